//! Cameras: light paths that end on the lens carry the same light as camera paths that start there.

use std::sync::Arc;

use glam::Vec3;
use lumbre_light::math::rng::{pcg4d, unit};
use lumbre_light::math::stats::{normal_two_sided_p, sidak};
use lumbre_light::scene::compile::NONE;
use lumbre_light::scene::desc::{CameraDesc, Optics};
use lumbre_light::transport::bsdf::{Bsdf, TransportMode};
use lumbre_light::transport::camera::{Camera, FilterKind, FilterSpec};
use lumbre_light::transport::contribution::Contribution;
use lumbre_light::transport::integrator::camera_path::{ShadowRay, unoccluded};
use lumbre_light::transport::integrator::{Context, IntegratorRow, integrator};
use lumbre_light::transport::ray::Ray;
use lumbre_light::transport::sampler::Sampler;
use lumbre_light::transport::surface::Surface;
use lumbre_light::transport::vertex::EdgeEnd;
use lumbre_render::Job;

use crate::common::{SceneBuilder, grey, job, light, render};

const SIZE: [u32; 2] = [9, 6];

/// Half width of the square that emits, in the plane z = 0.
const HALF: f32 = 1.5;

fn camera(aperture: f32, filter: FilterSpec) -> Camera {
    let desc = CameraDesc {
        position: Vec3::new(0.7, -1.0, 2.5),
        target: Vec3::new(0.1, 0.1, 0.0),
        up: Vec3::new(0.1, 1.0, 0.2),
        optics: Optics::pinhole(50.0).with_aperture(aperture),
        focus_distance: Some(1.9),
        ..CameraDesc::default()
    };
    Camera::new(&desc, SIZE, filter)
}

/// Returns the radiance of the plane towards `wo`: a stepped pattern, black outside the square
/// and brighter at grazing angles. A wrong position, a wrong cosine or a missing border changes the
/// result.
fn radiance(p: Vec3, wo: Vec3) -> f64 {
    if p.x.abs() > HALF || p.y.abs() > HALF || wo.z <= 0.0 {
        return 0.0;
    }
    let step = if (p.x * 2.3).floor() as i32 % 2 == 0 {
        1.0
    } else {
        0.3
    };
    f64::from(step * (1.4 + p.y) * (1.2 - wo.z))
}

pub(super) fn uniform(i: u32, which: u32) -> [f32; 4] {
    pcg4d([i, which, 88, 99]).map(unit)
}

/// Returns the mean and the variance of the mean from sums.
pub(super) fn estimate(sum: f64, sum2: f64, n: f64) -> (f64, f64) {
    (sum / n, (sum2 - sum * sum / n) / (n - 1.0) / n)
}

/// Returns the mean of `n` values, given their indices, and the variance of the mean.
pub(super) fn moments(n: u32, value: impl Fn(u32) -> f64) -> (f64, f64) {
    let (mut sum, mut sum2) = (0.0f64, 0.0f64);
    for value in (0..n).map(value) {
        sum += value;
        sum2 += value * value;
    }
    estimate(sum, sum2, f64::from(n))
}

/// Returns the mean of 1 / `pdf_w` over `n` camera rays of a film, and the variance of the mean.
pub(super) fn mean_inverse_density(camera: &Camera, size: [u32; 2], n: u32) -> (f64, f64) {
    moments(n, |i| {
        let pixel = [i % size[0], i / size[0] % size[1]];
        let ray = camera.sample_ray(pixel, &mut Sampler::new(6, pixel, u64::from(i)));
        f64::from(1.0 / camera.pdf_w(ray.dir))
    })
}

/// Light that light paths brought to the pixels of a film: sums of values and of their squares.
pub(super) struct Splats {
    size: [u32; 2],
    sums: Vec<[f64; 2]>,
}

impl Splats {
    /// Creates a film without light.
    pub fn new(size: [u32; 2]) -> Splats {
        let sums = vec![[0.0; 2]; (size[0] * size[1]) as usize];
        Splats { size, sums }
    }

    /// Adds the value of a light path to a pixel.
    pub fn add(&mut self, pixel: [u32; 2], value: f64) {
        let [sum, squares] = &mut self.sums[(pixel[1] * self.size[0] + pixel[0]) as usize];
        *sum += value;
        *squares += value * value;
    }

