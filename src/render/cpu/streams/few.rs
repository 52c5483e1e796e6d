//! Rays together, in scenes of few primitives: one primitive after the other is tested with the rays in all lanes, where a ray
//! by itself is tested with eight primitives. What every ray needs of its own is then made for all at once, and corners that
//! triangles share are sheared once.
//!
//! Rays meet what they meet alone, to the bit: the tests are those of [`intersect`](super::super::intersect), operation by
//! operation, and of hits at the same distance the one with the lesser primitive counts.
//!
//! Primitives with masks come last, since masks are looked up ray by ray: only where no other primitive is nearer.

use std::sync::Arc;

use glam::Vec3;

use crate::math::lanes::{AnyWidth, Lanes, Row, Width, set};
use crate::math::real::{Mask, Real, Vector};
use crate::render::cpu::accel::{Accel, ONE_LEAF};
use crate::scene::CompiledScene;
use crate::scene::compile::NONE;
use crate::transport::ray::{Hit, Ray};
use crate::transport::surface::is_masked_out;

/// All primitives of a scene of few.
pub struct Few {
    width: Width,
    scene: Arc<CompiledScene>,
    /// Corners, those with the same coordinates once.
    corners: Vec<Vec3>,
    solid: Part,
    /// Those with masks.
    masked: Part,
}

/// Some of the primitives, each with its id.
#[derive(Default)]
struct Part {
    /// Of every triangle its corners.
    triangles: Vec<([u8; 3], u32)>,
    /// Centre and radius.
    spheres: Vec<(Vec3, f32, u32)>,
}

/// What rays need for the test of a triangle: see `ShearedRay`.
struct Sheared<R: Real> {
    origin: R::Vec3,
    /// Where the ray runs most along x; where along y.
    along: [R::Mask; 2],
    /// Where the two other axes change places.
    swapped: R::Mask,
    shear: [R; 3],
}

/// Where a primitive is hit: at an infinite distance where it is not. The place on it is still to be divided: seldom is a hit
/// the last one.
#[derive(Clone, Copy)]
struct Met<R: Real> {
    t: R,
    v: R,
    w: R,
    divisor: R,
}

/// The best hits so far.
struct Best<R: Real> {
    /// How far rays go; nowhere below zero.
    limit: R,
    /// As far as that where nothing was hit.
    t: R,
    v: R,
    w: R,
    divisor: R,
    primitive: R,
}

/// Corners of a scene for whose rays no memory is asked for: to ask for as much, in line with vectors, for every few hundred rays
/// takes longer than to clear it.
const AT_HAND: usize = 32;

/// Room for what rays make of all corners.
struct Room<R> {
    at_hand: [[R; 3]; AT_HAND],
    more: Vec<[R; 3]>,
}

impl<R: Real> Room<R> {
    #[inline(always)]
    fn new() -> Room<R> {
        Room { at_hand: [[R::of(0.0); 3]; AT_HAND], more: Vec::new() }
    }

    #[inline(always)]
    fn for_corners(&mut self, corners: usize) -> &mut [[R; 3]] {
        if corners > AT_HAND {
            self.more.resize(corners, [R::of(0.0); 3]);
            return &mut self.more;
        }
        &mut self.at_hand[..corners]
    }
}

/// What masks need of the best hits so far.
struct Before<const N: usize> {
    t: [f32; N],
    primitive: [f32; N],
    /// A bit for each lane.
    found: u32,
}

impl Few {
    /// For a hierarchy that is one leaf.
    pub fn of(accel: &Accel, width: Width) -> Option<Few> {
        let scene = &accel.scene;
        let few = accel.is_one_leaf() && scene.primitive_count() <= ONE_LEAF;
        few.then(|| Few::new(width, Arc::clone(scene)))
    }

