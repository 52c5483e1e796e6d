//! From a hit to the surface that was hit.

use glam::{Vec2, Vec3};

use super::ray::{Hit, Ray, offset_origin};
use crate::scene::CompiledScene;
use crate::scene::compile::{Material, NONE, Texture};

/// A point on a surface with what shading needs of it.
#[derive(Clone, Copy, Debug)]
pub struct Surface<'a> {
    /// Position in world space, computed from the primitive rather than from the ray.
    pub position: Vec3,
    /// Unit normal of the primitive on its front side, whichever side was hit.
    pub n_geometric: Vec3,
    /// Unit shading normal on the same side.
    pub n_shading: Vec3,
    /// Texture coordinates before tiling.
    pub uv: Vec2,
    /// The material row.
    pub material: &'a Material,
    /// Index into the scene's emitters, or [`NONE`].
    pub emitter: u32,
}

impl<'a> Surface<'a> {
    /// The surface at a hit of `ray`.
    #[inline]
    pub fn at(scene: &'a CompiledScene, ray: &Ray, hit: &Hit) -> Surface<'a> {
        let i = hit.primitive as usize;
        if i < scene.triangles.len() {
            let [a, b, c] = scene.triangles[i];
            let attributes = &scene.attributes[i];
            let [v, w] = hit.uv;
            let u = 1.0 - v - w;
            let n_geometric = (b - a).cross(c - a).normalize_or(-ray.dir);
            let [na, nb, nc] = attributes.normals;
            let [ta, tb, tc] = attributes.uvs;
            Surface {
                position: a * u + b * v + c * w,
                n_geometric,
                n_shading: (na * u + nb * v + nc * w).normalize_or(n_geometric),
                uv: ta * u + tb * v + tc * w,
                material: &scene.materials[attributes.material as usize],
                emitter: attributes.emitter,
            }
        } else {
            let sphere = &scene.spheres[i - scene.triangles.len()];
            let n = (ray.origin + ray.dir * hit.t - sphere.center).normalize_or(-ray.dir);
            Surface {
                position: sphere.center + n * sphere.radius,
                n_geometric: n,
                n_shading: n,
                uv: sphere_uv(n),
                material: &scene.materials[sphere.material as usize],
                emitter: sphere.emitter,
            }
        }
    }

    /// Radiance emitted towards `wo`: the material's emission on the front side, black behind.
    #[inline]
    pub fn emitted(&self, textures: &[Texture], wo: Vec3) -> Vec3 {
        if self.emitter == NONE || self.n_geometric.dot(wo) <= 0.0 {
            return Vec3::ZERO;
        }
        self.material.emission * lookup(textures, self.material.emission_texture, self.uv, self.material.tiling)
    }

    /// The base colour here.
    #[inline]
    pub fn base_color(&self, textures: &[Texture]) -> Vec3 {
        self.material.base_color * lookup(textures, self.material.base_color_texture, self.uv, self.material.tiling)
    }

    /// A ray from here into `dir`, started off the surface on the side to which it goes.
    #[inline]
    pub fn spawn(&self, dir: Vec3) -> Ray {
        let side = if dir.dot(self.n_geometric) < 0.0 { -self.n_geometric } else { self.n_geometric };
        Ray { origin: offset_origin(self.position, side), dir }
    }
}

/// A texture's colour at texture coordinates, or white where there is no texture.
#[inline]
pub fn lookup(textures: &[Texture], texture: u32, uv: Vec2, tiling: f32) -> Vec3 {
    if texture == NONE { Vec3::ONE } else { textures[texture as usize].bilinear(uv * tiling) }
}

/// Texture coordinates on a sphere: longitude about y in u, from the south pole to the north pole in v.
#[inline]
pub fn sphere_uv(n: Vec3) -> Vec2 {
    let longitude = n.x.atan2(n.z) / std::f32::consts::TAU + 0.5;
    let latitude = n.y.clamp(-1.0, 1.0).acos() / std::f32::consts::PI;
    Vec2::new(longitude, 1.0 - latitude)
}