    /// Panics unless the mean over `paths` light paths is that over `rays` camera rays, which find
    /// `radiance`, in every pixel. `what` names the camera.
    pub fn assert_equal_to_rays(
        &self,
        paths: u32,
        camera: &Camera,
        (rays, significance): (u32, f64),
        radiance: impl Fn(&Ray) -> f64,
        what: &str,
    ) {
        // A sample of the film has one light path per pixel: `paths` paths are `paths / pixels`
        // samples.
        let pixels = self.sums.len() as f64;
        for (i, [sum, squares]) in self.sums.iter().enumerate() {
            let (mean, variance) = estimate(*sum, *squares, f64::from(paths));
            let (mean, variance) = (mean * pixels, variance * (pixels * pixels));
            let pixel = [i as u32 % self.size[0], i as u32 / self.size[0]];
            let (mut s, mut s2) = (0.0, 0.0);
            for sample in 0..rays {
                let mut sampler = Sampler::new(5, pixel, u64::from(sample));
                let value = radiance(&camera.sample_ray(pixel, &mut sampler));
                s += value;
                s2 += value * value;
            }
            let (expected, v) = estimate(s, s2, f64::from(rays));
            // Some pixels show nothing that emits.
            let sigma = (variance + v).sqrt().max(1e-12);
            let p = normal_two_sided_p((mean - expected) / sigma);
            assert!(
                p > significance,
                "{what}, pixel {pixel:?}: {mean} {expected}"
            );
        }
    }
}

#[test]
fn light_paths_connected_to_the_camera_equal_camera_rays_in_every_pixel() {
    let filters = [
        (FilterKind::Box, 0.5),
        (FilterKind::Box, 1.2),
        (FilterKind::Tent, 1.0),
        (FilterKind::Gauss, 1.5),
        (FilterKind::BlackmanHarris, 2.0),
        (FilterKind::AntialiasingRadius, 0.3),
    ];
    let pixels = (SIZE[0] * SIZE[1]) as usize;
    let significance = sidak(0.001, 2 * filters.len() * pixels);
    for aperture in [0.0, 0.5] {
        for (kind, radius) in filters {
            let camera = camera(aperture, FilterSpec { kind, radius });
            let n_light = 600_000u32;
            let mut light = Splats::new(SIZE);
            for i in 0..n_light {
                let [a, b, c, d] = uniform(i, 1);
                let [e, f, ..] = uniform(i, 2);
                let point = Vec3::new(2.0 * a - 1.0, 2.0 * b - 1.0, 0.0) * HALF;
                let Some(to) = camera.connect(point, [c, d], [e, f]) else {
                    continue;
                };
                assert!((to.lens + to.dir * to.distance - point).length() < 1e-5);
                let area = f64::from(4.0 * HALF * HALF);
                let value =
                    area * radiance(point, -to.dir) * f64::from(to.dir.z.abs() * to.importance);
                light.add(to.pixel, value);
            }
            let found = |ray: &Ray| {
                if ray.dir.z < 0.0 {
                    radiance(ray.origin - ray.dir * (ray.origin.z / ray.dir.z), -ray.dir)
                } else {
                    0.0
                }
            };
            let what = format!("{kind:?} {radius}, lens {aperture}");
            light.assert_equal_to_rays(n_light, &camera, (12_000, significance), found, &what);
        }
    }
}

#[test]
fn the_density_of_directions_integrates_to_one_over_the_film() {
    // Directions from the pinhole are uniform over the sphere. Those that hit the film have the
    // density of camera rays, the others have density zero.
    let camera = camera(0.0, FilterSpec::PIXEL);
    let (mean, variance) = moments(400_000, |i| {
        let [a, b, c, d] = uniform(i, 3);
        let dir = lumbre_light::math::warp::uniform_sphere([a, b]);
        let point = Vec3::new(0.7, -1.0, 2.5) + dir * 3.0;
        camera.connect(point, [0.5; 2], [c, d]).map_or(0.0, |to| {
            assert!((to.importance * 9.0 / to.pdf_w - 1.0).abs() < 1e-4);
            assert!((camera.pdf_w(dir) / to.pdf_w - 1.0).abs() < 1e-4);
            f64::from(to.pdf_w) * 4.0 * std::f64::consts::PI
        })
    });
    assert!(
        variance.sqrt() < 0.01 && normal_two_sided_p((mean - 1.0) / variance.sqrt()) > 0.001,
        "{mean}"
    );
}

