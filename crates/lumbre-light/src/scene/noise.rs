//! Gradient noise for procedural scenes.

use crate::math::rng::pcg4d;

/// Returns gradient noise [Perlin 2002]: zero on the integer lattice, between -1 and 1, with
/// continuous second derivatives. The noise repeats for coordinates beyond 2^31.
pub fn gradient([x, y, z]: [f64; 3]) -> f64 {
    let cell = [x, y, z].map(f64::floor);
    let local = [x - cell[0], y - cell[1], z - cell[2]];
    let fade = local.map(|t| t * t * t * (t * (6.0 * t - 15.0) + 10.0));
    let mut sum = 0.0;
    for corner in 0..8u32 {
        let bit = |axis: usize| f64::from((corner >> axis) & 1);
        let lattice = [0, 1, 2].map(|axis| (cell[axis] + bit(axis)) as i64 as u32);
        let weight: f64 = [0, 1, 2]
            .map(|axis| {
                if bit(axis) > 0.0 {
                    fade[axis]
                } else {
                    1.0 - fade[axis]
                }
            })
            .iter()
            .product();
        let offset = [0, 1, 2].map(|axis| local[axis] - bit(axis));
        sum += weight * slope(lattice, offset);
    }
    sum
}

/// Returns the dot product of the offset and the lattice point's gradient, one of twelve that point
/// to the edges of a cube.
fn slope([x, y, z]: [u32; 3], offset: [f64; 3]) -> f64 {
    let [word, ..] = pcg4d([x, y, z, 0x6e6f_6973]);
    let edge = (word >> 8) % 12;
    let (a, b) = [(0, 1), (1, 2), (2, 0)][(edge % 3) as usize];
    let sign = |bit: u32| if (edge / 3) & bit == 0 { 1.0 } else { -1.0 };
    sign(1) * offset[a] + sign(2) * offset[b]
}

/// Returns a sum of octaves of [`gradient`] noise, each with half the feature size and half the
/// amplitude of the previous one.
pub fn fractal(point: [f64; 3], octaves: u32) -> f64 {
    (0..octaves)
        .map(|i| f64::from(2u32.pow(i.min(30))))
        .map(|f| gradient(point.map(|p| p * f + f)) / f)
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradient_noise_is_smooth_bounded_and_has_zero_mean() {
        let (mut sum, mut squares, n) = (0.0, 0.0, 20_000);
        for i in 0..n {
            let p = [0.137, 0.219, 0.173].map(|s| s * f64::from(i));
            let v = gradient(p);
            assert!(v.abs() <= 1.0 + 1e-12, "{v} at {p:?}");
            let near = gradient(p.map(|x| x + 1e-6));
            assert!((near - v).abs() < 1e-5, "a jump at {p:?}");
            sum += v;
            squares += v * v;
        }
        let (mean, deviation) = (sum / f64::from(n), (squares / f64::from(n)).sqrt());
        assert!(mean.abs() < 0.02, "{mean}");
        assert!((0.15..0.45).contains(&deviation), "{deviation}");
    }

    #[test]
    fn gradient_noise_is_zero_on_the_lattice_also_at_negative_coordinates() {
        for p in [[0.0, 0.0, 0.0], [3.0, -7.0, 2.0], [-1.0, -1.0, -1.0]] {
            assert_eq!(gradient(p), 0.0);
        }
        assert!((gradient([-1e-7, 0.5, 0.5]) - gradient([1e-7, 0.5, 0.5])).abs() < 1e-5);
    }

    #[test]
    fn octaves_add_detail_and_one_is_the_plain_noise() {
        let p = [0.3, 1.7, 2.2];
        assert_eq!(fractal(p, 1), gradient(p.map(|x| x + 1.0)));
        assert_ne!(fractal(p, 1), fractal(p, 4));
    }
}
