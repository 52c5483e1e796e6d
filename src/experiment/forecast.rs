//! How long what is left of a night will take, from how fast its relatives were.
//!
//! What is known of a run that has not started is how fast runs like it were: of the same technique on the same scene at
//! the same depth, or the nearest of those; for want of any, one small sample of the smoke pass. A limit of time needs no
//! relatives. Where other rules can end a run first, a relative that had the same rule says when they did.

use std::collections::BTreeMap;

use super::WaveRow;
use super::event::CellRef;
use super::plan::{Plan, ReferenceSource};
use super::spec::CellConfig;
use super::stop::StopRule;

/// What decides how fast something renders, as far as that is looked at.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Kind {
    /// Name of the integrator.
    pub integrator: String,
    /// The scene as the script wrote it.
    pub scene: String,
    /// Name of the backend.
    pub backend: String,
    /// Greatest number of path edges.
    pub max_depth: u32,
}

impl Kind {
    /// The kind of a run.
    pub fn of(config: &CellConfig) -> Kind {
        Kind {
            integrator: config.integrator.clone(),
            scene: config.scene.clone(),
            backend: config.backend.clone(),
            max_depth: config.max_depth.unwrap_or(0),
        }
    }
}

/// How fast one run was.
#[derive(Clone, Debug, PartialEq)]
pub struct Pace {
    /// Camera paths per second of render time.
    pub paths_per_s: f64,
    /// Render time until it ended, and the rule that ended it; nothing for a try that only shows the speed.
    pub ended: Option<(f64, String)>,
    /// Seconds of wall time for one of render time, at least 1.
    pub overhead: f64,
}

impl Pace {
    /// The pace of a finished run by its last measurement; `None` if it says nothing.
    pub fn of(last: &WaveRow, rule: &StopRule) -> Option<Pace> {
        let paths_per_s = last.paths as f64 / last.render_s;
        let known = last.paths > 0 && last.render_s > 0.0;
        known.then(|| Pace {
            paths_per_s,
            ended: Some((last.render_s, rule.describe())),
            overhead: (last.wall_s / last.render_s).clamp(1.0, 10.0),
        })
    }
}

/// How fast runs were, by kind.
#[derive(Clone, Debug, Default)]
pub struct Paces {
    runs: BTreeMap<Kind, Vec<Pace>>,
    /// From the smoke pass.
    tries: BTreeMap<Kind, Pace>,
}

/// Most runs of one kind that are remembered: the newest count.
const MOST: usize = 16;

impl Paces {
    /// Takes in a finished run.
    pub fn learn(&mut self, kind: Kind, pace: Pace) {
        let runs = self.runs.entry(kind).or_default();
        if runs.len() >= MOST {
            runs.remove(0);
        }
        runs.push(pace);
    }

    /// Takes in a try of the smoke pass.
    pub fn tried(&mut self, kind: Kind, paths_per_s: f64) {
        if paths_per_s > 0.0 && paths_per_s.is_finite() {
            self.tries.insert(kind, Pace { paths_per_s, ended: None, overhead: 1.0 });
        }
    }

    /// The runs that are nearest to a kind, and whether only a small try of it is known.
    fn relatives(&self, wanted: &Kind) -> (&[Pace], bool) {
        if let Some(runs) = self.runs.get(wanted) {
            return (runs, false);
        }
        let far = |kind: &Kind| (f64::from(kind.max_depth.max(1)) / f64::from(wanted.max_depth.max(1))).ln().abs();
        let same_scene = |kind: &Kind| {
            (&kind.integrator, &kind.scene, &kind.backend) == (&wanted.integrator, &wanted.scene, &wanted.backend)
        };
        let nearest = |fits: &dyn Fn(&Kind) -> bool| {
            let fitting = self.runs.iter().filter(|(kind, _)| fits(kind));
            fitting.min_by(|a, b| far(a.0).total_cmp(&far(b.0))).map(|(_, runs)| runs.as_slice())
        };
        if let Some(runs) = nearest(&same_scene) {
            return (runs, false);
        }
        if let Some(pace) = self.tries.get(wanted) {
            return (std::slice::from_ref(pace), true);
        }
        let same_technique = |kind: &Kind| (&kind.integrator, &kind.backend) == (&wanted.integrator, &wanted.backend);
        (nearest(&same_technique).unwrap_or_default(), true)
    }
}