#[test]
fn camera_rays_have_the_density_pdf_w() {
    // The mean of 1 / pdf_w over camera rays of the whole film is the film's solid angle, with or
    // without a lens.
    let solid_angle = |a: f64, b: f64| 4.0 * (a * b / (1.0 + a * a + b * b).sqrt()).atan();
    let y = 25.0f64.to_radians().tan();
    let x = y * 1.5;
    for aperture in [0.0, 0.5] {
        let camera = camera(aperture, FilterSpec::PIXEL);
        let (mean, variance) = mean_inverse_density(&camera, SIZE, 4000 * SIZE[0] * SIZE[1]);
        // From the rim of the lens, the part of the focal plane that the film covers has another
        // direction and another solid angle than from the middle of the lens.
        let expected = if aperture == 0.0 {
            solid_angle(x, y)
        } else {
            mean_solid_angle(x, y, 0.25 / 1.9)
        };
        let p = normal_two_sided_p((mean - expected) / variance.sqrt());
        assert!(
            p > sidak(0.001, 2),
            "lens {aperture}: {mean} instead of {expected}"
        );
    }
}

/// Returns the solid angle of the rectangle of half sides `x` and `y` at distance one, averaged
/// over the points of a disk of radius `r` at distance zero, by a fine grid.
fn mean_solid_angle(x: f64, y: f64, r: f64) -> f64 {
    let corner = |a: f64, b: f64| (a * b / (1.0 + a * a + b * b).sqrt()).atan();
    let (mut sum, mut count) = (0.0, 0.0);
    for i in 0..200 {
        for j in 0..200 {
            let u = r * (f64::from(i) + 0.5) / 100.0 - r;
            let v = r * (f64::from(j) + 0.5) / 100.0 - r;
            if u * u + v * v < r * r {
                sum += corner(x - u, y - v)
                    + corner(x + u, y - v)
                    + corner(x - u, y + v)
                    + corner(x + u, y + v);
                count += 1.0;
            }
        }
    }
    sum / count
}

#[test]
fn points_behind_the_camera_or_outside_the_film_are_not_connected() {
    let pixel = camera(0.0, FilterSpec::PIXEL);
    let (position, target) = (Vec3::new(0.7, -1.0, 2.5), Vec3::new(0.1, 0.1, 0.0));
    let connect = |camera: &Camera, point| camera.connect(point, [0.3, 0.6], [0.2, 0.7]);
    assert!(connect(&pixel, target).is_some());
    assert!(connect(&pixel, position * 2.0 - target).is_none());
    assert_eq!(
        pixel.pdf_w((position - target).try_normalize().unwrap()),
        0.0
    );
    assert!(connect(&pixel, target + Vec3::X * 9.0).is_none());
    assert!(connect(&pixel, position).is_none());
    assert!(connect(&pixel, Vec3::splat(f32::NAN)).is_none());
    let points = camera(
        0.0,
        FilterSpec {
            kind: FilterKind::Box,
            radius: 0.0,
        },
    );
    assert!(connect(&points, target).is_none());
    assert_eq!(
        points.pdf_w((target - position).try_normalize().unwrap()),
        0.0
    );
}

/// Returns a camera with the lens and sensor of a small-format camera, looking along -z from the
/// origin, focused at 2.
fn small_format_camera() -> CameraDesc {
    let optics = Optics::pinhole(170.0)
        .with_aperture(9.0)
        .with_f_number(Some(1.4))
        .with_focal_length(Some(0.05))
        .with_sensor_height(Some(0.024));
    CameraDesc {
        position: Vec3::ZERO,
        target: -2.0 * Vec3::Z,
        up: Vec3::Y,
        focus_distance: None,
        optics,
        ..CameraDesc::default()
    }
}

#[test]
fn sensor_height_and_focal_length_determine_the_field_of_view() {
    let points = FilterSpec {
        kind: FilterKind::Box,
        radius: 0.0,
    };
    let pinhole = CameraDesc {
        optics: small_format_camera().optics.with_aperture(0.0),
        ..small_format_camera()
    };
    let camera = Camera::new(&pinhole, [3, 1000], points);
    // The centre of the top row is half a pixel below the sensor's edge, 12 mm from the axis and 50
    // mm away.
    let dir = camera
        .sample_ray([1, 0], &mut Sampler::new(1, [1, 0], 0))
        .dir;
    assert!(
        (dir.y / -dir.z - 0.012 / 0.05 * 0.999).abs() < 1e-6,
        "{dir}"
    );
}

