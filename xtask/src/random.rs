//! Pseudo-random numbers. The fuzz targets use this file too.

use lumbre_light::math::rng::pcg4d;

/// A sequence of pseudo-random numbers.
pub struct Random {
    key: [u32; 3],
    drawn: u32,
}

impl Random {
    /// Returns the sequence of a key.
    pub fn new(key: [u32; 3]) -> Random {
        Random { key, drawn: 0 }
    }

    /// Returns a number below `end`, which must not be zero.
    pub fn below(&mut self, end: usize) -> usize {
        self.drawn += 1;
        let [a, b, c] = self.key;
        let [high, low, ..] = pcg4d([a, b, c, self.drawn]);
        let word = u64::from(high) << 32 | u64::from(low);
        (word % end as u64) as usize
    }

    /// Returns one of the items, of which there must be one.
    pub fn pick<'a, T>(&mut self, items: &'a [T]) -> &'a T {
        &items[self.below(items.len())]
    }
}
