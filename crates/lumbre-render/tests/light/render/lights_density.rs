//! Densities of light sampling: chi-square tests of samples against the density, cell by cell over
//! directions and positions, and densities that integrate to one.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3};
use lumbre_light::math::rng::{pcg4d, unit};
use lumbre_light::math::stats::{chi_square_p, sidak};
use lumbre_light::math::{Frame, warp};
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{NONE, Texture};
use lumbre_light::transport::light::{LightId, LightSelection, Lights};
use lumbre_light::transport::ray::Ray;
use lumbre_light::transport::surface::Surface;
use lumbre_render::cpu::bvh::accel::Accel;

use crate::common::{SceneBuilder, grey, light};

/// Probability that any chi-square test of one `#[test]` fails by chance alone.
pub const SIGNIFICANCE: f64 = 0.001;

pub fn uniform(i: u32, key: u32) -> [f32; 8] {
    let [a, b] = [0, 1].map(|half| pcg4d([i, key, 31, half]).map(unit));
    [a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3]]
}

pub fn scene() -> SceneBuilder {
    SceneBuilder::new(Vec3::Z * 9.0, Vec3::ZERO, 40.0)
}

/// A cap of directions about an axis, divided into cells of equal solid angle.
pub struct Cap {
    frame: Frame,
    /// One minus the cosine of its half angle.
    height: f64,
    pub side: usize,
    /// Midpoints along a side of a cell.
    steps: usize,
}

impl Cap {
    pub fn new(axis: Vec3, height: f64) -> Cap {
        Cap {
            frame: Frame::from_normal(axis.try_normalize().unwrap()),
            height: height.min(2.0),
            side: 16,
            steps: 24,
        }
    }

    /// Returns the cell of a direction, if it lies in the cap. Exact for narrow caps too.
    pub fn cell(&self, dir: Vec3) -> Option<usize> {
        let d = self.frame.to_local(dir).as_dvec3();
        let sin2 = d.x * d.x + d.y * d.y;
        let q = if d.z > 0.0 {
            sin2 / (1.0 + d.z)
        } else {
            1.0 - d.z
        };
        let down = q / self.height;
        let round = d.y.atan2(d.x) / TAU + 0.5;
        let at = |x: f64| ((x * self.side as f64) as usize).min(self.side - 1);
        (down < 1.0).then(|| at(down) * self.side + at(round))
    }

    fn dir(&self, down: f64, round: f64) -> Vec3 {
        let q = down * self.height;
        let sin = (q * (2.0 - q)).max(0.0).sqrt();
        let phi = (round - 0.5) * TAU;
        self.frame
            .to_world(DVec3::new(sin * phi.cos(), sin * phi.sin(), 1.0 - q).as_vec3())
    }

    /// Returns the integral of a density over every cell.
    fn integrate(&self, density: impl Fn(Vec3) -> f64) -> Vec<f64> {
        let steps = self.steps;
        let n = self.side * steps;
        let mut cells = vec![0.0; self.side * self.side];
        for i in 0..n {
            for j in 0..n {
                let at = |x: usize| (x as f64 + 0.5) / n as f64;
                cells[i / steps * self.side + j / steps] += density(self.dir(at(i), at(j)));
            }
        }
        let area = TAU * self.height / (n * n) as f64;
        cells.into_iter().map(|c| c * area).collect()
    }
}

