//! The material parameter table: one row per parameter, from which the description's field, the script's sweep path,
//! the `.scn` key, the range check and the documentation all follow.

use std::sync::Arc;

use glam::Vec3;

use super::TextureDesc;
use crate::value::Value;
use crate::value::schema::{SchemaError, Ty};

/// One row of [`MATERIAL_PARAMS`].
#[derive(Debug)]
pub struct MaterialParam {
    /// Name in scripts: `set = { ["materials.NAME.<name>"] = .. }`.
    pub name: &'static str,
    /// Key in `.scn`, compared without regard to case.
    pub scn_key: &'static str,
    /// Key of its texture in `.scn`, empty if a texture makes no sense.
    pub scn_texture_key: &'static str,
    /// Type and range.
    pub ty: Ty,
    /// Meaning, unit and source in a sentence.
    pub doc: &'static str,
    /// Reads the parameter.
    pub get: fn(&MaterialDesc) -> Value,
    /// Writes the parameter; the value has been checked against `ty`.
    set_checked: fn(&mut MaterialDesc, &Value),
    /// The texture slot, if a texture makes sense.
    pub texture: Option<TextureSlot>,
}

/// The places where a material may have a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum TextureSlot {
    /// Multiplies the base colour; sRGB.
    BaseColor,
    /// Multiplies the emission; sRGB.
    Emission,
    /// Hits where its red channel is below the mask threshold are discarded; linear.
    Mask,
}

impl TextureSlot {
    /// Whether eight-bit texels of this role are decoded from sRGB; data textures never are.
    pub fn is_srgb(self) -> bool {
        match self {
            TextureSlot::BaseColor | TextureSlot::Emission => true,
            TextureSlot::Mask => false,
        }
    }
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
    /// Factor on texture coordinates.
    pub tiling: f32,
    /// Textures by slot, in order of slot, at most one each.
    pub textures: Vec<(TextureSlot, Arc<TextureDesc>)>,
    /// Whether a surface that emits also reflects; `.scn` says no, Lumbre's own scenes say yes.
    pub emitter_reflects: bool,
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
            tiling: 1.0,
            textures: Vec::new(),
            emitter_reflects: true,
        }
    }

    /// The texture in a slot.
    pub fn texture(&self, slot: TextureSlot) -> Option<&Arc<TextureDesc>> {
        self.textures.iter().find(|(s, _)| *s == slot).map(|(_, t)| t)
    }
}

macro_rules! scalar {
    ($name:ident, $scn:literal, $min:expr, $max:expr, $doc:literal) => {
        MaterialParam {
            name: stringify!($name),
            scn_key: $scn,
            scn_texture_key: "",
            ty: Ty::Num { min: $min, max: $max },
            doc: $doc,
            get: |m| Value::number(f64::from(m.$name)),
            set_checked: |m, v| m.$name = v.as_f64().unwrap_or_default() as f32,
            texture: None,
        }
    };
}

macro_rules! colour {
    ($name:ident, $scn:literal, $max:expr, $texture:literal, $slot:expr, $doc:literal) => {
        MaterialParam {
            name: stringify!($name),
            scn_key: $scn,
            scn_texture_key: $texture,
            ty: Ty::Nums { len: 3, min: 0.0, max: $max },
            doc: $doc,
            get: |m| Value::List(m.$name.to_array().iter().map(|x| Value::number(f64::from(*x))).collect()),
            set_checked: |m, v| m.$name = vec3_of(v),
            texture: Some($slot),
        }
    };
}

fn vec3_of(v: &Value) -> Vec3 {
    let at = |i: usize| v.as_list().and_then(|l| l.get(i)).and_then(Value::as_f64).unwrap_or_default() as f32;
    Vec3::new(at(0), at(1), at(2))
}

/// The smallest index of refraction that can be asked for: below it Snell's law has no useful picture.
pub const MIN_IOR: f64 = 0.01;

/// Every material parameter.
pub const MATERIAL_PARAMS: &[MaterialParam] = &[
    colour!(
        base_color,
        "color",
        1.0,
        "albedotexture",
        TextureSlot::BaseColor,
        "Linear base colour: albedo of the diffuse part, reflectance of the metal at normal incidence."
    ),
    colour!(
        emission,
        "emission",
        1e9,
        "emissiontexture",
        TextureSlot::Emission,
        "Radiance emitted by the front side, scene units."
    ),
    scalar!(roughness, "roughness", 0.0, 1.0, "Perceptual roughness; the GGX alpha is its square."),
    scalar!(metallic, "metallic", 0.0, 1.0, "0 is a dielectric, 1 a metal."),
    scalar!(opacity, "opacity", 0.0, 1.0, "1 is opaque, 0 refractive."),
    scalar!(ior, "ior", MIN_IOR, 100.0, "Index of refraction of the inside relative to the outside."),
    scalar!(tiling, "tiling", -1e6, 1e6, "Factor on texture coordinates."),
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
    fn every_row_writes_what_it_reads_and_defaults_are_in_range() {
        for row in MATERIAL_PARAMS {
            let mut m = MaterialDesc::new("m");
            let default = (row.get)(&m);
            row.ty.check("default", row.name, &default).unwrap();
            let other = match row.ty {
                Ty::Nums { .. } => Value::List(vec![Value::Num(0.25), Value::Num(0.5), Value::Int(0)]),
                _ => Value::Num(0.25),
            };
            row.set(&mut m, "path", &other).unwrap();
            assert_eq!((row.get)(&m), other, "{}", row.name);
            assert!(row.set(&mut m, "path", &Value::Str("x".into())).is_err());
        }
    }
}
