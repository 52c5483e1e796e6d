//! Materials, converted to the nearest model of this renderer.
//!
//! All reflect on both sides, as in pbrt, and use the distribution of Trowbridge and Reitz.

mod rough;
mod version3;

use std::sync::Arc;

use glam::Vec3;

use super::Loader;
use super::material_source::MaterialSource;
use super::params::{Param, Params};
use super::spectrum::Use;
use super::texture::TextureContext;
use super::token::truncated;
use crate::load::composed::{ImageTexture, TextureValue};
use crate::load::images::is_grey;
use crate::model_differences;
use lumbre_light::scene::desc::material_params::MIN_IOR;
use lumbre_light::scene::desc::{MaskMode, MaterialDesc, Model, TextureDesc, TextureSlot};
use lumbre_light::scene::{Note, SceneError};

/// Greatest depth of mixes in mixes.
const MAX_NESTING: usize = 8;

/// Conversion of one material.
struct MaterialReader<'a> {
    m: MaterialDesc,
    source: &'a MaterialSource,
    loader: &'a mut Loader,
    depth: usize,
}

/// Converts a material to one with this name.
pub(super) fn read(
    source: &MaterialSource,
    name: &str,
    loader: &mut Loader,
    depth: usize,
) -> Result<MaterialDesc, SceneError> {
    if depth > MAX_NESTING {
        return Err(source.params.error(format!(
            "mixes are nested more than {MAX_NESTING} levels deep"
        )));
    }
    let mut reader = MaterialReader {
        m: MaterialDesc::new(name),
        source,
        loader,
        depth,
    };
    reader.class()?;
    reader.maps()?;
    let MaterialReader { m, loader, .. } = reader;
    source.params.note_unread(&mut loader.notes);
    Ok(m)
}

/// Sets a mask that accepts a hit with the probability of a number, or of a texture.
pub(super) fn set_mask(m: &mut MaterialDesc, opacity: TextureValue) {
    m.mask_mode = MaskMode::Blend;
    match opacity {
        TextureValue::Constant(c) => {
            let grey = (c.element_sum() / 3.0).clamp(0.0, 1.0);
            m.set_texture(TextureSlot::Mask, Some(Arc::new(TextureDesc::grey(grey))));
        }
        TextureValue::Image(image) => image.apply_to(m, TextureSlot::Mask),
    }
}

impl<'a> MaterialReader<'a> {
    /// Sets the parameters of the material's type.
    fn class(&mut self) -> Result<(), SceneError> {
        match self.source.class.as_str() {
            "diffuse" => self.diffuse("reflectance", 0.5),
            "conductor" => self.conductor("", 0.0),
            "dielectric" => {
                self.dielectric()?;
                self.rough("", 0.0)
            }
            "thindielectric" => {
                self.m.thin = true;
                self.dielectric()
            }
            "coateddiffuse" => self.coated_diffuse(),
            "coatedconductor" => self.coated_conductor(),
            "diffusetransmission" => {
                let scale = self.params().number("scale", 1.0)? as f32;
                self.translucent(["reflectance", "transmittance"], [Vec3::splat(scale); 2])
            }
            "mix" => self.mix(),
            "interface" | "none" | "" => {
                // A pane with the index of the outside transmits everything unchanged.
                (self.m.model, self.m.thin, self.m.ior) = (Model::Dielectric, true, 1.0);
                Ok(())
            }
            _ => self.version3(),
        }
    }

