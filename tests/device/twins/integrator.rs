//! Whole samples of the integrators, over a traversal that tests every primitive: contributions of
//! one sample to all pixels, its strategies and its ray count, with the same sample numbers on both
//! sides.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{MaskMode, Material, Model, NONE, Texture};
use lumbre_light::transport::arrival::SurfaceClasses;
use lumbre_light::transport::camera::{Camera, FilterKind, FilterSpec};
use lumbre_light::transport::delay::Profile;
use lumbre_light::transport::integrator::{Context, Settings, integrator};
use lumbre_light::transport::light::{LightSampling, Lights};
use lumbre_light::transport::ray::{Hit, Ray, Trace};
use lumbre_light::transport::sampler::SOBOL;
use lumbre_light::transport::surface::is_masked_out;
use lumbre_light::transport::time_settings::Timing;
use lumbre_light::value::Value;
use lumbre_render::Job;

use super::{RandomInputs, SAME};
use crate::common::{SceneBuilder, WHITE, grey, job, light};
use crate::harness::{add_delays, timing};
use crate::parity::{Near, Row, Twin};

/// A traversal that tests every primitive, with the formulas of tests/device/parity/brute.glsl.
struct Brute<'a> {
    scene: &'a CompiledScene,
    rays: Cell<u32>,
}

fn triangle(ray: &Ray, [a, b, c]: [Vec3; 3]) -> Option<(f32, [f32; 2])> {
    let (ab, ac) = (b - a, c - a);
    let p = ray.dir.cross(ac);
    let inverse = 1.0 / ab.dot(p);
    let s = ray.origin - a;
    let q = s.cross(ab);
    let (v, w) = (s.dot(p) * inverse, ray.dir.dot(q) * inverse);
    (v >= 0.0 && w >= 0.0 && v + w <= 1.0).then_some((ac.dot(q) * inverse, [v, w]))
}

fn sphere(ray: &Ray, center: Vec3, radius: f32) -> Option<f32> {
    let f = ray.origin - center;
    let b = -f.dot(ray.dir);
    let discriminant = radius * radius - (f + ray.dir * b).length_squared();
    let q = b + discriminant.max(0.0).sqrt().copysign(b);
    let other = (f.length_squared() - radius * radius) / q;
    let near = other.min(q);
    (discriminant >= 0.0 && q != 0.0).then_some(if near > 0.0 { near } else { other.max(q) })
}

impl Brute<'_> {
    fn nearest(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        self.rays.set(self.rays.get() + 1);
        let mut best: Option<Hit> = None;
        for i in 0..self.scene.primitive_count() {
            let met = match self.scene.triangles.get(i) {
                Some(corners) => triangle(ray, *corners),
                None => {
                    let ball = &self.scene.spheres[i - self.scene.triangles.len()];
                    sphere(ray, ball.center, ball.radius).map(|t| (t, [0.0; 2]))
                }
            };
            let Some((t, uv)) = met else { continue };
            let hit = Hit {
                t,
                primitive: i as u32,
                instance: NONE,
                uv,
            };
            if t > 0.0 && t < best.map_or(t_max, |b| b.t) && !is_masked_out(self.scene, ray, &hit) {
                best = Some(hit);
            }
        }
        best
    }
}

impl Trace for Brute<'_> {
    fn closest(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        self.nearest(ray, t_max)
    }

    fn occluded(&self, ray: &Ray, t_max: f32) -> bool {
        self.nearest(ray, t_max).is_some()
    }
}

fn original(scene: &CompiledScene, job: &Job, row: &mut Row) {
    let pixel = [row.word(), row.word()];
    let index = row.word();
    let brute = Brute {
        scene,
        rays: Cell::new(0),
    };
    let context = Context {
        scene,
        camera: &Camera::new(&scene.camera, job.resolution, job.settings.filter),
        lights: &Lights::with_select(
            scene,
            LightSampling::new(job.integrator, &job.settings.params),
        ),
        classes: &SurfaceClasses::new(scene),
        trace: &brute,
        max_depth: job.max_depth,
        rr_start: job.settings.rr_start,
        settings: &Settings::new(&job.settings.params),
        params: &job.settings.params,
        timing: job.settings.timing.as_ref(),
        shared: None,
    };
    let (mut total, mut unweighted, mut strategies) = (Vec3::ZERO, Vec3::ZERO, 0u32);
    let mut lengths = 0.0f64;
    let mut sampler = job.sampler.start(job.seed, pixel, u64::from(index));
    (job.integrator.sample)(&context, pixel, &mut sampler, &mut |c| {
        total += c.value;
        unweighted += c.unweighted;
        lengths += c.length * f64::from(1 + c.s * 3 + c.t);
        let place = c.pixel[0] * 3 + c.pixel[1] * 5 + 1;
        strategies = strategies.wrapping_add((c.s * 31 + c.t * 7 + 1).wrapping_mul(place));
    });
    row.push_floats(total.to_array());
    row.push_floats(unweighted.to_array());
    row.push(strategies);
    row.push(brute.rays.get());
    row.push_floats([lengths as f32]);
}

