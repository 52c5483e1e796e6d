//! Pool of memory for the slots of films with a time axis, and for splat buffers.
//!
//! The first write to a page makes the operating system map it, which takes many times as long as
//! clearing mapped memory: 0.27 to 0.41 s for a film of 178 MB, instead of 0.02 s
//! (docs/notes/cpu.md). So that no run's time includes this, slots are written before the
//! clock starts, and their memory is recycled for the next run.
//!
//! Films larger than [`MAX_KEPT_BYTES`] are not written beforehand, and their pages are mapped when
//! light reaches them. If only the splat sums exceed the limit, this applies to the splat sums
//! alone.
//!
//! Splat buffers are recycled from wave to wave and from run to run: there is one per thread, even
//! if runs are interleaved.

use std::mem::take;
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use lumbre_light::film::splat::{SplatBuffer, SplatSums};
use lumbre_light::film::time::{BYTES_PER_SLOT, MAX_KEPT_BYTES, SPLAT_BYTES_PER_SLOT};

/// Number of slots that a thread clears at a time: 640 KiB.
const CLEAR_CHUNK: usize = 1 << 14;

/// Slot memory of finished runs, the most recent last.
static FREE_SLOTS: Mutex<Vec<SlotMemory>> = Mutex::new(Vec::new());

/// Splat buffers that no thread is using, all empty.
static FREE_BUFFERS: Mutex<Vec<SplatBuffer>> = Mutex::new(Vec::new());

/// Returns an empty buffer for the splat sums of `pixels` pixels or slots. Frees all unused buffers
/// of other sizes.
pub(crate) fn take_buffer(pixels: usize) -> SplatBuffer {
    let mut free = FREE_BUFFERS.lock().unwrap_or_else(PoisonError::into_inner);
    free.retain(|buffer| buffer.serves(pixels));
    free.pop().unwrap_or_else(|| SplatBuffer::new(pixels))
}

/// Recycles empty buffers for later waves.
pub(crate) fn recycle_buffers(buffers: Vec<SplatBuffer>) {
    FREE_BUFFERS
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .extend(buffers);
}

/// Sums of one slot of a pixel. They are stored together, since they are updated together.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Slot {
    /// Sum of the radiance of all samples.
    pub(crate) sum: [f64; 3],
    /// Sum of the squares of each sample's total contribution.
    pub(crate) square: [f32; 3],
}

impl Slot {
    /// Adds radiance to the sum.
    #[inline]
    pub(crate) fn add(&mut self, value: [f32; 3]) {
        for (sum, v) in self.sum.iter_mut().zip(value) {
            *sum += f64::from(v);
        }
    }

    /// Adds the square of a sample's contribution. Returns whether the sum stayed finite.
    #[inline]
    pub(crate) fn add_square(&mut self, value: [f32; 3]) -> bool {
        self.add_to_squares(value.map(|v| v * v))
    }

    /// Replaces the square of a sample's contribution `before` by that of its contribution `now`,
    /// which includes `before`. Returns whether the sum stayed finite.
    #[inline]
    pub(crate) fn replace_square(&mut self, before: [f32; 3], now: [f32; 3]) -> bool {
        self.add_to_squares([0, 1, 2].map(|c| {
            let square = now[c] * now[c];
            if square < f32::INFINITY {
                square - before[c] * before[c]
            } else {
                f32::INFINITY
            }
        }))
    }

    #[inline]
    fn add_to_squares(&mut self, increment: [f32; 3]) -> bool {
        for (square, v) in self.square.iter_mut().zip(increment) {
            *square += v;
        }
        let [a, b, c] = self.square;
        let greatest = if a > b { a } else { b };
        let greatest = if greatest > c { greatest } else { c };
        greatest < f32::INFINITY
    }
}

const _: () = assert!(size_of::<Slot>() as u64 == BYTES_PER_SLOT);

/// Sums of all slots of a film.
#[derive(Debug, Default)]
pub(crate) struct SlotMemory {
    /// Sums of samples, `[y][x][slot]`.
    pub(crate) slots: Vec<Slot>,
    /// Sums of splats in the same order, if the integrator makes splats and they are allocated
    /// beforehand.
    pub(crate) splats: Option<SplatSums>,
}

impl SlotMemory {
    /// Returns `slots` cleared slots, with splat sums if `has_splats` and they fit the limit. The
    /// threads of the current pool clear the memory.
    pub(crate) fn new(slots: usize, has_splats: bool) -> SlotMemory {
        let allocate_splats = has_splats && bytes(slots, true) <= MAX_KEPT_BYTES;
        let mut memory = take_matching(
            &mut FREE_SLOTS.lock().unwrap_or_else(PoisonError::into_inner),
            slots,
            allocate_splats,
        )
        .unwrap_or_else(|| SlotMemory {
            slots: vec![Slot::default(); slots],
            splats: allocate_splats.then(|| SplatSums::new(slots)),
        });
        if bytes(slots, false) <= MAX_KEPT_BYTES {
            memory
                .slots
                .par_chunks_mut(CLEAR_CHUNK)
                .for_each(|slots| slots.fill(Slot::default()));
        }
        if let Some(splats) = &mut memory.splats {
            splats.clear();
            (0..splats.stripes())
                .into_par_iter()
                .for_each(|stripe| splats.reserve(stripe));
        }
        memory
    }

