//! Export of materials as materials of pbrt-v4.
//!
//! | model | pbrt |
//! |---|---|
//! | `disney` | `conductor`, `dielectric` and `coateddiffuse`, mixed by metallic and opacity |
//! | `lambert` | `conductor`, `dielectric` and `diffuse`, mixed likewise |
//! | `conductor`, `plastic`, `dielectric` | `conductor`, `coateddiffuse`, `dielectric` |
//! | `translucent` | `diffusetransmission` |
//! | `oren_nayar` | `diffuse` |
//!
//! Masks become the `alpha` of shapes, emission area lights, compositions of two parts `mix`.

use glam::{Affine2, Vec2, Vec3};

use super::super::texture::{TexelConversion, TextureWriter};
use super::super::{OutputFolder, identifier};
use super::text::{Text, vector};
use crate::model_differences;
use crate::names::UniqueNames;
use lumbre_light::scene::desc::{
    DEFAULT_MATERIAL, DelayKind, Distribution, Formulas, MaskMode, MaterialDesc, Model,
    RoughnessTexels, SceneDesc, ShadingNormals, TextureFilter, TextureSlot, Wrap,
};
use lumbre_light::scene::{Note, SceneError};

/// A material in the file, and what shapes with it need.
pub(super) struct Written {
    /// Name of the material.
    pub name: String,
    /// Directive of its area light.
    pub light: Option<String>,
    /// Parameter `alpha` of its shapes.
    pub alpha: Option<String>,
}

/// Writer of all materials.
pub(super) struct Surfaces<'a> {
    pub desc: &'a SceneDesc,
    pub text: &'a mut Text,
    pub folder: &'a mut OutputFolder,
    pub textures: &'a mut TextureWriter,
    pub ids: &'a mut UniqueNames,
    pub notes: &'a mut Vec<Note>,
}

/// Lobe of a material: a material of pbrt with one type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Lobe {
    Metal,
    Glass,
    Body,
    Sheet,
}

/// Parameters of a material that is written.
type Parameters = Vec<String>;

