//! Builds the targets of `fuzz/`, runs each for an equal processor time, makes its corpus small, and
//! states what the corpus reaches of the target's reader. Needs Linux.

mod records;

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::command::{cargo, execute, output};
use crate::{is_chosen, page, root};

/// Lines around the table on the page about hostile files.
const MARKERS: [&str; 2] = ["<!-- fuzz -->", "<!-- end of fuzz -->"];

/// Head of the table.
const HEAD: &str = "| target | inputs | accepted | processor time, min | most memory, MiB | \
                    lines of the reader reached | findings | measured |\n\
                    |---|--:|--:|--:|--:|--:|--:|---|\n";

/// Targets, and the starts of paths of the source files that read what they are given.
const READERS: [(&str, &[&str]); 14] = [
    ("checkpoint", &["crates/lumbre-render/src/cpu/films/"]),
    ("folder", &["crates/lumbre-scene-io/src/load/folder/"]),
    ("glb", &["crates/lumbre-scene-io/src/load/gltf/"]),
    ("gltf", &["crates/lumbre-scene-io/src/load/gltf/"]),
    (
        "image",
        &[
            "crates/lumbre-scene-io/src/load/images.rs",
            "crates/lumbre-scene-io/src/load/openexr.rs",
        ],
    ),
    ("lua", &["crates/lumbre-lua/src/scene/"]),
    ("mitsuba", &["crates/lumbre-scene-io/src/load/mitsuba/"]),
    ("mtl", &["crates/lumbre-scene-io/src/load/obj/mtl.rs"]),
    ("obj", &["crates/lumbre-scene-io/src/load/obj/"]),
    ("pbrt", &["crates/lumbre-scene-io/src/load/pbrt/"]),
    ("ply", &["crates/lumbre-scene-io/src/load/ply"]),
    (
        "rows",
        &["crates/lumbre-night/src/store/write/metrics_csv.rs"],
    ),
    ("scn", &["crates/lumbre-scene-io/src/load/scn/"]),
    (
        "serialized",
        &["crates/lumbre-scene-io/src/load/mitsuba/serialized.rs"],
    ),
];

/// The system that the targets are built for; named, so that flags of targets are not those of
/// procedural macros.
const SYSTEM: &str = "x86_64-unknown-linux-gnu";

/// Flags of the compiler with which libFuzzer sees the branches that an input takes.
const FUZZING: &str = "-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
                       -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
                       -Cllvm-args=-sanitizer-coverage-pc-table \
                       -Cllvm-args=-sanitizer-coverage-trace-compares --cfg fuzzing";

/// Flags with which a target writes the lines that it reaches.
const COVERAGE: &str = "-Cinstrument-coverage --cfg fuzzing";

/// Program that writes samples of all formats.
const SEEDS: &str = "seeds";

/// Largest input in bytes.
const LONGEST: u32 = 20_000;
/// Findings after which a target runs no more.
const MAX_FINDINGS: usize = 10;
/// Seconds after which an input counts as hanging.
const HANG: u32 = 60;
/// Processor time after which a target is started anew and its tally kept in a file, so that a chore
/// that is interrupted loses no more.
const SITTING: Duration = Duration::from_secs(300);

/// Options of the chore.
#[derive(clap::Args)]
pub struct Args {
    /// Processor time for each target in minutes; with `--page` in all, with what the repository
    /// records of earlier runs
    #[arg(long, default_value_t = 1.0)]
    minutes: f64,
    /// Run only targets whose name contains this text (repeat for more)
    #[arg(long, value_name = "TEXT")]
    only: Vec<String>,
    /// Number of targets that run at once; by default the number of processors
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
    /// Folder of the builds, the corpus, the findings and the tallies of targets that were
    /// interrupted: what lies there is continued
    #[arg(long, value_name = "DIR", default_value = "target/fuzz")]
    out: PathBuf,
    /// Continue the runs that the repository records, measure the lines that each corpus reaches,
    /// write the rows into the table of the page about hostile files, and record tallies and small
    /// corpora in fuzz/corpus
    #[arg(long)]
    page: bool,
}

/// What a target did.
#[derive(Clone, Default, Deserialize, Serialize)]
struct Tally {
    inputs: u64,
    /// Inputs that were accepted, of how many; counted in steps.
    accepted: [u64; 2],
    processor_time: Duration,
    /// Largest resident memory in MiB.
    memory: u64,
    /// Lines of the reader that the corpus reaches, of how many.
    lines: Option<[u64; 2]>,
    /// Files of inputs that crashed, hung or took too much memory.
    findings: Vec<PathBuf>,
}

