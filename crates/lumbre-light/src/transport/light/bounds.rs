//! The bounding sphere of all surfaces: infinitely distant lights start their paths on a disk that
//! covers it.

use std::f32::consts::PI;

use glam::Vec3;

use super::{LightId, LightPoint};
use crate::math::{Frame, warp};
use crate::scene::CompiledScene;
use crate::scene::compile::Uv;

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
    #[inline]
    pub fn outside(&self, light: LightId, from: Vec3, wi: Vec3) -> LightPoint {
        let distance = from.distance(self.center) + 2.0 * self.radius;
        LightPoint {
            light,
            position: from + wi * distance,
            normal: -wi,
            uv: Uv::default(),
        }
    }

    /// Samples a point uniform over the disk that touches the sphere and faces it along its normal
    /// `dir`.
    #[inline]
    pub fn on_disk(&self, light: LightId, dir: Vec3, u: [f32; 2]) -> LightPoint {
        let d = warp::concentric_disk(u) * self.radius;
        let position =
            self.center + Frame::from_normal(dir).to_world(Vec3::new(d.x, d.y, -self.radius));
        LightPoint {
            light,
            position,
            normal: dir,
            uv: Uv::default(),
        }
    }
}
