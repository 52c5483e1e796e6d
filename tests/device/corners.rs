//! Every integrator with materials at the extremes of their parameters, every kind of light, camera
//! and filter, for every depth.
//!
//! Equal seeds on both sides allow a much sharper test than different seeds, because nearly every
//! sample is the same. Only blended masks depend on the exact bits of a ray, so their pictures are
//! compared within noise.

use std::sync::Arc;

use glam::Vec3;
use lumbre_light::film::Film;
use lumbre_light::film::layer::Layer;
use lumbre_light::film::ztest::{self, Estimate};
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{
    Distribution, Interface, MaskMode, Material, Model, NONE, Texture,
};
use lumbre_light::transport::camera::{FilterKind, FilterSpec};
use lumbre_light::transport::integrator::INTEGRATORS;
use lumbre_light::transport::sampler::{INDEPENDENT, SOBOL, sampler};
use lumbre_render::cpu::renderer::CpuRenderer;
use lumbre_render::{Job, Renderer};
use lumbre_vulkan::context::device::Device;
use lumbre_vulkan::pipelines::program::TracingMode;
use lumbre_vulkan::renderer::VulkanRenderer;

use super::harness;
use super::images::{render, supported_modes, technique_job};
use super::verdict::compare_loosely;
use crate::common::{self, SceneBuilder, WHITE, grey, light};

/// Returns materials at the extremes of every model.
fn extreme_materials() -> Vec<Material> {
    let disney = Material {
        model: Model::Disney,
        base_color: Vec3::new(0.8, 0.5, 0.3),
        roughness: 0.4,
        ..WHITE
    };
    let gold = Interface {
        eta: Vec3::new(0.14, 0.37, 1.44),
        k: Vec3::new(3.98, 2.39, 1.6),
        ..Interface::PLAIN
    };
    let beckmann = Interface {
        distribution: Distribution::Beckmann,
        ..Interface::PLAIN
    };
    let conductor = Material {
        model: Model::Conductor,
        roughness: 0.4,
        interface: gold,
        ..WHITE
    };
    let body = Interface {
        internal_reflectance: 0.6,
        ..beckmann
    };
    let plastic = Material {
        model: Model::Plastic,
        base_color: Vec3::new(0.2, 0.5, 0.7),
        roughness: 0.3,
        interface: body,
        ..WHITE
    };
    let glass = Material {
        model: Model::Dielectric,
        base_color: Vec3::new(0.9, 1.0, 0.8),
        roughness: 0.3,
        ..WHITE
    };
    vec![
        grey(0.6),
        Material {
            metallic: 1.0,
            ..grey(0.9)
        },
        Material {
            opacity: 0.0,
            ..WHITE
        },
        Material {
            subsurface: 0.5,
            sheen: 0.5,
            sheen_tint: 0.5,
            specular_tint: 0.5,
            ..disney
        },
        Material {
            metallic: 1.0,
            anisotropic: 0.7,
            roughness: 0.3,
            ..disney
        },
        Material {
            opacity: 0.0,
            roughness: 0.3,
            ..disney
        },
        Material {
            clearcoat: 1.0,
            clearcoat_gloss: 0.7,
            ..disney
        },
        conductor,
        Material {
            roughness: 0.0,
            ..conductor
        },
        Material {
            interface: Interface {
                distribution: Distribution::Beckmann,
                ..gold
            },
            anisotropic: 0.5,
            ..conductor
        },
        plastic,
        Material {
            roughness: 0.0,
            interface: Interface {
                nonlinear: true,
                ..body
            },
            ..plastic
        },
        glass,
        Material {
            interface: beckmann,
            ..glass
        },
        Material {
            roughness: 0.0,
            ..glass
        },
        Material {
            interface: Interface {
                thin: true,
                ..Interface::PLAIN
            },
            ..glass
        },
    ]
}

/// Kinds of light, one for each scene.
const LIGHTS: [&str; 5] = [
    "triangles",
    "spheres",
    "points",
    "directions",
    "environment",
];

