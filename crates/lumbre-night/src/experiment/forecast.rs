//! Forecast of the remaining time of a night, from the throughput of similar runs.
//!
//! The time of a run that has not started is estimated from finished runs of the same technique on
//! the same scene at the same or the nearest depth, else from its sample of the smoke pass, else
//! from the same technique on other scenes. A time limit needs no such estimate. If other clauses
//! of the stop rule can end a run earlier, a similar run with the same rule shows when they did.

use std::collections::BTreeMap;

use super::WaveRow;
use super::outcome::CellRef;
use super::plan::Plan;
use super::stop::StopRule;
use lumbre_render::Settings;

/// Properties of a run by which throughputs are looked up.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct WorkloadKey {
    /// Name of the integrator.
    pub integrator: String,
    /// Scene as written in the script.
    pub scene: String,
    /// Name of the backend.
    pub backend: String,
    /// Greatest number of path edges.
    pub max_depth: u32,
}

impl WorkloadKey {
    /// Returns the key of a run.
    pub fn from_config(config: &Settings) -> WorkloadKey {
        WorkloadKey {
            integrator: config.integrator.clone(),
            scene: config.scene.clone(),
            backend: config.backend.clone(),
            max_depth: config.max_depth.unwrap_or(0),
        }
    }

    /// Distance of two keys in depth: the absolute logarithm of the quotient of their depths.
    fn depth_distance(&self, other: &WorkloadKey) -> f64 {
        (f64::from(self.max_depth.max(1)) / f64::from(other.max_depth.max(1)))
            .ln()
            .abs()
    }
}

/// Measured throughput of one run.
#[derive(Clone, Debug, PartialEq)]
pub struct Throughput {
    /// Camera paths per second of render time.
    pub paths_per_s: f64,
    /// Seconds of render time until the run ended, and a description of its stop rule. `None` for a
    /// sample of the smoke pass.
    pub ended: Option<(f64, String)>,
    /// Wall-clock seconds per second of render time, at least 1.
    pub overhead: f64,
}

impl Throughput {
    /// Returns the throughput of a finished run by its last measurement; `None` if that has no
    /// paths or no render time.
    pub fn from_last_row(last: &WaveRow, rule: &StopRule) -> Option<Throughput> {
        let paths_per_s = last.paths as f64 / last.render_s;
        let known = last.paths > 0 && last.render_s > 0.0;
        known.then(|| Throughput {
            paths_per_s,
            ended: Some((last.render_s, rule.describe())),
            overhead: (last.wall_s / last.render_s).clamp(1.0, 10.0),
        })
    }
}

/// Throughputs of earlier runs by workload.
#[derive(Clone, Debug, Default)]
pub struct ThroughputHistory {
    runs: BTreeMap<WorkloadKey, Vec<Throughput>>,
    smoke_samples: BTreeMap<WorkloadKey, Throughput>,
}

/// Number of runs that are remembered for each workload, the newest ones.
const RUNS_PER_WORKLOAD: usize = 16;

impl ThroughputHistory {
    /// Adds a finished run.
    pub fn record(&mut self, key: WorkloadKey, throughput: Throughput) {
        let runs = self.runs.entry(key).or_default();
        if runs.len() >= RUNS_PER_WORKLOAD {
            runs.remove(0);
        }
        runs.push(throughput);
    }

    /// Adds a sample of the smoke pass, unless its rate is zero or not finite.
    pub fn record_smoke_sample(&mut self, key: WorkloadKey, paths_per_s: f64) {
        if paths_per_s > 0.0 && paths_per_s.is_finite() {
            self.smoke_samples.insert(
                key,
                Throughput {
                    paths_per_s,
                    ended: None,
                    overhead: 1.0,
                },
            );
        }
    }

