use super::*;
use crate::math::stats::{chi_square_p, normal_two_sided_p, sidak};
use crate::transport::sampler::sobol::tests::{Numbers, assert_stratified, numbers_of};
use crate::transport::sampler::{SOBOL, SamplerRow, sampler};

/// Returns the sampler with blocks of a number of samples.
fn zsobol(block: u32) -> &'static SamplerRow {
    sampler(&format!("zsobol{block}")).unwrap()
}

fn path(seed: u64, pixel: [u32; 2], sample: u64) -> Numbers {
    numbers_of(zsobol(4), seed, pixel, sample)
}

/// Returns all numbers of [`path`] in one list.
fn flat(seed: u64, pixel: [u32; 2], sample: u64) -> Vec<f32> {
    let (pairs, singles) = path(seed, pixel, sample);
    pairs.into_iter().flatten().chain(singles).collect()
}

#[test]
fn aligned_squares_of_pixels_have_the_points_of_one_sequence() {
    // Corner of the square in units of its side, binary digits of the side, and number of the block.
    for (seed, corner, side_bits, block, first) in [
        (1, [0, 0], 3, 1, 0),
        (9, [5, 2], 2, 4, 3),
        (1 << 40, [511, 511], 2, 16, 2),
        (3, [512, 7], 2, 4, 1 << 30),
        (4, [0, 1], 0, 64, 1),
        (5, [3, 0], 4, 1, 7),
    ] {
        let side = 1u32 << side_bits;
        let samples = first * u64::from(block)..(first + 1) * u64::from(block);
        let mut paths = Vec::new();
        for y in 0..side {
            for x in 0..side {
                let pixel = [corner[0] * side + x, corner[1] * side + y];
                let of = |sample| numbers_of(zsobol(block), seed, pixel, sample);
                paths.extend(samples.clone().map(of));
            }
        }
        assert_stratified(&paths);
    }
}

#[test]
fn golden_numbers_never_change() {
    let mut s = zsobol(4).start(7, [3, 2052], 5);
    let numbers = [s.next_1d(), s.next_1d(), s.next_1d(), s.next_2d()[1]];
    assert_eq!(
        numbers.map(|x| (x * 16_777_216.0) as u32),
        GOLDEN,
        "needs a new revision of the sampler's row"
    );
}

/// Reference numbers from an implementation in Python.
const GOLDEN: [u32; 4] = [2_627_533, 1_342_668, 16_248_326, 3_491_828];

#[test]
fn over_seeds_every_number_is_uniform_and_every_two_of_a_sample_are_independent() {
    let n = 1u64 << 15;
    let numbers: Vec<Vec<f32>> = (0..n).map(|i| flat(i << 13, [37, 4], 6)).collect();
    let count = numbers[0].len();
    let expected = vec![n as f64 / 64.0; 64];
    let significance = sidak(0.001, count + count * (count - 1) / 2);
    let test = |cell: &dyn Fn(&[f32]) -> usize| {
        let mut cells = vec![0.0; 64];
        numbers.iter().for_each(|p| cells[cell(p)] += 1.0);
        chi_square_p(&cells, &expected, 0)
    };
    for a in 0..count {
        let p = test(&|p| (p[a] * 64.0) as usize);
        assert!(p > significance, "number {a}: {p}");
        for b in 0..a {
            let p = test(&|p| (p[a] * 8.0) as usize * 8 + (p[b] * 8.0) as usize);
            assert!(p > significance, "numbers {a} and {b}: {p}");
        }
    }
}

#[test]
fn other_seeds_tiles_blocks_and_pixels_have_numbers_of_their_own() {
    let base = flat(7, [3, 4], 5);
    assert_eq!(base, flat(7, [3, 4], 5));
    for (seed, pixel, sample) in [
        (8, [3, 4], 5),
        (7 | 1 << 40, [3, 4], 5),
        (7, [4, 3], 5),
        (7, [3 + TILE, 4], 5),
        (7, [3, 4 + TILE], 5),
        (7, [3, 4], 6),
        (7, [3, 4], 5 + 4),
        (7, [3, 4], 5 | 1 << 32),
    ] {
        let other = flat(seed, pixel, sample);
        assert!(
            base.iter().zip(&other).all(|(a, b)| a != b),
            "{base:?} {other:?}"
        );
    }
}

/// Returns the mean and the variance, over seeds, of the mean of an integrand over `n` samples of
/// the pixels of a square of 4 x 4, and the mean variance of one pixel.
fn spread(sampler: &SamplerRow, n: u64, seeds: u64) -> (f64, f64, f64) {
    let pixel = |seed, i: u32| {
        let value = |sample| {
            let [x, y] = sampler
                .start(seed, [8 + i % 4, 4 + i / 4], sample)
                .next_2d();
            f64::from(x + y * y).exp()
        };
        (0..n).map(value).sum::<f64>() / n as f64
    };
    let variance = |numbers: &[f64]| {
        let mean = numbers.iter().sum::<f64>() / numbers.len() as f64;
        let squares = numbers.iter().map(|x| (x - mean) * (x - mean));
        (mean, squares.sum::<f64>() / (numbers.len() - 1) as f64)
    };
    let squares: Vec<Vec<f64>> = (0..seeds)
        .map(|seed| (0..16).map(|i| pixel(seed, i)).collect())
        .collect();
    let means: Vec<f64> = squares
        .iter()
        .map(|s| s.iter().sum::<f64>() / 16.0)
        .collect();
    let (mean, of_square) = variance(&means);
    let of_pixel = (0..16).map(|i| {
        let numbers: Vec<f64> = squares.iter().map(|s| s[i]).collect();
        variance(&numbers).1
    });
    (mean, of_square, of_pixel.sum::<f64>() / 16.0)
}

#[test]
fn errors_of_neighbouring_pixels_cancel() {
    // exp(x + y^2), whose integral is the product of two tabulated ones.
    let truth = 1.718_281_828_459 * 1.462_651_745_907;
    let seeds = 200;
    for n in [1, 4, 16] {
        let (_, of_square, of_pixel) = spread(SOBOL, n, seeds);
        let (mean, with_neighbours, alone) = spread(zsobol(n as u32), n, seeds);
        // The pixels of `sobol` are independent.
        assert!((of_square * 16.0 / of_pixel - 1.0).abs() < 0.4, "{n}");
        assert!(
            with_neighbours < 0.1 * of_square,
            "{n} samples: {with_neighbours} instead of {of_square}"
        );
        // A pixel's own samples are as even.
        assert!(
            (alone / of_pixel - 1.0).abs() < 0.2,
            "{n}: {alone} {of_pixel}"
        );
        let z = (mean - truth) / (with_neighbours / seeds as f64).sqrt();
        assert!(normal_two_sided_p(z) > sidak(0.001, 3), "{n}: {mean}");
    }
}
