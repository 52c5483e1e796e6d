//! Orthographic and spherical cameras: their rays, their densities, and the pictures of every
//! technique.

use std::sync::Arc;

use glam::Vec3;
use lumbre_light::math::stats::{normal_two_sided_p, sidak};
use lumbre_light::math::warp::uniform_sphere;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{Environment, Material};
use lumbre_light::scene::desc::{CameraDesc, CameraKind};
use lumbre_light::transport::camera::{Camera, FilterKind, FilterSpec};
use lumbre_light::transport::integrator::INTEGRATORS;
use lumbre_light::transport::ray::Ray;
use lumbre_light::value::Value;
use lumbre_render::{Job, Renderer};

use crate::common::{
    SceneBuilder, WHITE, grey, job, light, render, render_waves, timed_job, timing,
};
use crate::render::agreement::{agree_with_bpt, params, room};
use crate::render::camera::{Splats, mean_inverse_density, moments, uniform};

const SIZE: [u32; 2] = [10, 6];

/// The kinds of cameras without a centre of projection or without a border.
const KINDS: [CameraKind; 2] = [CameraKind::Orthographic, CameraKind::Spherical];

/// Returns a camera in the middle of things that looks along no axis.
fn desc(kind: CameraKind) -> CameraDesc {
    CameraDesc {
        kind,
        position: Vec3::new(0.7, -1.0, 2.5),
        target: Vec3::new(0.1, 0.1, 0.0),
        up: Vec3::new(0.1, 1.0, 0.2),
        view_height: 1.6,
        ..CameraDesc::default()
    }
}

/// Changes the camera of a scene.
fn seen_by(scene: &Arc<CompiledScene>, change: impl FnOnce(&mut CameraDesc)) -> Arc<CompiledScene> {
    let mut scene = CompiledScene::clone(scene);
    change(&mut scene.camera);
    Arc::new(scene)
}

#[test]
fn a_point_on_a_ray_is_projected_to_where_the_ray_was_sampled() {
    for kind in KINDS {
        let camera = Camera::new(&desc(kind), SIZE, FilterSpec::PIXEL);
        for i in 0..20_000 {
            let [a, b, c, d] = uniform(i, 1);
            let pixel = [(a * SIZE[0] as f32).floor(), (b * SIZE[1] as f32).floor()];
            let [origin, dir]: [Vec3; 2] = camera.ray(pixel, [c, d], [0.5; 2]);
            let distance = 0.1 + 3.0 * a;
            let at = camera.project(origin + dir * distance, [0.5; 2]);
            assert!(at.ahead, "{kind:?}");
            let close = [c, d].iter().enumerate().all(|(k, u)| {
                let error = (at.raster[k] - pixel[k] - u).abs();
                // At the pole, all longitudes are the same direction.
                error < if k == 0 { 1e-2 } else { 1e-3 }
            });
            assert!(close, "{kind:?}: {:?} {pixel:?} {c} {d}", at.raster);
            assert!((at.lens - origin).length() < 1e-5 && (at.dir - dir).length() < 1e-5);
            assert!((at.distance - distance).abs() < 1e-5);
        }
    }
}

#[test]
fn the_film_of_a_sphere_shows_what_is_around_the_camera() {
    let camera = Camera::new(
        &CameraDesc {
            kind: CameraKind::Spherical,
            ..CameraDesc::default()
        },
        [400, 200],
        FilterSpec::PIXEL,
    );
    let pixel = |dir: Vec3| camera.connect(dir * 2.0, [0.5; 2], [0.5; 2]).unwrap().pixel;
    // The camera looks along -z with +y up.
    assert_eq!(pixel(Vec3::new(0.001, 0.001, -1.0)), [200, 99]);
    assert_eq!(pixel(Vec3::new(1.0, -0.001, -0.001)), [299, 100]);
    assert_eq!(pixel(Vec3::new(-1.0, -0.001, -0.001)), [100, 100]);
    assert_eq!(pixel(Vec3::new(0.001, -0.001, 1.0)), [399, 100]);
    assert_eq!(pixel(Vec3::new(-0.001, -0.001, 1.0)), [0, 100]);
    // What is exactly behind the camera belongs to the first column.
    assert_eq!(pixel(Vec3::Z), [0, 100]);
    assert_eq!(pixel(Vec3::new(0.0, 1.0, -0.001))[1], 0);
    assert_eq!(pixel(Vec3::new(0.0, -1.0, -0.001))[1], 199);
}