    /// Returns the runs that are most similar to a workload, and whether the estimate is rough
    /// because they are of another scene or of the smoke pass.
    fn most_similar(&self, wanted: &WorkloadKey) -> (&[Throughput], bool) {
        if let Some(runs) = self.runs.get(wanted) {
            return (runs, false);
        }
        let same_scene = |key: &WorkloadKey| {
            (&key.integrator, &key.scene, &key.backend)
                == (&wanted.integrator, &wanted.scene, &wanted.backend)
        };
        let nearest = |fits: &dyn Fn(&WorkloadKey) -> bool| {
            let fitting = self.runs.iter().filter(|(key, _)| fits(key));
            fitting
                .min_by(|a, b| {
                    let [a, b] = [a.0, b.0].map(|key| key.depth_distance(wanted));
                    a.total_cmp(&b)
                })
                .map(|(_, runs)| runs.as_slice())
        };
        if let Some(runs) = nearest(&same_scene) {
            return (runs, false);
        }
        if let Some(sample) = self.smoke_samples.get(wanted) {
            return (std::slice::from_ref(sample), true);
        }
        let same_technique = |key: &WorkloadKey| {
            (&key.integrator, &key.backend) == (&wanted.integrator, &wanted.backend)
        };
        (nearest(&same_technique).unwrap_or_default(), true)
    }
}

/// Estimated time of one run or of several.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Forecast {
    /// Wall-clock seconds of the runs that can be estimated.
    pub seconds: f64,
    /// Whether this is an upper bound, because stop rules that cannot be predicted may end runs
    /// before their limits.
    pub at_most: bool,
    /// Whether part of it is estimated from runs of other scenes or from the smoke pass.
    pub rough: bool,
    /// Number of runs that are included.
    pub known: usize,
    /// Number of runs that cannot be estimated.
    pub unknown: usize,
}

impl Forecast {
    fn add(&mut self, run: Option<Forecast>) {
        match run {
            None => self.unknown += 1,
            Some(run) => {
                self.seconds += run.seconds;
                self.at_most |= run.at_most;
                self.rough |= run.rough;
                self.known += 1;
            }
        }
    }

    /// Qualifier of the estimate for people: `at most`, `roughly` or `about`.
    pub fn qualifier(&self) -> &'static str {
        match self {
            Forecast { at_most: true, .. } => "at most",
            Forecast { rough: true, .. } => "roughly",
            _ => "about",
        }
    }
}

/// Estimates the total time of those cells and references for which `is_open` is true, rendered one
/// after another. References from files take no time.
pub fn forecast(
    plan: &Plan,
    history: &ThroughputHistory,
    is_open: &dyn Fn(CellRef) -> bool,
) -> Forecast {
    let mut sum = Forecast::default();
    for (config, stop) in plan.runs(is_open) {
        sum.add(forecast_run(config, stop, history));
    }
    sum
}

/// Estimates the time of one run; `None` if nothing is known of it.
fn forecast_run(
    config: &Settings,
    stop: &StopRule,
    history: &ThroughputHistory,
) -> Option<Forecast> {
    let (similar, rough) = history.most_similar(&WorkloadKey::from_config(config));
    let mean = |value: &dyn Fn(&Throughput) -> f64| {
        similar.iter().map(value).sum::<f64>() / similar.len() as f64
    };
    let overhead = if similar.is_empty() {
        1.0
    } else {
        mean(&|run| run.overhead)
    };
    let rate = (!similar.is_empty()).then(|| {
        let [width, height] = config.resolution.unwrap_or([1, 1]);
        // Average times, not rates, so that slow runs have their full weight.
        1.0 / mean(&|run| 1.0 / run.paths_per_s) / (f64::from(width) * f64::from(height))
    });
    let (seconds, open) = limit_s(stop, rate)?;
    let rule = if open { stop.describe() } else { String::new() };
    let same_rule: Vec<f64> = similar
        .iter()
        .filter_map(|run| run.ended.as_ref())
        .filter(|(_, other)| *other == rule)
        .map(|(s, _)| *s)
        .collect();
    let at_most = open && same_rule.is_empty();
    let seconds = match seconds {
        _ if open && !same_rule.is_empty() => {
            same_rule.iter().sum::<f64>() / same_rule.len() as f64
        }
        Some(seconds) => seconds,
        None => return None,
    };
    let rough = rough && rate.is_some() && stop.time_limit_s() != Some(seconds);
    Some(Forecast {
        seconds: seconds * overhead,
        at_most,
        rough,
        known: 1,
        unknown: 0,
    })
}