    /// Recycles the memory for later runs.
    pub(crate) fn recycle(&mut self) {
        put_back(
            &mut FREE_SLOTS.lock().unwrap_or_else(PoisonError::into_inner),
            take(self),
        );
    }

    /// Returns its size in bytes.
    fn bytes(&self) -> u64 {
        bytes(self.slots.len(), self.splats.is_some())
    }
}

/// Returns the size of `slots` slots in bytes, with or without splat sums.
fn bytes(slots: usize, splats: bool) -> u64 {
    slots as u64 * (BYTES_PER_SLOT + u64::from(splats) * SPLAT_BYTES_PER_SLOT)
}

/// Returns the number of bytes held for later runs.
pub fn kept_bytes() -> u64 {
    FREE_SLOTS
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .iter()
        .map(SlotMemory::bytes)
        .sum()
}

/// Takes memory with this number of slots, and with or without splat sums, from the pool. If there
/// is none, frees all memory of other sizes, since the night then renders pictures of this size.
fn take_matching(free: &mut Vec<SlotMemory>, slots: usize, splats: bool) -> Option<SlotMemory> {
    match free
        .iter()
        .rposition(|memory| memory.slots.len() == slots && memory.splats.is_some() == splats)
    {
        Some(i) => Some(free.remove(i)),
        None => {
            free.retain(|memory| memory.slots.len() == slots);
            None
        }
    }
}

/// Adds memory to the pool if the pool then stays within [`MAX_KEPT_BYTES`]. Splat sums are dropped
/// first if the memory alone exceeds the limit.
fn put_back(free: &mut Vec<SlotMemory>, mut memory: SlotMemory) {
    if memory.bytes() > MAX_KEPT_BYTES {
        memory.splats = None;
    }
    let bytes = free.iter().map(SlotMemory::bytes).sum::<u64>() + memory.bytes();
    if bytes <= MAX_KEPT_BYTES {
        free.push(memory);
    }
}

#[cfg(test)]
mod tests {
    use crate::cpu::films::bin_pool::*;

    const LIT: Slot = Slot {
        sum: [1.0; 3],
        square: [1.0; 3],
    };

    fn memory(slots: usize) -> SlotMemory {
        SlotMemory {
            slots: vec![LIT; slots],
            splats: None,
        }
    }

    #[test]
    fn memory_is_reused_for_the_same_size_and_freed_for_another() {
        let mut free = Vec::new();
        put_back(&mut free, memory(8));
        put_back(&mut free, memory(9));
        put_back(&mut free, memory(8));
        assert_eq!(
            take_matching(&mut free, 8, false).map(|memory| memory.slots.len()),
            Some(8)
        );
        assert_eq!(
            free.iter()
                .map(|memory| memory.slots.len())
                .collect::<Vec<_>>(),
            [8, 9]
        );
        // Another technique that is interleaved with the first does not free its memory.
        assert!(take_matching(&mut free, 8, true).is_none() && free.len() == 1);
        put_back(
            &mut free,
            SlotMemory {
                splats: Some(SplatSums::new(8)),
                ..memory(8)
            },
        );
        assert!(
            take_matching(&mut free, 8, true).is_some_and(|memory| memory.splats.is_some())
                && free.len() == 1
        );
        assert!(take_matching(&mut free, 7, false).is_none() && free.is_empty());
    }

    #[test]
    fn the_pool_stays_within_its_limit() {
        let half = (MAX_KEPT_BYTES / BYTES_PER_SLOT / 2) as usize;
        // Nothing is written to them, so they take no physical memory.
        let large = || SlotMemory {
            slots: vec![Slot::default(); half],
            splats: None,
        };
        let mut free = Vec::new();
        (0..3).for_each(|_| put_back(&mut free, large()));
        assert_eq!(free.len(), 2);
        free.clear();
        put_back(
            &mut free,
            SlotMemory {
                splats: Some(SplatSums::new(half)),
                ..large()
            },
        );
        assert!(free.len() == 1 && free[0].splats.is_none());
    }

    #[test]
    fn reused_memory_is_cleared() {
        // A size that no other test uses.
        let slots = 3 * CLEAR_CHUNK + 17;
        for _ in 0..2 {
            let mut memory = SlotMemory::new(slots, true);
            assert_eq!(memory.slots.len(), slots);
            assert!(memory.slots.iter().all(|slot| *slot == Slot::default()));
            let splats = memory.splats.as_ref().unwrap();
            splats.for_each(|i, _, _| panic!("slot {i} has a splat"));
            assert!(splats.add(slots - 1, [1.0; 3]) && splats.sum(slots - 1) == [1.0; 3]);
            assert_eq!(
                splats.sum(slots - 2),
                [0.0; 3],
                "values written to map the memory are cleared"
            );
            memory.slots.fill(LIT);
            memory.recycle();
        }
    }
}