/// Returns the p-value of samples of `sample_direct` from a point, given the density
/// `pdf_direct_w`. Samples that are occluded or face away form a cell of their own. Panics if the
/// two densities differ at a sample, or if the integral over visible directions lies outside
/// `visible`.
fn p_of_direct(
    scene: &Arc<CompiledScene>,
    select: LightSelection,
    from: Vec3,
    cap: &Cap,
    visible: [f64; 2],
) -> f64 {
    let accel = Accel::build(Arc::clone(scene)).unwrap();
    let lights = Lights::with_select(scene, select);
    let found = |dir: Vec3| {
        let ray = Ray { origin: from, dir };
        let hit = accel.closest(&ray, f32::INFINITY)?;
        let s = Surface::at(scene, &ray, &hit);
        (s.emitter != NONE).then_some(s)
    };
    let density = |dir: Vec3| match found(dir) {
        Some(s) => f64::from(lights.pdf_direct_w(from, s.emitter, s.position, s.n_geometric)),
        None => 0.0,
    };
    let mut expected = cap.integrate(density);
    let total: f64 = expected.iter().sum();
    assert!(
        (visible[0]..=visible[1]).contains(&total),
        "the density integrates to {total}"
    );
    expected.push((1.0 - total).max(0.0));
    let n = 60_000u32;
    let mut observed = vec![0.0; expected.len()];
    let mut missed = 0;
    for i in 0..n {
        let u = uniform(i, 1);
        let mut cell = expected.len() - 1;
        if let Some(d) = lights.sample_direct(scene, from, u[0], [u[1], u[2]]) {
            assert!((d.wi.length() - 1.0).abs() < 1e-5 && d.distance > 0.0 && d.radiance.x > 0.0);
            let LightId::Emitter(which) = d.point.light() else {
                panic!("{:?}", d.point)
            };
            let off = (from + d.wi * d.distance - d.point.position).length();
            let ulp = f32::EPSILON * (from.length() + d.distance);
            assert!(
                off <= 1e-3 * d.distance + 8.0 * ulp,
                "the direction misses the point by {off}"
            );
            let again = lights.pdf_direct_w(from, which, d.point.position, d.point.normal);
            assert!(
                (again / d.pdf_w - 1.0).abs() < 2e-3,
                "{again} is not {}",
                d.pdf_w
            );
            match found(d.wi) {
                Some(s) if s.emitter == which => cell = cap.cell(d.wi).expect("inside the cap"),
                _ => missed += 1,
            }
        }
        observed[cell] += 1.0;
    }
    if visible[0] > 0.99 {
        // Nothing occludes the light. Only rounding at an edge can miss it, so the last cell is
        // left out.
        assert!(
            f64::from(missed) < 2e-3 * f64::from(n),
            "{missed} samples do not hit their light"
        );
        expected.pop();
        observed.pop();
    }
    let scale = observed.iter().sum::<f64>() / expected.iter().sum::<f64>();
    // Cells with few expected samples, such as a corner of the light that no midpoint hit, are
    // merged with their neighbours.
    let (mut wide_observed, mut wide_expected) = (vec![0.0], vec![0.0]);
    for (o, e) in observed.iter().zip(expected) {
        if e * scale >= 5.0 {
            wide_observed.push(0.0);
            wide_expected.push(0.0);
        }
        *wide_observed.last_mut().unwrap() += o;
        *wide_expected.last_mut().unwrap() += e * scale;
    }
    assert!(wide_expected.len() > 20, "too few cells for this test");
    chi_square_p(&wide_observed, &wide_expected, 0)
}

/// Range of the integral of a density if nothing is occluded.
const ALL: [f64; 2] = [0.995, 1.005];

#[test]
fn directions_to_triangles_follow_their_density() {
    let corners = [
        Vec3::new(-1.0, 2.0, -1.0),
        Vec3::new(1.5, 2.2, -0.5),
        Vec3::new(-0.5, 1.7, 1.0),
    ];
    let one = scene()
        .triangle(corners, [Vec2::ZERO; 3], light(1.0))
        .build();
    let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
    // Points below the triangle, far away, at a grazing angle, and so near that it fills most of a
    // hemisphere.
    let cases = [
        (Vec3::ZERO, 0.5),
        (Vec3::new(40.0, -130.0, 25.0), 2e-4),
        (Vec3::new(4.0, 0.6, 3.0), 0.08),
        (middle - Vec3::new(0.0, 0.3, 0.0), 1.2),
    ];
    let level = sidak(SIGNIFICANCE, cases.len());
    for (from, height) in cases {
        let p = p_of_direct(
            &one,
            LightSelection::Power,
            from,
            &Cap {
                steps: 48,
                ..Cap::new(middle - from, height)
            },
            ALL,
        );
        assert!(p > level, "from {from}: p = {p}");
    }
    // The back does not emit.
    let lights = Lights::new(&one);
    assert!((0..1000).all(|i| {
        lights
            .sample_direct(&one, Vec3::Y * 5.0, 0.3, [uniform(i, 2)[0], 0.5])
            .is_none()
    }));
}

#[test]
fn directions_to_spheres_follow_their_density_at_every_distance() {
    let (center, radius) = (Vec3::new(0.3, -0.2, 0.5), 0.7f32);
    let one = scene().sphere(center, radius, light(1.0)).build();
    let along = Vec3::new(0.48, 0.6, -0.64);
    let distances = [1.001, 1.05, 1.5, 4.0, 50.0, 1e3];
    let level = sidak(SIGNIFICANCE, distances.len());
    for distance in distances {
        let from = center - along * (radius * distance);
        let sin2 = f64::from(1.0 / distance).powi(2);
        // The cap is 10 % higher than the cone of the sphere, because rays in single precision can
        // also hit it from slightly outside.
        let height = sin2 / (1.0 + (1.0 - sin2).sqrt()) * 1.1;
        let p = p_of_direct(
            &one,
            LightSelection::Power,
            from,
            &Cap::new(along, height),
            [0.98, 1.02],
        );
        assert!(p > level, "from {distance} radii: p = {p}");
    }
    let lights = Lights::new(&one);
    for from in [center, center + along * 0.5, center - Vec3::X * 0.699] {
        assert!(
            lights.sample_direct(&one, from, 0.3, [0.4, 0.5]).is_none(),
            "the inside of a sphere must not emit"
        );
        assert_eq!(
            lights.pdf_direct_w(from, 0, center + Vec3::Y * radius, Vec3::Y),
            0.0
        );
    }
}