/// Returns the seconds of render time after which the time and sample limits of a rule end a run,
/// if they do, and whether other clauses may end it earlier. `None` if a sample limit is needed but
/// `samples_per_s` is not known.
fn limit_s(rule: &StopRule, samples_per_s: Option<f64>) -> Option<(Option<f64>, bool)> {
    match rule {
        StopRule::Time(seconds) => Some((Some(*seconds), false)),
        StopRule::Samples(samples) => {
            samples_per_s.map(|rate| (Some(*samples as f64 / rate), false))
        }
        StopRule::Any(parts) => {
            let known: Vec<(Option<f64>, bool)> = parts
                .iter()
                .filter_map(|part| limit_s(part, samples_per_s))
                .collect();
            let least = known
                .iter()
                .filter_map(|(seconds, _)| *seconds)
                .reduce(f64::min);
            // Invalid samples are not expected to occur.
            let expected = parts
                .iter()
                .filter(|part| !matches!(part, StopRule::Nan(_)))
                .count();
            let certain = known
                .iter()
                .filter(|(seconds, open)| seconds.is_some() && !open)
                .count();
            Some((least, certain < expected))
        }
        StopRule::All(parts) => {
            let known: Option<Vec<(Option<f64>, bool)>> = parts
                .iter()
                .map(|part| limit_s(part, samples_per_s))
                .collect();
            let known = known?;
            let all: Option<Vec<f64>> = known.iter().map(|(seconds, _)| *seconds).collect();
            let open = known.iter().any(|(_, open)| *open);
            Some((all.and_then(|all| all.into_iter().reduce(f64::max)), open))
        }
        // A similar run with the same rule may show when it holds.
        _ => Some((None, true)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::stop::Comparison;

    fn config(integrator: &str, scene: &str, max_depth: u32) -> Settings {
        Settings {
            scene: scene.to_owned(),
            scene_file: scene.into(),
            max_depth: Some(max_depth),
            resolution: Some([100, 10]),
            backend: "cpu".to_owned(),
            ..Settings::new(integrator)
        }
    }

    /// Throughput of a run of 1000 pixels with this many samples per pixel per second.
    fn throughput(samples_per_s: f64, ended: Option<(f64, &StopRule)>) -> Throughput {
        let ended = ended.map(|(seconds, rule)| (seconds, rule.describe()));
        Throughput {
            paths_per_s: 1000.0 * samples_per_s,
            ended,
            overhead: 1.5,
        }
    }

    fn seconds(
        history: &ThroughputHistory,
        config: &Settings,
        stop: &StopRule,
    ) -> Option<(f64, bool, bool)> {
        forecast_run(config, stop, history)
            .map(|f| ((f.seconds * 1e6).round() / 1e6, f.at_most, f.rough))
    }

    #[test]
    fn the_most_similar_runs_count() {
        let mut history = ThroughputHistory::default();
        let wanted = config("bpt", "box", 5);
        let samples = StopRule::Samples(60);
        assert_eq!(
            seconds(&history, &wanted, &samples),
            None,
            "nothing is known"
        );
        assert_eq!(
            seconds(&history, &wanted, &StopRule::Time(7.0)),
            Some((7.0, false, false)),
            "a time limit needs no history"
        );
        history.record(
            WorkloadKey::from_config(&config("bpt", "lights", 5)),
            throughput(2.0, None),
        );
        assert_eq!(
            seconds(&history, &wanted, &samples),
            Some((45.0, false, true)),
            "another scene, 60 / 2 * 1.5"
        );
        history.record_smoke_sample(WorkloadKey::from_config(&wanted), 4000.0);
        assert_eq!(
            seconds(&history, &wanted, &samples),
            Some((15.0, false, true)),
            "a smoke sample has no overhead"
        );
        history.record(
            WorkloadKey::from_config(&config("bpt", "box", 50)),
            throughput(3.0, None),
        );
        history.record(
            WorkloadKey::from_config(&config("bpt", "box", 7)),
            throughput(5.0, None),
        );
        history.record(
            WorkloadKey::from_config(&config("nee", "box", 5)),
            throughput(99.0, None),
        );
        assert_eq!(
            seconds(&history, &wanted, &samples),
            Some((18.0, false, false)),
            "depth 7 is nearer than 50"
        );
        history.record(WorkloadKey::from_config(&wanted), throughput(10.0, None));
        history.record(WorkloadKey::from_config(&wanted), throughput(30.0, None));
        assert_eq!(
            seconds(&history, &wanted, &samples),
            Some((6.0, false, false)),
            "the mean of 6 s and 2 s, times 1.5"
        );
    }

    #[test]
    fn the_nearest_depth_is_that_of_the_smallest_factor() {
        let mut history = ThroughputHistory::default();
        for (depth, samples_per_s) in [(2, 2.0), (24, 5.0)] {
            let key = WorkloadKey::from_config(&config("bpt", "box", depth));
            history.record(key, throughput(samples_per_s, None));
        }
        let wanted = config("bpt", "box", 10);
        assert_eq!(
            seconds(&history, &wanted, &StopRule::Samples(60)),
            Some((18.0, false, false)),
            "24 is 2.4 times 10, and 10 is 5 times 2"
        );
    }

    #[test]
    fn the_newest_runs_of_a_workload_count() {
        let mut history = ThroughputHistory::default();
        let wanted = config("bpt", "box", 5);
        let key = || WorkloadKey::from_config(&wanted);
        for _ in 0..RUNS_PER_WORKLOAD {
            history.record(key(), throughput(1.0, None));
        }
        for _ in 0..RUNS_PER_WORKLOAD {
            history.record(key(), throughput(3.0, None));
        }
        assert_eq!(
            seconds(&history, &wanted, &StopRule::Samples(60)),
            Some((30.0, false, false)),
            "all older runs are forgotten"
        );
    }

    #[test]
    fn unpredictable_rules_end_as_in_similar_runs() {
        let when = StopRule::When {
            column: "rmse".into(),
            op: Comparison::Less,
            value: 0.1,
            hold: 1,
        };
        let race = StopRule::Any(vec![when.clone(), StopRule::Time(60.0), StopRule::Nan(1)]);
        let wanted = config("bpt", "box", 5);
        let mut history = ThroughputHistory::default();
        assert_eq!(seconds(&history, &wanted, &race), Some((60.0, true, false)));
        assert_eq!(seconds(&history, &wanted, &when), None);
        history.record(
            WorkloadKey::from_config(&wanted),
            throughput(1.0, Some((12.0, &race))),
        );
        assert_eq!(
            seconds(&history, &wanted, &race),
            Some((18.0, false, false)),
            "as the similar run, times its overhead"
        );
        assert_eq!(seconds(&history, &wanted, &when), None, "another rule");
        let both = StopRule::All(vec![StopRule::Samples(8), StopRule::Time(2.0)]);
        assert_eq!(
            seconds(&history, &wanted, &both),
            Some((12.0, false, false)),
            "eight samples at one a second"
        );
        let guarded = StopRule::Any(vec![StopRule::Samples(8), StopRule::Nan(1)]);
        assert_eq!(
            seconds(&history, &wanted, &guarded),
            Some((12.0, false, false))
        );
    }
}