/// Returns a scene with a ball of every extreme material over a floor, under one kind of light.
pub fn balls(lamp: &str) -> Arc<CompiledScene> {
    let mut builder = SceneBuilder::new(Vec3::new(0.0, 2.2, 4.4), Vec3::new(0.0, 0.1, -0.2), 50.0)
        .floor(3.0, 0.0, grey(0.5));
    if lamp == "triangles" {
        builder = builder.ceiling(1.0, 3.0, light(4.0));
    }
    for (i, material) in extreme_materials().into_iter().enumerate() {
        let place = Vec3::new(i as f32 % 4.0 - 1.5, 0.4, (i / 4) as f32 - 2.0);
        builder = builder.sphere(place, 0.36, material);
    }
    match lamp {
        "triangles" => builder,
        "spheres" => builder.sphere(Vec3::new(1.0, 3.0, 1.0), 0.5, light(12.0)),
        "points" => builder.point(Vec3::new(-1.0, 2.5, 1.0), Vec3::splat(8.0)),
        "directions" => builder.directional(Vec3::new(0.4, -1.0, -0.2), Vec3::splat(2.0)),
        _ => {
            let sky: Vec<[f32; 3]> = (0..8)
                .map(|i| [0.2 * i as f32, 0.5, 1.6 - 0.2 * i as f32])
                .collect();
            builder.environment(Some(Texture::new(4, 2, sky)), Vec3::ONE, 40.0)
        }
    }
    .build()
}

/// Returns the total of a film over its samples.
fn total(film: &Film) -> f64 {
    film.sum.as_flattened().iter().sum::<f64>() / film.samples as f64
}

#[test]
fn every_material_light_camera_and_filter_gives_the_light_of_the_cpu_at_every_depth() {
    let device = or_return!(harness::device());
    let filters = [
        (FilterKind::Box, 0.5),
        (FilterKind::Gauss, 1.0),
        (FilterKind::BlackmanHarris, 1.5),
        (FilterKind::Tent, 1.0),
    ];
    for (i, lamp) in LIGHTS.into_iter().enumerate() {
        let mut scene = balls(lamp);
        if i % 2 == 1 {
            let camera = &mut Arc::make_mut(&mut scene).camera;
            (camera.optics, camera.focus_distance) = (camera.optics.with_aperture(0.1), Some(4.5));
        }
        for row in INTEGRATORS.iter().filter(|row| harness::renders(row)) {
            let (kind, radius) = filters[i % filters.len()];
            let filter = FilterSpec { kind, radius };
            // Each integrator has one pipeline: only data differs between kinds of light.
            let sampler = match row.name {
                "bdpt" => SOBOL,
                "nee" => sampler("zsobol4").unwrap(),
                _ => INDEPENDENT,
            };
            let plain = technique_job(row.name, 20 + i as u64);
            let job = Job {
                sampler,
                resolution: [32, 20],
                ..plain
            }
            .with(|settings| {
                settings.filter = filter;
                settings.films = vec![Layer::Depth];
            });
            let name = format!("{} under {lamp}", row.name);
            let (found, expected) = both(&device, &scene, &job, 8);
            if matches!(lamp, "points" | "directions") && row.name == "bpt" {
                assert!(
                    total(&expected[0]) == 0.0 && total(&found[0]) == 0.0,
                    "{name}: `bpt` found light that it cannot find"
                );
                continue;
            }
            compare_loosely(&name, &found[0], &expected[0]);
            let whole = total(&expected[0]);
            for (depth, (found, expected)) in found.iter().zip(&expected).enumerate().skip(1) {
                let (a, b) = (total(found), total(expected));
                assert!(
                    (a - b).abs() <= 2e-3 * whole.abs(),
                    "{name}, depth {depth}: {a} instead of {b} of {whole}"
                );
            }
        }
    }
    harness::assert_no_validation_messages();
}

