//! Rays together, in scenes of few primitives: one primitive after the other is tested with eight rays in lanes, where a ray
//! by itself is tested with eight primitives. What every ray needs of its own is then made for eight at once, and corners that
//! triangles share are sheared once.
//!
//! Rays meet what they meet alone, to the bit: the tests are those of [`intersect`](super::super::intersect), operation by
//! operation, and of hits at the same distance the one with the lesser primitive counts.

use glam::Vec3;

use super::set;
use crate::math::lanes::{LANES, Reals, Row, Vectors, Yes, transposed};
use crate::math::real::{Mask, Real, Vector};
use crate::render::cpu::accel::{Accel, ONE_LEAF};
use crate::scene::CompiledScene;
use crate::scene::compile::NONE;
use crate::transport::ray::{Hit, Ray};

/// All primitives of a scene of few.
pub struct Few {
    /// Corners, those with the same coordinates once.
    corners: Vec<Vec3>,
    /// Of every triangle its corners.
    triangles: Vec<[u8; 3]>,
    /// Centre and radius.
    spheres: Vec<(Vec3, f32)>,
}

/// What eight rays need for the test of a triangle: see `ShearedRay`.
struct Sheared {
    origin: Vectors,
    /// Where the ray runs most along x; where along y.
    along: [Yes; 2],
    /// Where the two other axes change places.
    swapped: Yes,
    shear: [Reals; 3],
}

/// The best hits so far.
struct Best {
    t: Reals,
    v: Reals,
    w: Reals,
    primitive: Reals,
    found: Yes,
}

impl Few {
    /// For a hierarchy that is one leaf, in a scene where no mask decides.
    pub fn of(scene: &CompiledScene, accel: &Accel) -> Option<Few> {
        let few = accel.is_one_leaf() && scene.primitive_count() <= ONE_LEAF;
        few.then(|| Few::new(&scene.triangles, scene.spheres.iter().map(|s| (s.center, s.radius)).collect()))
    }

    /// Of these triangles, and then spheres.
    fn new(triangles: &[[Vec3; 3]], spheres: Vec<(Vec3, f32)>) -> Few {
        let bits = |v: Vec3| v.to_array().map(f32::to_bits);
        let mut corners: Vec<Vec3> = Vec::new();
        let mut index = |corner: Vec3| {
            let place = corners.iter().position(|c| bits(*c) == bits(corner));
            place.unwrap_or_else(|| {
                corners.push(corner);
                corners.len() - 1
            }) as u8
        };
        let triangles = triangles.iter().map(|t| t.map(&mut index)).collect();
        Few { corners, triangles, spheres }
    }

    /// The nearest hit of each ray with `0 < t < t_max`.
    pub fn closest(&self, rays: &[(Ray, f32)], hits: &mut Vec<Option<Hit>>) {
        #[expect(unsafe_code, reason = "a function that is compiled for AVX2")]
        // SAFETY: streams, and this with them, are made only where the processor has AVX2.
        unsafe {
            self.closest_avx2(rays, hits);
        }
    }

    /// Whether each ray hits anything with `0 < t < t_max`.
    pub fn occluded(&self, rays: &[(Ray, f32)], hidden: &mut Vec<bool>) {
        #[expect(unsafe_code, reason = "a function that is compiled for AVX2")]
        // SAFETY: as in `closest`.
        unsafe {
            self.occluded_avx2(rays, hidden);
        }
    }

    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    fn closest_avx2(&self, rays: &[(Ray, f32)], hits: &mut Vec<Option<Hit>>) {
        let mut scratch = self.scratch();
        for group in rays.chunks(LANES) {
            let best = self.eight::<false>(group, &mut scratch);
            let (found, t, v, w) = (best.found.bits(), best.t.store(), best.v.store(), best.w.store());
            let primitives = best.primitive.store();
            for i in 0..group.len() {
                let (t, uv, primitive) = (t.0[i], [v.0[i], w.0[i]], primitives.0[i].to_bits());
                hits.push((found & 1 << i != 0).then_some(Hit { t, primitive, instance: NONE, uv }));
            }
        }
    }

    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    fn occluded_avx2(&self, rays: &[(Ray, f32)], hidden: &mut Vec<bool>) {
        let mut scratch = self.scratch();
        for group in rays.chunks(LANES) {
            let found = self.eight::<true>(group, &mut scratch).found.bits();
            hidden.extend((0..group.len()).map(|i| found & 1 << i != 0));
        }
    }

