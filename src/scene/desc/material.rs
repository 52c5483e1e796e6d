//! The material parameter table: one row per parameter, from which the description's field, the script's sweep path,
//! the `.scn` key, the range check and the documentation all follow.

use std::sync::Arc;

use glam::{Vec2, Vec3};

use super::delay::{self, DelayDesc};
use super::{Distribution, Lookup, MaskMode, Model, TextureDesc, TextureSlot};
use crate::value::Value;
use crate::value::schema::{SchemaError, Ty};

/// One row of [`MATERIAL_PARAMS`].
#[derive(Clone, Copy, Debug)]
pub struct MaterialParam {
    /// Name in scripts: `set = { ["materials.NAME.<name>"] = .. }`.
    pub name: &'static str,
    /// Key in `.scn`, compared without regard to case.
    pub scn_key: &'static str,
    /// Key of its texture in `.scn`, empty if a texture makes no sense.
    pub scn_texture_key: &'static str,
    /// Type and range.
    pub ty: Ty,
    /// Unit of the value, empty for a pure number.
    pub unit: &'static str,
    /// Meaning and source in a sentence.
    pub doc: &'static str,
    /// Reads the parameter.
    pub get: fn(&MaterialDesc) -> Value,
    /// Writes the parameter; the value has been checked against `ty`.
    pub(super) set_checked: fn(&mut MaterialDesc, &Value),
    /// The texture slot, if a texture makes sense.
    pub texture: Option<TextureSlot>,
}

/// A material as its file says it.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialDesc {
    /// The name by which faces and edits reach it.
    pub name: String,
    /// Linear base colour, each channel in 0..=1.
    pub base_color: Vec3,
    /// Radiance emitted by the front side, each channel at least 0.
    pub emission: Vec3,
    /// Perceptual roughness in 0..=1; the GGX alpha is its square.
    pub roughness: f32,
    /// 0 dielectric to 1 metal.
    pub metallic: f32,
    /// 1 opaque to 0 refractive.
    pub opacity: f32,
    /// Index of refraction of the inside relative to the outside, positive.
    pub ior: f32,
    /// 0 diffuse to 1 subsurface look [Burley 2012], in 0..=1.
    pub subsurface: f32,
    /// Part of the base colour's hue in the dielectric's reflectance at normal incidence, in 0..=1.
    pub specular_tint: f32,
    /// 0 round to 1 stretched highlights, in 0..=1.
    pub anisotropic: f32,
    /// World-space direction along which highlights are stretched; zero means the direction of growing u.
    pub anisotropic_direction: Vec3,
    /// Strength of the sheen of cloth at grazing angles, in 0..=1.
    pub sheen: f32,
    /// Part of the base colour's hue in the sheen, in 0..=1.
    pub sheen_tint: f32,
    /// Strength of a clear coat over everything else, in 0..=1.
    pub clearcoat: f32,
    /// 0 satin to 1 gloss of the clear coat.
    pub clearcoat_gloss: f32,
    /// Roughness below which specular lobes are perfectly smooth.
    pub smooth_below: f32,
    /// Which BSDF the parameters describe.
    pub model: Model,
    /// Factor on what conductors, plastic and dielectrics reflect at their surface, in 0..=1.
    pub specular: Vec3,
    /// Real part of a conductor's index of refraction by channel, relative to the outside, at least 0.
    pub eta: Vec3,
    /// Imaginary part of a conductor's index of refraction by channel, relative to the outside, at least 0.
    pub k: Vec3,
    /// How the microfacets of conductors, plastic and dielectrics are distributed.
    pub distribution: Distribution,
    /// Whether a dielectric is a thin pane without an inside.
    pub thin: bool,
    /// Whether light that plastic reflects back inside takes on its colour each time.
    pub nonlinear: bool,
    /// Factor on the slope of the normal map.
    pub normal_strength: f32,
    /// How far 1 in the bump map stands out, in scene units.
    pub bump_height: f32,
    /// Mask values below this are holes.
    pub mask_threshold: f32,
    /// How a mask decides.
    pub mask_mode: MaskMode,
    /// Whether light reaches the smooth surface that the vertex normals suggest above a triangle.
    pub shadow_terminator: bool,
    /// Factor on texture coordinates.
    pub tiling: f32,
    /// Added to texture coordinates after the factor.
    pub uv_offset: Vec2,
    /// Textures by slot, in order of slot, at most one each.
    pub textures: Vec<(TextureSlot, Arc<TextureDesc>)>,
    /// How the textures of these slots lie, in order of slot; those of all others repeat, on the first set of coordinates.
    pub lookups: Vec<(TextureSlot, Lookup)>,
    /// Whether a surface that emits also reflects; `.scn` says no, Lumbre's own scenes say yes.
    pub emitter_reflects: bool,
    /// When light is given back.
    pub delay: DelayDesc,
    /// Names of the materials of which this one is composed; none for a material of its own.
    pub parts: Vec<String>,
    /// Their weights, which sum to one.
    pub weights: Vec<f32>,
}

