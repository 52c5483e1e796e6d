//! Light from outside the scene: a constant colour, or an equirectangular map that is sampled by
//! its brightness.
//!
//! Radiance is interpolated between the centres of four texels, across the seam and up to the
//! poles. Directions are sampled from cells of one texel each, in proportion to the cell's mean
//! luminance of that same interpolation times its solid angle, and uniformly per solid angle inside
//! the cell. So every direction with radiance has a density, no density has the singularity of 1 /
//! sin theta at a pole, and none exceeds that of 16 times its luminance. With the sampling
//! `uniform` all cells have the probability of their solid angle.
//!
//! A compensated density is in proportion to what a cell exceeds the mean of all directions by
//! [Karlik et al. 2019, sec. 5.2]: the rest is left to the sampling of BSDFs, against which it is
//! weighted. It is zero in most directions, so it serves no paths that start at lights.

use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use glam::Vec3;

use crate::math::distribution::Grid;
use crate::math::luminance::luminance_of;
use crate::math::real::{Real, Vector};
use crate::math::simd::{Lanes, map_vectors};
use crate::math::warp;
use crate::scene::compile::{Environment, Texture};
use crate::scene::desc::EnvironmentSampling;

/// The environment of a scene, prepared for evaluation and sampling.
#[derive(Clone, Debug)]
pub struct EnvironmentLight {
    /// Constant radiance, or factor on the map.
    pub radiance: Vec3,
    pub map: Option<EnvironmentMap>,
    /// Luminance integrated over all directions.
    power: f64,
}

/// An equirectangular map of all directions.
#[derive(Clone, Debug)]
pub struct DirectionMap {
    pub texture: Arc<Texture>,
    /// Sine and cosine of the rotation about the vertical axis.
    pub turn: [f32; 2],
}

/// An equirectangular map with its sampling distribution.
#[derive(Clone, Debug)]
pub struct EnvironmentMap {
    pub directions: DirectionMap,
    pub grid: Grid,
    /// Cosine of the polar angle at the upper edge of every row, and at the lower edge of the last
    /// one.
    pub row_cos: Vec<f64>,
}

impl EnvironmentLight {
    /// Prepares an environment; `None` if it is black. If it is `compensated`, so is the density of the
    /// directions of a map.
    pub fn new(environment: &Environment, compensated: bool) -> Option<EnvironmentLight> {
        let radiance = environment.radiance;
        let Some(texture) = &environment.map else {
            let power = 4.0 * std::f64::consts::PI * luminance_of(radiance);
            return (power > 0.0).then_some(EnvironmentLight {
                radiance,
                map: None,
                power,
            });
        };
        let width = texture.width as usize;
        let row_cos = row_cosines(texture);
        let mut weights = cell_integrals(texture, radiance, &row_cos);
        let power: f64 = weights.iter().sum();
        if environment.sampling == EnvironmentSampling::Uniform && power > 0.0 {
            for (row, edges) in weights.chunks_exact_mut(width).zip(row_cos.windows(2)) {
                row.fill(edges[0] - edges[1]);
            }
        } else if compensated {
            weights = compensated_weights(weights, power, &row_cos);
        }
        let grid = Grid::new(width, &weights)?;
        let map = EnvironmentMap {
            directions: DirectionMap::new(Arc::clone(texture), environment.rotation_rad),
            grid,
            row_cos,
        };
        Some(EnvironmentLight {
            radiance,
            map: Some(map),
            power,
        })
    }

    /// Returns the luminance integrated over all directions.
    pub fn power(&self) -> f64 {
        self.power
    }

    /// Returns the radiance that arrives from the unit directions `dir` in the lanes of `wanted`.
    #[inline(always)]
    pub fn radiance<R: Lanes<N>, const N: usize>(&self, dir: R::Vec3, wanted: R::Mask) -> R::Vec3 {
        let radiance = R::Vec3::broadcast(self.radiance);
        match &self.map {
            None => radiance,
            Some(map) => {
                let colors = map_vectors::<R, N, 3>(dir, wanted, |_, dir| {
                    map.directions.color(dir).to_array()
                });
                radiance * R::Vec3::new(colors[0], colors[1], colors[2])
            }
        }
    }

