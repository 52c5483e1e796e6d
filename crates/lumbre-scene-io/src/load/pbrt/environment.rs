//! Environment maps of pbrt as equirectangular maps with +y up.
//!
//! Version 3 stores a map by longitude and latitude about +z of the light: its left edge is +x, a
//! quarter of it +y, its top row +z. Version 4 stores a square of equal areas [Clarberg 2008].

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec3};

use crate::load::environment::{MAX_HEIGHT, bilinear, resampled, texel};
use lumbre_light::math::luminance::luminance;
use lumbre_light::scene::desc::{Texels, TextureDesc};

/// Returns the point in the unit square of a direction.
fn to_square(d: DVec3) -> [f64; 2] {
    let r = (1.0 - d.z.abs()).max(0.0).sqrt();
    let phi = d.y.abs().atan2(d.x.abs()) * 2.0 / PI;
    let (mut u, mut v) = (r - phi * r, phi * r);
    if d.z < 0.0 {
        (u, v) = (1.0 - v, 1.0 - u);
    }
    [(u.copysign(d.x) + 1.0) * 0.5, (v.copysign(d.y) + 1.0) * 0.5]
}

/// Returns the direction of a point in the unit square, the inverse of [`to_square`].
fn from_square(x: f64, y: f64) -> DVec3 {
    let (u, v) = (2.0 * x - 1.0, 2.0 * y - 1.0);
    let signed = 1.0 - (u.abs() + v.abs());
    let r = 1.0 - signed.abs();
    let phi = if r == 0.0 {
        1.0
    } else {
        (v.abs() - u.abs()) / r + 1.0
    } * PI
        / 4.0;
    let across = r * (2.0 - r * r).max(0.0).sqrt();
    DVec3::new(
        phi.cos().copysign(u) * across,
        phi.sin().copysign(v) * across,
        (1.0 - r * r).copysign(signed),
    )
}

/// Returns the colour of a map of version 4 in a direction of the light's space: that of the
/// nearest texel.
fn equal_area(image: &TextureDesc, d: DVec3) -> [f32; 3] {
    let [u, v] = to_square(d);
    let at = |t: f64, n: u32| ((t * f64::from(n)) as u32).min(n - 1);
    texel(image, at(u, image.width), at(v, image.height))
}

/// Returns the colour of a map of version 3 in a direction of the light's space.
fn equirectangular(image: &TextureDesc, d: DVec3) -> [f32; 3] {
    let x = d.y.atan2(d.x).rem_euclid(TAU) / TAU * f64::from(image.width) - 0.5;
    let y = d.z.clamp(-1.0, 1.0).acos() / PI * f64::from(image.height) - 0.5;
    bilinear(image, x, y)
}

/// Returns the map of version 4 in the world. `to_world` is the linear map of the light.
pub(super) fn from_equal_area(image: &TextureDesc, to_world: &DMat3) -> TextureDesc {
    let height = image.height.min(MAX_HEIGHT);
    let samples = 2 * image.height.div_ceil(MAX_HEIGHT);
    let to_light = to_world.inverse();
    resampled(image, [2 * height, height], samples, &to_light, equal_area)
}

/// Returns a map of the world as one of version 4, for a light whose space is the world. The square
/// has as many texels as the map.
pub(crate) fn to_equal_area(map: &TextureDesc, rotation_deg: f32) -> TextureDesc {
    let texels = f64::from(map.width) * f64::from(map.height);
    let side = (texels.sqrt().ceil() as u32).next_multiple_of(2);
    let to_map = DMat3::from_rotation_y(-f64::from(rotation_deg).to_radians());
    // The world's map is one by longitude and latitude about z after a turn.
    let to_axes = DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::NEG_X) * to_map;
    let mut out = Vec::with_capacity(side as usize * side as usize);
    for y in 0..side {
        for x in 0..side {
            let mut sum = [0.0f32; 3];
            for k in 0..4 {
                let at =
                    |i: u32, k: u32| (f64::from(i) + 0.25 + 0.5 * f64::from(k)) / f64::from(side);
                let d = from_square(at(x, k % 2), at(y, k / 2));
                let c = equirectangular(map, to_axes * d);
                sum.iter_mut().zip(c).for_each(|(sum, c)| *sum += 0.25 * c);
            }
            out.push([sum[0], sum[1], sum[2], 1.0]);
        }
    }
    TextureDesc::new(&map.file, side, side, Texels::RgbaF32(out))
}

