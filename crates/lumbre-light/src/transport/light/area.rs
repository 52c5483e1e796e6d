//! Emissive primitives: points uniform over their exact area, and their emission.

use glam::Vec3;

use super::SelectedLights;
use super::source::{LightFacts, LightSource, PowerContext};
use super::table::light_rows;
use super::tree::LightBounds;
use crate::math::luminance::luminance_of;
use crate::math::real::{Mask, Real, Vector};
use crate::math::simd::{Lanes, map_vectors};
use crate::math::warp;
use crate::scene::CompiledScene;
use crate::scene::compile::{Emitter, Material, NONE, Sphere, Uv};
use crate::transport::surface::{coverage, lookup, sphere_uv};
use crate::transport::vertex::greatest_coordinate;

/// Flag of textured triangles; its sum with [`SPHERE`] is that of textured spheres.
const TEXTURED: f32 = 1.0;

/// Flag of spheres without a texture.
const SPHERE: f32 = 2.0;

/// Number of texture lookups for estimating the emission of a textured primitive.
const PROBES: u32 = 16;

/// Share of the whole texture's mean brightness in the estimate, so that a light whose bright spot
/// no probe hit is still chosen.
const MEAN_SHARE: f64 = 0.1;

/// Returns the material of an emitter.
#[inline]
fn material<'a>(scene: &'a CompiledScene, emitter: &Emitter) -> &'a Material {
    &scene.materials[scene.material_of(emitter.primitive, emitter.instance) as usize]
}

impl LightSource for Emitter {
    fn facts(&self, scene: &CompiledScene, context: &PowerContext) -> LightFacts {
        let m = material(scene, self);
        let is_textured = m.mask_texture != NONE || m.emission_texture != NONE;
        let textured = if is_textured { TEXTURED } else { 0.0 };
        let sphere = (self.primitive as usize).checked_sub(scene.triangles.len());
        let sphere = sphere.map(|s| &scene.spheres[s]);
        let (first, start, end, bounds) = match sphere {
            None => {
                let [a, b, c] = scene.corners(self.primitive, self.instance);
                let moved = scene.instance_extent(self.instance);
                let extent = greatest_coordinate(&[a, b, c]).max(moved);
                let first = [a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y];
                let bounds = LightBounds::triangle([a, b, c], 0.0);
                (first, [c.z, self.area], [textured, extent], bounds)
            }
            Some(&Sphere { center, radius, .. }) => {
                let extent = greatest_coordinate(&[center]) + radius;
                let first = [center.x, center.y, center.z, radius, 0.0, 0.0, 0.0, 0.0];
                let bounds = LightBounds::round([center - radius, center + radius], 0.0);
                (first, [0.0, self.area], [SPHERE + textured, extent], bounds)
            }
        };
        LightFacts {
            rows: light_rows(first, start, m.emission, end),
            power: power(scene, self, m, sphere.is_some(), &context.brightness),
            bounds: Some(bounds),
        }
    }
}

/// Estimates the luminance of the power that an emitter emits on its front.
fn power(
    scene: &CompiledScene,
    emitter: &Emitter,
    m: &Material,
    is_sphere: bool,
    brightness: &[f64],
) -> f64 {
    let plain = std::f64::consts::PI * f64::from(emitter.area) * luminance_of(m.emission);
    if m.emission_texture == NONE {
        return plain;
    }
    let side = PROBES.isqrt();
    let probe = |k: u32| {
        let u = [(k % side) as f32 + 0.5, (k / side) as f32 + 0.5].map(|x| x / side as f32);
        let uv = if is_sphere {
            Uv::same(sphere_uv(warp::uniform_sphere(u)))
        } else {
            scene.uv_at(emitter.primitive, warp::uniform_triangle(u))
        };
        luminance_of(lookup(&scene.textures, m.emission_texture, uv, m.tiling))
    };
    let probed = (0..PROBES).map(probe).sum::<f64>() / f64::from(PROBES);
    plain * (probed + MEAN_SHARE * brightness[m.emission_texture as usize])
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
    /// Returns the lanes with spheres.
    #[inline(always)]
    pub(super) fn are_spheres(&self) -> R::Mask {
        self.are_emitters() & self.flags().ge(R::splat(SPHERE))
    }

    /// Returns the lanes with emissive primitives whose emission depends on texture coordinates.
    #[inline(always)]
    pub(super) fn are_textured(&self) -> R::Mask {
        let flags = self.flags();
        let textured = flags.eq(R::splat(TEXTURED)) | flags.eq(R::splat(SPHERE + TEXTURED));
        self.are_emitters() & textured
    }

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
        let spheres = self.are_spheres();
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
        let spheres = self.are_spheres();
        let triangles = map_vectors::<R, N, 4>(at, wanted & !spheres, |lane, at| {
            let primitive = scene.emitters[self.indices[lane] as usize].primitive;
            scene.uv_at(primitive, [at.x, at.y]).to_array()
        });
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
            let emitter = &scene.emitters[self.indices[lane] as usize];
            let (m, uv) = (material(scene, emitter), uv[lane]);
            let color = m.emission
                * coverage(&scene.textures, m, uv)
                * lookup(&scene.textures, m.emission_texture, uv, m.tiling);
            color.to_array()
        });
        R::Vec3::select(textured, R::Vec3::new(r, g, b), radiance)
    }
}
