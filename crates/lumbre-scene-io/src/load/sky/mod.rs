//! The sun and the clear sky as an environment map.
//!
//! Everything here is in a frame in which +y points at the zenith. Radiance and irradiance are in
//! linear sRGB per nanometre: a spectrum of 1 W m^-2 sr^-1 nm^-1 has a luminance of 1.

mod sun;
#[cfg(test)]
mod tests;

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DMat3, DVec2, DVec3, Vec3};
use hw_skymodel::rgb::{Channel, Error, SkyParams, SkyState};

pub(super) use self::sun::{Moment, SUN_RADIUS, hosek_irradiance, preetham_irradiance};
use super::environment::direction;
use lumbre_light::scene::desc::{Texels, TextureDesc};

/// Integral of the matching function y of the CIE 1931 observer in nanometres, by which the data of
/// the sky are divided.
const LUMINANCE_INTEGRAL: f64 = 106.857;

/// Columns and rows of the map of a sky, and of one with a sun.
const SIZES: [[u32; 2]; 2] = [[1024, 512], [2048, 1024]];

/// Least angular radius of the disk of the sun in radians, more than half a texel.
pub(super) const MIN_RADIUS: f64 = 0.1 * PI / 180.0;

/// Width in texels from which on a disk is wide: its edge needs fewer samples.
const WIDE: f64 = 40.0;

/// The light of a day.
pub(super) struct DaySky {
    /// Direction towards the sun: a unit vector, not below the horizon.
    pub sun: DVec3,
    /// Turbidity of the air, from 1 to 10.
    pub turbidity: f64,
    /// Albedo of the ground, from 0 to 1.
    pub albedo: Vec3,
    /// Factor on the radiance of the sky.
    pub sky_scale: f64,
    /// Irradiance of the sun on a surface that faces it.
    pub sun_irradiance: DVec3,
    /// Angular radius of the disk of the sun in radians, at least [`MIN_RADIUS`].
    pub sun_radius: f64,
    /// Factor on angles from the zenith, from 1 to 2. Above 1 the sky covers more than its half.
    pub stretch: f64,
    /// Whether the colours of the horizon extend below it, darker towards the nadir.
    pub extend: bool,
}

impl DaySky {
    /// Computes the environment map. `to_sky` maps directions of the scene to those of the sky.
    ///
    /// # Errors
    /// Fails if turbidity or albedo are out of range.
    pub fn map(&self, to_sky: &DMat3) -> Result<TextureDesc, Error> {
        let state = SkyState::new(&SkyParams {
            elevation: self.sun.y.clamp(0.0, 1.0).asin() as f32,
            turbidity: self.turbidity as f32,
            albedo: self.albedo.to_array(),
        })?;
        let has_sun = self.sun_irradiance != DVec3::ZERO;
        let [width, height] = SIZES[usize::from(has_sun)];
        let grid = Grid {
            width,
            height,
            to_sky,
        };
        let radiance = |d: DVec3| self.radiance(&state, d).as_vec3();
        let horizon = self.stretch * FRAC_PI_2;
        let mut colors = Vec::with_capacity(width as usize * height as usize);
        for (x, y) in grid.texels() {
            let center = grid.center(x, y);
            let from_horizon = (zenith_angle(center) - horizon).abs();
            let at_horizon = from_horizon < grid.half_diagonal() && !self.extend;
            colors.push(match at_horizon {
                true => grid.samples(x, y, 4).map(radiance).sum::<Vec3>() / 16.0,
                false => radiance(center),
            });
        }
        if has_sun {
            self.add_sun(&grid, &mut colors);
        }
        let texel = |c: Vec3| c.extend(1.0).to_array();
        let texels = Texels::RgbaF32(colors.into_iter().map(texel).collect());
        Ok(TextureDesc::new("sunsky", width, height, texels))
    }