    /// Room for all corners, sheared.
    #[inline(always)]
    fn scratch(&self) -> Vec<[Row; 3]> {
        vec![[Row::default(); 3]; self.corners.len()]
    }

    /// Up to eight rays; with `ANY` until each has hit something.
    #[inline(always)]
    fn eight<const ANY: bool>(&self, group: &[(Ray, f32)], sheared: &mut [[Row; 3]]) -> Best {
        let mut rows = [Row::default(); LANES];
        for (row, (Ray { origin: o, dir: d }, t_max)) in rows.iter_mut().zip(group) {
            *row = Row([o.x, o.y, o.z, d.x, d.y, d.z, *t_max, 0.0]);
        }
        let [x, y, z, u, v, w, t_max, _] = transposed(rows.each_ref());
        let (origin, dir) = (Vectors::new(x, y, z), Vectors::new(u, v, w));
        let zero = Reals::of(0.0);
        // A ray with a number that is not finite hits nothing.
        let usable = Yes::first(group.len()) & (origin + dir).element_sum().is_finite();
        let mut best = Best { t: t_max, v: zero, w: zero, primitive: zero, found: Yes::of(false) };
        let rays = Sheared::new(origin, dir);
        for (place, corner) in sheared.iter_mut().zip(&self.corners) {
            let [x, y, z] = rays.corner(Vectors::of(*corner));
            *place = [x.store(), y.store(), z.store()];
        }
        for (id, [a, b, c]) in self.triangles.iter().enumerate() {
            let corners = [&sheared[usize::from(*a)], &sheared[usize::from(*b)], &sheared[usize::from(*c)]];
            rays.triangle::<ANY>(corners, id as u32, usable, &mut best);
            if ANY && !(usable & !best.found).any() {
                return best;
            }
        }
        for (i, (center, radius)) in self.spheres.iter().enumerate() {
            let t = sphere([origin, dir], Vectors::of(*center), *radius);
            best.offer(usable & t.gt(zero), t, [zero; 2], (self.triangles.len() + i) as u32);
        }
        best
    }
}

impl Best {
    /// Takes hits that are nearer.
    #[inline(always)]
    fn offer(&mut self, met: Yes, t: Reals, [v, w]: [Reals; 2], primitive: u32) {
        let better = met & t.lt(self.t);
        self.t = Reals::select(better, t, self.t);
        self.v = Reals::select(better, v, self.v);
        self.w = Reals::select(better, w, self.w);
        self.primitive = Reals::select(better, Reals::of(f32::from_bits(primitive)), self.primitive);
        self.found = self.found | better;
    }
}

impl Sheared {
    #[inline(always)]
    fn new(origin: Vectors, dir: Vectors) -> Sheared {
        let (x, y, z) = (dir.x().abs(), dir.y().abs(), dir.z().abs());
        let along_x = x.ge(y) & x.ge(z);
        let along = [along_x, !along_x & y.ge(z)];
        let none = Yes::of(false);
        let [kx, ky, kz] = turned(dir, along, none);
        let swapped = kz.lt(Reals::of(0.0));
        let (kx, ky) = (Reals::select(swapped, ky, kx), Reals::select(swapped, kx, ky));
        let inverse = Reals::of(1.0) / kz;
        Sheared { origin, along, swapped, shear: [kx * inverse, ky * inverse, inverse] }
    }