/// Runs the targets and prints the table.
///
/// # Errors
/// Returns the findings, or why nothing can be run.
pub fn run(args: &Args) -> Result<(), String> {
    let chosen = |(name, _): &&(&str, &[&str])| is_chosen(&args.only, name);
    let targets: Vec<_> = READERS.iter().filter(chosen).collect();
    if targets.is_empty() {
        return Err("no target has such a name".to_owned());
    }
    make_folder(&args.out)?;
    let out = args.out.canonicalize().map_err(|e| e.to_string())?;
    let names: Vec<&str> = targets.iter().map(|(name, _)| *name).collect();
    let programs = build(&out.join("build"), FUZZING, &names)?;
    let readers = seed(&out, if args.page { &names } else { &[] })?;
    let readers = args.page.then_some(readers);
    let time = Duration::from_secs_f64((args.minutes * 60.0).clamp(1.0, 1e9));
    let records = root().join("fuzz/corpus");
    let queue = Mutex::new(targets.iter());
    let tallies = Mutex::new(BTreeMap::new());
    // A guard in the head of a loop would live through its body.
    let next = || lock(&queue).next();
    let processors = || std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        let work = || {
            while let Some((name, reader)) = next() {
                let target = |programs: &Path| Target {
                    name,
                    reader,
                    program: programs.join(name),
                    out: &out,
                    records: &records,
                };
                let fuzzed = target(&programs);
                let tally = fuzzed.complete(time, readers.as_deref().map(target));
                let mut done = lock(&tallies);
                done.insert(*name, tally.and_then(|tally| put(name, tally, args.page)));
            }
        };
        for _ in 0..args.jobs.unwrap_or_else(processors) {
            scope.spawn(work);
        }
    });
    finish(lock(&tallies).iter())
}

/// Writes the row of a target into the table if wanted: a chore that is interrupted keeps the rows of
/// the targets that ended.
fn put(name: &str, tally: Tally, to_page: bool) -> Result<Tally, String> {
    if to_page {
        page::put_rows(MARKERS, HEAD, &[row(name, &tally)])?;
    }
    Ok(tally)
}

fn lock<T>(of: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Prints the table, and returns what was found as an error.
fn finish<'a>(
    tallies: impl Iterator<Item = (&'a &'a str, &'a Result<Tally, String>)>,
) -> Result<(), String> {
    let (mut rows, mut problems) = (Vec::new(), Vec::new());
    for (name, tally) in tallies {
        match tally {
            Ok(tally) => {
                rows.push(row(name, tally));
                let findings = tally.findings.iter().map(|f| f.display().to_string());
                problems.extend(findings);
            }
            Err(problem) => problems.push(format!("{name}: {problem}")),
        }
    }
    println!("{HEAD}{}", rows.join("\n"));
    match problems.is_empty() {
        true => Ok(()),
        false => Err(problems.join("\n")),
    }
}

/// Returns a row of the table without its last cell.
fn row(name: &str, tally: &Tally) -> String {
    let part = |[some, all]: [u64; 2]| match all {
        0 => String::new(),
        _ => format!("{:.0} %", 100.0 * some as f64 / all as f64),
    };
    let lines = match tally.lines {
        Some(lines) => format!("{} of {}", part(lines), lines[1]),
        None => String::new(),
    };
    format!(
        "| `{name}` | {} | {} | {:.1} | {} | {lines} | {} |",
        tally.inputs,
        part(tally.accepted),
        tally.processor_time.as_secs_f64() / 60.0,
        tally.memory,
        tally.findings.len()
    )
}

/// Builds targets that write the lines that they reach, and writes the first inputs of all targets:
/// samples of their formats. Returns the folder of the programs.
fn seed(out: &Path, names: &[&str]) -> Result<PathBuf, String> {
    // With the flags of the targets, since other flags need a build of their own.
    let programs = build(&out.join("coverage"), COVERAGE, &[names, &[SEEDS]].concat())?;
    let mut command = Command::new(programs.join(SEEDS));
    command.env("LLVM_PROFILE_FILE", "/dev/null");
    execute(command.arg(out.join("corpus")))?;
    Ok(programs)
}

/// Builds targets with flags of the compiler, and returns the folder of the programs.
fn build(target: &Path, flags: &str, names: &[&str]) -> Result<PathBuf, String> {
    let mut command = cargo();
    command
        .current_dir(root().join("fuzz"))
        .env("CARGO_TARGET_DIR", target)
        .env("RUSTFLAGS", flags)
        .args(["build", "--locked", "--release", "--target", SYSTEM]);
    for name in names {
        command.args(["--bin", name]);
    }
    // The pass that counts branches is open to unstable compilers alone.
    execute(command.env("RUSTC_BOOTSTRAP", "1"))?;
    Ok(target.join(SYSTEM).join("release"))
}

/// A target that was built.
struct Target<'a> {
    name: &'a str,
    /// Starts of paths of the source files of its reader.
    reader: &'a [&'a str],
    program: PathBuf,
    /// Folder of the corpus and the findings of all targets.
    out: &'a Path,
    /// Folder of the repository with small corpora, and the tallies beside them.
    records: &'a Path,
}

