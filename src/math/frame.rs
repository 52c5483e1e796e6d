//! Orthonormal frames.

use glam::Vec3;

/// A right-handed orthonormal frame whose third axis is a given unit vector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// First tangent.
    pub s: Vec3,
    /// Second tangent.
    pub t: Vec3,
    /// The given vector.
    pub n: Vec3,
}

impl Frame {
    /// The frame about a unit vector, without branches and without a singular direction [Duff et al. 2017].
    #[inline]
    pub fn from_normal(n: Vec3) -> Frame {
        let sign = 1.0f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Frame {
            s: Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            t: Vec3::new(b, sign + n.y * n.y * a, -n.y),
            n,
        }
    }

    /// World to local.
    #[inline]
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(v.dot(self.s), v.dot(self.t), v.dot(self.n))
    }

    /// Local to world.
    #[inline]
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.s * v.x + self.t * v.y + self.n * v.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_orthonormal_and_right_handed_everywhere() {
        let mut normals = vec![Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z];
        for i in 0..500u32 {
            let u = crate::math::rng::pcg4d([i, 1, 2, 3]).map(crate::math::rng::unit);
            normals.push(crate::math::warp::uniform_sphere([u[0], u[1]]));
        }
        for n in normals {
            let f = Frame::from_normal(n);
            assert!((f.s.cross(f.t) - f.n).length() < 1e-5, "{n}");
            assert!(f.s.dot(f.n).abs() < 1e-6 && (f.s.length() - 1.0).abs() < 1e-5, "{n}");
            let v = Vec3::new(0.3, -0.7, 0.2);
            assert!((f.to_world(f.to_local(v)) - v).length() < 1e-5);
        }
    }
}
