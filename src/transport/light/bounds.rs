//! The ball around all surfaces: lights without a place start their paths on a disk that covers it.

use std::f32::consts::PI;

use glam::Vec3;

use super::{LightId, LightPoint};
use crate::math::{Frame, warp};
use crate::scene::CompiledScene;
use crate::scene::compile::Uv;

/// Rounding must not leave a corner outside.
const MARGIN: f32 = 1.0 + 1e-5;

/// A ball that holds every surface of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ball {
    pub center: Vec3,
    pub radius: f32,
}

impl Ball {
    /// The ball about the middle of the scene's box; radius zero without surfaces.
    pub fn around(scene: &CompiledScene) -> Ball {
        let ([low, high], radius) = scene.around();
        Ball { center: low + (high - low) * 0.5, radius: radius * MARGIN }
    }

    /// Area of a disk of the ball's radius.
    pub fn disk_area(&self) -> f32 {
        PI * self.radius * self.radius
    }

    /// Density per area of a point of the disk; zero without surfaces.
    #[inline]
    pub fn pdf_a(&self) -> f32 {
        if self.radius > 0.0 { 1.0 / self.disk_area() } else { 0.0 }
    }

    /// The point outside the ball that a light without a place has in direction `wi` from a point.
    #[inline]
    pub fn outside(&self, light: LightId, from: Vec3, wi: Vec3) -> LightPoint {
        let distance = from.distance(self.center) + 2.0 * self.radius;
        LightPoint { light, position: from + wi * distance, normal: -wi, uv: Uv::default() }
    }

    /// A point uniform over the disk that touches the ball and whose normal `dir` looks at it.
    #[inline]
    pub fn on_disk(&self, light: LightId, dir: Vec3, u: [f32; 2]) -> LightPoint {
        let d = warp::concentric_disk(u) * self.radius;
        let position = self.center + Frame::from_normal(dir).to_world(Vec3::new(d.x, d.y, -self.radius));
        LightPoint { light, position, normal: dir, uv: Uv::default() }
    }
}
