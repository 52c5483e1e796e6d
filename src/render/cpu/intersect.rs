//! Ray-primitive intersection.

use glam::{Vec3, Vec4};

use crate::scene::compile::Sphere;
use crate::transport::ray::Ray;

/// Triangles in one block, tested together.
pub const LANES: usize = 4;

/// A ray with what every triangle test needs of it [Woop et al. 2013]: the axis along which it runs most, the two
/// others, and the shear that makes it run along that axis alone.
#[derive(Clone, Copy, Debug)]
pub struct ShearedRay {
    origin: [f32; 3],
    k: [usize; 3],
    shear: [f32; 3],
}

impl ShearedRay {
    #[inline]
    pub fn new(ray: &Ray) -> ShearedRay {
        let d = ray.dir.to_array();
        let a = ray.dir.abs();
        let kz = if a.x >= a.y && a.x >= a.z {
            0
        } else if a.y >= a.z {
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
            k: [kx, ky, kz],
            shear: [d[kx] * inverse, d[ky] * inverse, inverse],
        }
    }
}

/// Up to four triangles; lane `i` of every vector belongs to triangle `i`.
#[derive(Clone, Debug)]
pub struct TriangleBlock {
    /// By corner and axis. Lanes without a triangle hold NaN, which nothing hits.
    corners: [[Vec4; 3]; 3],
}

impl TriangleBlock {
    /// A block of the given triangles; missing ones are never hit.
    pub fn new(triangles: [Option<[Vec3; 3]>; LANES]) -> TriangleBlock {
        let lanes = triangles.map(|t| t.unwrap_or([Vec3::NAN; 3]));
        let corner = |c: usize| [0, 1, 2].map(|axis| Vec4::from_array(lanes.map(|t| t[c][axis])));
        TriangleBlock { corners: [0, 1, 2].map(corner) }
    }

    /// The triangles that the ray hits with `0 < t < t_max`.
    ///
    /// Watertight: a ray through a shared edge or corner hits one of the triangles, since both see the same edge
    /// function and a zero counts as inside. Where single precision says exactly zero, double precision decides.
    #[inline(always)]
    pub fn intersect(&self, ray: &ShearedRay, t_max: f32) -> BlockHit {
        let [kx, ky, kz] = ray.k;
        let sheared = |c: usize| {
            let z = self.corners[c][kz] - Vec4::splat(ray.origin[2]);
            let x = self.corners[c][kx] - Vec4::splat(ray.origin[0]) - z * Vec4::splat(ray.shear[0]);
            let y = self.corners[c][ky] - Vec4::splat(ray.origin[1]) - z * Vec4::splat(ray.shear[1]);
            [x, y, z * Vec4::splat(ray.shear[2])]
        };
        let (a, b, c) = (sheared(0), sheared(1), sheared(2));
        let mut u = c[0] * b[1] - c[1] * b[0];
        let mut v = a[0] * c[1] - a[1] * c[0];
        let mut w = b[0] * a[1] - b[1] * a[0];
        let zero = (u.cmpeq(Vec4::ZERO) | v.cmpeq(Vec4::ZERO) | w.cmpeq(Vec4::ZERO)).bitmask();
        if zero != 0 {
            for lane in (0..LANES).filter(|lane| zero & (1 << lane) != 0) {
                (u[lane], v[lane], w[lane]) = (exact(c, b, lane), exact(a, c, lane), exact(b, a, lane));
            }
        }
        let least = u.min(v).min(w);
        let greatest = u.max(v).max(w);
        let outside = least.cmplt(Vec4::ZERO) & greatest.cmpgt(Vec4::ZERO);
        let det = u + v + w;
        let t = (u * a[2] + v * b[2] + w * c[2]) / det;
        // Comparisons with what `det == 0` makes, infinite or NaN, are false.
        let within = t.cmpgt(Vec4::ZERO) & t.cmplt(Vec4::splat(t_max));
        BlockHit { lanes: within.bitmask() & !outside.bitmask(), t, v, w, det }
    }
}

/// An edge function in double precision.
#[cold]
fn exact(p: [Vec4; 3], q: [Vec4; 3], lane: usize) -> f32 {
    let at = |v: Vec4| f64::from(v[lane]);
    (at(p[0]) * at(q[1]) - at(p[1]) * at(q[0])) as f32
}

/// Where a ray met the triangles of a block.
#[derive(Clone, Copy, Debug)]
pub struct BlockHit {
    /// Bit `i` is set where triangle `i` is hit.
    pub lanes: u32,
    t: Vec4,
    v: Vec4,
    w: Vec4,
    det: Vec4,
}

impl BlockHit {
    /// Distance to a triangle that is hit.
    #[inline(always)]
    pub fn t(&self, lane: usize) -> f32 {
        self.t[lane]
    }

    /// Barycentric weights of its second and third corner.
    #[inline(always)]
    pub fn uv(&self, lane: usize) -> [f32; 2] {
        [self.v[lane] / self.det[lane], self.w[lane] / self.det[lane]]
    }
}

/// Distance to a sphere, if it is hit with `0 < t < t_max`, in the form that keeps its digits for small and for distant
/// spheres [Haines et al. 2019].
#[inline]
pub fn sphere(sphere: &Sphere, ray: &Ray, t_max: f32) -> Option<f32> {
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
    let (near, far) = if t0 < t1 { (t0, t1) } else { (t1, t0) };
    let t = if near > 0.0 { near } else { far };
    (t > 0.0 && t < t_max).then_some(t)
}
