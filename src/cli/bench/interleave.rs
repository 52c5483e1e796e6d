//! Interleaved benchmark runs: disturbances of the machine affect all of them equally.

use lumbre_render::{Renderer, WaveStats};

/// Advances each run by `samples`, `rounds` times in turn, and returns `cost` for every round and
/// run. Compare runs by the ratio of their costs within one round.
///
/// # Errors
/// A message for the user if a run cannot be rendered.
pub fn interleaved(
    runs: &mut [Box<dyn Renderer>],
    rounds: usize,
    samples: u64,
    cost: impl Fn(&WaveStats) -> f64,
) -> Result<Vec<Vec<f64>>, String> {
    let mut advance = |run: &mut Box<dyn Renderer>| {
        run.advance(samples)
            .map(|wave| cost(&wave))
            .map_err(|e| e.to_string())
    };
    (0..rounds)
        .map(|_| runs.iter_mut().map(&mut advance).collect())
        .collect()
}
