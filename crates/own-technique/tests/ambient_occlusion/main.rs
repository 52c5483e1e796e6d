//! The example of docs/inside/extending/integrator.md, which lists `technique.rs`, renders what it
//! should: `tests/library/laws/documents.rs` compares the page with the file.

#![allow(clippy::unwrap_used, reason = "test helpers may panic")]

mod technique;

use std::sync::Arc;

use glam::Vec3;
use lumbre::{OwnTechnique, Trial};
use lumbre_light::film::Film;
use lumbre_light::film::time::{TimeAxis, TimeFilter};
use lumbre_light::scene::desc::Model;
use lumbre_light::scene::desc::{CameraDesc, EntityDesc, MaterialDesc, SceneDesc, ShapeDesc};
use lumbre_light::scene::{CompiledScene, compile};
use lumbre_light::transport::delay::Profile;
use lumbre_light::transport::integrator::integrator;
use lumbre_light::transport::time_settings::Timing;
use lumbre_render::cpu::renderer::CpuRenderer;
use lumbre_render::{Job, Renderer};
use technique::{Ao, DISTANCE, ROW};

/// The technique, in vectors where the CPU has them.
const TECHNIQUE: OwnTechnique = OwnTechnique::camera_paths::<Ao>(ROW);

/// Side of the pictures in pixels, and samples for each pixel.
const SIDE: u32 = 16;
const SAMPLES: u64 = 64;

/// Returns the technique with a value of its parameter.
fn trial(distance: f64) -> Trial {
    Trial::new(&TECHNIQUE, &[(DISTANCE.key, distance.into())]).unwrap()
}

/// Returns the inside of a unit sphere, seen from its centre.
fn inside_a_sphere() -> Arc<CompiledScene> {
    let wall = MaterialDesc {
        model: Model::Lambert,
        ..MaterialDesc::new("wall")
    };
    let sphere = EntityDesc {
        material: Some("wall".into()),
        ..EntityDesc::new("sphere", ShapeDesc::Sphere { radius: 1.0 })
    };
    let desc = SceneDesc {
        resolution: [SIDE; 2],
        max_depth: 2,
        camera: CameraDesc {
            position: Vec3::ZERO,
            ..CameraDesc::default()
        },
        materials: vec![wall].into(),
        entities: vec![sphere].into(),
        ..SceneDesc::default()
    };
    Arc::new(compile(&desc).unwrap().0)
}

/// Returns the job with a value of the parameter.
fn job(distance: f64) -> Job {
    trial(distance);
    Job::plain(integrator(ROW.name).unwrap(), [SIDE; 2], 2, 1)
        .with(|settings| settings.params = [(DISTANCE.key.to_owned(), distance.into())].into())
}

/// Renders a job.
fn render(job: Job) -> CpuRenderer {
    let mut renderer = CpuRenderer::new(inside_a_sphere(), job).unwrap();
    assert_eq!(renderer.advance(SAMPLES).unwrap().invalid, 0);
    renderer
}

/// Returns the mean of a picture, and checks that it has no colour.
fn mean(film: &Film) -> f64 {
    let [r, g, b] = film.mean().mean();
    assert!(r == g && g == b, "{r} {g} {b}");
    r
}

/// A ray at the angle `t` to the normal leaves a unit sphere after `2 cos t`, so rays are open if
/// that is more than `d`, which cosine-distributed directions are with the probability
/// `1 - (d / 2)^2`.
#[test]
fn the_inside_of_a_sphere_is_as_open_as_the_closed_form_says() {
    let samples = f64::from(SIDE * SIDE) * SAMPLES as f64;
    for distance in [0.2, 0.5, 1.0, 1.5] {
        let open = 1.0 - distance * distance / 4.0;
        let error = (open * (1.0 - open) / samples).sqrt();
        let found = mean(render(job(distance)).film());
        assert!(
            (found - open).abs() < 4.0 * error,
            "distance {distance}: {found} instead of {open} +- {error}"
        );
    }
    assert_eq!(mean(render(job(2.5)).film()), 0.0);
}

#[test]
fn vectors_threads_and_waves_do_not_change_a_bit() {
    trial(0.4).same_bits().unwrap();
    trial(0.4).seeds().unwrap();
    let single = job(1.0).with(|settings| settings.accel = settings.accel.scalar());
    assert_eq!(render(single).film(), render(job(1.0)).film());
}

#[test]
fn a_film_with_a_time_axis_sums_to_the_picture() {
    let timed = job(1.0).with(|settings| {
        settings.timing = Some(Timing {
            axis: TimeAxis {
                start: 0.0,
                bin: 0.25,
                bins: 8,
            },
            filter: TimeFilter::None,
            camera: true,
            medium: 1.0,
            emission: Profile::NONE,
            metres: 0.0,
        })
    });
    let timed = render(timed);
    assert_eq!(timed.film(), render(job(1.0)).film());
    assert_eq!(timed.times().unwrap().steady(), timed.film().mean());
}
