//! Log messages about the ends of runs.

use crate::tui::format;
use lumbre_night::experiment::outcome::Level;
use lumbre_night::experiment::{Outcome, WaveRow};

/// Formats the log message about the end of a run; cached runs have none.
pub fn end_message(outcome: &Outcome, last: Option<&WaveRow>) -> (Level, Option<String>) {
    let after = last.map_or_else(String::new, |row| {
        let (samples, time) = (format::count(row.samples), format::duration(row.render_s));
        format!(" after {samples} spp in {time}")
    });
    match outcome {
        Outcome::Done(cause) => {
            // A limit of time or samples is what the line begins with.
            let rule = match cause.is_limit && last.is_some() {
                true => String::new(),
                false => format!(" (stop rule: {})", cause.clause),
            };
            (Level::Info, Some(format!("done{after}{rule}")))
        }
        Outcome::Failed(reason) => (Level::Error, Some(format!("failed{after}: {reason}"))),
        Outcome::Interrupted => (Level::Warn, Some(format!("interrupted{after}"))),
        Outcome::Cached(_) => (Level::Info, None),
    }
}
