//! Compares every vector operation with the scalar one, bit by bit.

use super::*;
use crate::math::real::{Double, Mask, Word};

/// Runs a kernel with each vector width that this processor has.
fn with_every_width<W: SimdKernel<Output = ()> + Clone>(work: W) {
    for width in [Width::eight(), Width::sixteen()].into_iter().flatten() {
        dispatch(width, work.clone());
    }
}

/// Returns pairs of zeros, small and large numbers, infinities and NaN in all combinations.
fn pairs<const N: usize>() -> Vec<[[f32; N]; 2]> {
    let special = [
        0.0,
        -0.0,
        1.0,
        -2.5,
        1e-40,
        -1e30,
        3e38,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::NAN,
        0.7,
    ];
    (0..special.len())
        .map(|shift| {
            let at = |i: usize| special[i % special.len()];
            [
                std::array::from_fn(at),
                std::array::from_fn(|i| at(i + shift + i * shift)),
            ]
        })
        .collect()
}

/// Returns the bits of a number, the same for every NaN.
fn bits(x: f32) -> u32 {
    let bits = x.to_bits();
    if bits & 0x7fff_ffff > 0x7f80_0000 {
        u32::MAX
    } else {
        bits
    }
}

#[test]
fn every_operation_is_in_every_lane_what_it_is_for_one_number() {
    #[derive(Clone)]
    struct Operations;
    impl SimdKernel for Operations {
        type Output = ();
        fn run<R: Lanes<N>, const N: usize>(self) {
            for [x, y] in pairs::<N>() {
                let (a, b) = (R::load(&x), R::load(&y));
                let check = |name: &str, wide: R, one: &dyn Fn(f32, f32) -> f32| {
                    for (lane, found) in wide.store().into_iter().enumerate() {
                        let (a, b) = (x[lane], y[lane]);
                        assert_eq!(bits(found), bits(one(a, b)), "{N} lanes, {name}: {a} {b}");
                    }
                };
                let yes = |mask: R::Mask| R::select(mask, R::splat(1.0), R::splat(2.0));
                let said = |yes: bool| if yes { 1.0 } else { 2.0 };
                check("sum", a + b, &|a, b| a + b);
                check("difference", a - b, &|a, b| a - b);
                check("product", a * b, &|a, b| a * b);
                check("quotient", a / b, &|a, b| a / b);
                check("negative", -a, &|a, _| -a);
                check("root", a.sqrt(), &|a, _| f32::sqrt(a));
                check("size", a.abs(), &|a, _| f32::abs(a));
                check("sign", a.copysign(b), &|a, b| f32::copysign(a, b));
                check("lesser", a.min(R::splat(0.5)), &|a, _| f32::min(a, 0.5));
                check("greater", a.max(R::splat(0.5)), &|a, _| f32::max(a, 0.5));
                check("between", a.clamp(-1.0, 1.0), &|a, _| {
                    f32::clamp(a, -1.0, 1.0)
                });
                check("less", yes(a.lt(b)), &|a, b| said(a < b));
                check("at most", yes(a.le(b)), &|a, b| said(a <= b));
                check("greater than", yes(a.gt(b)), &|a, b| said(a > b));
                check("at least", yes(a.ge(b)), &|a, b| said(a >= b));
                check("equal", yes(a.eq(b)), &|a, b| said(a == b));
                check("finite", yes(a.is_finite()), &|a, _| {
                    said(f32::is_finite(a))
                });
                check("not", yes(!a.lt(b)), &|a, b| {
                    said(!matches!(a.partial_cmp(&b), Some(std::cmp::Ordering::Less)))
                });
                check("both", yes(a.lt(b) & a.gt(R::splat(0.0))), &|a, b| {
                    said(a < b && a > 0.0)
                });
                check("either", yes(a.lt(b) | a.gt(R::splat(0.0))), &|a, b| {
                    said(a < b || a > 0.0)
                });
                check("each", a.map_lanes(f32::exp), &|a, _| f32::exp(a));
                check("each with", a.zip_lanes(b, f32::powf), &f32::powf);
            }
        }
    }
    with_every_width(Operations);
}

#[test]
fn doubles_are_in_every_lane_what_they_are_alone() {
    #[derive(Clone)]
    struct InDouble;
    impl SimdKernel for InDouble {
        type Output = ();
        fn run<R: Lanes<N>, const N: usize>(self) {
            let check = |name: &str, wide: [f64; N], one: [f64; N]| {
                for (a, b) in wide.into_iter().zip(one) {
                    let same = a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan());
                    assert!(same, "{N} lanes, {name}: {a} is not {b}");
                }
            };
            for [first, second] in pairs::<N>() {
                let (a, b) = (R::load(&first).double(), R::load(&second).double());
                let (x, y) = (first.map(f64::from), second.map(f64::from));
                let both =
                    |f: fn(f64, f64) -> f64| std::array::from_fn::<f64, N, _>(|i| f(x[i], y[i]));
                let stored = R::store_doubles;
                check("the same number", stored(a), x);
                check("sum", stored(a + b), both(|a, b| a + b));
                check("product", stored(a * b), both(|a, b| a * b));
                check("quotient", stored(a / b), both(|a, b| a / b));
                let third = R::Double::splat(1.0) / R::Double::splat(3.0);
                let single = (a * third).single().store().map(f64::from);
                check(
                    "single",
                    single,
                    x.map(|a| f64::from((a * (1.0 / 3.0)) as f32)),
                );
                let more = a.gt(b);
                check(
                    "greater",
                    stored(R::Double::select(more, a, b)),
                    both(|a, b| if a > b { a } else { b }),
                );
                let more = R::select(more, R::splat(1.0), R::splat(0.0))
                    .store()
                    .map(f64::from);
                check("mask", more, both(|a, b| f64::from(u8::from(a > b))));
                check("memory", stored(R::load_doubles(&x)), x);
            }
        }
    }
    with_every_width(InDouble);
}

