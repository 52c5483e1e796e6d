//! Light compared with closed forms: irradiance, power, the distribution of emitted light, and
//! selection among many lights.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3};
use lumbre_light::math::rng::{pcg4d, unit};
use lumbre_light::math::stats::{chi_square_p, normal_two_sided_p, sidak};
use lumbre_light::math::warp;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{Material, Texture, UvMap};
use lumbre_light::transport::light::{DirectSample, LightId, LightSelection, Lights};

use crate::common::{SceneBuilder, grey, light};
use crate::render::lights_density::{direction, sunny};

fn scene() -> SceneBuilder {
    SceneBuilder::new(Vec3::Z * 9.0, Vec3::ZERO, 40.0)
}

fn uniform(i: u32, key: u32) -> [f32; 8] {
    let [a, b] = [0, 1].map(|half| pcg4d([i, key, 47, half]).map(unit));
    [a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3]]
}

/// Returns the midpoints of `n` x `n` cells of the unit square.
fn grid(n: usize) -> impl Iterator<Item = [f32; 2]> {
    (0..n * n).map(move |i| [i % n, i / n].map(|x| (x as f32 + 0.5) / n as f32))
}

/// Returns the irradiance on a surface from one sample.
fn irradiance(d: &DirectSample, n: Vec3) -> DVec3 {
    d.radiance.as_dvec3() * f64::from(d.wi.dot(n).max(0.0)) / f64::from(d.pdf_w)
}

/// Returns the irradiance from all lights, each of them sampled on a grid.
fn irradiance_of_all(scene: &CompiledScene, from: Vec3, n: Vec3, side: usize) -> DVec3 {
    let lights = Lights::new(scene);
    let one = |index: u32| {
        let sum: DVec3 = grid(side)
            .filter_map(|u| lights.sample_direct_from(scene, index, from, u))
            .map(|d| irradiance(&d, n))
            .sum();
        sum / (side * side) as f64
    };
    lights.indices().map(one).sum()
}

#[test]
fn irradiance_of_a_sphere_follows_the_inverse_square_law() {
    let (center, radius) = (Vec3::new(0.5, 3.0, -1.0), 0.8f32);
    let lit = scene().sphere(center, radius, light(2.5)).build();
    let tilted = Vec3::new(0.3, 0.9, 0.1).try_normalize().unwrap();
    for from in [
        Vec3::ZERO,
        Vec3::new(0.5, 0.8, -1.0),
        Vec3::new(-60.0, -200.0, 10.0),
    ] {
        let to = (center - from).as_dvec3();
        let cos = tilted.as_dvec3().dot(to) / to.length();
        let exact = PI * 2.5 * f64::from(radius).powi(2) / to.length_squared() * cos;
        let found = irradiance_of_all(&lit, from, tilted, 64).x;
        assert!(
            (found / exact - 1.0).abs() < 1e-3,
            "from {from}: {found} instead of {exact}"
        );
    }
    // The form factor of a facing sphere also holds so near that half of the sphere lies below the
    // horizon.
    let from = center - Vec3::Y * radius * 1.0005;
    let found = irradiance_of_all(&lit, from, Vec3::Y, 256).x;
    let exact = PI * 2.5 / 1.0005f64.powi(2);
    assert!(
        (found / exact - 1.0).abs() < 1e-3,
        "{found} instead of {exact}"
    );
}

/// Returns the irradiance from a triangle of radiance one that lies above the horizon, by Lambert's
/// formula.
fn lambert(corners: [Vec3; 3], from: Vec3, n: Vec3) -> f64 {
    let to = corners.map(|c| (c - from).as_dvec3().normalize());
    let edge = |i: usize| {
        let (a, b) = (to[i], to[(i + 1) % 3]);
        a.dot(b).clamp(-1.0, 1.0).acos() * a.cross(b).normalize().dot(n.as_dvec3())
    };
    0.5 * (edge(0) + edge(1) + edge(2)).abs()
}