#[test]
fn directions_to_several_lights_follow_their_density_with_every_selection() {
    let up = |x: f32, y: f32, size: f32| {
        [
            Vec3::new(x, y, 0.0),
            Vec3::new(x + size, y, 0.2),
            Vec3::new(x, y, size),
        ]
        .map(|p| p - Vec3::Z * 0.3)
    };
    let lit = scene()
        .triangle(up(-1.0, 2.0, 1.4), [Vec2::ZERO; 3], light(1.0))
        .triangle(up(0.3, 1.6, 0.9), [Vec2::ZERO; 3], light(30.0))
        .triangle(up(-0.8, 0.9, 0.8), [Vec2::ZERO; 3], grey(0.5))
        .sphere(Vec3::new(1.2, 1.2, 0.3), 0.35, light(4.0))
        .build();
    let level = sidak(SIGNIFICANCE, LightSelection::NAMES.len());
    for (name, select) in LightSelection::NAMES {
        // The grey triangle hides part of the first light.
        let cap = Cap {
            steps: 64,
            ..Cap::new(Vec3::Y, 1.0)
        };
        let p = p_of_direct(&lit, select, Vec3::ZERO, &cap, [0.3, 0.99]);
        assert!(p > level, "{name}: p = {p}");
    }
}

/// Returns a map of 16 x 8 texels with a sun, two black rows and a black column.
pub fn sunny() -> Texture {
    let texel = |i: usize| match (i % 16, i / 16) {
        (11, 2) => [9000.0, 8000.0, 7000.0],
        (_, 5 | 6) | (4, _) => [0.0; 3],
        (x, y) => [1.0 + x as f32 * 0.2, 0.5 + y as f32 * 0.3, 2.0],
    };
    Texture::new(16, 8, (0..128).map(texel).collect::<Vec<_>>())
}

/// Returns the direction of map coordinates, both in 0..1 from the top left corner, computed from
/// the definition of the format alone: the top is +y, the middle is +z, -x is right of it; rotated
/// counter-clockwise seen from above.
pub fn direction(u: f64, v: f64, rotation_deg: f64) -> DVec3 {
    let right = TAU * (u - 0.5);
    let (sin, cos) = (PI * v).sin_cos();
    glam::DQuat::from_rotation_y(rotation_deg.to_radians())
        * DVec3::new(-right.sin() * sin, cos, right.cos() * sin)
}

/// Returns the map coordinates of a direction.
fn map_coordinates(dir: DVec3, rotation_deg: f64) -> [f64; 2] {
    let d = glam::DQuat::from_rotation_y(-rotation_deg.to_radians()) * dir;
    [
        0.5 + (-d.x).atan2(d.z) / TAU,
        d.y.clamp(-1.0, 1.0).acos() / PI,
    ]
}

#[test]
fn environment_maps_have_the_orientation_of_their_definition() {
    for rotation in [0.0f32, 73.0, 275.5] {
        let surrounded = scene()
            .environment(Some(sunny()), Vec3::splat(0.5), rotation)
            .build();
        let lights = Lights::new(&surrounded);
        for (i, texel) in sunny().texels.iter().enumerate() {
            let (u, v) = (
                (i % 16) as f64 / 16.0 + 1.0 / 32.0,
                (i / 16) as f64 / 8.0 + 1.0 / 16.0,
            );
            let dir = direction(u, v, rotation.into()).as_vec3();
            let (seen, own) = (lights.environment(dir), Vec3::from_array(texel) * 0.5);
            // By rounding, a neighbour of the sun contains a millionth of its radiance.
            assert!(
                (seen - own).abs().max_element() < 0.02,
                "texel {i}, {rotation}: {seen} instead of {own}"
            );
        }
    }
}

