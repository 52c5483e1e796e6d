//! Emissive primitives: points uniform over their exact area, and what they emit there.

use glam::{Vec2, Vec3};

use super::{DirectSample, LightId, LightPoint};
use crate::math::warp;
use crate::scene::CompiledScene;
use crate::scene::compile::{Material, Sphere};
use crate::transport::surface::{coverage, lookup, sphere_uv};

/// The sphere that emitter `i` is, if it is one.
#[inline]
pub(super) fn sphere(scene: &CompiledScene, i: u32) -> Option<&Sphere> {
    (scene.emitters[i as usize].primitive as usize).checked_sub(scene.triangles.len()).map(|s| &scene.spheres[s])
}

/// A point uniform over the area of emitter `i`: its density is one over the area.
#[inline]
pub(super) fn sample(scene: &CompiledScene, i: u32, u: [f32; 2]) -> LightPoint {
    let light = LightId::Emitter(i);
    let p = scene.emitters[i as usize].primitive as usize;
    match scene.triangles.get(p) {
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
    }
}

/// Light that arrives at `from` from a point uniform over the area; `None` behind it. The choice is not included.
#[inline]
pub(super) fn sample_direct(scene: &CompiledScene, i: u32, from: Vec3, u: [f32; 2]) -> Option<DirectSample> {
    let point = sample(scene, i, u);
    let to = point.position - from;
    let distance = to.length();
    let wi = to / distance;
    let pdf_w = pdf_direct_w(scene, i, from, point.position, point.normal);
    let usable = pdf_w > 0.0 && pdf_w.is_finite();
    usable.then(|| DirectSample { wi, distance, radiance: emission(scene, i, point.uv), pdf_w, delta: false, point })
}

/// Density per solid angle at `from` of a point uniform over the area; zero behind it.
#[inline]
pub(super) fn pdf_direct_w(scene: &CompiledScene, i: u32, from: Vec3, at: Vec3, normal: Vec3) -> f32 {
    let to = at - from;
    let d2 = to.length_squared();
    let cos = -to.dot(normal) / d2.sqrt();
    if cos > 0.0 { d2 / (cos * scene.emitters[i as usize].area) } else { 0.0 }
}

/// Radiance of the front of emitter `i` at texture coordinates, times how much of it the mask leaves.
#[inline]
pub(super) fn emission(scene: &CompiledScene, i: u32, uv: Vec2) -> Vec3 {
    let m = material(scene, i);
    m.emission * coverage(&scene.textures, m, uv) * lookup(&scene.textures, m.emission_texture, uv, m.tiling)
}

/// The material of emitter `i`.
#[inline]
pub(super) fn material(scene: &CompiledScene, i: u32) -> &Material {
    &scene.materials[scene.material_of(scene.emitters[i as usize].primitive) as usize]
}
