//! Masks, which leave holes in surfaces.

use super::{lookup, sphere_uv};
use crate::math::rng::{pcg4d, unit};
use crate::scene::CompiledScene;
use crate::scene::compile::{MaskMode, Material, NONE, Texture, Uv};
use crate::transport::ray::{Hit, Ray};

/// Returns the texture coordinates at a hit of `ray`.
#[inline]
pub fn uv_at(scene: &CompiledScene, ray: &Ray, hit: &Hit) -> Uv {
    match (hit.primitive as usize).checked_sub(scene.attributes.len()) {
        None => scene.uv_at(hit.primitive, hit.uv),
        Some(i) => {
            let sphere = &scene.spheres[i];
            Uv::same(sphere_uv(
                (ray.origin + ray.dir * hit.t - sphere.center).normalize_or(-ray.dir),
            ))
        }
    }
}

/// Returns whether a hit is the one at which the ray leaves a sphere.
#[inline]
fn leaves_sphere(scene: &CompiledScene, ray: &Ray, hit: &Hit) -> bool {
    (hit.primitive as usize)
        .checked_sub(scene.attributes.len())
        .is_some_and(|i| {
            (ray.origin + ray.dir * hit.t - scene.spheres[i].center).dot(ray.dir) > 0.0
        })
}

/// Returns whether a hit is on the back of a surface.
#[inline]
pub fn is_back(scene: &CompiledScene, ray: &Ray, hit: &Hit) -> bool {
    if hit.primitive as usize >= scene.attributes.len() {
        return leaves_sphere(scene, ray, hit);
    }
    let ([a, b, c], _) = scene.triangle(hit.primitive, hit.instance);
    (b - a).cross(c - a).dot(ray.dir) > 0.0
}

/// Returns the coverage of a material's mask at texture coordinates: 0 or 1 if the mask is compared
/// with a threshold, the mask itself if it is blended. Equals the expected result of
/// [`is_masked_out`].
#[inline]
pub fn coverage(textures: &[Texture], m: &Material, uv: Uv) -> f32 {
    if m.mask_texture == NONE {
        return 1.0;
    }
    let mask = lookup(textures, m.mask_texture, uv, m.tiling).x;
    match m.mask_mode {
        MaskMode::Threshold => f32::from(u8::from(mask >= m.mask_threshold)),
        MaskMode::Blend => mask.clamp(0.0, 1.0),
    }
}

/// Returns whether a material's mask accepts hits with a probability between 0 and 1.
pub fn has_fractional_mask(m: &Material) -> bool {
    m.mask_texture != NONE && m.mask_mode == MaskMode::Blend
}

/// Returns the probability with which the mask of the hit material accepted a hit of `ray`.
pub fn acceptance(scene: &CompiledScene, ray: &Ray, hit: &Hit) -> f32 {
    let m = &scene.materials[scene.material_of(hit.primitive, hit.instance) as usize];
    if has_fractional_mask(m) {
        coverage(&scene.textures, m, uv_at(scene, ray, hit))
    } else {
        1.0
    }
}

/// Returns whether the mask of the hit material leaves a hole at the hit.
///
/// In blend mode a hash of the ray and of the primitive decides, so that the same ray always finds
/// the same holes on any thread, while rays of different samples see the mask's value on average. A
/// ray crosses a sphere twice; both crossings are decided independently.
pub fn is_masked_out(scene: &CompiledScene, ray: &Ray, hit: &Hit) -> bool {
    let m = &scene.materials[scene.material_of(hit.primitive, hit.instance) as usize];
    if m.mask_texture == NONE {
        return false;
    }
    let covered = coverage(&scene.textures, m, uv_at(scene, ray, hit));
    match m.mask_mode {
        MaskMode::Threshold => covered == 0.0,
        MaskMode::Blend => {
            let [x, y, z] = ray.dir.to_array().map(f32::to_bits);
            let mut id = scene.unique_id(hit.primitive, hit.instance);
            if leaves_sphere(scene, ray, hit) {
                id ^= 1 << 31;
            }
            let directed = pcg4d([x, y, z, id]);
            let [x, y, z] = ray.origin.to_array().map(f32::to_bits);
            unit(
                pcg4d([
                    x ^ directed[0],
                    y ^ directed[1],
                    z ^ directed[2],
                    directed[3],
                ])[0],
            ) >= covered
        }
    }
}
