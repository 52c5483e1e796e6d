//! Rays that travel together: one ray per lane, all through the same nodes of a hierarchy.
//!
//! Rays of a packet share the octant of their directions and its longest axis. A node's children are
//! first tested against the interval of all rays at once, then those that it meets against every ray.
//! Where few rays of a packet are left, each goes on alone ([`Accel::continue_from`]). Rays that do
//! not form packets are traced by [`Accel`] one by one.
//!
//! Invariant: hits have the same bits as those of [`Accel`]: the triangle test is that of
//! [`intersect`](super::intersect), operation by operation, boxes are tested
//! conservatively, and of hits at the same distance the one with the lesser primitive index counts.

use super::accel::{Accel, STACK};
use super::bvh8::{Block, LEAF, Node};
use super::intersect_lanes::{intersect_sheared, load_rays};
use super::simd::{Avx2, Isa, LANES, Simd8};
use super::slabs::{OFFSET_ERROR, SLAB_SLACK};
use super::traverse::LIMIT_SLACK;
use lumbre_light::math::real::{Mask, Real};
use lumbre_light::math::simd::{Lanes, SimdKernel, Width, active_lanes, dispatch};
use lumbre_light::scene::compile::NONE;
use lumbre_light::transport::ray::{Hit, Ray};

/// Fraction of a packet's lanes up to which its rays go on alone.
const THIN: usize = 4;

/// Greatest ratio of the components of two directions of a packet along one axis. Rays that diverge
/// more share few nodes.
const SPREAD: f32 = 1.5;

/// Number of groups of neighbouring rays after which no more packets are formed, if none was.
const TRIALS: usize = 4;

/// Factor on distances of the interval test, so that no box is missed because of rounding.
const INTERVAL_SLACK: f32 = 1.000_002;

impl Accel {
    /// Traces rays that form packets and calls `done` with the index of each and its nearest hit within
    /// its distance, or with `ANY` any such hit. Returns the indices of all other rays.
    pub(super) fn trace_packets<const ANY: bool>(
        &self,
        rays: &[(Ray, f32)],
        done: impl FnMut(usize, Option<Hit>),
    ) -> Vec<u32> {
        let Some(width) = self.packet_width() else {
            return (0..rays.len() as u32).collect();
        };
        let mut alone = Vec::new();
        dispatch(
            width,
            PacketTrace::<ANY, _> {
                accel: self,
                rays,
                done,
                alone: &mut alone,
            },
        );
        alone
    }

    /// Returns the vectors of packets; `None` if rays form none.
    fn packet_width(&self) -> Option<Width> {
        if self.root & LEAF != 0 || !self.instances.is_empty() || self.compressed.is_some() {
            return None;
        }
        match self.isa {
            Isa::Portable => None,
            Isa::Avx2 => Width::eight(),
            Isa::Avx512 => Width::sixteen(),
        }
    }
}

/// Kernel that traces rays: packets where rays form them. With `ANY` it searches any hit, else the
/// nearest.
struct PacketTrace<'a, const ANY: bool, F> {
    accel: &'a Accel,
    rays: &'a [(Ray, f32)],
    done: F,
    /// Indices of the rays that form no packet.
    alone: &'a mut Vec<u32>,
}

/// One ray per lane with the state of its search, in memory.
struct Packet<'a, const N: usize> {
    rays: &'a [(Ray, f32)],
    origin: [[f32; N]; 3],
    inverse: [[f32; N]; 3],
    entry: [[f32; N]; 3],
    exit: [[f32; N]; 3],
    /// Index of the bound that all rays meet first on each axis.
    first: [usize; 3],
    /// Axes x, y and z of the sheared space of all rays.
    axes: [usize; 3],
    shear: [[f32; N]; 3],
    t: [f32; N],
    v: [f32; N],
    w: [f32; N],
    divisor: [f32; N],
    primitive: [f32; N],
    /// Distance beyond which boxes are skipped; negative for lanes without a ray.
    limit: [f32; N],
    /// Greatest limit of all lanes.
    reach: f32,
}

