//! Export of materials as surfaces of Mitsuba.
//!
//! | model | Mitsuba |
//! |---|---|
//! | `disney` | `principled`, with `spec_trans` = 1 - opacity |
//! | `lambert` | `diffuse`, `conductor` without an index, `dielectric`, blended by weights |
//! | `conductor`, `plastic`, `dielectric` | the plugins of these names; rough from `smooth_below` |
//! | `translucent` | `diffuse`, since no plugin transmits diffusely |
//! | `oren_nayar` | `diffuse`, since no plugin is rough and diffuse |
//!
//! The weights of `lambert` are `metallic` and opacity. Opaque surfaces are enclosed in `twosided`,
//! those with normal maps in `normalmap`, with bump maps in `bumpmap`, with masks in `mask`.

use glam::Vec3;

use super::output_folder::OutputFolder;
use super::texture::{TexelConversion, TextureWriter};
use super::xml::Xml;
use crate::model_differences;
use lumbre_light::scene::desc::{
    DelayKind, Distribution, Formulas, MaskMode, MaterialDesc, Model, RoughnessTexels, TextureSlot,
};
use lumbre_light::scene::{Note, SceneError};

/// Writer of one material as a surface with an id.
pub(super) struct SurfaceWriter<'a> {
    /// Material to be written.
    pub material: &'a MaterialDesc,
    /// Document that is written.
    pub xml: &'a mut Xml,
    /// Folder for texture files.
    pub folder: &'a mut OutputFolder,
    /// Textures written so far.
    pub textures: &'a mut TextureWriter,
    /// Features that could not be exported exactly.
    pub notes: &'a mut Vec<Note>,
}

