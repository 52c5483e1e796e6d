//! Attacks the program and counts what it noticed, what did no harm, and what got past it: kills,
//! damaged files, limits, terminals, clocks, hostile scripts and scenes. Needs Unix, no network
//! and no privileges; everything happens below one temporary folder.

mod damage;
mod files;
mod kills;
mod limits;
pub mod memory;
mod mutation;
mod night;
mod program;
mod scripts;
mod worst_files;

use std::fmt::Write;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use crate::random::Random;
use mutation::Extent;
use night::Site;

use crate::{is_chosen, page};

/// Lines around the table of the last long run on the page about hostile files.
const MARKERS: [&str; 2] = ["<!-- torture -->", "<!-- end of torture -->"];

/// Head of the table.
const HEAD: &str = "| attack | an attempt | tried | noticed | harmless | failed | measured |\n\
                    |---|---|--:|--:|--:|--:|---|\n";

/// Number of failures of an attack that are printed.
const PRINTED: usize = 10;

/// Extent of the changes of a text.
const EXTENT: Extent = Extent {
    changes: 4,
    copies: 500,
};

/// Options of the chore.
#[derive(clap::Args)]
pub struct Args {
    /// Minutes to spend, divided evenly among the attacks
    #[arg(long, default_value_t = 60.0)]
    minutes: f64,
    /// Make this many attempts with each attack instead, however long they take
    #[arg(long, value_name = "N", conflicts_with = "minutes")]
    attempts: Option<u32>,
    /// Seed of all random choices; an attempt is a function of seed, attack and number
    #[arg(long, default_value_t = 1)]
    seed: u32,
    /// Number of the first attempt, to repeat one that failed
    #[arg(long, default_value_t = 0)]
    first: u32,
    /// Attack only with those whose name contains this text (repeat for more)
    #[arg(long, value_name = "TEXT")]
    only: Vec<String>,
    /// Program to attack; by default the one that was built beside this program
    #[arg(long, value_name = "FILE")]
    program: Option<PathBuf>,
    /// Write the rows into the table of the page about hostile files
    #[arg(long)]
    page: bool,
}

