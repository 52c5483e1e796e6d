//! The bounding sphere of all surfaces: infinitely distant lights start their paths on a disk that
//! covers it.

use std::f32::consts::PI;

use glam::Vec3;

use crate::math::real::{Real, Vector};
use crate::math::{Frame, warp};
use crate::scene::CompiledScene;

/// Factor on the radius, so that rounding leaves no corner outside.
const MARGIN: f32 = 1.0 + 1e-5;

/// A sphere that contains every surface of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundingSphere {
    pub center: Vec3,
    pub radius: f32,
}

impl BoundingSphere {
    /// Returns the sphere about the middle of the scene's bounding box; radius zero without
    /// surfaces.
    pub fn for_scene(scene: &CompiledScene) -> BoundingSphere {
        let ([low, high], radius) = scene.bounds_and_radius();
        BoundingSphere {
            center: low + (high - low) * 0.5,
            radius: radius * MARGIN,
        }
    }

    /// Returns the area of a disk of the sphere's radius.
    pub fn disk_area(&self) -> f32 {
        PI * self.radius * self.radius
    }

    /// Returns the density per area of a point of that disk; zero without surfaces.
    #[inline]
    pub fn pdf_a(&self) -> f32 {
        if self.radius > 0.0 {
            1.0 / self.disk_area()
        } else {
            0.0
        }
    }

    /// Returns a point outside the sphere in direction `wi` from `from`, as the point of an
    /// infinitely distant light.
    #[inline(always)]
    pub fn outside<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(&self, from: V, wi: V) -> V {
        let distance =
            (from - V::broadcast(self.center)).length() + R::splat(2.0) * R::splat(self.radius);
        from + wi * distance
    }

    /// Samples a point uniform over the disk that touches the sphere and faces it along its normal
    /// `dir`.
    #[inline(always)]
    pub fn on_disk<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(&self, dir: V, u: [R; 2]) -> V {
        let radius = R::splat(self.radius);
        let [x, y] = warp::concentric_disk_lanes(u);
        let local = V::new(x * radius, y * radius, -radius);
        V::broadcast(self.center) + Frame::from_normal(dir).to_world(local)
    }
}