/// How long something takes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Forecast {
    /// Seconds of wall time, of the runs that are known.
    pub seconds: f64,
    /// Whether it may well be less: rules that cannot be foretold may end runs before their limits.
    pub at_most: bool,
    /// Whether part of it stands on runs of other scenes, or on small tries.
    pub rough: bool,
    /// Runs that are in it.
    pub known: usize,
    /// Runs of which nothing can be said.
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

    /// The reservations in words: `at most`, `roughly`, `about`.
    pub fn sign(&self) -> &'static str {
        match self {
            Forecast { at_most: true, .. } => "at most",
            Forecast { rough: true, .. } => "roughly",
            _ => "about",
        }
    }
}

/// How long those cells and references take for which `open` is true, one after another.
pub fn forecast(plan: &Plan, paces: &Paces, open: &dyn Fn(CellRef) -> bool) -> Forecast {
    let mut sum = Forecast::default();
    for (_, reference) in plan.references.iter().enumerate().filter(|(i, _)| open(CellRef::Reference(*i))) {
        if let ReferenceSource::Render { config, stop, .. } = &reference.source {
            sum.add(run(config, stop, paces));
        }
    }
    for (_, cell) in plan.cells.iter().enumerate().filter(|(i, _)| open(CellRef::Cell(*i))) {
        sum.add(run(&cell.config, &cell.stop, paces));
    }
    sum
}

/// How long one run takes.
fn run(config: &CellConfig, stop: &StopRule, paces: &Paces) -> Option<Forecast> {
    let (relatives, rough) = paces.relatives(&Kind::of(config));
    let mean = |of: &dyn Fn(&Pace) -> f64| relatives.iter().map(of).sum::<f64>() / relatives.len() as f64;
    let overhead = if relatives.is_empty() { 1.0 } else { mean(&|pace| pace.overhead) };
    let rate = (!relatives.is_empty()).then(|| {
        let [width, height] = config.resolution.unwrap_or([1, 1]);
        // The mean of times, not of rates: a slow run takes long.
        1.0 / mean(&|pace| 1.0 / pace.paths_per_s) / (f64::from(width) * f64::from(height))
    });
    let (seconds, open) = limit_s(stop, rate)?;
    let words = if open { stop.describe() } else { String::new() };
    let same: Vec<f64> = relatives
        .iter()
        .filter_map(|pace| pace.ended.as_ref())
        .filter(|(_, rule)| *rule == words)
        .map(|(s, _)| *s)
        .collect();
    let at_most = open && same.is_empty();
    let seconds = match seconds {
        _ if open && !same.is_empty() => same.iter().sum::<f64>() / same.len() as f64,
        Some(seconds) => seconds,
        None => return None,
    };
    let rough = rough && rate.is_some() && stop.time_limit_s() != Some(seconds);
    Some(Forecast { seconds: seconds * overhead, at_most, rough, known: 1, unknown: 0 })
}

