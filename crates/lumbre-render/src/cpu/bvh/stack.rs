//! Stack of the traversal loop.

use std::mem::MaybeUninit;

use super::accel::STACK;
use super::bvh8::Node;
use super::simd::{LANES, LaneArray};

/// Child in the lower half and the bits of the distance of its box, which is not negative, in the
/// upper half. Such numbers have the order of the distances.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
struct Entry(u64);

impl Entry {
    #[inline(always)]
    fn new(child: u32, key: u32) -> Entry {
        Entry(u64::from(key) << 32 | u64::from(child))
    }

    /// Removes the first lane of a mask and returns its child with the distance of its box.
    #[inline(always)]
    fn take(node: &Node, lanes: &mut u32, near: &LaneArray) -> Entry {
        let lane = lanes.trailing_zeros() as usize % LANES;
        *lanes &= lanes.wrapping_sub(1);
        Entry::new(node.child[lane], near.0[lane].to_bits())
    }

    #[inline(always)]
    fn child(self) -> u32 {
        self.0 as u32
    }

    /// Returns the child and the key, as the stack stores them.
    #[inline(always)]
    fn halves(self) -> [u32; 2] {
        [self.child(), (self.0 >> 32) as u32]
    }

    /// Returns the nearer and the farther one of two entries.
    #[inline(always)]
    fn sort(self, other: Entry) -> (Entry, Entry) {
        (Entry(self.0.min(other.0)), Entry(self.0.max(other.0)))
    }
}

/// Traversal stack. For the nearest hit its entries are children, each with the distance at which
/// the ray enters its box; for any hit they are nodes, each with the mask of the children that are
/// still to be visited.
pub(super) struct Stack {
    entries: [MaybeUninit<[u32; 2]>; STACK],
    depth: usize,
}

#[expect(unsafe_code, reason = "uninitialised entries are never read")]
impl Stack {
    #[inline(always)]
    pub fn new() -> Stack {
        Stack {
            entries: [const { MaybeUninit::uninit() }; STACK],
            depth: 0,
        }
    }

    /// Removes all entries.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub fn clear(&mut self) {
        self.depth = 0;
    }

    #[inline(always)]
    pub fn push(&mut self, child: u32, near: f32) {
        self.push_entry(Entry::new(child, near.to_bits()));
    }

    /// Pushes the children of a node in the lanes of a mask, in one entry; nothing if the mask is
    /// zero. There is no branch, which the processor could not predict.
    #[inline(always)]
    pub fn push_children(&mut self, node: u32, lanes: u32) {
        self.entries[self.depth].write([node, lanes]);
        self.depth += usize::from(lanes != 0);
    }

    /// Pops one child of an entry of [`Stack::push_children`]: its node and its lane.
    #[inline(always)]
    pub fn pop_child(&mut self) -> Option<(u32, usize)> {
        let top = self.depth.checked_sub(1)?;
        // SAFETY: every entry below the depth was written when the depth passed it.
        let [node, lanes] = unsafe { self.entries[top].assume_init() };
        let others = lanes & lanes.wrapping_sub(1);
        self.entries[top].write([node, others]);
        self.depth -= usize::from(others == 0);
        Some((node, lanes.trailing_zeros() as usize % LANES))
    }

    /// Pushes the children of a node in the lanes of a mask of at least two, the farthest first,
    /// except for the nearest one, which it returns. Up to four are sorted by exchanges without
    /// branches, which the processor could not predict.
    #[inline(always)]
    pub fn push_all_but_nearest(&mut self, node: &Node, mut lanes: u32, near: &LaneArray) -> u32 {
        let a = Entry::take(node, &mut lanes, near);
        let b = Entry::take(node, &mut lanes, near);
        let (a, b) = a.sort(b);
        if lanes == 0 {
            self.push_entry(b);
            return a.child();
        }
        let c = Entry::take(node, &mut lanes, near);
        if lanes == 0 {
            let (b, c) = b.sort(c);
            let (a, b) = a.sort(b);
            self.push_entry(c);
            self.push_entry(b);
            return a.child();
        }
        let d = Entry::take(node, &mut lanes, near);
        let (c, d) = c.sort(d);
        let (a, c) = a.sort(c);
        let (b, d) = b.sort(d);
        let (b, c) = b.sort(c);
        let base = self.depth;
        self.push_entry(d);
        self.push_entry(c);
        self.push_entry(b);
        if lanes == 0 {
            return a.child();
        }
        self.push_entry(a);
        while lanes != 0 {
            self.insert(base, Entry::take(node, &mut lanes, near));
        }
        self.depth -= 1;
        // SAFETY: every entry below the previous depth was written.
        let [child, _] = unsafe { self.entries[self.depth].assume_init() };
        child
    }

    #[inline(always)]
    fn push_entry(&mut self, entry: Entry) {
        self.entries[self.depth].write(entry.halves());
        self.depth += 1;
    }

    /// Inserts an entry below the nearer ones of the entries from `base` on.
    #[inline(always)]
    fn insert(&mut self, base: usize, entry: Entry) {
        let mut index = self.depth;
        self.depth += 1;
        while index > base {
            // SAFETY: the entry is below the previous depth, so it was written.
            let [child, key] = unsafe { self.entries[index - 1].assume_init() };
            let before = Entry::new(child, key);
            if before >= entry {
                break;
            }
            self.entries[index].write(before.halves());
            index -= 1;
        }
        self.entries[index].write(entry.halves());
    }

    /// Pops entries until the box of one begins before `t_max`, and returns that one.
    #[inline(always)]
    pub fn pop(&mut self, t_max: f32) -> Option<u32> {
        while self.depth > 0 {
            self.depth -= 1;
            // SAFETY: every entry below the previous depth was written.
            let [child, near] = unsafe { self.entries[self.depth].assume_init() };
            if f32::from_bits(near) < t_max {
                return Some(child);
            }
        }
        None
    }
}
