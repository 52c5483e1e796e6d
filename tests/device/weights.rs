//! The weights of `bdpt` on a device, which adds their terms in single precision, compared with their
//! definition in double precision (`lumbre_light::transport::integrator::oracle`).

use std::path::Path;
use std::sync::Arc;

use glam::Vec3;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::desc::CameraKind;
use lumbre_light::transport::arrival::SurfaceClasses;
use lumbre_light::transport::camera::Camera;
use lumbre_light::transport::integrator::bdpt::directions::BsdfDirections;
use lumbre_light::transport::integrator::bdpt::single;
use lumbre_light::transport::integrator::bdpt::weights::StrategyCounts;
use lumbre_light::transport::integrator::oracle::{self, Rule};
use lumbre_light::transport::integrator::{Context, Settings};
use lumbre_light::transport::light::{LightSampling, Lights};
use lumbre_light::value::Value;
use lumbre_render::Job;
use lumbre_render::cpu::bvh::accel::Accel;
use lumbre_render::path_trace::{PathEvent, SampleAt};
use lumbre_vulkan::pipelines::sources::Sources;
use lumbre_vulkan::pipelines::sources::TEXTS;
use lumbre_vulkan::renderer::VulkanRenderer;

use super::harness;
use super::images::{room, scene_with_all_lights, technique_job};
use crate::common::{SceneBuilder, WHITE, grey, light};

/// Contribution of a path: its pixel, its strategy `[s, t]`, and its weight.
type Weighted = ([u32; 2], [u32; 2], f64);

/// Returns a room of extreme densities: a light and glossy balls, all tiny, and glass that focuses
/// the light.
fn tiny_lights() -> Arc<CompiledScene> {
    let mut glossy = grey(0.9);
    (glossy.metallic, glossy.roughness) = (1.0, 0.05);
    glossy.model = lumbre_light::scene::compile::Model::Disney;
    let mut glass = WHITE;
    glass.opacity = 0.0;
    SceneBuilder::new(Vec3::new(0.0, 0.0, 1.9), Vec3::new(0.0, -0.5, 0.0), 60.0)
        .room(2.0, grey(0.7))
        .sphere(Vec3::new(0.0, 1.2, 0.0), 1e-3, light(1e5))
        .sphere(Vec3::new(0.3, -0.6, 0.2), 0.5, glass)
        .sphere(Vec3::new(-0.8, -1.0, 0.0), 0.4, glossy)
        .sphere(Vec3::new(0.9, -1.9, 0.9), 0.01, glossy)
        .build()
}

/// Returns a scene with every kind of light, seen by a camera of this kind.
pub fn seen_by(kind: CameraKind) -> Arc<CompiledScene> {
    let mut scene = CompiledScene::clone(&scene_with_all_lights());
    (scene.camera.kind, scene.camera.view_height) = (kind, 2.5);
    scene.camera.optics = scene.camera.optics.with_aperture(0.0);
    Arc::new(scene)
}

/// Returns a job of `bdpt` with a heuristic.
fn weighted_job(mis: &str, max_depth: u32) -> Job {
    let mut job = Job {
        resolution: [96, 16],
        max_depth,
        ..technique_job("bdpt", 90)
    };
    job.settings
        .params
        .insert("mis".to_owned(), Value::Str(mis.to_owned()));
    job
}

/// Returns the samples of a job that are compared.
fn samples_of(job: &Job) -> Vec<SampleAt> {
    let [width, height] = job.resolution;
    let row = |y: u32| {
        (0..width).map(move |x| SampleAt {
            pixel: [x, y],
            sample: u64::from(y),
        })
    };
    (0..height).flat_map(row).collect()
}

/// Returns the contributions of samples with the weights that the definition gives them.
fn expected(scene: &Arc<CompiledScene>, job: &Job, samples: &[SampleAt]) -> Vec<Vec<Weighted>> {
    let accel = Accel::build(Arc::clone(scene)).unwrap();
    let context = Context {
        scene,
        camera: &Camera::new(&scene.camera, job.resolution, job.settings.filter),
        lights: &Lights::with_select(
            scene,
            LightSampling::new(job.integrator, &job.settings.params),
        ),
        classes: &SurfaceClasses::new(scene),
        trace: &accel,
        max_depth: job.max_depth,
        rr_start: job.settings.rr_start,
        settings: &Settings::new(&job.settings.params),
        params: &job.settings.params,
        timing: None,
        shared: None,
    };
    let rule = Rule {
        heuristic: context.settings.heuristic(),
        counts: StrategyCounts::ONE_EACH,
        guide: None,
    };
    let mut subpaths = single::Subpaths::default();
    let mut of_sample = |at: &SampleAt| {
        let mut found = Vec::new();
        let mut sampler = job.sampler.start(job.seed, at.pixel, at.sample);
        single::for_each_path(
            &context,
            BsdfDirections,
            at.pixel,
            &mut sampler,
            &mut subpaths,
            &mut |connected| {
                let c = connected.contribution;
                let path = oracle::Path::new(&context, None, &connected).unwrap();
                let weight = path.weights(&context, &rule).connections[c.s as usize];
                found.push((c.pixel, [c.s, c.t], weight));
            },
        );
        found
    };
    samples.iter().map(&mut of_sample).collect()
}

/// Returns the contributions of a sample on the device.
fn contributions(events: &[PathEvent]) -> Vec<Weighted> {
    let weighted = |event: &PathEvent| match event {
        PathEvent::Light(c) => {
            let weight = c.value.max_element() / c.unweighted.max_element();
            Some((c.pixel, [c.s, c.t], f64::from(weight)))
        }
        _ => None,
    };
    events.iter().filter_map(weighted).collect()
}

