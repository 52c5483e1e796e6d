//! Light sources, and the choice among them.
//!
//! Three verbs serve every integrator: [`Lights::sample_direct`] finds light that arrives at a point,
//! [`Lights::sample_emission`] starts a path at a light, and the densities of both answer for light that a path found
//! by other means. Radiance itself is [`Surface::emitted`](super::surface::Surface::emitted) for surfaces and
//! [`Lights::environment`] for rays that leave the scene.
//!
//! A density includes the probability with which its light was chosen.

use glam::{Vec2, Vec3};

use super::surface::{lookup, sphere_uv};
use crate::math::distribution::Discrete;
use crate::math::{Frame, warp};
use crate::scene::CompiledScene;

/// All light sources of a scene.
#[derive(Clone, Debug)]
pub struct Lights {
    by_area: Option<Discrete>,
}

/// Light that arrives at a point, not yet tested for shadow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectSample {
    /// Unit direction from the point to the light.
    pub wi: Vec3,
    /// Distance to the light; infinite for lights without a place.
    pub distance: f32,
    /// Radiance that arrives along `-wi`; for a Dirac light the irradiance it makes on a surface facing it.
    pub radiance: Vec3,
    /// Density per solid angle at the point; for a Dirac light the probability of choosing it.
    pub pdf_w: f32,
    /// Whether no other technique can find this light (points, directions).
    pub delta: bool,
    /// The point on the light, for techniques that go on from it.
    pub point: LightPoint,
}

/// A point of a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightPoint {
    /// Which light.
    pub light: LightId,
    /// Position in world space; for lights without a place, a point outside the scene's bounding sphere.
    pub position: Vec3,
    /// Unit normal on the emitting side; for lights without a surface, the direction of the emission.
    pub normal: Vec3,
    /// Texture coordinates before tiling; zero for lights without a surface.
    pub uv: Vec2,
}

/// Names one light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightId {
    /// Row of [`CompiledScene::emitters`].
    Emitter(u32),
}

/// The start of a path at a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmissionSample {
    /// Where it starts.
    pub point: LightPoint,
    /// Unit direction in which it leaves.
    pub dir: Vec3,
    /// Emitted radiance in that direction (intensity for a point, irradiance for a direction).
    pub radiance: Vec3,
    /// Density of the position per area, the choice of the light included; for a point the probability alone.
    pub pdf_a: f32,
    /// Density of the direction per solid angle, given the position; for a direction 1.
    pub pdf_w: f32,
    /// Cosine between the normal and the direction; 1 for lights without a surface.
    pub cos: f32,
}

/// How the densities of a light that a path hit would have been, had it been sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmissionPdf {
    /// Density of the position per area, the choice of the light included.
    pub pdf_a: f32,
    /// Density of the direction per solid angle, given the position.
    pub pdf_w: f32,
}

impl Lights {
    /// Gathers the lights of a scene.
    pub fn new(scene: &CompiledScene) -> Lights {
        Lights { by_area: Discrete::new(scene.emitters.iter().map(|e| e.area)) }
    }

    /// Number of lights.
    pub fn count(&self, scene: &CompiledScene) -> usize {
        scene.emitters.len()
    }

    /// Total emitting area in square scene units; zero without emissive surfaces.
    pub fn total_area(&self) -> f64 {
        self.by_area.as_ref().map_or(0.0, Discrete::total)
    }

    /// Radiance that arrives along `-dir` from outside the scene.
    pub fn environment(&self, _dir: Vec3) -> Vec3 {
        Vec3::ZERO
    }