    /// Returns the parameters of the material.
    fn params(&self) -> &'a Params {
        &self.source.params
    }

    /// Adds a note about the material.
    fn note(&mut self, message: impl std::fmt::Display) {
        let note = self.source.params.note(message);
        self.loader.notes.push(note);
    }

    /// Returns a parameter of colours or numbers, which may be a texture.
    fn value(
        &mut self,
        name: &str,
        of_color: bool,
        default: f32,
    ) -> Result<TextureValue, SceneError> {
        let source = self.source;
        let Some(p) = source.params.get(name) else {
            return Ok(TextureValue::Constant(Vec3::splat(default)));
        };
        let textures = &self.loader.textures;
        source
            .captured(p, of_color)
            .unwrap_or_else(|| textures.value_of(p, of_color, Use::Reflectance, &source.spectra))
    }

    /// Returns a parameter that cannot have a texture here: of an image the mean, with a note.
    fn constant(&mut self, name: &str, of_color: bool, default: f32) -> Result<Vec3, SceneError> {
        let value = self.value(name, of_color, default)?;
        if matches!(value, TextureValue::Image(_)) {
            self.note(format!(
                "an image as `{name}` is not supported; its mean is used"
            ));
        }
        Ok(value.mean(of_color))
    }

    /// Returns a number that cannot have a texture here.
    fn number(&mut self, name: &str, default: f32) -> Result<f32, SceneError> {
        Ok(self.constant(name, false, default)?.x)
    }

    /// Reads the base colour, or its texture.
    fn base(&mut self, name: &str, default: f32) -> Result<(), SceneError> {
        self.m.base_color = self.color(name, default, TextureSlot::BaseColor)?;
        Ok(())
    }

    /// Reads a colour, or the texture of a slot, whose factor is returned.
    fn color(&mut self, name: &str, default: f32, slot: TextureSlot) -> Result<Vec3, SceneError> {
        Ok(match self.value(name, true, default)? {
            TextureValue::Constant(color) => self.clamped(name, color),
            TextureValue::Image(image) => {
                image.apply_to(&mut self.m, slot);
                Vec3::ONE
            }
        })
    }

    /// Returns a colour clamped to 0..=1, with a note if it was outside.
    fn clamped(&mut self, name: &str, color: Vec3) -> Vec3 {
        let inside = color.clamp(Vec3::ZERO, Vec3::ONE);
        if inside != color {
            self.note(format!("`{name}` is outside 0 to 1; it is clamped"));
        }
        inside
    }

    /// Sets a translucent sheet, by the names of its reflectance and transmittance and factors on
    /// them.
    fn translucent(&mut self, names: [&str; 2], factors: [Vec3; 2]) -> Result<(), SceneError> {
        self.m.model = Model::Translucent;
        let base_color = self.color(names[0], 0.25, TextureSlot::BaseColor)?;
        let transmittance = self.color(names[1], 0.25, TextureSlot::Transmittance)?;
        self.m.base_color = self.clamped(names[0], base_color * factors[0]);
        self.m.transmittance = self.clamped(names[1], transmittance * factors[1]);
        Ok(())
    }

    /// Sets a diffuse surface.
    fn diffuse(&mut self, name: &str, default: f32) -> Result<(), SceneError> {
        self.m.model = Model::Lambert;
        self.base(name, default)
    }

    /// Returns an index of refraction.
    fn index(&mut self, names: &[&str], default: f64) -> Result<f32, SceneError> {
        let Some(p) = self.source.params.any(names) else {
            return Ok(default as f32);
        };
        let (value, of_spectrum) = if p.ty == "texture" {
            (f64::from(self.number(&p.name, 1.5)?), false)
        } else {
            self.source.spectra.index(p)?
        };
        if of_spectrum {
            self.note("dispersion is not supported; the index at 587.6 nm is used");
        }
        // Version 3 means a surface without refraction by an index of zero.
        let value = if value == 0.0 { 1.0 } else { value };
        if (MIN_IOR..=100.0).contains(&value) {
            return Ok(value as f32);
        }
        Err(p.error(format!(
            "expected an index between {MIN_IOR} and 100, found {value}"
        )))
    }

    /// Returns a colour of an index of refraction, or of the absorption.
    fn index_color(&mut self, p: &Param) -> Result<Vec3, SceneError> {
        if p.ty == "texture" {
            return self.constant(&p.name, true, 1.0);
        }
        let color = self.source.spectra.color(p, Use::Index)?;
        if color.max_element() > 100.0 {
            return Err(p.error("expected an index of at most 100"));
        }
        Ok(color)
    }

    /// Sets a conductor; its parameters begin with a prefix, such as `conductor.`.
    fn conductor(&mut self, prefix: &str, roughness: f32) -> Result<(), SceneError> {
        self.m.model = Model::Conductor;
        let params = &self.source.params;
        let names = ["eta", "k"].map(|name| format!("{prefix}{name}"));
        let given = [params.get(&names[0]), params.get(&names[1])];
        if params.get("reflectance").is_some() {
            if given.iter().any(Option::is_some) {
                return Err(params.error("`reflectance` excludes `eta` and `k`"));
            }
            self.reflectance()?;
        } else {
            let copper = super::spectrum::copper();
            (self.m.eta, self.m.k) = copper;
            if let Some(p) = given[0] {
                self.m.eta = self.index_color(p)?;
            }
            if let Some(p) = given[1] {
                self.m.k = self.index_color(p)?;
            }
        }
        self.rough(prefix, roughness)
    }

    /// Sets the index of a conductor that has this reflectance at normal incidence: eta of 1, and k
    /// accordingly, as pbrt does.
    fn reflectance(&mut self) -> Result<(), SceneError> {
        match self.value("reflectance", true, 1.0)? {
            TextureValue::Constant(color) => {
                let r = color.clamp(Vec3::ZERO, Vec3::splat(0.9999));
                self.m.eta = Vec3::ONE;
                self.m.k = (r / (Vec3::ONE - r))
                    .map(|x| 2.0 * x.sqrt())
                    .min(Vec3::splat(100.0));
            }
            TextureValue::Image(image) => {
                self.note(
                    "an image as `reflectance` is the same at all angles here; in pbrt it \
                     increases to 1 at grazing ones",
                );
                (self.m.eta, self.m.k) = (Vec3::ZERO, Vec3::ONE);
                image.apply_to(&mut self.m, TextureSlot::BaseColor);
            }
        }
        Ok(())
    }

    /// Sets a dielectric without its roughness.
    fn dielectric(&mut self) -> Result<(), SceneError> {
        (self.m.model, self.m.roughness) = (Model::Dielectric, 0.0);
        self.m.opacity = 0.0;
        self.m.ior = self.index(&["eta", "index"], 1.5)?;
        Ok(())
    }

    /// Sets a plastic for a coat over a diffuse base: with all reflections between the two.
    fn coated_diffuse(&mut self) -> Result<(), SceneError> {
        (self.m.model, self.m.nonlinear) = (Model::Plastic, true);
        self.base("reflectance", 0.5)?;
        self.m.ior = self.index(&["eta"], 1.5)?;
        self.rough("", 0.0)?;
        self.layers()?;
        let alpha = self.alpha();
        self.note(model_differences::coated_diffuse(alpha));
        Ok(())
    }

    /// Sets a conductor for a coat over a conductor, whose index is relative to that of the coat.
    fn coated_conductor(&mut self) -> Result<(), SceneError> {
        self.conductor("conductor.", 0.0)?;
        let coat = self.index(&["interface.eta"], 1.5)?;
        if self.params().get("reflectance").is_none() {
            (self.m.eta, self.m.k) = (self.m.eta / coat, self.m.k / coat);
        }
        for name in [
            "interface.roughness",
            "interface.uroughness",
            "interface.vroughness",
        ] {
            self.params().get(name);
        }
        self.layers()?;
        self.note(model_differences::COATED_CONDUCTOR);
        Ok(())
    }

    /// Reads the medium between the layers, which is not supported.
    fn layers(&mut self) -> Result<(), SceneError> {
        self.params()
            .mark_read(&["thickness", "maxdepth", "nsamples", "g"]);
        if self.constant("albedo", true, 0.0)? != Vec3::ZERO {
            self.note("a medium between the layers (`albedo`) is not supported; ignored");
        }
        Ok(())
    }

    /// Returns the roughness as alpha; 1 if it is a texture.
    fn alpha(&self) -> f32 {
        if self.m.texture(TextureSlot::Roughness).is_some() {
            1.0
        } else {
            self.m.roughness.powi(2)
        }
    }

    /// Sets a material that is composed of two others. `amount` is the weight of the second in
    /// version 4 and of the first in version 3.
    fn mix(&mut self) -> Result<(), SceneError> {
        let source = self.source;
        let version4 = source.params.get("materials");
        let names: Vec<&str> = match version4 {
            Some(p) => p.texts()?.iter().map(String::as_str).collect(),
            None => ["namedmaterial1", "namedmaterial2"]
                .into_iter()
                .filter_map(|name| source.params.text(name).transpose())
                .collect::<Result<_, _>>()?,
        };
        if names.len() != 2 {
            return Err(source.params.error(format!(
                "a mix needs the names of two materials, found {}",
                names.len()
            )));
        }
        for name in names {
            let part = match source.parts.get(name) {
                Some(part) => part.clone(),
                None => self.loader.named_material(name, &source.params)?,
            };
            let part = self.loader.material(&part, self.depth + 1)?;
            self.m.parts.push(part);
        }
        let of_second = version4.is_some();
        let amount = self.amount(of_second)?;
        let amount = match (amount, of_second) {
            (TextureValue::Image(image), false) => {
                TextureValue::Image(self.mapped(image, "inverse", |x| 1.0 - x)?)
            }
            (TextureValue::Constant(c), false) => TextureValue::Constant(Vec3::ONE - c),
            (value, true) => value,
        };
        let second = amount.mean(false).x.clamp(0.0, 1.0);
        self.m.weights = vec![1.0 - second, second];
        if let TextureValue::Image(image) = amount {
            image.apply_to(&mut self.m, TextureSlot::Weights);
        }
        Ok(())
    }

    /// Returns the `amount` of a mix: a number in version 4, and a colour in version 3, of which
    /// the mean of the channels is used.
    fn amount(&mut self, version4: bool) -> Result<TextureValue, SceneError> {
        let is_number = self.params().get("amount").is_some_and(|p| p.ty == "float");
        if version4 || is_number {
            return self.value("amount", false, 0.5);
        }
        let coloured = "a coloured `amount` is not supported; the mean of its channels is used";
        match self.value("amount", true, 0.5)? {
            TextureValue::Constant(c) => {
                if c.max_element() != c.min_element() {
                    self.note(coloured);
                }
                Ok(TextureValue::Constant(Vec3::splat(c.element_sum() / 3.0)))
            }
            TextureValue::Image(image) => {
                if !is_grey(&image.image) {
                    self.note(coloured);
                }
                let grey = |[r, g, b, _]: [f32; 4]| [(r + g + b) / 3.0; 4];
                let textures = &mut self.loader.textures;
                let image = textures.mapped(&self.source.params, image, "grey amount", grey)?;
                Ok(TextureValue::Image(image))
            }
        }
    }

    /// Applies a function to the numbers of an image; `how` names it.
    fn mapped(
        &mut self,
        image: ImageTexture,
        how: &str,
        f: impl Fn(f32) -> f32,
    ) -> Result<ImageTexture, SceneError> {
        let texel = |texel: [f32; 4]| texel.map(&f);
        self.loader
            .textures
            .mapped(&self.source.params, image, how, texel)
    }

    /// Reads the normal map and the displacement, which becomes a bump map.
    fn maps(&mut self) -> Result<(), SceneError> {
        let source = self.source;
        if let Some(file) = source.params.text("normalmap")? {
            let mut context = TextureContext {
                spectra: &source.spectra,
                notes: &mut self.loader.notes,
            };
            let map = self
                .loader
                .textures
                .normal_map(&source.params, file, &mut context)?;
            if let Some(map) = map {
                map.apply_to(&mut self.m, TextureSlot::Normal);
            }
        }
        for name in ["displacement", "bumpmap"] {
            match self.value(name, false, 0.0)? {
                TextureValue::Image(image) if image.is_interpolated() => {
                    self.note(model_differences::PBRT_BUMPS);
                    image.apply_to(&mut self.m, TextureSlot::Bump);
                }
                TextureValue::Image(_) => self.note(model_differences::STEPPED_BUMPS),
                TextureValue::Constant(_) => {}
            }
        }
        Ok(())
    }
}

/// Returns the note about a material that is not supported.
fn unsupported(class: &str) -> String {
    format!(
        "the material `{}` is not supported; a diffuse one is used",
        truncated(class)
    )
}

/// Returns the surface of shapes whose material is not known.
pub(super) fn default_material(name: &str) -> MaterialDesc {
    MaterialDesc {
        model: Model::Lambert,
        base_color: Vec3::splat(0.5),
        ..MaterialDesc::new(name)
    }
}

/// Removes the parts of a material that emits light, with a note.
pub(super) fn without_parts(m: &mut MaterialDesc, params: &Params, notes: &mut Vec<Note>) {
    if !m.parts.is_empty() {
        (m.parts, m.weights) = (Vec::new(), Vec::new());
        m.emitter_reflects = false;
        notes.push(params.note("a light on a mixed material reflects nothing here"));
    }
}
