//! Profiles in time, and those of a point of a surface.

use crate::math::piecewise::Piecewise;
use crate::scene::compile::{DelayKind, DelayProfile, Texture, Uv};
use crate::transport::sampler::Independent;
use crate::transport::surface::lookup_scalar;

/// A distribution of delays, each an optical length of at least 0 in scene units.
#[derive(Clone, Debug, PartialEq)]
pub enum Profile {
    /// Always the same delay, at least 0.
    Constant(f32),
    /// `rate exp(-rate x)`: many give light back at once, few late. Positive rate, in 1 / scene unit.
    Exponential(f32),
    /// `3 / (4 width) (1 - ((x - mean) / width)^2)` for `|x - mean| <= width`; the width is positive and at most the mean.
    Epanechnikov {
        /// The middle.
        mean: f32,
        /// Half of the extent; the standard deviation is `width / sqrt(5)`.
        width: f32,
    },
    /// Straight lines between given densities.
    Table(Piecewise),
}

impl Profile {
    /// No delay at all.
    pub const NONE: Profile = Profile::Constant(0.0);

    /// Its kind, and the one or two parameters and the table that the kind has; what it does not have is zero and `None`.
    pub fn to_parts(&self) -> (DelayKind, [f32; 2], Option<&Piecewise>) {
        match self {
            Profile::Constant(delay) => (DelayKind::Constant, [*delay, 0.0], None),
            Profile::Exponential(rate) => (DelayKind::Exponential, [*rate, 0.0], None),
            Profile::Epanechnikov { mean, width } => (DelayKind::Epanechnikov, [*mean, *width], None),
            Profile::Table(table) => (DelayKind::Table, [0.0; 2], Some(table)),
        }
    }

    /// From those; a table that is not there delays nothing.
    #[inline]
    pub fn of_parts(kind: DelayKind, [first, second]: [f32; 2], table: impl FnOnce() -> Option<Piecewise>) -> Profile {
        match kind {
            DelayKind::None => Profile::NONE,
            DelayKind::Constant => Profile::Constant(first),
            DelayKind::Exponential => Profile::Exponential(first),
            DelayKind::Epanechnikov => Profile::Epanechnikov { mean: first, width: second },
            DelayKind::Table => table().map_or(Profile::NONE, Profile::Table),
        }
    }

    /// The delay at which the distribution function reaches `u`, from `[0, 1)`. The numbers of samplers have 24 binary
    /// digits, so that the longest exponential delay is `16.6 / rate`; what lies beyond has a probability of 6e-8.
    #[inline]
    pub fn sample(&self, u: f32) -> f32 {
        let (kind, params, table) = self.to_parts();
        drawn(kind, params, table, u)
    }

    /// The density of a delay, in 1 / scene unit; zero for the Dirac of a constant one.
    pub fn density(&self, x: f64) -> f64 {
        match self {
            Profile::Constant(_) => 0.0,
            Profile::Exponential(rate) if x >= 0.0 => f64::from(*rate) * (-f64::from(*rate) * x).exp(),
            Profile::Exponential(_) => 0.0,
            Profile::Epanechnikov { mean, width } => {
                let t = (x - f64::from(*mean)) / f64::from(*width);
                if t.abs() <= 1.0 { 0.75 / f64::from(*width) * (1.0 - t * t) } else { 0.0 }
            }
            Profile::Table(table) => table.density(x),
        }
    }

    /// The probability of a delay of at most `x`.
    pub fn cdf(&self, x: f64) -> f64 {
        match self {
            Profile::Constant(delay) => f64::from(u8::from(x >= f64::from(*delay))),
            Profile::Exponential(rate) => -(-f64::from(*rate) * x.max(0.0)).exp_m1(),
            Profile::Epanechnikov { mean, width } => {
                let t = ((x - f64::from(*mean)) / f64::from(*width)).clamp(-1.0, 1.0);
                0.5 + 0.75 * t - 0.25 * t * t * t
            }
            Profile::Table(table) => table.cdf(x),
        }
    }

