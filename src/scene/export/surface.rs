//! Materials as Mitsuba's surfaces.
//!
//! | here | there |
//! |---|---|
//! | `disney` | `principled`, with `spec_trans` = 1 - opacity |
//! | `lambert` | `diffuse`, `conductor` without an index, `dielectric`, blended by `metallic` and opacity |
//! | `conductor`, `plastic`, `dielectric` | the plugins of these names; their rough forms from `smooth_below` on |
//!
//! Opaque ones are put into `twosided`, normal maps into `normalmap`, bump maps into `bumpmap`, masks into `mask`.

use glam::Vec3;

use super::texture::{Textures, Use};
use super::xml::Xml;
use super::{Folder, whole};
use crate::scene::desc::{DelayKind, Distribution, MaskMode, MaterialDesc, Model, TextureSlot};
use crate::scene::{Note, SceneError};

/// Writes one material as a surface with an id.
pub(super) struct Surface<'a> {
    /// The material.
    pub material: &'a MaterialDesc,
    /// The document.
    pub xml: &'a mut Xml,
    /// Where textures are written.
    pub folder: &'a mut Folder,
    /// Those that were written.
    pub textures: &'a mut Textures,
    /// What has no counterpart.
    pub notes: &'a mut Vec<Note>,
}

impl Surface<'_> {
    fn note(&mut self, message: impl Into<String>) {
        self.notes.push(whole(&format!("materials.{}", self.material.name), message));
    }

    /// Writes the surface with all that is put around it.
    ///
    /// # Errors
    /// A texture that cannot be written.
    pub fn write(mut self, id: &str) -> Result<(), SceneError> {
        let m = self.material;
        let reflects = m.emission == Vec3::ZERO || m.emitter_reflects;
        let mask = m.texture(TextureSlot::Mask);
        let normal = m.texture(TextureSlot::Normal).filter(|_| reflects && m.normal_strength > 0.0);
        let bump = m.texture(TextureSlot::Bump).filter(|_| reflects && m.bump_height != 0.0);
        if normal.is_some() && bump.is_some() {
            self.note("its normal map is turned with the bumps there, here their slopes add");
        }
        let wraps = [("mask", mask), ("twosided", None), ("bumpmap", bump), ("normalmap", normal)];
        let there = |(kind, texture): &(&str, Option<_>)| match *kind {
            "twosided" => !reflects || self.is_opaque(),
            _ => texture.is_some(),
        };
        let wraps: Vec<_> = wraps.into_iter().filter(there).collect();
        let mut id = vec![("id", id)];
        for (kind, _) in &wraps {
            self.open(kind, &mut id);
        }
        if reflects {
            self.model(&mut id)?;
        } else {
            self.open("diffuse", &mut id);
            self.xml.rgb("reflectance", Vec3::ZERO);
            self.xml.close();
        }
        for (kind, _) in wraps.into_iter().rev() {
            match kind {
                "mask" => {
                    let of = self.opacity();
                    self.textures.write(self.xml, "opacity", m, TextureSlot::Mask, of, self.folder)?;
                }
                "bumpmap" => {
                    self.textures.write(self.xml, "arbitrary", m, TextureSlot::Bump, Use::Height, self.folder)?;
                    self.xml.value("float", "scale", m.bump_height);
                }
                "normalmap" => {
                    let of = Use::Normal(m.normal_strength);
                    self.textures.write(self.xml, "normalmap", m, TextureSlot::Normal, of, self.folder)?;
                }
                _ => {}
            }
            self.xml.close();
        }
        let laid: Vec<_> = m.lookups.iter().filter(|(slot, _)| m.texture(*slot).is_some()).map(|(_, l)| *l).collect();
        if laid.iter().any(|l| l.second) {
            self.note("there is one set of texture coordinates there: what lies on the second lies on the first");
        }
        if laid.iter().any(|l| l.wrap[0] != l.wrap[1]) {
            self.note("textures go on beyond their edges along v as along u there");
        }
        if m.shadow_terminator {
            self.note("`shadow_terminator` has no counterpart: shadows end at the triangles");
        }
        if m.delay.kind != DelayKind::None {
            self.note("it gives light back at once there");
        }
        if !m.parts.is_empty() {
            self.note("its parts are not written: it is there what its own parameters say");
        }
        Ok(())
    }

    /// Opens a surface, which takes the id if no other one around it has.
    fn open(&mut self, kind: &str, id: &mut Vec<(&str, &str)>) {
        self.xml.open("bsdf", &[&[("type", kind)], id.as_slice()].concat());
        id.clear();
    }

    /// How the mask is used.
    fn opacity(&mut self) -> Use {
        if self.material.emission != Vec3::ZERO {
            self.note("a mask does not cut what shines there");
        }
        match self.material.mask_mode {
            MaskMode::Blend => Use::Number,
            MaskMode::Threshold => {
                self.note("`mask_mode` is a threshold: texels are cut there, and edges between them are soft");
                Use::Step(self.material.mask_threshold)
            }
        }
    }

    /// Whether nothing passes through, so that both sides may be alike.
    fn is_opaque(&self) -> bool {
        let m = self.material;
        let glass = m.opacity < 1.0 || m.texture(TextureSlot::Opacity).is_some();
        match m.model {
            Model::Disney | Model::Lambert => !glass,
            Model::Conductor | Model::Plastic => true,
            Model::Dielectric => false,
        }
    }

    fn model(&mut self, id: &mut Vec<(&str, &str)>) -> Result<(), SceneError> {
        let m = self.material;
        let turned = m.anisotropic_direction != Vec3::ZERO || m.texture(TextureSlot::AnisotropicDirection).is_some();
        if m.anisotropic > 0.0 && m.model != Model::Lambert && turned {
            self.note("highlights are stretched along growing u: their own direction has no counterpart");
        }
        match m.model {
            Model::Disney => {
                self.open("principled", id);
                self.principled()?;
            }
            Model::Lambert => return self.ideal(id),
            Model::Conductor => {
                self.open(if self.is_rough() { "roughconductor" } else { "conductor" }, id);
                self.metal(m.base_color * m.specular, m.eta, m.k)?;
                self.facets(true)?;
            }
            Model::Plastic => {
                self.open(if self.is_rough() { "roughplastic" } else { "plastic" }, id);
                self.xml.value("float", "int_ior", m.ior);
                self.xml.value("float", "ext_ior", 1.0);
                self.color("diffuse_reflectance", m.base_color, Use::Color)?;
                self.xml.rgb("specular_reflectance", m.specular);
                self.xml.value("boolean", "nonlinear", m.nonlinear);
                self.facets(false)?;
                if self.is_rough() {
                    self.note("rough plastic lets through what its rough surface does, here what a smooth one does");
                }
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

    fn is_rough(&self) -> bool {
        self.material.texture(TextureSlot::Roughness).is_some() || self.material.roughness >= self.material.smooth_below
    }

    /// A colour, or the base colour's texture times it.
    fn color(&mut self, name: &str, factor: Vec3, of: fn(Vec3) -> Use) -> Result<(), SceneError> {
        let slot = TextureSlot::BaseColor;
        match self.material.texture(slot) {
            Some(_) => self.textures.write(self.xml, name, self.material, slot, of(factor), self.folder),
            None => {
                let plain = if of(factor) == Use::Root(factor) { factor.map(f32::sqrt) } else { factor };
                self.xml.rgb(name, plain);
                Ok(())
            }
        }
    }

    /// A number or its texture.
    fn number(&mut self, name: &str, value: f32, slot: TextureSlot, of: Use) -> Result<(), SceneError> {
        match self.material.texture(slot) {
            Some(_) => self.textures.write(self.xml, name, self.material, slot, of, self.folder),
            None => {
                self.xml.value("float", name, value);
                Ok(())
            }
        }
    }

    fn principled(&mut self) -> Result<(), SceneError> {
        let m = self.material;
        self.color("base_color", m.base_color, Use::Color)?;
        self.number("roughness", m.roughness, TextureSlot::Roughness, Use::Number)?;
        if m.metallic > 0.0 || m.texture(TextureSlot::Metallic).is_some() {
            self.number("metallic", m.metallic, TextureSlot::Metallic, Use::Number)?;
        }
        if !self.is_opaque() {
            self.number("spec_trans", 1.0 - m.opacity, TextureSlot::Opacity, Use::Rest)?;
            if m.opacity > 0.0 || m.metallic > 0.0 {
                self.note("its opaque part shows on the front side only");
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
            self.xml.value("float", "clearcoat_gloss", m.clearcoat_gloss);
        }
        if m.roughness < m.smooth_below && m.texture(TextureSlot::Roughness).is_none() {
            self.note("smooth lobes are microfacets of the least roughness that there is");
        }
        Ok(())
    }

    /// Lambert, mirror and glass, as far as their weights are not zero.
    fn ideal(&mut self, id: &mut Vec<(&str, &str)>) -> Result<(), SceneError> {
        let m = self.material;
        let (metal, opaque) = (m.texture(TextureSlot::Metallic), m.texture(TextureSlot::Opacity));
        let mut blends = 0;
        let blend = |surface: &mut Self, id: &mut Vec<(&str, &str)>, slot: TextureSlot, value: f32| {
            surface.open("blendbsdf", id);
            surface.number("weight", value, slot, Use::Number)
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
                let wrapped = self.open_inside(both, id, "diffuse");
                self.color("reflectance", m.base_color, Use::Color)?;
                (0..wrapped).for_each(|_| self.xml.close());
            }
            (0..usize::from(both)).for_each(|_| self.xml.close());
        }
        if mixed || m.metallic >= 1.0 {
            let wrapped = self.open_inside(!self.is_opaque(), id, "conductor");
            self.metal(m.base_color, Vec3::ZERO, Vec3::ONE)?;
            (0..wrapped).for_each(|_| self.xml.close());
        }
        (0..blends).for_each(|_| self.xml.close());
        Ok(())
    }

    /// Opens a part of a blend; one that is not two-sided as a whole has two-sided opaque parts.
    fn open_inside(&mut self, alone: bool, id: &mut Vec<(&str, &str)>, kind: &str) -> usize {
        if alone {
            self.open("twosided", id);
        }
        self.open(kind, id);
        1 + usize::from(alone)
    }

    fn metal(&mut self, factor: Vec3, eta: Vec3, k: Vec3) -> Result<(), SceneError> {
        if (eta, k) == (Vec3::ZERO, Vec3::ONE) {
            self.xml.value("string", "material", "none");
        } else {
            self.xml.rgb("eta", eta);
            self.xml.rgb("k", k);
        }
        self.color("specular_reflectance", factor, Use::Color)
    }

    fn glass(&mut self, specular: Vec3) -> Result<(), SceneError> {
        self.xml.value("float", "int_ior", self.material.ior);
        self.xml.value("float", "ext_ior", 1.0);
        self.xml.rgb("specular_reflectance", specular);
        self.color("specular_transmittance", self.material.base_color, Use::Root)
    }

    /// Distribution and alpha of a rough interface; `full` ones may be stretched and have a texture.
    fn facets(&mut self, full: bool) -> Result<(), SceneError> {
        let m = self.material;
        if !self.is_rough() {
            return Ok(());
        }
        let kind = match m.distribution {
            Distribution::Ggx => "ggx",
            Distribution::Beckmann => "beckmann",
        };
        self.xml.value("string", "distribution", kind);
        let texture = m.texture(TextureSlot::Roughness);
        let alpha = m.roughness * m.roughness;
        if full && texture.is_some() {
            if m.anisotropic > 0.0 {
                self.note("a roughness from a texture is not stretched");
            }
            return self.number("alpha", alpha, TextureSlot::Roughness, Use::Square);
        }
        if texture.is_some() {
            self.note("its roughness is that of the material, without the texture");
        }
        let aspect = (1.0 - 0.9 * m.anisotropic).sqrt();
        if m.anisotropic == 0.0 || !full {
            if m.anisotropic > 0.0 {
                self.note("its highlights are not stretched");
            }
            self.xml.value("float", "alpha", alpha);
            return Ok(());
        }
        let (u, v) = (alpha / aspect, alpha * aspect);
        if u > 1.0 {
            self.note("its highlights are stretched less: alpha is at most 1");
        }
        self.xml.value("float", "alpha_u", u.min(1.0));
        self.xml.value("float", "alpha_v", v);
        Ok(())
    }
}
