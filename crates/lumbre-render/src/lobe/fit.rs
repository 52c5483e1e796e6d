//! Samples of a BSDF and of a profile of delays, compared with the density that they state.

use std::f64::consts::{PI, TAU};

use glam::Vec3;

use super::cells::SphereCells;
use super::slice::mean_of;
use lumbre_light::math::Frame;
use lumbre_light::math::rng::{pcg4d, unit};
use lumbre_light::math::stats::chi_square_p;
use lumbre_light::scene::compile::Material;
use lumbre_light::transport::bsdf::{Bsdf, TransportMode};
use lumbre_light::transport::delay::Profile;

/// Number of directions that are sampled.
const DIRECTIONS: u32 = 1 << 17;

/// Number of delays that are sampled, as in figure 3.1 of thesis S2.
const DELAYS: u32 = 100_000;

/// Number of bins of a histogram of delays.
pub const DELAY_BINS: usize = 60;

/// Columns of the map of the sphere: azimuths about the normal, from -180 to 180 degrees.
pub const COLUMNS: usize = 72;

/// Rows of the map of the sphere: angles from the normal, from 0 to 180 degrees.
pub const ROWS: usize = 36;

/// Points along each side of a cell of the map at which the stated density is evaluated.
const POINTS: usize = 6;

/// Directions that a BSDF samples for one direction to the previous vertex.
#[derive(Clone, Debug, PartialEq)]
pub struct DirectionFit {
    /// Number of samples.
    pub samples: u32,
    /// Number of samples without a density: in Dirac lobes, or without a direction.
    pub without_density: u32,
    /// Integral of the stated density over the sphere.
    pub mass: f64,
    /// P-value of the chi-square test of all samples against the density, over cells that resolve
    /// the lobes; samples without a density are a further cell.
    pub p_value: f64,
    /// Stated density in 1/sr, the mean of each cell of the map, `[row][column]`.
    pub stated: Vec<f64>,
    /// Density of the samples in 1/sr in each cell of the map.
    pub drawn: Vec<f64>,
}

impl DirectionFit {
    /// Samples the BSDF of a material with the unit shading normal `frame.n`. Azimuths of the map
    /// are counted from `frame.s`; `wo` is the unit direction to the previous vertex.
    pub fn new(bsdf: &Bsdf, material: &Material, frame: &Frame<Vec3>, wo: Vec3) -> DirectionFit {
        let cells = SphereCells::for_lobes(material, frame.n, wo);
        let mut observed = vec![0.0; cells.cells()];
        let mut fit = DirectionFit {
            samples: DIRECTIONS,
            without_density: 0,
            mass: 0.0,
            p_value: 1.0,
            stated: stated_map(bsdf, frame, wo),
            drawn: vec![0.0; COLUMNS * ROWS],
        };
        for i in 0..DIRECTIONS {
            let [u, v, w, _] = pcg4d([i, 1, 0, 0]).map(unit::<u32>);
            let sample = bsdf.sample(wo, u, [v, w], TransportMode::Radiance);
            match sample.filter(|sample| !sample.delta) {
                None => fit.without_density += 1,
                Some(sample) => {
                    observed[cells.cell(sample.wi)] += 1.0;
                    let [row, column] = map_cell(frame.to_local(sample.wi));
                    fit.drawn[row * COLUMNS + column] +=
                        1.0 / (f64::from(DIRECTIONS) * solid_angle(row));
                }
            }
        }
        let n = f64::from(DIRECTIONS);
        let mass = cells.integrate(|wi| [f64::from(bsdf.pdf_w(wo, wi))]);
        let mut expected: Vec<f64> = mass.iter().map(|mass| mass[0] * n).collect();
        fit.mass = expected.iter().sum::<f64>() / n;
        // The error of the quadrature is no cell of its own.
        if fit.without_density > 0 || fit.mass < 0.999 {
            observed.push(f64::from(fit.without_density));
            expected.push((n * (1.0 - fit.mass)).max(0.0));
        }
        fit.p_value = chi_square_p(&observed, &expected, 0);
        fit
    }

    /// Returns the fit of a composed material, given the probabilities of its parts, which sum to 1,
    /// and their fits: maps are weighted means, and the p-value is the least one times the number
    /// of parts (Bonferroni). `None` without parts.
    pub fn composed(parts: &[(f64, DirectionFit)]) -> Option<DirectionFit> {
        let samples = parts.first()?.1.samples;
        let mean = |of: fn(&DirectionFit) -> f64| -> f64 {
            parts.iter().map(|(p, fit)| p * of(fit)).sum()
        };
        let least = parts.iter().map(|(_, fit)| fit.p_value).reduce(f64::min)?;
        Some(DirectionFit {
            samples,
            without_density: mean(|fit| f64::from(fit.without_density)).round() as u32,
            mass: mean(|fit| fit.mass),
            p_value: (least * parts.len() as f64).min(1.0),
            stated: mean_of(parts, |fit| &fit.stated),
            drawn: mean_of(parts, |fit| &fit.drawn),
        })
    }

