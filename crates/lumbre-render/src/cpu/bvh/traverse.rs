//! The traversal loop of the CPU backend, compiled once for every instruction set.
//!
//! Invariant: the result does not depend on the order in which nodes are visited. Boxes are tested
//! conservatively, and ties in distance are resolved by the indices of the hits.

use std::mem::MaybeUninit;

use super::accel::{Accel, STACK};
use super::bvh8::{INSTANCE, LEAF, Node};
use super::instances;
use super::intersect;
use super::intersect::ShearedRay;
use super::packed::PackedTree;
use super::simd::{Isa, LANES, LaneArray, Portable, Simd8};
use lumbre_light::scene::compile::NONE;
use lumbre_light::transport::ray::{Hit, Ray, Trace};
use lumbre_light::transport::surface::is_masked_out;

/// Factor on the far distance of a slab test, so that no box is missed because of rounding [Ize
/// 2013].
const SLAB_SLACK: f32 = 1.000_000_5;

/// Factor on the distance of the best hit, beyond which boxes are skipped. It is above 1 so that
/// rounding never skips a box with an equally near hit, whose indices may be less. Distances of
/// triangles that are much larger than the distance have the greatest errors.
const LIMIT_SLACK: f32 = 1.0 + 1.0 / (1 << 17) as f32;

/// Stack entry that marks the end of an instance's tree, after which traversal returns to world
/// space. No node, leaf or instance has this number.
const RETURN_TO_WORLD: u32 = u32::MAX;

impl Accel {
    /// Returns the nearest hit with `0 < t < t_max`, masks applied. Of hits at the same distance it
    /// returns the one with the lesser instance, then primitive. A ray with a component that is not
    /// finite hits nothing.
    #[inline]
    pub fn closest(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        self.dispatch::<false>(ray, t_max)
    }

    /// Returns whether anything is hit with `0 < t < t_max`, masks applied.
    #[inline]
    pub fn occluded(&self, ray: &Ray, t_max: f32) -> bool {
        self.dispatch::<true>(ray, t_max).is_some()
    }

    #[inline]
    fn dispatch<const ANY: bool>(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        if !self.instances.is_empty() {
            return self.dispatch_with_instances::<ANY>(ray, t_max);
        }
        if let Some(tree) = &self.compressed {
            return self.dispatch_compressed::<ANY>(tree, ray, t_max);
        }
        match self.isa {
            #[cfg(target_arch = "x86_64")]
            #[expect(unsafe_code, reason = "calls a function compiled for AVX2")]
            // SAFETY: `isa` is AVX2 or AVX-512 only if the processor has it, and AVX-512 implies
            // AVX2.
            Isa::Avx2 | Isa::Avx512 => unsafe { self.traverse_avx2::<ANY, false>(ray, t_max) },
            _ => self.traverse::<Portable, ANY, false>(ray, t_max),
        }
    }

    /// Does the same in scenes with instances. A separate function, so that instances cost nothing
    /// in scenes without them.
    #[inline(never)]
    fn dispatch_with_instances<const ANY: bool>(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        match self.isa {
            #[cfg(target_arch = "x86_64")]
            #[expect(unsafe_code, reason = "calls a function compiled for AVX2")]
            // SAFETY: `isa` is AVX2 or AVX-512 only if the processor has it, and AVX-512 implies
            // AVX2.
            Isa::Avx2 | Isa::Avx512 => unsafe { self.traverse_avx2::<ANY, true>(ray, t_max) },
            _ => self.traverse::<Portable, ANY, true>(ray, t_max),
        }
    }

