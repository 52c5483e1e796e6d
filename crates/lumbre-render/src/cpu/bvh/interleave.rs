//! Traversal of several rays in turn, so that one ray's nodes arrive from memory while others are
//! tested.
//!
//! Invariant: each ray has the result of [`super::traverse`], which does not depend on the order in
//! which nodes are visited, and rays share nothing.

use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};

use super::accel::Accel;
use super::bvh8::{Block, LEAF, Node};
use super::intersect::ShearedRay;
use super::simd::{Avx2, Isa, LANES, Simd8};
use super::slabs::Slabs;
use super::stack::Stack;
use super::traverse::{BestHit, is_finite};
use lumbre_light::scene::compile::NONE;
use lumbre_light::transport::ray::{Hit, Ray};

/// Number of rays that are traversed in turn for their nearest hits. More of them gain where trees
/// are larger than the caches, and lose where they are not (docs/notes/rays.md).
const NEAREST_IN_TURN: usize = 2;

/// Number of rays that are traversed in turn for any hit.
const ANY_IN_TURN: usize = 4;

/// Size in bytes of the hierarchies from which rays are traversed in turn for any hit. Smaller ones
/// gain little, and some lose a quarter (docs/notes/rays.md).
const ANY_LEAST_BYTES: usize = 2 << 20;

/// Size of a cache line in bytes.
const CACHE_LINE: usize = 64;

/// Traversal of one ray, between two of its steps.
struct Flight<L> {
    index: usize,
    ray: Ray,
    sheared: ShearedRay,
    slabs: Slabs<L>,
    best: BestHit,
    stack: Stack,
    current: u32,
}

impl Accel {
    /// Returns whether many rays are traversed in turn, for any hit or for the nearest.
    pub(super) fn interleaves(&self, any: bool) -> bool {
        self.can_interleave() && (!any || self.bytes() >= ANY_LEAST_BYTES)
    }

    /// Returns whether rays can be traversed in turn.
    fn can_interleave(&self) -> bool {
        self.isa != Isa::Portable
            && self.compressed.is_none()
            && self.instances.is_empty()
            && self.root & LEAF == 0
    }

    /// Traces some of the rays and calls `done` with the index of each and its nearest hit within its
    /// distance, or with `ANY` any such hit. Leaves out rays with a component that is not finite, which hit
    /// nothing. [`Accel::interleaves`] must be true.
    pub(super) fn trace_interleaved<const ANY: bool>(
        &self,
        rays: &[(Ray, f32)],
        indices: &[u32],
        done: impl FnMut(usize, Option<Hit>),
    ) {
        assert!(self.can_interleave());
        #[expect(unsafe_code, reason = "calls a function compiled for AVX2")]
        // SAFETY: asserted above, and the processor has AVX2 if `isa` is not the portable one.
        unsafe {
            self.interleave_avx2::<ANY>(rays, indices, done)
        }
    }

    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt")]
    fn interleave_avx2<const ANY: bool>(
        &self,
        rays: &[(Ray, f32)],
        indices: &[u32],
        mut done: impl FnMut(usize, Option<Hit>),
    ) {
        let queries = indices.iter().map(|i| (*i as usize, &rays[*i as usize]));
        let mut waiting = queries.filter(|(_, (ray, _))| is_finite(ray));
        let in_turn = if ANY { ANY_IN_TURN } else { NEAREST_IN_TURN };
        let mut flights: Vec<Flight<Avx2>> = Vec::with_capacity(in_turn);
        while flights.len() < in_turn {
            let Some((index, query)) = waiting.next() else {
                break;
            };
            flights.push(Flight::new(self.root, index, query));
        }
        while !flights.is_empty() {
            let mut i = 0;
            while i < flights.len() {
                let flight = &mut flights[i];
                if self.step::<Avx2, ANY>(flight) {
                    i += 1;
                    continue;
                }
                done(flight.index, flight.best.hit);
                if let Some((index, query)) = waiting.next() {
                    flight.restart(self.root, index, query);
                    i += 1;
                } else {
                    flights.swap_remove(i);
                }
            }
        }
    }

    /// Visits one node or leaf. Returns whether the traversal continues.
    #[inline(always)]
    fn step<L: Simd8, const ANY: bool>(&self, flight: &mut Flight<L>) -> bool {
        let current = flight.current;
        if current & LEAF != 0 {
            let found = self.test_leaf::<L, ANY, false>(
                current & !LEAF,
                &flight.ray,
                &flight.sheared,
                NONE,
                &mut flight.best,
            );
            if ANY && found {
                return false;
            }
        } else {
            let node = &self.nodes[current as usize];
            let (hits, near) = flight.slabs.intersect(&node.bounds, flight.best.limit);
            if hits != 0 {
                let first = hits.trailing_zeros() as usize % LANES;
                let others = hits & (hits - 1);
                flight.current = if ANY {
                    flight.stack.push_children(current, others);
                    node.child[first]
                } else if others == 0 {
                    node.child[first]
                } else {
                    flight.stack.push_all_but_nearest(node, hits, &near.store())
                };
                self.prefetch(flight.current);
                return true;
            }
        }
        let next = if ANY {
            let popped = flight.stack.pop_child();
            popped.map(|(node, lane)| self.nodes[node as usize].child[lane])
        } else {
            flight.stack.pop(flight.best.limit)
        };
        let Some(next) = next else { return false };
        flight.current = next;
        self.prefetch(next);
        true
    }

    /// Asks for the cache lines of a node or of the first block of a leaf.
    #[inline(always)]
    #[expect(unsafe_code, reason = "prefetches memory, which reads nothing")]
    fn prefetch(&self, child: u32) {
        let (start, bytes) = if child & LEAF == 0 {
            let start = self.nodes.as_ptr().wrapping_add(child as usize);
            (start.cast::<i8>(), size_of::<Node>())
        } else {
            let start = self.blocks.as_ptr().wrapping_add((child & !LEAF) as usize);
            (start.cast::<i8>(), size_of::<Block>())
        };
        for line in (0..bytes).step_by(CACHE_LINE) {
            // SAFETY: prefetching any address is allowed.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(start.wrapping_add(line)) };
        }
    }
}

impl<L: Simd8> Flight<L> {
    #[inline(always)]
    fn new(root: u32, index: usize, (ray, t_max): &(Ray, f32)) -> Flight<L> {
        Flight {
            index,
            ray: *ray,
            sheared: ShearedRay::new(ray),
            slabs: Slabs::new(ray),
            best: BestHit::new(*t_max),
            stack: Stack::new(),
            current: root,
        }
    }

    /// Replaces the ray, without a copy of the stack.
    #[inline(always)]
    fn restart(&mut self, root: u32, index: usize, (ray, t_max): &(Ray, f32)) {
        self.index = index;
        self.ray = *ray;
        self.sheared = ShearedRay::new(ray);
        self.slabs = Slabs::new(ray);
        self.best = BestHit::new(*t_max);
        self.stack.clear();
        self.current = root;
    }
}