    /// Returns the greatest density of both maps in 1/sr.
    pub fn greatest_density(&self) -> f64 {
        self.stated
            .iter()
            .chain(&self.drawn)
            .copied()
            .fold(0.0, f64::max)
    }

    /// Returns whether the lower half of the maps, below the surface, is zero.
    pub fn is_opaque(&self) -> bool {
        let below = COLUMNS * ROWS / 2..;
        let maps = self.stated[below.clone()].iter().chain(&self.drawn[below]);
        maps.copied().all(|density| density == 0.0)
    }
}

/// Returns the solid angle of a cell of the map in a row.
fn solid_angle(row: usize) -> f64 {
    let cos = |row: usize| (PI * row as f64 / ROWS as f64).cos();
    (cos(row) - cos(row + 1)) * TAU / COLUMNS as f64
}

/// Returns row and column of a direction in the local frame.
fn map_cell(w: Vec3) -> [usize; 2] {
    let [x, y, z] = w.to_array().map(f64::from);
    let row = x.hypot(y).atan2(z) / PI * ROWS as f64;
    let column = (y.atan2(x) / TAU + 0.5) * COLUMNS as f64;
    [
        (row as usize).min(ROWS - 1),
        (column as usize).min(COLUMNS - 1),
    ]
}

/// Returns the mean of the stated density over each cell of the map.
fn stated_map(bsdf: &Bsdf, frame: &Frame<Vec3>, wo: Vec3) -> Vec<f64> {
    let middle = |i: usize| (i as f64 + 0.5) / POINTS as f64;
    let mean = |row: usize, column: usize| {
        let (mut sum, mut weight) = (0.0, 0.0);
        for (i, j) in (0..POINTS).flat_map(|i| (0..POINTS).map(move |j| (i, j))) {
            let theta = (row as f64 + middle(i)) / ROWS as f64 * PI;
            let phi = ((column as f64 + middle(j)) / COLUMNS as f64 - 0.5) * TAU;
            let [sin, cos] = [theta.sin(), theta.cos()];
            let local = Vec3::new(
                (sin * phi.cos()) as f32,
                (sin * phi.sin()) as f32,
                cos as f32,
            );
            sum += sin * f64::from(bsdf.pdf_w(wo, frame.to_world(local)));
            weight += sin;
        }
        sum / weight
    };
    (0..ROWS)
        .flat_map(|row| (0..COLUMNS).map(move |column| (row, column)))
        .map(|(row, column)| mean(row, column))
        .collect()
}

/// Delays that a profile samples.
#[derive(Clone, Debug, PartialEq)]
pub struct DelayFit {
    /// Number of samples.
    pub samples: u32,
    /// Least and greatest delay of the histogram in scene units; greater ones are in the last cell
    /// of the test alone.
    pub range: [f64; 2],
    /// Mean density of each bin in 1 / scene unit, from the distribution function.
    pub stated: Vec<f64>,
    /// Density of the samples in each bin in 1 / scene unit.
    pub drawn: Vec<f64>,
    /// P-value of the chi-square test over the bins and the delays beyond them.
    pub p_value: f64,
    /// Mean delay that the profile states, in scene units.
    pub mean: f64,
    /// Mean of the samples in scene units.
    pub drawn_mean: f64,
}

impl DelayFit {
    /// Samples a profile.
    pub fn new(profile: &Profile) -> DelayFit {
        DelayFit::composed(&[(1.0, profile.clone())])
    }

    /// Samples one of several profiles each time, given their probabilities, which sum to 1. There
    /// must be at least one.
    pub fn composed(parts: &[(f64, Profile)]) -> DelayFit {
        let at = |u: f32| {
            parts
                .iter()
                .map(move |(_, profile)| f64::from(profile.sample(u)))
        };
        let low = at(0.0).fold(f64::INFINITY, f64::min);
        let high = at(0.995).fold(0.0, f64::max);
        let margin = (0.05 * (high - low)).max(0.05 * high.abs()).max(1e-6);
        // A profile of one delay needs an edge below it, which no other profile has below zero.
        let constant = |(_, profile): &(f64, Profile)| matches!(profile, Profile::Constant(_));
        let first = if parts.iter().any(constant) {
            low - margin
        } else {
            (low - margin).max(0.0)
        };
        let range = [first, high + margin];
        let width = (range[1] - range[0]) / DELAY_BINS as f64;
        let edges: Vec<f64> = (0..=DELAY_BINS)
            .map(|bin| first + width * bin as f64)
            .collect();
        let n = f64::from(DELAYS);
        let mut observed = vec![0.0; DELAY_BINS + 2];
        let mut sum = 0.0;
        for i in 0..DELAYS {
            let [u, choice, ..] = pcg4d([i, 2, 0, 0]).map(unit::<u32>);
            let delay = f64::from(chosen(parts, choice).sample(u));
            sum += delay;
            // A delay on an edge belongs to the bin below, as in the distribution function.
            observed[edges.partition_point(|edge| *edge < delay)] += 1.0;
        }
        let mut below = vec![0.0];
        below.extend(
            edges
                .iter()
                .map(|edge| mean(parts, |profile| profile.cdf(*edge))),
        );
        below.push(1.0);
        let expected: Vec<f64> = below.windows(2).map(|two| n * (two[1] - two[0])).collect();
        let bins = |counts: &[f64]| {
            let inside = &counts[1..=DELAY_BINS];
            inside.iter().map(|count| count / (n * width)).collect()
        };
        DelayFit {
            samples: DELAYS,
            range,
            stated: bins(&expected),
            drawn: bins(&observed),
            p_value: chi_square_p(&observed, &expected, 0),
            mean: mean(parts, Profile::mean),
            drawn_mean: sum / n,
        }
    }
}