    /// Samples directions towards the environment in the lanes of `wanted`, with their densities
    /// per solid angle.
    #[inline(always)]
    pub fn sample<R: Lanes<N>, const N: usize>(&self, u: [R; 2], wanted: R::Mask) -> (R::Vec3, R) {
        match &self.map {
            None => (warp::uniform_sphere(u), R::splat(1.0 / (4.0 * PI))),
            Some(map) => {
                let u = R::Vec3::new(u[0], u[1], R::splat(0.0));
                let [x, y, z, pdf_w] = map_vectors::<R, N, 4>(u, wanted, |_, u| {
                    let (dir, pdf_w) = map.sample([u.x, u.y]);
                    [dir.x, dir.y, dir.z, pdf_w]
                });
                (R::Vec3::new(x, y, z), pdf_w)
            }
        }
    }

    /// Returns the densities per solid angle with which [`EnvironmentLight::sample`] samples
    /// directions, in the lanes of `wanted`.
    #[inline(always)]
    pub fn pdf_w<R: Lanes<N>, const N: usize>(&self, dir: R::Vec3, wanted: R::Mask) -> R {
        match &self.map {
            None => R::splat(1.0 / (4.0 * PI)),
            Some(map) => map_vectors::<R, N, 1>(dir, wanted, |_, dir| [map.pdf_w(dir)])[0],
        }
    }
}

impl DirectionMap {
    /// Creates a map that is turned by an angle in radians.
    pub fn new(texture: Arc<Texture>, rotation_rad: f32) -> DirectionMap {
        let (sin, cos) = rotation_rad.sin_cos();
        DirectionMap {
            texture,
            turn: [sin, cos],
        }
    }

    /// Returns the colour in a unit direction.
    #[inline(always)]
    pub fn color(&self, dir: Vec3) -> Vec3 {
        bilinear(&self.texture, self.coordinates(dir), Edge::Seam)
    }

    /// Returns column and row of a direction as fractions of width and height, both in 0..=1.
    #[inline]
    fn coordinates(&self, dir: Vec3) -> [f32; 2] {
        let [sin, cos] = self.turn;
        let (x, z) = (dir.x * cos - dir.z * sin, dir.x * sin + dir.z * cos);
        let u = x.atan2(-z) / TAU;
        [
            if u < 0.0 { u + 1.0 } else { u },
            x.hypot(z).atan2(dir.y) / PI,
        ]
    }

    /// Returns the luminance of the map times a factor, integrated over all directions.
    pub fn power(&self, factor: Vec3) -> f64 {
        let row_cos = row_cosines(&self.texture);
        cell_integrals(&self.texture, factor, &row_cos).iter().sum()
    }
}

/// The meaning of columns beyond the left and the right edge of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Edge {
    /// Those at the other edge.
    Seam,
    /// Those at the same edge.
    Clamped,
}

/// Returns the colour of an image at fractions of its width and height.
#[inline(always)]
pub fn bilinear(texture: &Texture, [u, v]: [f32; 2], edge: Edge) -> Vec3 {
    let (width, height) = (texture.width as i64, texture.height as i64);
    let (x, y) = (u * width as f32 - 0.5, v * height as f32 - 0.5);
    let (left, top) = (Real::floor(x), Real::floor(y));
    let at = |dx: i64, dy: i64| {
        // At most one column beyond either edge; a division would be slower.
        let column = left as i64 + dx;
        let column = if edge == Edge::Clamped {
            column.clamp(0, width - 1)
        } else if column < 0 {
            column + width
        } else if column >= width {
            column - width
        } else {
            column
        };
        let row = (top as i64 + dy).clamp(0, height - 1);
        Vec3::from_array(texture.texels.at((row * width + column) as usize))
    };
    let (fx, fy) = (x - left, y - top);
    at(0, 0)
        .lerp(at(1, 0), fx)
        .lerp(at(0, 1).lerp(at(1, 1), fx), fy)
}

impl EnvironmentMap {
    /// Samples a direction, with its density per solid angle.
    fn sample(&self, u: [f32; 2]) -> (Vec3, f32) {
        let s = self.grid.sample(u);
        let [x, y] = s.cell;
        let phi = TAU * ((x as f32 + s.inside[0]) / self.directions.texture.width as f32);
        let (sin_phi, cos_phi) = phi.sin_cos();
        let (upper, lower) = (self.row_cos[y], self.row_cos[y + 1]);
        // In double precision: near a pole the sine is the root of a small difference from one.
        let cos = upper + (lower - upper) * f64::from(s.inside[1]);
        let sin = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt() as f32;
        let (px, pz) = (sin * sin_phi, -sin * cos_phi);
        let [turn_sin, turn_cos] = self.directions.turn;
        let dir = Vec3::new(
            px * turn_cos + pz * turn_sin,
            cos as f32,
            pz * turn_cos - px * turn_sin,
        );
        (dir, self.density(s.probability, y))
    }

