//! Sine and cosine from their Taylor series, scalar or vectorised.
//!
//! Invariant: results have the same bits on every machine and for any number of lanes, unlike those
//! of a system's mathematics library.

use std::f32::consts::FRAC_2_PI;

use super::real::{Real, Word};

/// Returns sine and cosine of an angle in radians, of absolute value up to a few thousand, to a few
/// units in the last place.
#[inline(always)]
pub fn sin_cos<R: Real>(x: R) -> (R, R) {
    // 1.5 * 2^23: the last bits of its sum with a small number are the integer nearest to that
    // number.
    let rounding = R::splat(12_582_912.0);
    let shifted = x * R::splat(FRAC_2_PI) + rounding;
    let quarters = shifted - rounding;
    // Subtract the nearest multiple of pi / 2, which is split into three constants of few digits to
    // keep accuracy.
    let r = ((x - quarters * R::splat(1.570_312_5)) - quarters * R::splat(4.837_513e-4))
        - quarters * R::splat(7.549_79e-8);
    let (s, c) = sin_cos_small(r);
    let word = R::Word::splat;
    let quadrant = shifted.bits().and(word(3));
    let (second, third) = (quadrant.eq(word(1)), quadrant.eq(word(2)));
    let even = quadrant.and(word(1)).eq(word(0));
    let (s, c) = (R::select(even, s, c), R::select(even, c, s));
    (
        R::select(third | quadrant.eq(word(3)), -s, s),
        R::select(second | third, -c, c),
    )
}

/// Returns sine and cosine of an angle of absolute value up to pi / 4, by a short Taylor series.
#[inline(always)]
pub fn sin_cos_small<R: Real>(r: R) -> (R, R) {
    let k = R::splat;
    let r2 = r * r;
    let s = r + r
        * r2
        * (k(-1.0 / 6.0)
            + r2 * (k(1.0 / 120.0) + r2 * (k(-1.0 / 5040.0) + r2 * k(1.0 / 362_880.0))));
    let c = k(1.0)
        + r2 * (k(-0.5) + r2 * (k(1.0 / 24.0) + r2 * (k(-1.0 / 720.0) + r2 * k(1.0 / 40_320.0))));
    (s, c)
}

#[cfg(test)]
mod tests {
    use crate::math::trig::*;

    #[test]
    fn series_agree_with_the_standard_library_in_every_quadrant() {
        for i in -40_000..40_000 {
            let x = i as f32 * 1.7e-3;
            let (s, c) = sin_cos(x);
            let (exact_s, exact_c) = f64::from(x).sin_cos();
            assert!(
                (f64::from(s) - exact_s).abs() < 2e-7 && (f64::from(c) - exact_c).abs() < 2e-7,
                "{x}: {s} {c}"
            );
        }
        assert_eq!(sin_cos(0.0), (0.0, 1.0));
    }
}
