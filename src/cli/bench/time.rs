//! What time costs: a film with a time axis beside the picture alone, and materials with delays or parts beside plain ones.
//!
//! All are the same scene with the same samples, so that what they trace is the same; they take turns on one thread, or on
//! the device, and ratios are of one turn. What the first turn takes longer than the others, memory that is touched for the first time above
//! all, is told apart. It also says how many samples the others have, which are as long as waves of runs: films are larger than caches, and the
//! more samples a wave brings to a pixel the less each of them waits for its bins.

use std::sync::Arc;

use serde_json::{Value as Json, json};

use super::subject::Subject;
use super::turns::in_turns;
use crate::film::time::TimeAxis;
use crate::math::stats::median;
use crate::render::hierarchy::{AccelSpec, InLanes};
use crate::render::{Job, Renderer, backend};
use crate::scene::compile;
use crate::scene::desc::{DelayKind, MaterialDesc, SceneDesc};
use crate::transport::flight::Timing;
use crate::transport::integrator::{INTEGRATORS, IntegratorRow};

/// Bins of the film.
const BINS: u32 = 300;
/// Pixels of the picture: so many that the film is larger than caches, and fits into the 128 MiB that every device offers.
const SIZE: [u32; 2] = [120, 80];
/// Samples of the first turn, and the fewest and the most of the others.
const SAMPLES: [u64; 2] = [16, 1024];
/// How long the picture takes in one of these, in seconds: waves of runs double up to half a second.
const TURN_S: f64 = 0.25;

/// The seconds of an integrator for each of the kinds.
pub struct Cost {
    backend: String,
    integrator: &'static str,
    /// Samples of a turn.
    samples: u64,
    /// In the first turn.
    first: Vec<f64>,
    /// In each of the others.
    turns: Vec<Vec<f64>>,
}

/// A kind of film and scene, and what it is compared with.
struct Kind {
    name: &'static str,
    base: usize,
    film: bool,
    lanes: InLanes,
    change: fn(&mut SceneDesc),
}

/// Lanes know no delays, so that what those cost shows beside paths that go one by one as well.
const KINDS: [Kind; 5] = [
    Kind { name: "picture", base: 0, film: false, lanes: InLanes::Auto, change: |_| {} },
    Kind { name: "film of 300 bins", base: 0, film: true, lanes: InLanes::Auto, change: |_| {} },
    Kind { name: "film, path by path", base: 1, film: true, lanes: InLanes::Never, change: |_| {} },
    Kind { name: "separable", base: 2, film: true, lanes: InLanes::Never, change: delayed },
    Kind { name: "composed", base: 2, film: true, lanes: InLanes::Never, change: composed },
];

/// Measures every integrator on a scene, on these backends.
///
/// # Errors
/// When it cannot be loaded or rendered, with a message for people.
pub fn measure(subject: &Subject, backends: &[String], repeats: usize) -> Result<Vec<Cost>, String> {
    let desc = subject.load()?;
    let all = INTEGRATORS.iter().flat_map(|row| backends.iter().map(move |backend| (row, backend)));
    all.map(|(row, backend)| cost(&desc, row, backend, repeats)).collect()
}

fn cost(desc: &SceneDesc, integrator: &'static IntegratorRow, backend: &str, repeats: usize) -> Result<Cost, String> {
    let mut renderers = Vec::new();
    for kind in &KINDS {
        let mut changed = desc.clone();
        (kind.change)(&mut changed);
        renderers.push(open(&changed, integrator, backend, kind)?);
    }
    let first = in_turns(&mut renderers, 1, SAMPLES[0], |wave| wave.render_s)?.remove(0);
    let samples = ((SAMPLES[0] as f64 * TURN_S / first[0]) as u64).clamp(SAMPLES[0], SAMPLES[1]);
    let turns = in_turns(&mut renderers, repeats, samples, |wave| wave.render_s)?;
    Ok(Cost { backend: backend.to_owned(), integrator: integrator.name, samples, first, turns })
}