    /// Returns the density per solid angle with which [`EnvironmentMap::sample`] samples a
    /// direction.
    fn pdf_w(&self, dir: Vec3) -> f32 {
        let [u, v] = self.directions.coordinates(dir);
        let texture = &self.directions.texture;
        let (width, height) = (texture.width, texture.height);
        let x = ((u * width as f32) as usize).min(width as usize - 1);
        let y = ((v * height as f32) as usize).min(height as usize - 1);
        self.density(self.grid.probability(x, y), y)
    }

    /// Returns the density per solid angle inside a cell of row `y` with this probability.
    #[inline]
    fn density(&self, probability: f32, y: usize) -> f32 {
        let band = std::f64::consts::TAU * (self.row_cos[y] - self.row_cos[y + 1]);
        (f64::from(probability) * f64::from(self.directions.texture.width) / band) as f32
    }
}

/// Returns what the integrals over the cells of a map exceed those of its mean by, or the integrals
/// themselves of a map whose cells are all alike. `power` is their sum.
fn compensated_weights(weights: Vec<f64>, power: f64, row_cos: &[f64]) -> Vec<f64> {
    let width = weights.len() / (row_cos.len() - 1);
    let mean = power / (4.0 * std::f64::consts::PI);
    let mut above = weights.clone();
    for (row, edges) in above.chunks_exact_mut(width).zip(row_cos.windows(2)) {
        let of_mean = mean * solid_angle(edges, width);
        row.iter_mut()
            .for_each(|cell| *cell = (*cell - of_mean).max(0.0));
    }
    if above.iter().sum::<f64>() > LEAST_EXCESS * power {
        above
    } else {
        weights
    }
}

/// Returns the solid angle of a cell of a row with these cosines at its edges.
fn solid_angle(edges: &[f64], width: usize) -> f64 {
    std::f64::consts::TAU * (edges[0] - edges[1]) / width as f64
}

/// Share of a map's light above its mean from which on its density is compensated.
const LEAST_EXCESS: f64 = 1e-3;

/// Returns the cosine of the polar angle at the upper edge of every row of a map, and at the lower
/// edge of the last one.
fn row_cosines(texture: &Texture) -> Vec<f64> {
    let height = f64::from(texture.height);
    (0..=texture.height)
        .map(|y| (std::f64::consts::PI * f64::from(y) / height).cos())
        .collect()
}

/// Computes the luminance of the interpolated map times a factor, integrated over every texel's
/// cell.
fn cell_integrals(texture: &Texture, factor: Vec3, row_cos: &[f64]) -> Vec<f64> {
    let width = texture.width as usize;
    let mut cells = cell_means(texture, factor);
    for (row, edges) in cells.chunks_exact_mut(width).zip(row_cos.windows(2)) {
        let solid_angle = solid_angle(edges, width);
        row.iter_mut().for_each(|cell| *cell *= solid_angle);
    }
    cells
}