impl Surfaces<'_> {
    /// Writes all materials, compositions after their parts.
    pub fn write(mut self) -> Result<Vec<Written>, SceneError> {
        let fallback = MaterialDesc::new(DEFAULT_MATERIAL);
        let desc = self.desc;
        let rows = if desc.materials.is_empty() {
            std::slice::from_ref(&fallback)
        } else {
            &desc.materials
        };
        let names: Vec<String> = rows
            .iter()
            .map(|m| self.ids.allocate(&identifier(&m.name)))
            .collect();
        let mut written = Vec::with_capacity(rows.len());
        let (plain, mixed): (Vec<_>, Vec<_>) = rows
            .iter()
            .zip(&names)
            .partition(|(m, _)| m.parts.is_empty());
        for (m, name) in plain {
            self.material(m, name)?;
        }
        for (m, name) in mixed {
            self.composition(m, name, &names)?;
        }
        for (m, name) in rows.iter().zip(names) {
            written.push(Written {
                name,
                light: self.light(m)?,
                alpha: self.alpha(m)?,
            });
        }
        Ok(written)
    }

    /// Adds a note about a material.
    fn note(&mut self, m: &MaterialDesc, message: impl Into<String>) {
        let place = format!("materials.{}", m.name);
        self.notes.push(Note::new("", place, message));
    }

    /// Writes a named material.
    fn named(&mut self, name: &str, class: &str, parameters: &[String]) {
        self.text.directive("MakeNamedMaterial", name);
        self.text.string("string type", class);
        for parameter in parameters {
            self.text.parameter(parameter);
        }
    }

    /// Writes a mix of two materials; `amount` is the parameter of the second's weight.
    fn mixed(&mut self, name: &str, [a, b]: [&str; 2], amount: String) {
        let materials = format!("\"string materials\" [ \"{a}\" \"{b}\" ]");
        self.named(name, "mix", &[materials, amount]);
    }

    /// Writes a material without parts.
    fn material(&mut self, m: &MaterialDesc, name: &str) -> Result<(), SceneError> {
        if m.emission != Vec3::ZERO && !m.emitter_reflects {
            self.named(name, "diffuse", &[vector("rgb reflectance", Vec3::ZERO)]);
            return Ok(());
        }
        self.note_unsupported(m);
        match m.model {
            Model::Conductor => self.lobe(m, Lobe::Metal, name),
            Model::Dielectric => self.lobe(m, Lobe::Glass, name),
            Model::Plastic => self.lobe(m, Lobe::Body, name),
            Model::Translucent => self.lobe(m, Lobe::Sheet, name),
            Model::OrenNayar => self.lobe(m, Lobe::Body, name),
            Model::Disney | Model::Lambert => self.weighted(m, name),
        }
    }

    /// Notes what pbrt has no counterpart of.
    fn note_unsupported(&mut self, m: &MaterialDesc) {
        let opaque = match m.model {
            Model::Dielectric | Model::Translucent => false,
            Model::OrenNayar => true,
            _ => m.opacity >= 1.0,
        };
        let of_interface = m.model.has_microfacets() && m.model != Model::Disney;
        let rows = [
            (m.one_sided && opaque, "`one_sided`: both sides reflect"),
            (
                m.shadow_terminator,
                "`shadow_terminator`: shadows end at the triangles",
            ),
            (
                m.shading_normals == ShadingNormals::Flat,
                "`shading_normals` of `flat`: the normals of vertices are used",
            ),
            (
                m.delay.kind != DelayKind::None,
                "delays: light is returned without delay",
            ),
            (
                m.distribution == Distribution::Beckmann && m.model.has_microfacets(),
                "the distribution `beckmann`: `ggx` of the same alpha is used",
            ),
            (
                m.specular != Vec3::ONE && of_interface,
                "`specular`: the interface reflects fully",
            ),
            (
                m.model == Model::Dielectric && m.base_color != Vec3::ONE,
                "the tint of transmission: it is white",
            ),
            (
                m.model == Model::Plastic && !m.nonlinear,
                "plastic without `nonlinear`: internal reflections are coloured",
            ),
            (
                m.formulas == Formulas::Mitsuba
                    && (m.model == Model::Plastic && m.roughness >= m.smooth_below
                        || m.model == Model::Disney && m.clearcoat > 0.0),
                "`formulas` of `mitsuba`: those of this renderer come nearest",
            ),
            (
                m.anisotropic > 0.0 && m.anisotropic_direction != Vec3::ZERO,
                "`anisotropic_direction`: increasing u is used",
            ),
        ];
        for (_, what) in rows.iter().filter(|(found, _)| *found) {
            self.note(m, format!("not supported by pbrt: {what}"));
        }
        if m.model == Model::OrenNayar {
            self.note(m, model_differences::SMOOTH_DIFFUSE);
        }
        if m.model == Model::Disney {
            self.note(
                m,
                "the model `disney` is not supported by pbrt: a coated diffuse surface, metal or \
                 glass of its colour, roughness and index is used",
            );
        }
        if m.texture(TextureSlot::Bump).is_some() {
            self.note(m, model_differences::PBRT_BUMPS);
        }
    }

    /// Writes the lobes of a model that mixes metal, glass and a body.
    fn weighted(&mut self, m: &MaterialDesc, name: &str) -> Result<(), SceneError> {
        let metal = self.weight(m, "metallic", m.metallic, TextureSlot::Metallic)?;
        let opaque = self.weight(m, "opacity", m.opacity, TextureSlot::Opacity)?;
        let only = match (&metal, &opaque) {
            (Weight::One, _) => Some(Lobe::Metal),
            (Weight::Zero, Weight::One) => Some(Lobe::Body),
            (Weight::Zero, Weight::Zero) => Some(Lobe::Glass),
            _ => None,
        };
        if let Some(lobe) = only {
            return self.lobe(m, lobe, name);
        }
        let mut inner = self.ids.allocate(&format!("{name}_inner"));
        if matches!(metal, Weight::Zero) {
            inner = name.to_owned();
        }
        match opaque {
            Weight::One => self.lobe(m, Lobe::Body, &inner)?,
            Weight::Zero => self.lobe(m, Lobe::Glass, &inner)?,
            Weight::Share(amount) => {
                let [glass, body] = ["glass", "body"].map(|part| format!("{name}_{part}"));
                let (glass, body) = (self.ids.allocate(&glass), self.ids.allocate(&body));
                self.lobe(m, Lobe::Glass, &glass)?;
                self.lobe(m, Lobe::Body, &body)?;
                self.mixed(&inner, [&glass, &body], amount);
            }
        }
        if let Weight::Share(amount) = metal {
            let metal = self.ids.allocate(&format!("{name}_metal"));
            self.lobe(m, Lobe::Metal, &metal)?;
            self.mixed(name, [&inner, &metal], amount);
        }
        Ok(())
    }

    /// Returns a weight of a lobe.
    fn weight(
        &mut self,
        m: &MaterialDesc,
        what: &str,
        value: f32,
        slot: TextureSlot,
    ) -> Result<Weight, SceneError> {
        if m.texture(slot).is_some() {
            let texture = self.texture(m, slot, TexelConversion::Number, &format!("{what}_map"))?;
            return Ok(Weight::Share(format!("\"texture amount\" \"{texture}\"")));
        }
        Ok(match value {
            x if x <= 0.0 => Weight::Zero,
            x if x >= 1.0 => Weight::One,
            x => Weight::Share(format!("\"float amount\" {x}")),
        })
    }

    /// Writes one lobe of a material.
    fn lobe(&mut self, m: &MaterialDesc, lobe: Lobe, name: &str) -> Result<(), SceneError> {
        let mut p = Parameters::new();
        let class = match lobe {
            Lobe::Metal => {
                self.metal(m, &mut p)?;
                "conductor"
            }
            Lobe::Glass if m.thin && m.ior == 1.0 => "interface",
            Lobe::Glass => {
                p.push(format!("\"float eta\" {}", m.ior));
                if m.thin {
                    "thindielectric"
                } else {
                    self.rough(m, &mut p)?;
                    "dielectric"
                }
            }
            Lobe::Sheet => {
                p.push(self.color(m, "reflectance", m.base_color)?);
                p.push(self.transmittance(m)?);
                "diffusetransmission"
            }
            Lobe::Body => {
                p.push(self.color(m, "reflectance", m.base_color)?);
                if matches!(m.model, Model::Lambert | Model::OrenNayar) {
                    "diffuse"
                } else {
                    p.push(format!("\"float eta\" {}", m.ior));
                    self.rough(m, &mut p)?;
                    let alpha = if m.texture(TextureSlot::Roughness).is_some() {
                        1.0
                    } else {
                        m.roughness.powi(2)
                    };
                    self.note(m, model_differences::coated_diffuse(alpha));
                    "coateddiffuse"
                }
            }
        };
        if class != "interface" {
            self.maps(m, &mut p)?;
        }
        self.named(name, class, &p);
        Ok(())
    }

    /// Adds the parameters of a conductor.
    fn metal(&mut self, m: &MaterialDesc, p: &mut Parameters) -> Result<(), SceneError> {
        let textured = m.texture(TextureSlot::BaseColor).is_some();
        let factor = if m.model == Model::Conductor {
            m.base_color * m.specular
        } else {
            m.base_color
        };
        let plain = factor == Vec3::ONE && !textured;
        if plain && m.model == Model::Conductor {
            p.extend([vector("rgb eta", m.eta), vector("rgb k", m.k)]);
        } else {
            let mut factor = factor;
            if m.model == Model::Conductor {
                self.note(
                    m,
                    "factors on the reflection of a metal are not supported by pbrt: its reflectance \
                     is the same at normal incidence, and rises to 1 at grazing angles",
                );
                // The reflectance of the index at normal incidence.
                let [low, high] = [-1.0, 1.0].map(|sign| {
                    let n = m.eta + sign;
                    n * n + m.k * m.k
                });
                factor *= low / high;
            }
            p.push(self.color(m, "reflectance", factor)?);
        }
        self.rough(m, p)
    }

    /// Returns a colour, or the base colour texture times it.
    fn color(&mut self, m: &MaterialDesc, name: &str, factor: Vec3) -> Result<String, SceneError> {
        self.textured(m, name, (factor, TextureSlot::BaseColor, "color_map"))
    }

    /// Returns the transmittance, or its texture times it.
    fn transmittance(&mut self, m: &MaterialDesc) -> Result<String, SceneError> {
        let texture = (
            m.transmittance,
            TextureSlot::Transmittance,
            "transmittance_map",
        );
        self.textured(m, "transmittance", texture)
    }

    /// Returns a colour, or the texture of a slot times it, with a name that ends with `stem`.
    fn textured(
        &mut self,
        m: &MaterialDesc,
        name: &str,
        (factor, slot, stem): (Vec3, TextureSlot, &str),
    ) -> Result<String, SceneError> {
        if m.texture(slot).is_none() {
            return Ok(vector(&format!("rgb {name}"), factor));
        }
        let texture = self.texture(m, slot, TexelConversion::Color(factor), stem)?;
        Ok(format!("\"texture {name}\" \"{texture}\""))
    }

    /// Adds the roughness as alpha.
    fn rough(&mut self, m: &MaterialDesc, p: &mut Parameters) -> Result<(), SceneError> {
        if !m.model.has_microfacets() {
            return Ok(());
        }
        if m.texture(TextureSlot::Roughness).is_some() {
            if m.anisotropic > 0.0 {
                self.note(
                    m,
                    "anisotropy is not supported together with a roughness texture",
                );
            }
            if m.roughness_texels == RoughnessTexels::Roughness {
                self.note(m, model_differences::ROUGHNESS_TEXELS);
            }
            let conversion =
                TexelConversion::of_roughness(m.roughness_texels, RoughnessTexels::Alpha);
            let texture = self.texture(m, TextureSlot::Roughness, conversion, "alpha_map")?;
            p.push(format!("\"texture roughness\" \"{texture}\""));
        } else if m.roughness >= m.smooth_below {
            let (alpha, aspect) = (
                m.roughness * m.roughness,
                (1.0 - 0.9 * m.anisotropic).sqrt(),
            );
            if m.anisotropic > 0.0 {
                let (u, v) = (alpha / aspect, alpha * aspect);
                p.push(format!("\"float uroughness\" {u}"));
                p.push(format!("\"float vroughness\" {v}"));
            } else {
                p.push(format!("\"float roughness\" {alpha}"));
            }
        } else {
            return Ok(());
        }
        p.push("\"bool remaproughness\" false".to_owned());
        Ok(())
    }

    /// Adds the normal map and the bump map.
    fn maps(&mut self, m: &MaterialDesc, p: &mut Parameters) -> Result<(), SceneError> {
        let slot = TextureSlot::Normal;
        if let Some(image) = m.texture(slot).filter(|_| m.normal_strength > 0.0) {
            let (lookup, tiled) = (m.lookup(slot), m.tiling != 1.0 || m.uv_offset != Vec2::ZERO);
            if !lookup.is_plain() || tiled {
                self.note(
                    m,
                    "pbrt does not support mappings of normal maps; it covers u and v once",
                );
            }
            let conversion = TexelConversion::NormalUp(m.normal_strength);
            let file = self.textures.file(image, conversion, self.folder)?;
            p.push(format!("\"string normalmap\" \"{file}\""));
        }
        if m.texture(TextureSlot::Bump).is_some() && m.bump_height != 0.0 {
            let conversion = TexelConversion::Height;
            let texture = self.texture(m, TextureSlot::Bump, conversion, "height_map")?;
            p.push(format!("\"texture displacement\" \"{texture}\""));
        }
        Ok(())
    }

    /// Writes a texture of a slot with its mapping; returns its name.
    fn texture(
        &mut self,
        m: &MaterialDesc,
        slot: TextureSlot,
        conversion: TexelConversion,
        stem: &str,
    ) -> Result<String, SceneError> {
        let name = self
            .ids
            .allocate(&format!("{}_{stem}", identifier(&m.name)));
        let Some(image) = m.texture(slot) else {
            return Ok(name);
        };
        let file = self.textures.file(image, conversion, self.folder)?;
        let of_color = matches!(conversion, TexelConversion::Color(_));
        let ty = if of_color { "spectrum" } else { "float" };
        self.text
            .line(&format!("Texture \"{name}\" \"{ty}\" \"imagemap\""));
        self.text.string("string filename", &file);
        if !of_color && file.ends_with(".png") {
            self.text.string("string encoding", "linear");
        }
        if slot == TextureSlot::Bump && m.bump_height != 1.0 {
            self.text.number("float scale", m.bump_height);
        }
        self.mapping(m, slot);
        Ok(name)
    }

    /// Writes the mapping of a texture.
    fn mapping(&mut self, m: &MaterialDesc, slot: TextureSlot) {
        let lookup = m.lookup(slot);
        let tiling = Affine2::from_scale_angle_translation(Vec2::splat(m.tiling), 0.0, m.uv_offset);
        let map = lookup.map.unwrap_or(Affine2::IDENTITY) * tiling;
        let [a, b, c, d] = map.matrix2.to_cols_array();
        if b != 0.0 || c != 0.0 {
            self.note(
                m,
                "pbrt does not support textures that are turned; their scale is used",
            );
        }
        let t = map.translation;
        let rows = [
            ("float uscale", a, 1.0),
            ("float vscale", d, 1.0),
            ("float udelta", t.x, 0.0),
            ("float vdelta", t.y, 0.0),
        ];
        for (name, value, _) in rows.iter().filter(|(_, value, default)| value != default) {
            self.text.number(name, value);
        }
        if lookup.second {
            self.note(
                m,
                "pbrt supports one set of texture coordinates; the first is used",
            );
        }
        if lookup.filter == TextureFilter::Nearest {
            self.text.string("string filter", "point");
        }
        match lookup.wrap {
            [Wrap::Repeat, Wrap::Repeat] => {}
            [Wrap::Clamp, Wrap::Clamp] => self.text.string("string wrap", "clamp"),
            _ => self.note(
                m,
                "pbrt supports the wrap modes `repeat` and `clamp`, the same for u and v; `repeat` \
                 is used",
            ),
        }
    }

    /// Writes a material of two parts.
    fn composition(
        &mut self,
        m: &MaterialDesc,
        name: &str,
        names: &[String],
    ) -> Result<(), SceneError> {
        let part = |part: &String| self.desc.material_index(part).map(|i| names[i].clone());
        let parts: Vec<String> = m.parts.iter().filter_map(part).collect();
        if let [a, b] = parts.as_slice() {
            let amount = if m.by_side {
                self.note(m, "pbrt has no part for each side; the front is on both");
                "\"float amount\" 0".to_owned()
            } else if m.texture(TextureSlot::Weights).is_some() {
                let texture = self.texture(
                    m,
                    TextureSlot::Weights,
                    TexelConversion::Number,
                    "weight_map",
                )?;
                format!("\"texture amount\" \"{texture}\"")
            } else {
                format!("\"float amount\" {}", m.weights.get(1).unwrap_or(&0.5))
            };
            self.mixed(name, [a, b], amount);
            return Ok(());
        }
        self.note(
            m,
            "compositions of other than two parts are not exported; the material's own parameters \
             are used",
        );
        self.material(m, name)
    }

    /// Returns the directive of the area light of a material, if it emits.
    fn light(&mut self, m: &MaterialDesc) -> Result<Option<String>, SceneError> {
        if m.emission == Vec3::ZERO {
            return Ok(None);
        }
        let Some(image) = m.texture(TextureSlot::Emission) else {
            let radiance = vector("rgb L", m.emission);
            return Ok(Some(format!("AreaLightSource \"diffuse\" {radiance}")));
        };
        let lookup = m.lookup(TextureSlot::Emission);
        let moved = m.tiling != 1.0 || m.uv_offset != Vec2::ZERO || lookup.map.is_some();
        if moved || lookup.second {
            self.note(
                m,
                "pbrt does not support mappings of the image of a light; it covers u and v once",
            );
        }
        if lookup.wrap != [Wrap::Clamp; 2] {
            self.note(m, "pbrt extends the edges of the image of a light");
        }
        let conversion = TexelConversion::Light(m.emission);
        let file = self.textures.file(image, conversion, self.folder)?;
        Ok(Some(format!(
            "AreaLightSource \"diffuse\" \"string filename\" \"{file}\""
        )))
    }

    /// Returns the parameter of shapes for the mask of a material.
    fn alpha(&mut self, m: &MaterialDesc) -> Result<Option<String>, SceneError> {
        if m.texture(TextureSlot::Mask).is_none() {
            return Ok(None);
        }
        let conversion = match m.mask_mode {
            MaskMode::Blend => TexelConversion::Number,
            MaskMode::Threshold => {
                self.note(
                    m,
                    "a threshold as `mask_mode` is not supported by pbrt; it is applied to texels, \
                     and edges are soft",
                );
                TexelConversion::Threshold(m.mask_threshold)
            }
        };
        let texture = self.texture(m, TextureSlot::Mask, conversion, "mask")?;
        Ok(Some(format!("\"texture alpha\" \"{texture}\"")))
    }
}

/// Weight of a lobe in a mix.
enum Weight {
    Zero,
    One,
    /// The parameter `amount`.
    Share(String),
}