/// Render seconds after which a rule holds by its limits of time and samples, if they tell, and whether other parts of it
/// may hold before. `None` if it is a rule that may never hold and of which nothing can be said.
fn limit_s(rule: &StopRule, samples_per_s: Option<f64>) -> Option<(Option<f64>, bool)> {
    match rule {
        StopRule::Time(seconds) => Some((Some(*seconds), false)),
        StopRule::Samples(samples) => samples_per_s.map(|rate| (Some(*samples as f64 / rate), false)),
        StopRule::Any(parts) => {
            let known: Vec<(Option<f64>, bool)> =
                parts.iter().filter_map(|part| limit_s(part, samples_per_s)).collect();
            let least = known.iter().filter_map(|(seconds, _)| *seconds).reduce(f64::min);
            // An invalid sample is an accident that nobody expects.
            let expected = parts.iter().filter(|part| !matches!(part, StopRule::Nan(_))).count();
            let sure = known.iter().filter(|(seconds, open)| seconds.is_some() && !open).count();
            Some((least, sure < expected))
        }
        StopRule::All(parts) => {
            let known: Option<Vec<(Option<f64>, bool)>> =
                parts.iter().map(|part| limit_s(part, samples_per_s)).collect();
            let known = known?;
            let all: Option<Vec<f64>> = known.iter().map(|(seconds, _)| *seconds).collect();
            let open = known.iter().any(|(_, open)| *open);
            Some((all.and_then(|all| all.into_iter().reduce(f64::max)), open))
        }
        // A relative with the same rule may know.
        _ => Some((None, true)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::stop::Comparison;
    use crate::transport::camera::{FilterKind, FilterSpec};

    fn config(integrator: &str, scene: &str, max_depth: u32) -> CellConfig {
        CellConfig {
            scene: scene.to_owned(),
            scene_file: scene.into(),
            scene_options: BTreeMap::new(),
            integrator: integrator.to_owned(),
            params: BTreeMap::new(),
            max_depth: Some(max_depth),
            resolution: Some([100, 10]),
            rr_start: None,
            filter: FilterSpec { kind: FilterKind::Box, radius: 0.5 },
            films: Vec::new(),
            timing: None,
            accel: Default::default(),
            sampler: "independent".to_owned(),
            set: BTreeMap::new(),
            backend: "cpu".to_owned(),
            fallback: None,
        }
    }

    /// 1000 pixels, so many samples a second.
    fn pace(samples_per_s: f64, ended: Option<(f64, &StopRule)>) -> Pace {
        let ended = ended.map(|(seconds, rule)| (seconds, rule.describe()));
        Pace { paths_per_s: 1000.0 * samples_per_s, ended, overhead: 1.5 }
    }

    fn seconds(paces: &Paces, config: &CellConfig, stop: &StopRule) -> Option<(f64, bool, bool)> {
        run(config, stop, paces).map(|f| ((f.seconds * 1e6).round() / 1e6, f.at_most, f.rough))
    }

    #[test]
    fn the_nearest_relatives_count() {
        let mut paces = Paces::default();
        let wanted = config("bpt", "box", 5);
        let samples = StopRule::Samples(60);
        assert_eq!(seconds(&paces, &wanted, &samples), None, "nobody knows");
        assert_eq!(seconds(&paces, &wanted, &StopRule::Time(7.0)), Some((7.0, false, false)), "nobody has to");
        paces.learn(Kind::of(&config("bpt", "lamps", 5)), pace(2.0, None));
        assert_eq!(seconds(&paces, &wanted, &samples), Some((45.0, false, true)), "another scene, 60 / 2 * 1.5");
        paces.tried(Kind::of(&wanted), 4000.0);
        assert_eq!(seconds(&paces, &wanted, &samples), Some((15.0, false, true)), "a try has no overhead");
        paces.learn(Kind::of(&config("bpt", "box", 50)), pace(3.0, None));
        paces.learn(Kind::of(&config("bpt", "box", 7)), pace(5.0, None));
        paces.learn(Kind::of(&config("nee", "box", 5)), pace(99.0, None));
        assert_eq!(seconds(&paces, &wanted, &samples), Some((18.0, false, false)), "depth 7 is nearer than 50");
        paces.learn(Kind::of(&wanted), pace(10.0, None));
        paces.learn(Kind::of(&wanted), pace(30.0, None));
        assert_eq!(seconds(&paces, &wanted, &samples), Some((6.0, false, false)), "the mean of 6 s and 2 s, times 1.5");
    }

    #[test]
    fn rules_that_cannot_be_foretold_end_as_they_did_before() {
        let when = StopRule::When { column: "rmse".into(), op: Comparison::Less, value: 0.1, hold: 1 };
        let race = StopRule::Any(vec![when.clone(), StopRule::Time(60.0), StopRule::Nan(1)]);
        let wanted = config("bpt", "box", 5);
        let mut paces = Paces::default();
        assert_eq!(seconds(&paces, &wanted, &race), Some((60.0, true, false)));
        assert_eq!(seconds(&paces, &wanted, &when), None);
        paces.learn(Kind::of(&wanted), pace(1.0, Some((12.0, &race))));
        assert_eq!(seconds(&paces, &wanted, &race), Some((18.0, false, false)), "as its relative, times its overhead");
        assert_eq!(seconds(&paces, &wanted, &when), None, "another rule");
        let both = StopRule::All(vec![StopRule::Samples(8), StopRule::Time(2.0)]);
        assert_eq!(seconds(&paces, &wanted, &both), Some((12.0, false, false)), "eight samples at one a second");
        let guarded = StopRule::Any(vec![StopRule::Samples(8), StopRule::Nan(1)]);
        assert_eq!(seconds(&paces, &wanted, &guarded), Some((12.0, false, false)));
    }
}