/// Returns a room with an area light, rough and smooth metal, glass with a ball in it and a
/// varnished ball, seen through a lens.
fn closed() -> CompiledScene {
    let disney = Material {
        model: Model::Disney,
        base_color: Vec3::new(0.8, 0.6, 0.3),
        ..WHITE
    };
    let rough_glass = Material {
        opacity: 0.0,
        roughness: 0.4,
        ..disney
    };
    let varnished = Material {
        clearcoat: 1.0,
        roughness: 0.5,
        sheen: 0.5,
        subsurface: 0.3,
        ..disney
    };
    let metal = Material {
        metallic: 1.0,
        roughness: 0.3,
        anisotropic: 0.6,
        ..disney
    };
    let glass = Material {
        opacity: 0.0,
        ..WHITE
    };
    let mirror = Material {
        metallic: 1.0,
        ..grey(0.9)
    };
    let builder = SceneBuilder::new(Vec3::new(0.0, 0.0, 0.9), Vec3::new(0.0, -0.2, 0.0), 70.0)
        .room(
            1.0,
            Material {
                base_color: Vec3::new(0.7, 0.6, 0.5),
                ..WHITE
            },
        )
        .ceiling(0.3, 0.95, light(6.0))
        .sphere(Vec3::new(-0.5, -0.6, -0.4), 0.3, rough_glass)
        .sphere(Vec3::new(0.5, -0.7, -0.2), 0.25, varnished)
        .sphere(Vec3::new(0.0, -0.8, 0.2), 0.15, metal)
        .sphere(Vec3::new(-0.2, -0.1, -0.7), 0.2, glass)
        .sphere(Vec3::new(-0.2, -0.1, -0.7), 0.1, grey(0.8))
        .sphere(Vec3::new(0.6, 0.2, -0.6), 0.25, mirror)
        .with(|s| {
            s.camera.optics = s.camera.optics.with_aperture(0.05);
            s.camera.focus_distance = Some(1.2);
            add_delays(s);
        });
    Arc::unwrap_or_clone(builder.build())
}

/// Returns a floor under every kind of light, with a textured light, a mask and an environment.
fn open() -> CompiledScene {
    let mut d = RandomInputs {
        count: 1 << 22,
        words: Vec::new(),
    };
    let mut texture = |width: u32, height: u32| {
        let texels: Vec<[f32; 3]> = (0..width * height)
            .map(|_| std::array::from_fn(|_| d.unit()))
            .collect();
        Texture::new(width, height, texels)
    };
    let (sky, pattern) = (texture(8, 4), texture(4, 4));
    let mut builder = SceneBuilder::new(Vec3::new(0.0, 1.0, 4.0), Vec3::ZERO, 50.0);
    let index = builder.texture(pattern);
    let emitting = Material {
        emission: Vec3::new(4.0, 2.0, 1.0),
        emission_texture: index,
        ..WHITE
    };
    let floor = Material {
        base_color_texture: index,
        ..grey(0.8)
    };
    let masked = Material {
        mask_texture: index,
        mask_mode: MaskMode::Blend,
        ..grey(0.6)
    };
    let plastic = Material {
        model: Model::Disney,
        roughness: 0.3,
        ..grey(0.6)
    };
    let builder = builder
        .quad(
            Vec3::new(-3.0, -1.0, -3.0),
            Vec3::Z * 6.0,
            Vec3::X * 6.0,
            floor,
        )
        .quad(Vec3::new(-1.0, -0.9, 0.5), Vec3::X * 1.5, Vec3::Y, masked)
        .quad(
            Vec3::new(1.0, 0.5, -1.0),
            Vec3::X * 0.5,
            Vec3::Y * 0.5,
            emitting,
        )
        .sphere(Vec3::new(-0.8, 0.0, -0.5), 0.6, plastic)
        .sphere(Vec3::new(0.8, -0.5, 0.8), 0.2, light(5.0))
        .point(Vec3::new(0.0, 2.0, 1.0), Vec3::splat(3.0))
        .directional(Vec3::new(0.3, -1.0, 0.2), Vec3::ONE)
        .environment(Some(sky), Vec3::new(0.5, 0.6, 0.7), 30.0);
    Arc::unwrap_or_clone(builder.build())
}

