//! Surfaces of Mitsuba scenes: plugins of the class `bsdf`, converted to materials.

mod adapters;
mod old;

use std::collections::BTreeSet;
use std::f32::consts::{FRAC_1_SQRT_2, FRAC_PI_2};
use std::rc::Rc;
use std::sync::Arc;

use glam::Vec3;

use super::super::metals;
use super::MitsubaLoader;
use super::texture::TextureReader;
use super::tree::{Property, PropertyValue, XmlObject};
use crate::load::composed::ImageTexture;
use crate::load::images::mean_texel;
use crate::model_differences;
use crate::names::UniqueNames;
use lumbre_light::scene::desc::material::SMOOTH_ROUGHNESS;
use lumbre_light::scene::desc::material_params::MIN_IOR;
use lumbre_light::scene::desc::{
    Distribution, Formulas, MaterialDesc, Model, RoughnessTexels, Texels, TextureDesc, TextureSlot,
};
use lumbre_light::scene::{Note, SceneError};

/// Greatest nesting depth of surfaces.
const MAX_NESTING: usize = 8;

/// Alpha to which Mitsuba 3 raises smaller ones.
const LEAST_ALPHA: f64 = 1e-4;

/// Converts a surface to a material with the given name, which is returned last, after the parts of
/// which it is composed. `two_sided` is set inside of `twosided`.
pub(super) fn read(
    object: &Rc<XmlObject>,
    name: &str,
    two_sided: bool,
    loader: &mut MitsubaLoader,
) -> Result<Vec<MaterialDesc>, SceneError> {
    let mut reader = BsdfReader {
        m: MaterialDesc::new(name),
        parts: Vec::new(),
        names: &mut loader.names,
        colored: &mut loader.colored,
        textures: &mut loader.textures,
        notes: &mut loader.notes,
    };
    reader.surface(object, two_sided, 0)?;
    let BsdfReader { m, mut parts, .. } = reader;
    parts.push(m);
    Ok(parts)
}

/// Returns the surface of shapes without one: grey on the front side, or black if they `emit`.
pub(super) fn default_surface(name: &str, emits: bool) -> MaterialDesc {
    MaterialDesc {
        model: Model::Lambert,
        base_color: Vec3::splat(0.5),
        one_sided: true,
        emitter_reflects: !emits,
        ..MaterialDesc::new(name)
    }
}

/// Returns a surface that transmits everything unchanged: a pane with the index of the outside.
pub(super) fn invisible(name: &str) -> MaterialDesc {
    MaterialDesc {
        model: Model::Dielectric,
        thin: true,
        ior: 1.0,
        ..MaterialDesc::new(name)
    }
}

/// Returns the texture of a direction of anisotropy along v, which is rougher than u.
fn along_v() -> Arc<TextureDesc> {
    let texels = vec![[0.5, 1.0, 0.0, 1.0]];
    Arc::new(TextureDesc::new("", 1, 1, Texels::RgbaF32(texels)))
}

/// Conversion of one surface.
struct BsdfReader<'a> {
    m: MaterialDesc,
    /// Materials of which it is composed.
    parts: Vec<MaterialDesc>,
    names: &'a mut UniqueNames,
    /// Names of the materials whose base colour is that of vertices.
    colored: &'a mut BTreeSet<String>,
    textures: &'a mut TextureReader,
    notes: &'a mut Vec<Note>,
}

