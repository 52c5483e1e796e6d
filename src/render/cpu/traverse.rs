//! The one traversal loop of the CPU backend, compiled once for every set of instructions.

use std::mem::MaybeUninit;

use super::accel::{Accel, LEAF, STACK};
use super::intersect::{self, ShearedRay};
use super::lanes::{Isa, LANES, Lanes, Portable, Row};
use crate::transport::ray::{Hit, Ray, Trace};
use crate::transport::surface::is_masked_out;

/// Widens the far end of a slab test so that rounding never loses a box [Ize 2013].
const SLAB_SLACK: f32 = 1.000_000_5;

impl Accel {
    /// The nearest hit with `0 < t < t_max`, masks applied. Of hits at the same distance it is the same for every set of
    /// instructions. A ray with a number that is not finite hits nothing.
    #[inline]
    pub fn closest(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        self.dispatch::<false>(ray, t_max)
    }

    /// Whether anything is hit with `0 < t < t_max`, masks applied.
    #[inline]
    pub fn occluded(&self, ray: &Ray, t_max: f32) -> bool {
        self.dispatch::<true>(ray, t_max).is_some()
    }

    #[inline]
    fn dispatch<const ANY: bool>(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        match self.isa {
            #[cfg(target_arch = "x86_64")]
            #[expect(unsafe_code, reason = "a function that is compiled for AVX2")]
            // SAFETY: an accel says AVX2 only where the processor has it.
            Isa::Avx2 => unsafe { self.traverse_avx2::<ANY>(ray, t_max) },
            _ => self.traverse::<Portable, ANY>(ray, t_max),
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    fn traverse_avx2<const ANY: bool>(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        self.traverse::<super::lanes::Avx2, ANY>(ray, t_max)
    }

    /// The traversal loop. With `ANY` it returns at the first hit, otherwise at the nearest.
    #[inline(always)]
    fn traverse<L: Lanes, const ANY: bool>(&self, ray: &Ray, mut t_max: f32) -> Option<Hit> {
        // With NaN in it every box would seem to be met, those of children that are not there too.
        if !(ray.origin + ray.dir).element_sum().is_finite() {
            return None;
        }
        let sheared = ShearedRay::new(ray);
        if self.root & LEAF != 0 {
            return self.leaf::<L, ANY>(self.root & !LEAF, ray, &sheared, t_max);
        }
        let slabs = Slabs::<L>::new(ray);
        let mut best: Option<Hit> = None;
        let mut stack = Stack::new();
        let mut current = self.root;
        loop {
            if current & LEAF != 0 {
                if let Some(hit) = self.leaf::<L, ANY>(current & !LEAF, ray, &sheared, t_max) {
                    if ANY {
                        return Some(hit);
                    }
                    t_max = hit.t;
                    best = Some(hit);
                }
            } else {
                let node = &self.nodes[current as usize];
                let (mut met, near) = slabs.meet(&node.bounds, t_max);
                if ANY && met != 0 {
                    // Any order will do.
                    current = node.child[met.trailing_zeros() as usize % LANES];
                    met &= met - 1;
                    while met != 0 {
                        stack.push(node.child[met.trailing_zeros() as usize % LANES], 0.0);
                        met &= met - 1;
                    }
                    continue;
                }
                if met != 0 {
                    // The nearest child is next; the others wait, farthest first.
                    let first = met.trailing_zeros() as usize % LANES;
                    met &= met - 1;
                    if met == 0 {
                        current = node.child[first];
                        continue;
                    }
                    let near = near.store();
                    let base = stack.depth;
                    stack.push(node.child[first], near.0[first]);
                    while met != 0 {
                        let lane = met.trailing_zeros() as usize % LANES;
                        met &= met - 1;
                        stack.insert(base, node.child[lane], near.0[lane]);
                    }
                    current = stack.pop_top();
                    continue;
                }
            }
            match stack.pop(t_max) {
                Some(next) => current = next,
                None => return best,
            }
        }
    }

    /// The nearest hit in the blocks of a leaf, or with `ANY` some hit.
    #[inline(always)]
    fn leaf<L: Lanes, const ANY: bool>(
        &self,
        first: u32,
        ray: &Ray,
        sheared: &ShearedRay,
        mut t_max: f32,
    ) -> Option<Hit> {
        let mut best = None;
        for block in &self.blocks[first as usize..] {
            let found = block.triangles.intersect::<L>(sheared, t_max);
            let mut lanes = found.lanes | block.spheres;
            if lanes != 0 {
                let distances = found.t();
                while lanes != 0 {
                    let lane = lanes.trailing_zeros() as usize % LANES;
                    lanes &= lanes - 1;
                    let primitive = block.primitives[lane];
                    let hit = if block.spheres & (1 << lane) != 0 {
                        let sphere = &self.scene.spheres[primitive as usize - self.scene.triangles.len()];
                        let Some(t) = intersect::sphere(sphere, ray, t_max) else { continue };
                        Hit { t, primitive, uv: [0.0; 2] }
                    } else if distances.0[lane] < t_max {
                        Hit { t: distances.0[lane], primitive, uv: found.uv(lane) }
                    } else {
                        continue;
                    };
                    if self.masked && is_masked_out(&self.scene, ray, &hit) {
                        continue;
                    }
                    if ANY {
                        return Some(hit);
                    }
                    t_max = hit.t;
                    best = Some(hit);
                }
            }
            if block.last {
                break;
            }
        }
        best
    }
}

/// A ray with what every box test needs of it.
struct Slabs<L> {
    origin: [L; 3],
    inverse: [L; 3],
    /// Which bound the ray meets first on each axis.
    first: [usize; 3],
}

impl<L: Lanes> Slabs<L> {
    #[inline(always)]
    fn new(ray: &Ray) -> Slabs<L> {
        // A zero component would make 0 * inf = NaN on a box's plane; a tiny one is as good and stays finite.
        let finite = |d: f32| 1.0 / if d.abs() < 1e-20 { 1e-20f32.copysign(d) } else { d };
        let (o, d) = (ray.origin, ray.dir);
        let (x, y, z) = (finite(d.x), finite(d.y), finite(d.z));
        Slabs {
            origin: [L::splat(o.x), L::splat(o.y), L::splat(o.z)],
            inverse: [L::splat(x), L::splat(y), L::splat(z)],
            first: [usize::from(x < 0.0), usize::from(y < 0.0), usize::from(z < 0.0)],
        }
    }

    /// The boxes that the ray meets before `t_max`, and where they begin.
    #[inline(always)]
    fn meet(&self, bounds: &[[Row; 3]; 2], t_max: f32) -> (u32, L) {
        let [x, y, z] = self.first;
        let near = self.plane(bounds, x, 0).max(self.plane(bounds, y, 1)).max(self.plane(bounds, z, 2));
        let far = self.plane(bounds, 1 - x, 0).min(self.plane(bounds, 1 - y, 1)).min(self.plane(bounds, 1 - z, 2));
        let near = near.max(L::splat(0.0));
        (near.le(far.mul(L::splat(SLAB_SLACK)).min(L::splat(t_max))), near)
    }

    #[inline(always)]
    fn plane(&self, bounds: &[[Row; 3]; 2], bound: usize, axis: usize) -> L {
        L::load(&bounds[bound][axis]).sub(self.origin[axis]).mul(self.inverse[axis])
    }
}

/// Children that wait, each with the distance at which its box begins.
struct Stack {
    entries: [MaybeUninit<(u32, f32)>; STACK],
    depth: usize,
}

#[expect(unsafe_code, reason = "entries that nothing has been written to yet are never read")]
impl Stack {
    #[inline(always)]
    fn new() -> Stack {
        Stack { entries: [const { MaybeUninit::uninit() }; STACK], depth: 0 }
    }

    #[inline(always)]
    fn push(&mut self, child: u32, near: f32) {
        self.entries[self.depth].write((child, near));
        self.depth += 1;
    }

    /// Pushes a child below all those from `base` on that are nearer.
    #[inline(always)]
    fn insert(&mut self, base: usize, child: u32, near: f32) {
        let mut place = self.depth;
        self.depth += 1;
        while place > base {
            // SAFETY: below the depth before, so written.
            let before = unsafe { self.entries[place - 1].assume_init() };
            if before.1 >= near {
                break;
            }
            self.entries[place].write(before);
            place -= 1;
        }
        self.entries[place].write((child, near));
    }

    /// The child on top, which must be there.
    #[inline(always)]
    fn pop_top(&mut self) -> u32 {
        self.depth -= 1;
        // SAFETY: every entry below the depth was written when the depth went past it.
        unsafe { self.entries[self.depth].assume_init() }.0
    }

    /// The uppermost child whose box begins before `t_max`.
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
