//! The material description, and the type of rows of the table of its parameters.

use std::sync::Arc;

use glam::{Vec2, Vec3};

use super::delay_profile::DelayDesc;
use super::{
    Distribution, FilterChoice, Formulas, Lookup, MaskMode, Model, RoughnessTexels, ShadingNormals,
    TextureDesc, TextureSlot,
};
use crate::value::Value;
use crate::value::schema::{SchemaError, Ty};

/// A material as specified by its file.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialDesc {
    /// Name used by faces and edits.
    pub name: String,
    /// Linear base colour, each channel in 0..=1.
    pub base_color: Vec3,
    /// Radiance emitted by the front side, each channel at least 0.
    pub emission: Vec3,
    /// Perceptual roughness in 0..=1; the GGX alpha is its square.
    pub roughness: f32,
    /// 0 dielectric to 1 metal.
    pub metallic: f32,
    /// 1 opaque to 0 refractive.
    pub opacity: f32,
    /// Index of refraction of the inside relative to the outside, positive.
    pub ior: f32,
    /// Mix of diffuse (0) and subsurface-like (1) reflection [Burley 2012].
    pub subsurface: f32,
    /// Share of the base colour's hue in the dielectric's reflectance at normal incidence, in
    /// 0..=1.
    pub specular_tint: f32,
    /// Anisotropy of highlights: 0 is isotropic; in 0..=1.
    pub anisotropic: f32,
    /// World-space direction along which highlights are stretched; zero means the direction of
    /// increasing u.
    pub anisotropic_direction: Vec3,
    /// Strength of the cloth sheen at grazing angles, in 0..=1.
    pub sheen: f32,
    /// Share of the base colour's hue in the sheen, in 0..=1.
    pub sheen_tint: f32,
    /// Strength of a clear coat over all other lobes, in 0..=1.
    pub clearcoat: f32,
    /// Gloss of the clear coat: 0 satin to 1 gloss.
    pub clearcoat_gloss: f32,
    /// Roughness below which specular lobes are perfectly smooth.
    pub smooth_below: f32,
    /// Scattering model that the parameters describe.
    pub model: Model,
    /// Factor on the interface reflection of conductors, plastics and dielectrics, in 0..=1.
    pub specular: Vec3,
    /// Real part of a conductor's index of refraction by channel, relative to the outside, at least
    /// 0.
    pub eta: Vec3,
    /// Imaginary part of a conductor's index of refraction by channel, relative to the outside, at
    /// least 0.
    pub k: Vec3,
    /// Microfacet distribution of conductors, plastics and dielectrics.
    pub distribution: Distribution,
    /// Whether a dielectric is a thin pane without an inside.
    pub thin: bool,
    /// Whether light that plastic reflects internally is coloured at each reflection.
    pub nonlinear: bool,
    /// Whether opaque lobes reflect on the front side only, and the back is black.
    pub one_sided: bool,
    /// Factor on the slope of the normal map.
    pub normal_strength: f32,
    /// Height of the value 1 of the bump map, in scene units.
    pub bump_height: f32,
    /// Mask value below which a hit is discarded.
    pub mask_threshold: f32,
    /// Effect of a mask value on a hit.
    pub mask_mode: MaskMode,
    /// Whether light is evaluated at the smooth surface that the vertex normals suggest above a
    /// triangle.
    pub shadow_terminator: bool,
    /// Factor on texture coordinates.
    pub tiling: f32,
    /// Offset of texture coordinates, added after the factor.
    pub uv_offset: Vec2,
    /// Textures by slot, sorted by slot, at most one each.
    pub textures: Vec<(TextureSlot, Arc<TextureDesc>)>,
    /// Mappings of the textures in these slots, sorted by slot. Textures in other slots repeat and
    /// use the first set of coordinates.
    pub lookups: Vec<(TextureSlot, Lookup)>,
    /// Filter of the textures.
    pub texture_filter: FilterChoice,
    /// Normals with which the surface is shaded.
    pub shading_normals: ShadingNormals,
    /// Albedo of the transmission of the model `translucent`, linear.
    pub transmittance: Vec3,
    /// Renderer whose formulas hold where renderers differ.
    pub formulas: Formulas,
    /// Meaning of the texels of the roughness texture.
    pub roughness_texels: RoughnessTexels,
    /// Whether an emitting surface also reflects: false in `.scn` files, true in Lumbre's own
    /// scenes.
    pub emitter_reflects: bool,
    /// Temporal profile of the material.
    pub delay: DelayDesc,
    /// Names of the materials of which this one is composed; empty for a plain material.
    pub parts: Vec<String>,
    /// Weights of `parts`, which sum to one.
    pub weights: Vec<f32>,
    /// Whether the first of two parts is the front and the second the back.
    pub by_side: bool,
}

