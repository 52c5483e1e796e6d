//! Tests of one ray against eight triangles at once, against one triangle, and against a sphere.
//!
//! The triangle tests are watertight and give the same bits as each other; the vectorised tests in
//! `wavefront::small_scene` repeat them operation by operation.

use glam::Vec3;

use super::simd::{LANES, LaneArray, Simd8};
use lumbre_light::scene::compile::Sphere;
use lumbre_light::transport::ray::Ray;

/// Ray with the precomputed values of the triangle test [Woop et al. 2013].
#[derive(Clone, Copy, Debug)]
pub struct ShearedRay {
    /// Origin, with its components in the order of `axes`.
    origin: [f32; 3],
    /// Axes x, y and z of the sheared space; z is that of the largest direction component.
    axes: [usize; 3],
    /// Shear in x and y and scale in z that map the direction to the unit vector of z.
    shear: [f32; 3],
}

impl ShearedRay {
    /// Computes the shear of a ray.
    #[inline]
    pub fn new(ray: &Ray) -> ShearedRay {
        let d = ray.dir.to_array();
        let size = ray.dir.abs();
        let kz = if size.x >= size.y && size.x >= size.z {
            0
        } else if size.y >= size.z {
            1
        } else {
            2
        };
        let (mut kx, mut ky) = ((kz + 1) % 3, (kz + 2) % 3);
        if d[kz] < 0.0 {
            std::mem::swap(&mut kx, &mut ky);
        }
        let o = ray.origin.to_array();
        let inverse = 1.0 / d[kz];
        ShearedRay {
            origin: [o[kx], o[ky], o[kz]],
            axes: [kx, ky, kz],
            shear: [d[kx] * inverse, d[ky] * inverse, inverse],
        }
    }
}

/// Up to eight triangles; lane `i` of every array belongs to triangle `i`.
#[derive(Clone, Debug)]
pub struct TriangleBlock {
    /// Coordinates by corner and axis. Lanes without a triangle hold NaN, which no ray hits.
    corners: [[LaneArray; 3]; 3],
}

impl TriangleBlock {
    /// Creates a block of the given triangles; lanes without one are never hit.
    pub fn new(triangles: [Option<[Vec3; 3]>; LANES]) -> TriangleBlock {
        let lanes = triangles.map(|t| t.unwrap_or([Vec3::NAN; 3]));
        let corner = |c: usize| [0, 1, 2].map(|axis| LaneArray(lanes.map(|t| t[c][axis])));
        TriangleBlock {
            corners: [0, 1, 2].map(corner),
        }
    }

    /// Returns a coordinate of a corner of the triangle in a lane.
    #[inline(always)]
    pub fn coordinate(&self, corner: usize, axis: usize, lane: usize) -> f32 {
        self.corners[corner][axis].0[lane]
    }

    /// Intersects the ray with all triangles and returns those that it hits with `0 < t <= t_max`.
    ///
    /// The test is watertight: a ray through a shared edge or corner hits one of the triangles,
    /// since both compute the same edge function and zero counts as inside. An edge function that
    /// is exactly zero in single precision is recomputed in double precision.
    #[inline(always)]
    pub fn intersect<L: Simd8>(&self, ray: &ShearedRay, t_max: f32) -> BlockHit<L> {
        // No closures or maps here: they cannot be force-inlined, and code that is not inlined is
        // not compiled for the caller's instruction set.
        let (a, b, c) = (
            self.sheared::<L>(0, ray),
            self.sheared::<L>(1, ray),
            self.sheared::<L>(2, ray),
        );
        let (mut u, mut v, mut w) = (edge(c, b), edge(a, c), edge(b, a));
        let zero = L::splat(0.0);
        let on_edge = u.eq(zero) | v.eq(zero) | w.eq(zero);
        if on_edge != 0 {
            let mut edges = [u.store(), v.store(), w.store()];
            recompute_in_f64(
                &mut edges,
                [
                    [a[0].store(), a[1].store()],
                    [b[0].store(), b[1].store()],
                    [c[0].store(), c[1].store()],
                ],
                on_edge,
            );
            (u, v, w) = (L::load(&edges[0]), L::load(&edges[1]), L::load(&edges[2]));
        }
        let outside = u.min(v).min(w).lt(zero) & zero.lt(u.max(v).max(w));
        let det = u.add(v).add(w);
        let shear = L::splat(ray.shear[2]);
        let (za, zb, zc) = (a[2].mul(shear), b[2].mul(shear), c[2].mul(shear));
        let t = u.mul(za).add(v.mul(zb)).add(w.mul(zc)).div(det);
        // If `det == 0`, t is infinite or NaN and the comparisons are false.
        let within = zero.lt(t) & t.le(L::splat(t_max));
        BlockHit {
            lanes: within & !outside,
            t,
            v,
            w,
            det,
        }
    }

    /// Returns one corner of all triangles relative to the ray's origin, sheared in x and y but not
    /// scaled in z.
    #[inline(always)]
    fn sheared<L: Simd8>(&self, corner: usize, ray: &ShearedRay) -> [L; 3] {
        let [kx, ky, kz] = ray.axes;
        let rows = &self.corners[corner];
        let z = L::load(&rows[kz]).sub(L::splat(ray.origin[2]));
        let x = L::load(&rows[kx])
            .sub(L::splat(ray.origin[0]))
            .sub(z.mul(L::splat(ray.shear[0])));
        let y = L::load(&rows[ky])
            .sub(L::splat(ray.origin[1]))
            .sub(z.mul(L::splat(ray.shear[1])));
        [x, y, z]
    }
}