impl MaterialDesc {
    /// A material with every parameter at its default.
    pub fn new(name: &str) -> MaterialDesc {
        MaterialDesc {
            name: name.to_owned(),
            base_color: Vec3::ONE,
            emission: Vec3::ZERO,
            roughness: 1.0,
            metallic: 0.0,
            opacity: 1.0,
            ior: 1.5,
            subsurface: 0.0,
            specular_tint: 0.0,
            anisotropic: 0.0,
            anisotropic_direction: Vec3::ZERO,
            sheen: 0.0,
            sheen_tint: 0.0,
            clearcoat: 0.0,
            clearcoat_gloss: 1.0,
            smooth_below: SMOOTH_ROUGHNESS,
            model: Model::Disney,
            specular: Vec3::ONE,
            eta: Vec3::ZERO,
            k: Vec3::ONE,
            distribution: Distribution::Ggx,
            thin: false,
            nonlinear: false,
            normal_strength: 1.0,
            bump_height: 1.0,
            mask_threshold: MASK_THRESHOLD,
            mask_mode: MaskMode::Threshold,
            shadow_terminator: false,
            tiling: 1.0,
            uv_offset: Vec2::ZERO,
            textures: Vec::new(),
            lookups: Vec::new(),
            emitter_reflects: true,
            delay: DelayDesc::default(),
            parts: Vec::new(),
            weights: Vec::new(),
        }
    }

    /// The texture in a slot.
    pub fn texture(&self, slot: TextureSlot) -> Option<&Arc<TextureDesc>> {
        self.textures.iter().find(|(s, _)| *s == slot).map(|(_, t)| t)
    }

    /// Puts a texture into a slot, or empties it.
    pub fn set_texture(&mut self, slot: TextureSlot, texture: Option<Arc<TextureDesc>>) {
        self.textures.retain(|(s, _)| *s != slot);
        self.textures.extend(texture.map(|t| (slot, t)));
        self.textures.sort_by_key(|(s, _)| *s);
    }

    /// How the texture in a slot lies.
    pub fn lookup(&self, slot: TextureSlot) -> Lookup {
        self.lookups.iter().find(|(s, _)| *s == slot).map_or_else(Lookup::default, |(_, lookup)| *lookup)
    }

    /// Puts a texture into a slot that lies so.
    pub fn lay_texture(&mut self, slot: TextureSlot, texture: Arc<TextureDesc>, lookup: Lookup) {
        self.set_texture(slot, Some(texture));
        self.set_lookup(slot, lookup);
    }

    /// Says how the texture in a slot lies, now and when it is replaced.
    pub fn set_lookup(&mut self, slot: TextureSlot, lookup: Lookup) {
        self.lookups.retain(|(s, _)| *s != slot);
        if !lookup.is_plain() {
            self.lookups.push((slot, lookup));
            self.lookups.sort_by_key(|(s, _)| *s);
        }
    }
}

