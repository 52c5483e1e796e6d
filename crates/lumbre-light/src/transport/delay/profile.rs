//! Delay profiles, and the profiles of a surface point.

use serde::{Deserialize, Serialize};

use crate::math::piecewise::Piecewise;
use crate::scene::compile::{DelayKind, DelayProfile, Texture, Uv};
use crate::scene::desc::DelayDesc;
use crate::transport::sampler::Sampler;
use crate::transport::surface::lookup_scalar;

/// A distribution of delays, each an optical length of at least 0 in scene units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Profile {
    /// Always the same delay, at least 0.
    Constant(f32),
    /// `rate exp(-rate x)`: most light is returned at once, little late. The rate is positive, in 1
    /// / scene unit.
    Exponential(f32),
    /// `3 / (4 width) (1 - ((x - mean) / width)^2)` for `|x - mean| <= width`; the width is
    /// positive and at most the mean.
    Epanechnikov {
        /// Middle of the profile.
        mean: f32,
        /// Half of the extent; the standard deviation is `width / sqrt(5)`.
        width: f32,
    },
    /// Piecewise linear density between given points.
    Table(Piecewise),
}

impl Profile {
    /// The profile without any delay.
    pub const NONE: Profile = Profile::Constant(0.0);

    /// Returns the profile that a description without textures specifies.
    pub fn of(desc: &DelayDesc) -> Profile {
        let mut params = [0.0; 2];
        for (param, (_, get, _)) in params.iter_mut().zip(desc.params()) {
            *param = get(desc).iter().sum();
        }
        Profile::from_parts(desc.kind, params, || Some(Piecewise::new(&desc.pairs())))
    }

    /// Returns the kind, its parameters (zero if unused), and its table, if it has one.
    pub fn to_parts(&self) -> (DelayKind, [f32; 2], Option<&Piecewise>) {
        match self {
            Profile::Constant(delay) => (DelayKind::Constant, [*delay, 0.0], None),
            Profile::Exponential(rate) => (DelayKind::Exponential, [*rate, 0.0], None),
            Profile::Epanechnikov { mean, width } => {
                (DelayKind::Epanechnikov, [*mean, *width], None)
            }
            Profile::Table(table) => (DelayKind::Table, [0.0; 2], Some(table)),
        }
    }

    /// Rebuilds a profile from [`Profile::to_parts`]; a missing table means no delay.
    #[inline]
    pub fn from_parts(
        kind: DelayKind,
        [first, second]: [f32; 2],
        table: impl FnOnce() -> Option<Piecewise>,
    ) -> Profile {
        match kind {
            DelayKind::None => Profile::NONE,
            DelayKind::Constant => Profile::Constant(first),
            DelayKind::Exponential => Profile::Exponential(first),
            DelayKind::Epanechnikov => Profile::Epanechnikov {
                mean: first,
                width: second,
            },
            DelayKind::Table => table().map_or(Profile::NONE, Profile::Table),
        }
    }

    /// Returns the delay at which the distribution function reaches `u` in `[0, 1)`. Sample numbers
    /// have 24 binary digits, so the longest exponential delay is `16.6 / rate`; longer ones have a
    /// probability of 6e-8.
    #[inline]
    pub fn sample(&self, u: f32) -> f32 {
        let (kind, params, table) = self.to_parts();
        sample_parts(kind, params, table, u)
    }

    /// Returns the density of a delay, in 1 / scene unit; zero for the Dirac of a constant one.
    pub fn density(&self, x: f64) -> f64 {
        match self {
            Profile::Constant(_) => 0.0,
            Profile::Exponential(rate) if x >= 0.0 => {
                f64::from(*rate) * (-f64::from(*rate) * x).exp()
            }
            Profile::Exponential(_) => 0.0,
            Profile::Epanechnikov { mean, width } => {
                let t = (x - f64::from(*mean)) / f64::from(*width);
                if t.abs() <= 1.0 {
                    0.75 / f64::from(*width) * (1.0 - t * t)
                } else {
                    0.0
                }
            }
            Profile::Table(table) => table.density(x),
        }
    }

    /// Returns the probability of a delay of at most `x`.
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

    /// Returns the mean delay in scene units.
    pub fn mean(&self) -> f64 {
        match self {
            Profile::Constant(delay) => f64::from(*delay),
            Profile::Exponential(rate) => 1.0 / f64::from(*rate),
            Profile::Epanechnikov { mean, .. } => f64::from(*mean),
            Profile::Table(table) => table.mean(),
        }
    }
}

/// Returns the delay at which the distribution function of a profile given by its parts reaches
/// `u`.
#[inline]
fn sample_parts(
    kind: DelayKind,
    [first, second]: [f32; 2],
    table: Option<&Piecewise>,
    u: f32,
) -> f32 {
    match kind {
        DelayKind::None => 0.0,
        DelayKind::Constant => first,
        // For sample numbers 1 - u is exact, and its logarithm costs a quarter of that of 1 + x.
        DelayKind::Exponential => -(1.0 - u).ln() / first,
        DelayKind::Epanechnikov => {
            let x = f64::from(2.0 * u - 1.0).clamp(-1.0, 1.0);
            (f64::from(first) + 2.0 * f64::from(second) * (x.asin() / 3.0).sin()) as f32
        }
        DelayKind::Table => table.map_or(0.0, |table| table.sample(u)),
    }
    .max(0.0)
}