    /// Returns the radiance of the sky from a direction, without the disk of the sun
    /// [Hosek & Wilkie 2012, eq. 8]. Negative values become 0.
    fn radiance(&self, state: &SkyState, d: DVec3) -> DVec3 {
        if !self.is_visible(d) {
            return DVec3::ZERO;
        }
        let zenith = zenith_angle(d);
        let theta = (zenith / self.stretch).min(FRAC_PI_2 - 1e-4);
        let across = DVec2::new(d.x, d.z).normalize_or_zero() * theta.sin();
        let in_model = DVec3::new(across.x, theta.cos(), across.y);
        let gamma = in_model.dot(self.sun).clamp(-1.0, 1.0).acos();
        let [r, g, b] = [Channel::R, Channel::G, Channel::B]
            .map(|channel| f64::from(state.radiance(theta as f32, gamma as f32, channel)));
        let fade = match self.extend {
            true => smooth_step(2.0 - zenith / FRAC_PI_2),
            false => 1.0,
        };
        DVec3::new(r, g, b).max(DVec3::ZERO) * (fade * self.sky_scale / LUMINANCE_INTEGRAL)
    }

    /// Returns whether a direction is above the lower edge of the light.
    fn is_visible(&self, d: DVec3) -> bool {
        self.extend || zenith_angle(d) < self.stretch * FRAC_PI_2
    }

    /// Adds the disk of the sun. Its whole irradiance is exact, of which the part of a disk below
    /// the edge of the light is missing.
    fn add_sun(&self, grid: &Grid, colors: &mut [Vec3]) {
        let zenith = zenith_angle(self.sun) * self.stretch;
        let across = DVec2::new(self.sun.x, self.sun.z).normalize_or(DVec2::X) * zenith.sin();
        let center = DVec3::new(across.x, zenith.cos(), across.y);
        let near = (self.sun_radius + grid.half_diagonal()).min(PI).cos();
        let inside = self.sun_radius.cos();
        let wide = self.sun_radius > WIDE * grid.half_diagonal();
        let samples = if wide { 4 } else { 32 };
        let mut covered = Vec::new();
        let mut total = 0.0;
        for ((x, y), color) in grid.texels().zip(colors) {
            if grid.center(x, y).dot(center) < near {
                continue;
            }
            let (mut disk, mut visible) = (0, 0);
            for d in grid.samples(x, y, samples) {
                let hit = d.dot(center) >= inside;
                disk += u32::from(hit);
                visible += u32::from(hit && self.is_visible(d));
            }
            total += f64::from(disk) * grid.solid_angle(y);
            covered.push((color, visible));
        }
        for (color, visible) in covered {
            *color += (self.sun_irradiance * (f64::from(visible) / total)).as_vec3();
        }
    }
}

/// Texels of an environment map in the axes of the scene.
struct Grid<'a> {
    width: u32,
    height: u32,
    to_sky: &'a DMat3,
}

impl Grid<'_> {
    /// Returns column and row of all texels, row by row.
    fn texels(&self) -> impl Iterator<Item = (u32, u32)> + use<> {
        let width = self.width;
        (0..self.height).flat_map(move |y| (0..width).map(move |x| (x, y)))
    }

    /// Returns the direction in the sky of the centre of a texel.
    fn center(&self, x: u32, y: u32) -> DVec3 {
        self.point(f64::from(x) + 0.5, f64::from(y) + 0.5)
    }

    /// Returns the directions in the sky of `n` times `n` points of a texel.
    fn samples(&self, x: u32, y: u32, n: u32) -> impl Iterator<Item = DVec3> {
        let inside = move |i: u32| (f64::from(i) + 0.5) / f64::from(n);
        let at = move |k: u32| [f64::from(x) + inside(k % n), f64::from(y) + inside(k / n)];
        (0..n * n).map(at).map(|[x, y]| self.point(x, y))
    }

    /// Returns the direction in the sky of a point in units of texels.
    fn point(&self, x: f64, y: f64) -> DVec3 {
        let d = direction(x / f64::from(self.width), y / f64::from(self.height));
        (*self.to_sky * d).normalize_or(DVec3::Y)
    }

    /// Returns the solid angle of a texel in steradians.
    fn solid_angle(&self, y: u32) -> f64 {
        let edge = |y: u32| (PI * f64::from(y) / f64::from(self.height)).cos();
        TAU / f64::from(self.width) * (edge(y) - edge(y + 1))
    }

    /// Returns the greatest angle between the centre of a texel and a point of it, in radians.
    fn half_diagonal(&self) -> f64 {
        PI / f64::from(self.height) * 0.5f64.sqrt()
    }
}

/// Returns the angle of a unit vector from the zenith in radians.
fn zenith_angle(d: DVec3) -> f64 {
    d.y.clamp(-1.0, 1.0).acos()
}

/// Returns a smooth ramp from 0 to 1.
fn smooth_step(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}
