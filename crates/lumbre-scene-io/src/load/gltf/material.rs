//! glTF materials: metallic-roughness, with the extensions that have a parameter in the Disney
//! model.

mod rewritten;
mod thin;

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{Affine2, Vec2, Vec3};
use serde_json::Value as Json;

use self::rewritten::SPECULAR_GLOSSINESS;
pub(super) use self::rewritten::UNLIT;
use super::document::Document;
use super::shown;
use crate::load::images::ImageCache;
use crate::load::{MissingTextures, with_lenient_hint};
use crate::names::UniqueNames;
use lumbre_light::scene::desc::material_params::MIN_IOR;
use lumbre_light::scene::desc::{
    Lookup, MaskMode, MaterialDesc, Model, TextureDesc, TextureFilter, TextureSlot, Wrap,
};
use lumbre_light::scene::{Note, SceneError};

/// Material extensions that are supported, entirely or in part.
pub(super) const SUPPORTED_EXTENSIONS: &[&str] = &[
    "KHR_materials_emissive_strength",
    "KHR_materials_transmission",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_ior",
    "KHR_materials_clearcoat",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_anisotropy",
    UNLIT,
    SPECULAR_GLOSSINESS,
];

/// Further extensions of materials, which are noted with the materials that have them.
pub(super) const OTHER_EXTENSIONS: [&str; 3] = [
    "KHR_materials_dispersion",
    "KHR_materials_iridescence",
    "KHR_materials_volume",
];

/// A material, and the texture coordinate sets that it needs.
pub(super) struct LoadedMaterial {
    /// The material without a mesh.
    pub desc: MaterialDesc,
    /// Materials of which it is composed.
    pub parts: Vec<MaterialDesc>,
    /// Texture coordinate sets that meshes with this material must provide.
    pub uv_sets: UvSets,
}

/// Selection of texture coordinate sets from the file. The first set is that of the normal map,
/// since tangents follow it, or else that of the first texture.
#[derive(Clone, Copy, Default)]
pub(super) struct UvSets {
    /// Number `n` of the `TEXCOORD_n` that becomes the mesh's first set.
    pub first: u64,
    /// Map from that set to the mesh's first set; both start at the top left.
    pub map: Affine2,
    /// Number of the set that becomes the mesh's second set.
    pub second: Option<u64>,
    /// Whether shading needs tangents, which meshes may provide.
    pub tangents: bool,
}

/// Coordinate set of a texture, and the map from it to image coordinates; both start at the top
/// left.
#[derive(Clone, Copy, PartialEq)]
struct TexturePlacement {
    set: u64,
    map: Affine2,
}

/// An image with the wrap modes and the filter of its sampler.
type SampledImage = (Arc<TextureDesc>, [Wrap; 2], TextureFilter);

/// Reader of materials and of the images that they refer to, each read once.
pub(super) struct MaterialReader<'a> {
    document: &'a Document,
    missing: MissingTextures,
    images: BTreeMap<usize, Option<Arc<TextureDesc>>>,
    cache: ImageCache,
    notes: &'a mut Vec<Note>,
}