impl Target<'_> {
    /// Runs the target for its processor time and makes its corpus small. With `coverage`, the same
    /// target that writes the lines it reaches, continues what the repository records, and records
    /// it again.
    fn complete(&self, time: Duration, coverage: Option<Target>) -> Result<Tally, String> {
        if coverage.is_some() {
            self.recall()?;
        }
        let mut tally = self.attack(time)?;
        self.minimise()?;
        if let Some(coverage) = coverage {
            tally.lines = Some(coverage.lines()?);
            self.record(&tally)?;
        }
        if_present(fs::remove_file(self.tally()))?;
        Ok(tally)
    }

    /// Runs the target until it took its processor time; a few findings do not end it.
    fn attack(&self, time: Duration) -> Result<Tally, String> {
        let findings = self.out.join("findings").join(self.name);
        make_folder(&findings)?;
        let mut tally = self.interrupted()?;
        let mut before = files(&findings)?;
        before.retain(|file| !tally.findings.contains(file));
        while tally.processor_time < time && tally.findings.len() < MAX_FINDINGS {
            let mut command = self.command();
            command
                .arg(self.corpus())
                .arg(format!("-artifact_prefix={}/", findings.display()));
            let rest = time.saturating_sub(tally.processor_time);
            let (status, text, spent) = end_after(&mut command, rest.min(SITTING))?;
            tally.processor_time += spent;
            tally.add(&text);
            let mut found = files(&findings)?;
            found.retain(|file| !before.contains(file) && !tally.findings.contains(file));
            if !status.success() && found.is_empty() {
                return Err(format!("{status}: {}", last_lines(&text)));
            }
            for file in found {
                if self.is_repeatable(&file)? {
                    tally.findings.push(file);
                } else {
                    if_present(fs::remove_file(file))?;
                }
            }
            let text = serde_json::to_string(&tally).map_err(|e| e.to_string())?;
            fs::write(self.tally(), text).map_err(|e| e.to_string())?;
        }
        Ok(tally)
    }

    /// Returns whether an input that was found hangs again. The clock of hanging goes on while a
    /// machine sleeps or the target is stopped. Other findings need no second run.
    fn is_repeatable(&self, file: &Path) -> Result<bool, String> {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        if !name.starts_with("timeout-") && !name.starts_with("slow-unit-") {
            return Ok(true);
        }
        let mut command = self.command();
        let ended = command.arg(file).stderr(Stdio::null()).status();
        Ok(!ended.map_err(|e| e.to_string())?.success())
    }

    /// Returns the tally that an interrupted chore left, or an empty one.
    fn interrupted(&self) -> Result<Tally, String> {
        let path = self.tally();
        match fs::read(&path) {
            Ok(text) => {
                serde_json::from_slice(&text).map_err(|e| format!("{}: {e}", path.display()))
            }
            Err(_) => Ok(Tally::default()),
        }
    }

    /// Returns the file of its tally while its time is not over.
    fn tally(&self) -> PathBuf {
        self.out.join(format!("{}.json", self.name))
    }

    /// Keeps those inputs of the corpus that reach different branches.
    fn minimise(&self) -> Result<(), String> {
        let corpus = self.corpus();
        let small = corpus.with_extension("small");
        make_folder(&small)?;
        let mut command = self.command();
        execute(
            command
                .arg("-merge=1")
                .arg(&small)
                .arg(&corpus)
                .stderr(Stdio::null()),
        )?;
        fs::remove_dir_all(&corpus)
            .and_then(|()| fs::rename(&small, &corpus))
            .map_err(|e| format!("{}: {e}", corpus.display()))
    }

    /// Returns how many lines of the reader the corpus reaches, and how many there are.
    fn lines(&self) -> Result<[u64; 2], String> {
        let raw = self.out.join(format!("{}.profraw", self.name));
        let merged = raw.with_extension("profdata");
        let mut command = self.command();
        command.args(files(&self.corpus())?);
        execute(command.env("LLVM_PROFILE_FILE", &raw).stderr(Stdio::null()))?;
        let mut merge = Command::new(llvm_tool("llvm-profdata")?);
        execute(
            merge
                .args(["merge", "-sparse", "-o"])
                .arg(&merged)
                .arg(&raw),
        )?;
        let mut export = Command::new(llvm_tool("llvm-cov")?);
        export.args(["export", "--summary-only", "--instr-profile"]);
        let summary = output(export.arg(&merged).arg(&self.program))?;
        let all: Value = serde_json::from_slice(&summary).map_err(|e| format!("llvm-cov: {e}"))?;
        let mut sums = [0, 0];
        for file in all["data"][0]["files"].as_array().into_iter().flatten() {
            let path = file["filename"].as_str().unwrap_or_default();
            let lines = &file["summary"]["lines"];
            if self.reader.iter().any(|start| path.contains(start)) {
                sums[0] += lines["covered"].as_u64().unwrap_or_default();
                sums[1] += lines["count"].as_u64().unwrap_or_default();
            }
        }
        match sums {
            [_, 0] => Err("no source file of its reader is in the program".to_owned()),
            sums => Ok(sums),
        }
    }

    /// Returns the command that runs the target with the limits of an input.
    fn command(&self) -> Command {
        let mut command = Command::new(&self.program);
        command
            .current_dir(self.out)
            .arg(format!("-max_len={LONGEST}"))
            .arg(format!("-timeout={HANG}"))
            .arg(format!("-report_slow_units={HANG}"))
            .args(["-print_final_stats=1", "-handle_usr1=1"]);
        // The files that a target writes live in memory where that is possible.
        if Path::new("/dev/shm").is_dir() {
            command.env("TMPDIR", "/dev/shm");
        }
        command
    }

    /// Returns the folder of its inputs.
    fn corpus(&self) -> PathBuf {
        self.out.join("corpus").join(self.name)
    }
}