/// Returns the map of version 3 in the world, and its rotation about +y in degrees. If the map's
/// axis is vertical its texels are unchanged, apart from their order.
pub(super) fn from_equirectangular(image: &TextureDesc, to_world: &DMat3) -> (TextureDesc, f32) {
    let axes = [to_world.x_axis, to_world.y_axis, to_world.z_axis];
    let [x, y, z] = axes.map(|axis| axis.normalize_or(DVec3::Z));
    let round = x.dot(y).abs() < 1e-6 && x.y.abs() < 1e-6 && y.y.abs() < 1e-6;
    if z.y < 1.0 - 1e-9 || !round {
        let height = image.height.min(MAX_HEIGHT);
        let to_light = to_world.inverse();
        let size = [image.width.min(2 * MAX_HEIGHT), height];
        return (resampled(image, size, 2, &to_light, equirectangular), 0.0);
    }
    // The angle of +x of the light from +z towards -x, in which maps of the world increase.
    let start = (-x.x).atan2(x.z);
    let towards = |angle: f64| DVec3::new(-angle.sin(), 0.0, angle.cos());
    let forward = towards(start + 0.5 * PI).dot(y) > 0.0;
    let turned = (start + PI).to_degrees().rem_euclid(360.0) as f32;
    // `rotation_deg` is counter-clockwise seen from above, which is from +z towards +x.
    let rotation = (-turned).rem_euclid(360.0);
    let texels = match (&image.texels, forward) {
        (texels, true) => texels.clone(),
        (Texels::Rgba8(t), false) => Texels::Rgba8(mirrored(t, image.width).into()),
        (Texels::RgbaF32(t), false) => Texels::RgbaF32(mirrored(t, image.width)),
    };
    let map = TextureDesc::new(&image.file, image.width, image.height, texels);
    (map, rotation)
}

/// Returns rows in reverse order of their columns.
fn mirrored<T: Copy>(texels: &[T], width: u32) -> Vec<T> {
    let rows = texels.chunks_exact(width.max(1) as usize);
    rows.flat_map(|row| row.iter().rev().copied()).collect()
}