macro_rules! scalar {
    ($name:ident, $scn:literal, $min:expr, $max:expr, $unit:literal, $doc:literal) => {
        scalar!($name, $scn, $min, $max, "", None, $unit, $doc)
    };
    ($name:ident, $scn:literal, $min:expr, $max:expr, $texture:literal, $slot:expr, $unit:literal, $doc:literal) => {
        MaterialParam {
            name: stringify!($name),
            scn_key: $scn,
            scn_texture_key: $texture,
            ty: Ty::Num { min: $min, max: $max },
            unit: $unit,
            doc: $doc,
            get: |m| Value::number(f64::from(m.$name)),
            set_checked: |m, v| m.$name = v.as_f64().unwrap_or_default() as f32,
            texture: $slot,
        }
    };
}

macro_rules! vector {
    ($name:ident, $scn:literal, $len:literal, $min:expr, $max:expr, $texture:literal, $slot:expr, $unit:literal, $doc:literal) => {
        MaterialParam {
            name: stringify!($name),
            scn_key: $scn,
            scn_texture_key: $texture,
            ty: Ty::Nums { len: $len, min: $min, max: $max },
            unit: $unit,
            doc: $doc,
            get: |m| Value::List(m.$name.to_array().iter().map(|x| Value::number(f64::from(*x))).collect()),
            set_checked: |m, v| m.$name = std::array::from_fn::<f32, $len, _>(|i| item(v, i)).into(),
            texture: $slot,
        }
    };
}

macro_rules! word {
    ($name:ident, $kind:ident, $doc:literal) => {
        MaterialParam {
            name: stringify!($name),
            scn_key: stringify!($name),
            scn_texture_key: "",
            ty: Ty::Word($kind::WORDS),
            unit: "",
            doc: $doc,
            get: |m| Value::Str(m.$name.word().to_owned()),
            set_checked: |m, v| {
                let said = $kind::ALL.into_iter().find(|kind| v.as_str() == Some(kind.word()));
                m.$name = said.unwrap_or(m.$name);
            },
            texture: None,
        }
    };
}

macro_rules! flag {
    ($name:ident, $doc:literal) => {
        MaterialParam {
            name: stringify!($name),
            scn_key: stringify!($name),
            scn_texture_key: "",
            ty: Ty::Bool,
            unit: "",
            doc: $doc,
            get: |m| Value::Bool(m.$name),
            set_checked: |m, v| m.$name = *v == Value::Bool(true),
            texture: None,
        }
    };
}

fn item(v: &Value, i: usize) -> f32 {
    v.as_list().and_then(|l| l.get(i)).and_then(Value::as_f64).unwrap_or_default() as f32
}

/// The smallest index of refraction that can be asked for: below it Snell's law has no useful picture.
pub const MIN_IOR: f64 = 0.01;

/// The default of the parameter `smooth_below`: specular lobes of less roughness are Dirac lobes. A lobe of this
/// roughness has the least GGX alpha there is, 0.001, and is already narrower than a pixel.
pub const SMOOTH_ROUGHNESS: f32 = 0.01;

/// The default of the parameter `mask_threshold` (annex A of the `.scn` format).
pub const MASK_THRESHOLD: f32 = 0.5;

/// Every material parameter. Defaults are those of [`MaterialDesc::new`].
pub const MATERIAL_PARAMS: &[MaterialParam] = &{
    let mut rows = [BUMP_HEIGHT; SURFACE.len() + delay::ROWS.len() + 1];
    let mut i = 0;
    while i < rows.len() - 1 {
        rows[i] = if i < SURFACE.len() { SURFACE[i] } else { delay::ROWS[i - SURFACE.len()] };
        i += 1;
    }
    rows
};

/// The row of bump maps: the last one, since hashes count rows.
const BUMP_HEIGHT: MaterialParam = scalar!(
    bump_height,
    "bump_height",
    -1e6,
    1e6,
    "bumptexture",
    Some(TextureSlot::Bump),
    "scene units",
    "How far 1 in the bump map stands out along the normal; negative makes dents. Only normals are tilted, by the map's \
     slopes on the surface, however texture coordinates are stretched [Blinn 1978; Mikkelsen 2010]."
);

