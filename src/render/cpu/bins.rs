//! The memory of films with a time axis.
//!
//! A system hands memory out page by page as it is first written to, which takes many times as long as clearing what is
//! there. So that no run has that on its clock, and none more than another, bins are written to before the clock starts, and
//! what a run leaves is the next one's. Of films beyond [`MAX_KEPT_BYTES`] pages come as light reaches them, if it does; where
//! only the sums of splats go beyond it, that is so for them.
//!
//! Buffers of splats stay as well, from wave to wave and from run to run: one for each thread, whatever runs take turns.

use std::mem::take;
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use crate::film::splat::{SplatBuffer, SplatSums};
use crate::film::time::{BYTES_PER_SLOT, MAX_KEPT_BYTES, SPLAT_BYTES_PER_SLOT};

/// Slots that a thread clears at a time: 640 KiB.
const CLEARED: usize = 1 << 14;

/// What runs have left, the newest last.
static LEFT: Mutex<Vec<Bins>> = Mutex::new(Vec::new());

/// Buffers of splats that no thread fills, all empty.
static IDLE: Mutex<Vec<SplatBuffer>> = Mutex::new(Vec::new());

/// A buffer for sums of so many pixels. If those that lie idle are for others, they are kept no longer.
pub(super) fn buffer(pixels: usize) -> SplatBuffer {
    let mut idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner);
    idle.retain(|buffer| buffer.serves(pixels));
    idle.pop().unwrap_or_else(|| SplatBuffer::new(pixels))
}

/// Leaves empty buffers to later waves.
pub(super) fn leave(buffers: Vec<SplatBuffer>) {
    IDLE.lock().unwrap_or_else(PoisonError::into_inner).extend(buffers);
}

/// What lands in a slot of a pixel, side by side: the two are needed together.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Slot {
    /// The sum over all samples.
    pub(super) sum: [f64; 3],
    /// That of the squares of what each of them brought.
    pub(super) square: [f32; 3],
}

impl Slot {
    /// Adds light to the sum.
    #[inline]
    pub(super) fn add(&mut self, value: [f32; 3]) {
        for (sum, v) in self.sum.iter_mut().zip(value) {
            *sum += f64::from(v);
        }
    }

    /// Adds the square of what a sample has brought. Returns whether there was room for it.
    #[inline]
    pub(super) fn add_square(&mut self, value: [f32; 3]) -> bool {
        self.grow(value.map(|v| v * v))
    }

    /// Makes the square of what a sample has brought before that of all it has brought now. Returns whether there was room.
    #[inline]
    pub(super) fn add_to_square(&mut self, before: [f32; 3], now: [f32; 3]) -> bool {
        self.grow([0, 1, 2].map(|c| {
            let square = now[c] * now[c];
            if square < f32::INFINITY { square - before[c] * before[c] } else { f32::INFINITY }
        }))
    }

    #[inline]
    fn grow(&mut self, by: [f32; 3]) -> bool {
        for (square, by) in self.square.iter_mut().zip(by) {
            *square += by;
        }
        let [a, b, c] = self.square;
        let most = if a > b { a } else { b };
        let most = if most > c { most } else { c };
        most < f32::INFINITY
    }
}

const _: () = assert!(size_of::<Slot>() as u64 == BYTES_PER_SLOT);

/// The sums of a film.
#[derive(Debug, Default)]
pub(super) struct Bins {
    /// `[y][x][slot]`.
    pub(super) slots: Vec<Slot>,
    /// Those of splats, in the same order, if they land and their memory is had beforehand.
    pub(super) splats: Option<SplatSums>,
}

impl Bins {
    /// So many slots of nothing, on which splats may land, made ready by the threads of the pool in which this is called.
    pub(super) fn new(slots: usize, landing: bool) -> Bins {
        let ready = landing && bytes(slots, true) <= MAX_KEPT_BYTES;
        let mut bins =
            from(&mut LEFT.lock().unwrap_or_else(PoisonError::into_inner), slots, ready).unwrap_or_else(|| Bins {
                slots: vec![Slot::default(); slots],
                splats: ready.then(|| SplatSums::new(slots)),
            });
        if bytes(slots, false) <= MAX_KEPT_BYTES {
            bins.slots.par_chunks_mut(CLEARED).for_each(|slots| slots.fill(Slot::default()));
        }
        if let Some(splats) = &mut bins.splats {
            splats.clear();
            (0..splats.stripes()).into_par_iter().for_each(|stripe| splats.reserve(stripe));
        }
        bins
    }