/// Result of an attempt.
enum Verdict {
    /// The program said what is wrong, and the results of a repair are those of an undisturbed
    /// night.
    Noticed,
    /// All results are those of an undisturbed night.
    Harmless,
    /// The attack is impossible on this machine, for this reason.
    Skipped(&'static str),
    /// The program crashed, hung, or took or gave other results in silence.
    Failed(String),
}

/// A way to attack the program.
struct Attack {
    name: &'static str,
    /// What an attempt does, for the table.
    description: &'static str,
    /// Makes one attempt. An error is a fault of the machine, and ends the chore.
    attempt: fn(&Site, &mut Random) -> Result<Verdict, String>,
}

/// All attacks.
const ATTACKS: &[Attack] = &[
    Attack {
        name: "kill",
        description: "20 kills of one to four processes, all orders; every file compared",
        attempt: kills::kill,
    },
    Attack {
        name: "signal",
        description: "a signal at a random instant, then the night again",
        attempt: kills::signal,
    },
    Attack {
        name: "clock",
        description: "a night killed under a clock that is days off, then resumed",
        attempt: kills::clock,
    },
    Attack {
        name: "changed bytes",
        description: "one to eight bytes of a file of a night, its size kept",
        attempt: damage::changed,
    },
    Attack {
        name: "cut file",
        description: "a file of a night cut at a random place",
        attempt: damage::cut,
    },
    Attack {
        name: "removed file",
        description: "a file of a night removed",
        attempt: damage::removed,
    },
    Attack {
        name: "exchanged files",
        description: "two files of one name exchanged",
        attempt: damage::exchanged,
    },
    Attack {
        name: "pipe",
        description: "a pipe in place of a file",
        attempt: damage::pipe,
    },
    Attack {
        name: "full disk",
        description: "a limit on the size of files, then the night again without it",
        attempt: limits::file_size,
    },
    Attack {
        name: "open files",
        description: "a limit on open files, then the night again without it",
        attempt: limits::open_files,
    },
    Attack {
        name: "terminal",
        description: "a terminal of 0 to 65,535 rows and columns",
        attempt: limits::terminal,
    },
    Attack {
        name: "script",
        description: "a hostile script, planned",
        attempt: scripts::hostile,
    },
    Attack {
        name: "changed script",
        description: "a shipped script with changed tokens and lines, planned",
        attempt: scripts::changed,
    },
    Attack {
        name: "scene",
        description: "a scene or picture of any format with changed tokens, lines or bytes, read",
        attempt: files::changed,
    },
];

/// Counts of the attempts of an attack.
#[derive(Default)]
struct Tally {
    tried: u32,
    noticed: u32,
    harmless: u32,
    skipped: Option<&'static str>,
    failed: Vec<String>,
    spent: Duration,
}

impl Tally {
    fn add(&mut self, attempt: u32, verdict: Verdict) {
        self.tried += 1;
        match verdict {
            Verdict::Noticed => self.noticed += 1,
            Verdict::Harmless => self.harmless += 1,
            Verdict::Skipped(reason) => {
                self.tried -= 1;
                self.skipped = Some(reason);
            }
            Verdict::Failed(problem) => self.failed.push(format!("attempt {attempt}: {problem}")),
        }
    }
}

/// Attacks until the time is over, and prints the table.
///
/// # Errors
/// Returns a message if the program cannot be started or something got past it.
pub fn run(args: &Args) -> Result<(), String> {
    // Absolute, since it is started in other folders.
    let program = crate::program(args.program.as_deref())?;
    let site = Site::new(&program.canonicalize().map_err(|e| e.to_string())?)?;
    let chosen = |attack: &&Attack| is_chosen(&args.only, attack.name);
    let attacks: Vec<&Attack> = ATTACKS.iter().filter(chosen).collect();
    if attacks.is_empty() {
        return Err("no attack has such a name".to_owned());
    }
    let mut tallies: Vec<Tally> = attacks.iter().map(|_| Tally::default()).collect();
    let time = match args.attempts {
        Some(_) => Duration::MAX,
        None => Duration::from_secs_f64((args.minutes * 60.0).clamp(0.0, 1e9)),
    };
    let is_open = |tally: &Tally| {
        let is_short = args.attempts.is_none_or(|attempts| tally.tried < attempts);
        tally.skipped.is_none() && is_short
    };
    let start = Instant::now();
    while start.elapsed() < time {
        let open = (0..attacks.len()).filter(|i| is_open(&tallies[*i]));
        let Some(next) = open.min_by_key(|i| tallies[*i].spent) else {
            break;
        };
        let tally = &mut tallies[next];
        let index = ATTACKS.iter().position(|a| a.name == attacks[next].name);
        let attempt = args.first + tally.tried;
        let mut random = Random::new([args.seed, index.unwrap_or_default() as u32, attempt]);
        let begun = Instant::now();
        let verdict = (attacks[next].attempt)(&site, &mut random)?;
        tally.spent += begun.elapsed();
        tally.add(attempt, verdict);
    }
    let rows = rows(&attacks, &tallies);
    println!("{HEAD}{}", rows.join("\n"));
    if args.page {
        let with_seed = |row: &String| format!("{row} seed {},", args.seed);
        page::put_rows(
            MARKERS,
            HEAD,
            &rows.iter().map(with_seed).collect::<Vec<_>>(),
        )?;
    }
    failures(&attacks, &tallies)
}

/// Returns the rows of the table in Markdown, without their last cell.
fn rows(attacks: &[&Attack], tallies: &[Tally]) -> Vec<String> {
    let row = |(attack, tally): (&&Attack, &Tally)| {
        let counts = match tally.skipped {
            Some(reason) => format!("skipped: {reason} | | |"),
            None => format!(
                "{} | {} | {} | {}",
                tally.tried,
                tally.noticed,
                tally.harmless,
                tally.failed.len()
            ),
        };
        format!("| {} | {} | {counts} |", attack.name, attack.description)
    };
    attacks.iter().zip(tallies).map(row).collect()
}

/// Returns an error that lists what got past the program.
fn failures(attacks: &[&Attack], tallies: &[Tally]) -> Result<(), String> {
    let mut text = String::new();
    for (attack, tally) in attacks.iter().zip(tallies) {
        for problem in tally.failed.iter().take(PRINTED) {
            // Writing to a string cannot fail.
            let _ = write!(text, "\n{}, {problem}", attack.name);
        }
    }
    if text.is_empty() {
        Ok(())
    } else {
        Err(format!("attacks that got past the program:{text}"))
    }
}