impl BsdfReader<'_> {
    /// Converts a surface: either an adapter with a surface inside, or a plain plugin. `two_sided`
    /// is set inside of `twosided`.
    fn surface(
        &mut self,
        o: &Rc<XmlObject>,
        two_sided: bool,
        depth: usize,
    ) -> Result<(), SceneError> {
        if depth > MAX_NESTING {
            return Err(o.error(format!(
                "surfaces are nested more than {MAX_NESTING} levels deep"
            )));
        }
        match o.plugin.as_str() {
            "twosided" => self.nested(o, true, depth),
            "mask" => {
                self.nested(o, two_sided, depth)?;
                self.mask(o)
            }
            "bumpmap" => {
                self.nested(o, two_sided, depth)?;
                self.bump_map(o)
            }
            "normalmap" => {
                self.nested(o, two_sided, depth)?;
                self.normal_map(o)
            }
            "blendbsdf" => self.blend(o, two_sided, depth),
            "mixturebsdf" => self.mixture(o, two_sided, depth),
            "coating" | "roughcoating" => self.coating(o, two_sided, depth),
            _ => {
                self.plugin(o)?;
                let transmits = matches!(self.m.model, Model::Dielectric | Model::Translucent);
                self.m.one_sided = !two_sided && !transmits;
                Ok(())
            }
        }
    }

    /// Reads a texture, if there is one.
    fn optional_texture(
        &mut self,
        o: Option<Rc<XmlObject>>,
    ) -> Result<Option<ImageTexture>, SceneError> {
        match o {
            Some(o) => self.textures.read(&o, self.notes),
            None => Ok(None),
        }
    }

    /// Converts a plugin without a surface inside.
    fn plugin(&mut self, o: &XmlObject) -> Result<(), SceneError> {
        match o.plugin.as_str() {
            "diffuse" => {
                self.m.model = Model::Lambert;
                // Version 0.6 knows both names.
                let old = o.legacy && o.property("diffuse_reflectance").is_some();
                let name = if old {
                    "diffuse_reflectance"
                } else {
                    "reflectance"
                };
                self.base(o, name, 0.5)
            }
            "roughdiffuse" => {
                // `alpha` is the deviation of the slopes of both axes together.
                let alpha = self.unit_number(o, "alpha", 0.2, None)?;
                let sigma = alpha * FRAC_1_SQRT_2;
                (self.m.model, self.m.roughness) = (Model::OrenNayar, sigma / FRAC_PI_2);
                let fast = ["useFastApprox", "use_fast_approx"];
                if !(o.flag(fast[0], false)? || o.flag(fast[1], false)?) {
                    self.notes.push(o.note(model_differences::ROUGH_DIFFUSE));
                }
                self.base(o, "reflectance", 0.5)
            }
            "difftrans" => {
                (self.m.model, self.m.base_color) = (Model::Translucent, Vec3::ZERO);
                let slot = TextureSlot::Transmittance;
                self.m.transmittance = self.color(o, "transmittance", 0.5, slot)?;
                Ok(())
            }
            "conductor" => self.conductor(o),
            "roughconductor" => {
                self.conductor(o)?;
                self.rough(o)
            }
            "dielectric" => self.dielectric(o),
            "thindielectric" => {
                self.m.thin = true;
                self.dielectric(o)
            }
            "roughdielectric" => {
                self.dielectric(o)?;
                self.rough(o)
            }
            "plastic" => self.plastic(o),
            "roughplastic" => {
                self.plastic(o)?;
                self.rough(o)?;
                self.m.formulas = Formulas::Mitsuba;
                Ok(())
            }
            "principled" => self.principled(o),
            "phong" => self.phong(o),
            "ward" => self.ward(o),
            "null" => {
                self.m = invisible(&self.m.name);
                Ok(())
            }
            other => {
                let shown = super::values::truncated(other);
                self.notes.push(o.note(format!(
                    "the surface `{shown}` is not supported; a grey diffuse one is used"
                )));
                o.mark_all_read();
                self.m = default_surface(&self.m.name, false);
                Ok(())
            }
        }
    }

    /// Reads the base colour, or its texture.
    fn base(&mut self, o: &XmlObject, key: &str, default: f32) -> Result<(), SceneError> {
        if let Some(Property::Object(t)) = o.property(key)
            && t.plugin == "mesh_attribute"
        {
            return self.vertex_colors(t);
        }
        self.m.base_color = self.color(o, key, default, TextureSlot::BaseColor)?;
        Ok(())
    }

    /// Reads a colour, or the texture of a slot, whose factor is returned.
    fn color(
        &mut self,
        o: &XmlObject,
        key: &str,
        default: f32,
        slot: TextureSlot,
    ) -> Result<Vec3, SceneError> {
        if let Some(Property::Object(t)) = o.property(key) {
            return Ok(match self.textures.read(t, self.notes)? {
                Some(read) => {
                    self.set_texture(o, slot, read);
                    Vec3::ONE
                }
                None => Vec3::splat(0.5),
            });
        }
        Ok(match o.color(key)? {
            Some(color) => self.clamped_color(o, key, color),
            None => Vec3::splat(default),
        })
    }

    /// Reads the base colour from a `mesh_attribute`: a factor on the colours of the vertices.
    fn vertex_colors(&mut self, o: &XmlObject) -> Result<(), SceneError> {
        let scale = o.number("scale", 1.0)? as f32;
        let name = o.text("name")?.unwrap_or_default();
        if name != "vertex_color" {
            self.notes.push(o.note(format!(
                "the attribute `{}` is not supported, only `vertex_color`; grey is used",
                super::values::truncated(name)
            )));
            self.m.base_color = Vec3::splat(0.5);
            return Ok(());
        }
        self.m.base_color = self.clamped_color(o, "scale", Vec3::splat(scale));
        self.colored.insert(self.m.name.clone());
        Ok(())
    }

    /// Reads a colour that cannot have a texture here.
    fn constant_color(&mut self, o: &XmlObject, key: &str) -> Result<Vec3, SceneError> {
        if let Some(Property::Object(t)) = o.property(key) {
            self.notes.push(t.note(format!(
                "textures of `{key}` are not supported; white is used"
            )));
            return Ok(Vec3::ONE);
        }
        let color = o.color(key)?.unwrap_or(Vec3::ONE);
        Ok(self.clamped_color(o, key, color))
    }

    /// Returns a colour clamped to 0..=1, with a note if it was outside.
    fn clamped_color(&mut self, o: &XmlObject, key: &str, color: Vec3) -> Vec3 {
        let inside = color.clamp(Vec3::ZERO, Vec3::ONE);
        if inside != color {
            self.notes
                .push(o.note(format!("`{key}` is outside 0 to 1; it is clamped")));
        }
        inside
    }

    /// Sets the texture of a slot, with a note if its mapping is not supported.
    fn set_texture(&mut self, o: &XmlObject, slot: TextureSlot, read: ImageTexture) {
        if let Err(e) = read.apply_relative(&mut self.m, slot) {
            self.notes.push(o.note(e.to_string()));
        }
    }

    /// Reads `alpha`, or `alpha_u` and `alpha_v`, as roughness and anisotropy.
    fn rough(&mut self, o: &XmlObject) -> Result<(), SceneError> {
        self.m.distribution = match o.text("distribution")? {
            Some("ggx") => Distribution::Ggx,
            None | Some("beckmann") => Distribution::Beckmann,
            Some(other) => {
                let shown = super::values::truncated(other);
                self.notes.push(o.note(format!(
                    "the distribution `{shown}` is not supported; `beckmann` is used"
                )));
                Distribution::Beckmann
            }
        };
        o.mark_read(&["sample_visible"]);
        if let Some(Property::Object(t)) = o.property("alpha") {
            if let Some(read) = self.number_texture(t)? {
                let read = match read.image.texels {
                    Texels::Rgba8(_) => read,
                    Texels::RgbaF32(_) => {
                        let unit = |x: f32| x.clamp(0.0, 1.0);
                        self.textures.mapped(t, read, "unit", unit)?
                    }
                };
                self.m.roughness_texels = RoughnessTexels::Alpha;
                self.set_texture(o, TextureSlot::Roughness, read);
            }
            return Ok(());
        }
        let alpha = o.number("alpha", 0.1)?;
        let (u, v) = (
            self.number_or_mean(o, "alpha_u", alpha)?,
            self.number_or_mean(o, "alpha_v", alpha)?,
        );
        if !(u >= 0.0 && v >= 0.0 && u <= 1.0 && v <= 1.0) {
            return Err(o.error(format!(
                "`alpha` must be at least 0 and at most 1, found {u} and {v}"
            )));
        }
        let (u, v) = (u.max(LEAST_ALPHA), v.max(LEAST_ALPHA));
        self.m.roughness = (u * v)
            .sqrt()
            .sqrt()
            .clamp(f64::from(SMOOTH_ROUGHNESS), 1.0) as f32;
        let stretch = (1.0 - u.min(v) / u.max(v)) / 0.9;
        if stretch > 1.0 {
            self.notes.push(o.note(
                "one of `alpha_u` and `alpha_v` may be at most ten times the other here; it is clamped",
            ));
        }
        self.m.anisotropic = stretch.min(1.0) as f32;
        if v > u {
            self.m
                .set_texture(TextureSlot::AnisotropicDirection, Some(along_v()));
        }
        Ok(())
    }

    /// Reads a number, or the mean of its texture.
    fn number_or_mean(
        &mut self,
        o: &XmlObject,
        key: &str,
        default: f64,
    ) -> Result<f64, SceneError> {
        let Some(Property::Object(t)) = o.property(key) else {
            return o.number(key, default);
        };
        let Some(read) = self.number_texture(t)? else {
            return Ok(default);
        };
        let mean = mean_texel(&read.image, false).x;
        self.notes.push(t.note(format!(
            "textures of `{key}` are not supported; their mean, {mean:.3}, is used"
        )));
        Ok(f64::from(mean))
    }

    /// Reads a conductor; a smooth one unless [`BsdfReader::rough`] follows.
    fn conductor(&mut self, o: &XmlObject) -> Result<(), SceneError> {
        (self.m.model, self.m.roughness) = (Model::Conductor, 0.0);
        self.base(o, "specular_reflectance", 1.0)?;
        let material = o.text("material")?;
        let given = (o.color("eta")?, o.color("k")?);
        // The default of Mitsuba 3, a perfect mirror, is used; that of Mitsuba 0.5 was copper.
        let named = material.unwrap_or("none");
        let (eta, k) = match given {
            (None, None) => metals::metal(named).ok_or_else(|| {
                let shown = super::values::truncated(named);
                o.error(format!(
                    "unknown metal `{shown}`; supported: {}, none",
                    metals::metal_names()
                ))
            })?,
            (eta, k) => (eta.unwrap_or(Vec3::ZERO), k.unwrap_or(Vec3::ONE)),
        };
        let exterior_key = if o.property("ext_ior").is_some() {
            "ext_ior"
        } else {
            "ext_eta"
        };
        let outside = self.index(o, exterior_key, 1.0)? as f32;
        (self.m.eta, self.m.k) = (
            (eta / outside).max(Vec3::ZERO),
            (k / outside).max(Vec3::ZERO),
        );
        if self.m.eta.max(self.m.k).max_element() > 100.0 {
            return Err(o.error("`eta` and `k` must be at most 100"));
        }
        Ok(())
    }

    /// Reads an index of refraction: a number or the name of a medium.
    fn index(&self, o: &XmlObject, key: &str, default: f64) -> Result<f64, SceneError> {
        let value = match o.property(key) {
            None => default,
            Some(Property::Value(PropertyValue::Text(name))) => metals::dielectric(name)
                .ok_or_else(|| {
                    o.error(format!(
                        "unknown medium `{}`",
                        super::values::truncated(name)
                    ))
                })?,
            Some(_) => o.number(key, default)?,
        };
        if (MIN_IOR..=100.0).contains(&value) {
            return Ok(value);
        }
        Err(o.error(format!(
            "`{key}` must be between {MIN_IOR} and 100, found {value}"
        )))
    }

    /// Reads the index of the inside relative to the outside.
    fn relative_index(&self, o: &XmlObject, inside: f64) -> Result<f32, SceneError> {
        let index = self.index(o, "int_ior", inside)? / self.index(o, "ext_ior", 1.000_277)?;
        Ok(index as f32)
    }

    /// Reads a dielectric; a smooth one unless [`BsdfReader::rough`] follows.
    fn dielectric(&mut self, o: &XmlObject) -> Result<(), SceneError> {
        (self.m.model, self.m.roughness) = (Model::Dielectric, 0.0);
        self.m.opacity = 0.0;
        self.m.ior = self.relative_index(o, 1.5046)?;
        self.m.specular = self.constant_color(o, "specular_reflectance")?;
        let transmittance = self.constant_color(o, "specular_transmittance")?;
        self.m.base_color = transmittance * transmittance;
        Ok(())
    }

    /// Reads a plastic; a smooth one unless [`BsdfReader::rough`] follows.
    fn plastic(&mut self, o: &XmlObject) -> Result<(), SceneError> {
        (self.m.model, self.m.roughness) = (Model::Plastic, 0.0);
        self.m.ior = self.relative_index(o, 1.49)?;
        self.base(o, "diffuse_reflectance", 0.5)?;
        self.m.specular = self.constant_color(o, "specular_reflectance")?;
        self.m.nonlinear = o.flag("nonlinear", false)?;
        Ok(())
    }

    /// Reads a texture of numbers.
    fn number_texture(&mut self, o: &Rc<XmlObject>) -> Result<Option<ImageTexture>, SceneError> {
        let Some(read) = self.textures.read(o, self.notes)? else {
            return Ok(None);
        };
        if o.plugin == "checkerboard" {
            self.notes.push(o.note(
                "Mitsuba exchanges the colours of a checkerboard that is used as a number, which is \
                 not supported",
            ));
        }
        self.textures.linear(o, read).map(Some)
    }

    /// Reads the `principled` surface.
    fn principled(&mut self, o: &XmlObject) -> Result<(), SceneError> {
        self.base(o, "base_color", 0.5)?;
        self.m.metallic = self.unit_number(o, "metallic", 0.0, Some(TextureSlot::Metallic))?;
        self.m.roughness = self.unit_number(o, "roughness", 0.5, Some(TextureSlot::Roughness))?;
        self.m.opacity = 1.0;
        match o.property("spec_trans") {
            Some(Property::Object(t)) => {
                if let Some(read) = self.number_texture(t)? {
                    let read = self.textures.mapped(t, read, "inverse", |x| 1.0 - x)?;
                    self.set_texture(o, TextureSlot::Opacity, read);
                }
            }
            _ => self.m.opacity = 1.0 - self.unit_number(o, "spec_trans", 0.0, None)?,
        }
        self.m.anisotropic = self.unit_number(o, "anisotropic", 0.0, None)?;
        self.m.specular_tint = self.unit_number(o, "spec_tint", 0.0, None)?;
        self.m.sheen = self.unit_number(o, "sheen", 0.0, None)?;
        self.m.sheen_tint = self.unit_number(o, "sheen_tint", 0.0, None)?;
        self.m.subsurface = self.unit_number(o, "flatness", 0.0, None)?;
        self.m.clearcoat = self.unit_number(o, "clearcoat", 0.0, None)?;
        self.m.clearcoat_gloss = self.unit_number(o, "clearcoat_gloss", 0.0, None)?;
        if o.property("eta").is_some() {
            self.m.ior = self.index(o, "eta", 1.5)? as f32;
        } else {
            // F0 = 0.08 specular, as an index.
            let root = (0.08 * self.unit_number(o, "specular", 0.5, None)?).sqrt();
            self.m.ior = (1.0 + root) / (1.0 - root);
        }
        o.mark_read(&[
            "diffuse_reflectance_sampling_rate",
            "main_specular_sampling_rate",
            "clearcoat_sampling_rate",
        ]);
        // Where all formulas agree, the material keeps the default.
        if self.m.clearcoat > 0.0 || self.m.specular_tint > 0.0 {
            self.m.formulas = Formulas::Mitsuba;
        }
        Ok(())
    }

    /// Reads a number clamped to 0..=1, or its texture if `slot` is given.
    fn unit_number(
        &mut self,
        o: &XmlObject,
        key: &str,
        default: f64,
        slot: Option<TextureSlot>,
    ) -> Result<f32, SceneError> {
        if let Some(Property::Object(t)) = o.property(key) {
            match (slot, self.number_texture(t)?) {
                (Some(slot), Some(read)) => {
                    self.set_texture(o, slot, read);
                }
                _ => self.notes.push(t.note(format!(
                    "textures of `{key}` are not supported; {default} is used"
                ))),
            }
            return Ok(default as f32);
        }
        let value = o.number(key, default)?;
        if !(0.0..=1.0).contains(&value) {
            self.notes
                .push(o.note(format!("`{key}` is {value}, outside 0 to 1; it is clamped")));
        }
        Ok(value.clamp(0.0, 1.0) as f32)
    }
}
