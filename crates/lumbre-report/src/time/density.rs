//! Densities of delays as small plots beside frames.

use crate::format::significant;
use crate::plot::grid::Plot;
use lumbre_light::transport::delay::Profile;

/// Weights and profiles of a distribution of delays.
pub type Mixture = [(f32, Profile)];

/// Number of points of a curve.
const POINTS: usize = 240;
/// Probability of the delays that the horizontal axis covers.
const COVERED: f32 = 0.99;
/// Height of the greatest density, and of an arrow for all light.
const TOP: f64 = 0.92;
/// Width and height of the head of an arrow.
const HEAD: (f64, f64) = (0.025, 0.08);

/// Common scales of densities of delays.
pub struct DensityScale {
    /// Right end of the horizontal axis in scene units; the left one is 0.
    longest: f64,
    /// Greatest density, in 1 / scene unit; 0 if all delays are constants.
    pub greatest: f64,
}

impl DensityScale {
    /// Returns the scales that cover some distributions.
    pub fn new<'a>(mixtures: impl Iterator<Item = &'a Mixture> + Clone) -> DensityScale {
        let profiles = mixtures.clone().flatten();
        let delays = profiles.map(|(_, profile)| f64::from(profile.sample(COVERED)));
        let longest = 1.1 * delays.fold(0.0, f64::max);
        let mut scale = DensityScale {
            longest: if longest > 0.0 { longest } else { 1.0 },
            greatest: 0.0,
        };
        let curves = mixtures.flat_map(|mixture| scale.curve(mixture));
        scale.greatest = curves.map(|(_, density)| density).fold(0.0, f64::max);
        scale
    }

    /// Plots a distribution: a curve of its density, and an arrow for each constant delay, as high
    /// as its weight.
    pub fn plot(&self, mixture: &Mixture) -> Plot {
        let mut lines = Vec::new();
        for (weight, profile) in mixture {
            if let Profile::Constant(delay) = profile {
                let (x, top) = (f64::from(*delay) / self.longest, TOP * f64::from(*weight));
                lines.push(vec![(x, 0.0), (x, top)]);
                let below = top - HEAD.1;
                lines.push(vec![(x - HEAD.0, below), (x, top), (x + HEAD.0, below)]);
            }
        }
        let place = |(x, density)| (x / self.longest, TOP * density / self.greatest);
        let curve: Vec<(f64, f64)> = self.curve(mixture).map(place).collect();
        if curve.iter().any(|(_, height)| *height > 0.0) {
            lines.push(curve);
        }
        Plot {
            lines,
            ends: ["0".to_owned(), significant(self.longest, 2)],
        }
    }

    /// Returns delays with the density of all profiles that have one.
    fn curve(&self, mixture: &Mixture) -> impl Iterator<Item = (f64, f64)> {
        let step = self.longest / (POINTS - 1) as f64;
        let delays = (0..POINTS).map(move |i| i as f64 * step);
        delays.map(|x| {
            let parts = mixture.iter();
            let density = parts.map(|(weight, p)| f64::from(*weight) * p.density(x));
            (x, density.sum())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn densities_share_their_scales_and_constants_are_arrows() {
        let slow = vec![(1.0, Profile::Exponential(0.5))];
        let mixed = vec![(0.25, Profile::NONE), (0.75, Profile::Exponential(2.0))];
        let scale = DensityScale::new([&slow[..], &mixed].into_iter());
        assert!((scale.greatest - 1.5).abs() < 1e-9, "0.75 of a rate of 2");
        let plots = [&slow, &mixed].map(|mixture| scale.plot(mixture));
        assert_eq!(plots[0].ends, plots[1].ends);
        let heights = |plot: &Plot| -> Vec<f64> { plot.lines.iter().map(|l| l[0].1).collect() };
        assert!((heights(&plots[0])[0] - TOP / 3.0).abs() < 1e-9);
        assert_eq!(plots[1].lines[0][1], (0.0, 0.25 * TOP));
        let only = vec![(1.0, Profile::NONE)];
        let scale = DensityScale::new([&only[..]].into_iter());
        assert_eq!((scale.longest, scale.plot(&only).lines.len()), (1.0, 2));
    }
}
