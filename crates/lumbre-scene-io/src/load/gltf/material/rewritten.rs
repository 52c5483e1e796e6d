//! Materials of other models, rewritten as materials of metallic and roughness before they are read.

use std::sync::Arc;

use glam::Vec3;
use serde_json::{Value as Json, json};

use super::{MaterialReader, color, unit_number};
use crate::load::images::mean_texel;
use lumbre_light::scene::SceneError;
use lumbre_light::scene::desc::{Lookup, Texels, TextureDesc};

/// Key of an unlit material among the extensions.
pub(in crate::load::gltf) const UNLIT: &str = "KHR_materials_unlit";
/// Key of a material of diffuse and specular colours among the extensions.
pub(super) const SPECULAR_GLOSSINESS: &str = "KHR_materials_pbrSpecularGlossiness";

/// Reflectance of dielectrics at normal incidence.
const DIELECTRIC: f32 = 0.04;
/// Least number that is divided by.
const LEAST: f32 = 1e-6;

/// A texture with its mapping, or none.
pub(super) type Mapped = Option<(Arc<TextureDesc>, Lookup)>;

/// Returns a material in the model of metallic and roughness. Textures of a material of diffuse and
/// specular colours take the places of those of base colour and roughness:
/// [`MaterialReader::converted`] converts them.
pub(super) fn rewritten(m: &Json) -> Json {
    let mut m = m.clone();
    if m["extensions"][UNLIT].is_object() {
        // The base colour is what is seen. All else is for viewers without the extension.
        let pbr = &m["pbrMetallicRoughness"];
        let [alpha, texture] = [&pbr["baseColorFactor"][3], &pbr["baseColorTexture"]];
        let mut seen = color(&pbr["baseColorFactor"], Vec3::ONE);
        if seen == Vec3::ZERO {
            // A black surface would reflect: only what emits may not reflect.
            seen = Vec3::splat(LEAST);
        }
        return json!({
            "alphaMode": m["alphaMode"],
            "alphaCutoff": m["alphaCutoff"],
            "pbrMetallicRoughness": { "baseColorFactor": [0, 0, 0, alpha], "baseColorTexture": texture },
            "emissiveFactor": seen.to_array(),
            "emissiveTexture": texture,
            "extensions": { UNLIT: {} },
        });
    }
    let other = m["extensions"][SPECULAR_GLOSSINESS].clone();
    if other.is_object() {
        let factors = Factors::read(&other);
        let [diffuse, gloss] =
            ["diffuseTexture", "specularGlossinessTexture"].map(|key| &other[key]);
        let textured = diffuse.is_object() || gloss.is_object();
        let ([r, g, b, _], [_, roughness, metallic, _]) = match textured {
            true => ([1.0; 4], [1.0; 4]),
            false => factors.converted([1.0; 4], [1.0; 4]),
        };
        m["pbrMetallicRoughness"] = json!({
            "baseColorFactor": [r, g, b, other["diffuseFactor"][3]],
            "roughnessFactor": roughness,
            "metallicFactor": metallic,
            "baseColorTexture": diffuse,
            "metallicRoughnessTexture": gloss,
        });
    }
    m
}