    /// A point uniform over the emitting area and its density per area; `None` without emissive surfaces.
    pub fn sample_area(&self, scene: &CompiledScene, choice: f32, u: [f32; 2]) -> Option<(LightPoint, f32)> {
        let (i, probability) = self.by_area.as_ref()?.sample(choice);
        let emitter = &scene.emitters[i];
        let light = LightId::Emitter(i as u32);
        let p = emitter.primitive as usize;
        let point = match scene.triangles.get(p) {
            Some([a, b, c]) => {
                let [v, w] = warp::uniform_triangle(u);
                let u = 1.0 - v - w;
                let [ta, tb, tc] = scene.attributes[p].uvs;
                LightPoint {
                    light,
                    position: *a * u + *b * v + *c * w,
                    normal: (*b - *a).cross(*c - *a).normalize_or_zero(),
                    uv: ta * u + tb * v + tc * w,
                }
            }
            None => {
                let sphere = &scene.spheres[p - scene.triangles.len()];
                let normal = warp::uniform_sphere(u);
                LightPoint { light, position: sphere.center + normal * sphere.radius, normal, uv: sphere_uv(normal) }
            }
        };
        Some((point, probability / emitter.area))
    }

    /// Density per area with which [`Lights::sample_area`] finds any point of emitter `i`.
    pub fn pdf_a(&self, scene: &CompiledScene, i: u32) -> f32 {
        self.by_area.as_ref().map_or(0.0, |d| d.pmf(i as usize) / scene.emitters[i as usize].area)
    }

    /// Light that arrives at `from`; `None` where the drawn point cannot shine there.
    pub fn sample_direct(&self, scene: &CompiledScene, from: Vec3, choice: f32, u: [f32; 2]) -> Option<DirectSample> {
        let (point, pdf_a) = self.sample_area(scene, choice, u)?;
        let to = point.position - from;
        let distance = to.length();
        let wi = to / distance;
        let cos = -wi.dot(point.normal);
        if !(cos > 0.0 && distance > 0.0) {
            return None;
        }
        let pdf_w = pdf_a * distance * distance / cos;
        Some(DirectSample { wi, distance, radiance: self.emission(scene, &point), pdf_w, delta: false, point })
    }

    /// Density per solid angle at `from` with which [`Lights::sample_direct`] finds the point `at` of emitter `i`, whose
    /// front side has the unit normal `normal` there; zero seen from behind.
    pub fn pdf_direct_w(&self, scene: &CompiledScene, from: Vec3, i: u32, at: Vec3, normal: Vec3) -> f32 {
        let to = at - from;
        let d2 = to.length_squared();
        let cos = -to.dot(normal) / d2.sqrt();
        if cos > 0.0 { self.pdf_a(scene, i) * d2 / cos } else { 0.0 }
    }

    /// Density per solid angle with which [`Lights::sample_direct`] finds the environment in direction `dir`.
    pub fn pdf_environment_w(&self, _dir: Vec3) -> f32 {
        0.0
    }

    /// The start of a path at a light: a point, and a direction with the density of the cosine.
    pub fn sample_emission(
        &self,
        scene: &CompiledScene,
        choice: f32,
        u: [f32; 2],
        v: [f32; 2],
    ) -> Option<EmissionSample> {
        let (point, pdf_a) = self.sample_area(scene, choice, u)?;
        let local = warp::cosine_hemisphere(v);
        let pdf_w = warp::cosine_hemisphere_pdf_w(local.z);
        (pdf_w > 0.0).then(|| EmissionSample {
            point,
            dir: Frame::from_normal(point.normal).to_world(local),
            radiance: self.emission(scene, &point),
            pdf_a,
            pdf_w,
            cos: local.z,
        })
    }

    /// The densities with which [`Lights::sample_emission`] starts a path at a point of emitter `i` in a direction whose
    /// cosine with the front normal is `cos`.
    pub fn pdf_emission(&self, scene: &CompiledScene, i: u32, cos: f32) -> EmissionPdf {
        EmissionPdf { pdf_a: self.pdf_a(scene, i), pdf_w: warp::cosine_hemisphere_pdf_w(cos) }
    }

    fn emission(&self, scene: &CompiledScene, point: &LightPoint) -> Vec3 {
        let LightId::Emitter(i) = point.light;
        let material = &scene.materials[scene.material_of(scene.emitters[i as usize].primitive) as usize];
        material.emission * lookup(&scene.textures, material.emission_texture, point.uv, material.tiling)
    }
}