/// Returns the integral of a density per solid angle over cells of a map: its texels, each divided
/// into 3 x 3.
pub fn map_cells(size: [usize; 2], rotation: f64, density: impl Fn(Vec3) -> f64) -> Vec<f64> {
    let (cells, steps) = (size.map(|n| 3 * n), 4);
    let mut sums = vec![0.0; cells[0] * cells[1]];
    let [w, h] = cells.map(|c| c * steps);
    for y in 0..h {
        let v = (y as f64 + 0.5) / h as f64;
        let band = TAU / w as f64
            * ((PI * y as f64 / h as f64).cos() - (PI * (y + 1) as f64 / h as f64).cos());
        for x in 0..w {
            let dir = direction((x as f64 + 0.5) / w as f64, v, rotation).as_vec3();
            sums[y / steps * cells[0] + x / steps] += band * density(dir);
        }
    }
    sums
}

pub fn map_cell(size: [usize; 2], rotation: f64, dir: Vec3) -> usize {
    let [u, v] = map_coordinates(dir.as_dvec3(), rotation);
    let at = |x: f64, n: usize| ((x * 3.0 * n as f64) as usize).min(3 * n - 1);
    at(v, size[1]) * 3 * size[0] + at(u, size[0])
}

#[test]
fn directions_to_the_environment_follow_their_density() {
    let sky = Texture::new(4, 3, vec![[1.0, 2.0, 3.0]; 4 * 3]);
    let thin = Texture::new(1, 3, vec![[0.0; 3], [5.0; 3], [1.0; 3]]);
    let cases = [
        (Some(sunny()), 73.0f32),
        (Some(sky), 200.0),
        (Some(thin), -10.0),
        (None, 0.0),
    ];
    let level = sidak(SIGNIFICANCE, cases.len());
    for (map, rotation) in cases {
        let size = map
            .as_ref()
            .map_or([4, 4], |m| [m.width as usize, m.height as usize]);
        let surrounded = scene()
            .sphere(Vec3::ZERO, 1.0, grey(0.5))
            .environment(map, Vec3::ONE, rotation)
            .build();
        let lights = Lights::new(&surrounded);
        let mut expected = map_cells(size, rotation.into(), |dir| {
            f64::from(lights.pdf_environment_w(dir))
        });
        let total: f64 = expected.iter().sum();
        assert!(
            (total - 1.0).abs() < 1e-4,
            "{size:?}: the density integrates to {total}"
        );
        let n = 400_000u32;
        expected.iter_mut().for_each(|e| *e *= f64::from(n));
        let mut observed = vec![0.0; expected.len()];
        for i in 0..n {
            let u = uniform(i, 3);
            let d = lights
                .sample_direct(&surrounded, Vec3::X * 3.0, u[0], [u[1], u[2]])
                .unwrap();
            assert!((d.wi.length() - 1.0).abs() < 1e-5 && d.distance == f32::INFINITY && !d.delta);
            assert_eq!(
                (d.point.light(), d.radiance),
                (LightId::Environment, lights.environment(d.wi))
            );
            observed[map_cell(size, rotation.into(), d.wi)] += 1.0;
        }
        let p = chi_square_p(&observed, &expected, 0);
        assert!(p > level, "{size:?} turned by {rotation}: p = {p}");
    }
}

#[test]
fn every_emitting_direction_has_a_density_close_to_proportional() {
    let surrounded = scene()
        .sphere(Vec3::ZERO, 1.0, grey(0.5))
        .environment(Some(sunny()), Vec3::ONE, 31.0)
        .build();
    let lights = Lights::new(&surrounded);
    let mut worst = 0.0f32;
    for i in 0..200_000u32 {
        let u = uniform(i, 4);
        let dir = warp::uniform_sphere([u[0], u[1]]);
        let (radiance, pdf_w) = (lights.environment(dir), lights.pdf_environment_w(dir));
        assert!(pdf_w.is_finite() && pdf_w >= 0.0 && radiance.is_finite());
        assert!(
            radiance == Vec3::ZERO || pdf_w > 0.0,
            "{dir} has radiance {radiance} and is never sampled"
        );
        if radiance != Vec3::ZERO {
            worst = worst.max(radiance.y / pdf_w);
        }
    }
    // The ratio of radiance to density is greatest in the corner that a black cell shares with the
    // sun's cell: radiance is a quarter of the sun's there, and the mean of the cell 1/64 of it.
    // That is 16 times the ratio of a perfect density, which is the integral over all directions.
    let perfect = 4.0 * std::f32::consts::PI * mean_radiance(&lights).y;
    assert!(worst < 1.2 * 16.0 * perfect, "{worst} of {perfect}");
}

fn mean_radiance(lights: &Lights) -> Vec3 {
    let n = 20_000;
    (0..n)
        .map(|i| lights.environment(warp::uniform_sphere([uniform(i, 5)[0], uniform(i, 5)[1]])))
        .sum::<Vec3>()
        / n as f32
}
