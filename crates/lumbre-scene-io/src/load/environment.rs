//! Equirectangular environment maps computed from others.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec3};

use lumbre_light::scene::compile::Curve;
use lumbre_light::scene::desc::{Texels, TextureDesc};

/// Greatest height of a map that is computed.
pub(super) const MAX_HEIGHT: u32 = 2048;

/// Least height of a map that is computed, at which a coarse one keeps its interpolation.
pub(super) const MIN_HEIGHT: u32 = 512;

/// Rows from which on a map has the same light within 0.5 % whether its first and last row are at the
/// poles, as in Mitsuba, or half a texel from them, as here.
pub(crate) const FINE_ROWS: u32 = 90;

/// Returns a finer map for Mitsuba, whose first and last rows are at the poles.
pub(crate) fn with_rows_at_poles(image: &TextureDesc) -> TextureDesc {
    let height = (2 * image.height).max(MIN_HEIGHT);
    let width = image.width.max(2 * height);
    let [w, h] = [image.width, image.height].map(f64::from);
    let texel = |x: u32, y: u32| {
        let u = (f64::from(x) + 0.5) / f64::from(width);
        let v = f64::from(y) / f64::from(height - 1);
        let [r, g, b] = bilinear(image, u * w - 0.5, v * h - 0.5);
        [r, g, b, 1.0]
    };
    let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let texels = texels.map(|(x, y)| texel(x, y)).collect();
    TextureDesc::new(&image.file, width, height, Texels::RgbaF32(texels))
}

/// Returns the linear colour of a texel.
pub(super) fn texel(image: &TextureDesc, x: u32, y: u32) -> [f32; 3] {
    let at = y as usize * image.width as usize + x as usize;
    match &image.texels {
        Texels::Rgba8(t) => {
            let [r, g, b, _] = t[at];
            [r, g, b].map(|c| Curve::Srgb.decode(c))
        }
        Texels::RgbaF32(t) => [t[at][0], t[at][1], t[at][2]],
    }
}

/// Returns the colour between the centres of texels, which are at whole numbers; columns repeat.
pub(super) fn bilinear(image: &TextureDesc, x: f64, y: f64) -> [f32; 3] {
    let (w, h) = (i64::from(image.width), i64::from(image.height));
    let (fx, fy) = ((x - x.floor()) as f32, (y - y.floor()) as f32);
    let at = |i: i64, j: i64| {
        let (i, j) = (
            (x.floor() as i64 + i).rem_euclid(w),
            (y.floor() as i64 + j).clamp(0, h - 1),
        );
        texel(image, i as u32, j as u32)
    };
    let corners = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
    std::array::from_fn(|c| {
        let row = |a: [f32; 3], b: [f32; 3]| a[c] + (b[c] - a[c]) * fx;
        let (top, bottom) = (row(corners[0], corners[1]), row(corners[2], corners[3]));
        top + (bottom - top) * fy
    })
}

/// Returns the direction in the world of a point of an equirectangular map, both in 0..=1.
pub(super) fn direction(u: f64, v: f64) -> DVec3 {
    let ((sin, cos), (x, z)) = ((PI * v).sin_cos(), (TAU * (u - 0.5)).sin_cos());
    DVec3::new(-x * sin, cos, z * sin)
}

/// Computes a map of the world from one of a light, each texel as the mean of some directions in
/// it.
pub(super) fn resampled(
    image: &TextureDesc,
    [width, height]: [u32; 2],
    samples: u32,
    to_light: &DMat3,
    lookup: fn(&TextureDesc, DVec3) -> [f32; 3],
) -> TextureDesc {
    let mut texels = Vec::with_capacity(width as usize * height as usize);
    let inside = |i: u32, k: u32, n: u32| {
        (f64::from(i) + (f64::from(k) + 0.5) / f64::from(samples)) / f64::from(n)
    };
    for y in 0..height {
        for x in 0..width {
            let mut sum = [0.0f32; 3];
            for k in 0..samples * samples {
                let (u, v) = (
                    inside(x, k % samples, width),
                    inside(y, k / samples, height),
                );
                let d = (*to_light * direction(u, v)).normalize_or(DVec3::Z);
                let c = lookup(image, d);
                sum.iter_mut().zip(c).for_each(|(sum, c)| *sum += c);
            }
            let [r, g, b] = sum.map(|c| c / (samples * samples) as f32);
            texels.push([r, g, b, 1.0]);
        }
    }
    TextureDesc::new(&image.file, width, height, Texels::RgbaF32(texels))
}
