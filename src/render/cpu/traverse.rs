//! The one traversal loop of the CPU backend, compiled once for every set of instructions.

use std::mem::MaybeUninit;

use super::accel::{Accel, STACK};
use super::compressed::Compressed;
use super::copies;
use super::intersect::{self, ShearedRay};
use super::lanes::{Isa, LANES, Lanes, Portable, Row};
use super::wide::{COPY, LEAF};
use crate::scene::compile::NONE;
use crate::transport::ray::{Hit, Ray, Trace};
use crate::transport::surface::is_masked_out;

/// Widens the far end of a slab test so that rounding never loses a box [Ize 2013].
const SLAB_SLACK: f32 = 1.000_000_5;

/// Widens the distance beyond which boxes do not matter, so that a box never hides a hit in it that is as near as the
/// best one, by rounding: which hit is found must not depend on how boxes are laid around.
const LIMIT_SLACK: f32 = 1.0 + 1.0 / (1 << 20) as f32;

/// On the stack it stands below what waits in the tree of a copy: the way back to the world. No node, leaf or copy has
/// this number.
const BACK: u32 = u32::MAX;

impl Accel {
    /// The nearest hit with `0 < t < t_max`, masks applied. Of hits at the same distance it is the one with the lesser
    /// instance, then primitive. A ray with a number that is not finite hits nothing.
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
        if !self.places.is_empty() {
            return self.among_copies::<ANY>(ray, t_max);
        }
        match self.isa {
            #[cfg(target_arch = "x86_64")]
            #[expect(unsafe_code, reason = "a function that is compiled for AVX2")]
            // SAFETY: an accel says AVX2, or AVX-512, only where the processor has it, and AVX2 with the latter.
            Isa::Avx2 | Isa::Avx512 => unsafe { self.traverse_avx2::<ANY, false>(ray, t_max) },
            _ => self.traverse::<Portable, ANY, false>(ray, t_max),
        }
    }

    /// The same where there are copies: apart, so that what has none does not pay for them.
    #[inline(never)]
    fn among_copies<const ANY: bool>(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        match self.isa {
            #[cfg(target_arch = "x86_64")]
            #[expect(unsafe_code, reason = "a function that is compiled for AVX2")]
            // SAFETY: an accel says AVX2, or AVX-512, only where the processor has it, and AVX2 with the latter.
            Isa::Avx2 | Isa::Avx512 => unsafe { self.traverse_avx2::<ANY, true>(ray, t_max) },
            _ => self.traverse::<Portable, ANY, true>(ray, t_max),
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    fn traverse_avx2<const ANY: bool, const COPIES: bool>(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        self.traverse::<super::lanes::Avx2, ANY, COPIES>(ray, t_max)
    }

    /// The traversal loop. With `ANY` it returns at the first hit, otherwise at the nearest. With `COPIES` it enters the
    /// trees of copies, with the ray in the space of their mesh, and comes back.
    #[inline(always)]
    fn traverse<L: Lanes, const ANY: bool, const COPIES: bool>(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        // With NaN in it every box would seem to be met, those of children that are not there too.
        if !(ray.origin + ray.dir).element_sum().is_finite() {
            return None;
        }
        let mut best = Best::new(t_max);
        let mut sheared = ShearedRay::new(ray);
        if self.root & LEAF != 0 && !COPIES {
            if let Some(compressed) = &self.compressed {
                self.compressed::<ANY>(compressed, ray, &sheared, &mut best);
            } else {
                self.leaf::<L, ANY, false>(self.root & !LEAF, ray, &sheared, NONE, &mut best);
            }
            return best.hit;
        }
        let mut slabs = Slabs::<L>::new(ray);
        let mut instance = NONE;
        let mut stack = Stack::new();
        let mut current = self.root;
        loop {
            if current & LEAF != 0 {
                if COPIES && current == BACK {
                    (sheared, slabs, instance) = (ShearedRay::new(ray), Slabs::new(ray), NONE);
                } else if COPIES && current & COPY != 0 {
                    instance = current & !(LEAF | COPY);
                    let place = &self.places[instance as usize];
                    let own = place.enter(ray);
                    (sheared, slabs) = (ShearedRay::new(&own), Slabs::new(&own));
                    // Never beyond any limit, so that it is met.
                    stack.push(BACK, f32::NEG_INFINITY);
                    current = place.root;
                    continue;
                } else if self.leaf::<L, ANY, COPIES>(current & !LEAF, ray, &sheared, instance, &mut best) && ANY {
                    return best.hit;
                }
            } else {
                let node = &self.nodes[current as usize];
                let (mut met, near) = slabs.meet(&node.bounds, best.limit);
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
            match stack.pop(best.limit) {
                Some(next) => current = next,
                None => return best.hit,
            }
        }
    }

    /// Tests the blocks of a leaf, and says whether something was found that is better than before. With `ANY` it returns
    /// at the first.
    #[inline(always)]
    fn leaf<L: Lanes, const ANY: bool, const COPIES: bool>(
        &self,
        first: u32,
        ray: &Ray,
        sheared: &ShearedRay,
        instance: u32,
        best: &mut Best,
    ) -> bool {
        let mut better = false;
        for block in &self.blocks[first as usize..] {
            // What the space of a copy says of a distance is not its last word.
            let within = if COPIES && instance != NONE { best.limit } else { best.t };
            let found = block.triangles.intersect::<L>(sheared, within);
            let mut lanes = found.lanes | block.spheres;
            if lanes != 0 {
                let distances = found.t();
                while lanes != 0 {
                    let lane = lanes.trailing_zeros() as usize % LANES;
                    lanes &= lanes - 1;
                    let primitive = block.primitives[lane];
                    let (t, uv) = if block.spheres & (1 << lane) != 0 {
                        let sphere = &self.scene.spheres[primitive as usize - self.scene.triangles.len()];
                        let Some(t) = intersect::sphere(sphere, ray, best.t) else { continue };
                        (t, [0.0; 2])
                    } else if COPIES && instance != NONE {
                        let t = copies::distance(&self.scene, ray, primitive, instance);
                        if !(t > 0.0 && t <= best.t) {
                            continue;
                        }
                        (t, found.uv(lane))
                    } else if distances.0[lane] <= best.t {
                        (distances.0[lane], found.uv(lane))
                    } else {
                        continue;
                    };
                    better |= self.offer(ray, Hit { t, primitive, instance, uv }, best);
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

    /// Takes a hit with `t <= best.t` if it is better than the best one so far and no mask cuts it out.
    #[inline(always)]
    fn offer(&self, ray: &Ray, hit: Hit, best: &mut Best) -> bool {
        if hit.t == best.t && !best.yields_to(&hit) || self.masked && is_masked_out(&self.scene, ray, &hit) {
            return false;
        }
        best.t = hit.t;
        best.limit = hit.t * LIMIT_SLACK;
        best.hit = Some(hit);
        true
    }

    /// The search through the tree of `obvhs` by its own traversal.
    #[inline(never)]
    fn compressed<const ANY: bool>(&self, tree: &Compressed, ray: &Ray, sheared: &ShearedRay, best: &mut Best) {
        let scene = &self.scene;
        tree.traverse(ray, best.limit, ANY, |primitive| {
            let (t, uv) = match scene.triangles.get(primitive as usize) {
                Some(corners) => intersect::triangle(corners, sheared, best.t)?,
                None => {
                    let sphere = &scene.spheres[primitive as usize - scene.triangles.len()];
                    (intersect::sphere(sphere, ray, best.t)?, [0.0; 2])
                }
            };
            self.offer(ray, Hit { t, primitive, instance: NONE, uv }, best).then_some(best.limit)
        });
    }
}

/// The best hit so far.
struct Best {
    hit: Option<Hit>,
    /// Its distance, or that at which the ray ends.
    t: f32,
    /// Boxes that begin beyond do not matter.
    limit: f32,
}

impl Best {
    #[inline(always)]
    fn new(t_max: f32) -> Best {
        Best { hit: None, t: t_max, limit: t_max * LIMIT_SLACK }
    }

    /// Whether a hit at the same distance goes before it. Nothing goes before the end of the ray.
    #[inline(always)]
    fn yields_to(&self, hit: &Hit) -> bool {
        self.hit.is_some_and(|best| (hit.instance, hit.primitive) < (best.instance, best.primitive))
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
