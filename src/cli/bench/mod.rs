//! `lumbre bench`: the program measuring itself. Figures, never pass or fail: machines are shared and noisy.

mod night;
mod rates;

use std::path::PathBuf;
use std::process::Command;
use std::time::Instant;

use serde_json::{Value as Json, json};

use crate::cli::builtin::{BuiltIn, short};
use crate::math::stats::median;

/// Repetitions of every measurement; the median is reported.
const REPEATS: usize = 5;

/// Everything that was measured, ready to print or to save.
pub struct Report {
    json: Json,
    text: String,
}

impl Report {
    /// The table for people.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The same figures as JSON.
    pub fn json(&self) -> &Json {
        &self.json
    }
}

/// Measures the built-in scenes, the given ones, and the program's own
/// overheads. `say` hears what is being measured.
///
/// # Errors
/// When a given scene cannot be loaded or rendered, with a message for people.
pub fn measure(given: &[PathBuf], threads: usize, say: &mut dyn FnMut(&str)) -> Result<Report, String> {
    let built_in = BuiltIn::unpack()?;
    let scenes: Vec<PathBuf> = built_in.scenes().into_iter().chain(given.iter().cloned()).collect();
    let mut rows = Vec::new();
    for scene in &scenes {
        say(&format!("measuring {}", short(scene)));
        rows.push(rates::measure(scene, threads, REPEATS)?);
    }
    say("measuring the program's own overheads");
    let start_up_s = start_up_s();
    let plan_s = night::plan_10_000_cells_s()?;
    let outside = scenes.first().map(|s| night::share_outside_advance(s, threads)).transpose()?;

    let mut text = rates::table(&rows);
    text += "\n";
    text += &format!("start-up (--version)                 {:>9.1} ms\n", start_up_s * 1e3);
    text += &format!("plan of 10,000 cells                 {:>9.3} s\n", plan_s);
    if let Some(share) = outside {
        text += &format!("time outside `advance`, 4 s cell     {:>9.2} %\n", share * 100.0);
    }
    let json = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "threads": if threads == 0 { std::thread::available_parallelism().map_or(1, usize::from) } else { threads },
        "repeats": REPEATS,
        "scenes": rows.iter().map(rates::Row::to_json).collect::<Vec<_>>(),
        "start_up_s": start_up_s,
        "plan_10000_cells_s": plan_s,
        "share_outside_advance": outside,
    });
    Ok(Report { json, text })
}

/// Seconds from starting this program to its end when it has nothing to do.
fn start_up_s() -> f64 {
    let Ok(program) = std::env::current_exe() else { return f64::NAN };
    median((0..2 * REPEATS + 1).map(|_| {
        let start = Instant::now();
        match Command::new(&program).arg("--version").output() {
            Ok(_) => start.elapsed().as_secs_f64(),
            Err(_) => f64::NAN,
        }
    }))
}