    /// A corner relative to the rays' origins, sheared across them; along them not yet.
    #[inline(always)]
    fn corner(&self, corner: Vectors) -> [Reals; 3] {
        let [x, y, z] = turned(corner - self.origin, self.along, self.swapped);
        [x - z * self.shear[0], y - z * self.shear[1], z]
    }

    #[inline(always)]
    fn triangle<const ANY: bool>(&self, corners: [&[Row; 3]; 3], id: u32, usable: Yes, best: &mut Best) {
        let zero = Reals::of(0.0);
        let (a, b, c) = (loaded(corners[0]), loaded(corners[1]), loaded(corners[2]));
        let (mut u, mut v, mut w) = (edge(c, b), edge(a, c), edge(b, a));
        let doubtful = Real::eq(u, zero) | Real::eq(v, zero) | Real::eq(w, zero);
        if doubtful.any() {
            let mut edges = [u.store(), v.store(), w.store()];
            exact(&mut edges, corners, doubtful.bits());
            (u, v, w) = (Reals::load(&edges[0]), Reals::load(&edges[1]), Reals::load(&edges[2]));
        }
        let below = u.lt(zero) | v.lt(zero) | w.lt(zero);
        let above = u.gt(zero) | v.gt(zero) | w.gt(zero);
        let inside = usable & !(below & above);
        if !inside.any() {
            return;
        }
        let det = u + v + w;
        let shear = self.shear[2];
        let t = (u * (a[2] * shear) + v * (b[2] * shear) + w * (c[2] * shear)) / det;
        let met = inside & t.gt(zero);
        let weights = if ANY { [zero; 2] } else { [v / det, w / det] };
        best.offer(met, t, weights, id);
    }
}

/// The components by the axis along which the ray runs most, which is the last, and the two behind it, which may change
/// places.
#[inline(always)]
fn turned(v: Vectors, [along_x, along_y]: [Yes; 2], swapped: Yes) -> [Reals; 3] {
    let (x, y, z) = (v.x(), v.y(), v.z());
    let last = Reals::select(along_x, x, Reals::select(along_y, y, z));
    let first = Reals::select(along_x, y, Reals::select(along_y, z, x));
    let second = Reals::select(along_x, z, Reals::select(along_y, x, y));
    [Reals::select(swapped, second, first), Reals::select(swapped, first, second), last]
}

#[inline(always)]
fn loaded([x, y, z]: &[Row; 3]) -> [Reals; 3] {
    [Reals::load(x), Reals::load(y), Reals::load(z)]
}

/// Twice the area of the triangle between the ray and an edge, as seen along the ray.
#[inline(always)]
fn edge(p: [Reals; 3], q: [Reals; 3]) -> Reals {
    p[0] * q[1] - p[1] * q[0]
}

/// The edge functions in double precision, in the lanes whose bits are set.
#[cold]
#[inline(never)]
fn exact(edges: &mut [Row; 3], [a, b, c]: [&[Row; 3]; 3], lanes: u32) {
    for lane in set(lanes) {
        let edge = |p: &[Row; 3], q: &[Row; 3]| {
            let at = |row: &Row| f64::from(row.0[lane]);
            (at(&p[0]) * at(&q[1]) - at(&p[1]) * at(&q[0])) as f32
        };
        (edges[0].0[lane], edges[1].0[lane], edges[2].0[lane]) = (edge(c, b), edge(a, c), edge(b, a));
    }
}