    fn new(width: Width, scene: Arc<CompiledScene>) -> Few {
        let bits = |v: Vec3| v.to_array().map(f32::to_bits);
        let mut corners: Vec<Vec3> = Vec::new();
        let mut index = |corner: Vec3| {
            let place = corners.iter().position(|c| bits(*c) == bits(corner));
            place.unwrap_or_else(|| {
                corners.push(corner);
                corners.len() - 1
            }) as u8
        };
        let (mut solid, mut masked) = (Part::default(), Part::default());
        for id in 0..scene.primitive_count() as u32 {
            let has_mask = scene.materials[scene.material_of(id, NONE) as usize].mask_texture != NONE;
            let part = if has_mask { &mut masked } else { &mut solid };
            match scene.triangles.get(id as usize) {
                Some(corners) => part.triangles.push((corners.map(&mut index), id)),
                None => {
                    let sphere = &scene.spheres[id as usize - scene.triangles.len()];
                    part.spheres.push((sphere.center, sphere.radius, id));
                }
            }
        }
        Few { width, scene, corners, solid, masked }
    }

    /// The nearest hit of each ray with `0 < t < t_max`, masks applied.
    pub fn closest(&self, rays: &[(Ray, f32)], hits: &mut Vec<Option<Hit>>) {
        self.width.run(Closest { few: self, rays, hits });
    }

    /// Whether each ray hits anything with `0 < t < t_max`, masks applied.
    pub fn occluded(&self, rays: &[(Ray, f32)], hidden: &mut Vec<bool>) {
        self.width.run(Occluded { few: self, rays, hidden });
    }

    /// As many rays as there are lanes, or fewer; with `ANY` until each has hit something. `sheared` is room for all corners.
    #[inline(always)]
    fn some<R: Lanes<N>, const N: usize, const ANY: bool>(
        &self,
        group: &[(Ray, f32)],
        sheared: &mut [[R; 3]],
    ) -> Best<R> {
        let mut rows = [Row::default(); N];
        for (row, (Ray { origin: o, dir: d }, t_max)) in rows.iter_mut().zip(group) {
            *row = Row([o.x, o.y, o.z, d.x, d.y, d.z, *t_max, 0.0]);
        }
        let [x, y, z, u, v, w, t_max, _] = R::transposed(rows.each_ref());
        let (origin, dir) = (R::Vec3::new(x, y, z), R::Vec3::new(u, v, w));
        // A ray with a number that is not finite hits nothing.
        let usable = (origin + dir).element_sum().is_finite() & t_max.gt(R::of(0.0));
        let mut best = Best::new(R::select(R::Mask::first(group.len()) & usable, t_max, R::of(-1.0)));
        let rays = Sheared::new(origin, dir);
        for (sheared, corner) in sheared.iter_mut().zip(&self.corners) {
            *sheared = rays.corner(R::Vec3::of(*corner));
        }
        for (corners, id) in &self.solid.triangles {
            best.offer(rays.triangle::<N>(of(sheared, *corners)), *id);
            if ANY && !best.nothing_yet().any() {
                return best;
            }
        }
        for (center, radius, id) in &self.solid.spheres {
            best.offer(sphere([origin, dir], R::Vec3::of(*center), *radius), *id);
        }
        for (corners, id) in &self.masked.triangles {
            self.offer_masked::<R, N, ANY>(group, rays.triangle::<N>(of(sheared, *corners)), *id, &mut best);
            if ANY && !best.nothing_yet().any() {
                return best;
            }
        }
        for (center, radius, id) in &self.masked.spheres {
            let at = sphere([origin, dir], R::Vec3::of(*center), *radius);
            self.offer_masked::<R, N, ANY>(group, at, *id, &mut best);
        }
        best
    }

    /// Takes hits of a primitive with a mask that count and are better than the best ones so far; with `ANY` only where there
    /// is none.
    #[inline(always)]
    fn offer_masked<R: Lanes<N>, const N: usize, const ANY: bool>(
        &self,
        group: &[(Ray, f32)],
        at: Met<R>,
        primitive: u32,
        best: &mut Best<R>,
    ) {
        let mut near = at.t.le(best.t) & at.t.lt(best.limit);
        if ANY {
            near = near & best.nothing_yet();
        }
        if near.any() {
            let hits = [at.t.store(), (at.v / at.divisor).store(), (at.w / at.divisor).store()];
            let found = best.found().bits();
            let before = Before { t: best.t.store(), primitive: best.primitive.store(), found };
            let counts = R::load(&self.counting(group, primitive, &hits, near.bits(), &before)).gt(R::of(0.0));
            best.put(counts, Met { t: R::select(counts, at.t, best.t), ..at }, primitive);
        }
    }

