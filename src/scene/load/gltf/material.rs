//! Materials of glTF: metallic-roughness with the extensions that the Disney model has a parameter for.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{Affine2, Vec2, Vec3};
use serde_json::Value as Json;

use super::document::Document;
use crate::scene::desc::material::MIN_IOR;
use crate::scene::desc::{Lookup, MaskMode, MaterialDesc, TextureDesc, TextureSlot, Wrap};
use crate::scene::load::images::Pictures;
use crate::scene::load::{Missing, missing_texture};
use crate::scene::{Note, SceneError};

/// Extensions that are read, in part or wholly.
const READ: &[&str] = &[
    "KHR_materials_emissive_strength",
    "KHR_materials_transmission",
    "KHR_materials_ior",
    "KHR_materials_clearcoat",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_anisotropy",
];

/// A material, and what it wants of the texture coordinates of meshes.
pub(super) struct Read {
    /// The material.
    pub desc: MaterialDesc,
    /// Them.
    pub wanted: Coordinates,
}

/// Which sets of texture coordinates a mesh takes from the file. The normal map decides about the first one, since
/// tangents follow it, or else the first texture.
#[derive(Clone, Copy, Default)]
pub(super) struct Coordinates {
    /// The number of `TEXCOORD_n` that is the first set.
    pub first: u64,
    /// From the first set in the file to that of the mesh, both starting at the top left.
    pub map: Affine2,
    /// The number of the set that is the second one.
    pub second: Option<u64>,
}

/// Where a texture lies: its set of coordinates, and from those to places in the picture, both starting at the top left.
#[derive(Clone, Copy, PartialEq)]
struct Place {
    set: u64,
    map: Affine2,
}

/// A picture, and what is beyond its edges.
type Wrapped = (Arc<TextureDesc>, [Wrap; 2]);

/// Reads materials and the images that they name, each once.
pub(super) struct Materials<'a> {
    document: &'a Document,
    missing: Missing,
    images: BTreeMap<usize, Option<Arc<TextureDesc>>>,
    pictures: Pictures,
    notes: &'a mut Vec<Note>,
}

