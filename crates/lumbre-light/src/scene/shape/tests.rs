use std::f32::consts::{PI, TAU};

use super::*;

/// Returns the enclosed volume by the divergence theorem; valid only for a closed surface whose
/// front is outside.
fn volume(shape: &Shape) -> f64 {
    let corners = |t: &[u32; 3]| t.map(|c| shape.positions[c as usize].as_dvec3());
    shape
        .triangles
        .iter()
        .map(corners)
        .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0)
        .sum()
}

/// Returns whether every edge occurs once in each direction, comparing positions instead of
/// indices.
fn is_closed(shape: &Shape) -> bool {
    let key = |c: u32| {
        (shape.positions[c as usize] * 1e4)
            .round()
            .as_ivec3()
            .to_array()
    };
    let mut edges = std::collections::BTreeMap::new();
    for t in &shape.triangles {
        for i in 0..3 {
            let (a, b) = (key(t[i]), key(t[(i + 1) % 3]));
            *edges
                .entry(if a < b { (a, b) } else { (b, a) })
                .or_insert(0) += if a < b { 1 } else { -1 };
        }
    }
    edges.values().all(|n| *n == 0)
}

fn assert_sound(shape: &Shape) {
    shape.clone().checked().unwrap();
    for t in &shape.triangles {
        let [a, b, c] = t.map(|c| shape.positions[c as usize]);
        let face = (b - a).cross(c - a);
        assert!(face.length() > 0.0, "{t:?} has no area: {a} {b} {c}");
        if !shape.normals.is_empty() {
            let mean: Vec3 = t.iter().map(|c| shape.normals[*c as usize]).sum();
            assert!(mean.dot(face) > 0.0, "{t:?} looks away from its normals");
        }
    }
}

#[test]
fn closed_shapes_have_the_volumes_of_their_formulas() {
    let wedge = |n: f64| 0.5 * n * (std::f64::consts::TAU / n).sin();
    let cylinder = [(0.0, 0.0), (0.5, 0.0), (0.5, 2.0), (0.0, 2.0)].map(Vec2::from);
    let cases = [
        (cuboid(Vec3::new(1.0, 2.0, 3.0), 0.0, 1).unwrap(), 6.0, 1e-9),
        // A rounded box: the inner box, six slabs, twelve quarter cylinders, eight octants of a
        // ball.
        (
            cuboid(Vec3::new(1.0, 2.0, 3.0), 0.25, 24).unwrap(),
            0.5 * 1.5 * 2.5
                + 0.5 * (0.75 + 3.75 + 1.25)
                + std::f64::consts::PI * (0.0625 * 4.5 + 4.0 / 3.0 / 64.0),
            1e-3,
        ),
        (
            icosphere(1.0, 5).unwrap(),
            4.0 / 3.0 * std::f64::consts::PI,
            2e-3,
        ),
        (
            lathe(&cylinder, 64).unwrap(),
            2.0 * 0.25 * wedge(64.0),
            1e-5,
        ),
        (
            torus(2.0, 0.5, [256, 128]).unwrap(),
            2.0 * std::f64::consts::PI.powi(2) * 2.0 * 0.25,
            1e-3,
        ),
        (
            tube(&[Vec3::ZERO, Vec3::Z, Vec3::Z * 3.0], &[0.5; 3], 32, false).unwrap(),
            3.0 * 0.25 * wedge(32.0),
            1e-5,
        ),
        (
            extrude(
                &[
                    (0.0, 0.0),
                    (2.0, 0.0),
                    (2.0, 1.0),
                    (1.0, 1.0),
                    (1.0, 2.0),
                    (0.0, 2.0),
                ]
                .map(Vec2::from),
                0.5,
            )
            .unwrap(),
            1.5,
            1e-9,
        ),
    ];
    for (i, (shape, expected, tolerance)) in cases.iter().enumerate() {
        assert_sound(shape);
        assert!(is_closed(shape), "case {i} has holes");
        let found = volume(shape);
        assert!(
            (found - expected).abs() <= tolerance * expected,
            "case {i}: {found} instead of {expected}"
        );
    }
}

#[test]
fn sheets_face_up_and_have_their_area() {
    let area = |s: &Shape| -> f32 {
        let cross = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|c| s.positions[c as usize]);
            (b - a).cross(c - a)
        };
        s.triangles.iter().map(|t| 0.5 * cross(t).y).sum()
    };
    let g = grid(Vec2::new(2.0, 3.0), [4, 5]).unwrap();
    assert_sound(&g);
    assert!((area(&g) - 6.0).abs() < 1e-5);
    assert_eq!(
        (g.uvs[0], g.positions[0]),
        (Vec2::new(0.0, 1.0), Vec3::new(-1.0, 0.0, -1.5))
    );
    let d = disk(1.0, 100).unwrap();
    assert_sound(&d);
    assert!((area(&d) - 50.0 * (TAU / 100.0).sin()).abs() < 1e-4);
    let slope: Vec<f32> = (0..12).map(|i| 0.5 * (i % 4) as f32).collect();
    let h = heightfield(Vec2::new(3.0, 2.0), [3, 2], &slope).unwrap();
    assert_sound(&h);
    let up = Vec3::new(-0.5, 1.0, 0.0).normalize_or(Vec3::Y);
    assert!(
        h.normals.iter().all(|n| n.distance(up) < 1e-6),
        "a plane of slope 1/2 has one normal"
    );
}