    /// 1 where a hit of a primitive with a mask, at `[t, u, v]` and not beyond the best one before it, is better than that and
    /// the mask lets it count, else 0; of the lanes whose bits are set.
    #[inline(never)]
    fn counting<const N: usize>(
        &self,
        group: &[(Ray, f32)],
        primitive: u32,
        [t, u, v]: &[[f32; N]; 3],
        lanes: u32,
        before: &Before<N>,
    ) -> [f32; N] {
        let mut counts = [0.0; N];
        for lane in set(lanes) {
            let hit = Hit { t: t[lane], primitive, instance: NONE, uv: [u[lane], v[lane]] };
            let goes_before = before.found & 1 << lane != 0 && primitive < before.primitive[lane].to_bits();
            let better = hit.t < before.t[lane] || goes_before;
            if better && !is_masked_out(&self.scene, &group[lane].0, &hit) {
                counts[lane] = 1.0;
            }
        }
        counts
    }
}

/// The work of [`Few::closest`].
struct Closest<'a> {
    few: &'a Few,
    rays: &'a [(Ray, f32)],
    hits: &'a mut Vec<Option<Hit>>,
}

impl AnyWidth for Closest<'_> {
    type Out = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        let mut room = Room::new();
        let sheared = room.for_corners(self.few.corners.len());
        for group in self.rays.chunks(N) {
            let best = self.few.some::<R, N, false>(group, sheared);
            let (found, t, primitives) = (best.found().bits(), best.t.store(), best.primitive.store());
            let (v, w) = ((best.v / best.divisor).store(), (best.w / best.divisor).store());
            let mut hits = [None; N];
            for i in set(found) {
                hits[i] = Some(Hit { t: t[i], primitive: primitives[i].to_bits(), instance: NONE, uv: [v[i], w[i]] });
            }
            self.hits.extend_from_slice(&hits[..group.len()]);
        }
    }
}

/// The work of [`Few::occluded`].
struct Occluded<'a> {
    few: &'a Few,
    rays: &'a [(Ray, f32)],
    hidden: &'a mut Vec<bool>,
}

impl AnyWidth for Occluded<'_> {
    type Out = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        let mut room = Room::new();
        let sheared = room.for_corners(self.few.corners.len());
        for group in self.rays.chunks(N) {
            let found = self.few.some::<R, N, true>(group, sheared).found().bits();
            self.hidden.extend((0..group.len()).map(|i| found & 1 << i != 0));
        }
    }
}

impl<R: Real> Best<R> {
    /// Nothing yet, for rays that go so far.
    #[inline(always)]
    fn new(limit: R) -> Best<R> {
        let (zero, one) = (R::of(0.0), R::of(1.0));
        Best { limit, t: limit, v: zero, w: zero, divisor: one, primitive: zero }
    }

    /// Where anything was hit.
    #[inline(always)]
    fn found(&self) -> R::Mask {
        self.t.lt(self.limit)
    }

    /// Where something could be hit and was not.
    #[inline(always)]
    fn nothing_yet(&self) -> R::Mask {
        self.t.ge(self.limit) & self.limit.gt(R::of(0.0))
    }

    /// Takes hits that are nearer.
    #[inline(always)]
    fn offer(&mut self, at: Met<R>, primitive: u32) {
        self.put(at.t.lt(self.t), at, primitive);
    }

    /// Takes hits in some lanes; in all others they are no nearer.
    #[inline(always)]
    fn put(&mut self, lanes: R::Mask, at: Met<R>, primitive: u32) {
        // Not chosen by the mask: the next primitive need not wait for that.
        self.t = at.t.min(self.t);
        self.v = R::select(lanes, at.v, self.v);
        self.w = R::select(lanes, at.w, self.w);
        self.divisor = R::select(lanes, at.divisor, self.divisor);
        self.primitive = R::select(lanes, R::of(f32::from_bits(primitive)), self.primitive);
    }
}