/// Returns the illuminance of a map of version 4 on a surface that faces its +z.
pub(super) fn upper_illuminance(image: &TextureDesc) -> f64 {
    let (w, h) = (image.width, image.height);
    let mut sum = 0.0;
    for y in 0..h {
        for x in 0..w {
            let at = |i: u32, n: u32| 2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0;
            let (u, v) = (at(x, w), at(y, h));
            let distance = 1.0 - (u.abs() + v.abs());
            if distance > 0.0 {
                let cos = 1.0 - (1.0 - distance) * (1.0 - distance);
                sum += cos * luminance(texel(image, x, y).map(f64::from));
            }
        }
    }
    // Each texel covers an equal part of the sphere.
    sum * 4.0 * PI / (f64::from(w) * f64::from(h))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::environment::direction;

    /// Returns a map whose texels contain their direction, mapped to 0..=1.
    fn directions(width: u32, height: u32, at: impl Fn(f64, f64) -> DVec3) -> TextureDesc {
        let texels = (0..width * height).map(|i| {
            let (x, y) = (f64::from(i % width) + 0.5, f64::from(i / width) + 0.5);
            let d = at(x / f64::from(width), y / f64::from(height)) * 0.5 + 0.5;
            [d.x as f32, d.y as f32, d.z as f32, 1.0]
        });
        TextureDesc::new("", width, height, Texels::RgbaF32(texels.collect()))
    }

    fn decoded(map: &TextureDesc, x: u32, y: u32) -> DVec3 {
        let [r, g, b] = texel(map, x, y).map(f64::from);
        DVec3::new(r, g, b) * 2.0 - 1.0
    }

    #[test]
    fn maps_of_equal_area_show_every_direction_where_it_is() {
        let square = directions(64, 64, from_square);
        let turned = DMat3::from_rotation_x(-0.5 * PI) * DMat3::from_rotation_z(0.3);
        for to_world in [
            turned,
            DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)) * turned,
        ] {
            let map = from_equal_area(&square, &to_world);
            assert_eq!((map.width, map.height), (128, 64));
            for (x, y) in [(0, 32), (20, 10), (64, 50), (100, 33), (127, 5)] {
                let expected = direction((f64::from(x) + 0.5) / 128.0, (f64::from(y) + 0.5) / 64.0);
                let found = to_world * decoded(&map, x, y);
                assert!(
                    found.distance(expected) < 0.06,
                    "{x} {y}: {found} {expected}"
                );
            }
        }
        // The mean over the sphere is preserved.
        let bright = directions(32, 32, |x, y| DVec3::splat(x * x + 3.0 * y));
        let map = from_equal_area(&bright, &turned);
        let (mut mean, mut weights) = (0.0, 0.0);
        for y in 0..map.height {
            let weight = (PI * (f64::from(y) + 0.5) / f64::from(map.height)).sin();
            for x in 0..map.width {
                mean += weight * f64::from(texel(&map, x, y)[0]);
                weights += weight;
            }
        }
        let own: f64 = (0..1024)
            .map(|i| f64::from(texel(&bright, i % 32, i / 32)[0]))
            .sum();
        assert!((mean / weights / (own / 1024.0) - 1.0).abs() < 2e-3);
        assert!(
            (upper_illuminance(&directions(64, 64, |_, _| DVec3::ONE)) / PI - 1.0).abs() < 1e-3
        );
    }

    #[test]
    fn maps_of_the_world_become_squares_that_show_the_same() {
        let own = directions(128, 64, direction);
        let square = to_equal_area(&own, 40.0);
        assert_eq!((square.width, square.height), (92, 92));
        let back = from_equal_area(&square, &DMat3::IDENTITY);
        let turn = DMat3::from_rotation_y(40f64.to_radians());
        for (x, y) in [(0, 40), (20, 10), (64, 50), (100, 33), (150, 70)] {
            let size = [back.width, back.height].map(f64::from);
            let at = [
                (f64::from(x) + 0.5) / size[0],
                (f64::from(y) + 0.5) / size[1],
            ];
            let (found, expected) = (turn * decoded(&back, x, y), direction(at[0], at[1]));
            assert!(
                found.distance(expected) < 0.05,
                "{x} {y}: {found} {expected}"
            );
        }
    }

    #[test]
    fn maps_of_version_3_keep_their_texels_about_the_vertical_axis() {
        let book = |u: f64, v: f64| {
            let ((y, x), (sin, cos)) = ((TAU * u).sin_cos(), (PI * v).sin_cos());
            DVec3::new(x * sin, y * sin, cos)
        };
        let image = directions(64, 32, book);
        let upright = DMat3::from_rotation_x(-0.5 * PI);
        let mirror = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
        let tilted = DMat3::from_rotation_x(0.4);
        for to_world in [
            upright,
            upright * DMat3::from_rotation_z(1.0),
            mirror * upright * DMat3::from_rotation_z(2.0),
            tilted,
            mirror,
        ] {
            let (map, degrees) = from_equirectangular(&image, &to_world);
            for (x, y) in [(3, 16), (20, 10), (40, 25), (60, 15)] {
                let local = direction((f64::from(x) + 0.5) / 64.0, (f64::from(y) + 0.5) / 32.0);
                let expected = DMat3::from_rotation_y(f64::from(degrees).to_radians()) * local;
                let found = to_world * decoded(&map, x, y);
                assert!(
                    found.distance(expected) < 0.03,
                    "{x} {y}: {found} {expected}"
                );
            }
        }
    }
}
