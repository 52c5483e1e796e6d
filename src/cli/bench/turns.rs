//! Runs that take turns, so that what slows the machine slows all of them and ratios are of one turn.

use crate::render::{Renderer, WaveStats};

/// What each of some runs takes to add `samples`, turn by turn.
///
/// # Errors
/// When one cannot be rendered, with a message for people.
pub fn in_turns(
    runs: &mut [Box<dyn Renderer>],
    turns: usize,
    samples: u64,
    cost: impl Fn(&WaveStats) -> f64,
) -> Result<Vec<Vec<f64>>, String> {
    let mut one = |run: &mut Box<dyn Renderer>| run.advance(samples).map(|wave| cost(&wave)).map_err(|e| e.to_string());
    (0..turns).map(|_| runs.iter_mut().map(&mut one).collect()).collect()
}
