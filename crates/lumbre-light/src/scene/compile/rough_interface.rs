//! Light that passes the rough interface of a plastic, or is reflected at its inside, as Mitsuba
//! counts it: by single scattering at microfacets, so that light which meets a second one is lost.
//!
//! Both are means over the normals that are visible from a direction [Walter et al. 2007], computed
//! once for each material. Mitsuba tabulates the transmittance by 64 cosines; here it is piecewise
//! linear between [`KNOTS`] of them, which is within 0.01 from `alpha` of 0.02 on, and within 0.003
//! from 0.1 on.

use std::f64::consts::PI;

use crate::math::real::Real;
use crate::scene::desc::Distribution;

/// Count of the cosines between which the transmittance is linear.
pub const KNOTS: usize = 12;

/// Cosines between which the transmittance is linear: denser at grazing angles, where it changes
/// most.
const KNOT_COSINES: [f32; KNOTS] = {
    let mut cosines = [0.0; KNOTS];
    let mut k = 0;
    while k < KNOTS {
        cosines[k] = (k * k) as f32 / ((KNOTS - 1) * (KNOTS - 1)) as f32;
        k += 1;
    }
    cosines
};

/// Cosines over which Mitsuba takes the mean of the internal reflectance, both ends included.
const INSIDE_COSINES: u32 = 64;

/// Normals by slope and by azimuth, of which the means are taken.
const SLOPES: u32 = 64;
const AZIMUTHS: u32 = 32;

/// Transmittance of a rough interface from outside, by the cosine of the direction.
///
/// The first number is that of cosine 0; the others are its slopes between [`KNOT_COSINES`].
pub type Transmittance = [f32; KNOTS];

/// Returns a transmittance at a cosine, scalar or vectorised.
#[inline(always)]
pub fn transmittance_at<R: Real>(transmittance: &[R; KNOTS], cos: R) -> R {
    let mut sum = transmittance[0];
    for k in 1..KNOTS {
        let [from, to] = [KNOT_COSINES[k - 1], KNOT_COSINES[k]];
        sum = sum + transmittance[k] * (cos - R::splat(from)).clamp(0.0, to - from);
    }
    sum
}

/// A rough dielectric interface.
#[derive(Clone, Debug)]
pub(super) struct RoughInterface {
    distribution: Distribution,
    alpha: f64,
    ior: f64,
    normals: Vec<Normal>,
}

/// Normal of a microfacet.
#[derive(Clone, Copy, Debug)]
struct Normal {
    /// Density among the normals that are taken, times the cosine.
    density: f64,
    /// Components towards the light and along the surface's normal.
    x: f64,
    z: f64,
}

impl RoughInterface {
    /// Returns an interface of a distribution of normals with a positive roughness. The index is
    /// that of the inside relative to the outside.
    pub fn new(distribution: Distribution, alpha: f64, ior: f64) -> RoughInterface {
        let normal = |i: u32| {
            // Square root of the share of normals that are steeper, in which the tail of GGX is
            // regular.
            let steeper = (f64::from(i / AZIMUTHS) + 0.5) / f64::from(SLOPES);
            let steeper2 = steeper * steeper;
            let azimuth = PI * (f64::from(i % AZIMUTHS) + 0.5) / f64::from(AZIMUTHS);
            let slope2 = match distribution {
                Distribution::Ggx => (1.0 - steeper2) / steeper2,
                Distribution::Beckmann => -steeper2.ln(),
            } * alpha.powi(2);
            let z = 1.0 / (1.0 + slope2).sqrt();
            Normal {
                density: steeper,
                x: slope2.sqrt() * z * azimuth.cos(),
                z,
            }
        };
        RoughInterface {
            distribution,
            alpha,
            ior,
            normals: (0..SLOPES * AZIMUTHS).map(normal).collect(),
        }
    }

    /// Returns the transmittance.
    pub fn transmittance(&self) -> Transmittance {
        let cosines = KNOT_COSINES.map(f64::from);
        let at_knots = cosines.map(|cos| self.shares(cos, self.ior)[1]);
        // Chords are on one side of a curve: knots are moved so that the integral is that of the
        // curve, if it is a parabola between them.
        let sagitta = |k: usize| {
            let middle = self.shares(0.5 * (cosines[k] + cosines[k + 1]), self.ior)[1];
            middle - 0.5 * (at_knots[k] + at_knots[k + 1])
        };
        let last = KNOTS - 1;
        let sagittas: Vec<f64> = (0..last).map(sagitta).collect();
        let moved: [f64; KNOTS] = std::array::from_fn(|k| {
            let (left, right) = (sagittas[k.saturating_sub(1)], sagittas[k.min(last - 1)]);
            (at_knots[k] + (left + right) / 3.0).clamp(0.0, 1.0)
        });
        std::array::from_fn(|k| match k {
            0 => moved[0] as f32,
            k => ((moved[k] - moved[k - 1]) / (cosines[k] - cosines[k - 1])) as f32,
        })
    }

