//! Emissive primitives: points uniform over their exact area, and their emission.

use glam::Vec3;

use super::{DirectSample, LightId, LightPoint};
use crate::math::real::{Real, Vector};
use crate::math::warp;
use crate::scene::CompiledScene;
use crate::scene::compile::{Material, NONE, Sphere, Uv};
use crate::transport::surface::{coverage, lookup, sphere_uv};

/// Returns the sphere that emitter `i` is, if it is one.
#[inline]
pub(super) fn sphere(scene: &CompiledScene, i: u32) -> Option<&Sphere> {
    (scene.emitters[i as usize].primitive as usize)
        .checked_sub(scene.triangles.len())
        .map(|s| &scene.spheres[s])
}

/// Samples a point uniform over the area of emitter `i`: its density is one over the area.
#[inline]
pub(super) fn sample(scene: &CompiledScene, i: u32, u: [f32; 2]) -> LightPoint {
    let light = LightId::Emitter(i);
    match sphere(scene, i) {
        None => {
            let p = scene.emitters[i as usize].primitive;
            let [a, b, c] = scene.corners(p, scene.emitters[i as usize].instance);
            let at = warp::uniform_triangle(u);
            let (position, normal) = on_triangle([a, b, c], at);
            LightPoint {
                light,
                position,
                normal,
                uv: scene.uv_at(p, at),
            }
        }
        Some(sphere) => {
            let normal = warp::uniform_sphere(u);
            LightPoint {
                light,
                position: sphere.center + normal * sphere.radius,
                normal,
                uv: Uv::same(sphere_uv(normal)),
            }
        }
    }
}

/// Returns the point of a triangle with these weights of its second and third corner, and the unit
/// normal there, zero for a triangle without area; scalar or vectorised.
#[inline(always)]
pub fn on_triangle<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(
    [a, b, c]: [V; 3],
    [v, w]: [R; 2],
) -> (V, V) {
    let normal = (b - a).cross(c - a).normalize_or(V::broadcast(Vec3::ZERO));
    (a * (R::splat(1.0) - v - w) + b * v + c * w, normal)
}

/// Returns unit direction, distance and density per solid angle from `from` to a point uniform over
/// `area` with the unit normal `normal`. The density is zero from behind, and if it is not a
/// positive finite number. Scalar or vectorised.
#[inline(always)]
pub fn direction_from<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(
    from: V,
    at: V,
    normal: V,
    area: R,
) -> (V, R, R) {
    let to = at - from;
    let distance = to.length();
    (to / distance, distance, density(to, distance, normal, area))
}

/// Returns the density per area with which [`sample`] samples any point of emitter `i`.
#[inline]
pub(super) fn pdf_a(scene: &CompiledScene, i: u32) -> f32 {
    1.0 / scene.emitters[i as usize].area
}

/// Samples light that arrives at `from` from a point uniform over the area; `None` from behind. The
/// density does not include the choice of the light.
#[inline]
pub(super) fn sample_direct(
    scene: &CompiledScene,
    i: u32,
    from: Vec3,
    u: [f32; 2],
) -> Option<DirectSample> {
    let point = sample(scene, i, u);
    let (wi, distance, pdf_w) = direction_from(
        from,
        point.position,
        point.normal,
        scene.emitters[i as usize].area,
    );
    (pdf_w > 0.0).then(|| {
        let radiance = emission(scene, i, point.uv);
        DirectSample {
            wi,
            distance,
            radiance,
            pdf_w,
            delta: false,
            point,
        }
    })
}

/// Returns the density per solid angle at `from` of a point uniform over the area; zero from
/// behind.
#[inline]
pub(super) fn pdf_direct_w(
    scene: &CompiledScene,
    i: u32,
    from: Vec3,
    at: Vec3,
    normal: Vec3,
) -> f32 {
    direct_w(from, at, normal, scene.emitters[i as usize].area)
}

/// Returns the density per solid angle at `from` of the point `at`, uniform over `area` and with
/// the unit normal `normal`; zero from behind. Scalar or vectorised.
#[inline(always)]
pub fn direct_w<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(from: V, at: V, normal: V, area: R) -> R {
    let to = at - from;
    density(to, to.length(), normal, area)
}

/// Returns the density per solid angle of a point uniform over `area` in direction `to`; zero from
/// behind, and if it is not a positive finite number.
#[inline(always)]
fn density<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(to: V, distance: R, normal: V, area: R) -> R {
    let zero = R::splat(0.0);
    let pdf_w = distance * distance * distance / (-to.dot(normal) * area);
    R::select(pdf_w.gt(zero) & pdf_w.is_finite(), pdf_w, zero)
}

/// Returns the corners and the radiance of emitter `i` if it is a triangle without mask and
/// emission texture.
pub fn constant_triangle(scene: &CompiledScene, i: u32) -> Option<([Vec3; 3], Vec3)> {
    let m = material(scene, i);
    let constant =
        sphere(scene, i).is_none() && m.mask_texture == NONE && m.emission_texture == NONE;
    let row = &scene.emitters[i as usize];
    constant.then(|| (scene.corners(row.primitive, row.instance), m.emission))
}

/// Returns the radiance of the front of emitter `i` at texture coordinates, times the coverage of
/// its mask.
#[inline]
pub(super) fn emission(scene: &CompiledScene, i: u32, uv: Uv) -> Vec3 {
    let m = material(scene, i);
    m.emission
        * coverage(&scene.textures, m, uv)
        * lookup(&scene.textures, m.emission_texture, uv, m.tiling)
}

/// Returns the material of emitter `i`.
#[inline]
pub(super) fn material(scene: &CompiledScene, i: u32) -> &Material {
    let emitter = &scene.emitters[i as usize];
    &scene.materials[scene.material_of(emitter.primitive, emitter.instance) as usize]
}