impl<R: Real> Sheared<R> {
    #[inline(always)]
    fn new(origin: R::Vec3, dir: R::Vec3) -> Sheared<R> {
        let (x, y, z) = (dir.x().abs(), dir.y().abs(), dir.z().abs());
        let along_x = x.ge(y) & x.ge(z);
        let along = [along_x, !along_x & y.ge(z)];
        let none = R::Mask::of(false);
        let [kx, ky, kz] = turned::<R>(dir, along, none);
        let swapped = kz.lt(R::of(0.0));
        let (kx, ky) = (R::select(swapped, ky, kx), R::select(swapped, kx, ky));
        let inverse = R::of(1.0) / kz;
        Sheared { origin, along, swapped, shear: [kx * inverse, ky * inverse, inverse] }
    }

    /// A corner relative to the rays' origins, sheared across them and along them.
    #[inline(always)]
    fn corner(&self, corner: R::Vec3) -> [R; 3] {
        let [x, y, z] = turned::<R>(corner - self.origin, self.along, self.swapped);
        [x - z * self.shear[0], y - z * self.shear[1], z * self.shear[2]]
    }

    /// Where rays hit a triangle. Nothing is left out where no ray does: some rays mostly do, and to guess that
    /// wrongly takes longer than the rest of the test.
    #[inline(always)]
    fn triangle<const N: usize>(&self, corners: [&[R; 3]; 3]) -> Met<R>
    where
        R: Lanes<N>,
    {
        let zero = R::of(0.0);
        let [a, b, c] = corners;
        let (a, b, c) = (*a, *b, *c);
        let (mut u, mut v, mut w) = (edge(c, b), edge(a, c), edge(b, a));
        let doubtful = Real::eq(u, zero) | Real::eq(v, zero) | Real::eq(w, zero);
        if doubtful.any() {
            let mut edges = [u.store(), v.store(), w.store()];
            let sheared = [[a[0].store(), a[1].store()], [b[0].store(), b[1].store()], [c[0].store(), c[1].store()]];
            exact(&mut edges, &sheared, doubtful.bits());
            (u, v, w) = (R::load(&edges[0]), R::load(&edges[1]), R::load(&edges[2]));
        }
        let outside = u.min(v).min(w).lt(zero) & u.max(v).max(w).gt(zero);
        let det = u + v + w;
        let t = (u * a[2] + v * b[2] + w * c[2]) / det;
        Met { t: R::select(!outside & t.gt(zero), t, R::of(f32::INFINITY)), v, w, divisor: det }
    }
}

/// The components by the axis along which the ray runs most, which is the last, and the two behind it, which may change
/// places.
#[inline(always)]
fn turned<R: Real>(v: R::Vec3, [along_x, along_y]: [R::Mask; 2], swapped: R::Mask) -> [R; 3] {
    let (x, y, z) = (v.x(), v.y(), v.z());
    let last = R::select(along_x, x, R::select(along_y, y, z));
    let first = R::select(along_x, y, R::select(along_y, z, x));
    let second = R::select(along_x, z, R::select(along_y, x, y));
    [R::select(swapped, second, first), R::select(swapped, first, second), last]
}

/// Twice the area of the triangle between the ray and an edge, as seen along the ray.
#[inline(always)]
fn edge<R: Real>(p: [R; 3], q: [R; 3]) -> R {
    p[0] * q[1] - p[1] * q[0]
}

/// The edge functions in double precision, in the lanes whose bits are set.
#[cold]
#[inline(never)]
fn exact<const N: usize>(edges: &mut [[f32; N]; 3], [a, b, c]: &[[[f32; N]; 2]; 3], lanes: u32) {
    for lane in set(lanes) {
        let edge = |p: &[[f32; N]; 2], q: &[[f32; N]; 2]| {
            let at = |row: &[f32; N]| f64::from(row[lane]);
            (at(&p[0]) * at(&q[1]) - at(&p[1]) * at(&q[0])) as f32
        };
        (edges[0][lane], edges[1][lane], edges[2][lane]) = (edge(c, b), edge(a, c), edge(b, a));
    }
}