/// Returns the parameters of a material's profile at texture coordinates.
#[inline]
fn params_at(profile: &DelayProfile, textures: &[Texture], uv: Uv) -> [f32; 2] {
    profile
        .params
        .map(|p| p.offset + p.value * lookup_scalar(textures, p.texture, uv, profile.tiling, 1.0))
}

/// Returns the profile of a material at texture coordinates.
pub fn profile_at(profile: &DelayProfile, textures: &[Texture], uv: Uv) -> Profile {
    Profile::from_parts(profile.kind, params_at(profile, textures, uv), || {
        profile.table.clone()
    })
}

/// Samples one delay of each profile at texture coordinates and returns the sum.
#[inline]
pub fn sample_all<'a>(
    profiles: impl Iterator<Item = &'a DelayProfile>,
    textures: &[Texture],
    uv: Uv,
    aux_rng: &mut Sampler,
) -> f32 {
    profiles
        .map(|p| {
            sample_parts(
                p.kind,
                params_at(p, textures, uv),
                p.table.as_ref(),
                aux_rng.next_1d(),
            )
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::stats::{chi_square_p, sidak};
    use crate::transport::sampler::Sampler;

    /// The profiles of figure 3.1 and those of the figures of chapter 6, and a table.
    fn all() -> Vec<Profile> {
        let knots = [[0.5, 0.0], [1.0, 2.0], [1.5, 2.0], [1.5, 0.25], [4.0, 0.75]];
        vec![
            Profile::Exponential(2.0),
            Profile::Exponential(0.5),
            Profile::Epanechnikov {
                mean: 0.5,
                width: 0.1,
            },
            Profile::Epanechnikov {
                mean: 0.5,
                width: 0.5,
            },
            Profile::Epanechnikov {
                mean: 0.1,
                width: 0.1,
            },
            Profile::Table(Piecewise::new(&knots)),
        ]
    }

    const SAMPLES: usize = 1 << 18;

    fn samples(profile: &Profile, seed: u64) -> Vec<f64> {
        let mut aux_rng = Sampler::new(seed, [3, 1], 4).auxiliary();
        let mut drawn: Vec<f64> = (0..SAMPLES)
            .map(|_| f64::from(profile.sample(aux_rng.next_1d())))
            .collect();
        drawn.sort_by(f64::total_cmp);
        drawn
    }

    /// Returns Kolmogorov's distance times the root of the sample size, and the probability of a
    /// greater one; the first terms of its series are exact to all digits that matter here.
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
            // The cells lie between quantiles of even and uneven probability.
            let edges: Vec<f64> = (0..=64).map(|k| (f64::from(k) / 64.0).powf(1.5)).collect();
            let bounds: Vec<f64> = edges[1..64]
                .iter()
                .map(|e| f64::from(profile.sample(*e as f32)))
                .collect();
            let cell = |x: f64| bounds.partition_point(|b| *b < x);
            let mut observed = vec![0.0; 64];
            drawn.iter().for_each(|x| observed[cell(*x)] += 1.0);
            let below = |k: usize| match k {
                0 => 0.0,
                64 => 1.0,
                k => profile.cdf(bounds[k - 1]),
            };
            let expected: Vec<f64> = (0..64)
                .map(|k| (below(k + 1) - below(k)) * SAMPLES as f64)
                .collect();
            let p = chi_square_p(&observed, &expected, 0);
            assert!(p > alpha, "{profile:?}: chi-square {p}");
        }
    }

    #[test]
    fn a_wrong_distribution_is_told() {
        let drawn = samples(&Profile::Exponential(2.0), 1);
        assert!(kolmogorov(&drawn, |x| Profile::Exponential(2.02).cdf(x)) < 1e-3);
        let drawn = samples(
            &Profile::Epanechnikov {
                mean: 0.5,
                width: 0.5,
            },
            2,
        );
        // The source's normalisation gives a distribution function that ends at sigma.
        assert!(
            kolmogorov(&drawn, |x| 0.5
                * Profile::Epanechnikov {
                    mean: 0.5,
                    width: 0.5
                }
                .cdf(x))
                < 1e-9
        );
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
                    assert!(
                        (by_cdf - profile.density(x)).abs() < 2e-3 * (1.0 + by_cdf),
                        "{profile:?} at {x}"
                    );
                }
            }
            assert!((mass - 1.0).abs() < 1e-4, "{profile:?}: {mass}");
            assert!(
                (moment - profile.mean()).abs() < 1e-3,
                "{profile:?}: {moment} and {}",
                profile.mean()
            );
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
        assert_eq!(
            (
                Profile::Constant(2.0).cdf(1.99),
                Profile::Constant(2.0).cdf(2.0)
            ),
            (0.0, 1.0)
        );
    }
}