#[test]
fn profiles_are_smooth_at_small_angles_and_sharp_at_large_ones() {
    let half_ball: Vec<Vec2> = (0..=16)
        .map(|i| PI * (i as f32 / 16.0 - 0.5))
        .map(|a| Vec2::new(a.cos().max(0.0), a.sin()))
        .collect();
    let ball = lathe(&half_ball, 48).unwrap();
    assert_sound(&ball);
    let tilt = |s: &Shape| {
        s.positions
            .iter()
            .zip(&s.normals)
            .map(|(p, n)| p.normalize_or(*n).dot(*n))
            .fold(1.0, f32::min)
    };
    assert!(tilt(&ball) > 0.99, "{}", tilt(&ball));
    let can = lathe(&[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)].map(Vec2::from), 16).unwrap();
    assert!(
        can.normals.iter().all(|n| n.y == 0.0 || n.y == -1.0),
        "a right angle stays sharp"
    );
}

#[test]
fn a_closed_tube_along_a_twisted_curve_has_no_seam() {
    let knot = |t: f32| {
        Vec3::new(
            (2.0 * t).cos() * (2.0 + (3.0 * t).cos()),
            (3.0 * t).sin(),
            (2.0 * t).sin() * (2.0 + (3.0 * t).cos()),
        )
    };
    let points: Vec<Vec3> = (0..200).map(|i| knot(TAU * i as f32 / 200.0)).collect();
    let t = tube(&points, &[0.2; 200], 12, true).unwrap();
    assert_sound(&t);
    assert!(is_closed(&t));
}

#[test]
fn mirrored_and_flattened_shapes() {
    let mirrored = cuboid(Vec3::ONE, 0.2, 3)
        .unwrap()
        .transformed(&Affine3A::from_scale(Vec3::new(-1.0, 2.0, 1.0)))
        .unwrap();
    assert_sound(&mirrored);
    assert!(volume(&mirrored) > 1.0);
    assert!(
        cuboid(Vec3::ONE, 0.0, 1)
            .unwrap()
            .transformed(&Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0)))
            .is_err()
    );
}

#[test]
fn joined_shapes_keep_every_triangle_and_its_front() {
    let mut both = cuboid(Vec3::ONE, 0.0, 1).unwrap();
    both.append(
        icosphere(1.0, 2)
            .unwrap()
            .transformed(&Affine3A::from_translation(Vec3::X * 3.0))
            .unwrap(),
    )
    .unwrap();
    assert_sound(&both);
    assert_eq!(both.triangles.len(), 12 + 320);
    let alone = volume(&icosphere(1.0, 2).unwrap());
    assert!((volume(&both) - 1.0 - alone).abs() < 1e-4);
}

#[test]
fn texture_coordinates_of_spheres_do_not_jump_within_a_triangle() {
    let ball = icosphere(1.0, 3).unwrap();
    for t in &ball.triangles {
        let us = t.map(|c| ball.uvs[c as usize].x);
        let span =
            us.iter().fold(f32::MIN, |a, b| a.max(*b)) - us.iter().fold(f32::MAX, |a, b| a.min(*b));
        assert!(span < 0.3, "{us:?}");
    }
}

#[test]
fn invalid_shapes_are_errors_with_a_reason() {
    let errors = [
        grid(Vec2::new(0.0, 1.0), [1, 1]).unwrap_err(),
        grid(Vec2::ONE, [100_000, 100_000]).unwrap_err(),
        grid(Vec2::ONE, [0, 1]).unwrap_err(),
        heightfield(Vec2::ONE, [1, 1], &[0.0; 3]).unwrap_err(),
        heightfield(Vec2::ONE, [1, 1], &[0.0, 0.0, f32::NAN, 0.0]).unwrap_err(),
        disk(-1.0, 8).unwrap_err(),
        cuboid(Vec3::ONE, 0.6, 2).unwrap_err(),
        icosphere(1.0, 40).unwrap_err(),
        lathe(&[Vec2::ZERO, Vec2::Y], 8).unwrap_err(),
        lathe(&[Vec2::new(-1.0, 0.0), Vec2::Y], 8).unwrap_err(),
        tube(&[Vec3::ZERO, Vec3::ZERO], &[1.0; 2], 8, false).unwrap_err(),
        extrude(
            &[(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)].map(Vec2::from),
            1.0,
        )
        .unwrap_err(),
        extrude(&[(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)].map(Vec2::from), 1.0).unwrap_err(),
        torus(1.0, 2.0, [8, 8]).unwrap_err(),
        Shape {
            positions: vec![Vec3::ZERO; 3],
            triangles: vec![[0, 1, 3]],
            ..Shape::default()
        }
        .checked()
        .unwrap_err(),
    ];
    for e in errors {
        let text = e.to_string();
        assert!(text.len() > 12 && !text.ends_with('.'), "{text}");
    }
}