/// What was made of these corners.
#[inline(always)]
fn of<R>(sheared: &[[R; 3]], [a, b, c]: [u8; 3]) -> [&[R; 3]; 3] {
    [&sheared[usize::from(a)], &sheared[usize::from(b)], &sheared[usize::from(c)]]
}

/// Where rays hit a sphere.
#[inline(always)]
fn sphere<R: Real>([origin, dir]: [R::Vec3; 2], center: R::Vec3, radius: f32) -> Met<R> {
    let zero = R::of(0.0);
    let f = origin - center;
    let b = -f.dot(dir);
    let nearest = f + dir * b;
    let r2 = R::of(radius * radius);
    let discriminant = r2 - nearest.length_squared();
    let c = f.length_squared() - r2;
    let q = b + discriminant.sqrt().copysign(b);
    let (t0, t1) = (c / q, q);
    let first = t0.lt(t1);
    let (near, far) = (R::select(first, t0, t1), R::select(first, t1, t0));
    let missed = discriminant.lt(zero) | Real::eq(q, zero);
    let t = R::select(missed, zero, R::select(near.gt(zero), near, far));
    Met { t: R::select(t.gt(zero), t, R::of(f32::INFINITY)), v: zero, w: zero, divisor: R::of(1.0) }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use glam::Vec2;

    use super::*;
    use crate::math::rng::{pcg4d, unit};
    use crate::render::cpu::lanes::Isa;
    use crate::render::hierarchy::AccelSpec;
    use crate::scene::compile::{MaskMode, Sphere, TriangleAttributes};
    use crate::scene::desc::{
        CameraDesc, Lookup, MaterialDesc, SceneDesc, Texels, TextureDesc, TextureSlot, texture_hash,
    };

    /// No shape; the first material has no mask, the second holes by a threshold, and the third is blended.
    fn materials() -> CompiledScene {
        let texels = Texels::RgbaF32([0.1, 0.9, 0.7, 0.3, 1.0, 0.0].map(|v| [v; 4]).to_vec());
        let content_hash = texture_hash(3, 2, &texels);
        let mask = Arc::new(TextureDesc { file: PathBuf::new(), width: 3, height: 2, texels, content_hash });
        let material = |mask_mode: Option<MaskMode>| {
            let mut material = MaterialDesc::new("m");
            if let Some(mode) = mask_mode {
                material.mask_mode = mode;
                material.lay_texture(TextureSlot::Mask, Arc::clone(&mask), Lookup::default());
            }
            material
        };
        let scene = SceneDesc {
            resolution: [1, 1],
            max_depth: 1,
            camera: CameraDesc::default(),
            views: Vec::new(),
            materials: [None, Some(MaskMode::Threshold), Some(MaskMode::Blend)].map(material).to_vec(),
            entities: Vec::new(),
            lights: Vec::new(),
            environment: None,
        };
        crate::scene::compile(&scene).unwrap().0
    }

    /// Triangles and rays through points of a coarse grid meet edges and corners exactly; some lie in one another, have no
    /// area, or are slivers. All else is anywhere. In a third of the scenes nothing has a mask, and in another all has.
    #[test]
    fn rays_meet_together_what_they_meet_alone() {
        let materials = materials();
        for width in [Width::eight(), Width::sixteen()].into_iter().flatten() {
            compare(width, &materials);
        }
    }

    fn compare(width: Width, materials: &CompiledScene) {
        let mut i = 0;
        let mut next = || {
            i += 1;
            unit(pcg4d([i, 5, 1, 77])[0])
        };
        let (mut hits, mut edges, mut covered) = (0, 0, 0);
        let [mut through, mut shown, mut tied, mut shown_spheres] = [0; 4];
        for scene in 0..90 {
            let grid = scene % 2 == 0;
            let mut point = |grid: bool| {
                let p = Vec3::new(next(), next(), next()) * 4.0 - 2.0;
                if grid { p.round() } else { p }
            };
            let mut triangles: Vec<[Vec3; 3]> = (0..11).map(|_| [0; 3].map(|_| point(grid))).collect();
            triangles.extend([triangles[2], triangles[3], [triangles[4][0]; 3]]);
            let centers = [0; 4].map(|_| point(grid));
            let mut rays: Vec<(Ray, f32)> = Vec::new();
            for k in 0..101 {
                let (origin, to) = (point(grid && k % 3 != 0), point(grid && k % 3 != 1));
                let dir = if k % 5 == 0 { Vec3::AXES[k % 3] * (1.0 - (k % 2) as f32 * 2.0) } else { to - origin };
                rays.push((Ray { origin, dir: dir.normalize_or(Vec3::X) }, [f32::INFINITY, 1.5][k % 2]));
            }
            for bad in [f32::NAN, f32::INFINITY] {
                rays.push((Ray { origin: Vec3::splat(bad), dir: Vec3::X }, 1.0));
                rays.push((Ray { origin: Vec3::ZERO, dir: Vec3::new(bad, 0.0, 1.0) }, 1.0));
            }
            let mut material = || match scene % 3 {
                0 => 0,
                1 => 1 + (next() * 2.0) as u32,
                _ => (next() * 3.0) as u32,
            };
            let attributes = triangles.iter().map(|_| TriangleAttributes {
                normals: [Vec3::Z; 3],
                uvs: [Vec2::ZERO, Vec2::X, Vec2::new(0.4, 1.3)],
                material: material(),
                emitter: NONE,
            });
            let attributes = attributes.collect();
            let radii = [0.5, 1.0, 0.7, 1.4];
            let spheres = [0, 1, 2, 3].map(|i| Sphere {
                center: centers[i],
                radius: radii[i],
                material: material(),
                emitter: NONE,
            });
            let scene = CompiledScene { triangles, attributes, spheres: spheres.into(), ..materials.clone() };
            let bare = CompiledScene { materials: vec![scene.materials[0]; 3], ..scene.clone() };
            let scene = Arc::new(scene);
            let built = |scene| Accel::build_as(scene, &AccelSpec::default(), Isa::Portable).unwrap();
            let (accel, bare) = (built(Arc::clone(&scene)), built(Arc::new(bare)));
            let few = Few::of(&accel, width).unwrap();
            let (mut found, mut hidden) = (Vec::new(), Vec::new());
            few.closest(&rays, &mut found);
            few.occluded(&rays, &mut hidden);
            assert_eq!([found.len(), hidden.len()], [rays.len(); 2]);
            for (((ray, t_max), found), hidden) in rays.iter().zip(found).zip(hidden) {
                let expected = accel.closest(ray, *t_max);
                let bits = |hit: Hit| ([hit.t, hit.uv[0], hit.uv[1]].map(f32::to_bits), hit.primitive, hit.instance);
                assert_eq!(found.map(bits), expected.map(bits), "{ray:?}");
                assert_eq!(hidden, expected.is_some(), "{ray:?}");
                through += usize::from(bare.closest(ray, *t_max) != expected);
                let Some(hit) = expected else { continue };
                hits += 1;
                let masked = |primitive: u32| scene.material_of(primitive, NONE) > 0;
                shown += usize::from(masked(hit.primitive));
                if hit.primitive < 14 {
                    edges += usize::from(hit.uv.contains(&0.0));
                    let twin = [2, 3].contains(&hit.primitive);
                    covered += usize::from(twin);
                    tied += usize::from(twin && masked(hit.primitive) && !masked(hit.primitive + 9));
                } else {
                    shown_spheres += usize::from(masked(hit.primitive));
                }
            }
        }
        assert!(hits > 1000 && edges > 100 && covered > 20, "{hits} {edges} {covered}");
        assert!(
            through > 200 && shown > 500 && tied > 10 && shown_spheres > 100,
            "{through} {shown} {tied} {shown_spheres}"
        );
    }
}