    /// The mean delay in scene units.
    pub fn mean(&self) -> f64 {
        match self {
            Profile::Constant(delay) => f64::from(*delay),
            Profile::Exponential(rate) => 1.0 / f64::from(*rate),
            Profile::Epanechnikov { mean, .. } => f64::from(*mean),
            Profile::Table(table) => table.mean(),
        }
    }
}

/// The delay at which the distribution function of the profile of these parts reaches `u`.
#[inline]
fn drawn(kind: DelayKind, [first, second]: [f32; 2], table: Option<&Piecewise>, u: f32) -> f32 {
    match kind {
        DelayKind::None => 0.0,
        DelayKind::Constant => first,
        // 1 - u is exact for the numbers of samplers, and its logarithm costs a quarter of that of 1 + x.
        DelayKind::Exponential => -(1.0 - u).ln() / first,
        DelayKind::Epanechnikov => {
            let x = f64::from(2.0 * u - 1.0).clamp(-1.0, 1.0);
            (f64::from(first) + 2.0 * f64::from(second) * (x.asin() / 3.0).sin()) as f32
        }
        DelayKind::Table => table.map_or(0.0, |table| table.sample(u)),
    }
    .max(0.0)
}

/// The parameters of a material's profile where its textures are at these coordinates.
#[inline]
fn params_at(profile: &DelayProfile, textures: &[Texture], uv: Uv) -> [f32; 2] {
    profile.params.map(|p| p.offset + p.value * lookup_scalar(textures, p.texture, uv, profile.tiling, 1.0))
}

/// The profile of a material where its textures are at these coordinates.
pub fn at(profile: &DelayProfile, textures: &[Texture], uv: Uv) -> Profile {
    Profile::of_parts(profile.kind, params_at(profile, textures, uv), || profile.table.clone())
}

