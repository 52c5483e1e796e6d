//! Materials, a scene, jobs and the comparison of bits, for the tests of the wavefront.

use std::ops::Range;
use std::sync::Arc;

use glam::Vec3;
use lumbre_light::film::time::{TimeAxis, TimeCube, sum_slots};
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{Distribution, Interface, Material, Model, diffuse_reflectance};
use lumbre_light::transport::integrator::integrator;
use lumbre_light::transport::time_settings::Timing;
use lumbre_light::value::Value;
use lumbre_render::cpu::bvh::simd::Isa;
use lumbre_render::hierarchy::{AccelSpec, LaneMode};
use lumbre_render::{Job, Renderer, cpu::renderer::CpuRenderer};

use crate::common::{SceneBuilder, WHITE, grey, light};

pub const DISNEY: Material = Material {
    model: Model::Disney,
    base_color: Vec3::new(0.8, 0.5, 0.2),
    ..WHITE
};

/// Returns materials with every lobe alone and in combination.
pub fn materials() -> Vec<(&'static str, Material)> {
    vec![
        ("rough", DISNEY),
        (
            "shiny",
            Material {
                roughness: 0.25,
                ior: 2.5,
                ..DISNEY
            },
        ),
        (
            "subsurface",
            Material {
                subsurface: 0.6,
                ..DISNEY
            },
        ),
        (
            "sheen",
            Material {
                sheen: 1.0,
                sheen_tint: 0.5,
                ..DISNEY
            },
        ),
        (
            "tinted",
            Material {
                specular_tint: 0.8,
                roughness: 0.4,
                ..DISNEY
            },
        ),
        (
            "smooth dielectric over diffuse",
            Material {
                roughness: 0.0,
                ..DISNEY
            },
        ),
        (
            "metal",
            Material {
                metallic: 1.0,
                roughness: 0.3,
                ..DISNEY
            },
        ),
        (
            "mirror",
            Material {
                metallic: 1.0,
                roughness: 0.0,
                ..DISNEY
            },
        ),
        (
            "half metal",
            Material {
                metallic: 0.5,
                roughness: 0.5,
                ..DISNEY
            },
        ),
        (
            "glass",
            Material {
                opacity: 0.0,
                roughness: 0.0,
                ..DISNEY
            },
        ),
        (
            "rough glass",
            Material {
                opacity: 0.0,
                roughness: 0.4,
                ..DISNEY
            },
        ),
        (
            "glass of index close to one",
            Material {
                opacity: 0.0,
                roughness: 0.02,
                ior: 1.001,
                ..DISNEY
            },
        ),
        (
            "half opaque",
            Material {
                opacity: 0.5,
                roughness: 0.3,
                ..DISNEY
            },
        ),
        (
            "half opaque and smooth",
            Material {
                opacity: 0.5,
                roughness: 0.0,
                metallic: 0.2,
                ..DISNEY
            },
        ),
        (
            "coat",
            Material {
                clearcoat: 1.0,
                clearcoat_gloss: 0.4,
                ..DISNEY
            },
        ),
        (
            "coat on a mixture",
            Material {
                clearcoat: 0.7,
                opacity: 0.5,
                metallic: 0.3,
                roughness: 0.5,
                sheen: 0.5,
                ..DISNEY
            },
        ),
        (
            "black",
            Material {
                base_color: Vec3::ZERO,
                metallic: 1.0,
                ..DISNEY
            },
        ),
        (
            "brushed",
            Material {
                anisotropic: 0.8,
                roughness: 0.4,
                metallic: 1.0,
                ..DISNEY
            },
        ),
        (
            "emitting and reflecting",
            Material {
                emission: Vec3::splat(0.2),
                ..DISNEY
            },
        ),
        ("Lambert", grey(0.7)),
        (
            "ideal",
            Material {
                opacity: 0.0,
                ..WHITE
            },
        ),
        (
            "ideal mixture",
            Material {
                opacity: 0.5,
                metallic: 0.2,
                ..WHITE
            },
        ),
    ]
}

