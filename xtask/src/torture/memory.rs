//! Memory that verbs take for the worst files of every format.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::PathBuf;

use super::night::Site;
use super::program::Ended;
use super::worst_files::{WorstFile, all};
use crate::page;

/// Lines around the table on the page about hostile files.
const MARKERS: [&str; 2] = ["<!-- memory -->", "<!-- end of memory -->"];

/// Number of files of each format that all verbs read: those for which the first verb takes most.
const WORST: usize = 10;

/// Word of a command line that stands for the file.
const FILE: &str = "{}";

/// Command lines of verbs that read scenes.
const SCENE_VERBS: &[&[&str]] = &[
    &["check", FILE],
    &[
        "render",
        FILE,
        "--spp",
        "1",
        "--size",
        "32x32",
        "-o",
        "picture.png",
        "-q",
    ],
    &["trace", FILE, "--pixel", "0,0"],
    &["export", "--mitsuba", FILE, "-o", "mitsuba"],
    &["export", "--pbrt", FILE, "-o", "pbrt"],
    &["new", FILE, "--yes", "-o", "new.lua"],
];

/// Command lines of verbs that read pictures.
const PICTURE_VERBS: &[&[&str]] = &[&["metric", FILE, FILE], &["diff", FILE, FILE]];

/// Options of the chore.
#[derive(clap::Args)]
pub struct Args {
    /// Program to measure; by default the one that was built beside this program
    #[arg(long, value_name = "FILE")]
    program: Option<PathBuf>,
    /// Write the table into the page about hostile files
    #[arg(long)]
    page: bool,
}

/// Measures the memory and prints the table.
///
/// # Errors
/// Returns the files that crash the program, or why nothing can be measured.
pub fn run(args: &Args) -> Result<(), String> {
    let program = crate::program(args.program.as_deref())?;
    let site = Site::new(&program.canonicalize().map_err(|e| e.to_string())?)?;
    let mut formats: BTreeMap<&str, Vec<WorstFile>> = BTreeMap::new();
    for file in all() {
        formats.entry(file.format()).or_default().push(file);
    }
    formats.remove("other");
    let mut peaks = BTreeMap::new();
    let mut crashes = BTreeSet::new();
    for (format, files) in &formats {
        let verbs = verbs(format);
        let mut worst = Vec::new();
        for file in files {
            worst.push((read(&site, file, verbs[0])?.memory, file));
        }
        worst.sort_by_key(|(memory, _)| std::cmp::Reverse(*memory));
        for (_, file) in worst.iter().take(WORST) {
            for verb in verbs {
                let ended = read(&site, file, verb)?;
                let peak = peaks.entry((title(verb), *format)).or_insert(0);
                *peak = ended.memory.max(*peak);
                // Rays meet all of millions of coincident triangles: that takes long and is no fault.
                if let Some(crash) = ended.crash().filter(|_| !ended.hung) {
                    crashes.insert(format!("`{}` of {}: {crash}", title(verb), file.name));
                }
            }
        }
    }
    let formats: Vec<&str> = formats.into_keys().collect();
    let table = table(&formats, &peaks);
    println!("{table}");
    if args.page {
        page::write(MARKERS, "memory", &table)?;
    }
    match crashes.is_empty() {
        true => Ok(()),
        false => Err(crashes.into_iter().collect::<Vec<_>>().join("\n")),
    }
}

/// Returns the command lines for a format.
fn verbs(format: &str) -> &'static [&'static [&'static str]] {
    match format {
        "picture" => PICTURE_VERBS,
        _ => SCENE_VERBS,
    }
}

/// Returns a verb with the option that selects what it does, for the table.
fn title(verb: &[&'static str]) -> String {
    let words = verb.iter().take_while(|word| **word != FILE);
    words.copied().collect::<Vec<_>>().join(" ")
}

/// Reads a file by a verb in a folder of its own.
fn read(site: &Site, file: &WorstFile, verb: &[&str]) -> Result<Ended, String> {
    let room = site.empty_room()?;
    for (name, bytes) in &file.files {
        room.write(name, bytes)?;
    }
    let (main, _) = &file.files[0];
    let arguments: Vec<&str> = verb
        .iter()
        .map(|word| if *word == FILE { main } else { *word })
        .collect();
    room.run(&arguments)
}

/// Returns the table of peaks in MiB in Markdown, a row for each verb.
fn table(formats: &[&str], peaks: &BTreeMap<(String, &str), u64>) -> String {
    let mut text = format!(
        "| verb | {} |\n|---|{}\n",
        formats.join(" | "),
        "--:|".repeat(formats.len())
    );
    for verb in SCENE_VERBS.iter().chain(PICTURE_VERBS) {
        let title = title(verb);
        let cell = |format: &&str| {
            let peak = peaks.get(&(title.clone(), *format));
            peak.map_or_else(String::new, |bytes| (bytes >> 20).to_string())
        };
        let cells: Vec<String> = formats.iter().map(cell).collect();
        // Writing to a string cannot fail.
        let _ = writeln!(text, "| `{title}` | {} |", cells.join(" | "));
    }
    text
}