/// Computes the mean luminance of the interpolated map over every texel's cell: an eighth of the
/// weight goes to each neighbour.
fn cell_means(texture: &Texture, factor: Vec3) -> Vec<f64> {
    let (width, height) = (texture.width as usize, texture.height as usize);
    let texels: Vec<f64> = texture
        .texels
        .iter()
        .map(|t| luminance_of(Vec3::from_array(t) * factor))
        .collect();
    let blend = |before: f64, here: f64, after: f64| 0.125 * before + 0.75 * here + 0.125 * after;
    let mut rows = Vec::with_capacity(texels.len());
    for row in texels.chunks_exact(width) {
        rows.extend(
            (0..width).map(|x| blend(row[(x + width - 1) % width], row[x], row[(x + 1) % width])),
        );
    }
    let at = |x: usize, y: usize| rows[y * width + x];
    (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .map(|(x, y)| {
            blend(
                at(x, y.saturating_sub(1)),
                at(x, y),
                at(x, (y + 1).min(height - 1)),
            )
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the light of a map of one row, whose texels have these values.
    fn of_columns(columns: [f32; 4], compensated: bool) -> EnvironmentLight {
        let environment = Environment {
            map: Some(Arc::new(Texture::new(
                4,
                1,
                columns.map(|x| [x; 3]).to_vec(),
            ))),
            radiance: Vec3::ONE,
            rotation_rad: 0.0,
            sampling: EnvironmentSampling::default(),
        };
        EnvironmentLight::new(&environment, compensated).unwrap()
    }

    /// Returns the direction at a fraction of the width of a map, on the horizon.
    fn horizon(u: f32) -> Vec3 {
        let (sin, cos) = (TAU * u).sin_cos();
        Vec3::new(sin, 0.0, -cos)
    }

    #[test]
    fn radiance_is_interpolated_across_the_seam() {
        let environment = of_columns([1.0, 5.0, 2.0, 9.0], false);
        // Fractions of the width: the centre of texel k is at (k + 1/2) / 4.
        for (u, expected) in [
            (0.125, 1.0),
            (0.25, 3.0),
            (0.875, 9.0),
            (0.9375, 7.0),
            (0.99999, 5.0),
            (0.00001, 5.0),
            (0.0625, 3.0),
        ] {
            let found = environment.radiance::<f32, 1>(horizon(u), true).x;
            assert!(
                (found - expected).abs() < 1e-3,
                "{u}: {found}, expected {expected}"
            );
        }
    }

    #[test]
    fn directions_across_the_seam_are_sampled() {
        for lit in [0, 3] {
            let environment =
                of_columns([0, 1, 2, 3].map(|x| f32::from(u8::from(x == lit))), false);
            for u in [0.01, 0.99] {
                let radiance = environment.radiance::<f32, 1>(horizon(u), true).x;
                let density = environment.pdf_w::<f32, 1>(horizon(u), true);
                assert!(radiance > 0.4 && density > 0.0, "{lit} {u}: {density}");
            }
        }
    }

    #[test]
    fn a_compensated_density_is_that_of_the_light_above_the_mean() {
        // The means of the cells are 3.125, 3.75, 4.625 and 7.5, an eighth of each neighbour included, and
        // that of all is 4.75.
        let environment = of_columns([2.0, 4.0, 4.0, 9.0], true);
        let density = |u: f32| environment.pdf_w::<f32, 1>(horizon(u), true);
        assert_eq!([0.1, 0.4, 0.6].map(density), [0.0; 3]);
        // All light above the mean is in a quarter of the sphere.
        assert!((density(0.9) - 1.0 / PI).abs() < 1e-5, "{}", density(0.9));
        for i in 0..64 {
            let u = [(i as f32 + 0.5) / 64.0, 0.37];
            let (dir, pdf_w) = environment.sample::<f32, 1>(u, true);
            assert_eq!(pdf_w, environment.pdf_w::<f32, 1>(dir, true));
            assert!(pdf_w > 0.0);
        }
        let plain = of_columns([2.0, 4.0, 4.0, 9.0], false);
        assert_eq!(environment.power(), plain.power());
        // Rows of a quarter, a half and a quarter of the sphere, with means of 5.75, 3.875 and 1.375: 3.71875
        // in all.
        let rows = [6.0, 4.0, 1.0].map(|x| [x; 3]).to_vec();
        let environment = Environment {
            map: Some(Arc::new(Texture::new(1, 3, rows))),
            radiance: Vec3::ONE,
            rotation_rad: 0.0,
            sampling: EnvironmentSampling::default(),
        };
        let environment = EnvironmentLight::new(&environment, true).unwrap();
        let excess = [2.03125 * 0.25, 0.15625 * 0.5].map(|x: f32| x / 0.5859375);
        for (dir, expected) in [
            (Vec3::Y, excess[0] / PI),
            (Vec3::X, excess[1] / (2.0 * PI)),
            (Vec3::NEG_Y, 0.0),
        ] {
            let found = environment.pdf_w::<f32, 1>(dir, true);
            assert!((found - expected).abs() < 1e-5, "{dir}: {found}");
        }
        let even = of_columns([3.0; 4], true);
        assert!((even.pdf_w::<f32, 1>(horizon(0.1), true) - 0.25 / PI).abs() < 1e-6);
    }
}
