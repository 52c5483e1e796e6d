//! Cost of time-resolved films, and of materials with delays or with component materials.
//!
//! All variants render the same scene with the same samples, so they trace the same paths. They
//! are interleaved on one thread or on the device; ratios are taken within one round. The first
//! round is reported separately, because it touches memory for the first time. The other rounds
//! are as long as waves of a night, and their sample count is reported: films exceed the caches,
//! and the more samples a wave adds to a pixel, the better its bins are cached.

use std::sync::Arc;

use lumbre::cli::bench::backends::renders;
use lumbre::cli::bench::interleave::interleaved;
use lumbre::cli::bench::subject::Subject;
use lumbre_light::film::time::TimeAxis;
use lumbre_light::math::stats::median;
use lumbre_light::scene::compile;
use lumbre_light::scene::desc::{DelayKind, MaterialDesc, SceneDesc};
use lumbre_light::transport::integrator::{INTEGRATORS, IntegratorRow};
use lumbre_light::transport::time_settings::Timing;
use lumbre_night::backends::backend;
use lumbre_render::hierarchy::{AccelSpec, LaneMode};
use lumbre_render::{Job, Renderer};

/// Number of bins of the film.
const BINS: u32 = 300;
/// Resolution: large enough that the film exceeds the caches, and small enough for the 128 MiB
/// buffers that every device supports.
const SIZE: [u32; 2] = [120, 80];
/// Samples of the first round; and the smallest and largest number of samples of the others.
const SAMPLES: [u64; 2] = [16, 1024];
/// Target duration in seconds of a round of the plain picture; waves of a night double up to 0.5 s.
const ROUND_S: f64 = 0.25;

/// Durations of an integrator for each variant, in seconds.
pub struct TimeFilmCost {
    backend: String,
    integrator: &'static str,
    /// Samples per pixel of a round.
    samples: u64,
    /// Seconds of each variant in the first round.
    first: Vec<f64>,
    /// Seconds of each variant in each of the other rounds.
    rounds: Vec<Vec<f64>>,
}

/// A variant of film and scene, and the variant with which it is compared.
struct Variant {
    name: &'static str,
    base: usize,
    film: bool,
    lanes: LaneMode,
    change: fn(&mut SceneDesc),
}

/// The vectorised path does not support delays, so their cost is also compared with the scalar
/// path.
const VARIANTS: [Variant; 5] = [
    Variant {
        name: "picture",
        base: 0,
        film: false,
        lanes: LaneMode::Auto,
        change: |_| {},
    },
    Variant {
        name: "film of 300 bins",
        base: 0,
        film: true,
        lanes: LaneMode::Auto,
        change: |_| {},
    },
    Variant {
        name: "film, path by path",
        base: 1,
        film: true,
        lanes: LaneMode::Never,
        change: |_| {},
    },
    Variant {
        name: "separable",
        base: 2,
        film: true,
        lanes: LaneMode::Never,
        change: delayed,
    },
    Variant {
        name: "composed",
        base: 2,
        film: true,
        lanes: LaneMode::Never,
        change: composed,
    },
];

/// Measures every integrator on a scene, on each of `backends` that renders it.
///
/// # Errors
/// A message for the user if the scene cannot be loaded or rendered.
pub fn measure(
    subject: &Subject,
    backends: &[String],
    repeats: usize,
) -> Result<Vec<TimeFilmCost>, String> {
    let desc = subject.load()?;
    let all = INTEGRATORS
        .iter()
        .flat_map(|row| backends.iter().map(move |backend| (row, backend)))
        .filter(|(row, backend)| renders(backend, row));
    all.map(|(row, backend)| cost(&desc, row, backend, repeats))
        .collect()
}

