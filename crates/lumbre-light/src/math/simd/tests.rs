//! Compares every vector operation with the scalar one, bit by bit, for every width that this
//! processor has.

use glam::Vec3;

use super::*;
use crate::math::real::{Double, Mask, Vector, Word};

/// Runs a kernel with each kind of vectors that this processor has instructions for, and with each
/// kind of pairs.
fn with_every_width<K: SimdKernel<Output = ()> + Clone>(kernel: K) {
    let pairs = [Vectors::PortableEight, Vectors::PortableSixteen].map(Width);
    #[cfg(target_arch = "x86_64")]
    let two = has_avx2().then_some(Width(Vectors::TwoAvx2));
    #[cfg(not(target_arch = "x86_64"))]
    let two = None;
    for width in Width::all().into_iter().chain(pairs).chain(two) {
        dispatch(width, kernel.clone());
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

/// Returns the bits of a number. All NaNs give the same bits.
fn bits(x: f32) -> u32 {
    let bits = x.to_bits();
    if bits & 0x7fff_ffff > 0x7f80_0000 {
        u32::MAX
    } else {
        bits
    }
}

#[test]
fn operations_equal_the_scalar_ones_in_every_lane() {
    #[derive(Clone)]
    struct Operations;
    impl SimdKernel for Operations {
        type Output = ();
        fn run<R: Lanes<N>, const N: usize>(self) {
            for [x, y] in pairs::<N>() {
                let (a, b) = (R::load(&x), R::load(&y));
                let check = |name: &str, vector: R, scalar: &dyn Fn(f32, f32) -> f32| {
                    for (lane, found) in vector.store().into_iter().enumerate() {
                        let (a, b) = (x[lane], y[lane]);
                        assert_eq!(
                            bits(found),
                            bits(scalar(a, b)),
                            "{N} lanes, {name}: {a} {b}"
                        );
                    }
                };
                let encode_mask = |mask: R::Mask| R::select(mask, R::splat(1.0), R::splat(2.0));
                let encode = |set: bool| if set { 1.0 } else { 2.0 };
                check("sum", a + b, &|a, b| a + b);
                check("difference", a - b, &|a, b| a - b);
                check("product", a * b, &|a, b| a * b);
                check("quotient", a / b, &|a, b| a / b);
                check("negative", -a, &|a, _| -a);
                check("square root", a.sqrt(), &|a, _| f32::sqrt(a));
                check("absolute value", a.abs(), &|a, _| f32::abs(a));
                check("floor", a.floor(), &|a, _| f32::floor(a));
                check("copysign", a.copysign(b), &|a, b| f32::copysign(a, b));
                check("minimum", a.min(R::splat(0.5)), &|a, _| f32::min(a, 0.5));
                check("maximum", a.max(R::splat(0.5)), &|a, _| f32::max(a, 0.5));
                check("clamp", a.clamp(-1.0, 1.0), &|a, _| {
                    f32::clamp(a, -1.0, 1.0)
                });
                check("less than", encode_mask(a.lt(b)), &|a, b| encode(a < b));
                check("at most", encode_mask(a.le(b)), &|a, b| encode(a <= b));
                check("greater than", encode_mask(a.gt(b)), &|a, b| encode(a > b));
                check("at least", encode_mask(a.ge(b)), &|a, b| encode(a >= b));
                check("equal", encode_mask(a.eq(b)), &|a, b| encode(a == b));
                check("is finite", encode_mask(a.is_finite()), &|a, _| {
                    encode(f32::is_finite(a))
                });
                check("not", encode_mask(!a.lt(b)), &|a, b| {
                    encode(!matches!(a.partial_cmp(&b), Some(std::cmp::Ordering::Less)))
                });
                check(
                    "and",
                    encode_mask(a.lt(b) & a.gt(R::splat(0.0))),
                    &|a, b| encode(a < b && a > 0.0),
                );
                check("or", encode_mask(a.lt(b) | a.gt(R::splat(0.0))), &|a, b| {
                    encode(a < b || a > 0.0)
                });
                check("map_lanes", a.map_lanes(f32::exp), &|a, _| f32::exp(a));
                check("zip_lanes", a.zip_lanes(b, f32::powf), &f32::powf);
            }
        }
    }
    with_every_width(Operations);
}

#[test]
fn double_precision_operations_equal_the_scalar_ones_in_every_lane() {
    #[derive(Clone)]
    struct DoubleOperations;
    impl SimdKernel for DoubleOperations {
        type Output = ();
        fn run<R: Lanes<N>, const N: usize>(self) {
            let check = |name: &str, vector: [f64; N], scalar: [f64; N]| {
                for (a, b) in vector.into_iter().zip(scalar) {
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
                check("conversion", stored(a), x);
                check("sum", stored(a + b), both(|a, b| a + b));
                check("product", stored(a * b), both(|a, b| a * b));
                check("quotient", stored(a / b), both(|a, b| a / b));
                check("square root", stored(a.sqrt()), x.map(f64::sqrt));
                let table = std::array::from_fn(|i| i as f64);
                let indices = std::array::from_fn(|i| (7 * i + 2048) as u32);
                let entries = R::Double::lookup(&table, R::load_words(&indices));
                check(
                    "lookup",
                    stored(entries),
                    indices.map(|i| f64::from(i % 32)),
                );
                let third = R::Double::splat(1.0) / R::Double::splat(3.0);
                let single = (a * third).single().store().map(f64::from);
                check(
                    "rounding to single",
                    single,
                    x.map(|a| f64::from((a * (1.0 / 3.0)) as f32)),
                );
                let greater = a.gt(b);
                check(
                    "greater",
                    stored(R::Double::select(greater, a, b)),
                    both(|a, b| if a > b { a } else { b }),
                );
                let greater = R::select(greater, R::splat(1.0), R::splat(0.0))
                    .store()
                    .map(f64::from);
                check("mask", greater, both(|a, b| f64::from(u8::from(a > b))));
                check("load and store", stored(R::load_doubles(&x)), x);
            }
        }
    }
    with_every_width(DoubleOperations);
}

/// Operands of word operations: the first and the second.
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
fn word_operations_equal_the_scalar_ones_in_every_lane() {
    #[derive(Clone)]
    struct WordOperations;
    impl SimdKernel for WordOperations {
        type Output = ();
        fn run<R: Lanes<N>, const N: usize>(self) {
            // In lanes 8 to 15 the second operands are shifted by one.
            let a: [u32; N] = std::array::from_fn(|i| WORDS[0][i % 8]);
            let b: [u32; N] = std::array::from_fn(|i| WORDS[1][(i + i / 8) % 8]);
            let load = |w: [u32; N]| R::load(&w.map(f32::from_bits)).bits();
            let store = |w: R::Word| w.bits_to_float().store().map(f32::to_bits);
            let (x, y) = (load(a), load(b));
            let both = |f: fn(u32, u32) -> u32| std::array::from_fn::<u32, N, _>(|i| f(a[i], b[i]));
            assert_eq!(store(x.add(y)), both(u32::wrapping_add));
            assert_eq!(store(x.sub(y)), both(u32::wrapping_sub));
            assert_eq!(store(x.mul(y)), both(u32::wrapping_mul));
            assert_eq!(store(x.xor(y)), both(|a, b| a ^ b));
            assert_eq!(store(x.and(y)), both(|a, b| a & b));
            assert_eq!(store(x.or(y)), both(|a, b| a | b));
            assert_eq!(store(x.shr::<8>()), a.map(|a| a >> 8));
            assert_eq!(store(x.shl::<5>()), a.map(|a| a << 5));
            assert_eq!(store(x.swap_halves()), a.map(|a| a.rotate_left(16)));
            assert_eq!(store(x.reverse_bits()), a.map(u32::reverse_bits));
            assert_eq!(store(x.map_lanes(u32::count_ones)), a.map(u32::count_ones));
            assert_eq!(
                store(x.sign_mask()),
                a.map(|a| if a >> 31 == 1 { u32::MAX } else { 0 })
            );
            assert_eq!(
                store(R::Word::select(x.eq(load(flip_odd(a))), x, y)),
                select_equal(a, b, flip_odd(a))
            );
            assert_eq!(x.shr::<8>().to_float().store(), a.map(|a| (a >> 8) as f32));
            let fractions = [0.0, -1.9, 255.99, -256.0, 3.5, 1e6, -0.2, 7.0];
            let floats: [f32; N] = std::array::from_fn(|i| fractions[i % 8] + (i / 8) as f32);
            assert_eq!(
                store(R::load(&floats).truncated()),
                floats.map(|x| x as i32 as u32)
            );
        }
    }
    /// Returns the words with the lowest bit of every second one flipped.
    fn flip_odd<const N: usize>(a: [u32; N]) -> [u32; N] {
        std::array::from_fn(|i| a[i] ^ (i as u32 & 1))
    }
    /// Returns `a` where it equals `same`, else `b`.
    fn select_equal<const N: usize>(a: [u32; N], b: [u32; N], same: [u32; N]) -> [u32; N] {
        std::array::from_fn(|i| if a[i] == same[i] { a[i] } else { b[i] })
    }
    with_every_width(WordOperations);
}

#[test]
fn transposed_loads_and_stores_are_inverse_and_masks_select_lanes() {
    #[derive(Clone)]
    struct Transposition;
    impl SimdKernel for Transposition {
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
                [true, false].map(|set| R::Mask::splat(set).bits().count_ones()),
                [N as u32, 0]
            );
            let group: Vec<usize> = (5..8).collect();
            let lanes: [usize; N] = padded(&group);
            assert!(
                lanes
                    .into_iter()
                    .enumerate()
                    .all(|(i, item)| item == if i < 3 { 5 + i } else { 5 })
            );
        }
    }
    with_every_width(Transposition);
}

#[test]
fn records_keep_every_field_of_every_lane() {
    crate::record! {
        /// Fields of every type, over more than one row.
        struct Mixed => MixedRecord {
            /// The first of three vectors.
            first: Vec3,
            /// A word that is no number.
            word: Word,
            /// The second of three vectors.
            second: Vec3,
            /// Third vector, which lies in both rows.
            third: Vec3,
            /// A single number.
            number: Real,
        }
    }
    #[derive(Clone)]
    struct StoreAndLoad;
    impl SimdKernel for StoreAndLoad {
        type Output = ();
        fn run<R: Lanes<N>, const N: usize>(self) {
            let column = |k: usize| R::load(&std::array::from_fn(|i| (100 * k + i) as f32));
            let vector = |k: usize| R::Vec3::new(column(k), column(k + 1), column(k + 2));
            let words: [u32; N] = std::array::from_fn(|i| 0x7fc0_0000 | i as u32);
            let lanes = Mixed::<R> {
                first: vector(0),
                word: R::load_words(&words),
                second: vector(3),
                third: vector(6),
                number: column(9),
            };
            let records: [MixedRecord; N] = MixedRecord::store(lanes);
            for (i, record) in records.iter().enumerate() {
                let one = MixedRecord::load::<f32, 1>([record]);
                let expected = |k: usize| {
                    let at = |k: usize| (100 * k + i) as f32;
                    Vec3::new(at(k), at(k + 1), at(k + 2))
                };
                assert_eq!(
                    (one.first, one.second, one.third),
                    (expected(0), expected(3), expected(6))
                );
                assert_eq!((one.word, one.number), (words[i], expected(9).x));
            }
            let back = MixedRecord::load::<R, N>(records.each_ref());
            assert_eq!(R::store_words(back.word), words);
            assert_eq!(back.third.z().store(), column(8).store());
        }
    }
    with_every_width(StoreAndLoad);
}