#[test]
fn irradiance_of_a_triangle_equals_the_formula_of_lambert() {
    let corners = [
        Vec3::new(-1.0, 2.0, -1.0),
        Vec3::new(1.5, 2.2, -0.5),
        Vec3::new(-0.5, 1.7, 1.0),
    ];
    let lit = scene()
        .triangle(corners, [Vec2::ZERO; 3], light(3.0))
        .build();
    for from in [
        Vec3::ZERO,
        Vec3::new(0.2, 1.2, -0.3),
        Vec3::new(3.0, -70.0, 20.0),
    ] {
        let exact = 3.0 * lambert(corners, from, Vec3::Y);
        let found = irradiance_of_all(&lit, from, Vec3::Y, 128).x;
        assert!(
            (found / exact - 1.0).abs() < 1e-3,
            "from {from}: {found} instead of {exact}"
        );
        assert_eq!(
            irradiance_of_all(&lit, from + Vec3::Y * 300.0, Vec3::NEG_Y, 16).x,
            0.0,
            "the back of the triangle emits"
        );
    }
}

#[test]
fn irradiance_of_points_directions_and_a_constant_environment_has_its_closed_form() {
    let n = Vec3::new(0.2, 0.9, -0.3).try_normalize().unwrap();
    let from = Vec3::new(1.0, 2.0, 3.0);
    let (place, way) = (Vec3::new(-1.0, 6.0, 2.0), Vec3::new(0.3, -1.0, 0.2));
    let to = (place - from).as_dvec3();
    let (i, e) = (Vec3::new(4.0, 5.0, 6.0), Vec3::new(0.5, 0.25, 0.125));
    let point = i.as_dvec3() * (n.as_dvec3().dot(to) / to.length().powi(3));
    let direction = e.as_dvec3() * n.as_dvec3().dot(-way.as_dvec3().normalize());
    let sky = Vec3::new(0.1, 0.2, 0.4);
    // The ball gives the scene an extent. It lies behind the surface and occludes no light.
    let dark = || scene().sphere(from - n * 9.0, 0.5, grey(0.5));
    let cases = [
        (dark().point(place, i), point),
        (dark().directional(way, e), direction),
        (dark().environment(None, sky, 0.0), sky.as_dvec3() * PI),
        (
            dark()
                .point(place, i)
                .directional(way, e)
                .environment(None, sky, 0.0),
            point + direction + sky.as_dvec3() * PI,
        ),
    ];
    for (k, (lit, exact)) in cases.into_iter().enumerate() {
        let found = irradiance_of_all(&lit.build(), from, n, 256);
        assert!(
            (found / exact - 1.0).abs().max_element() < 1e-3,
            "case {k}: {found} instead of {exact}"
        );
    }
}

#[test]
fn irradiance_of_a_map_with_a_sun_is_its_integral() {
    let lit = scene()
        .environment(Some(sunny()), Vec3::new(1.0, 0.5, 2.0), 57.0)
        .build();
    let lights = Lights::new(&lit);
    let n = Vec3::new(-0.4, 0.8, 0.2).try_normalize().unwrap();
    let (w, h) = (1600, 800);
    let mut exact = DVec3::ZERO;
    for y in 0..h {
        let v = (f64::from(y) + 0.5) / f64::from(h);
        let area = 2.0 * PI * PI / f64::from(w * h) * (PI * v).sin();
        for x in 0..w {
            let dir = direction((f64::from(x) + 0.5) / f64::from(w), v, 57.0);
            exact += lights.environment(dir.as_vec3()).as_dvec3()
                * area
                * dir.dot(n.as_dvec3()).max(0.0);
        }
    }
    let (found, error) = mean(4_000_000, |i| {
        let u = uniform(i, 9);
        lights
            .sample_direct_from(&lit, 0, Vec3::ZERO, [u[0], u[1]])
            .map_or(0.0, |d| irradiance(&d, n).y)
    });
    let z = (found - exact.y) / error;
    assert!(
        error < 1e-3 * exact.y && normal_two_sided_p(z) > 0.001,
        "{found} +- {error} instead of {exact}"
    );
}