#[test]
fn what_is_behind_or_beside_an_orthographic_camera_is_not_connected() {
    let camera = Camera::new(
        &CameraDesc {
            kind: CameraKind::Orthographic,
            view_height: 2.0,
            ..CameraDesc::default()
        },
        [4, 2],
        FilterSpec::PIXEL,
    );
    let connect = |x, y, z| camera.connect(Vec3::new(x, y, z), [0.5; 2], [0.5; 2]);
    let c = connect(1.9, -0.9, -3.0).unwrap();
    assert_eq!((c.pixel, c.dir, c.distance), ([3, 1], Vec3::NEG_Z, 3.0));
    assert_eq!(c.lens, Vec3::new(1.9, -0.9, 0.0));
    // One over the area of the rectangle, whatever the distance.
    assert!((c.importance - 1.0 / 8.0).abs() < 1e-6);
    assert!((c.pdf_w - 9.0 / 8.0).abs() < 1e-6);
    assert!(connect(0.0, 0.0, 0.1).is_none());
    assert!(connect(2.1, 0.0, -1.0).is_none());
    assert!(connect(0.0, 1.1, -1.0).is_none());
    assert!(connect(f32::NAN, 0.0, -1.0).is_none());
    for dir in [
        Vec3::NEG_Z,
        Vec3::X,
        Vec3::new(0.1, 0.0, -1.0).normalize_or_zero(),
    ] {
        assert!(camera.connect_direction(dir, [0.5; 2], [0.5; 2]).is_none());
    }
}

#[test]
fn the_density_of_spherical_directions_integrates_to_one() {
    let camera = Camera::new(&desc(CameraKind::Spherical), SIZE, FilterSpec::PIXEL);
    let (mean, variance) = moments(400_000, |i| {
        let [a, b, ..] = uniform(i, 3);
        let dir: Vec3 = uniform_sphere([a, b]);
        f64::from(camera.pdf_w(dir)) * 4.0 * std::f64::consts::PI
    });
    // The density is infinite at the poles, and so is its variance: the logarithm of it converges.
    assert!(
        (mean - 1.0).abs() < 0.01 && variance.sqrt() < 0.01,
        "{mean} {variance}"
    );
    // The mean of its inverse over camera rays is the solid angle of everything.
    let (mean, variance) = mean_inverse_density(&camera, SIZE, 4000 * SIZE[0] * SIZE[1]);
    let p = normal_two_sided_p((mean - 4.0 * std::f64::consts::PI) / variance.sqrt());
    assert!(p > 0.001, "{mean}");
}

/// Returns the radiance of the sphere of radius 1.5 about the camera at a point.
fn pattern(p: Vec3) -> f64 {
    let step = if (p.x * 2.3).floor() as i32 % 2 == 0 {
        1.0
    } else {
        0.3
    };
    f64::from(step * (2.0 + p.y) * (1.2 - 0.4 * p.z))
}

/// Side of the square about the camera's axis that emits in front of an orthographic camera.
const SQUARE: f32 = 1.8;

/// Returns a random point of a surface that emits, its normal, and the area over the density of all
/// such points: a sphere about a spherical camera, a tilted square in front of an orthographic one.
fn emitting_point(kind: CameraKind, camera: &Camera, [a, b]: [f32; 2]) -> (Vec3, Vec3, f64) {
    if kind == CameraKind::Spherical {
        let dir: Vec3 = uniform_sphere([a, b]);
        let area = 4.0 * std::f64::consts::PI * 1.5 * 1.5;
        return (camera.position + dir * 1.5, -dir, area);
    }
    let tilted = (camera.up + 0.7 * camera.forward).normalize_or_zero();
    let middle = camera.position + camera.forward * 2.0;
    let at = middle + (camera.right * (a - 0.5) + tilted * (b - 0.5)) * SQUARE;
    let normal = camera.right.cross(tilted);
    (at, normal, f64::from(SQUARE * SQUARE))
}

/// Returns the radiance that a ray of the camera finds.
fn radiance_along(kind: CameraKind, camera: &Camera, origin: Vec3, dir: Vec3) -> f64 {
    if kind == CameraKind::Spherical {
        return pattern(dir * 1.5);
    }
    let tilted = (camera.up + 0.7 * camera.forward).normalize_or_zero();
    let normal = camera.right.cross(tilted);
    let middle = camera.position + camera.forward * 2.0;
    let t = (middle - origin).dot(normal) / dir.dot(normal);
    let at = origin + dir * t - middle;
    let inside = [camera.right, tilted]
        .iter()
        .all(|axis| at.dot(*axis).abs() <= 0.5 * SQUARE);
    if inside { pattern(at) } else { 0.0 }
}

#[test]
fn light_paths_connected_to_the_camera_equal_camera_rays_in_every_pixel() {
    let filters = FilterKind::ALL.map(|kind| {
        let radius = match kind {
            FilterKind::AntialiasingRadius => 0.4,
            _ => 1.4,
        };
        FilterSpec { kind, radius }
    });
    let pixels = (SIZE[0] * SIZE[1]) as usize;
    let significance = sidak(0.001, KINDS.len() * (filters.len() + 1) * pixels);
    for kind in KINDS {
        for filter in filters.iter().copied().chain([FilterSpec::PIXEL]) {
            let camera = Camera::new(&desc(kind), SIZE, filter);
            let n_light = 400_000u32;
            let mut splats = Splats::new(SIZE);
            for i in 0..n_light {
                let [a, b, e, f] = uniform(i, 1);
                let (point, normal, area) = emitting_point(kind, &camera, [a, b]);
                let Some(to) = camera.connect(point, [0.5; 2], [e, f]) else {
                    continue;
                };
                let middle = if kind == CameraKind::Spherical {
                    camera.position
                } else {
                    camera.position + camera.forward * 2.0
                };
                let cos = to.dir.dot(normal).abs();
                let value = area * pattern(point - middle) * f64::from(cos * to.importance);
                splats.add(to.pixel, value);
            }
            let found = |ray: &Ray| radiance_along(kind, &camera, ray.origin, ray.dir);
            let what = format!("{kind:?} {filter:?}");
            splats.assert_equal_to_rays(n_light, &camera, (10_000, significance), found, &what);
        }
    }
}