/// Returns the picture and the films by depth of a device, and of the CPU.
fn both(
    device: &Arc<Device>,
    scene: &Arc<CompiledScene>,
    job: &Job,
    samples: u64,
) -> (Vec<Film>, Vec<Film>) {
    let kind = harness::fastest_to_compile(device);
    let films = |renderer: &mut dyn Renderer| {
        let stats = renderer.advance(samples).unwrap();
        assert_eq!(stats.invalid, 0, "first at {:?}", stats.first_invalid);
        let layers = (0..renderer.layers().len()).map(|i| renderer.layer(i).unwrap());
        std::iter::once(renderer.film().clone())
            .chain(layers)
            .collect::<Vec<Film>>()
    };
    let found =
        films(&mut VulkanRenderer::new(device, kind, &harness::sources(), scene, job).unwrap());
    (
        found,
        films(&mut CpuRenderer::new(Arc::clone(scene), job.clone()).unwrap()),
    )
}

#[test]
fn extreme_materials_give_the_same_picture_in_compute_shaders() {
    let device = or_return!(harness::device());
    let (scene, job) = (balls("triangles"), technique_job("bpt", 31));
    let expected = common::render(&scene, job.clone(), 8);
    compare_loosely(
        "interfaces in a compute shader",
        &render(&device, TracingMode::Compute, &scene, &job, 8),
        &expected,
    );
    harness::assert_no_validation_messages();
}

/// A leaf that stands on a floor, and one that shades it; `masked` makes them partly transparent.
fn leaves(masked: bool) -> Arc<CompiledScene> {
    let mut builder = SceneBuilder::new(Vec3::new(0.0, 0.5, 3.0), Vec3::new(0.0, 0.4, 0.0), 45.0);
    let texels = vec![[0.2; 3], [0.8; 3], [0.5; 3], [0.35; 3]];
    let half = builder.texture(Texture::new(2, 2, texels));
    let leaf = Material {
        mask_texture: if masked { half } else { NONE },
        mask_mode: MaskMode::Blend,
        // Dark, so that what shows through is brighter.
        ..grey(0.1)
    };
    let floor = Vec3::new(-2.0, 0.0, 2.0);
    let shade = Vec3::new(-1.0, 1.8, 0.4);
    builder
        .quad(floor, Vec3::X * 4.0, Vec3::Z * -4.0, grey(0.5))
        .quad(Vec3::new(-1.0, 0.0, 0.6), Vec3::X * 2.0, Vec3::Y, leaf)
        .quad(shade, Vec3::X * 2.0, Vec3::Z * -1.0, leaf)
        .directional(Vec3::new(0.1, -1.0, -0.4), Vec3::splat(1.5))
        .environment(None, Vec3::splat(0.4), 0.0)
        .build()
}

#[test]
fn pictures_with_blended_masks_agree_within_noise() {
    let device = or_return!(harness::device());
    let scene = leaves(true);
    let job = common::named_job("nee", [24, 16], 4, 5);
    let expected = common::render(&scene, job.clone(), 256);
    let compare = |found: &Film, expected: &Film| {
        let (a, b) = (
            [found.mean(), expected.mean()],
            [found.variance_of_mean(), expected.variance_of_mean()],
        );
        let estimate = |i: usize| Estimate {
            mean: &a[i],
            variance: &b[i],
        };
        ztest::compare(estimate(0), estimate(1), 4, 0.0)
    };
    let ignored = common::render(&leaves(false), job.clone(), 256);
    let test = compare(&ignored, &expected);
    assert!(!test.agrees(1e-3, 1), "masks without effect: {test:?}");
    let kinds: Vec<TracingMode> = supported_modes(&device)
        .into_iter()
        .filter(|kind| *kind != TracingMode::Query)
        .collect();
    for kind in &kinds {
        // Another seed makes the two independent where the bits of rays do not decide.
        let found = render(
            &device,
            *kind,
            &scene,
            &Job {
                seed: 6,
                ..job.clone()
            },
            256,
        );
        let test = compare(&found, &expected);
        println!("blended masks by {}: {test:?}", kind.backend());
        assert!(
            test.agrees(1e-3, kinds.len()),
            "{}: {test:?}",
            kind.backend()
        );
    }
    harness::assert_no_validation_messages();
}