impl MaterialDesc {
    /// Creates a material with every parameter at its default.
    pub fn new(name: &str) -> MaterialDesc {
        MaterialDesc {
            name: name.to_owned(),
            base_color: Vec3::ONE,
            emission: Vec3::ZERO,
            roughness: 1.0,
            metallic: 0.0,
            opacity: 1.0,
            ior: 1.5,
            subsurface: 0.0,
            specular_tint: 0.0,
            anisotropic: 0.0,
            anisotropic_direction: Vec3::ZERO,
            sheen: 0.0,
            sheen_tint: 0.0,
            clearcoat: 0.0,
            clearcoat_gloss: 1.0,
            smooth_below: SMOOTH_ROUGHNESS,
            model: Model::Disney,
            specular: Vec3::ONE,
            eta: Vec3::ZERO,
            k: Vec3::ONE,
            distribution: Distribution::Ggx,
            thin: false,
            nonlinear: false,
            one_sided: false,
            normal_strength: 1.0,
            bump_height: 1.0,
            mask_threshold: MASK_THRESHOLD,
            mask_mode: MaskMode::Threshold,
            shadow_terminator: false,
            tiling: 1.0,
            uv_offset: Vec2::ZERO,
            textures: Vec::new(),
            lookups: Vec::new(),
            texture_filter: FilterChoice::Given,
            shading_normals: ShadingNormals::Smooth,
            transmittance: Vec3::ZERO,
            formulas: Formulas::Lumbre,
            roughness_texels: RoughnessTexels::Roughness,
            emitter_reflects: true,
            delay: DelayDesc::default(),
            parts: Vec::new(),
            weights: Vec::new(),
            by_side: false,
        }
    }

    /// Returns whether one of two parts is chosen at each hit: by a texture of weights, or by the side.
    pub fn is_blend(&self) -> bool {
        self.parts.len() == 2 && (self.by_side || self.texture(TextureSlot::Weights).is_some())
    }

    /// Returns the texture in a slot.
    pub fn texture(&self, slot: TextureSlot) -> Option<&Arc<TextureDesc>> {
        self.textures
            .iter()
            .find(|(s, _)| *s == slot)
            .map(|(_, t)| t)
    }

    /// Sets or removes the texture of a slot.
    pub fn set_texture(&mut self, slot: TextureSlot, texture: Option<Arc<TextureDesc>>) {
        self.textures.retain(|(s, _)| *s != slot);
        self.textures.extend(texture.map(|t| (slot, t)));
        self.textures.sort_by_key(|(s, _)| *s);
    }

    /// Returns the mapping of a slot's texture.
    pub fn lookup(&self, slot: TextureSlot) -> Lookup {
        self.lookups
            .iter()
            .find(|(s, _)| *s == slot)
            .map_or_else(Lookup::default, |(_, lookup)| *lookup)
    }

    /// Sets the texture of a slot and its mapping.
    pub fn set_mapped_texture(
        &mut self,
        slot: TextureSlot,
        texture: Arc<TextureDesc>,
        lookup: Lookup,
    ) {
        self.set_texture(slot, Some(texture));
        self.set_lookup(slot, lookup);
    }

    /// Sets the mapping of a slot's texture, present or future.
    pub fn set_lookup(&mut self, slot: TextureSlot, lookup: Lookup) {
        self.lookups.retain(|(s, _)| *s != slot);
        if !lookup.is_plain() {
            self.lookups.push((slot, lookup));
            self.lookups.sort_by_key(|(s, _)| *s);
        }
    }
}

/// Default of the parameter `smooth_below`: specular lobes of lower roughness are Dirac lobes. A
/// lobe of this roughness has the least supported GGX alpha, 0.001, and is already narrower than a
/// pixel.
pub const SMOOTH_ROUGHNESS: f32 = 0.01;

/// Default of the parameter `mask_threshold` (annex A of the `.scn` format).
pub const MASK_THRESHOLD: f32 = 0.5;

/// A row of [`MATERIAL_PARAMS`](super::MATERIAL_PARAMS): one material parameter.
#[derive(Clone, Copy, Debug)]
pub struct MaterialParam {
    /// Name in scripts: `set = { ["materials.NAME.<name>"] = .. }`.
    pub name: &'static str,
    /// Key in `.scn`, compared case-insensitively.
    pub scn_key: &'static str,
    /// Key of its texture in `.scn`; empty if the parameter takes no texture.
    pub scn_texture_key: &'static str,
    /// Type and range.
    pub ty: Ty,
    /// Unit of the value; empty for a pure number.
    pub unit: &'static str,
    /// Meaning and source, in a sentence.
    pub doc: &'static str,
    /// Returns the parameter's value.
    pub get: fn(&MaterialDesc) -> Value,
    /// Stores a value that has been checked against `ty`.
    pub(super) set_checked: fn(&mut MaterialDesc, &Value),
    /// Texture slot; `None` if the parameter takes no texture.
    pub texture: Option<TextureSlot>,
}

impl MaterialParam {
    /// Stores a value after checking its type and range; `path` appears in the error.
    ///
    /// # Errors
    /// Fails if the value has the wrong type or is out of range.
    pub fn set(
        &self,
        material: &mut MaterialDesc,
        path: &str,
        value: &Value,
    ) -> Result<(), SchemaError> {
        self.ty.check(path, self.name, value)?;
        (self.set_checked)(material, value);
        Ok(())
    }
}
