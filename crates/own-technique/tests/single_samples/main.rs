//! The example of docs/reference/own_technique.md, which lists `technique.rs`, passes the checks of
//! an unbiased technique: `tests/library/laws/documents.rs` compares the page with the file.

#![allow(clippy::unwrap_used, reason = "test helpers may panic")]

mod technique;

use std::sync::Arc;

use glam::Vec3;
use lumbre::Trial;
use lumbre_light::film::time::{TimeAxis, TimeFilter};
use lumbre_light::scene::desc::{CameraDesc, EntityDesc, MaterialDesc, SceneDesc, ShapeDesc};
use lumbre_light::scene::desc::{Model, Transform};
use lumbre_light::scene::{CompiledScene, compile};
use lumbre_light::transport::delay::Profile;
use lumbre_light::transport::integrator::integrator;
use lumbre_light::transport::time_settings::Timing;
use lumbre_render::cpu::renderer::CpuRenderer;
use lumbre_render::{Job, Renderer};
use technique::TECHNIQUE;

/// Returns the technique.
fn trial() -> Trial {
    Trial::new(&TECHNIQUE, &[]).unwrap()
}

#[test]
fn pictures_have_the_radiance_of_the_furnace_and_of_path_tracing() {
    for edges in [2, 5] {
        trial().max_depth(edges).furnace().unwrap();
        trial().max_depth(edges).agreement("bpt").unwrap();
    }
}

#[test]
fn samples_depend_on_seed_and_index_alone() {
    trial().same_bits().unwrap();
    trial().seeds().unwrap();
}

/// Returns a diffuse sphere and a small light beside the camera.
fn two_spheres() -> Arc<CompiledScene> {
    let material = |name: &str, emission: f32| MaterialDesc {
        model: Model::Lambert,
        emission: Vec3::splat(emission),
        ..MaterialDesc::new(name)
    };
    let sphere = |name: &str, x: f32, radius: f32| EntityDesc {
        name: name.into(),
        transform: Transform {
            translate: (Vec3::X * x).as_dvec3(),
            ..Transform::default()
        },
        material: Some(name.into()),
        anisotropic_direction: None,
        shape: ShapeDesc::Sphere { radius },
    };
    let desc = SceneDesc {
        resolution: [16; 2],
        max_depth: 4,
        camera: CameraDesc {
            position: Vec3::Z * 4.0,
            ..CameraDesc::default()
        },
        materials: vec![material("wall", 0.0), material("light", 5.0)].into(),
        entities: vec![sphere("wall", -0.6, 1.0), sphere("light", 0.9, 0.4)].into(),
        ..SceneDesc::default()
    };
    Arc::new(compile(&desc).unwrap().0)
}

/// Returns the mean of every time bin, by a technique with the given parameters.
fn time_bins(name: &str, params: &[(&str, &str)]) -> Vec<f64> {
    let timing = Timing {
        axis: TimeAxis {
            start: 3.0,
            bin: 0.1,
            bins: 48,
        },
        filter: TimeFilter::None,
        camera: true,
        medium: 1.0,
        emission: Profile::NONE,
        metres: 0.0,
    };
    let params = params
        .iter()
        .map(|(key, value)| ((*key).to_owned(), (*value).into()));
    let job = Job::plain(integrator(name).unwrap(), [16; 2], 4, 1).with(|settings| {
        settings.params = params.collect();
        settings.timing = Some(timing);
    });
    let mut renderer = CpuRenderer::new(two_spheres(), job).unwrap();
    assert_eq!(renderer.advance(64).unwrap().invalid, 0);
    let times = renderer.times().unwrap();
    let pixels = || (0..16).flat_map(|y| (0..16).map(move |x| (x, y)));
    let slots = 0..times.slots(0, 0).len();
    let sum = |slot: usize| pixels().map(|(x, y)| times.slots(x, y)[slot][0]).sum();
    slots.map(sum).collect()
}

#[test]
fn light_arrives_when_that_of_nee_does() {
    trial();
    let own = time_bins("single_nee", &[]);
    let nee = time_bins("nee", &[("mis", "balance")]);
    assert!(
        own.iter().filter(|light| **light > 0.0).count() > 8,
        "{own:?}"
    );
    // Both take the same random numbers for the same decisions.
    for (bin, (a, b)) in own.iter().zip(&nee).enumerate() {
        assert!((a - b).abs() <= 1e-3 * b, "bin {bin}: {a} and {b}");
    }
}