/// Returns the mean and its standard error of `n` values.
fn mean(n: u32, value: impl Fn(u32) -> f64) -> (f64, f64) {
    let (mut sum, mut sum2) = (0.0, 0.0);
    for i in 0..n {
        let x = value(i);
        assert!(x.is_finite(), "sample {i}");
        sum += x;
        sum2 += x * x;
    }
    let n = f64::from(n);
    let mean = sum / n;
    (mean, ((sum2 / n - mean * mean).max(0.0) / (n - 1.0)).sqrt())
}

/// Returns an emission texture from dark to bright, and a mask that makes a part transparent.
fn textured() -> (Texture, Texture) {
    let bright = Texture::new(2, 2, vec![[0.0; 3], [1.0; 3], [4.0; 3], [12.0; 3]]);
    let mask = Texture::new(2, 1, vec![[0.2; 3], [1.0; 3]]);
    (bright, mask)
}

/// Returns a scene with every kind of light.
fn all_kinds() -> Arc<CompiledScene> {
    let mut builder = scene();
    let (bright, mask) = textured();
    let (bright, mask) = (builder.texture(bright), builder.texture(mask));
    let lamp = Material {
        emission_texture: bright,
        mask_texture: mask,
        ..light(1.5)
    };
    let lamp = Material {
        tiling: UvMap {
            scale: 1.5,
            offset: Vec2::new(0.1, 0.2),
        },
        ..lamp
    };
    let small = [
        Vec3::new(0.5, 1.0, 0.5),
        Vec3::new(0.8, 1.0, 0.5),
        Vec3::new(0.5, 1.1, 0.9),
    ];
    builder
        .quad(
            Vec3::new(-0.8, -0.5, 0.8),
            Vec3::X * 1.8,
            Vec3::Z * -1.6,
            grey(0.5),
        )
        .quad(Vec3::new(-1.0, 2.0, -1.0), Vec3::X, Vec3::Z * 1.5, lamp)
        .triangle(small, [Vec2::ZERO; 3], light(40.0))
        .sphere(Vec3::new(-0.9, 0.9, 0.4), 0.25, light(5.0))
        .point(Vec3::new(0.0, 1.5, -1.0), Vec3::splat(2.0))
        .point(Vec3::new(1.0, 3.0, 1.0), Vec3::splat(0.5))
        .directional(Vec3::new(0.2, -1.0, 0.1), Vec3::splat(0.7))
        .environment(Some(sunny()), Vec3::splat(0.002), 20.0)
        .build()
}

/// Sides of grids of samples, without common factors.
const GRIDS: [usize; 6] = [353, 401, 449, 503, 557, 601];

/// Returns the irradiance by grids of samples, and its standard error. The borders of masks and maps
/// lie between the samples of a grid in another way for each grid.
fn mean_of_grids(scene: &CompiledScene, from: Vec3, n: Vec3) -> (f64, f64) {
    let found = GRIDS.map(|side| irradiance_of_all(scene, from, n, side).x);
    let count = GRIDS.len() as f64;
    let mean = found.iter().sum::<f64>() / count;
    let spread: f64 = found.iter().map(|x| (x - mean).powi(2)).sum();
    (mean, (spread / (count - 1.0) / count).sqrt())
}