#[test]
fn the_circle_of_confusion_has_the_diameter_of_the_lens_formula() {
    // Diameter on the sensor: A |z - d| / z * f / d, where A = f / N is the lens, for a sensor at
    // distance f. The film has more rows than could be stored, so that one row is a small error.
    let rows = 100_000u32;
    let camera = Camera::new(&small_format_camera(), [rows, rows], FilterSpec::PIXEL);
    let (lens, focus, focal, height) = (0.05 / 1.4, 2.0, 0.05, 0.024);
    for (depth, x, y) in [
        (2.0f64, 0.0f64, 0.1f64),
        (4.0, 0.0, 0.0),
        (4.0, 0.3, -0.5),
        (1.2, 0.1, 0.1),
        (30.0, 2.0, 2.0),
    ] {
        let expected =
            lens * (depth - focus).abs() / depth * focal / focus / height * f64::from(rows);
        let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
        let (mut sum, mut squares) = (0.0, 0.0);
        let n = 20_000u32;
        let centre = [x, -y].map(|c| (0.5 + c / depth * focal / height) * f64::from(rows));
        for i in 0..n {
            let [a, b, c, d] = uniform(i, 7);
            let point = Vec3::new(x as f32, y as f32, -depth as f32);
            let pixel = camera.connect(point, [a, b], [c, d]).unwrap().pixel;
            let place = pixel.map(|p| f64::from(p) + 0.5);
            let mut r2 = 0.0;
            for k in 0..2 {
                low[k] = low[k].min(place[k]);
                high[k] = high[k].max(place[k]);
                r2 += (place[k] - centre[k]).powi(2);
            }
            sum += r2;
            squares += r2 * r2;
        }
        // Rounding of `f32` positions is a few rows; the extent of `n` points is about 0.2 % below
        // the diameter.
        for k in 0..2 {
            let diameter = high[k] - low[k];
            assert!(
                (diameter - expected).abs() < 3.0 + 5e-3 * expected,
                "depth {depth}: {diameter}, not {expected}"
            );
        }
        // The disk is evenly filled: the mean squared distance from its middle is half the squared
        // radius.
        if expected > 100.0 {
            let (mean, variance) = estimate(sum, squares, f64::from(n));
            let p = normal_two_sided_p((mean - expected * expected / 8.0) / variance.sqrt());
            assert!(
                p > sidak(0.001, 4),
                "depth {depth}: {mean}, not {}",
                expected * expected / 8.0
            );
        }
    }
}

#[test]
fn rays_of_one_pixel_spread_by_the_lens_formula() {
    let points = FilterSpec {
        kind: FilterKind::Box,
        radius: 0.0,
    };
    let camera = Camera::new(&small_format_camera(), [64, 64], points);
    let lens = 0.05 / 1.4f32;
    for depth in [0.5, 2.0, 3.0, 10.0] {
        let (mut low, mut high) = (f32::MAX, f32::MIN);
        for i in 0..4000 {
            let ray = camera.sample_ray([50, 9], &mut Sampler::sobol(1, [50, 9], i));
            let x = ray.origin.x - ray.dir.x * (depth + ray.origin.z) / ray.dir.z;
            (low, high) = (low.min(x), high.max(x));
        }
        let expected = lens * (depth - 2.0f32).abs() / 2.0;
        assert!(
            (high - low - expected).abs() < 1e-2 * expected + 1e-6,
            "depth {depth}: {} {expected}",
            high - low
        );
    }
}

