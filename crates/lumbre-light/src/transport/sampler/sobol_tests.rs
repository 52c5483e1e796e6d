use super::*;
use crate::math::stats::{chi_square_p, normal_two_sided_p, sidak};
use crate::transport::sampler::{INDEPENDENT, SOBOL, Sampler, SamplerRow};

/// Pairs and single numbers of an imaginary path.
pub type Numbers = (Vec<[f32; 2]>, Vec<f32>);

/// Returns the numbers of an imaginary path: lens, then "choice, direction" repeatedly, with
/// roulette in between.
pub fn numbers_of(sampler: &SamplerRow, seed: u64, pixel: [u32; 2], sample: u64) -> Numbers {
    let mut s = sampler.start(seed, pixel, sample);
    let mut pairs = vec![s.next_2d(), s.next_2d()];
    let mut singles = Vec::new();
    for i in 0..6 {
        singles.push(s.next_1d());
        if i % 2 == 1 {
            singles.push(s.next_1d());
        }
        pairs.push(s.next_2d());
    }
    (pairs, singles)
}

fn path(seed: u64, pixel: [u32; 2], sample: u64) -> Numbers {
    numbers_of(SOBOL, seed, pixel, sample)
}

/// Checks that every pair of these paths, a power of two, has one point in each elementary
/// rectangle, and every single number one in each interval.
pub fn assert_stratified(paths: &[Numbers]) {
    let n = paths.len();
    let bits = n.ilog2();
    for pair in 0..8 {
        for wide in 0..=bits {
            let tall = bits - wide;
            let mut seen = vec![false; n];
            for (pairs, _) in paths {
                let [x, y] = pairs[pair];
                let cell = (((x * (1 << wide) as f32) as usize) << tall)
                    | (y * (1 << tall) as f32) as usize;
                assert!(
                    !std::mem::replace(&mut seen[cell], true),
                    "pair {pair}, {n} samples, {wide} x {tall}"
                );
            }
        }
    }
    for single in 0..9 {
        let mut seen = vec![false; n];
        for (_, singles) in paths {
            let cell = (singles[single] * n as f32) as usize;
            assert!(
                !std::mem::replace(&mut seen[cell], true),
                "single {single}, {n} samples"
            );
        }
    }
}

#[test]
fn directions_are_those_of_the_published_table() {
    // From the recurrence m_i = 2 a_1 m_(i-1) ^ .. ^ 2^s m_(i-s) ^ m_(i-s), by hand.
    let m = |v: &[u32; 32], i: usize| v[i - 1] >> (32 - i);
    let one = directions(1, 0, &[1]);
    assert_eq!([1, 2, 3, 4, 5].map(|i| m(&one, i)), [1, 3, 5, 15, 17]);
    assert_eq!(
        [1, 2, 3, 4, 5].map(|i| m(&DIMENSION_2, i)),
        [1, 3, 3, 9, 29]
    );
    assert_eq!(
        [1, 2, 3, 4, 5].map(|i| m(&DIMENSION_3, i)),
        [1, 3, 1, 5, 31]
    );
    let product = |v: &[u32; 32], index: u32| {
        (0..32)
            .filter(|i| index >> i & 1 == 1)
            .fold(0, |x, i| x ^ v[i])
    };
    for i in 0..100_000u32 {
        let index = i.wrapping_mul(0x9e37_79b9);
        assert_eq!(dimension_1(index), product(&one, index));
        assert_eq!(multiply(&TABLE_2, index), product(&DIMENSION_2, index));
        assert_eq!(multiply(&TABLE_3, index), product(&DIMENSION_3, index));
    }
}

#[test]
fn golden_numbers_never_change() {
    let mut s = Sampler::sobol(7, [3, 4], 5);
    let numbers = [s.next_1d(), s.next_1d(), s.next_1d(), s.next_2d()[1]];
    assert_eq!(
        numbers.map(|x| (x * 16_777_216.0) as u32),
        GOLDEN,
        "needs a new revision of the sampler's row"
    );
}

/// Reference numbers from an implementation in Python.
const GOLDEN: [u32; 4] = [9_644_703, 7_943_241, 9_006_243, 12_499_537];

#[test]
fn every_pair_and_every_single_number_is_stratified_for_every_power_of_two() {
    for (seed, pixel, block) in [
        (1, [0, 0], 0),
        (1, [7, 3], 1),
        (1 << 40, [700, 1], 6),
        (99, [2, 2], 1 << 25),
    ] {
        for bits in 0..=9u32 {
            let n = 1usize << bits;
            let paths: Vec<_> = (0..n as u64)
                .map(|i| path(seed, pixel, block * n as u64 + i))
                .collect();
            assert_stratified(&paths);
        }
    }
}

