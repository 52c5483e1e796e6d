//! Independent uniform random numbers.

use crate::math::real::{Real, Word};
use crate::math::rng::{pcg4d, unit};

/// A stream of independent uniform numbers, determined by a key and a counter of dimensions alone.
#[derive(Clone, Debug)]
pub struct Independent {
    key: [u32; 4],
    block: u32,
    words: [u32; 4],
    used: usize,
}

impl Independent {
    /// Starts the numbers of one sample of one pixel.
    #[inline]
    pub fn new(seed: u64, pixel: [u32; 2], sample: u64) -> Independent {
        Independent::from_key(pcg4d(Independent::key_input(seed, pixel, sample)))
    }

    /// Returns the words from which the key of one sample of one pixel is hashed.
    #[inline]
    pub fn key_input(seed: u64, pixel: [u32; 2], sample: u64) -> [u32; 4] {
        [
            pixel[0] | (pixel[1] << 16),
            (seed as u32) ^ (pixel[0] >> 16).rotate_left(8) ^ (pixel[1] >> 16),
            sample as u32,
            ((seed >> 32) as u32) ^ ((sample >> 32) as u32).rotate_left(16),
        ]
    }

    /// Returns the keys of [inputs](Independent::key_input) and their first four numbers; scalar or
    /// vectorised.
    #[inline(always)]
    pub fn first_four<W: Word>(place: [W; 4]) -> ([W; 4], [W::Real; 4]) {
        let key = pcg4d(place);
        let [a, b, c, d] = pcg4d(key);
        (key, [unit(a), unit(b), unit(c), unit(d)])
    }

    /// Starts the numbers of a key of four random words.
    #[inline]
    pub(super) fn from_key(key: [u32; 4]) -> Independent {
        Independent {
            key,
            block: 0,
            words: [0; 4],
            used: 4,
        }
    }

    /// Returns the key.
    #[inline]
    pub fn key(&self) -> [u32; 4] {
        self.key
    }

    /// Returns how many numbers were taken.
    #[inline]
    pub fn taken(&self) -> u32 {
        self.block
            .wrapping_mul(4)
            .wrapping_sub(4 - self.used as u32)
    }

    /// Resumes the numbers of a key after `taken` of them.
    #[inline]
    pub fn resume(key: [u32; 4], taken: u32) -> Independent {
        let mut numbers = Independent {
            block: taken / 4,
            ..Independent::from_key(key)
        };
        for _ in 0..taken % 4 {
            numbers.next_1d();
        }
        numbers
    }

    /// Returns the next three numbers of keys after `taken` of each; scalar or vectorised.
    #[inline(always)]
    pub fn next_three<W: Word>(key: [W; 4], taken: W) -> [W::Real; 3] {
        let block = key[3].add(taken.shr::<2>());
        let [a, b, c, d] = pcg4d([key[0], key[1], key[2], block]);
        let [e, f, ..] = pcg4d([key[0], key[1], key[2], block.add(W::splat(1))]);
        let within = taken.and(W::splat(3));
        let shift = [
            within.eq(W::splat(1)),
            within.eq(W::splat(2)),
            within.eq(W::splat(3)),
        ];
        [
            selected(shift, [a, b, c, d]),
            selected(shift, [b, c, d, e]),
            selected(shift, [c, d, e, f]),
        ]
    }

    /// Returns the next number, in `[0, 1)`.
    #[inline]
    pub fn next_1d(&mut self) -> f32 {
        if self.used == 4 {
            let [a, b, c, d] = self.key;
            self.words = pcg4d([a, b, c, d.wrapping_add(self.block)]);
            self.block = self.block.wrapping_add(1);
            self.used = 0;
        }
        let word = self.words[self.used];
        self.used += 1;
        unit(word)
    }
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
    use crate::transport::sampler::{Independent, Sampler};

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
    fn the_first_four_are_those_that_are_taken_first() {
        let (key, numbers) =
            Independent::first_four(Independent::key_input(1 << 40 | 7, [70_003, 4], 5));
        let mut all = Independent::new(1 << 40 | 7, [70_003, 4], 5);
        assert_eq!((key, numbers), (all.key(), [0; 4].map(|_| all.next_1d())));
    }

    #[test]
    fn numbers_go_on_wherever_they_were_left() {
        let mut whole = Independent::from_key([1, 2, 3, 4]);
        for taken in 0..13 {
            assert_eq!(whole.taken(), taken);
            let mut rest = Independent::resume([1, 2, 3, 4], taken);
            assert_eq!(rest.taken(), taken);
            assert_eq!(
                Independent::next_three(whole.key(), taken),
                [0; 3].map(|_| rest.next_1d())
            );
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