/// Bounds of the rays of a packet, for one test of all children of a node.
struct Interval {
    /// Coordinate of the origins to subtract from the first and from the second bound of a box.
    near_origin: [Avx2; 3],
    far_origin: [Avx2; 3],
    /// Least and greatest inverse of the directions.
    inverse: [[Avx2; 3]; 2],
    first: [usize; 3],
}

impl Interval {
    #[inline(always)]
    fn new<const N: usize>(packet: &Packet<N>) -> Interval {
        let (mut near_origin, mut far_origin) = ([Avx2::splat(0.0); 3], [Avx2::splat(0.0); 3]);
        let mut inverse = [[Avx2::splat(0.0); 3]; 2];
        for axis in 0..3 {
            let [low, high] = extent(&packet.origin[axis]);
            // Along a positive direction the least distance to a bound is that from the greatest
            // origin.
            let (near, far) = if packet.first[axis] == 0 {
                (high, low)
            } else {
                (low, high)
            };
            (near_origin[axis], far_origin[axis]) = (Avx2::splat(near), Avx2::splat(far));
            let [low, high] = extent(&packet.inverse[axis]);
            (inverse[0][axis], inverse[1][axis]) = (Avx2::splat(low), Avx2::splat(high));
        }
        Interval {
            near_origin,
            far_origin,
            inverse,
            first: packet.first,
        }
    }

    /// Returns a bit mask of the children whose box some ray of the interval may meet before
    /// `reach`, and lower bounds of the distances at which it enters them.
    #[inline(always)]
    fn intersect(&self, node: &Node, reach: f32) -> (u32, Avx2) {
        let near = self
            .near(node, 0)
            .max(self.near(node, 1))
            .max(self.near(node, 2));
        let far = self
            .far(node, 0)
            .min(self.far(node, 1))
            .min(self.far(node, 2));
        let near = near.max(Avx2::splat(0.0));
        let last = far.mul(Avx2::splat(INTERVAL_SLACK)).min(Avx2::splat(reach));
        (near.mul(Avx2::splat(2.0 - INTERVAL_SLACK)).le(last), near)
    }

    #[inline(always)]
    fn near(&self, node: &Node, axis: usize) -> Avx2 {
        let bound = Avx2::load(&node.bounds[self.first[axis]][axis]).sub(self.near_origin[axis]);
        let [a, b] = [
            bound.mul(self.inverse[0][axis]),
            bound.mul(self.inverse[1][axis]),
        ];
        a.min(b)
    }

    #[inline(always)]
    fn far(&self, node: &Node, axis: usize) -> Avx2 {
        let bound = Avx2::load(&node.bounds[1 - self.first[axis]][axis]).sub(self.far_origin[axis]);
        let [a, b] = [
            bound.mul(self.inverse[0][axis]),
            bound.mul(self.inverse[1][axis]),
        ];
        a.max(b)
    }
}

/// Returns the least and the greatest of some numbers.
#[inline(always)]
fn extent<const N: usize>(numbers: &[f32; N]) -> [f32; 2] {
    let (mut least, mut most) = (numbers[0], numbers[0]);
    for x in numbers {
        least = if *x < least { *x } else { least };
        most = if *x > most { *x } else { most };
    }
    [least, most]
}

/// A node, leaf or block on the stack: the lower bound of its distance and the rays that meet it.
#[derive(Clone, Copy)]
struct Entry {
    child: u32,
    near: f32,
    lanes: u32,
}