#[test]
fn a_choice_and_the_direction_after_it_are_stratified_together() {
    let bits = 9u32;
    let n = 1u32 << bits;
    let points: Vec<[f32; 3]> = (0..n)
        .map(|i| {
            let (pairs, singles) = path(5, [1, 2], u64::from(n + i));
            [singles[0], pairs[2][0], pairs[2][1]]
        })
        .collect();
    for a in 0..bits {
        for b in 0..bits - a {
            let sizes = [a, b, bits - 1 - a - b].map(|k| 1u32 << k);
            let mut boxes = vec![0; n as usize / 2];
            for p in &points {
                let cell = (0..3).fold(0, |cell, k| {
                    cell * sizes[k] + (p[k] * sizes[k] as f32) as u32
                });
                boxes[cell as usize] += 1;
            }
            assert!(boxes.iter().all(|count| *count == 2), "{sizes:?}");
        }
    }
}

#[test]
fn a_bit_reaches_all_bits_above_it_and_none_below() {
    // Over random inputs and words, flipping bit j flips bit k > j in half the cases: a z-test for
    // each of the 496 pairs.
    let n = 1u32 << 14;
    let significance = sidak(0.001, 32 * 31 / 2);
    for j in 0..32 {
        let mut flips = [0u32; 32];
        for i in 0..n {
            let [x, word, ..] = pcg4d([i, j, 5, 6]);
            let changed = permute(x, word) ^ permute(x ^ (1 << j), word);
            assert_eq!(changed.trailing_zeros(), j, "{x:x} {word:x}");
            flips
                .iter_mut()
                .enumerate()
                .for_each(|(k, count)| *count += (changed >> k) & 1);
        }
        for (k, count) in flips.into_iter().enumerate().skip(j as usize + 1) {
            let z = (f64::from(count) - f64::from(n) / 2.0) / (f64::from(n) / 4.0).sqrt();
            assert!(
                normal_two_sided_p(z) > significance,
                "bit {j} flips bit {k} {count} times of {n}"
            );
        }
    }
}

/// Returns all numbers of [`path`] in one list.
fn flat(seed: u64, pixel: [u32; 2], sample: u64) -> Vec<f32> {
    let (pairs, singles) = path(seed, pixel, sample);
    pairs.into_iter().flatten().chain(singles).collect()
}

#[test]
fn over_pixels_and_seeds_every_number_is_uniform_and_every_two_are_independent() {
    // One sample of each sequence, so that the counts are those of independent draws: single
    // numbers in 64 cells, pairs of numbers in 8 x 8; significance 0.001 split over all tests.
    let n = 1u32 << 15;
    let walks: [fn(u32) -> Vec<f32>; 3] = [
        |i| flat(3, [i % 181, i / 181], 0),
        |i| flat(3, [i % 181, i / 181], 1021),
        |i| flat(u64::from(i) << 13, [4, 4], 6),
    ];
    let count = walks[0](0).len();
    let expected = vec![f64::from(n) / 64.0; 64];
    let significance = sidak(0.001, walks.len() * (count + count * (count - 1) / 2));
    for (which, walk) in walks.into_iter().enumerate() {
        let numbers: Vec<Vec<f32>> = (0..n).map(walk).collect();
        for a in 0..count {
            let mut cells = vec![0.0; 64];
            numbers
                .iter()
                .for_each(|p| cells[(p[a] * 64.0) as usize] += 1.0);
            let p = chi_square_p(&cells, &expected, 0);
            assert!(p > significance, "walk {which}, number {a}: {p}");
            for b in 0..a {
                let mut cells = vec![0.0; 64];
                numbers
                    .iter()
                    .for_each(|p| cells[(p[a] * 8.0) as usize * 8 + (p[b] * 8.0) as usize] += 1.0);
                let p = chi_square_p(&cells, &expected, 0);
                assert!(p > significance, "walk {which}, numbers {a} and {b}: {p}");
            }
        }
    }
}

