//! Orthographic cameras: parallel rays from a rectangle.
//!
//! Rays start at the rectangle `F` of the film in world space, which is centred on the camera's
//! position and perpendicular to the viewing direction `d`; what lies behind its plane is not seen.
//! The measurement of the whole picture is the mean of the radiance over the rectangle,
//!
//! ```text
//! I = 1/A * integral over p in F of L(p, -d) dA(p),    A = area of F.
//! ```
//!
//! The emitted importance [Veach 1997, 8.3.2] is thus a Dirac distribution in direction, `W_e(p, w)
//! = delta(w - d) / (A |cos(w, d)|)`. A point `x` with normal `n` on the first surface is met by
//! one ray, that from `p = x - ((x - o) . d) d`, with `o` the position. Areas on the surface are
//! projected along `d`: `dA(p) = |n . d| dA(x)`, without the squared distance. So
//!
//! ```text
//! I = integral over x of L(x, -d) |n . d| / A dA(x),
//! ```
//!
//! from which both numbers of the strategies follow. A camera path generates `x` with the density
//! `|n . d| / A` per area. A light path that is connected to the camera at `x` adds its throughput
//! times `f |n . d| / A`. A perspective camera has `pdf_w / distance^2` in the place of `1 / A`.
//! [`Projection::pdf_w`] is therefore `distance^2 / A` here, from which both follow by the formulas
//! of the other cameras.
//!
//! Light from infinity that a camera ray meets directly has the direction `d` with certainty. No
//! light path starts in that direction with any density, so only camera paths find it.

use super::lens::{Camera, Projection};
use crate::math::real::{Real, Vector};

impl Camera {
    /// Returns a ray through a film position in scene units from the centre, to the right and
    /// downwards.
    #[inline(always)]
    pub(super) fn parallel_ray<V: Vector>(&self, [x, y]: [V::Scalar; 2]) -> [V; 2] {
        let forward = V::broadcast(self.forward);
        [self.plane_point([x, -y]), forward]
    }

    /// Projects scene points along the viewing direction.
    #[inline(always)]
    pub(super) fn project_parallel<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(
        &self,
        point: V,
    ) -> Projection<V> {
        let forward = V::broadcast(self.forward);
        let to = point - V::broadcast(self.position);
        let distance = to.dot(forward);
        let at = [
            to.dot(V::broadcast(self.right)),
            to.dot(V::broadcast(self.up)),
        ];
        Projection {
            ahead: distance.gt(R::splat(0.0)) & point.is_finite(),
            raster: self.raster([at[0], -at[1]]),
            lens: self.plane_point(at),
            dir: forward,
            distance,
            pdf_w: self.pdf_w_at(forward, distance),
        }
    }
}