#[test]
fn every_light_selection_has_the_same_mean() {
    let lit = all_kinds();
    let points = [
        (Vec3::ZERO, Vec3::Y),
        (Vec3::new(0.6, 0.9, 0.3), Vec3::X),
        (Vec3::new(-3.0, 0.5, 2.0), -Vec3::Z),
    ];
    let level = sidak(0.001, points.len() * LightSelection::NAMES.len());
    for (from, n) in points {
        let (exact, doubt) = mean_of_grids(&lit, from, n);
        for (name, select) in LightSelection::NAMES {
            let lights = Lights::with_select(&lit, select);
            let total: f64 = lights
                .indices()
                .map(|i| f64::from(lights.pdf_choice(lights.id(i))))
                .sum();
            assert!(
                (total - 1.0).abs() < 1e-6,
                "{name}: probabilities sum to {total}"
            );
            let (found, error) = mean(300_000, |i| {
                let u = uniform(i, 1);
                lights
                    .sample_direct(&lit, from, u[0], [u[1], u[2]])
                    .map_or(0.0, |d| irradiance(&d, n).x)
            });
            let z = (found - exact) / error.hypot(doubt);
            assert!(
                error / exact < 0.05,
                "{name} from {from}: too noisy for this test, {error} of {exact}"
            );
            assert!(
                normal_two_sided_p(z) > level,
                "{name} from {from}: {found} instead of {exact}, z = {z}"
            );
        }
    }
}

#[test]
fn emission_sampling_carries_the_power_of_the_light() {
    let ball = |b: SceneBuilder| b.sphere(Vec3::new(1.0, 0.0, 2.0), 3.0, grey(0.5));
    let corners = [Vec3::ZERO, Vec3::X * 2.0, Vec3::Y];
    let disk = PI * 9.0;
    let sun: f64 = {
        let lit = scene().environment(Some(sunny()), Vec3::ONE, 0.0).build();
        let lights = Lights::new(&lit);
        let n = 400_000;
        let w = |i: u32| grid_direction(i, n);
        (0..n)
            .map(|i| f64::from(lights.environment(w(i)).x))
            .sum::<f64>()
            / f64::from(n)
            * 4.0
            * PI
    };
    let cases = [
        (
            "triangle",
            scene().triangle(corners, [Vec2::ZERO; 3], light(3.0)),
            PI * 3.0,
        ),
        (
            "sphere",
            scene().sphere(Vec3::Y, 0.5, light(2.0)),
            PI * 2.0 * PI,
        ),
        (
            "point",
            ball(scene()).point(Vec3::X, Vec3::splat(5.0)),
            4.0 * PI * 5.0,
        ),
        (
            "direction",
            ball(scene()).directional(Vec3::Y, Vec3::splat(0.5)),
            0.5 * disk,
        ),
        (
            "sky",
            ball(scene()).environment(None, Vec3::splat(0.25), 0.0),
            4.0 * PI * 0.25 * disk,
        ),
        (
            "map",
            ball(scene()).environment(Some(sunny()), Vec3::ONE, 10.0),
            sun * disk,
        ),
    ];
    for (name, lit, exact) in cases {
        let lit = lit.build();
        let lights = Lights::new(&lit);
        let (found, error) = mean(200_000, |i| {
            let u = uniform(i, 2);
            let e = lights
                .sample_emission(&lit, u[0], [u[1], u[2]], [u[3], u[4]])
                .unwrap();
            f64::from(e.radiance.x) * f64::from(e.cos) / (f64::from(e.pdf_a) * f64::from(e.pdf_w))
        });
        let close = (found - exact).abs() < 4.0 * error + 2e-3 * exact;
        assert!(
            close && error < 0.01 * exact,
            "{name}: {found} +- {error} instead of {exact}"
        );
    }
}

/// Returns directions that fill the sphere evenly: a spiral.
fn grid_direction(i: u32, n: u32) -> Vec3 {
    let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(n);
    let (sin, cos) = (f64::from(i) * PI * (3.0 - 5f64.sqrt())).sin_cos();
    let r = (1.0 - z * z).sqrt();
    DVec3::new(r * cos, z, r * sin).as_vec3()
}