/// Distances to a sphere; not above zero where it is not hit.
#[inline(always)]
fn sphere([origin, dir]: [Vectors; 2], center: Vectors, radius: f32) -> Reals {
    let zero = Reals::of(0.0);
    let f = origin - center;
    let b = -f.dot(dir);
    let nearest = f + dir * b;
    let r2 = Reals::of(radius * radius);
    let discriminant = r2 - nearest.length_squared();
    let c = f.length_squared() - r2;
    let q = b + discriminant.sqrt().copysign(b);
    let (t0, t1) = (c / q, q);
    let first = t0.lt(t1);
    let (near, far) = (Reals::select(first, t0, t1), Reals::select(first, t1, t0));
    let missed = discriminant.lt(zero) | Real::eq(q, zero);
    Reals::select(missed, zero, Reals::select(near.gt(zero), near, far))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::{pcg4d, unit};
    use crate::render::cpu::intersect::{self, ShearedRay};
    use crate::scene::compile::Sphere;

    /// The nearest hit by the tests of single rays, one primitive after the other.
    fn alone(triangles: &[[Vec3; 3]], spheres: &[Sphere], (ray, t_max): &(Ray, f32)) -> Option<Hit> {
        if !(ray.origin + ray.dir).element_sum().is_finite() {
            return None;
        }
        let sheared = ShearedRay::new(ray);
        let mut best: Option<Hit> = None;
        for primitive in 0..triangles.len() + spheres.len() {
            let within = best.map_or(*t_max, |hit| hit.t);
            let found = match triangles.get(primitive) {
                Some(corners) => intersect::triangle(corners, &sheared, within),
                None => intersect::sphere(&spheres[primitive - triangles.len()], ray, within).map(|t| (t, [0.0; 2])),
            };
            if let Some((t, uv)) = found.filter(|(t, _)| *t < within) {
                best = Some(Hit { t, primitive: primitive as u32, instance: NONE, uv });
            }
        }
        best
    }

    /// Triangles and rays through points of a coarse grid meet edges and corners exactly; some lie in one another, have no
    /// area, or are slivers. All else is anywhere.
    #[test]
    fn rays_meet_together_what_they_meet_alone() {
        if !std::arch::is_x86_feature_detected!("avx2") {
            return;
        }
        let mut i = 0;
        let mut next = || {
            i += 1;
            unit(pcg4d([i, 5, 1, 77])[0])
        };
        let mut point = |grid: bool| {
            let p = Vec3::new(next(), next(), next()) * 4.0 - 2.0;
            if grid { p.round() } else { p }
        };
        let (mut hits, mut edges, mut covered) = (0, 0, 0);
        for scene in 0..60 {
            let grid = scene % 2 == 0;
            let mut triangles: Vec<[Vec3; 3]> = (0..11).map(|_| [0; 3].map(|_| point(grid))).collect();
            triangles.extend([triangles[2], triangles[3], [triangles[4][0]; 3]]);
            let ball = |center, radius| Sphere { center, radius, material: 0, emitter: NONE };
            let spheres = [ball(point(grid), 0.5), ball(point(grid), 1.0)];
            let few = Few::new(&triangles, spheres.iter().map(|s| (s.center, s.radius)).collect());
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
            let (mut found, mut hidden) = (Vec::new(), Vec::new());
            few.closest(&rays, &mut found);
            few.occluded(&rays, &mut hidden);
            assert_eq!([found.len(), hidden.len()], [rays.len(); 2]);
            for ((ray, found), hidden) in rays.iter().zip(found).zip(hidden) {
                let expected = alone(&triangles, &spheres, ray);
                let bits = |hit: Hit| ([hit.t, hit.uv[0], hit.uv[1]].map(f32::to_bits), hit.primitive, hit.instance);
                assert_eq!(found.map(bits), expected.map(bits), "{ray:?}");
                assert_eq!(hidden, expected.is_some(), "{ray:?}");
                hits += usize::from(expected.is_some());
                let triangle = expected.filter(|hit| hit.primitive < 14);
                edges += usize::from(triangle.is_some_and(|hit| hit.uv.contains(&0.0)));
                covered += usize::from(triangle.is_some_and(|hit| [2, 3].contains(&hit.primitive)));
            }
        }
        assert!(hits > 1000 && edges > 100 && covered > 20, "{hits} {edges} {covered}");
    }
}