/// Returns the profile that a number in `[0, 1)` chooses.
fn chosen(parts: &[(f64, Profile)], choice: f32) -> &Profile {
    let mut below = 0.0;
    let passed = parts.iter().take_while(|(probability, _)| {
        below += probability;
        f64::from(choice) >= below
    });
    &parts[passed.count().min(parts.len() - 1)].1
}

/// Returns the mean of a quantity of profiles, weighted by their probabilities.
fn mean(parts: &[(f64, Profile)], of: impl Fn(&Profile) -> f64) -> f64 {
    parts.iter().map(|(p, profile)| p * of(profile)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A profile whose samples are those of another one.
    fn fit_of(stated: &Profile, drawn: &Profile) -> f64 {
        let n = f64::from(DELAYS);
        let [a, b] = [DelayFit::new(stated), DelayFit::new(drawn)];
        let width = (a.range[1] - a.range[0]) / DELAY_BINS as f64;
        let counts = |densities: &[f64]| -> Vec<f64> {
            densities
                .iter()
                .map(|density| density * n * width)
                .collect()
        };
        chi_square_p(&counts(&b.drawn), &counts(&a.stated), 0)
    }

    #[test]
    fn every_profile_draws_what_it_states_and_another_one_is_found() {
        let narrow = |width| Profile::Epanechnikov { mean: 0.5, width };
        for profile in [
            Profile::Constant(1.5),
            Profile::Constant(0.0),
            Profile::Exponential(2.0),
            narrow(0.1),
            narrow(0.5),
        ] {
            let fit = DelayFit::new(&profile);
            assert!(fit.p_value > 1e-3, "{profile:?}: {}", fit.p_value);
            let off = (fit.drawn_mean - fit.mean).abs();
            assert!(off < 0.01 * fit.mean.max(0.1), "{profile:?} {fit:?}");
            let width = (fit.range[1] - fit.range[0]) / DELAY_BINS as f64;
            let mass: f64 = fit.stated.iter().sum::<f64>() * width;
            assert!(mass > 0.99 && mass < 1.0 + 1e-9, "{profile:?} {mass}");
        }
        assert!(fit_of(&narrow(0.1), &narrow(0.1)) > 1e-3);
        assert!(fit_of(&narrow(0.1), &narrow(0.104)) < 1e-6);
    }

    #[test]
    fn a_composed_profile_draws_each_part_with_its_probability() {
        let parts = [
            (0.3, Profile::Constant(0.5)),
            (0.7, Profile::Exponential(0.5)),
        ];
        let fit = DelayFit::composed(&parts);
        assert!(fit.p_value > 1e-3, "{}", fit.p_value);
        assert!((fit.mean - (0.3 * 0.5 + 0.7 * 2.0)).abs() < 1e-9);
        assert!(
            (fit.drawn_mean - fit.mean).abs() < 0.02,
            "{}",
            fit.drawn_mean
        );
        let other = DelayFit::composed(&[(0.32, parts[0].1.clone()), (0.68, parts[1].1.clone())]);
        let n = f64::from(DELAYS) * (fit.range[1] - fit.range[0]) / DELAY_BINS as f64;
        let counts = |densities: &[f64]| -> Vec<f64> { densities.iter().map(|d| d * n).collect() };
        assert_eq!(fit.range, other.range);
        assert!(chi_square_p(&counts(&other.drawn), &counts(&fit.stated), 0) < 1e-6);
    }

    #[test]
    fn cells_of_the_map_cover_the_sphere() {
        let total: f64 = (0..ROWS).map(|row| solid_angle(row) * COLUMNS as f64).sum();
        assert!((total - 4.0 * PI).abs() < 1e-9);
        assert_eq!(map_cell(Vec3::Z)[0], 0);
        assert_eq!(map_cell(-Vec3::Z)[0], ROWS - 1);
        assert_eq!(map_cell(Vec3::X), [ROWS / 2, COLUMNS / 2]);
    }
}