/// Differences of the weights of a device from their definition.
#[derive(Debug)]
struct Errors {
    /// Number of samples whose contributions are others, since rounding made a path diverge.
    diverged: usize,
    /// Number of samples.
    samples: usize,
    /// Relative errors of the weights of all other samples, in increasing order. A weight below a
    /// millionth is compared with a millionth.
    sorted: Vec<f64>,
}

impl Errors {
    /// Returns the error that a fraction of all weights does not exceed.
    fn quantile(&self, fraction: f64) -> f64 {
        let index = (fraction * self.sorted.len() as f64) as usize;
        self.sorted[index.min(self.sorted.len() - 1)]
    }

    /// Returns why the errors are more than rounding explains; `None` if they are not. Curved
    /// surfaces multiply errors of a path, so few weights are less exact.
    fn problem(&self) -> Option<String> {
        if self.diverged * 50 > self.samples {
            return Some(format!("{} samples diverge", self.diverged));
        }
        [(0.5, 1e-5), (0.9, 1e-4), (0.995, 1e-3)]
            .into_iter()
            .map(|(fraction, most)| (fraction, most, self.quantile(fraction)))
            .find(|(_, most, found)| found.is_nan() || found > most)
            .map(|(fraction, _, found)| format!("{fraction} of the errors are up to {found:e}"))
    }
}

/// Compares the weights of shaders with their definition; `None` without a device.
fn compare(sources: &Sources, scene: &Arc<CompiledScene>, job: &Job) -> Option<Errors> {
    let device = harness::device()?;
    let samples = samples_of(job);
    let kind = harness::fastest_to_compile(&device);
    let mut renderer = VulkanRenderer::recording(&device, kind, sources, scene, job).unwrap();
    let found = renderer.paths(&samples).unwrap();
    let mut errors = Errors {
        diverged: 0,
        samples: samples.len(),
        sorted: Vec::new(),
    };
    for (events, expected) in found.iter().zip(expected(scene, job, &samples)) {
        let found = contributions(events);
        let strategies = |of: &[Weighted]| -> Vec<([u32; 2], [u32; 2])> {
            of.iter().map(|(pixel, st, _)| (*pixel, *st)).collect()
        };
        if strategies(&found) == strategies(&expected) {
            let error = |((.., a), (.., b)): (&Weighted, &Weighted)| (a - b).abs() / b.max(1e-6);
            errors.sorted.extend(found.iter().zip(&expected).map(error));
        } else {
            errors.diverged += 1;
        }
    }
    errors.sorted.sort_by(f64::total_cmp);
    Some(errors)
}

#[test]
fn weights_in_single_precision_are_those_of_their_definition() {
    let scenes = [
        ("room", room(), 6),
        ("lights", scene_with_all_lights(), 5),
        ("tiny", tiny_lights(), 7),
        ("orthographic", seen_by(CameraKind::Orthographic), 5),
        ("spherical", seen_by(CameraKind::Spherical), 5),
    ];
    for (name, scene, max_depth) in scenes {
        for mis in ["power", "balance", "none"] {
            let job = weighted_job(mis, max_depth);
            let errors = or_return!(compare(&harness::sources(), &scene, &job));
            println!(
                "{name}, {mis}: {} weights, errors {:.1e} {:.1e} {:.1e} {:.1e}, {} samples diverge",
                errors.sorted.len(),
                errors.quantile(0.5),
                errors.quantile(0.9),
                errors.quantile(0.995),
                errors.quantile(1.0),
                errors.diverged
            );
            assert!(errors.sorted.len() > 2000, "{name}: too few weights");
            assert_eq!(errors.problem(), None, "{name}, {mis}");
        }
    }
    harness::assert_no_validation_messages();
}

/// Bugs in the recursion of the weights that the comparison must find: text of `weights.glsl`, and
/// the text that replaces it.
const BUGS: [(&str, &str); 3] = [
    // The density of the previous vertex is left out.
    ("c.d_vc * heuristic_root(h, before))", "c.d_vc)"),
    // Roots are added where their squares should be.
    (
        "return larger * sqrt(1.0 + ratio * ratio);",
        "return larger + smaller;",
    ),
    // Vertices of Dirac events are connected.
    (
        "delta ? 0.0 : heuristic_root(h, counts_connecting()),",
        "1.0,",
    ),
];

#[test]
fn planted_bugs_in_the_recursion_of_weights_are_found() {
    if !harness::has_compiler() {
        return;
    }
    for (from, to) in BUGS {
        let folder = tempfile::tempdir().unwrap();
        write_shaders(folder.path(), from, to);
        let sources = Sources::Folder(folder.path().to_owned());
        let errors = or_return!(compare(&sources, &tiny_lights(), &weighted_job("power", 7)));
        let problem = errors.problem();
        println!("{from}: {problem:?}");
        assert!(problem.is_some(), "not found: {from}");
    }
    harness::assert_no_validation_messages();
}

/// Writes the shaders to a folder, with a text of the weights replaced.
fn write_shaders(folder: &Path, from: &str, to: &str) {
    for (path, text) in TEXTS {
        let mut text = (*text).to_owned();
        if *path == "transport/integrator/bdpt/weights.glsl" {
            assert!(text.contains(from), "{path} no longer has `{from}`");
            text = text.replace(from, to);
        }
        let file = folder.join(path);
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(file, text).unwrap();
    }
}