impl<'a> MaterialReader<'a> {
    /// Creates a reader that has read nothing yet.
    pub fn new(
        document: &'a Document,
        missing: MissingTextures,
        notes: &'a mut Vec<Note>,
    ) -> MaterialReader<'a> {
        MaterialReader {
            document,
            missing,
            images: BTreeMap::new(),
            cache: ImageCache::default(),
            notes,
        }
    }

    /// Reads the material of an index. `name` is its unique name.
    pub fn read(
        &mut self,
        i: usize,
        name: String,
        names: &mut UniqueNames,
    ) -> Result<LoadedMaterial, SceneError> {
        let m = rewritten::rewritten(self.document.at("materials", i));
        let place = format!("materials[{i}]");
        let mut loaded = LoadedMaterial {
            desc: MaterialDesc::new(&name),
            parts: Vec::new(),
            uv_sets: UvSets::default(),
        };
        let d = &mut loaded.desc;
        let pbr = &m["pbrMetallicRoughness"];
        let factor = color(&pbr["baseColorFactor"], Vec3::ONE);
        d.base_color = factor.clamp(Vec3::ZERO, Vec3::ONE);
        d.metallic = unit_number(&pbr["metallicFactor"], 1.0);
        d.roughness = unit_number(&pbr["roughnessFactor"], 1.0);
        let extension = |name: &str| &m["extensions"][name];
        let strength = extension("KHR_materials_emissive_strength")["emissiveStrength"]
            .as_f64()
            .unwrap_or(1.0);
        d.emission = (color(&m["emissiveFactor"], Vec3::ZERO) * strength as f32)
            .clamp(Vec3::ZERO, Vec3::splat(1e9));
        d.opacity = 1.0
            - unit_number(
                &extension("KHR_materials_transmission")["transmissionFactor"],
                0.0,
            );
        d.ior = extension("KHR_materials_ior")["ior"]
            .as_f64()
            .unwrap_or(1.5)
            .clamp(MIN_IOR, 100.0) as f32;
        self.lobes(&place, &m, d);
        self.diffuse_transmission(&place, &m, d);
        for name in m["extensions"]
            .as_object()
            .into_iter()
            .flat_map(|o| o.keys())
            .filter(|k| !SUPPORTED_EXTENSIONS.contains(&k.as_str()))
        {
            let name = shown(name);
            self.note(&place, format!("the extension `{name}` is not supported"));
        }
        self.textures(&place, &m, &mut loaded)?;
        let d = &mut loaded.desc;
        if m["extensions"][UNLIT].is_object() {
            // Like an emissive texture it does not count as a light, and a studio is added.
            d.emitter_reflects = false;
            if d.texture(TextureSlot::Emission).is_none() {
                d.set_texture(TextureSlot::Emission, Some(TextureDesc::grey(1.0).into()));
            }
            self.note(
                &place,
                "an unlit surface emits its base colour, so it lights other surfaces, too",
            );
        }
        let d = &loaded.desc;
        loaded.uv_sets.tangents = d.texture(TextureSlot::Normal).is_some() || d.anisotropic > 0.0;
        self.thin_walls(&place, &m, &mut loaded, names)?;
        Ok(loaded)
    }

    /// Reads the extensions that add or modify lobes of the Disney model.
    fn lobes(&mut self, place: &str, m: &Json, d: &mut MaterialDesc) {
        let extension = |name: &str| Some(&m["extensions"][name]).filter(|e| e.is_object());
        if let Some(specular) = extension("KHR_materials_specular") {
            self.specular(place, specular, d);
        }
        if let Some(coat) = extension("KHR_materials_clearcoat") {
            d.clearcoat = unit_number(&coat["clearcoatFactor"], 0.0);
            d.clearcoat_gloss = 1.0 - unit_number(&coat["clearcoatRoughnessFactor"], 0.0);
            self.note(
                place,
                "a full clear coat is a quarter as strong as in glTF, and clear coat textures are \
                 not supported",
            );
        }
        if let Some(sheen) = extension("KHR_materials_sheen") {
            let tint = color(&sheen["sheenColorFactor"], Vec3::ZERO);
            (d.sheen, d.sheen_tint) = (tint.max_element().clamp(0.0, 1.0), 0.0);
            self.note(
                place,
                "sheen uses Burley's model, white; its textures and roughness are not supported",
            );
        }
        if let Some(anisotropy) = extension("KHR_materials_anisotropy") {
            d.anisotropic = unit_number(&anisotropy["anisotropyStrength"], 0.0);
            self.note(
                place,
                "anisotropy uses Burley's model, along increasing u; its texture and rotation are \
                 not supported",
            );
        }
    }

    /// Makes a material translucent that transmits diffusely; the lobes over its diffuse one are left
    /// out.
    fn diffuse_transmission(&mut self, place: &str, m: &Json, d: &mut MaterialDesc) {
        let extension = &m["extensions"]["KHR_materials_diffuse_transmission"];
        let share = unit_number(&extension["diffuseTransmissionFactor"], 0.0);
        if share == 0.0 {
            return;
        }
        let tint = color(&extension["diffuseTransmissionColorFactor"], Vec3::ONE);
        d.model = Model::Translucent;
        d.base_color *= 1.0 - share;
        d.transmittance = tint.clamp(Vec3::ZERO, Vec3::ONE) * share;
        let reflected = 100.0 * ((d.ior - 1.0) / (d.ior + 1.0)).powi(2);
        self.note(
            place,
            format!(
                "a surface that transmits diffusely has no other lobes here: without the reflection of \
                 its interface, {reflected:.0} % of the light at normal incidence"
            ),
        );
        if extension["diffuseTransmissionTexture"].is_object() {
            self.note(
                place,
                "a texture of `diffuseTransmissionFactor` is not supported; the factor is used",
            );
        }
    }

    fn note(&mut self, place: &str, message: impl Into<String>) {
        let (file, place, message) = (self.document.path.clone(), place.to_owned(), message.into());
        self.notes.push(Note::new(file, place, message));
    }

    /// Reads the factor on the reflectance at normal incidence, expressed as an index of
    /// refraction.
    fn specular(&mut self, place: &str, extension: &Json, d: &mut MaterialDesc) {
        let factor = extension["specularFactor"]
            .as_f64()
            .unwrap_or(1.0)
            .clamp(0.0, 1.0) as f32;
        let f0 = ((d.ior - 1.0) / (d.ior + 1.0)).powi(2) * factor;
        if d.opacity == 1.0 {
            d.ior = (1.0 + f0.sqrt()) / (1.0 - f0.sqrt());
        }
        if factor != 1.0
            || extension["specularColorFactor"].is_array()
            || extension["specularTexture"].is_object()
            || extension["specularColorTexture"].is_object()
        {
            self.note(
                place,
                "`KHR_materials_specular` sets the index of opaque materials; its colour and \
                 textures are not supported",
            );
        }
    }

    /// Reads the textures of a material and selects the texture coordinate sets.
    fn textures(
        &mut self,
        place: &str,
        m: &Json,
        loaded: &mut LoadedMaterial,
    ) -> Result<(), SceneError> {
        let pbr = &m["pbrMetallicRoughness"];
        let transmission = &m["extensions"]["KHR_materials_transmission"]["transmissionTexture"];
        let diffuse = &m["extensions"]["KHR_materials_diffuse_transmission"];
        let references = [
            ("baseColorTexture", &pbr["baseColorTexture"]),
            ("metallicRoughnessTexture", &pbr["metallicRoughnessTexture"]),
            ("normalTexture", &m["normalTexture"]),
            ("emissiveTexture", &m["emissiveTexture"]),
            ("transmissionTexture", transmission),
            (
                "diffuseTransmissionColorTexture",
                &diffuse["diffuseTransmissionColorTexture"],
            ),
        ];
        let mut textures = [const { None }; 6];
        for ((key, reference), texture) in references.iter().zip(&mut textures) {
            if reference.is_object() {
                let place = format!("{place}.{key}");
                let placement = self.placement(&place, reference)?;
                *texture = self
                    .texture(&place, reference)?
                    .map(|sampled| (sampled, placement, place));
            }
        }
        let normal = textures[2].as_ref();
        if let Some((_, placement, _)) = normal.or(textures.iter().flatten().next()) {
            loaded.uv_sets = UvSets {
                first: placement.set,
                map: placement.map,
                ..UvSets::default()
            };
        }
        let mut mapped = [const { None }; 6];
        for (texture, mapped) in textures.into_iter().zip(&mut mapped) {
            if let Some(((image, wrap, filter), placement, place)) = texture {
                let lookup = Lookup {
                    wrap,
                    filter,
                    ..self.lookup(&place, placement, &mut loaded.uv_sets)
                };
                *mapped = Some((image, lookup));
            }
        }
        self.set_textures(place, m, mapped, &mut loaded.desc)
    }

    /// Stores the textures in the material: base colour, metallic and roughness, normal map,
    /// emission, transmission, colour of diffuse transmission.
    fn set_textures(
        &mut self,
        place: &str,
        m: &Json,
        textures: [Option<(Arc<TextureDesc>, Lookup)>; 6],
        d: &mut MaterialDesc,
    ) -> Result<(), SceneError> {
        let [base, rough, normal, emissive, transmission, through] = textures;
        let [base, rough] = self.converted(place, m, [base, rough])?;
        self.set_mask(place, m, base.as_ref(), d)?;
        if let Some((image, lookup)) = base {
            d.set_mapped_texture(TextureSlot::BaseColor, image, lookup);
        }
        if let Some((image, lookup)) = rough {
            let (roughness, metallic) = (d.roughness, d.metallic);
            d.set_mapped_texture(
                TextureSlot::Roughness,
                self.channel(place, &image, 1, roughness)?,
                lookup,
            );
            d.set_mapped_texture(
                TextureSlot::Metallic,
                self.channel(place, &image, 2, metallic)?,
                lookup,
            );
        }
        if let Some((image, lookup)) = normal {
            let scale = m["normalTexture"]["scale"].as_f64().unwrap_or(1.0);
            if scale < 0.0 {
                self.note(
                    place,
                    "a negative scale of a normal map is not supported; the map is disabled",
                );
            }
            d.normal_strength = scale.clamp(0.0, 100.0) as f32;
            d.set_mapped_texture(TextureSlot::Normal, image, lookup);
        }
        if let Some((image, lookup)) = emissive {
            d.set_mapped_texture(TextureSlot::Emission, image, lookup);
        }
        if let Some((image, lookup)) = through {
            d.set_mapped_texture(TextureSlot::Transmittance, image, lookup);
        }
        if let Some((image, lookup)) = transmission {
            let transmission = 1.0 - d.opacity;
            let opacity = self.derived(
                place,
                &image,
                &format!("1 - r * {transmission}"),
                |[r, ..]| 1.0 - r * transmission,
            )?;
            d.set_mapped_texture(TextureSlot::Opacity, opacity, lookup);
        }
        Ok(())
    }

    /// Sets the mask of a material that is not opaque: the alpha of its base colour.
    fn set_mask(
        &mut self,
        place: &str,
        m: &Json,
        base: Option<&(Arc<TextureDesc>, Lookup)>,
        d: &mut MaterialDesc,
    ) -> Result<(), SceneError> {
        let mode = m["alphaMode"].as_str().unwrap_or("OPAQUE");
        if mode == "OPAQUE" {
            return Ok(());
        }
        d.mask_mode = if mode == "BLEND" {
            MaskMode::Blend
        } else {
            MaskMode::Threshold
        };
        d.mask_threshold = m["alphaCutoff"].as_f64().unwrap_or(0.5).clamp(0.0, 1.0) as f32;
        let alpha = m["pbrMetallicRoughness"]["baseColorFactor"][3]
            .as_f64()
            .unwrap_or(1.0) as f32;
        let (mask, lookup) = match base {
            Some((image, lookup)) => (self.channel(place, image, 3, alpha)?, *lookup),
            None => (Arc::new(TextureDesc::grey(alpha)), Lookup::default()),
        };
        d.set_mapped_texture(TextureSlot::Mask, mask, lookup);
        Ok(())
    }

    /// Reads the coordinate set and the transform of a texture reference.
    fn placement(&mut self, place: &str, reference: &Json) -> Result<TexturePlacement, SceneError> {
        let transform = &reference["extensions"]["KHR_texture_transform"];
        let set = transform["texCoord"]
            .as_u64()
            .or(reference["texCoord"].as_u64())
            .unwrap_or(0);
        let pair = |v: &Json, default: f32| {
            let at = |i: usize| v[i].as_f64().map_or(default, |x| x as f32);
            Vec2::new(at(0), at(1))
        };
        let angle = transform["rotation"].as_f64().unwrap_or(0.0) as f32;
        // The rotation is applied after the scale.
        let map = Affine2::from_translation(pair(&transform["offset"], 0.0))
            * Affine2::from_angle(-angle)
            * Affine2::from_scale(pair(&transform["scale"], 1.0));
        if !map.is_finite() {
            return Err(self
                .document
                .error(place, "the texture transform must be finite"));
        }
        Ok(TexturePlacement { set, map })
    }

    /// Returns the mapping of a texture relative to the material's coordinate sets. The first
    /// texture with another set than the first determines the second set.
    fn lookup(&mut self, place: &str, placement: TexturePlacement, uv_sets: &mut UvSets) -> Lookup {
        let second = placement.set != uv_sets.first;
        if second && *uv_sets.second.get_or_insert(placement.set) != placement.set {
            self.note(
                place,
                "textures of a material can use at most two texture coordinate sets; this one is \
                 mapped like the first texture",
            );
            return Lookup::default();
        }
        let first = if second {
            Affine2::IDENTITY
        } else {
            uv_sets.map
        };
        match Lookup::relative_to(first, placement.map) {
            Ok(map) => Lookup {
                second,
                map: map.map(flipped_v),
                ..Lookup::default()
            },
            Err(e) => {
                self.note(place, e.to_string());
                Lookup::default()
            }
        }
    }

    /// Reads the image and the sampler of a texture reference.
    fn texture(
        &mut self,
        place: &str,
        reference: &Json,
    ) -> Result<Option<SampledImage>, SceneError> {
        let (i, texture) = self
            .document
            .resolve(place, "textures", &reference["index"])?;
        let place = format!("textures[{i}]");
        let texture = texture.clone();
        let sampler = match &texture["sampler"] {
            Json::Null => Json::Null,
            index => self.document.resolve(&place, "samplers", index)?.1.clone(),
        };
        let wrap = |key: &str| match sampler[key].as_u64() {
            Some(33071) => Wrap::Clamp,
            Some(33648) => Wrap::Mirror,
            _ => Wrap::Repeat,
        };
        let filter = match sampler["magFilter"].as_u64() {
            Some(9728) => TextureFilter::Nearest,
            _ => TextureFilter::Bilinear,
        };
        // Flipping v leaves every wrap mode unchanged.
        let wraps = [wrap("wrapS"), wrap("wrapT")];
        let webp = &texture["extensions"]["EXT_texture_webp"]["source"];
        let source = [webp, &texture["source"]]
            .into_iter()
            .find(|s| !s.is_null());
        let Some(source) = source else {
            return self.without_source(&place, &texture).map(|()| None);
        };
        Ok(self
            .image(&place, source)?
            .map(|image| (image, wraps, filter)))
    }

    /// Notes a texture without `source`: one whose image only an extension gives is unreadable.
    fn without_source(&mut self, place: &str, texture: &Json) -> Result<(), SceneError> {
        let extensions = texture["extensions"].as_object();
        let given = extensions
            .into_iter()
            .flatten()
            .find(|(_, e)| e["source"].is_u64());
        let Some((name, _)) = given else {
            self.note(place, "the texture has no image; it is ignored");
            return Ok(());
        };
        let name = shown(name);
        let problem =
            format!("only the extension `{name}`, which is not supported, gives its image");
        if self.missing == MissingTextures::Fail {
            return Err(with_lenient_hint(self.document.error(place, problem)));
        }
        self.note(
            place,
            format!("{problem}; the material's constant value is used"),
        );
        Ok(())
    }

    /// Returns a grey image computed from every texel, with channels as stored, from 0 to 1. `how`
    /// identifies the function.
    fn derived(
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
        self.cache
            .derived(image, how, grey)
            .map_err(|problem| self.document.error(place, problem))
    }

    /// Returns one channel of an image times a factor, as a grey image.
    fn channel(
        &mut self,
        place: &str,
        image: &TextureDesc,
        which: usize,
        factor: f32,
    ) -> Result<Arc<TextureDesc>, SceneError> {
        self.derived(place, image, &format!("{which} * {factor}"), |texel| {
            texel[which] * factor
        })
    }

    /// Returns an image of the document, or `None` with a note if it cannot be read and the policy
    /// allows it.
    fn image(
        &mut self,
        place: &str,
        source: &Json,
    ) -> Result<Option<Arc<TextureDesc>>, SceneError> {
        let (i, image) = self.document.resolve(place, "images", source)?;
        if let Some(known) = self.images.get(&i) {
            return Ok(known.clone());
        }
        let place = format!("images[{i}]");
        let image = match self.read_image(&place, image) {
            Ok(image) => Some(image),
            Err(e) if self.missing == MissingTextures::Note => {
                self.note(
                    &place,
                    format!("{e}; the material's constant value is used"),
                );
                None
            }
            Err(e) => return Err(with_lenient_hint(e)),
        };
        self.images.insert(i, image.clone());
        Ok(image)
    }

    /// Reads an image of the document; errors name its place.
    fn read_image(&mut self, place: &str, image: &Json) -> Result<Arc<TextureDesc>, SceneError> {
        let document = self.document;
        if let Some(uri) = image["uri"]
            .as_str()
            .filter(|uri| !uri.starts_with("data:"))
        {
            let read = self.cache.load(&document.relative_path(uri), self.notes);
            return read.map_err(|e| document.error(place, e.to_string()));
        }
        let bytes = match document.uri(place, image)? {
            Some(bytes) => bytes,
            None => document.view(place, &image["bufferView"])?.0.to_vec(),
        };
        self.cache
            .load_embedded(&document.path, bytes, document.size(), self.notes)
            .map_err(|e| match e {
                SceneError::Malformed { problem, .. } => document.error(place, problem),
                other => other,
            })
    }
}

/// Converts a map of texture coordinates between those that start at the top left and those that
/// start at the bottom left.
fn flipped_v(map: Affine2) -> Affine2 {
    let flip = Affine2 {
        matrix2: glam::Mat2::from_diagonal(Vec2::new(1.0, -1.0)),
        translation: Vec2::Y,
    };
    flip * map * flip
}

/// Returns a number clamped to 0..=1.
fn unit_number(v: &Json, default: f64) -> f32 {
    v.as_f64().unwrap_or(default).clamp(0.0, 1.0) as f32
}

/// Returns the first three elements of a list as a colour.
fn color(v: &Json, default: Vec3) -> Vec3 {
    let at = |i: usize| v[i].as_f64().map_or(default[i], |x| x as f32);
    Vec3::new(at(0), at(1), at(2))
}
