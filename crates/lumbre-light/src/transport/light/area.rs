//! Emissive primitives: points uniform over their exact area, and their emission.

use glam::Vec3;

use super::SelectedLights;
use super::table::{SPHERE, TRIANGLE};
use crate::math::real::{Mask, Real, Vector};
use crate::math::simd::{Lanes, map_vectors};
use crate::math::warp;
use crate::scene::CompiledScene;
use crate::scene::compile::{Material, Sphere, Uv};
use crate::transport::surface::{coverage, lookup, sphere_uv};

/// Returns the sphere that emitter `i` is, if it is one.
#[inline]
pub(super) fn sphere(scene: &CompiledScene, i: u32) -> Option<&Sphere> {
    (scene.emitters[i as usize].primitive as usize)
        .checked_sub(scene.triangles.len())
        .map(|s| &scene.spheres[s])
}

/// Returns the material of emitter `i`.
#[inline]
pub(super) fn material(scene: &CompiledScene, i: u32) -> &Material {
    let emitter = &scene.emitters[i as usize];
    &scene.materials[scene.material_of(emitter.primitive, emitter.instance) as usize]
}

/// Returns the texture coordinates of a point uniform over the area of emitter `i`.
pub(super) fn sample_uv(scene: &CompiledScene, i: u32, u: [f32; 2]) -> Uv {
    match sphere(scene, i) {
        None => {
            let primitive = scene.emitters[i as usize].primitive;
            scene.uv_at(primitive, warp::uniform_triangle(u))
        }
        Some(_) => Uv::same(sphere_uv(warp::uniform_sphere(u))),
    }
}

/// Returns the point of a triangle with these weights of its second and third corner, and the unit
/// normal there, zero for a triangle without area.
#[inline(always)]
fn on_triangle<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(
    [a, b, c]: [V; 3],
    [v, w]: [R; 2],
) -> (V, V) {
    let normal = (b - a).cross(c - a).normalize_or(V::broadcast(Vec3::ZERO));
    (a * (R::splat(1.0) - v - w) + b * v + c * w, normal)
}

/// Returns the density per solid angle of a point uniform over `area` in direction `to`; zero from
/// behind, and if it is not a positive finite number.
#[inline(always)]
pub(super) fn density<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(
    to: V,
    distance: R,
    normal: V,
    area: R,
) -> R {
    let zero = R::splat(0.0);
    let pdf_w = distance * distance * distance / (-to.dot(normal) * area);
    R::select(pdf_w.gt(zero) & pdf_w.is_finite(), pdf_w, zero)
}

impl<R: Lanes<N>, const N: usize> SelectedLights<'_, R, N> {
    /// Samples points uniform over triangles: returns positions and unit normals.
    #[inline(always)]
    pub(super) fn sample_triangle(&self, u: [R; 2]) -> (R::Vec3, R::Vec3) {
        on_triangle(self.corners(), warp::uniform_triangle(u))
    }

    /// Samples points uniform over the areas of emissive primitives: returns positions and unit
    /// normals.
    #[inline(always)]
    pub(super) fn sample_area(&self, u: [R; 2]) -> (R::Vec3, R::Vec3) {
        let (mut position, mut normal) = self.sample_triangle(u);
        let spheres = self.are(SPHERE);
        if spheres.any() {
            let (center, radius) = self.sphere();
            let n: R::Vec3 = warp::uniform_sphere(u);
            position = R::Vec3::select(spheres, center + n * radius, position);
            normal = R::Vec3::select(spheres, n, normal);
        }
        (position, normal)
    }

    /// Returns the texture coordinates of points of emissive primitives in the lanes of `wanted`:
    /// of triangles sampled with `u`, and of spheres with the unit normal `normal`.
    #[inline(always)]
    pub(super) fn uv(
        &self,
        scene: &CompiledScene,
        u: [R; 2],
        normal: R::Vec3,
        wanted: R::Mask,
    ) -> Uv<R> {
        let [v, w] = warp::uniform_triangle(u);
        let at = R::Vec3::new(v, w, R::splat(0.0));
        let triangles = map_vectors::<R, N, 4>(at, wanted & self.are(TRIANGLE), |lane, at| {
            let primitive = scene.emitters[self.indices[lane] as usize].primitive;
            scene.uv_at(primitive, [at.x, at.y]).to_array()
        });
        let spheres = self.are(SPHERE);
        let mut uv = Uv::from_array(triangles);
        if spheres.any() {
            let on_spheres = map_vectors::<R, N, 4>(normal, wanted & spheres, |_, n| {
                Uv::same(sphere_uv(n)).to_array()
            });
            uv = Uv::select(spheres, Uv::from_array(on_spheres), uv);
        }
        uv
    }

    /// Returns the radiance of the front of emissive primitives: in the lanes of `textured` at
    /// texture coordinates and times the coverage of their masks.
    #[inline(always)]
    pub(super) fn emission(&self, scene: &CompiledScene, uv: &Uv<R>, textured: R::Mask) -> R::Vec3 {
        let radiance = self.radiance();
        if !textured.any() {
            return radiance;
        }
        let uv = uv.lanes();
        let [r, g, b] = map_vectors::<R, N, 3>(radiance, textured, |lane, _| {
            let (m, uv) = (material(scene, self.indices[lane]), uv[lane]);
            let color = m.emission
                * coverage(&scene.textures, m, uv)
                * lookup(&scene.textures, m.emission_texture, uv, m.tiling);
            color.to_array()
        });
        R::Vec3::select(textured, R::Vec3::new(r, g, b), radiance)
    }
}
