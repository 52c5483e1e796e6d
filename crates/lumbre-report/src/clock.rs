//! Caveats on the clock of runs that are compared by render time.

use std::collections::BTreeMap;

use lumbre_night::experiment::spec::Order;
use lumbre_night::text::counted;

/// Share of the time of a run that other work on the machine may take without a sentence.
const MAX_LOST: f64 = 0.05;

/// Runs of one technique.
#[derive(Default)]
struct Clocks {
    runs: u64,
    disturbed: u64,
    unwatched: u64,
    /// Greatest share of a run's time that was lost.
    most_lost: f64,
}

/// Returns sentences on clocks that other work on the machine disturbed or that nothing watched,
/// and on the order of techniques. Each finished run has the label of its technique and its
/// [`Run::lost_share`](lumbre_night::experiment::night::run::Run::lost_share).
pub fn caveats<'a>(runs: impl Iterator<Item = (&'a str, Option<f64>)>, order: &str) -> Vec<String> {
    let mut techniques: BTreeMap<&str, Clocks> = BTreeMap::new();
    for (label, lost_share) in runs {
        let clocks = techniques.entry(label).or_default();
        clocks.runs += 1;
        match lost_share {
            None => clocks.unwatched += 1,
            Some(lost) => {
                clocks.disturbed += u64::from(lost > MAX_LOST);
                clocks.most_lost = clocks.most_lost.max(lost);
            }
        }
    }
    let disturbed = techniques.iter().filter(|(_, c)| c.disturbed > 0);
    let disturbed: Vec<String> = disturbed
        .map(|(label, clocks)| {
            format!(
                "{} of {} of {label} (up to {:.0} % of the time)",
                clocks.disturbed,
                counted(clocks.runs, "run"),
                100.0 * clocks.most_lost
            )
        })
        .collect();
    let unwatched = techniques.iter().filter(|(_, c)| c.unwatched > 0);
    let unwatched: Vec<&str> = unwatched.map(|(label, _)| *label).collect();
    let mut sentences = Vec::new();
    if !disturbed.is_empty() {
        sentences.push(format!(
            "Other work on the machine, or a stop of the process, took time from {}. Render times do not \
             contain it; they contain the effect of other work on caches.",
            disturbed.join(", ")
        ));
    }
    if !unwatched.is_empty() {
        sentences.push(format!(
            "Whether other work on the machine slowed {} could not be watched: devices, other programs and \
             some systems do not tell how long threads waited for a processor.",
            unwatched.join(", ")
        ));
    }
    if techniques.len() > 1 && !order.is_empty() && order != Order::Interleave.name() {
        sentences.push(format!(
            "Techniques did not take turns (`order = \"{order}\"`), so a change of the machine's speed during the \
             night affects some more than others."
        ));
    }
    sentences
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn disturbed_and_unwatched_clocks_are_named_and_quiet_ones_are_not() {
        let of = |a: Option<f64>, b: Option<f64>, order: &str| {
            let runs = [("nee", Some(0.01)), ("nee", a), ("bdpt", b)];
            caveats(runs.into_iter(), order)
        };
        assert!(of(Some(0.0), Some(0.04), "interleave").is_empty());
        let found = of(Some(0.5), Some(0.0), "interleave");
        assert_eq!(found.len(), 1);
        assert!(
            found[0].contains("1 of 2 runs of nee (up to 50 % of the time)"),
            "{found:?}"
        );
        let found = of(Some(0.0), None, "sequential");
        assert!(
            found[0].contains("slowed bdpt could not be watched"),
            "{found:?}"
        );
        assert!(found[1].contains("order = \"sequential\""), "{found:?}");
    }
}