impl Tally {
    /// Adds what a run of the target printed.
    fn add(&mut self, text: &str) {
        let number = |name: &str| {
            let line = text.lines().rev().find_map(|l| l.strip_prefix(name));
            line.and_then(|l| l.trim().parse::<u64>().ok())
        };
        self.inputs += number("stat::number_of_executed_units:").unwrap_or_default();
        self.memory = self
            .memory
            .max(number("stat::peak_rss_mb:").unwrap_or_default());
        let counts = text.lines().rev().find_map(|line| {
            let (accepted, tried) = line.strip_prefix("accepted: ")?.split_once(" of ")?;
            Some([accepted.parse().ok()?, tried.parse().ok()?])
        });
        let [accepted, tried]: [u64; 2] = counts.unwrap_or_default();
        self.accepted[0] += accepted;
        self.accepted[1] += tried;
    }
}

/// Returns a tool of the compiler's own LLVM.
fn llvm_tool(name: &str) -> Result<PathBuf, String> {
    let printed = output(Command::new("rustc").args(["--print", "sysroot"]))?;
    let root = PathBuf::from(String::from_utf8_lossy(&printed).trim());
    let tool = root.join("lib/rustlib").join(SYSTEM).join("bin").join(name);
    match tool.is_file() {
        true => Ok(tool),
        false => Err(format!(
            "{name} is missing: `rustup component add llvm-tools`"
        )),
    }
}

