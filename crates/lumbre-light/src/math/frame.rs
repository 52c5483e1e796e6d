//! Orthonormal frames about a unit vector, scalar or vectorised.

use glam::Vec3;

use super::real::{Real, Vector};

/// A right-handed orthonormal frame whose third axis is a given unit vector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame<V: Vector = Vec3> {
    /// First unit tangent.
    pub s: V,
    /// Second unit tangent.
    pub t: V,
    /// The given unit vector.
    pub n: V,
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> Frame<V> {
    /// Builds a frame about a unit vector, without branches or a singular direction [Duff et al.
    /// 2017].
    #[inline(always)]
    pub fn from_normal(n: V) -> Frame<V> {
        let [x, y, z] = [n.x(), n.y(), n.z()];
        let sign = R::splat(1.0).copysign(z);
        let a = R::splat(-1.0) / (sign + z);
        let b = x * y * a;
        Frame {
            s: V::new(R::splat(1.0) + sign * x * x * a, sign * b, -sign * x),
            t: V::new(b, sign + y * y * a, -y),
            n,
        }
    }

    /// Transforms a vector from world space to the local frame.
    #[inline(always)]
    pub fn to_local(&self, v: V) -> V {
        V::new(v.dot(self.s), v.dot(self.t), v.dot(self.n))
    }

    /// Transforms a vector from the local frame to world space.
    #[inline(always)]
    pub fn to_world(&self, v: V) -> V {
        self.s * v.x() + self.t * v.y() + self.n * v.z()
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
            assert!(
                f.s.dot(f.n).abs() < 1e-6 && (f.s.length() - 1.0).abs() < 1e-5,
                "{n}"
            );
            let v = Vec3::new(0.3, -0.7, 0.2);
            assert!((f.to_world(f.to_local(v)) - v).length() < 1e-5);
        }
    }
}
