//! The filters of FLIP for a number of pixels per degree: contrast sensitivity, edges and points.
//!
//! All are separable, or sums of two separable filters, and are cut where the paper's program cuts
//! them.

use std::f64::consts::PI;

/// Filter kernel with an odd number of weights.
pub struct Kernel {
    weights: Vec<f32>,
}

impl Kernel {
    /// Weights from left to right.
    pub fn weights(&self) -> &[f32] {
        &self.weights
    }

    /// Radius of the kernel in pixels.
    pub fn radius(&self) -> usize {
        self.weights.len() / 2
    }

    /// Makes a kernel from weights, dropping those at both ends that are too small to change a sum
    /// of `f32`.
    fn new(weights: &[f64]) -> Kernel {
        let largest = weights.iter().fold(0.0, |a: f64, w| a.max(w.abs()));
        let counts = |w: &f64| w.abs() > 1e-9 * largest;
        let centre = weights.len() / 2;
        let radius = (0..=centre)
            .rev()
            .find(|r| counts(&weights[centre - r]) || counts(&weights[centre + r]));
        let radius = radius.unwrap_or(0);
        Kernel {
            weights: weights[centre - radius..=centre + radius]
                .iter()
                .map(|w| *w as f32)
                .collect(),
        }
    }
}

/// All filters for one number of pixels per degree.
pub struct Filters {
    /// Contrast sensitivity of the achromatic channel.
    pub y: Kernel,
    /// Contrast sensitivity of the red-green channel.
    pub cx: Kernel,
    /// Contrast sensitivity of the blue-yellow channel: the sum of two filters, each applied along
    /// both axes.
    pub cz: [Kernel; 2],
    /// Gaussian that smooths across the direction of a derivative.
    pub smooth: Kernel,
    /// First derivative of the Gaussian, which detects edges.
    pub edge: Kernel,
    /// Second derivative of the Gaussian, which detects points.
    pub point: Kernel,
}

/// Amplitude and width in squared degrees of the Gaussians that make up the contrast sensitivity
/// functions [Andersson et al. 2020, table 1].
const Y: [f64; 2] = [1.0, 0.0047];
const CX: [f64; 2] = [1.0, 0.0053];
const CZ: [[f64; 2]; 2] = [[34.1, 0.04], [13.5, 0.025]];

/// Width of the feature detectors in degrees [Andersson et al. 2020, 4.2].
const FEATURE_WIDTH: f64 = 0.082;

impl Filters {
    /// Computes the filters for `ppd` pixels per degree.
    pub fn new(ppd: f64) -> Filters {
        let radius = (3.0 * (CZ[0][1] / (2.0 * PI * PI)).sqrt() * ppd).ceil() as i32;
        let along = |f: &dyn Fn(f64) -> f64| -> Vec<f64> {
            (-radius..=radius).map(|i| f(f64::from(i) / ppd)).collect()
        };
        let gauss = |b: f64| along(&|x| (-PI * PI * x * x / b).exp());
        let unit_sum = |weights: Vec<f64>| {
            let sum: f64 = weights.iter().sum();
            Kernel::new(&weights.iter().map(|w| w / sum).collect::<Vec<_>>())
        };
        // The amplitude belongs to the plane, so each axis gets its root; both planes together sum
        // to one.
        let parts = CZ.map(|[a, b]| {
            gauss(b)
                .iter()
                .map(|g| (a * (PI / b).sqrt()).sqrt() * g)
                .collect::<Vec<f64>>()
        });
        let both = parts
            .iter()
            .map(|p| p.iter().sum::<f64>().powi(2))
            .sum::<f64>()
            .sqrt();
        let sigma = 0.5 * FEATURE_WIDTH * ppd;
        let reach = (3.0 * sigma).ceil() as i32;
        let feature = |f: &dyn Fn(f64) -> f64| -> Vec<f64> {
            (-reach..=reach)
                .map(f64::from)
                .map(|x| f(x) * (-x * x / (2.0 * sigma * sigma)).exp())
                .collect()
        };
        Filters {
            y: unit_sum(gauss(Y[1]).iter().map(|g| Y[0] * g).collect()),
            cx: unit_sum(gauss(CX[1]).iter().map(|g| CX[0] * g).collect()),
            cz: parts.map(|p| Kernel::new(&p.iter().map(|w| w / both).collect::<Vec<_>>())),
            smooth: unit_sum(feature(&|_| 1.0)),
            edge: balanced(&feature(&|x| -x)),
            point: balanced(&feature(&|x| x * x / (sigma * sigma) - 1.0)),
        }
    }

    /// Radius of the widest filter in pixels.
    pub fn radius(&self) -> usize {
        let [a, b] = &self.cz;
        let all = [
            &self.y,
            &self.cx,
            a,
            b,
            &self.smooth,
            &self.edge,
            &self.point,
        ];
        all.iter().map(|k| k.radius()).max().unwrap_or(0)
    }
}

/// Scales positive weights to a sum of 1 and negative ones to a sum of -1.
fn balanced(weights: &[f64]) -> Kernel {
    let side = |sign: f64| weights.iter().map(|w| (sign * w).max(0.0)).sum::<f64>();
    let [positive, negative] = [side(1.0), side(-1.0)];
    let scaled = weights.iter().map(|w| {
        w / if *w > 0.0 {
            positive
        } else {
            negative.max(f64::MIN_POSITIVE)
        }
    });
    Kernel::new(&scaled.collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sum(kernel: &Kernel) -> f64 {
        kernel.weights().iter().map(|w| f64::from(*w)).sum()
    }

    #[test]
    fn sums_are_those_of_the_paper() {
        for ppd in [3.0, 20.0, 67.0206, 150.0] {
            let f = Filters::new(ppd);
            for kernel in [&f.y, &f.cx, &f.smooth] {
                assert!((sum(kernel) - 1.0).abs() < 1e-5, "{ppd}");
            }
            let plane: f64 = f.cz.iter().map(|k| sum(k).powi(2)).sum();
            assert!((plane - 1.0).abs() < 1e-5, "{ppd} {plane}");
            for kernel in [&f.edge, &f.point] {
                let positive: f64 = kernel.weights().iter().map(|w| f64::from(w.max(0.0))).sum();
                assert!(
                    (positive - 1.0).abs() < 1e-5 && sum(kernel).abs() < 1e-5,
                    "{ppd}"
                );
            }
        }
    }

    #[test]
    fn radii_at_the_standard_viewing_distance() {
        let f = Filters::new(67.0206);
        assert_eq!((f.radius(), f.smooth.radius()), (10, 9));
        assert!(f.y.radius() < 10, "weights below rounding are left out");
    }
}