/// Samples a light path and connects its first vertex, and the vertex after one edge, to the
/// camera.
fn from_light(
    context: &Context,
    _: [u32; 2],
    sampler: &mut Sampler,
    sink: &mut dyn FnMut(Contribution),
) {
    let scene = context.scene;
    let (choice, u, v) = (sampler.next_1d(), sampler.next_2d(), sampler.next_2d());
    let Some(e) = context.lights.sample_emission(scene, choice, u, v) else {
        return;
    };
    let mut connect_vertex = |end: EdgeEnd, s: u32, value: &dyn Fn(Vec3) -> Vec3| {
        let Some(c) = context
            .camera
            .connect(end.position, sampler.next_2d(), sampler.next_2d())
        else {
            return;
        };
        let ray = ShadowRay::between(end, EdgeEnd::free(c.lens), -c.dir, false);
        if unoccluded(context, &ray) {
            let value = value(-c.dir) * c.dir.dot(end.normal).abs() * c.importance;
            sink(Contribution {
                pixel: c.pixel,
                value,
                unweighted: value,
                s,
                t: 1,
                length: 0.0,
            });
        }
    };
    // The light is Lambertian and one-sided.
    connect_vertex(e.point.end(), 1, &|wo| {
        if wo.dot(e.point.normal) > 0.0 {
            e.radiance / e.pdf_a
        } else {
            Vec3::ZERO
        }
    });
    let ray = Ray {
        origin: e.point.end().off_surface(e.dir),
        dir: e.dir,
    };
    let Some(hit) = context.trace.closest(&ray, f32::INFINITY) else {
        return;
    };
    let surface = Surface::at(scene, &ray, &hit);
    let throughput = e.radiance * e.cos / (e.pdf_a * e.pdf_w);
    if !surface.materials[0].emitter_reflects && surface.emitter != NONE {
        return;
    }
    let bsdf = Bsdf::new(&surface, &scene.textures);
    connect_vertex(surface.end(), 2, &|wo| {
        throughput * bsdf.eval(-ray.dir, wo, TransportMode::Importance)
    });
}

#[test]
fn splats_through_every_filter_have_the_mean_of_camera_rays() {
    // `nee` is the reference because `bpt` finds light too rarely here for a normal test.
    let rays = integrator("nee").unwrap();
    let splats = Box::leak(Box::new(IntegratorRow {
        name: "from_light",
        sample: from_light,
        ..*rays
    }));
    let mut scene = Arc::unwrap_or_clone(
        SceneBuilder::new(Vec3::new(0.0, 0.0, 0.95), Vec3::new(0.1, 0.0, -0.4), 70.0)
            .room(1.0, grey(0.7))
            .quad(
                Vec3::new(-0.5, 0.2, -0.95),
                Vec3::X * 0.8,
                Vec3::Y * 0.5,
                light(3.0),
            )
            .quad(
                Vec3::new(-0.2, -0.7, -0.4),
                Vec3::X * 0.6,
                Vec3::Y * 0.6,
                grey(0.4),
            )
            .build(),
    );
    scene.camera.focus_distance = Some(1.4);
    let size = [12, 9];
    let significance = sidak(
        0.001,
        FilterKind::ALL.len() * 2 * (size[0] * size[1] + 1) as usize,
    );
    let mut films = Vec::new();
    for (i, kind) in FilterKind::ALL.into_iter().enumerate() {
        for aperture in [0.0, 0.15] {
            scene.camera.optics = scene.camera.optics.with_aperture(aperture);
            let scene = Arc::new(scene.clone());
            let filter = FilterSpec {
                kind,
                radius: if kind == FilterKind::AntialiasingRadius {
                    0.4
                } else {
                    1.3
                },
            };
            let film = |integrator, seed| {
                let film = render(
                    &scene,
                    Job {
                        integrator,
                        ..job(size, 2, seed)
                    }
                    .with(|settings| settings.filter = filter),
                    3000,
                );
                (film.mean(), film.variance_of_mean())
            };
            let ((a, va), (b, vb)) = (film(rays, 40 + i as u64), film(splats, 60 + i as u64));
            // Pixels that only the filter's tail connects with light have too few such samples for
            // a normal test; they are tested in the sum over the film, whose error is a few parts
            // in a thousand.
            let threshold = 0.2 * (a.mean()[0] + b.mean()[0]);
            let mut whole = [0.0f64; 2];
            for i in 0..a.data.len() {
                let [ray_value, splat_value] = [a.data[i][0], b.data[i][0]].map(f64::from);
                let variance = f64::from(va.data[i][0] + vb.data[i][0]);
                whole = [whole[0] + ray_value - splat_value, whole[1] + variance];
                let p = normal_two_sided_p((ray_value - splat_value) / variance.sqrt());
                let bright = ray_value + splat_value > threshold;
                assert!(
                    !bright || p > significance,
                    "{kind:?}, lens {aperture}, pixel {i}: {ray_value} {splat_value}"
                );
            }
            let z = whole[0] / whole[1].sqrt();
            assert!(
                normal_two_sided_p(z) > significance,
                "{kind:?}, lens {aperture}, all pixels: {whole:?}"
            );
            films.push(z);
        }
    }
    // The sum over all films reveals a weight that is wrong by the same factor everywhere.
    let all = films.iter().sum::<f64>() / (films.len() as f64).sqrt();
    assert!(normal_two_sided_p(all) > 0.001, "{films:?}");
}