/// The rows that say what a surface does with light; [`delay`] has those that say when.
pub(super) const SURFACE: &[MaterialParam] = &[
    vector!(
        base_color,
        "color",
        3,
        0.0,
        1.0,
        "albedotexture",
        Some(TextureSlot::BaseColor),
        "",
        "Linear base colour: albedo of the diffuse part, reflectance of the metal at normal incidence; what passes \
         through is tinted by its square root. A texture multiplies it."
    ),
    vector!(
        emission,
        "emission",
        3,
        0.0,
        1e9,
        "emissiontexture",
        Some(TextureSlot::Emission),
        "scene radiance",
        "Radiance emitted by the front side. A texture multiplies it."
    ),
    scalar!(
        roughness,
        "roughness",
        0.0,
        1.0,
        "roughnesstexture",
        Some(TextureSlot::Roughness),
        "",
        "Perceptual roughness; the GGX alpha is its square. A texture replaces it."
    ),
    scalar!(
        metallic,
        "metallic",
        0.0,
        1.0,
        "metallictexture",
        Some(TextureSlot::Metallic),
        "",
        "0 is a dielectric, 1 a metal. A texture replaces it."
    ),
    scalar!(
        opacity,
        "opacity",
        0.0,
        1.0,
        "opacitytexture",
        Some(TextureSlot::Opacity),
        "",
        "1 is opaque, 0 refractive, of the dielectric part. A texture replaces it."
    ),
    scalar!(ior, "ior", MIN_IOR, 100.0, "", "Index of refraction of the inside relative to the outside."),
    scalar!(
        subsurface,
        "subsurface",
        0.0,
        1.0,
        "",
        "Part of the diffuse reflection that has the flatter look of scattering below the surface [Burley 2012]."
    ),
    scalar!(
        specular_tint,
        "speculartint",
        0.0,
        1.0,
        "",
        "Part of the base colour's hue in the dielectric's reflectance at normal incidence."
    ),
    scalar!(
        anisotropic,
        "anisotropic",
        0.0,
        1.0,
        "",
        "Stretches highlights: the aspect of the GGX lobe is sqrt(1 - 0.9 anisotropic)."
    ),
    vector!(
        anisotropic_direction,
        "anisotropic_direction",
        3,
        -1e6,
        1e6,
        "anisotropictexture",
        Some(TextureSlot::AnisotropicDirection),
        "",
        "World-space direction along which highlights are stretched; zero is the direction of growing u. A texture \
         replaces it by directions in the tangent frame."
    ),
    scalar!(sheen, "sheen", 0.0, 1.0, "", "Strength of the sheen of cloth at grazing angles [Burley 2012]."),
    scalar!(sheen_tint, "sheentint", 0.0, 1.0, "", "Part of the base colour's hue in the sheen."),
    scalar!(
        clearcoat,
        "clearcoat",
        0.0,
        1.0,
        "",
        "Strength of a clear coat of index 1.5 over everything else; 1 is a quarter of a full coat [Burley 2012]."
    ),
    scalar!(clearcoat_gloss, "clearcoatgloss", 0.0, 1.0, "", "0 is a satin, 1 a glossy clear coat [Burley 2012]."),
    word!(
        model,
        Model,
        "`lambert` makes surfaces ideal: the opaque part Lambertian, metal a mirror, glass smooth; roughness and the \
         parameters of the Disney lobes have no effect then. `conductor` is a metal of the index `eta` + i `k`, `plastic` \
         a diffuse body of the base colour under a surface of index `ior`, `dielectric` glass of that index: of the other \
         parameters they have roughness, anisotropy, `distribution` and `specular`."
    ),
    vector!(
        specular,
        "specular",
        3,
        0.0,
        1.0,
        "",
        None,
        "",
        "Factor on what the surfaces of the models `conductor`, `plastic` and `dielectric` reflect."
    ),
    vector!(
        eta,
        "eta",
        3,
        0.0,
        100.0,
        "",
        None,
        "",
        "Real part of the index of the model `conductor` by channel, relative to the outside; with 0, and `k` of 1, it is a \
         perfect mirror."
    ),
    vector!(
        k,
        "k",
        3,
        0.0,
        100.0,
        "",
        None,
        "",
        "Imaginary part of the index of the model `conductor` by channel, relative to the outside."
    ),
    word!(
        distribution,
        Distribution,
        "How the microfacets of the models `conductor`, `plastic` and `dielectric` are distributed; the other models have \
         `ggx`."
    ),
    flag!(thin, "Whether the model `dielectric` is a thin pane: what passes is not bent, and there is no inside."),
    flag!(
        nonlinear,
        "Whether light that the model `plastic` reflects back inside takes on the base colour each time, which makes \
         saturated colours more so."
    ),
    scalar!(
        smooth_below,
        "smooth_below",
        0.0,
        1.0,
        "",
        "Roughness below which specular lobes are perfectly smooth, which makes them Dirac lobes."
    ),
    scalar!(
        normal_strength,
        "normal_strength",
        0.0,
        100.0,
        "normaltexture",
        Some(TextureSlot::Normal),
        "",
        "Factor on the slope of the normal map; 0 switches it off."
    ),
    scalar!(
        mask_threshold,
        "mask_threshold",
        0.0,
        1.0,
        "masktexture",
        Some(TextureSlot::Mask),
        "",
        "Hits where the mask's red channel is below this are no hits."
    ),
    word!(
        mask_mode,
        MaskMode,
        "`blend` lets a hit count with the mask's value as probability, decided by a hash of ray and hit."
    ),
    flag!(
        shadow_terminator,
        "Whether light that passes below an opaque triangle still reaches the curved surface that its normals suggest, \
         which hides the hard edge where smooth shading meets shadow [Vives]. It shows another surface than the triangles, \
         so it is off unless asked for."
    ),
    scalar!(tiling, "tiling", -1e6, 1e6, "repeats", "Factor on texture coordinates."),
    vector!(
        uv_offset,
        "uv_offset",
        2,
        -1e6,
        1e6,
        "",
        None,
        "repeats",
        "Added to texture coordinates after the factor."
    ),
];