/// Operands of the operations on words.
const WORDS: [[u32; 8]; 2] = [
    [
        0,
        1,
        0xffff_ffff,
        0x8000_0000,
        0x7fff_ffff,
        12_345,
        1_664_525,
        0xdead_beef,
    ],
    [
        3,
        0xffff_ffff,
        2,
        0x8000_0000,
        7,
        1_013_904_223,
        0xdead_beef,
        5,
    ],
];

#[test]
fn words_wrap_and_shift_as_one_does() {
    #[derive(Clone)]
    struct InWords;
    impl SimdKernel for InWords {
        type Output = ();
        fn run<R: Lanes<N>, const N: usize>(self) {
            // In the second half of 16 lanes the other operands are shifted by one.
            let a: [u32; N] = std::array::from_fn(|i| WORDS[0][i % 8]);
            let b: [u32; N] = std::array::from_fn(|i| WORDS[1][(i + i / 8) % 8]);
            let words = |w: [u32; N]| R::load(&w.map(f32::from_bits)).bits();
            let out = |w: R::Word| w.bits_to_float().store().map(f32::to_bits);
            let (x, y) = (words(a), words(b));
            let both = |f: fn(u32, u32) -> u32| std::array::from_fn::<u32, N, _>(|i| f(a[i], b[i]));
            assert_eq!(out(x.add(y)), both(u32::wrapping_add));
            assert_eq!(out(x.sub(y)), both(u32::wrapping_sub));
            assert_eq!(out(x.mul(y)), both(u32::wrapping_mul));
            assert_eq!(out(x.xor(y)), both(|a, b| a ^ b));
            assert_eq!(out(x.and(y)), both(|a, b| a & b));
            assert_eq!(out(x.shr::<8>()), a.map(|a| a >> 8));
            assert_eq!(
                out(x.sign_mask()),
                a.map(|a| if a >> 31 == 1 { u32::MAX } else { 0 })
            );
            assert_eq!(
                out(R::Word::select(x.eq(words(other_half(a))), x, y)),
                chosen(a, b, other_half(a))
            );
            assert_eq!(x.shr::<8>().to_float().store(), a.map(|a| (a >> 8) as f32));
            let parts = [0.0, -1.9, 255.99, -256.0, 3.5, 1e6, -0.2, 7.0];
            let floats: [f32; N] = std::array::from_fn(|i| parts[i % 8] + (i / 8) as f32);
            assert_eq!(
                out(R::load(&floats).truncated()),
                floats.map(|x| x as i32 as u32)
            );
        }
    }
    /// Returns the words with every second one changed.
    fn other_half<const N: usize>(a: [u32; N]) -> [u32; N] {
        std::array::from_fn(|i| a[i] ^ (i as u32 & 1))
    }
    fn chosen<const N: usize>(a: [u32; N], b: [u32; N], same: [u32; N]) -> [u32; N] {
        std::array::from_fn(|i| if a[i] == same[i] { a[i] } else { b[i] })
    }
    with_every_width(InWords);
}

#[test]
fn rows_become_columns_and_columns_rows() {
    #[derive(Clone)]
    struct Turning;
    impl SimdKernel for Turning {
        type Output = ();
        fn run<R: Lanes<N>, const N: usize>(self) {
            let rows: [F32x8; N] =
                std::array::from_fn(|i| F32x8(std::array::from_fn(|k| (10 * i + k) as f32)));
            let columns = R::transpose_load(rows.each_ref());
            for (k, column) in columns.into_iter().enumerate() {
                assert_eq!(column.store(), std::array::from_fn(|i| (10 * i + k) as f32));
            }
            assert_eq!(R::transpose_store(columns), rows);
            for count in 0..=N {
                let first = R::Mask::first(count);
                assert_eq!(first.bits(), ((1_u64 << count) - 1) as u32);
                assert_eq!(
                    (first.any(), first == R::Mask::default()),
                    (count > 0, count == 0)
                );
                assert!(active_lanes(first.bits()).eq(0..count));
                assert_eq!((!first).bits().count_ones() as usize, N - count);
            }
            assert_eq!(
                [true, false].map(|yes| R::Mask::splat(yes).bits().count_ones()),
                [N as u32, 0]
            );
            let group: Vec<usize> = (5..8).collect();
            let lanes: [usize; N] = padded(&group);
            assert!(
                lanes
                    .into_iter()
                    .enumerate()
                    .all(|(i, of)| of == if i < 3 { 5 + i } else { 5 })
            );
        }
    }
    with_every_width(Turning);
}