/// Returns a faceted dome with smooth vertex normals.
fn dome() -> CompiledScene {
    let material = Material {
        shadow_terminator: true,
        ..grey(0.7)
    };
    let mut builder = SceneBuilder::new(Vec3::new(0.0, 0.5, 3.0), Vec3::ZERO, 45.0);
    let ring = |i: u32| {
        let (sin, cos) = (std::f32::consts::TAU * i as f32 / 6.0).sin_cos();
        Vec3::new(cos, 0.0, sin)
    };
    for i in 0..6 {
        builder = builder.triangle(
            [ring(i + 1), ring(i), Vec3::Y * 0.8],
            [Vec2::ZERO; 3],
            material,
        );
    }
    let builder = builder
        .quad(
            Vec3::new(-3.0, -0.01, -3.0),
            Vec3::Z * 6.0,
            Vec3::X * 6.0,
            grey(0.5),
        )
        .quad(Vec3::new(2.0, 0.5, -0.5), Vec3::Z, Vec3::Y, light(8.0))
        .sphere(Vec3::new(-2.0, 0.6, 0.0), 0.2, light(9.0))
        .with(|s| {
            for i in 0..6 {
                let corners = s.triangles[i];
                s.normals.make_smooth()[i] =
                    corners.map(|p| (p * Vec3::new(1.0, 1.5, 1.0)).normalize_or(Vec3::Y));
            }
        });
    Arc::unwrap_or_clone(builder.build())
}

type Params = &'static [(&'static str, &'static str)];

/// Returns a scene and a job with a time axis.
fn technique_job(
    scene: CompiledScene,
    name: &str,
    depth: u32,
    params: Params,
) -> (Arc<CompiledScene>, Job) {
    let params: BTreeMap<String, Value> = params
        .iter()
        .map(|(k, v)| ((*k).to_owned(), Value::from(*v)))
        .collect();
    let integrator = integrator(name).expect("an integrator has this name");
    let timing = Some(Timing {
        medium: 1.25,
        emission: Profile::Exponential(3.0),
        ..timing(0.0, 1.0, 1)
    });
    (
        Arc::new(scene),
        Job {
            integrator,
            ..job([32, 18], depth, 5)
        }
        .with(|settings| {
            settings.params = params;
            settings.timing = timing;
        }),
    )
}

/// Returns the scene with a wide filter, Russian roulette, and the Sobol sequence.
fn wide_filter_job((scene, job): (Arc<CompiledScene>, Job)) -> (Arc<CompiledScene>, Job) {
    let filter = FilterSpec {
        kind: FilterKind::Gauss,
        radius: 1.5,
    };
    (
        scene,
        Job {
            sampler: SOBOL,
            ..job
        }
        .with(|settings| {
            settings.filter = filter;
            settings.rr_start = Some(2);
        }),
    )
}

fn inputs() -> Vec<u32> {
    RandomInputs::rows(2048, |d, i| {
        let pixel = [d.word() % 32, d.word() % 18];
        pixel.into_iter().for_each(|p| d.put_word(p));
        d.put_word(i % 16);
    })
}

const VALUE: Near = Near::Float {
    absolute: 1e-4,
    relative: 2e-3,
};
const NEAR: [Near; 9] = [VALUE, VALUE, VALUE, VALUE, VALUE, VALUE, SAME, SAME, VALUE];

/// `bpt` in the room.
pub const BPT: Twin = Twin {
    name: "bpt",
    kernel: kernel!(Generation "bpt.rgen"),
    scene: || wide_filter_job(technique_job(closed(), "bpt", 6, &[])),
    in_words: 3,
    inputs,
    original,
    near: &NEAR,
    max_outliers: 0.002,
    why: "every bounce multiplies an error by the curvature of the surface, to a few hundred \
          times over a path; where rounding decides an edge or a random choice, the path diverges",
};

/// Share of differing samples with a blended mask, which decides by the bits of a ray.
const MASKED: f64 = 0.03;

/// `bpt` in the open scene.
pub const BPT_OPEN: Twin = Twin {
    scene: || technique_job(open(), "bpt", 4, &[]),
    max_outliers: MASKED,
    ..BPT
};

/// `nee` in the room.
pub const NEE: Twin = Twin {
    name: "nee",
    kernel: kernel!(Generation "nee.rgen"),
    scene: || wide_filter_job(technique_job(closed(), "nee", 6, &[("mis", "balance")])),
    ..BPT
};

/// `nee` with every light sampled in turn.
pub const NEE_OPEN: Twin = Twin {
    scene: || technique_job(open(), "nee", 4, &[("lights", "all")]),
    max_outliers: MASKED,
    ..NEE
};

/// `nee` with the offset at shadow terminators.
pub const NEE_TERMINATOR: Twin = Twin {
    scene: || technique_job(dome(), "nee", 4, &[("mis", "none")]),
    ..NEE
};

/// `bdpt` in the room.
pub const BDPT: Twin = Twin {
    name: "bdpt",
    kernel: kernel!(Generation "bdpt.rgen"),
    scene: || wide_filter_job(technique_job(closed(), "bdpt", 6, &[])),
    ..BPT
};

/// `bdpt` with lights of every kind.
pub const BDPT_OPEN: Twin = Twin {
    scene: || technique_job(open(), "bdpt", 5, &[("mis", "balance")]),
    max_outliers: MASKED,
    ..BDPT
};

/// `bdpt` with the offset at shadow terminators, all strategies weighted alike.
pub const BDPT_TERMINATOR: Twin = Twin {
    scene: || technique_job(dome(), "bdpt", 4, &[("mis", "none")]),
    ..BDPT
};