/// Runs a command, asks it to end after a processor time, and returns how it ended, its messages
/// and its processor time.
fn end_after(
    command: &mut Command,
    time: Duration,
) -> Result<(ExitStatus, String, Duration), String> {
    let mut child = command
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|e| format!("cannot start {command:?}: {e}"))?;
    let messages = child.stderr.take().map(BufReader::new);
    let reader = std::thread::Builder::new()
        .name("messages".to_owned())
        .spawn(move || messages.map(kept).unwrap_or_default())
        .map_err(|e| e.to_string())?;
    let (mut spent, mut is_asked) = (Duration::ZERO, false);
    let status = loop {
        if let Some(status) = child.try_wait().map_err(|e| e.to_string())? {
            break status;
        }
        spent = processor_time(&child).unwrap_or(spent);
        if spent >= time && !is_asked {
            is_asked = true;
            execute(Command::new("kill").args(["-USR1", &child.id().to_string()]))?;
        }
        std::thread::sleep(Duration::from_millis(100));
    };
    let text = reader.join().unwrap_or_default();
    Ok((status, text, spent))
}

/// Reads messages to their end, and returns those that are not about new inputs.
fn kept(messages: impl Read) -> String {
    let lines = BufReader::new(messages).split(b'\n').map_while(Result::ok);
    let lines = lines.map(|line| String::from_utf8_lossy(&line).into_owned());
    let told: Vec<String> = lines.filter(|line| !line.starts_with('#')).collect();
    told.join("\n")
}

/// Returns the processor time of a process so far, from the fields 14 and 15 of its `stat` in
/// hundredths of a second.
fn processor_time(child: &Child) -> Option<Duration> {
    let stat = fs::read_to_string(format!("/proc/{}/stat", child.id())).ok()?;
    let (_, rest) = stat.rsplit_once(')')?;
    let ticks = rest.split_whitespace().skip(11).take(2);
    let ticks: u64 = ticks.map(|t| t.parse::<u64>().unwrap_or_default()).sum();
    Some(Duration::from_millis(10 * ticks))
}

/// Returns the problem of an operation on a file, unless the file does not exist.
fn if_present<T>(result: std::io::Result<T>) -> Result<(), String> {
    match result {
        Err(e) if e.kind() != ErrorKind::NotFound => Err(e.to_string()),
        _ => Ok(()),
    }
}

fn make_folder(path: &Path) -> Result<(), String> {
    fs::create_dir_all(path).map_err(|e| format!("{}: {e}", path.display()))
}

/// Returns the files of a folder in order.
fn files(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let entries = fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut files: Vec<PathBuf> = entries.flatten().map(|e| e.path()).collect();
    files.sort();
    Ok(files)
}

/// Returns the last lines of messages in one.
fn last_lines(text: &str) -> String {
    let lines: Vec<&str> = text.lines().rev().take(4).collect();
    lines.into_iter().rev().collect::<Vec<_>>().join(" / ")
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;

    #[test]
    fn every_target_has_a_reader_whose_files_exist() {
        let of_folder = files(&root().join("fuzz/fuzz_targets")).unwrap();
        let stem = |path: &PathBuf| path.file_stem().unwrap().to_string_lossy().into_owned();
        let targets: Vec<String> = of_folder.iter().map(stem).collect();
        let readers: Vec<&str> = READERS.iter().map(|r| r.0).collect();
        assert_eq!(targets, readers);
        for start in READERS.iter().flat_map(|r| r.1) {
            let path = root().join(start);
            assert!(
                path.exists() || path.with_extension("rs").exists(),
                "{start}"
            );
        }
    }

    #[test]
    fn an_input_hangs_only_if_it_hangs_again() {
        let is_repeatable = |program: &str, file: &str| {
            let target = Target {
                name: "any",
                reader: &[],
                program: program.into(),
                out: Path::new("/"),
                records: Path::new("/"),
            };
            target.is_repeatable(Path::new(file)).unwrap()
        };
        for name in ["timeout-1", "slow-unit-1"] {
            assert!(!is_repeatable("/bin/true", name), "{name}");
            assert!(is_repeatable("/bin/false", name), "{name}");
        }
        assert!(is_repeatable("/bin/true", "crash-1"));
    }

    #[test]
    fn counts_are_read_from_the_messages_of_a_target() {
        let mut tally = Tally::default();
        for _ in 0..2 {
            tally.add(
                "accepted: 10 of 4096\naccepted: 30 of 8192\nstat::number_of_executed_units: 9000\n\
                 stat::peak_rss_mb:              91\n",
            );
        }
        assert_eq!((tally.inputs, tally.memory), (18_000, 91));
        assert_eq!(tally.accepted, [60, 16_384]);
    }
}