/// The sum of one delay of each profile, at these texture coordinates.
#[inline]
pub fn sample_all<'a>(
    profiles: impl Iterator<Item = &'a DelayProfile>,
    textures: &[Texture],
    uv: Uv,
    chance: &mut Independent,
) -> f32 {
    profiles.map(|p| drawn(p.kind, params_at(p, textures, uv), p.table.as_ref(), chance.next_1d())).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::stats::{chi_square_p, sidak};
    use crate::transport::sampler::Sampler;

    /// The profiles of figure 3.1, and those of the figures of chapter 6, with a table of our own.
    fn all() -> Vec<Profile> {
        let knots = [[0.5, 0.0], [1.0, 2.0], [1.5, 2.0], [1.5, 0.25], [4.0, 0.75]];
        vec![
            Profile::Exponential(2.0),
            Profile::Exponential(0.5),
            Profile::Epanechnikov { mean: 0.5, width: 0.1 },
            Profile::Epanechnikov { mean: 0.5, width: 0.5 },
            Profile::Epanechnikov { mean: 0.1, width: 0.1 },
            Profile::Table(Piecewise::new(&knots)),
        ]
    }

    const SAMPLES: usize = 1 << 18;

    fn samples(profile: &Profile, seed: u64) -> Vec<f64> {
        let mut chance = Sampler::new(seed, [3, 1], 4).aside();
        let mut drawn: Vec<f64> = (0..SAMPLES).map(|_| f64::from(profile.sample(chance.next_1d()))).collect();
        drawn.sort_by(f64::total_cmp);
        drawn
    }

    /// Kolmogorov's distance, times the root of the number, and the probability of a greater one: the first terms of
    /// its series are exact to all digits that matter here.
    fn kolmogorov(sorted: &[f64], cdf: impl Fn(f64) -> f64) -> f64 {
        let n = sorted.len() as f64;
        let distance = sorted.iter().enumerate().fold(0.0f64, |worst, (i, x)| {
            let p = cdf(*x);
            worst.max(p - i as f64 / n).max((i + 1) as f64 / n - p)
        });
        let x = distance * n.sqrt();
        let term = |k: i32| (-2.0 * f64::from(k * k) * x * x).exp();
        (2.0 * (term(1) - term(2) + term(3))).clamp(0.0, 1.0)
    }

    #[test]
    fn delays_have_the_distribution_that_they_should() {
        let alpha = sidak(1e-3, 2 * all().len());
        for (i, profile) in all().iter().enumerate() {
            let drawn = samples(profile, 7 + i as u64);
            let p = kolmogorov(&drawn, |x| profile.cdf(x));
            assert!(p > alpha, "{profile:?}: Kolmogorov and Smirnov {p}");
            // Cells between quantiles of even and uneven probability.
            let edges: Vec<f64> = (0..=64).map(|k| (f64::from(k) / 64.0).powf(1.5)).collect();
            let bounds: Vec<f64> = edges[1..64].iter().map(|e| f64::from(profile.sample(*e as f32))).collect();
            let cell = |x: f64| bounds.partition_point(|b| *b < x);
            let mut observed = vec![0.0; 64];
            drawn.iter().for_each(|x| observed[cell(*x)] += 1.0);
            let below = |k: usize| match k {
                0 => 0.0,
                64 => 1.0,
                k => profile.cdf(bounds[k - 1]),
            };
            let expected: Vec<f64> = (0..64).map(|k| (below(k + 1) - below(k)) * SAMPLES as f64).collect();
            let p = chi_square_p(&observed, &expected, 0);
            assert!(p > alpha, "{profile:?}: chi-square {p}");
        }
    }

    #[test]
    fn a_wrong_distribution_is_told() {
        let drawn = samples(&Profile::Exponential(2.0), 1);
        assert!(kolmogorov(&drawn, |x| Profile::Exponential(2.02).cdf(x)) < 1e-3);
        let drawn = samples(&Profile::Epanechnikov { mean: 0.5, width: 0.5 }, 2);
        // The source's normalisation gives a distribution function that ends at sigma.
        assert!(kolmogorov(&drawn, |x| 0.5 * Profile::Epanechnikov { mean: 0.5, width: 0.5 }.cdf(x)) < 1e-9);
    }

    #[test]
    fn densities_are_the_slopes_of_distribution_functions_that_end_at_one() {
        for profile in all() {
            let (mut mass, mut moment) = (0.0, 0.0);
            let (steps, end) = (400_000, 40.0);
            let h = end / f64::from(steps);
            for i in 0..steps {
                let x = (f64::from(i) + 0.5) * h;
                mass += profile.density(x) * h;
                moment += x * profile.density(x) * h;
                if i % 997 == 0 {
                    let by_cdf = (profile.cdf(x + h / 2.0) - profile.cdf(x - h / 2.0)) / h;
                    assert!((by_cdf - profile.density(x)).abs() < 2e-3 * (1.0 + by_cdf), "{profile:?} at {x}");
                }
            }
            assert!((mass - 1.0).abs() < 1e-4, "{profile:?}: {mass}");
            assert!((moment - profile.mean()).abs() < 1e-3, "{profile:?}: {moment} and {}", profile.mean());
            assert!((profile.cdf(end) - 1.0).abs() < 1e-8 && profile.cdf(-1.0) == 0.0);
        }
    }

    #[test]
    fn a_constant_is_always_the_same_and_the_ends_of_chance_are_finite() {
        for u in [0.0, 0.5, 1.0 - f32::EPSILON / 2.0] {
            assert_eq!(Profile::Constant(2.0).sample(u), 2.0);
            for profile in all() {
                let x = profile.sample(u);
                assert!(x.is_finite() && x >= 0.0, "{profile:?} at {u}: {x}");
            }
        }
        assert_eq!((Profile::Constant(2.0).cdf(1.99), Profile::Constant(2.0).cdf(2.0)), (0.0, 1.0));
    }
}