#[test]
fn within_a_pixel_no_group_follows_another() {
    // Correlations of numbers of different groups over the samples of one pixel are small in every
    // pixel, and zero in the mean. With 256 samples, pairing two scrambled sequences by independent
    // orders spreads the coefficient by about 1/16. The numbers are of the same dimension: in the
    // same order they would be strongly correlated.
    let (n, pixels) = (256u64, 300u32);
    let mut sums = vec![(0.0f64, 0.0f64); 8 * 8];
    for pixel in 0..pixels {
        let paths: Vec<_> = (0..n).map(|i| path(11, [pixel, 2 * pixel], i).0).collect();
        for a in 0..8 {
            for b in 0..a {
                let which = (a + b) % 2;
                let product =
                    |p: &Vec<[f32; 2]>| f64::from(p[a][which] - 0.5) * f64::from(p[b][which] - 0.5);
                let correlation = 12.0 * paths.iter().map(product).sum::<f64>() / n as f64;
                assert!(
                    correlation.abs() < 0.45,
                    "pixel {pixel}, pairs {a} and {b}: {correlation}"
                );
                sums[a * 8 + b].0 += correlation;
                sums[a * 8 + b].1 += correlation * correlation;
            }
        }
    }
    for a in 0..8 {
        for b in 0..a {
            let (sum, squares) = sums[a * 8 + b];
            let p = normal_two_sided_p(sum / squares.sqrt());
            assert!(p > sidak(0.001, 28), "pairs {a} and {b}: {p}");
        }
    }
}

#[test]
fn neighbouring_pixels_and_later_sequences_have_numbers_of_their_own() {
    let base = flat(7, [3, 4], 5);
    assert_eq!(base, flat(7, [3, 4], 5));
    let others = [
        (8, [3, 4], 5),
        (7, [4, 3], 5),
        (7, [3, 4], 6),
        (7, [3, 4], 5 | 1 << 32),
        (7, [3 | 1 << 17, 4], 5),
    ];
    for (seed, pixel, sample) in others {
        let other = flat(seed, pixel, sample);
        assert!(
            base.iter().zip(&other).all(|(a, b)| a != b),
            "{base:?} {other:?}"
        );
    }
}

/// Returns the variance over seeds of the mean of `n` samples of an integrand, and the mean of
/// those means.
fn spread(sampler: &SamplerRow, n: u64, seeds: u64, f: fn([[f32; 2]; 3]) -> f64) -> (f64, f64) {
    let mean = |seed| {
        let value = |i| {
            let mut s = sampler.start(seed, [1, 1], i);
            f([s.next_2d(), s.next_2d(), s.next_2d()])
        };
        (0..n).map(value).sum::<f64>() / n as f64
    };
    let means: Vec<f64> = (0..seeds).map(mean).collect();
    let all = means.iter().sum::<f64>() / seeds as f64;
    (
        means.iter().map(|m| (m - all) * (m - all)).sum::<f64>() / (seeds as f64 - 1.0),
        all,
    )
}

#[test]
fn smooth_integrals_converge_faster_than_independent_numbers_and_to_the_same() {
    // Integrates exp(x + y^2) on the first pair. The variance of independent numbers falls like
    // 1/n, that of a smooth integrand under Owen scrambling nearly like 1/n^3.
    let smooth = |p: [[f32; 2]; 3]| f64::from(p[0][0] + p[0][1] * p[0][1]).exp();
    let truth = 1.718_281_828_459 * 1.462_651_745_907;
    let slope = |sampler| {
        let variance = |n| spread(sampler, n, 100, smooth).0;
        (variance(1024) / variance(16)).log2() / 6.0
    };
    let (independent, sobol) = (slope(INDEPENDENT), slope(SOBOL));
    assert!((independent + 1.0).abs() < 0.15, "{independent}");
    assert!(sobol < -2.3, "{sobol}");
    let (variance, mean) = spread(SOBOL, 64, 100, smooth);
    assert!(
        normal_two_sided_p((mean - truth) / (variance / 100.0).sqrt()) > 0.001,
        "{mean}"
    );
    // Integrands that are pure interactions of three groups gain little; those of two lose up to a
    // factor of two.
    let crossed = |p: [[f32; 2]; 3]| f64::from((p[0][0] - 0.5) * (p[1][0] - 0.5));
    let (independent, sobol) = (
        spread(INDEPENDENT, 64, 400, crossed).0,
        spread(SOBOL, 64, 400, crossed).0,
    );
    assert!(sobol < 2.4 * independent, "{sobol} {independent}");
    let crossed = |p: [[f32; 2]; 3]| f64::from((p[0][0] - 0.5) * (p[1][0] - 0.5) * (p[2][0] - 0.5));
    let (independent, sobol) = (
        spread(INDEPENDENT, 64, 400, crossed).0,
        spread(SOBOL, 64, 400, crossed).0,
    );
    assert!(sobol < 1.5 * independent, "{sobol} {independent}");
}
