//! Plants bugs in a copy of the code, and shows which tests catch them. The list is in
//! `xtask/bugs/`; CONTRIBUTING.md has its format.

mod list;
mod place;
#[cfg(test)]
mod tests;
mod tree;
mod trial;

use std::fmt::Write;
use std::path::PathBuf;
use std::time::Instant;

use list::Bug;
use trial::{End, Trials};

/// Sources of crates, as starts of paths.
const LIGHT: &str = "crates/lumbre-light/";
const METRICS: &str = "crates/lumbre-metrics/";
const RENDER: &str = "crates/lumbre-render/";
const VULKAN: &str = "crates/lumbre-vulkan/";

/// Test binaries with starts of paths of the sources that they are built from, quickest first.
/// `--all` runs them in this order.
const ALL: [(&str, &[&str]); 14] = [
    ("lumbre", &[""]),
    ("lumbre_night", &[""]),
    ("lumbre_scene_io", &[""]),
    ("lumbre_lua", &[""]),
    ("lumbre_report", &[""]),
    ("lumbre_tui", &[""]),
    ("lumbre_metrics", &[LIGHT, METRICS]),
    ("lumbre_light", &[LIGHT]),
    ("lumbre_render", &[LIGHT, RENDER]),
    ("lumbre_vulkan", &[LIGHT, RENDER, VULKAN]),
    ("library", &[""]),
    ("program", &[""]),
    ("light", &[LIGHT, RENDER]),
    ("device", &[""]),
];

/// Options of the chore.
#[derive(clap::Args)]
pub struct Args {
    /// Bugs to plant, by name, start of the name, or room; by default all
    bugs: Vec<String>,
    /// Print the bugs with their kinds and tests, and do nothing else
    #[arg(long)]
    list: bool,
    /// Check that the block of each bug is found once, without building anything
    #[arg(long, conflicts_with = "list")]
    check: bool,
    /// Run all tests with the bugs that the named tests do not catch, until one fails
    #[arg(long)]
    all: bool,
    /// File for a table of the results, in Markdown
    #[arg(long, value_name = "FILE")]
    table: Option<PathBuf>,
}

/// What became of a bug.
enum Verdict {
    /// A test failed, or hung.
    Caught(String),
    /// The named tests, or with `--all` all tests, passed.
    Missed,
    /// The named tests fail without the bug as well.
    Unclear(String),
}

/// Plants the bugs and runs their tests.
///
/// # Errors
/// Returns a message if the list is wrong, if the copy cannot be built, or if a test misses a bug
/// that it should catch.
pub fn run(args: &Args) -> Result<(), String> {
    let bugs = list::read(&crate::root().join("xtask/bugs"))?;
    let chosen: Vec<&Bug> = bugs.iter().filter(|bug| is_chosen(args, bug)).collect();
    if chosen.is_empty() {
        return Err(format!(
            "no bug is called {}: see --list",
            args.bugs.join(" or ")
        ));
    }
    if args.list {
        chosen.iter().for_each(|bug| print_bug(bug));
        return Ok(());
    }
    let sources = place::sources(&crate::root())?;
    let edits = place::place(&bugs, &sources)?;
    if args.check {
        println!("{} bugs, each found once", bugs.len());
        return Ok(());
    }
    let planted = place::planted(&bugs, &sources, &edits);
    tree::write(&planted)?;
    let start = Instant::now();
    let mut trials = Trials::new(tree::build()?);
    println!("built in {:.0} s", start.elapsed().as_secs_f64());
    trials.check(chosen.iter().flat_map(|bug| &bug.caught))?;
    let mut table = String::from("| bug | room | kind | verdict | s |\n|---|---|---|---|--:|\n");
    let (mut caught, mut wrong) = (0, Vec::new());
    for bug in &chosen {
        let start = Instant::now();
        // Tests rewrite generated files that a bug changes.
        tree::write(&planted)?;
        let own = edits.iter().filter(|edit| bugs[edit.bug].name == bug.name);
        let paths: Vec<&str> = own.map(|edit| sources[edit.source].path.as_str()).collect();
        let verdict = try_bug(args, &mut trials, bug, &paths)?;
        let seconds = start.elapsed().as_secs_f64();
        caught += u32::from(matches!(verdict, Verdict::Caught(_)));
        if verdict.disagrees(bug) {
            wrong.push(bug.name.as_str());
        }
        let text = verdict.describe(bug);
        println!("{}: {text} ({seconds:.1} s)", bug.name);
        // A `String` can always be written to.
        let _ = writeln!(
            table,
            "| {} | {} | {} | {text} | {seconds:.1} |",
            bug.name, bug.room, bug.kind
        );
    }
    let share = 100.0 * f64::from(caught) / chosen.len() as f64;
    println!("{caught} of {} bugs caught ({share:.0} %)", chosen.len());
    if let Some(path) = &args.table {
        std::fs::write(path, table).map_err(|e| format!("{}: {e}", path.display()))?;
    }
    match wrong.is_empty() {
        true => Ok(()),
        false => Err(format!(
            "the lines `caught` of these bugs are wrong: {}",
            wrong.join(", ")
        )),
    }
}

/// Returns whether a bug is chosen on the command line.
fn is_chosen(args: &Args, bug: &Bug) -> bool {
    let named = |text: &String| bug.room == *text || bug.name.starts_with(text.as_str());
    args.bugs.is_empty() || args.bugs.iter().any(named)
}

/// Prints the entry of a bug, without its code.
fn print_bug(bug: &Bug) {
    println!(
        "{} ({}, {}), LUMBRE_BUG={}",
        bug.name,
        bug.room,
        bug.kind,
        bug.number()
    );
    bug.caught.iter().for_each(|call| println!("  {call}"));
}

/// Runs the tests of a bug until one fails. `paths` are those of the sources that it changes.
fn try_bug(args: &Args, trials: &mut Trials, bug: &Bug, paths: &[&str]) -> Result<Verdict, String> {
    for call in &bug.caught {
        let (without, time) = trials.without_bug(call)?;
        if without != End::Passed {
            let how = format!("without the bug {}", without.describe(call));
            return Ok(Verdict::Unclear(how));
        }
        let end = trials.with_bug(call, bug, time)?;
        if end != End::Passed {
            return Ok(Verdict::Caught(end.describe(call)));
        }
    }
    let is_built_from = |starts: &[&str]| {
        let mut all = paths
            .iter()
            .flat_map(|path| starts.iter().map(move |s| (path, s)));
        all.any(|(path, start)| path.starts_with(start))
    };
    let others = ALL
        .iter()
        .filter(|(_, starts)| args.all && is_built_from(starts));
    for (binary, _) in others {
        if let Some(how) = trials.find_failure(binary, bug)? {
            return Ok(Verdict::Caught(how));
        }
    }
    Ok(Verdict::Missed)
}

impl Verdict {
    /// Returns whether the verdict is not what the entry of the bug states.
    fn disagrees(&self, bug: &Bug) -> bool {
        match self {
            Self::Caught(_) => bug.caught.is_empty(),
            Self::Missed => !bug.caught.is_empty(),
            Self::Unclear(_) => true,
        }
    }

    /// Describes the verdict in words.
    fn describe(&self, bug: &Bug) -> String {
        match self {
            Self::Caught(how) => format!("caught: {how}"),
            Self::Missed if bug.caught.is_empty() => "not caught, as listed".to_owned(),
            Self::Missed => "NOT CAUGHT".to_owned(),
            Self::Unclear(how) => format!("UNCLEAR: {how}"),
        }
    }
}