impl<'a> Materials<'a> {
    /// None read yet.
    pub fn new(document: &'a Document, missing: Missing, notes: &'a mut Vec<Note>) -> Materials<'a> {
        Materials { document, missing, images: BTreeMap::new(), pictures: Pictures::default(), notes }
    }

    /// The material of an index, under a name that is its own.
    pub fn read(&mut self, i: usize, name: String) -> Result<Read, SceneError> {
        let m = self.document.at("materials", i).clone();
        let place = format!("materials[{i}]");
        let mut read = Read { desc: MaterialDesc::new(&name), wanted: Coordinates::default() };
        let d = &mut read.desc;
        let pbr = &m["pbrMetallicRoughness"];
        let part = |v: &Json, default: f64| v.as_f64().unwrap_or(default).clamp(0.0, 1.0) as f32;
        let factor = color(&pbr["baseColorFactor"], Vec3::ONE);
        d.base_color = factor.clamp(Vec3::ZERO, Vec3::ONE);
        d.metallic = part(&pbr["metallicFactor"], 1.0);
        d.roughness = part(&pbr["roughnessFactor"], 1.0);
        let extension = |name: &str| m["extensions"][name].clone();
        let strength = extension("KHR_materials_emissive_strength")["emissiveStrength"].as_f64().unwrap_or(1.0);
        d.emission = (color(&m["emissiveFactor"], Vec3::ZERO) * strength as f32).clamp(Vec3::ZERO, Vec3::splat(1e9));
        d.opacity = 1.0 - part(&extension("KHR_materials_transmission")["transmissionFactor"], 0.0);
        d.ior = extension("KHR_materials_ior")["ior"].as_f64().unwrap_or(1.5).clamp(MIN_IOR, 100.0) as f32;
        let specular = extension("KHR_materials_specular");
        if specular.is_object() {
            self.specular(&place, &specular, &mut read.desc);
        }
        let d = &mut read.desc;
        let coat = extension("KHR_materials_clearcoat");
        if coat.is_object() {
            d.clearcoat = part(&coat["clearcoatFactor"], 0.0);
            d.clearcoat_gloss = 1.0 - part(&coat["clearcoatRoughnessFactor"], 0.0);
            self.note(&place, "a full clear coat is a quarter as strong as in glTF, and its textures are not read");
        }
        let sheen = extension("KHR_materials_sheen");
        if sheen.is_object() {
            let tint = color(&sheen["sheenColorFactor"], Vec3::ZERO);
            let d = &mut read.desc;
            (d.sheen, d.sheen_tint) = (tint.max_element().clamp(0.0, 1.0), 0.0);
            self.note(&place, "sheen has Burley's form, white, without textures or a roughness of its own");
        }
        let stretched = extension("KHR_materials_anisotropy");
        if stretched.is_object() {
            read.desc.anisotropic = part(&stretched["anisotropyStrength"], 0.0);
            self.note(&place, "anisotropy has Burley's form, along growing u, without its texture");
        }
        for name in
            m["extensions"].as_object().into_iter().flat_map(|o| o.keys()).filter(|k| !READ.contains(&k.as_str()))
        {
            let shown: String = name.chars().take(48).collect();
            self.note(&place, format!("the extension `{shown}` is not read"));
        }
        self.textures(&place, &m, &mut read)?;
        Ok(read)
    }

    fn note(&mut self, place: &str, message: impl Into<String>) {
        let (file, place, message) = (self.document.path.clone(), place.to_owned(), message.into());
        self.notes.push(Note { file, place, message });
    }

    /// The factor on reflectance at normal incidence as an index.
    fn specular(&mut self, place: &str, said: &Json, d: &mut MaterialDesc) {
        let factor = said["specularFactor"].as_f64().unwrap_or(1.0).clamp(0.0, 1.0) as f32;
        let f0 = ((d.ior - 1.0) / (d.ior + 1.0)).powi(2) * factor;
        if d.opacity == 1.0 {
            d.ior = (1.0 + f0.sqrt()) / (1.0 - f0.sqrt());
        }
        if factor != 1.0 || said["specularColorFactor"].is_array() || said["specularTexture"].is_object() {
            self.note(place, "`specular` sets the index of opaque materials; its colour and textures are not read");
        }
    }

    fn textures(&mut self, place: &str, m: &Json, read: &mut Read) -> Result<(), SceneError> {
        let pbr = &m["pbrMetallicRoughness"];
        let passes = &m["extensions"]["KHR_materials_transmission"]["transmissionTexture"];
        let said = [
            ("baseColorTexture", &pbr["baseColorTexture"]),
            ("metallicRoughnessTexture", &pbr["metallicRoughnessTexture"]),
            ("normalTexture", &m["normalTexture"]),
            ("emissiveTexture", &m["emissiveTexture"]),
            ("transmissionTexture", passes),
        ];
        let mut found = [const { None }; 5];
        for ((key, said), found) in said.iter().zip(&mut found) {
            if said.is_object() {
                let place = format!("{place}.{key}");
                let lies = self.lies(&place, said)?;
                *found = self.texture(&place, said)?.map(|(image, wrap)| (image, wrap, lies, place));
            }
        }
        if let Some((_, _, lies, _)) = found[2].as_ref().or(found.iter().flatten().next()) {
            read.wanted = Coordinates { first: lies.set, map: lies.map, second: None };
        }
        let mut laid = [const { None }; 5];
        for (found, laid) in found.into_iter().zip(&mut laid) {
            if let Some((image, wrap, lies, place)) = found {
                *laid = Some((image, Lookup { wrap, ..self.lookup(&place, lies, &mut read.wanted) }));
            }
        }
        let [base, rough, normal, emissive, transmission] = laid;
        let d = &mut read.desc;
        let alpha = pbr["baseColorFactor"][3].as_f64().unwrap_or(1.0) as f32;
        match m["alphaMode"].as_str().unwrap_or("OPAQUE") {
            "OPAQUE" => {}
            mode => {
                d.mask_mode = if mode == "BLEND" { MaskMode::Blend } else { MaskMode::Threshold };
                d.mask_threshold = m["alphaCutoff"].as_f64().unwrap_or(0.5).clamp(0.0, 1.0) as f32;
                let (mask, lookup) = match &base {
                    Some((image, lookup)) => (self.channel(place, image, 3, alpha)?, *lookup),
                    None => (Arc::new(TextureDesc::grey(alpha)), Lookup::default()),
                };
                d.lay_texture(TextureSlot::Mask, mask, lookup);
            }
        }
        if let Some((image, lookup)) = base {
            d.lay_texture(TextureSlot::BaseColor, image, lookup);
        }
        if let Some((image, lookup)) = rough {
            let (roughness, metallic) = (d.roughness, d.metallic);
            d.lay_texture(TextureSlot::Roughness, self.channel(place, &image, 1, roughness)?, lookup);
            d.lay_texture(TextureSlot::Metallic, self.channel(place, &image, 2, metallic)?, lookup);
        }
        if let Some((image, lookup)) = normal {
            let scale = m["normalTexture"]["scale"].as_f64().unwrap_or(1.0);
            if scale < 0.0 {
                self.note(place, "a negative scale of a normal map is not possible: it is switched off");
            }
            d.normal_strength = scale.clamp(0.0, 100.0) as f32;
            d.lay_texture(TextureSlot::Normal, image, lookup);
        }
        if let Some((image, lookup)) = emissive {
            d.lay_texture(TextureSlot::Emission, image, lookup);
        }
        if let Some((image, lookup)) = transmission {
            // What passes is what is not opaque.
            let through = 1.0 - d.opacity;
            let opaque = self.mapped(place, &image, &format!("1 - r * {through}"), |[r, ..]| 1.0 - r * through)?;
            d.lay_texture(TextureSlot::Opacity, opaque, lookup);
        }
        Ok(())
    }

    /// Where a texture lies.
    fn lies(&mut self, place: &str, said: &Json) -> Result<Place, SceneError> {
        let transform = &said["extensions"]["KHR_texture_transform"];
        let set = transform["texCoord"].as_u64().or(said["texCoord"].as_u64()).unwrap_or(0);
        let pair = |v: &Json, default: f32| {
            let at = |i: usize| v[i].as_f64().map_or(default, |x| x as f32);
            Vec2::new(at(0), at(1))
        };
        let angle = transform["rotation"].as_f64().unwrap_or(0.0) as f32;
        // Its rotation comes after the scale.
        let map = Affine2::from_translation(pair(&transform["offset"], 0.0))
            * Affine2::from_angle(-angle)
            * Affine2::from_scale(pair(&transform["scale"], 1.0));
        if !map.is_finite() {
            return Err(self.document.error(place, "its transform must be finite"));
        }
        Ok(Place { set, map })
    }

    /// How a texture is laid on a mesh that has these coordinates; the second set is that of the first texture which
    /// wants another one than the first set.
    fn lookup(&mut self, place: &str, lies: Place, wanted: &mut Coordinates) -> Lookup {
        let second = lies.set != wanted.first;
        if second && *wanted.second.get_or_insert(lies.set) != lies.set {
            self.note(place, "a material has textures on two sets of coordinates at most: this one lies as the first");
            return Lookup::default();
        }
        let around = if second { Affine2::IDENTITY } else { wanted.map };
        match Lookup::beside(around, lies.map) {
            Ok(map) => Lookup { second, map: map.map(turned_over), ..Lookup::default() },
            Err(e) => {
                self.note(place, e.to_string());
                Lookup::default()
            }
        }
    }

    /// The image of a texture, and how it goes on beyond its edges.
    fn texture(&mut self, place: &str, said: &Json) -> Result<Option<Wrapped>, SceneError> {
        let (i, texture) = self.document.named(place, "textures", &said["index"])?;
        let place = format!("textures[{i}]");
        let texture = texture.clone();
        let sampler = match &texture["sampler"] {
            Json::Null => Json::Null,
            index => self.document.named(&place, "samplers", index)?.1.clone(),
        };
        let wrap = |key: &str| match sampler[key].as_u64() {
            Some(33071) => Wrap::Clamp,
            Some(33648) => Wrap::Mirror,
            _ => Wrap::Repeat,
        };
        if sampler["magFilter"].as_u64() == Some(9728) {
            self.note(&place, "textures are bilinear, whatever their sampler says");
        }
        // Turning v over changes none of the three.
        let wraps = [wrap("wrapS"), wrap("wrapT")];
        Ok(self.image(&place, &texture["source"])?.map(|image| (image, wraps)))
    }

    /// A grey picture by a function of every texel, whose channels are as stored from 0 to 1.
    fn mapped(
        &mut self,
        place: &str,
        image: &TextureDesc,
        how: &str,
        f: impl Fn([f32; 4]) -> f32,
    ) -> Result<Arc<TextureDesc>, SceneError> {
        let grey = |texel| {
            let x = f(texel);
            [x, x, x, 1.0]
        };
        self.pictures.made(image, how, grey).map_err(|problem| self.document.error(place, problem))
    }

    /// One channel times a factor.
    fn channel(
        &mut self,
        place: &str,
        image: &TextureDesc,
        which: usize,
        factor: f32,
    ) -> Result<Arc<TextureDesc>, SceneError> {
        self.mapped(place, image, &format!("{which} * {factor}"), |texel| texel[which] * factor)
    }

    fn image(&mut self, place: &str, source: &Json) -> Result<Option<Arc<TextureDesc>>, SceneError> {
        let (i, image) = self.document.named(place, "images", source)?;
        if let Some(known) = self.images.get(&i) {
            return Ok(known.clone());
        }
        let place = format!("images[{i}]");
        let image = match self.picture(&place, image) {
            Ok(image) => Some(image),
            Err(e) if self.missing == Missing::Noted => {
                self.note(&place, format!("{e}: left out"));
                None
            }
            Err(e) => return Err(missing_texture(e)),
        };
        self.images.insert(i, image.clone());
        Ok(image)
    }

    /// Reads an image of the document, which errors name.
    fn picture(&mut self, place: &str, image: &Json) -> Result<Arc<TextureDesc>, SceneError> {
        let document = self.document;
        if let Some(uri) = image["uri"].as_str().filter(|uri| !uri.starts_with("data:")) {
            let read = self.pictures.load(&document.beside(uri), self.notes);
            return read.map_err(|e| document.error(place, e.to_string()));
        }
        let bytes = match document.uri(place, image)? {
            Some(bytes) => bytes,
            None => document.view(place, &image["bufferView"])?.0.to_vec(),
        };
        self.pictures.part(&document.path, bytes, document.size(), self.notes).map_err(|e| match e {
            SceneError::Malformed { problem, .. } => document.error(place, problem),
            other => other,
        })
    }
}

/// A map of texture coordinates that start at the top left as one of those that start at the bottom left, and the other
/// way round.
fn turned_over(map: Affine2) -> Affine2 {
    let turn = Affine2 { matrix2: glam::Mat2::from_diagonal(Vec2::new(1.0, -1.0)), translation: Vec2::Y };
    turn * map * turn
}

fn color(v: &Json, default: Vec3) -> Vec3 {
    let at = |i: usize| v[i].as_f64().map_or(default[i], |x| x as f32);
    Vec3::new(at(0), at(1), at(2))
}