#[test]
fn emission_sampling_and_light_sampling_give_the_same_power_on_a_square() {
    // The power on a square: by light paths that hit it, and by light sampling from points on it.
    // Nothing occludes the light, and the square is part of the floor, so that emission disks cover
    // it.
    let (corner, a, b) = (Vec3::new(-0.7, -0.5, -0.6), Vec3::X * 1.5, Vec3::Z * 1.2);
    let lit = all_kinds();
    let lights = Lights::new(&lit);
    let area = f64::from(a.length() * b.length());
    let n = 1_500_000;
    let (direct, direct_error) = mean(300_000, |i| {
        let u = uniform(i, 3);
        let from = corner + a * u[3] + b * u[4];
        lights
            .sample_direct(&lit, from, u[0], [u[1], u[2]])
            .map_or(0.0, |d| irradiance(&d, Vec3::Y).x)
            * area
    });
    let (emitted, emitted_error) = mean(n, |i| {
        let u = uniform(i, 4);
        let Some(e) = lights.sample_emission(&lit, u[0], [u[1], u[2]], [u[3], u[4]]) else {
            return 0.0;
        };
        let t = (corner.y - e.point.position.y) / e.dir.y;
        let at = e.point.position + e.dir * t - corner;
        let (x, z) = (at.x / a.x, at.z / b.z);
        let met = t > 0.0 && e.dir.y < 0.0 && (0.0..1.0).contains(&x) && (0.0..1.0).contains(&z);
        let power =
            f64::from(e.radiance.x) * f64::from(e.cos) / (f64::from(e.pdf_a) * f64::from(e.pdf_w));
        if met { power } else { 0.0 }
    });
    let sigma = direct_error.hypot(emitted_error);
    let z = (direct - emitted) / sigma;
    assert!(
        sigma / direct < 0.01,
        "too noisy for this test: {direct} +- {sigma}"
    );
    assert!(
        normal_two_sided_p(z) > 0.001,
        "light sampling {direct}, emission sampling {emitted}, z = {z}"
    );
}

/// Returns ten thousand triangles of very different sizes and radiances.
fn many() -> SceneBuilder {
    (0..10_000u32).fold(scene(), |builder, i| {
        let u = uniform(i, 5);
        let at = Vec3::new(u[0], 0.2 * u[1], u[2]) * 8.0 - Vec3::new(4.0, -1.0, 4.0);
        let size = 0.002 + 0.05 * u[3] * u[3];
        let facing = warp::uniform_sphere([u[4], u[5]]);
        let side = facing.any_orthonormal_vector() * size;
        let corners = [at, at + side, at + facing.cross(side)];
        builder.triangle(corners, [Vec2::ZERO; 3], light(0.01 + 10.0 * u[6].powi(4)))
    })
}

#[test]
fn ten_thousand_lights_are_selected_with_their_probabilities() {
    let lit = many().build();
    assert_eq!(lit.emitters.len(), 10_000);
    let weight = |select: LightSelection, i: usize| match select {
        LightSelection::Uniform => 1.0,
        LightSelection::Area => f64::from(lit.emitters[i].area),
        LightSelection::Power | LightSelection::Tree => {
            f64::from(lit.emitters[i].area) * f64::from(lit.materials[i].emission.x)
        }
    };
    let level = sidak(0.001, 2 * LightSelection::NAMES.len());
    for (name, select) in LightSelection::NAMES {
        let lights = Lights::with_select(&lit, select);
        let total: f64 = (0..10_000).map(|i| weight(select, i)).sum();
        for i in 0..10_000 {
            let (own, exact) = (
                f64::from(lights.pdf_choice(LightId::Emitter(i as u32))),
                weight(select, i) / total,
            );
            // Sample numbers have 24 bits: see `AliasTable`.
            assert!(
                own > 0.0 && (own - exact).abs() < 3.0 / 16_777_216.0,
                "{name}, light {i}: {own}, not {exact}"
            );
        }
        let n = 400_000;
        let mut observed = vec![0.0; 1000];
        for i in 0..n {
            let u = uniform(i, 6);
            let e = lights
                .sample_emission(&lit, u[0], [u[1], u[2]], [u[3], 0.5])
                .unwrap();
            let LightId::Emitter(which) = e.point.light() else {
                panic!("{:?}", e.point)
            };
            observed[which as usize / 10] += 1.0;
        }
        let expected: Vec<f64> = (0..1000)
            .map(|g| {
                (g * 10..g * 10 + 10)
                    .map(|i| weight(select, i))
                    .sum::<f64>()
                    / total
                    * f64::from(n)
            })
            .collect();
        let p = chi_square_p(&observed, &expected, 0);
        assert!(p > level, "{name}: p = {p}");
        // The irradiance is right as well.
        let exact: f64 = irradiance_of_all(&lit, Vec3::ZERO, Vec3::Y, 3).x;
        let (found, error) = mean(400_000, |i| {
            let u = uniform(i, 7);
            lights
                .sample_direct(&lit, Vec3::ZERO, u[0], [u[1], u[2]])
                .map_or(0.0, |d| irradiance(&d, Vec3::Y).x)
        });
        let z = (found - exact) / error;
        assert!(
            error / exact < 0.02 && normal_two_sided_p(z) > level,
            "{name}: {found}, not {exact}, z = {z}"
        );
    }
}

