//! The traversal loop of the CPU backend, compiled once for every instruction set.
//!
//! Invariant: the result does not depend on the order in which nodes are visited. Boxes are tested
//! conservatively, and ties in distance are resolved by the indices of the hits.

use super::accel::Accel;
use super::bvh8::{Block, INSTANCE, LEAF};
use super::compressed;
use super::instances;
use super::intersect;
use super::intersect::ShearedRay;
use super::packed::CwBvh;
#[cfg(target_arch = "x86_64")]
use super::simd::Isa;
use super::simd::{LANES, Portable, Simd8};
use super::slabs::Slabs;
use super::stack::Stack;
use lumbre_light::scene::compile::NONE;
use lumbre_light::transport::ray::{Hit, Ray, Trace};
use lumbre_light::transport::surface::is_masked_out;

/// Factor on the distance of the best hit, beyond which boxes are skipped. It is above 1 so that
/// rounding never skips a box with an equally near hit, whose indices may be less. Distances of
/// triangles that are much larger than the distance have the greatest errors.
pub(crate) const LIMIT_SLACK: f32 = 1.0 + 1.0 / (1 << 17) as f32;

/// Leaf in which the last of several rays found a hit, with the bit of leaves; zero if it found none.
/// The next ray tests it before the tree: shadow rays of one tile are often blocked by one object.
type LastOccluder = u32;

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

    /// Returns anything that one of several rays hits with `0 < t < t_max`, masks applied.
    #[inline]
    fn any_hit_after(&self, ray: &Ray, t_max: f32, last: &mut LastOccluder) -> Option<Hit> {
        match self.isa {
            _ if !self.instances.is_empty() || self.compressed.is_some() => {
                self.dispatch::<true>(ray, t_max)
            }
            #[cfg(target_arch = "x86_64")]
            #[expect(unsafe_code, reason = "calls a function compiled for AVX2")]
            // SAFETY: `isa` is AVX2 or AVX-512 only if the processor has it, and AVX-512 implies
            // AVX2.
            Isa::Avx2 | Isa::Avx512 => unsafe { self.any_hit_avx2(ray, t_max, last) },
            _ => self.any_hit_with::<Portable>(ray, t_max, last),
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt")]
    fn any_hit_avx2(&self, ray: &Ray, t_max: f32, last: &mut LastOccluder) -> Option<Hit> {
        self.any_hit_with::<crate::cpu::bvh::simd::Avx2>(ray, t_max, last)
    }

    #[inline(always)]
    fn any_hit_with<L: Simd8>(
        &self,
        ray: &Ray,
        t_max: f32,
        last: &mut LastOccluder,
    ) -> Option<Hit> {
        if *last != 0 && is_finite(ray) {
            let (leaf, sheared) = (*last & !LEAF, ShearedRay::new(ray));
            let mut best = BestHit::new(t_max);
            if self.test_leaf::<L, true, false>(leaf, ray, &sheared, NONE, &mut best) {
                return best.hit;
            }
        }
        self.traverse::<L, true, false>(ray, t_max, last)
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
            _ => self.traverse::<Portable, ANY, false>(ray, t_max, &mut 0),
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
            _ => self.traverse::<Portable, ANY, true>(ray, t_max, &mut 0),
        }
    }

    /// Does the same with the compressed tree.
    #[inline(never)]
    fn dispatch_compressed<const ANY: bool>(
        &self,
        tree: &CwBvh,
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
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt")]
    fn traverse_compressed_avx2<const ANY: bool>(
        &self,
        tree: &CwBvh,
        ray: &Ray,
        t_max: f32,
    ) -> Option<Hit> {
        self.traverse_compressed::<crate::cpu::bvh::simd::Avx2, ANY>(tree, ray, t_max)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt")]
    fn traverse_avx2<const ANY: bool, const INSTANCES: bool>(
        &self,
        ray: &Ray,
        t_max: f32,
    ) -> Option<Hit> {
        self.traverse::<crate::cpu::bvh::simd::Avx2, ANY, INSTANCES>(ray, t_max, &mut 0)
    }

    /// Returns the hit of a ray that goes on alone at a node or leaf: the nearest one up to `t`, or
    /// with `ANY` any, else the one that is `known` at `t`. For hierarchies without instances.
    #[cfg(target_arch = "x86_64")]
    #[inline]
    pub(super) fn continue_from<const ANY: bool>(
        &self,
        from: u32,
        ray: &Ray,
        t: f32,
        known: Option<Hit>,
    ) -> Option<Hit> {
        let best = BestHit {
            hit: known,
            ..BestHit::new(t)
        };
        match self.isa {
            #[expect(unsafe_code, reason = "calls a function compiled for AVX2")]
            // SAFETY: `isa` is AVX2 or AVX-512 only if the processor has it, and AVX-512 implies
            // AVX2.
            Isa::Avx2 | Isa::Avx512 => unsafe { self.walk_avx2::<ANY>(from, ray, best) },
            _ => self.walk::<Portable, ANY, false>(from, ray, best, &mut 0),
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt")]
    fn walk_avx2<const ANY: bool>(&self, from: u32, ray: &Ray, best: BestHit) -> Option<Hit> {
        self.walk::<crate::cpu::bvh::simd::Avx2, ANY, false>(from, ray, best, &mut 0)
    }

    /// Returns the hit of a ray in a block: the nearest one up to `t`, or with `ANY` any, else the one
    /// that is `known` at `t`.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub(super) fn hit_in_block<L: Simd8, const ANY: bool>(
        &self,
        block: &Block,
        ray: &Ray,
        t: f32,
        known: Option<Hit>,
    ) -> Option<Hit> {
        let mut best = BestHit {
            hit: known,
            ..BestHit::new(t)
        };
        self.test_block::<L, ANY, false>(block, ray, &ShearedRay::new(ray), NONE, &mut best);
        best.hit
    }

    /// Runs the traversal loop. Returns any hit with `ANY`, and the nearest one otherwise. With
    /// `INSTANCES` it also traverses the trees of instances, with the ray transformed into their
    /// mesh's space. `last` becomes the leaf of the hit.
    #[inline(always)]
    fn traverse<L: Simd8, const ANY: bool, const INSTANCES: bool>(
        &self,
        ray: &Ray,
        t_max: f32,
        last: &mut LastOccluder,
    ) -> Option<Hit> {
        // With NaN every box test would succeed, even for missing children.
        if !is_finite(ray) {
            return None;
        }
        self.walk::<L, ANY, INSTANCES>(self.root, ray, BestHit::new(t_max), last)
    }

    /// Runs the loop from a node or leaf on, for a ray whose best hit so far is known.
    #[inline(always)]
    fn walk<L: Simd8, const ANY: bool, const INSTANCES: bool>(
        &self,
        from: u32,
        ray: &Ray,
        mut best: BestHit,
        last: &mut LastOccluder,
    ) -> Option<Hit> {
        let mut sheared = ShearedRay::new(ray);
        if from & LEAF != 0 && !INSTANCES {
            self.test_leaf::<L, ANY, false>(from & !LEAF, ray, &sheared, NONE, &mut best);
            return best.hit;
        }
        let mut slabs = Slabs::<L>::new(ray);
        let mut instance = NONE;
        let mut stack = Stack::new();
        let mut current = from;
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
                    *last = current;
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
                        current = stack.push_all_but_nearest(node, hits, &near.store());
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
                None => {
                    *last = 0;
                    return best.hit;
                }
            }
        }
    }

    /// Tests the ray against the blocks of a leaf and returns whether a better hit was found. With
    /// `ANY` it returns at the first hit.
    #[inline(always)]
    pub(super) fn test_leaf<L: Simd8, const ANY: bool, const INSTANCES: bool>(
        &self,
        first: u32,
        ray: &Ray,
        sheared: &ShearedRay,
        instance: u32,
        best: &mut BestHit,
    ) -> bool {
        let mut better = false;
        for block in &self.blocks[first as usize..] {
            better |= self.test_block::<L, ANY, INSTANCES>(block, ray, sheared, instance, best);
            if ANY && better {
                return true;
            }
            if block.last {
                break;
            }
        }
        better
    }

    /// Does the same with one block.
    #[inline(always)]
    fn test_block<L: Simd8, const ANY: bool, const INSTANCES: bool>(
        &self,
        block: &Block,
        ray: &Ray,
        sheared: &ShearedRay,
        instance: u32,
        best: &mut BestHit,
    ) -> bool {
        let mut better = false;
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
        tree: &CwBvh,
        ray: &Ray,
        t_max: f32,
    ) -> Option<Hit> {
        if !is_finite(ray) {
            return None;
        }
        let mut best = BestHit::new(t_max);
        let sheared = ShearedRay::new(ray);
        let scene = &self.scene;
        compressed::traverse::<L, ANY>(tree, ray, best.limit, |primitive| {
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

impl Accel {
    /// Returns the indices of all rays: packets are compiled for the instructions of x86-64.
    #[cfg(not(target_arch = "x86_64"))]
    fn trace_packets<const ANY: bool>(
        &self,
        rays: &[(Ray, f32)],
        _: impl FnMut(usize, Option<Hit>),
    ) -> Vec<u32> {
        (0..rays.len() as u32).collect()
    }

    /// Traces some of the rays one by one or a few in turn, and calls `done` with the index of each
    /// and its nearest hit, or with `ANY` any hit.
    fn trace_alone<const ANY: bool>(
        &self,
        rays: &[(Ray, f32)],
        indices: &[u32],
        mut done: impl FnMut(usize, Option<Hit>),
    ) {
        #[cfg(target_arch = "x86_64")]
        if self.interleaves(ANY) {
            return self.trace_interleaved::<ANY>(rays, indices, done);
        }
        let mut last = 0;
        for i in indices {
            let (ray, t_max) = &rays[*i as usize];
            let hit = if ANY {
                self.any_hit_after(ray, *t_max, &mut last)
            } else {
                self.closest(ray, *t_max)
            };
            done(*i as usize, hit);
        }
    }
}

/// Returns whether all components of a ray are finite.
#[inline(always)]
pub(super) fn is_finite(ray: &Ray) -> bool {
    (ray.origin + ray.dir).element_sum().is_finite()
}

/// Best hit so far.
pub(super) struct BestHit {
    pub hit: Option<Hit>,
    /// Distance of the hit, or the maximum distance of the ray without a hit.
    t: f32,
    /// Distance beyond which boxes are skipped; `t` times [`LIMIT_SLACK`].
    pub limit: f32,
}

impl BestHit {
    #[inline(always)]
    pub fn new(t_max: f32) -> BestHit {
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

impl Trace for Accel {
    fn closest_each(&self, rays: &[(Ray, f32)], hits: &mut Vec<Option<Hit>>) {
        let first = hits.len();
        hits.resize(first + rays.len(), None);
        let alone = self.trace_packets::<false>(rays, |i, hit| hits[first + i] = hit);
        self.trace_alone::<false>(rays, &alone, |i, hit| hits[first + i] = hit);
    }

    fn occluded_each(&self, rays: &[(Ray, f32)], hidden: &mut Vec<bool>) {
        let first = hidden.len();
        hidden.resize(first + rays.len(), false);
        let alone = self.trace_packets::<true>(rays, |i, hit| hidden[first + i] = hit.is_some());
        self.trace_alone::<true>(rays, &alone, |i, hit| hidden[first + i] = hit.is_some());
    }

    fn closest(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        Accel::closest(self, ray, t_max)
    }

    fn occluded(&self, ray: &Ray, t_max: f32) -> bool {
        Accel::occluded(self, ray, t_max)
    }
}