/// Returns metals, plastic and glass of both distributions, smooth and rough.
pub fn interfaces() -> Vec<(String, Material)> {
    let mut all = Vec::new();
    for (distribution, roughness) in [Distribution::Ggx, Distribution::Beckmann]
        .into_iter()
        .flat_map(|d| [0.0, 0.02, 0.4, 1.0].map(|r| (d, r)))
    {
        let interface = Interface {
            distribution,
            specular: Vec3::new(0.7, 0.9, 1.0),
            eta: Vec3::new(0.2, 0.92, 0.0),
            k: Vec3::new(3.9, 2.45, 1.0),
            ..Interface::PLAIN
        };
        let plain = Material {
            roughness,
            interface,
            ..DISNEY
        };
        let plastic = Material {
            model: Model::Plastic,
            interface: Interface {
                internal_reflectance: 1.0 - (1.0 - diffuse_reflectance(1.5)) / 2.25,
                ..interface
            },
            ..plain
        };
        let nonlinear = Interface {
            nonlinear: true,
            ..plastic.interface
        };
        let glass = Material {
            model: Model::Dielectric,
            ..plain
        };
        let pane = Interface {
            thin: true,
            ..interface
        };
        let rows = [
            (
                "metal",
                Material {
                    model: Model::Conductor,
                    ..plain
                },
            ),
            ("plastic", plastic),
            (
                "nonlinear plastic",
                Material {
                    interface: nonlinear,
                    ..plastic
                },
            ),
            ("glass", glass),
            ("glass of a low index", Material { ior: 0.7, ..glass }),
            ("glass of index one", Material { ior: 1.0, ..glass }),
            (
                "pane",
                Material {
                    interface: pane,
                    ..glass
                },
            ),
        ];
        all.extend(rows.map(|(name, m)| (format!("{name}, {distribution:?}, {roughness}"), m)));
    }
    all
}

/// Triangles of the floor of [`room`].
pub const FLOOR: Range<usize> = 12..14;

/// Returns a room with an area light; its floor and a sphere have the material, and the floor's
/// normals are bent.
pub fn room(material: Material) -> SceneBuilder {
    SceneBuilder::new(Vec3::new(0.0, 0.0, 0.95), Vec3::ZERO, 70.0)
        .room(
            1.0,
            Material {
                base_color: Vec3::splat(0.6),
                ..DISNEY
            },
        )
        .quad(
            Vec3::new(-0.9, -0.8, -0.9),
            Vec3::Z * 1.7,
            Vec3::X * 1.8,
            material,
        )
        .with(|s| {
            for (i, n) in s.normals.make_smooth()[FLOOR]
                .as_flattened_mut()
                .iter_mut()
                .enumerate()
            {
                let bend = Vec3::new(0.3 * (i as f32 - 2.5), 0.0, 0.2 * (i as f32 % 3.0 - 1.0));
                *n = (*n + bend).try_normalize().unwrap();
            }
        })
        .ceiling(0.3, 0.99, light(8.0))
        .sphere(Vec3::new(0.3, -0.3, 0.0), 0.35, material)
}

/// Returns a job with `nee`, vectorised where possible.
pub fn nee_job(resolution: [u32; 2], max_depth: u32) -> Job {
    let accel = AccelSpec {
        lanes: LaneMode::Always,
        ..AccelSpec::default()
    };
    Job::plain(integrator("nee").unwrap(), resolution, max_depth, 5)
        .on_threads(1)
        .with(|settings| settings.accel = accel)
}

/// Returns the job with `bpt`, which makes no connections.
pub fn with_bpt(job: Job) -> Job {
    with_technique(job, "bpt", &[])
}

/// Returns the job with `bdpt`.
pub fn with_bdpt(job: Job) -> Job {
    with_technique(job, "bdpt", &[])
}

/// Returns the job with a technique and more parameters.
pub fn with_technique(mut job: Job, name: &str, params: &[(&str, Value)]) -> Job {
    job.integrator = integrator(name).unwrap();
    let params = params
        .iter()
        .map(|(key, value)| ((*key).to_owned(), value.clone()));
    job.settings.params.extend(params);
    job
}

/// Radius within which a surface gathers several photons, and a number of photons that is not that
/// of the pixels.
const PHOTONS: [(&str, Value); 2] = [("radius", Value::Num(0.2)), ("photons", Value::Int(700))];

/// Returns the job with `sppm`.
pub fn with_sppm(job: Job) -> Job {
    with_technique(job, "sppm", &PHOTONS)
}

/// Returns the job with `vcm`.
pub fn with_vcm(job: Job) -> Job {
    with_technique(job, "vcm", &PHOTONS)
}