impl<'a, const N: usize> Packet<'a, N> {
    /// Returns the packet of some rays, if they form one.
    #[inline(always)]
    fn form<R: Lanes<N>>(rays: &'a [(Ray, f32)]) -> Option<Packet<'a, N>> {
        if N == 1 || rays.len() != N {
            return None;
        }
        let (origin, dir, t_max) = load_rays::<R, N>(rays);
        let all = R::Mask::splat(true);
        let ([ox, oy, oz], [dx, dy, dz]) = (origin, dir);
        let sum = ox + oy + oz + dx + dy + dz;
        let mut usable = sum.is_finite() & t_max.gt(R::splat(0.0));
        let mut first = [0; 3];
        let mut sizes = [dx, dy, dz];
        for axis in 0..3 {
            let negative = dir[axis].lt(R::splat(0.0)).bits();
            if negative != 0 && negative != all.bits() {
                return None;
            }
            first[axis] = usize::from(negative != 0);
            sizes[axis] = dir[axis].abs();
            usable = usable & sizes[axis].gt(R::splat(1e-6));
        }
        // The longest axis, as single rays choose it.
        let [x, y, z] = sizes;
        let along_x = x.ge(y) & x.ge(z);
        let along_y = !along_x & y.ge(z);
        let longest = if along_x == all {
            0
        } else if along_y == all {
            1
        } else if !(along_x | along_y) == all {
            2
        } else {
            return None;
        };
        if usable != all {
            return None;
        }
        for size in sizes {
            let [least, most] = extent(&size.store());
            if most > SPREAD * least + 0.05 {
                return None;
            }
        }
        let (mut kx, mut ky) = ((longest + 1) % 3, (longest + 2) % 3);
        if first[longest] == 1 {
            std::mem::swap(&mut kx, &mut ky);
        }
        let axes = [kx, ky, longest];
        let one = R::splat(1.0);
        let scale = one / dir[longest];
        let mut packet = Packet {
            rays,
            origin: [[0.0; N]; 3],
            inverse: [[0.0; N]; 3],
            entry: [[0.0; N]; 3],
            exit: [[0.0; N]; 3],
            first,
            axes,
            shear: [
                (dir[kx] * scale).store(),
                (dir[ky] * scale).store(),
                scale.store(),
            ],
            t: t_max.store(),
            v: [0.0; N],
            w: [0.0; N],
            divisor: [1.0; N],
            primitive: [0.0; N],
            limit: (t_max * R::splat(LIMIT_SLACK)).store(),
            reach: 0.0,
        };
        for axis in 0..3 {
            let (o, i) = (origin[axis], one / dir[axis]);
            let offset = o * i;
            let error = offset.abs() * R::splat(OFFSET_ERROR);
            packet.origin[axis] = o.store();
            packet.inverse[axis] = i.store();
            packet.entry[axis] = (-offset - error).store();
            packet.exit[axis] = (error - offset).store();
        }
        packet.update_reach();
        Some(packet)
    }

    /// Returns the lanes whose ray meets the box of a child before its limit.
    #[inline(always)]
    fn meets<R: Lanes<N>>(&self, node: &Node, child: usize) -> u32 {
        let (mut enter, mut leave) = (R::splat(0.0), R::splat(f32::INFINITY));
        for axis in 0..3 {
            let (first, inverse) = (self.first[axis], R::load(&self.inverse[axis]));
            let near = R::splat(node.bounds[first][axis].0[child]) * inverse;
            let far = R::splat(node.bounds[1 - first][axis].0[child]) * inverse;
            enter = (near + R::load(&self.entry[axis])).max(enter);
            leave = (far + R::load(&self.exit[axis])).min(leave);
        }
        let leave = leave * R::splat(SLAB_SLACK);
        enter.le(leave.min(R::load(&self.limit))).bits()
    }
}

impl<const ANY: bool, F> PacketTrace<'_, ANY, F> {
    /// Traces the rays of a packet through the whole hierarchy.
    #[inline(always)]
    fn packet<R: Lanes<N>, const N: usize>(
        &self,
        packet: &mut Packet<N>,
        stack: &mut [Entry; STACK],
    ) {
        let accel = self.accel;
        let interval = Interval::new(packet);
        let mut depth = 0;
        let all = R::Mask::splat(true).bits();
        let mut current = Entry {
            child: accel.root,
            near: 0.0,
            lanes: all,
        };
        loop {
            if current.lanes.count_ones() as usize * THIN <= N {
                self.alone(packet, current);
            } else if current.child & LEAF != 0 {
                self.leaf::<R, N>(packet, current);
            } else {
                let node = &accel.nodes[current.child as usize];
                let (children, near) = interval.intersect(node, packet.reach);
                let base = depth;
                if children != 0 {
                    let near = near.store();
                    for child in active_lanes(children) {
                        let lanes = packet.meets::<R>(node, child);
                        if lanes != 0 {
                            let entry = Entry {
                                child: node.child[child],
                                near: near.0[child],
                                lanes,
                            };
                            depth = insert(stack, base, depth, entry);
                        }
                    }
                }
            }
            if ANY && packet.reach < 0.0 {
                return;
            }
            loop {
                if depth == 0 {
                    return;
                }
                depth -= 1;
                current = stack[depth];
                if current.near <= packet.reach {
                    break;
                }
            }
        }
    }

