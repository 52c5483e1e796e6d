//! All integrators render the same picture of surfaces of the Disney model.

use std::sync::Arc;

use glam::Vec3;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::Material;
use lumbre_light::transport::arrival::SurfaceClasses;
use lumbre_light::transport::camera::{Camera, FilterSpec};
use lumbre_light::transport::integrator::bdpt::directions::BsdfDirections;
use lumbre_light::transport::integrator::bdpt::single::{Subpaths, for_each_path};
use lumbre_light::transport::integrator::{Context, Settings};
use lumbre_light::transport::light::Lights;
use lumbre_light::transport::sampler::Sampler;
use lumbre_render::cpu::bvh::accel::Accel;

use crate::common::light;
use crate::render::agreement::{
    EYE, Params, SIDE, Setting, agree, agree_with_bpt, room, technique, variants,
};
use crate::render::bsdf_grid::DISNEY;

/// Centre and radius of the spherical light.
const LAMP: (Vec3, f32) = (Vec3::new(-0.3, 1.45, -0.4), 0.3);

/// Returns a room with two balls of rough glass; the parameters are their roughness.
fn glass(frosted: f32, clear: f32) -> Arc<CompiledScene> {
    let frosted = Material {
        opacity: 0.0,
        roughness: frosted,
        base_color: Vec3::new(0.9, 1.0, 0.9),
        ..DISNEY
    };
    let clear = Material {
        opacity: 0.0,
        roughness: clear,
        ior: 1.3,
        base_color: Vec3::new(1.0, 0.8, 0.9),
        ..DISNEY
    };
    room(EYE)
        .sphere(Vec3::new(-0.6, 0.5, 0.0), 0.45, frosted)
        .sphere(Vec3::new(0.6, 0.5, 0.3), 0.45, clear)
        .sphere(LAMP.0, LAMP.1, light(6.0))
        .build()
}

/// Compares all techniques except those with `mis = "none"`. Without weights by density,
/// connections through a narrow lobe are rarely found and then contribute so much that the
/// estimated error of a run is unreliable. Standard deviation of block means over 40 to 120 runs of
/// 900 samples, in units of the standard error that each run estimates, and the largest deviation:
///
/// | roughness | `bpt`, and the others by power and balance | `nee`, none | `bdpt`, none |
/// |---|---|---|---|
/// | 0.65, 0.5 | 0.96 .. 0.98, -3.8 | 0.98, -3.2; in one block 3.4 | 1.6, -11 |
/// | 0.35, 0.2 | 0.94 .. 1.00, -3.4 | 2.0, -12 | 3.0, -25 |
///
/// The mean is unbiased where noise allows a test: at roughness 0.65 and 0.5 the mean red of the
/// picture over 150 runs is 0.3906 +- 0.0008 (median 0.388, maximum 0.49), that of `bpt` 0.3905 +-
/// 0.0001. With equal weights for all k + 1 strategies, those that hit the light find their share
/// of each depth k from 2 to 6 to within 0.2 to 0.6 % at roughness 1 and 0.9, and those that
/// connect on the glass find theirs at five edges to within 1 to 3 %. `oracle` compares the weights
/// of `mis = "none"` with their definition path by path.
#[test]
fn integrators_agree_on_rough_glass() {
    let mut weighted = variants();
    weighted.retain(|(_, params)| params.get("mis") != Some(&"none".into()));
    for (frosted, clear) in [(0.65, 0.5), (0.35, 0.2)] {
        let scene = &glass(frosted, clear);
        let setting = Setting {
            scene,
            depth: 6,
            rr_start: None,
            samples: 900,
            noise: 0.01,
        };
        agree(setting, &technique("bpt", &[]), &weighted);
    }
}

/// Checks a regression: for one sample in 10^8, rounding placed a light point sampled at the rim of
/// the spherical light on the hidden side, and the weight was 0 / 0.
#[test]
fn weights_of_light_from_the_rim_of_a_sphere_are_finite() {
    let scene = &glass(0.35, 0.2);
    let (accel, lights) = (Accel::build(Arc::clone(scene)).unwrap(), Lights::new(scene));
    let camera = &Camera::new(&scene.camera, [SIDE as u32; 2], FilterSpec::PIXEL);
    let settings = &Settings::new(&Params::new());
    let trace = &accel;
    let context = Context {
        scene,
        camera,
        lights: &lights,
        classes: &SurfaceClasses::new(scene),
        trace,
        max_depth: 6,
        rr_start: None,
        settings,
        params: &Params::new(),
        timing: None,
        shared: None,
    };
    let mut sampler = Sampler::new(3016, [7, 5], 15207);
    let mut found = 0;
    for_each_path(
        &context,
        BsdfDirections,
        [7, 5],
        &mut sampler,
        &mut Subpaths::default(),
        &mut |f| {
            assert!(
                f.weight.is_finite() && f.contribution.value.is_finite(),
                "{:?}",
                f.contribution
            );
            found += 1;
        },
    );
    assert!(found > 4);
}

#[test]
fn integrators_agree_on_anisotropic_metal() {
    let brushed = Material {
        metallic: 1.0,
        roughness: 0.4,
        anisotropic: 0.9,
        base_color: Vec3::new(0.9, 0.8, 0.7),
        ..DISNEY
    };
    let upright = Material {
        anisotropic_direction: Vec3::Y,
        roughness: 0.3,
        ..brushed
    };
    let scene = room(EYE)
        .quad(
            Vec3::new(-1.9, 0.1, 0.8),
            Vec3::new(1.2, 0.0, -1.6),
            Vec3::Y * 1.6,
            brushed,
        )
        .sphere(Vec3::new(0.5, 0.5, 0.2), 0.45, upright)
        .sphere(LAMP.0, LAMP.1, light(6.0))
        .build();
    agree_with_bpt(&scene, 5, None, 450);
}

#[test]
fn integrators_agree_on_a_clear_coat_over_a_mixture() {
    let mixed = Material {
        metallic: 0.3,
        opacity: 0.5,
        roughness: 0.3,
        clearcoat: 1.0,
        clearcoat_gloss: 0.3,
        base_color: Vec3::new(0.9, 0.7, 0.5),
        ..DISNEY
    };
    // Dirac lobes beside lobes with a density.
    let smooth = Material {
        roughness: 0.0,
        ..mixed
    };
    let scene = room(EYE)
        .sphere(Vec3::new(-0.6, 0.5, 0.0), 0.45, mixed)
        .sphere(Vec3::new(0.6, 0.5, 0.3), 0.45, smooth)
        .sphere(LAMP.0, LAMP.1, light(6.0))
        .build();
    agree_with_bpt(&scene, 6, None, 450);
}

#[test]
fn integrators_agree_on_cloth_and_on_a_surface_seen_from_behind() {
    let velvet = Material {
        sheen: 1.0,
        sheen_tint: 0.5,
        subsurface: 0.7,
        specular_tint: 0.6,
        roughness: 0.6,
        ..DISNEY
    };
    // Its front faces away from the camera and towards the wall of the light.
    let curtain = Material {
        roughness: 0.3,
        base_color: Vec3::new(0.3, 0.5, 0.8),
        ..DISNEY
    };
    let scene = room(EYE)
        .quad(
            Vec3::new(1.6, 0.1, 0.5),
            Vec3::new(-1.3, 0.0, 0.4),
            Vec3::Y * 1.2,
            curtain,
        )
        .sphere(Vec3::new(-0.6, 0.5, 0.0), 0.45, velvet)
        .sphere(LAMP.0, LAMP.1, light(6.0))
        .build();
    agree_with_bpt(&scene, 5, None, 450);
}