/// Returns the edge function: twice the area of the triangle between the ray and an edge, as seen
/// along the ray.
#[inline(always)]
fn edge<L: Simd8>(p: [L; 3], q: [L; 3]) -> L {
    p[0].mul(q[1]).sub(p[1].mul(q[0]))
}

/// Recomputes the edge functions of the given lanes in double precision.
#[cold]
#[inline(never)]
fn recompute_in_f64(edges: &mut [LaneArray; 3], [a, b, c]: [[LaneArray; 2]; 3], lanes: u32) {
    for lane in (0..LANES).filter(|lane| lanes & (1 << lane) != 0) {
        let edge = |p: &[LaneArray; 2], q: &[LaneArray; 2]| {
            let at = |row: &LaneArray| f64::from(row.0[lane]);
            (at(&p[0]) * at(&q[1]) - at(&p[1]) * at(&q[0])) as f32
        };
        (edges[0].0[lane], edges[1].0[lane], edges[2].0[lane]) =
            (edge(&c, &b), edge(&a, &c), edge(&b, &a));
    }
}

/// Intersection of a ray with the triangles of a block.
#[derive(Clone, Copy, Debug)]
pub struct BlockHit<L> {
    /// Mask of the triangles that are hit, one bit per lane.
    pub lanes: u32,
    t: L,
    v: L,
    w: L,
    det: L,
}

impl<L: Simd8> BlockHit<L> {
    /// Returns the distances to the triangles; valid in the lanes that are hit.
    #[inline(always)]
    pub fn t(&self) -> LaneArray {
        self.t.store()
    }

    /// Returns the barycentric weights of a triangle's second and third corner.
    #[inline(always)]
    pub fn uv(&self, lane: usize) -> [f32; 2] {
        let det = self.det.store().0[lane];
        [self.v.store().0[lane] / det, self.w.store().0[lane] / det]
    }
}

/// Intersects the ray with one triangle. Returns the distance and the barycentric weights of the
/// second and third corner, if `0 < t <= t_max`. The operations, and so the bits, are those of
/// [`TriangleBlock::intersect`].
#[inline]
pub fn triangle(corners: &[Vec3; 3], ray: &ShearedRay, t_max: f32) -> Option<(f32, [f32; 2])> {
    let [kx, ky, kz] = ray.axes;
    let [a, b, c] = corners.map(|p| {
        let z = p[kz] - ray.origin[2];
        [
            p[kx] - ray.origin[0] - z * ray.shear[0],
            p[ky] - ray.origin[1] - z * ray.shear[1],
            z,
        ]
    });
    let edge = |p: [f32; 3], q: [f32; 3]| p[0] * q[1] - p[1] * q[0];
    let (mut u, mut v, mut w) = (edge(c, b), edge(a, c), edge(b, a));
    if u == 0.0 || v == 0.0 || w == 0.0 {
        let edge_in_f64 = |p: [f32; 3], q: [f32; 3]| {
            (f64::from(p[0]) * f64::from(q[1]) - f64::from(p[1]) * f64::from(q[0])) as f32
        };
        (u, v, w) = (edge_in_f64(c, b), edge_in_f64(a, c), edge_in_f64(b, a));
    }
    if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
        return None;
    }
    let det = u + v + w;
    let [za, zb, zc] = [a, b, c].map(|p| p[2] * ray.shear[2]);
    let t = (u * za + v * zb + w * zc) / det;
    (0.0 < t && t <= t_max).then(|| (t, [v / det, w / det]))
}

/// Returns the distance to a sphere, if the ray hits it with `0 < t <= t_max`.
#[inline]
pub fn sphere(sphere: &Sphere, ray: &Ray, t_max: f32) -> Option<f32> {
    let [near, far] = sphere_crossings(sphere, ray)?;
    let t = if near > 0.0 { near } else { far };
    (t > 0.0 && t <= t_max).then_some(t)
}

/// Returns the distance at which the ray leaves a sphere that it has entered with `t > 0`, if that
/// is at most `t_max`.
#[inline]
pub fn sphere_exit(sphere: &Sphere, ray: &Ray, t_max: f32) -> Option<f32> {
    let [near, far] = sphere_crossings(sphere, ray)?;
    (near > 0.0 && far <= t_max).then_some(far)
}

/// Returns the distances, positive or not, at which the line of a ray enters and leaves a sphere. The
/// formula stays accurate for small and for distant spheres [Haines et al. 2019].
#[inline]
fn sphere_crossings(sphere: &Sphere, ray: &Ray) -> Option<[f32; 2]> {
    let f = ray.origin - sphere.center;
    let b = -f.dot(ray.dir);
    let nearest = f + ray.dir * b;
    let r2 = sphere.radius * sphere.radius;
    let discriminant = r2 - nearest.length_squared();
    if discriminant < 0.0 {
        return None;
    }
    let c = f.length_squared() - r2;
    let q = b + discriminant.sqrt().copysign(b);
    if q == 0.0 {
        return None;
    }
    let (t0, t1) = (c / q, q);
    Some(if t0 < t1 { [t0, t1] } else { [t1, t0] })
}