    /// Lets the rays of an entry go on alone below it.
    #[inline(always)]
    fn alone<const N: usize>(&self, packet: &mut Packet<N>, entry: Entry) {
        for lane in active_lanes(entry.lanes) {
            let (ray, t_max) = &packet.rays[lane];
            if packet.limit[lane] < entry.near {
                continue;
            }
            let known = packet.hit(lane, *t_max);
            let found = self
                .accel
                .continue_from::<ANY>(entry.child, ray, packet.t[lane], known);
            if let Some(hit) = found
                && found != known
            {
                packet.accept(lane, hit, ANY);
            }
        }
        packet.update_reach();
    }

    /// Tests the rays of an entry against the blocks of a leaf: the rays against one triangle after
    /// the other, or in blocks with masks or spheres, and for few rays, ray by ray.
    #[inline(always)]
    fn leaf<R: Lanes<N>, const N: usize>(&self, packet: &mut Packet<N>, entry: Entry) {
        let first = (entry.child & !LEAF) as usize;
        for block in &self.accel.blocks[first..] {
            let count = block.primitives.iter().filter(|p| **p != NONE).count();
            if block.masked | block.spheres != 0 || (entry.lanes.count_ones() as usize) < count {
                for lane in active_lanes(entry.lanes) {
                    if packet.limit[lane] < entry.near {
                        continue;
                    }
                    let (ray, t_max) = &packet.rays[lane];
                    let known = packet.hit(lane, *t_max);
                    let found =
                        self.accel
                            .hit_in_block::<Avx2, ANY>(block, ray, packet.t[lane], known);
                    if let Some(hit) = found
                        && found != known
                    {
                        packet.accept(lane, hit, ANY);
                    }
                }
            } else {
                packet.test_triangles::<R, ANY>(block);
            }
            if block.last {
                break;
            }
        }
        packet.update_reach();
    }
}

/// Inserts an entry below the nearer ones of the entries from `base` to `depth`; returns the new
/// depth.
#[inline(always)]
fn insert(stack: &mut [Entry; STACK], base: usize, depth: usize, entry: Entry) -> usize {
    let mut at = depth;
    while at > base && stack[at - 1].near < entry.near {
        stack[at] = stack[at - 1];
        at -= 1;
    }
    stack[at] = entry;
    depth + 1
}