    /// Returns the fraction of diffuse light from inside that the interface reflects back, as the
    /// mean that Mitsuba takes.
    pub fn internal_reflectance(&self) -> f32 {
        let reflected = |i: u32| {
            let cos = f64::from(i) / f64::from(INSIDE_COSINES - 1);
            2.0 * cos * self.shares(cos, 1.0 / self.ior)[0]
        };
        ((0..INSIDE_COSINES).map(reflected).sum::<f64>() / f64::from(INSIDE_COSINES)) as f32
    }

    /// Returns the shares of the light in a direction of this cosine that are reflected and
    /// transmitted by one microfacet each, for an index of the far side.
    fn shares(&self, cos: f64, index: f64) -> [f64; 2] {
        let sin = (1.0 - cos * cos).sqrt();
        let (mut all, mut reflected, mut transmitted) = (0.0, 0.0, 0.0);
        for &Normal { density, x, z } in &self.normals {
            let dot = sin * x + cos * z;
            if dot <= 0.0 {
                continue;
            }
            // Weight of the normal among those that are visible.
            let weight = density * dot / z;
            all += weight;
            let (reflectance, refracted) = fresnel(dot, index);
            let up = 2.0 * dot * z - cos;
            if up > 0.0 {
                reflected += weight * reflectance * self.masking(up);
            }
            let down = (refracted - dot / index) * z + cos / index;
            if down > 0.0 && reflectance < 1.0 {
                transmitted += weight * (1.0 - reflectance) * self.masking(down);
            }
        }
        [reflected / all, transmitted / all]
    }

    /// Returns Smith's masking at a cosine: for Beckmann's distribution by the fit of
    /// [Walter et al. 2007, 6.1].
    fn masking(&self, cos: f64) -> f64 {
        let slope = self.alpha * (1.0 / (cos * cos) - 1.0).max(0.0).sqrt();
        match self.distribution {
            Distribution::Ggx => 2.0 / (1.0 + (1.0 + slope * slope).sqrt()),
            Distribution::Beckmann if slope * 1.6 <= 1.0 => 1.0,
            Distribution::Beckmann => {
                let a = 1.0 / slope;
                (3.535 + 2.181 * a) * a / (1.0 + (2.276 + 2.577 * a) * a)
            }
        }
    }
}

/// Returns the reflectance at a cosine and the cosine of the refracted direction, 0 if there is
/// none.
fn fresnel(cos: f64, index: f64) -> (f64, f64) {
    let sin2 = (1.0 - cos * cos) / (index * index);
    if sin2 >= 1.0 {
        return (1.0, 0.0);
    }
    let inner = (1.0 - sin2).sqrt();
    let s = (cos - index * inner) / (cos + index * inner);
    let p = (index * cos - inner) / (index * cos + inner);
    (0.5 * (s * s + p * p), inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_almost_smooth_interface_has_fresnels_transmittance() {
        let smooth = RoughInterface::new(Distribution::Ggx, 1e-3, 1.5);
        let found = smooth.transmittance();
        for cos in [0.2, 0.3, 0.5, 0.8, 1.0] {
            let expected = 1.0 - fresnel(f64::from(cos), 1.5).0 as f32;
            assert!(
                (transmittance_at(&found, cos) - expected).abs() < 4e-3,
                "{cos}"
            );
        }
        // The fraction of diffuse light, 0.5963, by Mitsuba's mean over 64 cosines.
        assert!((smooth.internal_reflectance() - 0.587).abs() < 3e-3);
    }

    #[test]
    fn light_is_lost_to_further_facets_alone() {
        for distribution in [Distribution::Ggx, Distribution::Beckmann] {
            for (alpha, cos, most) in [(0.1, 0.9, 0.003), (0.1, 0.1, 0.1), (0.6, 0.5, 0.2)] {
                let rough = RoughInterface::new(distribution, alpha, 1.5);
                let shares = rough.shares(cos, 1.5);
                let lost = 1.0 - shares.iter().sum::<f64>();
                assert!(
                    (-1e-9..most).contains(&lost),
                    "{distribution:?} {alpha} at {cos}: {lost}"
                );
                let found = transmittance_at(&rough.transmittance(), cos as f32);
                assert!((f64::from(found) - shares[1]).abs() < 4e-3);
            }
        }
    }
}
