//! The parameters of materials at points of surfaces, with their textures.

use super::{Surface, TexturedParameters, load_vectors, lookup_in_lanes};
use crate::math::real::{Outlined, Real, Vector};
use crate::math::simd::{Lanes, map_array};
use crate::scene::compile::{Material, Model, Texture};

/// The parameters of a material that textures may vary, at a point in each lane. Those of a
/// `translucent` material are its base colour and its [`transmittance`](Self::transmittance), which is
/// stored in place of the three numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadingParameters<R: Real = f32> {
    /// Base colour, linear: that of the material times the tint of the surface and its texture.
    pub base_color: R::Vec3,
    /// Roughness, from 0 to 1.
    pub roughness: R,
    /// Weight of the metallic lobes, from 0 to 1.
    pub metallic: R,
    /// Weight of the opaque lobes among the dielectric ones, from 0 to 1.
    pub opacity: R,
}

impl ShadingParameters {
    /// Returns the parameters of a material without textures.
    pub fn of(m: &Material) -> ShadingParameters {
        if m.model == Model::Translucent {
            return ShadingParameters::translucent(m.base_color, m.transmittance);
        }
        ShadingParameters {
            base_color: m.base_color,
            roughness: m.roughness,
            metallic: m.metallic,
            opacity: m.opacity,
        }
    }
}

impl<R: Real> ShadingParameters<R> {
    /// Returns the parameters of a translucent material.
    #[inline(always)]
    fn translucent(base_color: R::Vec3, transmittance: R::Vec3) -> ShadingParameters<R> {
        ShadingParameters {
            base_color,
            roughness: transmittance.x(),
            metallic: transmittance.y(),
            opacity: transmittance.z(),
        }
    }

    /// Returns the weights of the opaque dielectric, the metal and the refractive dielectric.
    #[inline(always)]
    pub fn mix(&self) -> [R; 3] {
        let one = R::splat(1.0);
        let dielectric = one - self.metallic;
        [
            dielectric * self.opacity,
            self.metallic,
            dielectric * (one - self.opacity),
        ]
    }

    /// Returns the share of the light that a translucent material transmits, by channel.
    #[inline(always)]
    pub fn transmittance(&self) -> R::Vec3 {
        R::Vec3::new(self.roughness, self.metallic, self.opacity)
    }

    /// Looks up the parameters that have textures, the same in all lanes; the others are those of
    /// the materials.
    #[inline(always)]
    pub fn new<const N: usize>(
        surface: &Surface<R, N>,
        textures: &[Texture],
        textured: TexturedParameters,
    ) -> ShadingParameters<R>
    where
        R: Lanes<N>,
    {
        R::outline(ParameterLookup {
            surface,
            textures,
            textured,
        })
    }

    /// Computes the result of [`ShadingParameters::new`].
    #[inline(always)]
    fn look_up<const N: usize>(
        surface: &Surface<R, N>,
        textures: &[Texture],
        textured: TexturedParameters,
    ) -> ShadingParameters<R>
    where
        R: Lanes<N>,
    {
        let base_color = if textured.base_color {
            surface.base_color(textures)
        } else {
            surface.plain_color()
        };
        if textured.translucent {
            let transmittance =
                load_vectors::<R, N>(map_array(surface.materials, |m| m.transmittance));
            let texels = surface.texels(textures, |m| m.transmittance_texture);
            return ShadingParameters::translucent(base_color, transmittance * texels);
        }
        let mut roughness = R::load(&map_array(surface.materials, |m| m.roughness));
        if textured.roughness {
            roughness = surface.texels(textures, |m| m.roughness_texture).x();
            if textured.alpha {
                roughness = roughness.sqrt();
            }
        }
        let mut metallic = R::load(&map_array(surface.materials, |m| m.metallic));
        if textured.metallic {
            metallic = surface.texels(textures, |m| m.metallic_texture).x();
        }
        let mut opacity = R::load(&map_array(surface.materials, |m| m.opacity));
        if textured.opacity {
            opacity = surface.texels(textures, |m| m.opacity_texture).x();
        }
        ShadingParameters {
            base_color,
            roughness,
            metallic,
            opacity,
        }
    }
}

/// Outlined computation of [`ShadingParameters::new`].
struct ParameterLookup<'a, R: Real, const N: usize> {
    surface: &'a Surface<'a, R, N>,
    textures: &'a [Texture],
    textured: TexturedParameters,
}

impl<R: Lanes<N>, const N: usize> Outlined for ParameterLookup<'_, R, N> {
    type Output = ShadingParameters<R>;

    #[inline(always)]
    fn run(self) -> ShadingParameters<R> {
        ShadingParameters::look_up(self.surface, self.textures, self.textured)
    }
}

impl Surface<'_> {
    /// Returns the values of the material's parameters at this point.
    #[inline]
    pub fn shading_parameters(&self, textures: &[Texture]) -> ShadingParameters {
        let textured = TexturedParameters::new(self.materials[0]);
        ShadingParameters::new(self, textures, textured)
    }
}

impl<R: Lanes<N>, const N: usize> Surface<'_, R, N> {
    /// Returns the base colours.
    #[inline(always)]
    pub fn base_color(&self, textures: &[Texture]) -> R::Vec3 {
        self.plain_color() * self.texels(textures, |m| m.base_color_texture)
    }

    /// Returns the base colours without their textures.
    #[inline(always)]
    fn plain_color(&self) -> R::Vec3 {
        load_vectors::<R, N>(map_array(self.materials, |m| m.base_color)) * self.tint
    }

    /// Returns the colours of one texture of the materials, given its index in each material; white
    /// in lanes without.
    #[inline(always)]
    pub(super) fn texels(&self, textures: &[Texture], index: fn(&Material) -> u32) -> R::Vec3 {
        let ids = map_array(self.materials, index);
        let tilings = map_array(self.materials, |m| m.tiling);
        lookup_in_lanes(textures, ids, &self.uv, tilings)
    }
}