    /// Does the same with the compressed tree.
    #[inline(never)]
    fn dispatch_compressed<const ANY: bool>(
        &self,
        tree: &PackedTree,
        ray: &Ray,
        t_max: f32,
    ) -> Option<Hit> {
        match self.isa {
            #[cfg(target_arch = "x86_64")]
            #[expect(unsafe_code, reason = "calls a function compiled for AVX2")]
            // SAFETY: `isa` is AVX2 or AVX-512 only if the processor has it, and AVX-512 implies
            // AVX2.
            Isa::Avx2 | Isa::Avx512 => unsafe {
                self.traverse_compressed_avx2::<ANY>(tree, ray, t_max)
            },
            _ => self.traverse_compressed::<Portable, ANY>(tree, ray, t_max),
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    fn traverse_compressed_avx2<const ANY: bool>(
        &self,
        tree: &PackedTree,
        ray: &Ray,
        t_max: f32,
    ) -> Option<Hit> {
        self.traverse_compressed::<crate::cpu::bvh::simd::Avx2, ANY>(tree, ray, t_max)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    fn traverse_avx2<const ANY: bool, const INSTANCES: bool>(
        &self,
        ray: &Ray,
        t_max: f32,
    ) -> Option<Hit> {
        self.traverse::<crate::cpu::bvh::simd::Avx2, ANY, INSTANCES>(ray, t_max)
    }

    /// Runs the traversal loop. Returns any hit with `ANY`, and the nearest one otherwise. With
    /// `INSTANCES` it also traverses the trees of instances, with the ray transformed into their
    /// mesh's space.
    #[inline(always)]
    fn traverse<L: Simd8, const ANY: bool, const INSTANCES: bool>(
        &self,
        ray: &Ray,
        t_max: f32,
    ) -> Option<Hit> {
        // With NaN every box test would succeed, even for missing children.
        if !(ray.origin + ray.dir).element_sum().is_finite() {
            return None;
        }
        let mut best = BestHit::new(t_max);
        let mut sheared = ShearedRay::new(ray);
        if self.root & LEAF != 0 && !INSTANCES {
            self.test_leaf::<L, ANY, false>(self.root & !LEAF, ray, &sheared, NONE, &mut best);
            return best.hit;
        }
        let mut slabs = Slabs::<L>::new(ray);
        let mut instance = NONE;
        let mut stack = Stack::new();
        let mut current = self.root;
        loop {
            if current & LEAF != 0 {
                if INSTANCES && current == RETURN_TO_WORLD {
                    (sheared, slabs, instance) = (ShearedRay::new(ray), Slabs::new(ray), NONE);
                } else if INSTANCES && current & INSTANCE != 0 {
                    instance = current & !(LEAF | INSTANCE);
                    let mesh = &self.instances[instance as usize];
                    let local = mesh.to_mesh_space(ray);
                    (sheared, slabs) = (ShearedRay::new(&local), Slabs::new(&local));
                    if ANY {
                        stack.push_children(RETURN_TO_WORLD, 1);
                    } else {
                        // Its distance is below every limit, so it is never skipped.
                        stack.push(RETURN_TO_WORLD, f32::NEG_INFINITY);
                    }
                    current = mesh.root;
                    continue;
                } else if self.test_leaf::<L, ANY, INSTANCES>(
                    current & !LEAF,
                    ray,
                    &sheared,
                    instance,
                    &mut best,
                ) && ANY
                {
                    return best.hit;
                }
            } else {
                let node = &self.nodes[current as usize];
                let (hits, near) = slabs.intersect(&node.bounds, best.limit);
                if hits != 0 {
                    let first = hits.trailing_zeros() as usize % LANES;
                    let others = hits & (hits - 1);
                    if ANY {
                        // Any hit ends the search, so the order is irrelevant.
                        stack.push_children(current, others);
                        current = node.child[first];
                    } else if others == 0 {
                        current = node.child[first];
                    } else {
                        current = stack.push_all_but_nearest(node, first, others, &near.store());
                    }
                    continue;
                }
            }
            let next = if ANY {
                stack.pop_child().map(|(node, lane)| {
                    if INSTANCES && node == RETURN_TO_WORLD {
                        node
                    } else {
                        self.nodes[node as usize].child[lane]
                    }
                })
            } else {
                stack.pop(best.limit)
            };
            match next {
                Some(next) => current = next,
                None => return best.hit,
            }
        }
    }

    /// Tests the ray against the blocks of a leaf and returns whether a better hit was found. With
    /// `ANY` it returns at the first hit.
    #[inline(always)]
    fn test_leaf<L: Simd8, const ANY: bool, const INSTANCES: bool>(
        &self,
        first: u32,
        ray: &Ray,
        sheared: &ShearedRay,
        instance: u32,
        best: &mut BestHit,
    ) -> bool {
        let mut better = false;
        for block in &self.blocks[first as usize..] {
            // Distances in an instance's space are approximate, so candidates are accepted up to
            // the wider limit.
            let within = if INSTANCES && instance != NONE {
                best.limit
            } else {
                best.t
            };
            let found = block.triangles.intersect::<L>(sheared, within);
            let mut lanes = found.lanes | block.spheres;
            if lanes != 0 {
                let distances = found.t();
                while lanes != 0 {
                    let lane = lanes.trailing_zeros() as usize % LANES;
                    lanes &= lanes - 1;
                    let primitive = block.primitives[lane];
                    let (t, uv) = if block.spheres & (1 << lane) != 0 {
                        let sphere =
                            &self.scene.spheres[primitive as usize - self.scene.triangles.len()];
                        let Some(t) = intersect::sphere(sphere, ray, best.t) else {
                            continue;
                        };
                        (t, [0.0; 2])
                    } else if INSTANCES && instance != NONE {
                        let t = instances::distance(&self.scene, ray, primitive, instance);
                        if !(t > 0.0 && t <= best.t) {
                            continue;
                        }
                        (t, found.uv(lane))
                    } else if distances.0[lane] <= best.t {
                        (distances.0[lane], found.uv(lane))
                    } else {
                        continue;
                    };
                    let hit = Hit {
                        t,
                        primitive,
                        instance,
                        uv,
                    };
                    let masked = block.masked & (1 << lane) != 0;
                    better |= self.accept(ray, hit, masked, best)
                        || masked && self.accept_exit(ray, hit, best);
                    if ANY && better {
                        return true;
                    }
                }
            }
            if block.last {
                break;
            }
        }
        better
    }

    /// Accepts the hit at which the ray leaves a sphere, after its mask has removed `entry`. Returns
    /// whether it was accepted; false for triangles.
    fn accept_exit(&self, ray: &Ray, entry: Hit, best: &mut BestHit) -> bool {
        let sphere = (entry.primitive as usize).checked_sub(self.scene.triangles.len());
        sphere
            .and_then(|i| intersect::sphere_exit(&self.scene.spheres[i], ray, best.t))
            .is_some_and(|t| self.accept(ray, Hit { t, ..entry }, true, best))
    }

    /// Accepts a hit with `t <= best.t`, unless it loses a tie or a mask removes it. `masked` is
    /// false only if the material has no mask. Returns whether it was accepted.
    #[inline(always)]
    fn accept(&self, ray: &Ray, hit: Hit, masked: bool, best: &mut BestHit) -> bool {
        if hit.t == best.t && !best.loses_tie_to(&hit)
            || masked && is_masked_out(&self.scene, ray, &hit)
        {
            return false;
        }
        best.t = hit.t;
        best.limit = hit.t * LIMIT_SLACK;
        best.hit = Some(hit);
        true
    }

    /// Traverses the compressed tree.
    #[inline(always)]
    fn traverse_compressed<L: Simd8, const ANY: bool>(
        &self,
        tree: &PackedTree,
        ray: &Ray,
        t_max: f32,
    ) -> Option<Hit> {
        if !(ray.origin + ray.dir).element_sum().is_finite() {
            return None;
        }
        let mut best = BestHit::new(t_max);
        let sheared = ShearedRay::new(ray);
        let scene = &self.scene;
        tree.traverse::<L, ANY>(ray, best.limit, |primitive| {
            let (t, uv) = match scene.triangles.get(primitive as usize) {
                Some(corners) => intersect::triangle(corners, &sheared, best.t)?,
                None => {
                    let sphere = &scene.spheres[primitive as usize - scene.triangles.len()];
                    (intersect::sphere(sphere, ray, best.t)?, [0.0; 2])
                }
            };
            let hit = Hit {
                t,
                primitive,
                instance: NONE,
                uv,
            };
            let accepted = self.accept(ray, hit, self.masked, &mut best)
                || self.masked && self.accept_exit(ray, hit, &mut best);
            accepted.then_some(best.limit)
        });
        best.hit
    }
}

/// Best hit so far.
struct BestHit {
    hit: Option<Hit>,
    /// Distance of the hit, or the maximum distance of the ray without a hit.
    t: f32,
    /// Distance beyond which boxes are skipped; `t` times [`LIMIT_SLACK`].
    limit: f32,
}

impl BestHit {
    #[inline(always)]
    fn new(t_max: f32) -> BestHit {
        BestHit {
            hit: None,
            t: t_max,
            limit: t_max * LIMIT_SLACK,
        }
    }

    /// Returns whether `hit` replaces this one, which is at the same distance: its indices must be
    /// less. False without a hit, since the ray's end is excluded.
    #[inline(always)]
    fn loses_tie_to(&self, hit: &Hit) -> bool {
        self.hit
            .is_some_and(|best| (hit.instance, hit.primitive) < (best.instance, best.primitive))
    }
}

/// Returns the inverse of a component of a direction. A zero component would give 0 * inf = NaN on
/// a box's plane. A tiny one gives the same result and stays finite.
#[inline(always)]
pub(super) fn nonzero_inverse(d: f32) -> f32 {
    1.0 / if d.abs() < 1e-20 {
        1e-20f32.copysign(d)
    } else {
        d
    }
}

/// Returns a component of the origin for the distances at which a ray leaves boxes. If it does not
/// move along this axis, it stays inside a box whose bound it lies in, but with the tiny component
/// of [`nonzero_inverse`] it would leave at distance 0. So it begins a little further inside.
#[inline(always)]
fn exit_origin(o: f32, d: f32) -> f32 {
    if d.abs() < 1e-20 {
        // At least 1e-7, so that the distance is at least 1e13, and a unit in the last place.
        o - (1e-7 + o.abs() * 1.2e-7).copysign(d)
    } else {
        o
    }
}

/// Ray with the precomputed values of the box test.
struct Slabs<L> {
    /// Origin for the distances at which the ray enters boxes.
    origin: [L; 3],
    /// Origin for the distances at which the ray leaves boxes; see [`exit_origin`].
    exit_origin: [L; 3],
    inverse: [L; 3],
    /// Index of the bound that the ray meets first on each axis: 0 for the least, 1 for the
    /// greatest.
    first: [usize; 3],
}

impl<L: Simd8> Slabs<L> {
    #[inline(always)]
    fn new(ray: &Ray) -> Slabs<L> {
        let (o, d) = (ray.origin, ray.dir);
        let (x, y, z) = (
            nonzero_inverse(d.x),
            nonzero_inverse(d.y),
            nonzero_inverse(d.z),
        );
        Slabs {
            origin: [L::splat(o.x), L::splat(o.y), L::splat(o.z)],
            exit_origin: [
                L::splat(exit_origin(o.x, d.x)),
                L::splat(exit_origin(o.y, d.y)),
                L::splat(exit_origin(o.z, d.z)),
            ],
            inverse: [L::splat(x), L::splat(y), L::splat(z)],
            first: [
                usize::from(x < 0.0),
                usize::from(y < 0.0),
                usize::from(z < 0.0),
            ],
        }
    }

    /// Returns a bit mask of the boxes that the ray meets before `t_max`, and the distances at
    /// which it enters them.
    #[inline(always)]
    fn intersect(&self, bounds: &[[LaneArray; 3]; 2], t_max: f32) -> (u32, L) {
        let [x, y, z] = self.first;
        let near = self
            .enter(bounds, x, 0)
            .max(self.enter(bounds, y, 1))
            .max(self.enter(bounds, z, 2));
        let far = self
            .leave(bounds, 1 - x, 0)
            .min(self.leave(bounds, 1 - y, 1))
            .min(self.leave(bounds, 1 - z, 2));
        let near = near.max(L::splat(0.0));
        (
            near.le(far.mul(L::splat(SLAB_SLACK)).min(L::splat(t_max))),
            near,
        )
    }

    /// Returns the distances to the bound of all boxes on one axis that the ray meets first.
    #[inline(always)]
    fn enter(&self, bounds: &[[LaneArray; 3]; 2], bound: usize, axis: usize) -> L {
        L::load(&bounds[bound][axis])
            .sub(self.origin[axis])
            .mul(self.inverse[axis])
    }

    /// Returns the distances to the other bound.
    #[inline(always)]
    fn leave(&self, bounds: &[[LaneArray; 3]; 2], bound: usize, axis: usize) -> L {
        L::load(&bounds[bound][axis])
            .sub(self.exit_origin[axis])
            .mul(self.inverse[axis])
    }
}

/// Traversal stack. For the nearest hit its entries are children, each with the distance at which
/// the ray enters its box; for any hit they are nodes, each with the mask of the children that are
/// still to be visited.
struct Stack {
    entries: [MaybeUninit<(u32, f32)>; STACK],
    depth: usize,
}

#[expect(unsafe_code, reason = "uninitialised entries are never read")]
impl Stack {
    #[inline(always)]
    fn new() -> Stack {
        Stack {
            entries: [const { MaybeUninit::uninit() }; STACK],
            depth: 0,
        }
    }

    #[inline(always)]
    fn push(&mut self, child: u32, near: f32) {
        self.entries[self.depth].write((child, near));
        self.depth += 1;
    }

    /// Pushes the children of a node in the lanes of a mask, in one entry; nothing if the mask is
    /// zero. There is no branch, which the processor could not predict.
    #[inline(always)]
    fn push_children(&mut self, node: u32, lanes: u32) {
        self.entries[self.depth].write((node, f32::from_bits(lanes)));
        self.depth += usize::from(lanes != 0);
    }

    /// Pops one child of an entry of [`Stack::push_children`]: its node and its lane.
    #[inline(always)]
    fn pop_child(&mut self) -> Option<(u32, usize)> {
        let top = self.depth.checked_sub(1)?;
        // SAFETY: every entry below the depth was written when the depth passed it.
        let (node, lanes) = unsafe { self.entries[top].assume_init() };
        let lanes = lanes.to_bits();
        let others = lanes & lanes.wrapping_sub(1);
        self.entries[top].write((node, f32::from_bits(others)));
        self.depth -= usize::from(others == 0);
        Some((node, lanes.trailing_zeros() as usize % LANES))
    }

    /// Pushes the children of a node in lane `first` and in the lanes of the mask `others`, the
    /// farthest first, except for the nearest one, which it returns.
    #[inline(always)]
    fn push_all_but_nearest(
        &mut self,
        node: &Node,
        first: usize,
        mut others: u32,
        near: &LaneArray,
    ) -> u32 {
        let second = others.trailing_zeros() as usize % LANES;
        others &= others - 1;
        if others == 0 {
            let swapped = near.0[second] < near.0[first];
            let (nearer, farther) = if swapped {
                (second, first)
            } else {
                (first, second)
            };
            self.push(node.child[farther], near.0[farther]);
            return node.child[nearer];
        }
        let base = self.depth;
        self.push(node.child[first], near.0[first]);
        self.insert(base, node.child[second], near.0[second]);
        while others != 0 {
            let lane = others.trailing_zeros() as usize % LANES;
            others &= others - 1;
            self.insert(base, node.child[lane], near.0[lane]);
        }
        self.pop_top()
    }

    /// Inserts a child below the nearer ones of the entries from `base` on.
    #[inline(always)]
    fn insert(&mut self, base: usize, child: u32, near: f32) {
        let mut index = self.depth;
        self.depth += 1;
        while index > base {
            // SAFETY: the entry is below the previous depth, so it was written.
            let before = unsafe { self.entries[index - 1].assume_init() };
            if before.1 >= near {
                break;
            }
            self.entries[index].write(before);
            index -= 1;
        }
        self.entries[index].write((child, near));
    }

    /// Pops the top entry; the stack must not be empty.
    #[inline(always)]
    fn pop_top(&mut self) -> u32 {
        self.depth -= 1;
        // SAFETY: every entry below the depth was written when the depth passed it.
        unsafe { self.entries[self.depth].assume_init() }.0
    }

    /// Pops entries until the box of one begins before `t_max`, and returns that one.
    #[inline(always)]
    fn pop(&mut self, t_max: f32) -> Option<u32> {
        while self.depth > 0 {
            self.depth -= 1;
            // SAFETY: as in `pop_top`.
            let (child, near) = unsafe { self.entries[self.depth].assume_init() };
            if near < t_max {
                return Some(child);
            }
        }
        None
    }
}

impl Trace for Accel {
    fn closest(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        Accel::closest(self, ray, t_max)
    }

    fn occluded(&self, ray: &Ray, t_max: f32) -> bool {
        Accel::occluded(self, ray, t_max)
    }
}
