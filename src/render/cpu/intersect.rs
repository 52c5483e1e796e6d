//! Ray-primitive intersection.

use glam::Vec3;

use crate::scene::compile::Sphere;
use crate::transport::ray::Ray;

/// A ray with what every triangle test needs of it [Woop et al. 2013]: the axis along which it runs most, the two
/// others, and the shear that makes it run along that axis alone.
#[derive(Clone, Copy, Debug)]
pub struct ShearedRay {
    pub origin: Vec3,
    k: [usize; 3],
    shear: Vec3,
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
        ShearedRay { origin: ray.origin, k: [kx, ky, kz], shear: Vec3::new(d[kx] / d[kz], d[ky] / d[kz], 1.0 / d[kz]) }
    }

    #[inline(always)]
    fn sheared(&self, p: Vec3) -> Vec3 {
        let p = p - self.origin;
        let (x, y, z) = match self.k {
            [1, 2, 0] => (p.y, p.z, p.x),
            [2, 1, 0] => (p.z, p.y, p.x),
            [2, 0, 1] => (p.z, p.x, p.y),
            [0, 2, 1] => (p.x, p.z, p.y),
            [0, 1, 2] => (p.x, p.y, p.z),
            _ => (p.y, p.x, p.z),
        };
        Vec3::new(x - self.shear.x * z, y - self.shear.y * z, self.shear.z * z)
    }

    /// Distance and barycentric weights of the second and third corner, if the triangle is hit with `0 < t < t_max`.
    ///
    /// Watertight: a ray through a shared edge or corner hits one of the triangles, since both see the same edge
    /// function and a zero counts as inside. Where single precision says exactly zero, double precision decides.
    #[inline(always)]
    pub fn triangle(&self, corners: &[Vec3; 3], t_max: f32) -> Option<(f32, [f32; 2])> {
        let a = self.sheared(corners[0]);
        let b = self.sheared(corners[1]);
        let c = self.sheared(corners[2]);
        let mut u = c.x * b.y - c.y * b.x;
        let mut v = a.x * c.y - a.y * c.x;
        let mut w = b.x * a.y - b.y * a.x;
        if u == 0.0 || v == 0.0 || w == 0.0 {
            let exact = |p: Vec3, q: Vec3| (f64::from(p.x) * f64::from(q.y) - f64::from(p.y) * f64::from(q.x)) as f32;
            (u, v, w) = (exact(c, b), exact(a, c), exact(b, a));
        }
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let det = u + v + w;
        let t = (u * a.z + v * b.z + w * c.z) / det;
        // Also refuses det == 0, where t is infinite or NaN.
        (t > 0.0 && t < t_max).then(|| (t, [v / det, w / det]))
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