/// Returns the environment of radiance one.
fn white() -> Environment {
    Environment {
        radiance: Vec3::ONE,
        map: None,
        rotation_rad: 0.0,
        sampling: Default::default(),
    }
}

#[test]
fn a_white_environment_is_white_in_every_pixel() {
    // Around the camera and around a white sphere, which reflects all that it receives.
    let scene = SceneBuilder::new(Vec3::new(0.2, 0.1, 2.0), Vec3::new(0.2, 0.1, 0.0), 50.0)
        .sphere(Vec3::ZERO, 0.6, WHITE)
        .with(|s| s.environment = Some(white()))
        .build();
    for kind in KINDS {
        let scene = seen_by(&scene, |camera| {
            (camera.kind, camera.view_height) = (kind, 1.7);
        });
        let rows = INTEGRATORS.iter().filter(|row| row.bias.is_none());
        let rows: Vec<_> = rows.collect();
        let level = sidak(0.001, rows.len() * 2);
        for row in rows {
            let j = Job {
                integrator: row,
                ..job([16, 12], 6, 3)
            };
            let film = render(&scene, j, 600);
            let (picture, variance) = (film.mean(), film.variance_of_mean());
            let n = picture.data.len() as f64;
            let mean: f64 = picture.data.iter().map(|p| f64::from(p[1])).sum::<f64>() / n;
            let error: f64 = variance
                .data
                .iter()
                .map(|p| f64::from(p[1]))
                .sum::<f64>()
                .sqrt()
                / n;
            let z = (mean - 1.0) / error.max(1e-6);
            assert!(
                normal_two_sided_p(z) > level && error < 0.01,
                "{kind:?} {}: {mean} +- {error}",
                row.name
            );
            if kind == CameraKind::Orthographic {
                // Only camera paths find the environment that is seen directly, without noise.
                let direct = picture.at(0, 0)[1];
                assert!((direct - 1.0).abs() < 1e-5, "{}: {direct}", row.name);
            }
        }
    }
}

#[test]
fn all_techniques_agree_on_lamps_seen_and_unseen() {
    let mirror = Material {
        metallic: 1.0,
        ..WHITE
    };
    let scene = room(Vec3::new(0.3, 1.1, 1.6))
        .sphere(Vec3::new(-0.6, 0.5, 0.0), 0.4, mirror)
        .sphere(Vec3::new(0.5, 0.4, 0.2), 0.35, light(2.0))
        .sphere(Vec3::new(0.9, 0.3, -0.7), 0.3, grey(0.8))
        .with(|s| s.environment = Some(white()))
        .build();
    for kind in KINDS {
        let scene = seen_by(&scene, |camera| {
            (camera.kind, camera.view_height) = (kind, 2.4);
        });
        agree_with_bpt(&scene, 4, None, 600);
    }
}

#[test]
fn times_of_an_orthographic_camera_are_counted_from_its_plane() {
    // A lamp at distance two fills the picture: its light arrives everywhere after a length of two,
    // whichever strategy finds it.
    let scene = SceneBuilder::new(Vec3::new(0.3, 0.2, 2.0), Vec3::new(0.3, 0.2, 0.0), 50.0)
        .quad(
            Vec3::new(-4.0, -4.0, 0.0),
            Vec3::X * 8.0,
            Vec3::Y * 8.0,
            light(1.0),
        )
        .with(|s| (s.camera.kind, s.camera.view_height) = (CameraKind::Orthographic, 3.0))
        .build();
    for (s, t) in [(0i64, 2i64), (1, 1)] {
        let pair = Value::List(vec![Value::Int(s), Value::Int(t)]);
        let j = timed_job("bdpt", timing(1.55, 0.25, 4), [6, 4], 2, 1).with(|settings| {
            settings.params = params(&[("mis", "none".into()), ("strategies", pair)])
        });
        let renderer = render_waves(&scene, j, &[400]);
        let times = renderer.times().unwrap();
        for slot in 0..6 {
            let mean = times.frame(slot).mean()[0];
            // The second bin, after the slot of what is earlier, is from 1.8 to 2.05.
            let expected = if slot == 2 { 1.0 } else { 0.0 };
            assert!((mean - expected).abs() < 0.1, "{s} {t}, {slot}: {mean}");
        }
    }
}