fn open(
    desc: &SceneDesc,
    integrator: &'static IntegratorRow,
    on: &str,
    kind: &Kind,
) -> Result<Box<dyn Renderer>, String> {
    let (scene, _) = compile(desc).map_err(|e| e.to_string())?;
    let timing = Timing::plain(TimeAxis { start: 0.0, bin: 0.1, bins: BINS });
    let plain = Job::plain(integrator, SIZE, scene.max_depth, 1);
    let accel = AccelSpec { lanes: kind.lanes, ..plain.accel };
    let job = Job { timing: kind.film.then_some(timing), threads: 1, accel, ..plain };
    let row = backend(on).ok_or_else(|| format!("there is no backend `{on}`"))?;
    (row.open)(Arc::new(scene), job).map_err(|e| e.to_string())
}

/// Gives every surface that does not shine an exponential delay.
fn delayed(desc: &mut SceneDesc) {
    for m in desc.materials.iter_mut().filter(|m| m.emission == glam::Vec3::ZERO) {
        m.delay.kind = DelayKind::Exponential;
        m.delay.rate = [2.0, 0.0];
    }
}

/// Composes every surface that does not shine of two that are like it.
fn composed(desc: &mut SceneDesc) {
    let mut parts = Vec::new();
    for m in desc.materials.iter_mut().filter(|m| m.emission == glam::Vec3::ZERO) {
        let names = ["one", "two"].map(|which| format!("{}, part {which}", m.name));
        parts.extend(names.iter().map(|name| MaterialDesc { name: name.clone(), ..m.clone() }));
        (m.parts, m.weights) = (names.to_vec(), vec![0.5; 2]);
    }
    desc.materials.extend(parts);
}

impl Cost {
    /// Median seconds of a kind, and its median ratio to what it is compared with.
    fn figures(&self, kind: usize) -> (f64, f64) {
        let base = KINDS[kind].base;
        (median(self.turns.iter().map(|t| t[kind])), median(self.turns.iter().map(|t| t[kind] / t[base])))
    }

    /// How many times as long a sample of a kind took in the first turn.
    fn first(&self, kind: usize) -> f64 {
        self.first[kind] / SAMPLES[0] as f64 / (self.figures(kind).0 / self.samples as f64)
    }

    /// The figures by name.
    fn to_json(&self) -> Json {
        let kinds = KINDS.iter().enumerate().map(|(i, kind)| {
            let (seconds, ratio) = self.figures(i);
            (kind.name.to_owned(), json!({ "seconds": seconds, "ratio": ratio, "first_s": self.first[i] }))
        });
        let kinds: serde_json::Map<_, _> = kinds.collect();
        json!({ "backend": self.backend, "integrator": self.integrator, "samples": self.samples, "kinds": kinds })
    }
}

/// The figures of all integrators.
pub fn to_json(costs: &[Cost]) -> Json {
    costs.iter().map(Cost::to_json).collect()
}

/// The figures for people.
pub fn table(costs: &[Cost]) -> String {
    let mut rows = vec![
        ["time", "backend", "integrator", "samples", "Mpaths/s", "of its base", "base", "first turn"]
            .map(str::to_owned)
            .to_vec(),
    ];
    for cost in costs {
        let paths = f64::from(SIZE[0] * SIZE[1]) * cost.samples as f64;
        for (i, kind) in KINDS.iter().enumerate() {
            let (seconds, ratio) = cost.figures(i);
            rows.push(vec![
                kind.name.to_owned(),
                cost.backend.clone(),
                cost.integrator.to_owned(),
                cost.samples.to_string(),
                format!("{:.3}", paths / seconds / 1e6),
                format!("{ratio:.3}"),
                KINDS[kind.base].name.to_owned(),
                format!("{:.2}", cost.first(i)),
            ]);
        }
    }
    crate::cli::text::aligned(&rows)
}