/// Returns the job with `lvc` and several connections of a vertex.
pub fn with_lvc(job: Job) -> Job {
    let params = [("connections", 2), ("candidates", 5), ("photons", 700)];
    let params = params.map(|(key, value)| (key, Value::Int(value)));
    with_technique(job, "lvc", &params)
}

/// Parameters with which the tree of guided paths has several leaves.
const TRAINED: [(&str, Value); 2] = [("training", Value::Int(12)), ("split", Value::Num(500.0))];

/// Returns the job with `guided`.
pub fn with_guided(job: Job) -> Job {
    with_technique(job, "guided", &TRAINED)
}

/// Returns the job with `guided_bdpt`.
pub fn with_guided_bdpt(job: Job) -> Job {
    with_technique(job, "guided_bdpt", &TRAINED)
}

/// Returns the job with a time axis on which most light arrives, and some before it and after it.
pub fn with_time_axis(job: &Job) -> Job {
    job.clone().with(|settings| {
        settings.timing = Some(Timing::plain(TimeAxis {
            start: 2.0,
            bin: 0.125,
            bins: 40,
        }))
    })
}

/// Returns the bits of a film with a time axis. Panics unless the film is the sum of its slots.
fn slots(cube: &TimeCube, sum: &[[f64; 3]], name: &str) -> (Vec<[u64; 3]>, Vec<[u32; 3]>) {
    let sums: Vec<[f64; 3]> = cube.sum.chunks(cube.axis.slots()).map(sum_slots).collect();
    assert_eq!(sums, sum, "{name}: the film is not the sum of its slots");
    (
        cube.sum.iter().map(|s| s.map(f64::to_bits)).collect(),
        cube.square.iter().map(|s| s.map(f32::to_bits)).collect(),
    )
}

/// Renders in lanes and on the scalar path, with and without a time axis. Panics unless all bits
/// and the ray counts are equal.
pub fn assert_same_bits(name: &str, scene: &Arc<CompiledScene>, job: Job, samples: u64) {
    assert_same_film_bits(
        &format!("{name}, with a time axis"),
        scene,
        with_time_axis(&job),
        samples,
    );
    assert_same_film_bits(name, scene, job, samples);
}

/// Does what [`assert_same_bits`] does, but only for the film that the job describes.
pub fn assert_same_film_bits(name: &str, scene: &Arc<CompiledScene>, job: Job, samples: u64) {
    // Emission alone is black, because the lights are behind the camera.
    let dark = job.max_depth == 1;
    let run = |job: Job, isa: Isa, lanes: bool| {
        let mut renderer = CpuRenderer::with_isa(Arc::clone(scene), job, isa).unwrap();
        assert_eq!(
            renderer.is_vectorised(),
            lanes && isa != Isa::Portable,
            "{name}"
        );
        let stats = renderer.advance(samples).unwrap();
        let bits = |sums: &[[f64; 3]]| sums.iter().map(|s| s.map(f64::to_bits)).collect::<Vec<_>>();
        let film = renderer.film();
        let times = renderer.times().map(|cube| slots(&cube, &film.sum, name));
        let layers: Vec<_> = (0..renderer.layers().len())
            .map(|i| renderer.layer(i).unwrap())
            .map(|film| (bits(&film.sum), bits(&film.sum2)))
            .collect();
        (
            bits(&film.sum),
            bits(&film.sum2),
            stats.rays,
            (stats.invalid, stats.first_invalid),
            layers,
            times,
        )
    };
    let scalar = run(
        job.clone()
            .with(|settings| settings.accel = job.settings.accel.scalar()),
        Isa::Portable,
        false,
    );
    for isa in Isa::available() {
        let (lanes, by) = (run(job.clone(), *isa, true), isa.name());
        let differing = scalar
            .0
            .iter()
            .zip(&lanes.0)
            .filter(|(a, b)| a != b)
            .count();
        assert_eq!(
            differing,
            0,
            "{name}, {by}: number of pixels of {} that differ",
            scalar.0.len()
        );
        assert!(scalar.5 == lanes.5, "{name}, {by}: slots differ");
        assert!(scalar.4 == lanes.4, "{name}, {by}: layers differ");
        assert!(
            scalar == lanes,
            "{name}, {by}: squares, rays or invalid samples differ: {:?} {:?}",
            scalar.2,
            lanes.2
        );
        assert!(
            dark || lanes.0.iter().any(|s| f64::from_bits(s[0]) > 0.0),
            "{name}: black"
        );
    }
}
