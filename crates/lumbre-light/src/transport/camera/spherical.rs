//! Spherical cameras: rays from a point in all directions.
//!
//! Film coordinates are angles. The longitude grows to the right, from -pi at the left edge over 0
//! in the viewing direction to pi; the latitude falls from pi / 2, the camera's up direction, at the
//! upper edge to -pi / 2. A map of an environment is such a picture, seen towards +z.
//!
//! The pole of the polar angle `theta = pi / 2 - latitude` is the up direction, and `dw = sin theta
//! d theta d phi`; film positions are uniform over `2 pi` times `pi`. So the density of directions
//! per solid angle is `1 / (2 pi^2 sin theta)`. Pixels near the poles are means over small solid
//! angles, with the same number of samples as others.
//!
//! A filter that reaches beyond an edge continues on the sphere: columns wrap around, and rows are
//! reflected at the poles ([`FilmEdge`](super::filter::FilmEdge)), so that every direction has the
//! same sum of filters whichever strategy finds it.

use super::lens::Camera;
use crate::math::real::{Real, Vector};
use crate::math::simd::map_array;
use crate::math::trig;

impl Camera {
    /// Returns the unit direction at angles in radians: the longitude, and the latitude counted
    /// downwards, which may lie beyond the poles and is then reflected.
    #[inline(always)]
    pub(super) fn direction_at<V: Vector>(&self, [longitude, down]: [V::Scalar; 2]) -> V {
        let (sin_x, cos_x) = trig::sin_cos(longitude);
        let (sin_y, cos_y) = trig::sin_cos(down);
        let [right, up, forward] = map_array([self.right, self.up, self.forward], V::broadcast);
        let level = right * sin_x + forward * cos_x;
        (level * cos_y.abs() - up * sin_y).normalize_or(forward)
    }

    /// Returns the angles of a unit direction, as [`Camera::direction_at`] takes them, from -pi to
    /// pi, exclusive, and from -pi / 2 to pi / 2.
    #[inline(always)]
    pub(super) fn angles_of<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(&self, dir: V) -> [R; 2] {
        let [right, up, forward] = map_array([self.right, self.up, self.forward], V::broadcast);
        let longitude = dir.dot(right).zip_lanes(dir.dot(forward), f32::atan2);
        let down = (-dir.dot(up)).zip_lanes(self.sin_theta(dir), f32::atan2);
        // The right edge is the left one.
        let edge = R::splat(std::f32::consts::PI);
        [R::select(longitude.lt(edge), longitude, -edge), down]
    }

    /// Returns the sine of the angle between a unit direction and the camera's up direction.
    #[inline(always)]
    pub(super) fn sin_theta<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(&self, dir: V) -> R {
        let (x, z) = (
            dir.dot(V::broadcast(self.right)),
            dir.dot(V::broadcast(self.forward)),
        );
        (x * x + z * z).sqrt()
    }

    /// Returns where a direction is no pole, at which the density has no value.
    #[inline(always)]
    pub(super) fn off_poles<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(&self, dir: V) -> R::Mask {
        self.sin_theta(dir).gt(R::splat(0.0)) & dir.is_finite()
    }
}