fn cost(
    desc: &SceneDesc,
    integrator: &'static IntegratorRow,
    backend: &str,
    repeats: usize,
) -> Result<TimeFilmCost, String> {
    let mut renderers = Vec::new();
    for variant in &VARIANTS {
        let mut changed = desc.clone();
        (variant.change)(&mut changed);
        renderers.push(open(&changed, integrator, backend, variant)?);
    }
    let first = interleaved(&mut renderers, 1, SAMPLES[0], |wave| wave.render_s)?.remove(0);
    let samples = ((SAMPLES[0] as f64 * ROUND_S / first[0]) as u64).clamp(SAMPLES[0], SAMPLES[1]);
    let rounds = interleaved(&mut renderers, repeats, samples, |wave| wave.render_s)?;
    Ok(TimeFilmCost {
        backend: backend.to_owned(),
        integrator: integrator.name,
        samples,
        first,
        rounds,
    })
}

fn open(
    desc: &SceneDesc,
    integrator: &'static IntegratorRow,
    backend_name: &str,
    variant: &Variant,
) -> Result<Box<dyn Renderer>, String> {
    let (scene, _) = compile(desc).map_err(|e| e.to_string())?;
    let timing = Timing::plain(TimeAxis {
        start: 0.0,
        bin: 0.1,
        bins: BINS,
    });
    let plain = Job::plain(integrator, SIZE, scene.max_depth, 1);
    let accel = AccelSpec {
        lanes: variant.lanes,
        ..plain.settings.accel
    };
    let job = plain.on_threads(1).with(|settings| {
        settings.timing = variant.film.then_some(timing);
        settings.accel = accel;
    });
    let row = backend(backend_name).ok_or_else(|| {
        format!("there is no backend `{backend_name}`; `lumbre doctor` lists them")
    })?;
    (row.open)(Arc::new(scene), job).map_err(|e| e.to_string())
}

/// Gives every surface that does not emit light an exponential delay.
fn delayed(desc: &mut SceneDesc) {
    for m in desc
        .materials
        .iter_mut()
        .filter(|m| m.emission == glam::Vec3::ZERO)
    {
        m.delay.kind = DelayKind::Exponential;
        m.delay.rate = [2.0, 0.0];
    }
}

/// Replaces every surface that does not emit light by a mixture of two copies of it.
fn composed(desc: &mut SceneDesc) {
    let mut components = Vec::new();
    for m in desc
        .materials
        .iter_mut()
        .filter(|m| m.emission == glam::Vec3::ZERO)
    {
        let names = ["one", "two"].map(|which| format!("{}, component {which}", m.name));
        components.extend(names.iter().map(|name| MaterialDesc {
            name: name.clone(),
            ..m.clone()
        }));
        (m.parts, m.weights) = (names.to_vec(), vec![0.5; 2]);
    }
    desc.materials.extend(components);
}

impl TimeFilmCost {
    /// Median seconds of a variant, and its median ratio to the variant it is compared with.
    fn figures(&self, variant: usize) -> (f64, f64) {
        let base = VARIANTS[variant].base;
        (
            median(self.rounds.iter().map(|t| t[variant])),
            median(self.rounds.iter().map(|t| t[variant] / t[base])),
        )
    }

    /// Time per sample in the first round, relative to the other rounds.
    fn first(&self, variant: usize) -> f64 {
        self.first[variant] / SAMPLES[0] as f64 / (self.figures(variant).0 / self.samples as f64)
    }
}

/// Formats the figures as a table.
pub fn table(costs: &[TimeFilmCost]) -> String {
    let mut rows = vec![
        [
            "variant",
            "backend",
            "integrator",
            "samples",
            "Mpaths/s",
            "ratio",
            "base",
            "first round",
        ]
        .map(str::to_owned)
        .to_vec(),
    ];
    for cost in costs {
        let paths = f64::from(SIZE[0] * SIZE[1]) * cost.samples as f64;
        for (i, variant) in VARIANTS.iter().enumerate() {
            let (seconds, ratio) = cost.figures(i);
            rows.push(vec![
                variant.name.to_owned(),
                cost.backend.clone(),
                cost.integrator.to_owned(),
                cost.samples.to_string(),
                format!("{:.3}", paths / seconds / 1e6),
                format!("{ratio:.3}"),
                VARIANTS[variant.base].name.to_owned(),
                format!("{:.2}", cost.first(i)),
            ]);
        }
    }
    lumbre::cli::format::aligned(&rows)
}