impl<const N: usize> Packet<'_, N> {
    /// Returns the nearest hit of a lane so far.
    #[inline(always)]
    fn hit(&self, lane: usize, t_max: f32) -> Option<Hit> {
        (self.t[lane] < t_max).then(|| Hit {
            t: self.t[lane],
            primitive: self.primitive[lane].to_bits(),
            instance: NONE,
            uv: [
                self.v[lane] / self.divisor[lane],
                self.w[lane] / self.divisor[lane],
            ],
        })
    }

    /// Makes a hit that of a lane, whose search ends if any hit is enough.
    #[inline(always)]
    fn accept(&mut self, lane: usize, hit: Hit, any: bool) {
        self.t[lane] = hit.t;
        self.limit[lane] = if any { -1.0 } else { hit.t * LIMIT_SLACK };
        [self.v[lane], self.w[lane]] = hit.uv;
        self.divisor[lane] = 1.0;
        self.primitive[lane] = f32::from_bits(hit.primitive);
    }

    #[inline(always)]
    fn update_reach(&mut self) {
        let [_, most] = extent(&self.limit);
        self.reach = most;
    }

    /// Tests all rays against the triangles of a block.
    #[inline(always)]
    fn test_triangles<R: Lanes<N>, const ANY: bool>(&mut self, block: &Block) {
        let [kx, ky, kz] = self.axes;
        let origin = [
            R::load(&self.origin[kx]),
            R::load(&self.origin[ky]),
            R::load(&self.origin[kz]),
        ];
        let shear = [
            R::load(&self.shear[0]),
            R::load(&self.shear[1]),
            R::load(&self.shear[2]),
        ];
        let mut t = R::load(&self.t);
        let (mut v, mut w) = (R::load(&self.v), R::load(&self.w));
        let mut divisor = R::load(&self.divisor);
        let mut primitive = R::load(&self.primitive);
        let mut limit = R::load(&self.limit);
        for lane in 0..LANES {
            let id = block.primitives[lane];
            if id == NONE {
                continue;
            }
            let mut corners = [origin; 3];
            for (i, corner) in corners.iter_mut().enumerate() {
                let at = &block.triangles;
                let x = R::splat(at.coordinate(i, kx, lane)) - origin[0];
                let y = R::splat(at.coordinate(i, ky, lane)) - origin[1];
                let z = R::splat(at.coordinate(i, kz, lane)) - origin[2];
                *corner = [x - z * shear[0], y - z * shear[1], z * shear[2]];
            }
            let [a, b, c] = &corners;
            let found = intersect_sheared::<R, N, true>([a, b, c]);
            let id = R::splat(f32::from_bits(id));
            let nearer = found.t.lt(t) | (Real::eq(found.t, t) & id.lt(primitive));
            let nearer = nearer & limit.gt(R::splat(0.0));
            if !nearer.any() {
                continue;
            }
            t = R::select(nearer, found.t, t);
            v = R::select(nearer, found.v, v);
            w = R::select(nearer, found.w, w);
            divisor = R::select(nearer, found.divisor, divisor);
            primitive = R::select(nearer, id, primitive);
            let end = if ANY {
                R::splat(-1.0)
            } else {
                found.t * R::splat(LIMIT_SLACK)
            };
            limit = R::select(nearer, end, limit);
        }
        self.t = t.store();
        self.v = v.store();
        self.w = w.store();
        self.divisor = divisor.store();
        self.primitive = primitive.store();
        self.limit = limit.store();
    }
}

impl<const ANY: bool, F: FnMut(usize, Option<Hit>)> SimdKernel for PacketTrace<'_, ANY, F> {
    type Output = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(mut self) {
        let rays = self.rays;
        let mut formed = 0;
        let bottom = Entry {
            child: 0,
            near: 0.0,
            lanes: 0,
        };
        let mut stack = [bottom; STACK];
        for (k, group) in rays.chunks(N).enumerate() {
            let first = k * N;
            if k == TRIALS && formed == 0 {
                self.alone.extend(first as u32..rays.len() as u32);
                return;
            }
            match Packet::<N>::form::<R>(group) {
                Some(mut packet) => {
                    formed += 1;
                    self.packet::<R, N>(&mut packet, &mut stack);
                    for (lane, (_, t_max)) in group.iter().enumerate() {
                        (self.done)(first + lane, packet.hit(lane, *t_max));
                    }
                }
                None => self
                    .alone
                    .extend((first..first + group.len()).map(|i| i as u32)),
            }
        }
    }
}
