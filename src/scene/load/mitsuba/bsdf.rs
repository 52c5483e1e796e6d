//! Surfaces: plugins of the class `bsdf` as materials.

use std::rc::Rc;
use std::sync::Arc;

use glam::Vec3;

use super::texture::Textures;
use super::tree::{Data, Item, Object};
use super::{metals, texture};
use crate::scene::desc::material::{MIN_IOR, SMOOTH_ROUGHNESS};
use crate::scene::desc::{Distribution, MaskMode, MaterialDesc, Model, TextureDesc, TextureSlot};
use crate::scene::{Note, SceneError};

/// How deep surfaces may wrap one another.
const MAX_WRAPS: usize = 8;

/// Reads a surface as a material of a name.
pub(super) fn read(
    object: &Rc<Object>,
    name: &str,
    textures: &mut Textures,
    notes: &mut Vec<Note>,
) -> Result<MaterialDesc, SceneError> {
    let mut reader = Reader { m: MaterialDesc::new(name), textures, notes };
    reader.wrapped(object, false, 0)?;
    Ok(reader.m)
}

/// The grey surface of shapes that name none.
pub(super) fn plain(name: &str) -> MaterialDesc {
    MaterialDesc { model: Model::Lambert, base_color: Vec3::splat(0.5), ..MaterialDesc::new(name) }
}

struct Reader<'a> {
    m: MaterialDesc,
    textures: &'a mut Textures,
    notes: &'a mut Vec<Note>,
}