    /// Leaves them to later runs.
    pub(super) fn leave(&mut self) {
        to(&mut LEFT.lock().unwrap_or_else(PoisonError::into_inner), take(self));
    }

    /// Bytes that it takes.
    fn bytes(&self) -> u64 {
        bytes(self.slots.len(), self.splats.is_some())
    }
}

/// Bytes of so many slots, with those of splats or without.
fn bytes(slots: usize, splats: bool) -> u64 {
    slots as u64 * (BYTES_PER_SLOT + u64::from(splats) * SPLAT_BYTES_PER_SLOT)
}

/// Bytes that were left and are there for runs to come.
pub fn kept_bytes() -> u64 {
    LEFT.lock().unwrap_or_else(PoisonError::into_inner).iter().map(Bins::bytes).sum()
}

/// What was left of this size and kind. If nothing was, a night has gone on to other pictures, and nothing is kept any longer.
fn from(left: &mut Vec<Bins>, slots: usize, splats: bool) -> Option<Bins> {
    match left.iter().rposition(|bins| bins.slots.len() == slots && bins.splats.is_some() == splats) {
        Some(i) => Some(left.remove(i)),
        None => {
            left.retain(|bins| bins.slots.len() == slots);
            None
        }
    }
}

/// Keeps bins, if there is room for them; without their splats, if that helps.
fn to(left: &mut Vec<Bins>, mut bins: Bins) {
    if bins.bytes() > MAX_KEPT_BYTES {
        bins.splats = None;
    }
    let bytes = left.iter().map(Bins::bytes).sum::<u64>() + bins.bytes();
    if bytes <= MAX_KEPT_BYTES {
        left.push(bins);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIT: Slot = Slot { sum: [1.0; 3], square: [1.0; 3] };

    fn bins(slots: usize) -> Bins {
        Bins { slots: vec![LIT; slots], splats: None }
    }

    #[test]
    fn the_next_run_of_the_same_size_has_what_was_left_and_another_size_ends_that() {
        let mut left = Vec::new();
        to(&mut left, bins(8));
        to(&mut left, bins(9));
        to(&mut left, bins(8));
        assert_eq!(from(&mut left, 8, false).map(|bins| bins.slots.len()), Some(8));
        assert_eq!(left.iter().map(|bins| bins.slots.len()).collect::<Vec<_>>(), [8, 9]);
        // Another technique beside the first in turn ends nothing.
        assert!(from(&mut left, 8, true).is_none() && left.len() == 1);
        to(&mut left, Bins { splats: Some(SplatSums::new(8)), ..bins(8) });
        assert!(from(&mut left, 8, true).is_some_and(|bins| bins.splats.is_some()) && left.len() == 1);
        assert!(from(&mut left, 7, false).is_none() && left.is_empty());
    }

    #[test]
    fn no_more_is_kept_than_there_is_room_for() {
        let half = (MAX_KEPT_BYTES / BYTES_PER_SLOT / 2) as usize;
        // Nothing is written to them, so that they take no memory.
        let large = || Bins { slots: vec![Slot::default(); half], splats: None };
        let mut left = Vec::new();
        (0..3).for_each(|_| to(&mut left, large()));
        assert_eq!(left.len(), 2);
        left.clear();
        to(&mut left, Bins { splats: Some(SplatSums::new(half)), ..large() });
        assert!(left.len() == 1 && left[0].splats.is_none());
    }

    #[test]
    fn what_was_left_is_cleared() {
        // A size that no other test has.
        let slots = 3 * CLEARED + 17;
        for _ in 0..2 {
            let mut own = Bins::new(slots, true);
            assert_eq!(own.slots.len(), slots);
            assert!(own.slots.iter().all(|slot| *slot == Slot::default()));
            let splats = own.splats.as_ref().unwrap();
            splats.each(|i, _, _| panic!("something has landed on {i}"));
            assert!(splats.add(slots - 1, [1.0; 3]) && splats.sum(slots - 1) == [1.0; 3]);
            assert_eq!(splats.sum(slots - 2), [0.0; 3], "what was written to have the memory is gone");
            own.slots.fill(LIT);
            own.leave();
        }
    }
}