impl SurfaceWriter<'_> {
    /// Adds a note about the material.
    fn note(&mut self, message: impl Into<String>) {
        self.notes.push(Note::new(
            "",
            format!("materials.{}", self.material.name),
            message,
        ));
    }

    /// Writes the surface and the adapters around it.
    ///
    /// # Errors
    /// Fails if a texture cannot be written.
    pub fn write(mut self, id: &str) -> Result<(), SceneError> {
        let m = self.material;
        let reflects = m.emission == Vec3::ZERO || m.emitter_reflects;
        let mask = m.texture(TextureSlot::Mask);
        let normal = m
            .texture(TextureSlot::Normal)
            .filter(|_| reflects && m.normal_strength > 0.0);
        let bump = m
            .texture(TextureSlot::Bump)
            .filter(|_| reflects && m.bump_height != 0.0);
        if bump.is_some() {
            self.note(match m.formulas {
                Formulas::Lumbre => model_differences::BUMPS,
                Formulas::Mitsuba => model_differences::STEEP_BUMPS,
            });
        }
        if normal.is_some() {
            self.note(model_differences::NORMALS);
        }
        if normal.is_some() && bump.is_some() {
            self.note(
                "Mitsuba applies the normal map in the frame of the bump map; here their slopes \
                 are added",
            );
        }
        let adapters = [
            ("mask", mask.is_some()),
            ("twosided", (!reflects || self.is_opaque()) && !m.one_sided),
            ("bumpmap", bump.is_some()),
            ("normalmap", normal.is_some()),
        ];
        let adapters: Vec<&str> = adapters
            .into_iter()
            .filter_map(|(plugin, used)| used.then_some(plugin))
            .collect();
        let mut id = vec![("id", id)];
        for plugin in &adapters {
            self.open(plugin, &mut id);
        }
        if reflects {
            self.model(&mut id)?;
        } else {
            self.open("diffuse", &mut id);
            self.xml.rgb("reflectance", Vec3::ZERO);
            self.xml.close();
        }
        for plugin in adapters.into_iter().rev() {
            self.adapter_texture(plugin)?;
            self.xml.close();
        }
        self.note_lookups();
        if m.shadow_terminator {
            self.note(
                "`shadow_terminator` is not supported by Mitsuba; shadows end at the triangles",
            );
        }
        if m.delay.kind != DelayKind::None {
            self.note("delays are not supported by Mitsuba; light is returned without delay");
        }
        if !m.parts.is_empty() {
            self.note(
                "composed materials are not exported; the material's own parameters are used",
            );
        }
        Ok(())
    }

    /// Writes the texture of an adapter before it is closed.
    fn adapter_texture(&mut self, plugin: &str) -> Result<(), SceneError> {
        let m = self.material;
        let (name, slot, conversion) = match plugin {
            "mask" => ("opacity", TextureSlot::Mask, self.opacity()),
            "bumpmap" => ("arbitrary", TextureSlot::Bump, TexelConversion::Height),
            "normalmap" => (
                "normalmap",
                TextureSlot::Normal,
                TexelConversion::Normal(m.normal_strength),
            ),
            _ => return Ok(()),
        };
        self.textures
            .write(self.xml, name, m, slot, conversion, self.folder)?;
        if plugin == "bumpmap" {
            self.xml.value("float", "scale", m.bump_height);
        }
        Ok(())
    }

    /// Notes mappings of textures that Mitsuba does not support.
    fn note_lookups(&mut self) {
        let m = self.material;
        let lookups: Vec<_> = m
            .lookups
            .iter()
            .filter(|(slot, _)| m.texture(*slot).is_some())
            .map(|(_, lookup)| *lookup)
            .collect();
        if lookups.iter().any(|lookup| lookup.second) {
            self.note(
            "Mitsuba supports one set of texture coordinates; textures on the second set use the \
             first",
        );
        }
        if lookups
            .iter()
            .any(|lookup| lookup.wrap[0] != lookup.wrap[1])
        {
            self.note("Mitsuba supports one wrap mode per texture; that of u is used for v");
        }
    }

    /// Opens a surface; the outermost one gets the id.
    fn open(&mut self, plugin: &str, id: &mut Vec<(&str, &str)>) {
        self.xml
            .open("bsdf", &[&[("type", plugin)], id.as_slice()].concat());
        id.clear();
    }

    /// Returns the conversion of mask texels to opacity.
    fn opacity(&mut self) -> TexelConversion {
        if self.material.emission != Vec3::ZERO {
            self.note("Mitsuba does not apply masks to emission");
        }
        match self.material.mask_mode {
            MaskMode::Blend => TexelConversion::Number,
            MaskMode::Threshold => {
                self.note(
                    "a threshold as `mask_mode` is not supported by Mitsuba; it is applied to \
                     texels, and edges are soft",
                );
                TexelConversion::Threshold(self.material.mask_threshold)
            }
        }
    }

    /// Returns whether nothing is transmitted, so that both sides may be alike.
    fn is_opaque(&self) -> bool {
        let m = self.material;
        let glass = m.opacity < 1.0 || m.texture(TextureSlot::Opacity).is_some();
        match m.model {
            Model::Disney | Model::Lambert => !glass,
            Model::Conductor | Model::Plastic | Model::OrenNayar => true,
            Model::Dielectric => false,
            // It is written as a diffuse surface.
            Model::Translucent => true,
        }
    }

    /// Writes the plugin of the material's model.
    fn model(&mut self, id: &mut Vec<(&str, &str)>) -> Result<(), SceneError> {
        let m = self.material;
        let has_direction = m.anisotropic_direction != Vec3::ZERO
            || m.texture(TextureSlot::AnisotropicDirection).is_some();
        if m.anisotropic > 0.0 && m.model.has_microfacets() && has_direction {
            self.note("anisotropy directions are not supported by Mitsuba; increasing u is used");
        }
        match m.model {
            Model::Disney => {
                self.open("principled", id);
                self.principled()?;
            }
            Model::Lambert => return self.ideal(id),
            Model::Conductor => {
                self.open(
                    if self.is_rough() {
                        "roughconductor"
                    } else {
                        "conductor"
                    },
                    id,
                );
                self.metal(m.base_color * m.specular, m.eta, m.k)?;
                self.facets(true)?;
            }
            Model::Plastic => self.plastic(id)?,
            Model::Translucent => {
                self.open("diffuse", id);
                self.color("reflectance", m.base_color, TexelConversion::Color)?;
                if m.transmittance != Vec3::ZERO {
                    self.note(
                        "diffuse transmission is not supported by Mitsuba 3; what is transmitted is \
                         lost",
                    );
                }
            }
            Model::OrenNayar => {
                self.open("diffuse", id);
                self.color("reflectance", m.base_color, TexelConversion::Color)?;
                self.note(model_differences::SMOOTH_DIFFUSE);
            }
            Model::Dielectric => {
                let rough = self.is_rough() && !m.thin && m.ior != 1.0;
                let kind = match (m.thin, rough) {
                    (true, _) => "thindielectric",
                    (false, true) => "roughdielectric",
                    (false, false) => "dielectric",
                };
                self.open(kind, id);
                self.glass(m.specular)?;
                if rough {
                    self.facets(true)?;
                }
            }
        }
        self.xml.close();
        Ok(())
    }

    /// Writes a plastic, and opens its element.
    fn plastic(&mut self, id: &mut Vec<(&str, &str)>) -> Result<(), SceneError> {
        let m = self.material;
        let rough = self.is_rough();
        self.open(if rough { "roughplastic" } else { "plastic" }, id);
        self.xml.value("float", "int_ior", m.ior);
        self.xml.value("float", "ext_ior", 1.0);
        self.color("diffuse_reflectance", m.base_color, TexelConversion::Color)?;
        self.xml.rgb("specular_reflectance", m.specular);
        self.xml.value("boolean", "nonlinear", m.nonlinear);
        self.facets(false)?;
        if rough && m.formulas == Formulas::Lumbre {
            let message = model_differences::rough_plastic(m.distribution, m.roughness.powi(2));
            self.note(message);
        }
        Ok(())
    }

    /// Returns whether the specular lobe is rough.
    fn is_rough(&self) -> bool {
        self.material.texture(TextureSlot::Roughness).is_some()
            || self.material.roughness >= self.material.smooth_below
    }

    /// Writes a colour, or the base colour texture times it.
    fn color(
        &mut self,
        name: &str,
        factor: Vec3,
        conversion: fn(Vec3) -> TexelConversion,
    ) -> Result<(), SceneError> {
        let slot = TextureSlot::BaseColor;
        match self.material.texture(slot) {
            Some(_) => self.textures.write(
                self.xml,
                name,
                self.material,
                slot,
                conversion(factor),
                self.folder,
            ),
            None => {
                let value = if conversion(factor) == TexelConversion::SquareRoot(factor) {
                    factor.map(f32::sqrt)
                } else {
                    factor
                };
                self.xml.rgb(name, value);
                Ok(())
            }
        }
    }

    /// Writes a number, or its texture.
    fn number(
        &mut self,
        name: &str,
        value: f32,
        slot: TextureSlot,
        conversion: TexelConversion,
    ) -> Result<(), SceneError> {
        match self.material.texture(slot) {
            Some(_) => {
                self.textures
                    .write(self.xml, name, self.material, slot, conversion, self.folder)
            }
            None => {
                self.xml.value("float", name, value);
                Ok(())
            }
        }
    }

    /// Writes the parameters of `principled`.
    fn principled(&mut self) -> Result<(), SceneError> {
        let m = self.material;
        self.color("base_color", m.base_color, TexelConversion::Color)?;
        self.number(
            "roughness",
            m.roughness,
            TextureSlot::Roughness,
            TexelConversion::of_roughness(m.roughness_texels, RoughnessTexels::Roughness),
        )?;
        if m.metallic > 0.0 || m.texture(TextureSlot::Metallic).is_some() {
            self.number(
                "metallic",
                m.metallic,
                TextureSlot::Metallic,
                TexelConversion::Number,
            )?;
        }
        if !self.is_opaque() {
            self.number(
                "spec_trans",
                1.0 - m.opacity,
                TextureSlot::Opacity,
                TexelConversion::OneMinus,
            )?;
            if !m.one_sided && (m.opacity > 0.0 || m.metallic > 0.0) {
                self.note(
                    "opaque lobes at the back are not supported by `principled`, which has them at \
                     the front only",
                );
            }
        }
        self.xml.value("float", "eta", m.ior);
        for (name, value) in [
            ("anisotropic", m.anisotropic),
            ("spec_tint", m.specular_tint),
            ("sheen", m.sheen),
            ("sheen_tint", m.sheen_tint),
            ("flatness", m.subsurface),
            ("clearcoat", m.clearcoat),
        ] {
            if value > 0.0 {
                self.xml.value("float", name, value);
            }
        }
        if m.clearcoat > 0.0 {
            self.xml
                .value("float", "clearcoat_gloss", m.clearcoat_gloss);
        }
        for message in model_differences::principled(m) {
            self.note(message);
        }
        if m.roughness < m.smooth_below && m.texture(TextureSlot::Roughness).is_none() {
            self.note("smooth lobes become rough ones of the least roughness in Mitsuba");
        }
        Ok(())
    }

    /// Writes an ideal material: Lambertian, mirror and glass, those with non-zero weight.
    fn ideal(&mut self, id: &mut Vec<(&str, &str)>) -> Result<(), SceneError> {
        let m = self.material;
        let (metal, opaque) = (
            m.texture(TextureSlot::Metallic),
            m.texture(TextureSlot::Opacity),
        );
        if metal.is_some() || m.metallic > 0.0 {
            self.note(
                "the mirror of the model `lambert`, which brightens towards grazing angles, is not \
                 supported by Mitsuba",
            );
        }
        let is_share = |x: f32| x > 0.0 && x < 1.0;
        if metal.is_some() || opaque.is_some() || is_share(m.metallic) || is_share(m.opacity) {
            self.note(model_differences::SMOOTH_BLEND);
        }
        let mut blends = 0;
        let blend =
            |surface: &mut Self, id: &mut Vec<(&str, &str)>, slot: TextureSlot, value: f32| {
                surface.open("blendbsdf", id);
                surface.number("weight", value, slot, TexelConversion::Number)
            };
        let mixed = metal.is_some() || (m.metallic > 0.0 && m.metallic < 1.0);
        if mixed {
            blend(self, id, TextureSlot::Metallic, m.metallic)?;
            blends += 1;
        }
        if mixed || m.metallic <= 0.0 {
            let both = opaque.is_some() || (m.opacity > 0.0 && m.opacity < 1.0);
            if both {
                blend(self, id, TextureSlot::Opacity, m.opacity)?;
            }
            if both || m.opacity <= 0.0 {
                self.open("dielectric", id);
                self.glass(Vec3::ONE)?;
                self.xml.close();
            }
            if both || m.opacity >= 1.0 {
                let wrapped = self.open_inside(both && !m.one_sided, id, "diffuse");
                self.color("reflectance", m.base_color, TexelConversion::Color)?;
                (0..wrapped).for_each(|_| self.xml.close());
            }
            (0..usize::from(both)).for_each(|_| self.xml.close());
        }
        if mixed || m.metallic >= 1.0 {
            let two_sided = !self.is_opaque() && !m.one_sided;
            let wrapped = self.open_inside(two_sided, id, "conductor");
            self.metal(m.base_color, Vec3::ZERO, Vec3::ONE)?;
            (0..wrapped).for_each(|_| self.xml.close());
        }
        (0..blends).for_each(|_| self.xml.close());
        Ok(())
    }

    /// Opens a component of a blend; returns the number of elements opened. An opaque component of
    /// a blend that is not two-sided as a whole is made `two_sided`.
    fn open_inside(&mut self, two_sided: bool, id: &mut Vec<(&str, &str)>, plugin: &str) -> usize {
        if two_sided {
            self.open("twosided", id);
        }
        self.open(plugin, id);
        1 + usize::from(two_sided)
    }

    /// Writes the parameters of a conductor.
    fn metal(&mut self, factor: Vec3, eta: Vec3, k: Vec3) -> Result<(), SceneError> {
        if (eta, k) == (Vec3::ZERO, Vec3::ONE) {
            self.xml.value("string", "material", "none");
        } else {
            self.xml.rgb("eta", eta);
            self.xml.rgb("k", k);
        }
        self.color("specular_reflectance", factor, TexelConversion::Color)
    }

    /// Writes the parameters of a dielectric.
    fn glass(&mut self, specular: Vec3) -> Result<(), SceneError> {
        self.xml.value("float", "int_ior", self.material.ior);
        self.xml.value("float", "ext_ior", 1.0);
        self.xml.rgb("specular_reflectance", specular);
        self.color(
            "specular_transmittance",
            self.material.base_color,
            TexelConversion::SquareRoot,
        )
    }

    /// Writes distribution and alpha of a rough interface. Only a `full` one supports anisotropy
    /// and a texture.
    fn facets(&mut self, full: bool) -> Result<(), SceneError> {
        let m = self.material;
        if !self.is_rough() {
            return Ok(());
        }
        let name = match m.distribution {
            Distribution::Ggx => "ggx",
            Distribution::Beckmann => "beckmann",
        };
        self.xml.value("string", "distribution", name);
        let texture = m.texture(TextureSlot::Roughness);
        let alpha = m.roughness * m.roughness;
        if full && texture.is_some() {
            if m.anisotropic > 0.0 {
                self.note("anisotropy is not supported together with a roughness texture");
            }
            if m.roughness_texels == RoughnessTexels::Roughness {
                self.note(model_differences::ROUGHNESS_TEXELS);
            }
            return self.number(
                "alpha",
                alpha,
                TextureSlot::Roughness,
                TexelConversion::of_roughness(m.roughness_texels, RoughnessTexels::Alpha),
            );
        }
        if texture.is_some() {
            self.note(
                "the roughness texture is not supported here; the material's roughness is used",
            );
        }
        let aspect = (1.0 - 0.9 * m.anisotropic).sqrt();
        if m.anisotropic == 0.0 || !full {
            if m.anisotropic > 0.0 {
                self.note("anisotropy of rough plastic is not supported by Mitsuba");
            }
            self.xml.value("float", "alpha", alpha);
            return Ok(());
        }
        let (u, v) = (alpha / aspect, alpha * aspect);
        if u > 1.0 {
            self.note("anisotropy is reduced, since alpha is at most 1");
        }
        self.xml.value("float", "alpha_u", u.min(1.0));
        self.xml.value("float", "alpha_v", v);
        Ok(())
    }
}