impl Reader<'_> {
    fn wrapped(&mut self, o: &Rc<Object>, two_sided: bool, depth: usize) -> Result<(), SceneError> {
        if depth > MAX_WRAPS {
            return Err(o.error("surfaces wrap one another too deep"));
        }
        let inner = |two_sided: bool, this: &mut Self| {
            let inside: Vec<_> = o.children("bsdf").cloned().collect();
            if inside.len() > 1 {
                this.notes.push(o.note(format!(
                    "the first of the {} surfaces of `{}` is used alone",
                    inside.len(),
                    o.kind
                )));
            }
            match inside.first() {
                Some(first) => this.wrapped(first, two_sided, depth + 1),
                None => Err(o.error(format!("a `{}` needs a surface inside", o.kind))),
            }
        };
        match o.kind.as_str() {
            "twosided" => inner(true, self),
            "mask" => {
                inner(two_sided, self)?;
                self.mask(o)
            }
            "bumpmap" => {
                inner(two_sided, self)?;
                // Its texture may have any name.
                let map = o.children("texture").next().cloned();
                let height = o.number("scale", 1.0)?;
                if height.abs() > 1e6 {
                    return Err(o.error(format!("`scale` must lie between -1e6 and 1e6, found {height}")));
                }
                if let Some(read) = map.map(|t| self.textures.read(&t, self.notes)).transpose()?.flatten() {
                    self.m.bump_height = height as f32;
                    let read = self.textures.heights(o, read)?;
                    self.slot(o, TextureSlot::Bump, read);
                }
                Ok(())
            }
            "normalmap" => {
                inner(two_sided, self)?;
                let map = o.item("normalmap").or_else(|| o.item(""));
                let map = match map {
                    Some(Item::Object(t)) if t.class == "texture" => Some(t.clone()),
                    _ => o.children("texture").next().cloned(),
                };
                if let Some(read) = map.map(|t| self.textures.read(&t, self.notes)).transpose()?.flatten() {
                    // Normals are stored as they are, whatever `raw` says.
                    self.slot(o, TextureSlot::Normal, read);
                }
                Ok(())
            }
            "blendbsdf" => {
                self.notes.push(o.note("surfaces are not blended"));
                o.known(&["weight"]);
                inner(two_sided, self)
            }
            _ => {
                let opaque = !matches!(o.kind.as_str(), "dielectric" | "thindielectric" | "roughdielectric" | "null");
                if !two_sided && opaque && o.kind != "principled" {
                    self.notes.push(o.note("opaque surfaces reflect on both sides, as if they were `twosided`"));
                }
                self.plugin(o)
            }
        }
    }

    fn plugin(&mut self, o: &Object) -> Result<(), SceneError> {
        match o.kind.as_str() {
            "diffuse" => {
                self.m.model = Model::Lambert;
                self.base(o, "reflectance", 0.5)
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
                self.rough(o)
            }
            "principled" => self.principled(o),
            "null" => {
                // A pane of the outside's own index lets everything pass as it is.
                (self.m.model, self.m.thin, self.m.ior) = (Model::Dielectric, true, 1.0);
                Ok(())
            }
            other => {
                let shown = super::values::shorten(other);
                self.notes
                    .push(o.note(format!("the surface `{shown}` is not known: a grey diffuse one takes its place")));
                o.known(&o.items.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>());
                self.m = plain(&self.m.name);
                Ok(())
            }
        }
    }

    /// Diffuse or reflected colour with its texture.
    fn base(&mut self, o: &Object, key: &str, default: f32) -> Result<(), SceneError> {
        self.m.base_color = Vec3::splat(default);
        if let Some(Item::Object(t)) = o.item(key) {
            match self.textures.read(t, self.notes)? {
                Some(read) => {
                    self.m.base_color = Vec3::ONE;
                    self.slot(o, TextureSlot::BaseColor, read);
                }
                None => self.m.base_color = Vec3::splat(0.5),
            }
        } else if let Some(color) = o.color(key)? {
            self.m.base_color = self.unit(o, key, color);
        }
        Ok(())
    }

    /// A colour that a texture cannot stand for here.
    fn tint(&mut self, o: &Object, key: &str) -> Result<Vec3, SceneError> {
        if let Some(Item::Object(t)) = o.item(key) {
            self.notes.push(t.note(format!("`{key}` has no texture here: white is used")));
            return Ok(Vec3::ONE);
        }
        let color = o.color(key)?.unwrap_or(Vec3::ONE);
        Ok(self.unit(o, key, color))
    }

    fn unit(&mut self, o: &Object, key: &str, color: Vec3) -> Vec3 {
        let inside = color.clamp(Vec3::ZERO, Vec3::ONE);
        if inside != color {
            self.notes.push(o.note(format!("`{key}` lies outside 0 to 1: it is clamped")));
        }
        inside
    }

    fn slot(&mut self, o: &Object, slot: TextureSlot, read: texture::Read) {
        if let Err(e) = read.lay(&mut self.m, slot) {
            self.notes.push(o.note(e.to_string()));
        }
    }

    /// `alpha`, or `alpha_u` and `alpha_v`, as roughness and anisotropy.
    fn rough(&mut self, o: &Object) -> Result<(), SceneError> {
        self.m.distribution = match o.text("distribution")? {
            Some("ggx") => Distribution::Ggx,
            None | Some("beckmann") => Distribution::Beckmann,
            Some(other) => {
                let shown = super::values::shorten(other);
                self.notes.push(o.note(format!("the distribution `{shown}` is not known: `beckmann` is used")));
                Distribution::Beckmann
            }
        };
        o.known(&["sample_visible"]);
        if let Some(Item::Object(t)) = o.item("alpha") {
            if let Some(read) = self.textures.read(t, self.notes)? {
                // A texture says alpha; roughness is its square root.
                let read = self.textures.linear(t, read)?;
                let read = self.textures.mapped(t, read, "root", |x| x.clamp(0.0, 1.0).sqrt())?;
                self.slot(o, TextureSlot::Roughness, read);
            }
            return Ok(());
        }
        let alpha = o.number("alpha", 0.1)?;
        let (u, v) = (o.number("alpha_u", alpha)?, o.number("alpha_v", alpha)?);
        if !(u > 0.0 && v > 0.0 && u <= 1.0 && v <= 1.0) {
            return Err(o.error(format!("`alpha` must lie between 0 and 1, found {u} and {v}")));
        }
        self.m.roughness = (u * v).sqrt().sqrt().clamp(f64::from(SMOOTH_ROUGHNESS), 1.0) as f32;
        let stretch = (1.0 - v / u) / 0.9;
        if !(0.0..=1.0).contains(&stretch) {
            self.notes.push(o.note("`alpha_u` is at least, and at most ten times, `alpha_v` here: it is moved there"));
        }
        self.m.anisotropic = stretch.clamp(0.0, 1.0) as f32;
        Ok(())
    }

    fn conductor(&mut self, o: &Object) -> Result<(), SceneError> {
        (self.m.model, self.m.roughness) = (Model::Conductor, 0.0);
        self.base(o, "specular_reflectance", 1.0)?;
        let material = o.text("material")?;
        let given = (o.color("eta")?, o.color("k")?);
        // The one default that matters: Mitsuba 3 has a perfect mirror where 0.5 had copper.
        let named = material.unwrap_or("none");
        let (eta, k) = match given {
            (None, None) => metals::metal(named).ok_or_else(|| {
                let shown = super::values::shorten(named);
                o.error(format!("the metal `{shown}` is not known (known: {}, none)", metals::metal_names()))
            })?,
            (eta, k) => (eta.unwrap_or(Vec3::ZERO), k.unwrap_or(Vec3::ONE)),
        };
        let outside = match o.item("ext_ior").is_some() {
            true => self.index(o, "ext_ior", 1.0)?,
            false => self.index(o, "ext_eta", 1.0)?,
        } as f32;
        (self.m.eta, self.m.k) = ((eta / outside).max(Vec3::ZERO), (k / outside).max(Vec3::ZERO));
        if self.m.eta.max(self.m.k).max_element() > 100.0 {
            return Err(o.error("`eta` and `k` must be at most 100"));
        }
        Ok(())
    }

    fn index(&self, o: &Object, key: &str, default: f64) -> Result<f64, SceneError> {
        let value = match o.item(key) {
            None => default,
            Some(Item::Data(Data::Text(name))) => metals::dielectric(name)
                .ok_or_else(|| o.error(format!("the medium `{}` is not known", super::values::shorten(name))))?,
            Some(_) => o.number(key, default)?,
        };
        if (MIN_IOR..=100.0).contains(&value) {
            return Ok(value);
        }
        Err(o.error(format!("`{key}` must lie between {MIN_IOR} and 100, found {value}")))
    }

    fn dielectric(&mut self, o: &Object) -> Result<(), SceneError> {
        (self.m.model, self.m.roughness) = (Model::Dielectric, 0.0);
        self.m.opacity = 0.0;
        self.m.ior = (self.index(o, "int_ior", 1.5046)? / self.index(o, "ext_ior", 1.000_277)?) as f32;
        self.m.specular = self.tint(o, "specular_reflectance")?;
        let passes = self.tint(o, "specular_transmittance")?;
        self.m.base_color = passes * passes;
        Ok(())
    }

    fn plastic(&mut self, o: &Object) -> Result<(), SceneError> {
        (self.m.model, self.m.roughness) = (Model::Plastic, 0.0);
        self.m.ior = (self.index(o, "int_ior", 1.49)? / self.index(o, "ext_ior", 1.000_277)?) as f32;
        self.base(o, "diffuse_reflectance", 0.5)?;
        self.m.specular = self.tint(o, "specular_reflectance")?;
        self.m.nonlinear = o.flag("nonlinear", false)?;
        Ok(())
    }

    fn principled(&mut self, o: &Object) -> Result<(), SceneError> {
        self.base(o, "base_color", 0.5)?;
        self.m.metallic = self.part(o, "metallic", 0.0, Some(TextureSlot::Metallic))?;
        self.m.roughness = self.part(o, "roughness", 0.5, Some(TextureSlot::Roughness))?;
        self.m.opacity = 1.0;
        match o.item("spec_trans") {
            Some(Item::Object(t)) => {
                if let Some(read) = self.textures.read(t, self.notes)? {
                    let read = self.textures.linear(t, read)?;
                    let read = self.textures.mapped(t, read, "inverse", |x| 1.0 - x)?;
                    self.slot(o, TextureSlot::Opacity, read);
                }
            }
            _ => self.m.opacity = 1.0 - self.part(o, "spec_trans", 0.0, None)?,
        }
        self.m.anisotropic = self.part(o, "anisotropic", 0.0, None)?;
        self.m.specular_tint = self.part(o, "spec_tint", 0.0, None)?;
        self.m.sheen = self.part(o, "sheen", 0.0, None)?;
        self.m.sheen_tint = self.part(o, "sheen_tint", 0.0, None)?;
        self.m.subsurface = self.part(o, "flatness", 0.0, None)?;
        self.m.clearcoat = self.part(o, "clearcoat", 0.0, None)?;
        self.m.clearcoat_gloss = self.part(o, "clearcoat_gloss", 0.0, None)?;
        if o.item("eta").is_some() {
            self.m.ior = self.index(o, "eta", 1.5)? as f32;
        } else {
            // F0 = 0.08 specular, and its index.
            let root = (0.08 * self.part(o, "specular", 0.5, None)?).sqrt();
            self.m.ior = (1.0 + root) / (1.0 - root);
        }
        o.known(&["diffuse_reflectance_sampling_rate", "main_specular_sampling_rate", "clearcoat_sampling_rate"]);
        Ok(())
    }

    fn part(&mut self, o: &Object, key: &str, default: f64, slot: Option<TextureSlot>) -> Result<f32, SceneError> {
        if let Some(Item::Object(t)) = o.item(key) {
            match (slot, self.textures.read(t, self.notes)?) {
                (Some(slot), Some(read)) => {
                    let read = self.textures.linear(t, read)?;
                    self.slot(o, slot, read);
                }
                _ => self.notes.push(t.note(format!("`{key}` has no texture here: {default} is used"))),
            }
            return Ok(default as f32);
        }
        let value = o.number(key, default)?;
        if !(0.0..=1.0).contains(&value) {
            self.notes.push(o.note(format!("`{key}` is {value}, outside 0 to 1: it is clamped")));
        }
        Ok(value.clamp(0.0, 1.0) as f32)
    }

    /// A constant opacity becomes a mask of one texel, which is as probable to be there as the opacity says.
    fn mask(&mut self, o: &Object) -> Result<(), SceneError> {
        self.m.mask_mode = MaskMode::Blend;
        if let Some(Item::Object(t)) = o.item("opacity") {
            if let Some(read) = self.textures.read(t, self.notes)? {
                let read = self.textures.linear(t, read)?;
                self.slot(o, TextureSlot::Mask, read);
            }
            return Ok(());
        }
        let opacity = o.color("opacity")?.unwrap_or(Vec3::splat(0.5));
        if opacity.max_element() != opacity.min_element() {
            self.notes.push(o.note("an opacity has no colour here: the mean of its channels is used"));
        }
        let grey = (opacity.element_sum() / 3.0).clamp(0.0, 1.0);
        self.m.set_texture(TextureSlot::Mask, Some(Arc::new(TextureDesc::grey(grey))));
        Ok(())
    }
}
