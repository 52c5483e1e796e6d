//! Independent uniform random numbers: a pure function of a key and of how many were taken.

use crate::math::real::{Mask, Real, Word};
use crate::math::rng::{pcg4d, unit};

/// Returns the words from which the key of one sample of one pixel is hashed. `sample` is given by
/// its lower and its upper word.
#[inline(always)]
pub fn key_input<W: Word>(seed: u64, [x, y]: [W; 2], [low, high]: [W; 2]) -> [W; 4] {
    [
        x.or(y.shl::<16>()),
        super::seed_and_upper_halves(seed, [x, y]),
        low,
        W::splat((seed >> 32) as u32).xor(high.swap_halves()),
    ]
}

/// Returns the four words of the block in which number `taken` lies, or of the block after it.
#[inline(always)]
fn block<W: Word>(key: [W; 4], taken: W, after: u32) -> [W; 4] {
    let block = taken.shr::<2>().add(W::splat(after));
    pcg4d([key[0], key[1], key[2], key[3].add(block)])
}

/// Returns the masks of the lanes whose next number is the second, third or fourth of its block.
#[inline(always)]
fn places<W: Word>(taken: W) -> [<W::Real as Real>::Mask; 3] {
    let within = taken.and(W::splat(3));
    [
        within.eq(W::splat(1)),
        within.eq(W::splat(2)),
        within.eq(W::splat(3)),
    ]
}

/// Returns number `taken` of each key.
#[inline(always)]
pub fn next_one<W: Word>(key: [W; 4], taken: W) -> W::Real {
    selected(places(taken), block(key, taken, 0))
}

/// Returns the next two numbers of keys after `taken` of each.
#[inline(always)]
pub fn next_two<W: Word>(key: [W; 4], taken: W) -> [W::Real; 2] {
    let [a, b, c, d] = block(key, taken, 0);
    let places = places(taken);
    let [e, ..] = if places[2].any() {
        block(key, taken, 1)
    } else {
        [a; 4]
    };
    [
        selected(places, [a, b, c, d]),
        selected(places, [b, c, d, e]),
    ]
}

/// Returns the next three numbers of keys after `taken` of each.
#[inline(always)]
pub fn next_three<W: Word>(key: [W; 4], taken: W) -> [W::Real; 3] {
    let [a, b, c, d] = block(key, taken, 0);
    let [e, f, ..] = block(key, taken, 1);
    let places = places(taken);
    [
        selected(places, [a, b, c, d]),
        selected(places, [b, c, d, e]),
        selected(places, [c, d, e, f]),
    ]
}

/// Returns the number of word 1, 2 or 3 where the respective mask is set, else of word 0.
#[inline(always)]
fn selected<R: Real>([one, two, three]: [R::Mask; 3], words: [R::Word; 4]) -> R {
    let later = R::Word::select(three, words[3], R::Word::select(two, words[2], words[0]));
    unit(R::Word::select(one, words[1], later))
}

#[cfg(test)]
mod tests {
    use crate::math::stats::chi_square_p;
    use crate::transport::sampler::{Sampler, Sequence};

    #[test]
    fn golden_numbers_never_change() {
        // From an implementation in Python. A change here changes every picture and needs a new
        // revision.
        let mut s = Sampler::new(7, [3, 4], 5);
        let ([a, b], c, [d, e]) = (s.next_2d(), s.next_1d(), s.next_2d());
        let numbers = [a, b, c, d, e].map(|x| (x * 16_777_216.0) as u32);
        assert_eq!(
            numbers,
            [11_238_112, 5_423_057, 9_467_810, 14_703_034, 1_590_657]
        );
    }

    #[test]
    fn numbers_go_on_wherever_they_were_left() {
        let resume = |taken| Sampler::<f32>::resume(Sequence::Independent, [1, 2, 3, 4], 0, taken);
        let mut whole = resume(0);
        for taken in 0..13 {
            assert_eq!(whole.taken(), taken);
            let mut rest = resume(taken);
            let three = resume(taken).next_three();
            let ([a, b], c) = (resume(taken).next_2d(), resume(taken + 2).next_1d());
            assert_eq!([three, [a, b, c]], [[0; 3].map(|_| rest.next_1d()); 2]);
            whole.next_1d();
        }
    }

    #[test]
    fn same_key_same_numbers_and_any_other_key_others() {
        let take = |mut s: Sampler| (0..9).map(|_| s.next_1d()).collect::<Vec<_>>();
        let base = take(Sampler::new(7, [3, 4], 5));
        assert_eq!(base, take(Sampler::new(7, [3, 4], 5)));
        let others = [
            Sampler::new(8, [3, 4], 5),
            Sampler::new(7 | 1 << 40, [3, 4], 5),
            Sampler::new(7, [4, 3], 5),
            Sampler::new(7, [3, 4], 6),
            Sampler::new(7, [3, 4], 5 | 1 << 33),
            Sampler::new(7, [3 | 1 << 17, 4], 5),
        ];
        for other in others {
            let other = take(other);
            assert!(
                base.iter().zip(&other).all(|(a, b)| a != b),
                "{base:?} {other:?}"
            );
        }
    }

    #[test]
    fn pairs_fill_the_square_over_samples_pixels_and_dimensions() {
        // Three ways of walking the key space, 16 x 16 cells each; significance 0.001 split over
        // three tests.
        let walks: [fn(u32) -> [f32; 2]; 3] = [
            |i| Sampler::new(1, [5, 6], u64::from(i)).next_2d(),
            |i| Sampler::new(1, [i % 300, i / 300], 0).next_2d(),
            |i| {
                let mut s = Sampler::new(1, [9, 9], u64::from(i / 64));
                for _ in 0..i % 64 {
                    s.next_2d();
                }
                s.next_2d()
            },
        ];
        for walk in walks {
            let n = 1u32 << 16;
            let mut observed = vec![0.0; 256];
            for i in 0..n {
                let [x, y] = walk(i);
                observed[(x * 16.0) as usize * 16 + (y * 16.0) as usize] += 1.0;
            }
            let expected = vec![f64::from(n) / 256.0; 256];
            assert!(chi_square_p(&observed, &expected, 0) > 0.001 / 3.0);
        }
    }
}
