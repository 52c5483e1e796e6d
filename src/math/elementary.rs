//! Sines and cosines from their series: inlined where the library's are calls, and the same on every machine.

use std::f32::consts::FRAC_2_PI;

/// Sine and cosine of an angle of at most a few thousand radians, to a few units in the last place.
#[inline]
pub fn sin_cos(x: f32) -> (f32, f32) {
    // Added to a small number, it leaves the nearest whole one in the last bits.
    const WHOLE: f32 = 12_582_912.0;
    let shifted = x * FRAC_2_PI + WHOLE;
    let turns = shifted - WHOLE;
    // The nearest multiple of a quarter turn, subtracted in three parts of few digits each.
    let r = ((x - turns * 1.570_312_5) - turns * 4.837_513e-4) - turns * 7.549_79e-8;
    let (s, c) = sin_cos_small(r);
    let quarter = shifted.to_bits() & 3;
    let (s, c) = if quarter & 1 == 0 { (s, c) } else { (c, s) };
    (if quarter >= 2 { -s } else { s }, if quarter == 1 || quarter == 2 { -c } else { c })
}

/// The same of an angle of at most an eighth of a turn, where Taylor's series need few terms.
#[inline]
pub fn sin_cos_small(r: f32) -> (f32, f32) {
    let r2 = r * r;
    let s = r + r * r2 * (-1.0 / 6.0 + r2 * (1.0 / 120.0 + r2 * (-1.0 / 5040.0 + r2 * (1.0 / 362_880.0))));
    let c = 1.0 + r2 * (-0.5 + r2 * (1.0 / 24.0 + r2 * (-1.0 / 720.0 + r2 * (1.0 / 40_320.0))));
    (s, c)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_are_the_library_s_functions_at_every_quarter() {
        for i in -40_000..40_000 {
            let x = i as f32 * 1.7e-3;
            let (s, c) = sin_cos(x);
            let (exact_s, exact_c) = f64::from(x).sin_cos();
            assert!((f64::from(s) - exact_s).abs() < 2e-7 && (f64::from(c) - exact_c).abs() < 2e-7, "{x}: {s} {c}");
        }
        assert_eq!(sin_cos(0.0), (0.0, 1.0));
    }
}