impl MaterialParam {
    /// Writes a value after checking its type and range; `path` is for the error.
    ///
    /// # Errors
    /// A value of the wrong kind or out of range.
    pub fn set(&self, material: &mut MaterialDesc, path: &str, value: &Value) -> Result<(), SchemaError> {
        self.ty.check(path, self.name, value)?;
        (self.set_checked)(material, value);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_slot_belongs_to_one_row_and_has_a_name_of_its_own() {
        for slot in TextureSlot::ALL {
            assert_eq!(MATERIAL_PARAMS.iter().filter(|row| row.texture == Some(slot)).count(), 1, "{slot:?}");
            assert_eq!(TextureSlot::from_name(slot.name()), Some(slot));
            assert!(MATERIAL_PARAMS.iter().all(|row| row.name != slot.name()));
        }
        let keyed = |row: &&MaterialParam| row.texture.is_some() == row.scn_texture_key.is_empty();
        assert_eq!(MATERIAL_PARAMS.iter().filter(keyed).count(), 0);
    }

    #[test]
    fn every_row_writes_what_it_reads_and_defaults_are_in_range() {
        for row in MATERIAL_PARAMS {
            let mut m = MaterialDesc::new("m");
            let default = (row.get)(&m);
            row.ty.check("default", row.name, &default).unwrap();
            let other = match row.ty {
                Ty::Nums { len, .. } => Value::List([Value::Num(0.25), Value::Num(0.5), Value::Int(0)][..len].to_vec()),
                Ty::Word(words) => Value::Str(words[1].to_owned()),
                Ty::Bool => Value::Bool(true),
                Ty::List(Ty::Str) => Value::List(vec!["a".into(), "b".into()]),
                Ty::List(_) => Value::List(vec![Value::Num(0.25), Value::Num(0.75)]),
                _ => Value::Num(0.25),
            };
            row.set(&mut m, "path", &other).unwrap();
            assert_eq!((row.get)(&m), other, "{}", row.name);
            assert!(row.set(&mut m, "path", &Value::Str("x".into())).is_err());
            assert_ne!(default, other, "{}", row.name);
        }
    }
}
