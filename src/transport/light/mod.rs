//! Light sources: emissive triangles and spheres, and the choice among them.
//!
//! A point of a light is drawn uniformly over the emitting area of the whole scene: an emitter with the probability of
//! its share of the area, then a point on it. The density is then `1 / total area` exactly, whatever the sizes.

use glam::Vec3;

use crate::math::distribution::Discrete;
use crate::math::warp;
use crate::scene::CompiledScene;

/// All light sources of a scene.
#[derive(Clone, Debug)]
pub struct Lights {
    by_area: Option<Discrete>,
}

/// A point on a light source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightPoint {
    /// Primitive id of the emitter.
    pub primitive: u32,
    /// Barycentric weights of the second and third corner on a triangle; zero on a sphere.
    pub uv: [f32; 2],
    /// Position in world space.
    pub position: Vec3,
    /// Unit normal on the emitting side.
    pub normal: Vec3,
    /// Density per area.
    pub pdf_a: f32,
}

impl Lights {
    /// Gathers the emitters of a scene.
    pub fn new(scene: &CompiledScene) -> Lights {
        Lights { by_area: Discrete::new(scene.emitters.iter().map(|e| e.area)) }
    }

    /// Total emitting area in square scene units; zero without lights.
    pub fn total_area(&self) -> f64 {
        self.by_area.as_ref().map_or(0.0, Discrete::total)
    }

    /// A point uniform over the emitting area; `None` without lights.
    pub fn sample_area(&self, scene: &CompiledScene, choice: f32, u: [f32; 2]) -> Option<LightPoint> {
        let (i, probability) = self.by_area.as_ref()?.sample(choice);
        let emitter = &scene.emitters[i];
        let pdf_a = probability / emitter.area;
        let p = emitter.primitive as usize;
        Some(match scene.triangles.get(p) {
            Some([a, b, c]) => {
                let [v, w] = warp::uniform_triangle(u);
                LightPoint {
                    primitive: emitter.primitive,
                    uv: [v, w],
                    position: *a * (1.0 - v - w) + *b * v + *c * w,
                    normal: (*b - *a).cross(*c - *a).normalize_or_zero(),
                    pdf_a,
                }
            }
            None => {
                let sphere = &scene.spheres[p - scene.triangles.len()];
                let normal = warp::uniform_sphere(u);
                LightPoint {
                    primitive: emitter.primitive,
                    uv: [0.0; 2],
                    position: sphere.center + normal * sphere.radius,
                    normal,
                    pdf_a,
                }
            }
        })
    }

    /// Density per area with which [`Lights::sample_area`] finds any point of emitter `i`.
    pub fn pdf_a(&self, scene: &CompiledScene, i: u32) -> f32 {
        self.by_area.as_ref().map_or(0.0, |d| d.pmf(i as usize) / scene.emitters[i as usize].area)
    }
}
