//! Materials of glTF: metallic-roughness with the extensions that the Disney model has a parameter for.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{Affine2, Vec2, Vec3};
use serde_json::Value as Json;

use super::document::Document;
use crate::scene::desc::material::MIN_IOR;
use crate::scene::desc::{MaskMode, MaterialDesc, Texels, TextureDesc, TextureSlot, texture_hash};
use crate::scene::load::Missing;
use crate::scene::load::images::Pictures;
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

/// A material, the set of texture coordinates that it uses, and how they are moved on the mesh.
pub(super) struct Read {
    /// The material.
    pub desc: MaterialDesc,
    /// 0 or 1 of `TEXCOORD_n`.
    pub uv_set: u64,
    /// From the coordinates of the file to those of the picture, both starting at the top left.
    pub uv: Affine2,
}

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
        let mut read = Read { desc: MaterialDesc::new(&name), uv_set: 0, uv: Affine2::IDENTITY };
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
        let alpha = pbr["baseColorFactor"][3].as_f64().unwrap_or(1.0) as f32;
        let mut placed = false;
        let base = self.texture(place, "baseColorTexture", &pbr["baseColorTexture"], read, &mut placed)?;
        match m["alphaMode"].as_str().unwrap_or("OPAQUE") {
            "OPAQUE" => {}
            mode => {
                read.desc.mask_mode = if mode == "BLEND" { MaskMode::Blend } else { MaskMode::Threshold };
                read.desc.mask_threshold = m["alphaCutoff"].as_f64().unwrap_or(0.5).clamp(0.0, 1.0) as f32;
                let mask = match &base {
                    Some(image) => self.channel(place, image, 3, alpha)?,
                    None => constant(alpha),
                };
                read.desc.set_texture(TextureSlot::Mask, Some(mask));
            }
        }
        if let Some(image) = base {
            read.desc.set_texture(TextureSlot::BaseColor, Some(image));
        }
        let rough =
            self.texture(place, "metallicRoughnessTexture", &pbr["metallicRoughnessTexture"], read, &mut placed)?;
        if let Some(image) = rough {
            let (roughness, metallic) = (read.desc.roughness, read.desc.metallic);
            read.desc.set_texture(TextureSlot::Roughness, Some(self.channel(place, &image, 1, roughness)?));
            read.desc.set_texture(TextureSlot::Metallic, Some(self.channel(place, &image, 2, metallic)?));
        }
        let normal = self.texture(place, "normalTexture", &m["normalTexture"], read, &mut placed)?;
        if let Some(image) = normal {
            let scale = m["normalTexture"]["scale"].as_f64().unwrap_or(1.0);
            if scale < 0.0 {
                self.note(place, "a negative scale of a normal map is not possible: it is switched off");
            }
            read.desc.normal_strength = scale.clamp(0.0, 100.0) as f32;
            read.desc.set_texture(TextureSlot::Normal, Some(image));
        }
        if let Some(image) = self.texture(place, "emissiveTexture", &m["emissiveTexture"], read, &mut placed)? {
            read.desc.set_texture(TextureSlot::Emission, Some(image));
        }
        let passes = &m["extensions"]["KHR_materials_transmission"]["transmissionTexture"];
        if let Some(image) = self.texture(place, "transmissionTexture", passes, read, &mut placed)? {
            // What passes is what is not opaque.
            let through = 1.0 - read.desc.opacity;
            let opaque = self.mapped(place, &image, &format!("1 - r * {through}"), |[r, ..]| 1.0 - r * through)?;
            read.desc.set_texture(TextureSlot::Opacity, Some(opaque));
        }
        Ok(())
    }

    /// The image of a texture, whose coordinates the first one of a material decides.
    fn texture(
        &mut self,
        place: &str,
        key: &str,
        said: &Json,
        read: &mut Read,
        placed: &mut bool,
    ) -> Result<Option<Arc<TextureDesc>>, SceneError> {
        if !said.is_object() {
            return Ok(None);
        }
        let place = format!("{place}.{key}");
        let transform = &said["extensions"]["KHR_texture_transform"];
        let set = transform["texCoord"].as_u64().or(said["texCoord"].as_u64()).unwrap_or(0);
        let pair = |v: &Json, default: f32| {
            let at = |i: usize| v[i].as_f64().map_or(default, |x| x as f32);
            Vec2::new(at(0), at(1))
        };
        let angle = transform["rotation"].as_f64().unwrap_or(0.0) as f32;
        let uv = Affine2::from_scale_angle_translation(
            pair(&transform["scale"], 1.0),
            -angle,
            pair(&transform["offset"], 0.0),
        );
        // Its rotation comes after the scale.
        let uv = if angle == 0.0 {
            uv
        } else {
            Affine2::from_translation(uv.translation)
                * Affine2::from_angle(-angle)
                * Affine2::from_scale(pair(&transform["scale"], 1.0))
        };
        if !uv.is_finite() {
            return Err(self.document.error(&place, "its transform must be finite"));
        }
        if !*placed {
            (read.uv_set, read.uv, *placed) = (set, uv, true);
        } else if read.uv_set != set || read.uv != uv {
            self.note(&place, "all textures of a material have the coordinates of its first one");
        }
        let (i, texture) = self.document.named(&place, "textures", &said["index"])?;
        let texture = texture.clone();
        let sampler = self.document.json["samplers"][texture["sampler"].as_u64().unwrap_or(u64::MAX) as usize].clone();
        let repeats = |key: &str| sampler[key].as_u64().is_none_or(|mode| mode == 10497);
        if !(repeats("wrapS") && repeats("wrapT")) || sampler["magFilter"].as_u64() == Some(9728) {
            self.note(&format!("textures[{i}]"), "textures are bilinear and repeat, whatever their sampler says");
        }
        self.image(&format!("textures[{i}]"), &texture["source"])
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
        let document = self.document;
        let decoded = match image["uri"].as_str().filter(|uri| !uri.starts_with("data:")) {
            Some(uri) => self.pictures.load(&document.beside(uri), self.notes),
            None => {
                let bytes = match document.uri(&place, image) {
                    Ok(Some(bytes)) => Ok(bytes),
                    Ok(None) => document.view(&place, &image["bufferView"]).map(|(bytes, _)| bytes.to_vec()),
                    Err(e) => Err(e),
                };
                bytes.and_then(|bytes| self.pictures.part(&document.path, bytes, document.size(), self.notes))
            }
        };
        let image = match decoded.map_err(|e| document.error(&place, e.to_string())) {
            Ok(image) => Some(image),
            Err(e) if self.missing == Missing::Noted => {
                self.note(&place, format!("{e}: left out"));
                None
            }
            Err(e) => return Err(e),
        };
        self.images.insert(i, image.clone());
        Ok(image)
    }
}

fn color(v: &Json, default: Vec3) -> Vec3 {
    let at = |i: usize| v[i].as_f64().map_or(default[i], |x| x as f32);
    Vec3::new(at(0), at(1), at(2))
}

/// A picture of one grey texel.
fn constant(value: f32) -> Arc<TextureDesc> {
    let texels = Texels::RgbaF32(vec![[value, value, value, 1.0]]);
    let content_hash = texture_hash(1, 1, &texels);
    Arc::new(TextureDesc { file: Default::default(), width: 1, height: 1, texels, content_hash })
}
