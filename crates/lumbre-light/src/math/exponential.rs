//! The exponential function and the hypotenuse, in lanes.
//!
//! [`exp`] is the algorithm of GNU's C library and of Arm's optimized routines: 2^(k/32) from a table
//! times a polynomial, in double precision. It has the same bits in every lane and on every machine.
//! That library fuses multiplications and additions where the processor can; the results differ in
//! the last place for less than one number in a million.

use super::real::{Double, Real, Word};

/// Number of entries of [`POWERS`].
const STEPS: f64 = 32.0;

/// Steps that are added to make exponents positive.
const BIAS: u32 = 256 * 32;

/// 1.5 times 2^52: a number to which others are added to round them to integers.
const ROUNDING: f64 = 6_755_399_441_055_744.0;

/// The powers 2^(i / 32).
const POWERS: [f64; 32] = [
    f64::from_bits(0x3ff0_0000_0000_0000),
    f64::from_bits(0x3ff0_59b0_d315_8574),
    f64::from_bits(0x3ff0_b558_6cf9_890f),
    f64::from_bits(0x3ff1_1301_d012_5b51),
    f64::from_bits(0x3ff1_72b8_3c7d_517b),
    f64::from_bits(0x3ff1_d487_3168_b9aa),
    f64::from_bits(0x3ff2_387a_6e75_6238),
    f64::from_bits(0x3ff2_9e9d_f51f_dee1),
    f64::from_bits(0x3ff3_06fe_0a31_b715),
    f64::from_bits(0x3ff3_71a7_373a_a9cb),
    f64::from_bits(0x3ff3_dea6_4c12_3422),
    f64::from_bits(0x3ff4_4e08_6061_892d),
    f64::from_bits(0x3ff4_bfda_d536_2a27),
    f64::from_bits(0x3ff5_342b_569d_4f82),
    f64::from_bits(0x3ff5_ab07_dd48_5429),
    f64::from_bits(0x3ff6_247e_b03a_5585),
    f64::from_bits(0x3ff6_a09e_667f_3bcd),
    f64::from_bits(0x3ff7_1f75_e8ec_5f74),
    f64::from_bits(0x3ff7_a114_73eb_0187),
    f64::from_bits(0x3ff8_2589_994c_ce13),
    f64::from_bits(0x3ff8_ace5_422a_a0db),
    f64::from_bits(0x3ff9_3737_b0cd_c5e5),
    f64::from_bits(0x3ff9_c491_82a3_f090),
    f64::from_bits(0x3ffa_5503_b23e_255d),
    f64::from_bits(0x3ffa_e89f_995a_d3ad),
    f64::from_bits(0x3ffb_7f76_f2fb_5e47),
    f64::from_bits(0x3ffc_199b_dd85_529c),
    f64::from_bits(0x3ffc_b720_dcef_9069),
    f64::from_bits(0x3ffd_5818_dcfb_a487),
    f64::from_bits(0x3ffd_fc97_337b_9b5f),
    f64::from_bits(0x3ffe_a4af_a2a4_90da),
    f64::from_bits(0x3fff_5076_5b6e_4540),
];

/// Coefficients of 2^(r / 32) for r in [-1/2, 1/2], the highest power first; the last one is 1.
const COEFFICIENTS: [f64; 3] = [
    0.055_503_615_593_415_35 / STEPS / STEPS / STEPS,
    0.240_228_452_244_572_2 / STEPS / STEPS,
    0.693_147_180_691_620_3 / STEPS,
];

/// Returns the exponential function, within 0.51 units in the last place.
#[inline(always)]
pub fn exp<R: Real>(x: R) -> R {
    let number = R::Double::splat;
    // Beyond these bounds the result is zero or infinite.
    let z = x.clamp(-104.0, 89.0).double() * number(std::f64::consts::LOG2_E * STEPS);
    let k = (z + number(ROUNDING)) + number(-ROUNDING);
    let r = z + k * number(-1.0);
    let steps = k.single().truncated().add(R::Word::splat(BIAS));
    // The exponent in two parts, each of which is that of a single-precision number.
    let exponent = steps.shr::<5>();
    let half = exponent.shr::<1>();
    let scale = R::Double::lookup(&POWERS, steps)
        * power_of_two::<R>(half)
        * power_of_two::<R>(exponent.sub(half));
    let [a, b, c] = COEFFICIENTS;
    let value = (number(a) * r + number(b)) * (r * r) + (number(c) * r + number(1.0));
    (value * scale).single()
}

/// Returns 2^(`exponent` - 128).
#[inline(always)]
fn power_of_two<R: Real>(exponent: R::Word) -> R::Double {
    let bits = exponent.sub(R::Word::splat(1)).shl::<23>();
    bits.bits_to_float().double()
}

/// Returns the length of the hypotenuse of a right-angled triangle, rounded once.
#[inline(always)]
pub fn hypot<R: Real>(x: R, y: R) -> R {
    let (x, y) = (x.double(), y.double());
    (x * x + y * y).sqrt().single()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_function_is_that_of_the_library() {
        let (mut tested, mut different) = (0u64, 0u64);
        // A prime step through all bit patterns.
        for bits in (0..=u32::MAX).step_by(2_003) {
            let x = f32::from_bits(bits);
            let (own, library) = (exp(x), x.exp());
            if x.is_nan() {
                assert!(own.is_nan(), "{x}");
                continue;
            }
            tested += 1;
            different += u64::from(own != library);
            let distance = own.to_bits().abs_diff(library.to_bits());
            assert!(distance <= 1, "exp({x}) = {own} instead of {library}");
        }
        assert!(different * 1_000_000 < tested, "{different} of {tested}");
        assert_eq!([exp(0.0f32), exp(f32::NEG_INFINITY)], [1.0, 0.0]);
        assert_eq!(exp(f32::INFINITY), f32::INFINITY);
    }

    #[test]
    fn the_hypotenuse_is_rounded_once() {
        assert_eq!(hypot(3.0f32, -4.0), 5.0);
        assert_eq!(hypot(1e30f32, 1e30), 1e30f32.hypot(1e30));
        assert_eq!(hypot(1e-30f32, 2e-30), 1e-30f32.hypot(2e-30));
    }
}