impl MaterialReader<'_> {
    /// Converts textures of diffuse and of specular colours and glossiness, texel by texel, to those of
    /// base colour and of roughness and metallic.
    pub(super) fn converted(
        &mut self,
        place: &str,
        m: &Json,
        [diffuse, gloss]: [Mapped; 2],
    ) -> Result<[Mapped; 2], SceneError> {
        let extension = &m["extensions"][SPECULAR_GLOSSINESS];
        if !extension.is_object() || diffuse.is_none() && gloss.is_none() {
            return Ok([diffuse, gloss]);
        }
        let factors = Factors::read(extension);
        let mut out = [const { None }; 2];
        for (which, out) in out.iter_mut().enumerate() {
            let pair = [&diffuse, &gloss];
            // Without a texture of its own it is mapped like the other.
            let Some((own, lookup)) = pair[which].as_ref().or(pair[1 - which].as_ref()) else {
                continue;
            };
            let mut images = pair.map(|texture| match texture {
                None => Arc::new(TextureDesc::grey(1.0)),
                Some((image, at)) if at == lookup => Arc::clone(image),
                Some((image, _)) => {
                    let [r, g, b] = mean_texel(image, true).to_array();
                    Arc::new(TextureDesc::new(
                        "",
                        1,
                        1,
                        Texels::RgbaF32(vec![[r, g, b, 1.0]]),
                    ))
                }
            });
            if which == 0 && diffuse.iter().zip(&gloss).any(|(d, g)| d.1 != g.1) {
                self.note(
                    place,
                    "the textures of diffuse and specular colours are mapped differently; each is \
                     converted with the mean of the other",
                );
            }
            images.rotate_left(which);
            let how = format!("{which} {factors:?}");
            let image = self.cache.combined(
                [&images[0], &images[1]],
                [own.width, own.height],
                &how,
                |a, b| match which {
                    0 => factors.converted(a, b).0,
                    _ => factors.converted(b, a).1,
                },
            );
            let image = image.map_err(|problem| self.document.error(place, problem))?;
            *out = Some((image, *lookup));
        }
        Ok(out)
    }
}

/// Factors of a material of diffuse and specular colours.
#[derive(Clone, Copy, Debug)]
struct Factors {
    diffuse: Vec3,
    specular: Vec3,
    glossiness: f32,
}

impl Factors {
    fn read(extension: &Json) -> Factors {
        let factor = |key: &str| color(&extension[key], Vec3::ONE).clamp(Vec3::ZERO, Vec3::ONE);
        Factors {
            diffuse: factor("diffuseFactor"),
            specular: factor("specularFactor"),
            glossiness: unit_number(&extension["glossinessFactor"], 1.0),
        }
    }

    /// Returns the base colour with alpha, and a texel of roughness (green) and metallic (blue), of
    /// linear texels of both textures. The formulas are those of Khronos' examples of the extension,
    /// `convert-between-workflows`.
    fn converted(&self, diffuse: [f32; 4], gloss: [f32; 4]) -> ([f32; 4], [f32; 4]) {
        let [d, s] = [diffuse, gloss].map(|[r, g, b, _]| Vec3::new(r, g, b));
        let [d, s] = [d * self.diffuse, s * self.specular];
        let kept = 1.0 - s.max_element();
        let metallic = metallic(brightness(d), brightness(s), kept);
        let of_diffuse = d * (kept / (1.0 - DIELECTRIC) / (1.0 - metallic).max(LEAST));
        let of_specular = (s - DIELECTRIC * (1.0 - metallic)) / metallic.max(LEAST);
        let base = of_diffuse.lerp(of_specular, metallic * metallic);
        let [r, g, b] = base.clamp(Vec3::ZERO, Vec3::ONE).to_array();
        let roughness = 1.0 - gloss[3] * self.glossiness;
        ([r, g, b, diffuse[3]], [0.0, roughness, metallic, 1.0])
    }
}

/// Returns the perceived brightness of a colour.
fn brightness(c: Vec3) -> f32 {
    (c * c).dot(Vec3::new(0.299, 0.587, 0.114)).sqrt()
}

/// Returns the metallic for which a diffuse and a specular brightness result; `kept` is what the
/// specular reflection leaves.
fn metallic(diffuse: f32, specular: f32, kept: f32) -> f32 {
    if specular < DIELECTRIC {
        return 0.0;
    }
    let b = diffuse * kept / (1.0 - DIELECTRIC) + specular - 2.0 * DIELECTRIC;
    let c = DIELECTRIC - specular;
    let root = (b * b - 4.0 * DIELECTRIC * c).max(0.0).sqrt();
    ((root - b) / (2.0 * DIELECTRIC)).clamp(0.0, 1.0)
}