#[test]
fn degenerate_and_black_lights_give_only_finite_samples() {
    let flat = [Vec3::ZERO, Vec3::X, Vec3::X * 2.0];
    let black = Texture::new(2, 1, vec![[0.0; 3]; 2]);
    let mut builder = scene();
    let row = builder.texture(black.clone());
    let unlit = Material {
        emission_texture: row,
        ..light(1.0)
    };
    let corners = [Vec3::Y, Vec3::Y + Vec3::X, Vec3::Y + Vec3::Z];
    let cases = [
        ("nothing", scene()),
        (
            "a triangle without area",
            scene().triangle(flat, [Vec2::ZERO; 3], light(1.0)),
        ),
        (
            "a point triangle",
            scene().triangle([Vec3::X; 3], [Vec2::ZERO; 3], light(1.0)),
        ),
        (
            "a black texture",
            builder.triangle(corners, [Vec2::ZERO; 3], unlit),
        ),
        (
            "a black map",
            scene().environment(Some(black), Vec3::ONE, 0.0),
        ),
        ("a black sky", scene().environment(None, Vec3::ZERO, 0.0)),
        (
            "a sky around nothing",
            scene().environment(None, Vec3::ONE, 0.0),
        ),
        (
            "a direction around nothing",
            scene().directional(Vec3::Y, Vec3::ONE),
        ),
        ("a point", scene().point(Vec3::X, Vec3::ONE)),
    ];
    for (name, lit) in cases {
        let lit = lit.build();
        for (_, select) in LightSelection::NAMES {
            let lights = Lights::with_select(&lit, select);
            for i in 0..2000 {
                let u = uniform(i, 8);
                // At the point light, on the line of the triangle, and elsewhere.
                for from in [Vec3::X, Vec3::ZERO, Vec3::new(u[5], u[6], -2.0)] {
                    if let Some(d) = lights.sample_direct(&lit, from, u[0], [u[1], u[2]]) {
                        assert!(d.pdf_w > 0.0 && d.pdf_w.is_finite(), "{name}: {d:?}");
                        assert!(
                            d.wi.is_finite()
                                && d.radiance.is_finite()
                                && d.point.position.is_finite(),
                            "{name}"
                        );
                    }
                }
                if let Some(e) = lights.sample_emission(&lit, u[0], [u[1], u[2]], [u[3], u[4]]) {
                    let throughput = e.radiance * e.cos / (e.pdf_a * e.pdf_w);
                    assert!(throughput.is_finite() && e.dir.is_finite(), "{name}: {e:?}");
                }
                let dir = warp::uniform_sphere([u[3], u[4]]);
                assert!(
                    lights.environment(dir).is_finite()
                        && lights.pdf_environment_w(dir).is_finite(),
                    "{name}"
                );
            }
        }
    }
}
