//! The material parameter table: one row per parameter. The field of the description, the sweep
//! path in scripts, the `.scn` key, the range check and the documentation all follow from it.

use super::delay::DELAY_PARAMS;
use super::material::MaterialParam;
use super::{
    Distribution, FilterChoice, Formulas, MaskMode, MaterialDesc, Model, RoughnessTexels,
    ShadingNormals, TextureSlot,
};
use crate::value::Value;
use crate::value::schema::Ty;

/// Declares parameters by one row each: `KIND FIELD(ARGUMENTS) [SLOT "KEY"], "UNIT", "DOC";`. The
/// macro `KIND` below explains its arguments. `SLOT` is its texture slot, `KEY` the key of its
/// texture in `.scn`.
macro_rules! rows {
    ($($kind:ident $name:ident($($arg:tt)*) $([$slot:ident $texture:literal])?, $unit:literal,
       $doc:literal;)*) => {
        &[$(MaterialParam {
            scn_texture_key: concat!("" $(, $texture)?),
            unit: $unit,
            doc: $doc,
            texture: [$(Some(TextureSlot::$slot),)? None][0],
            ..$kind!($name, $($arg)*)
        }),*]
    };
}

/// Parameter of one kind; [`rows!`] adds texture, unit and documentation.
const fn param(
    name: &'static str,
    scn_key: &'static str,
    ty: Ty,
    get: fn(&MaterialDesc) -> Value,
    set_checked: fn(&mut MaterialDesc, &Value),
) -> MaterialParam {
    MaterialParam {
        name,
        scn_key,
        scn_texture_key: "",
        ty,
        unit: "",
        doc: "",
        get,
        set_checked,
        texture: None,
    }
}

/// Number: key in `.scn`, smallest and largest value.
macro_rules! scalar {
    ($name:ident, $scn:literal, $min:expr, $max:expr) => {
        param(
            stringify!($name),
            $scn,
            Ty::num($min, $max),
            |m| Value::number(f64::from(m.$name)),
            |m, v| m.$name = v.as_f64().unwrap_or_default() as f32,
        )
    };
}

/// Vector: key in `.scn`, number of components, smallest and largest value.
macro_rules! vector {
    ($name:ident, $scn:literal, $len:literal, $min:expr, $max:expr) => {
        param(
            stringify!($name),
            $scn,
            Ty::nums($len, $min, $max),
            |m| {
                let numbers = m.$name.to_array();
                Value::List(numbers.map(|x| Value::number(f64::from(x))).to_vec())
            },
            |m, v| m.$name = std::array::from_fn::<f32, $len, _>(|i| item(v, i)).into(),
        )
    };
}

/// One of the values of an enum.
macro_rules! choice {
    ($name:ident, $kind:ident) => {
        param(
            stringify!($name),
            stringify!($name),
            Ty::Word($kind::NAMES),
            |m| Value::Str(m.$name.name().to_owned()),
            |m, v| m.$name = v.as_str().and_then($kind::from_name).unwrap_or(m.$name),
        )
    };
}

/// Truth value: `true` or `false`.
macro_rules! flag {
    ($name:ident,) => {
        param(
            stringify!($name),
            stringify!($name),
            Ty::Bool,
            |m| Value::Bool(m.$name),
            |m, v| m.$name = *v == Value::Bool(true),
        )
    };
}

fn item(v: &Value, i: usize) -> f32 {
    v.as_list()
        .and_then(|l| l.get(i))
        .and_then(Value::as_f64)
        .unwrap_or_default() as f32
}

/// Smallest accepted index of refraction: smaller ones yield no useful image.
pub const MIN_IOR: f64 = 0.01;

/// Every material parameter. Defaults are those of [`MaterialDesc::new`]. The order is part of the
/// content hash, so a new one follows the last.
pub const MATERIAL_PARAMS: &[MaterialParam] = &{
    const TABLES: [&[MaterialParam]; 3] = [SURFACE, &DELAY_PARAMS, LATER];
    let mut params = [SURFACE[0]; SURFACE.len() + DELAY_PARAMS.len() + LATER.len()];
    let (mut table, mut next) = (0, 0);
    while table < TABLES.len() {
        let mut i = 0;
        while i < TABLES[table].len() {
            params[next] = TABLES[table][i];
            (i, next) = (i + 1, next + 1);
        }
        table += 1;
    }
    params
};

/// Parameters of the surface's scattering; [`DELAY_PARAMS`] holds those of delays and compositions.
pub(super) const SURFACE: &[MaterialParam] = rows! {
    vector base_color("color", 3, 0.0, 1.0) [BaseColor "albedotexture"], "",
        "Linear base colour: albedo of the diffuse lobe, reflectance of the metal at normal \
         incidence; transmission is tinted by its square root. A texture multiplies it.";
    vector emission("emission", 3, 0.0, 1e9) [Emission "emissiontexture"], "scene radiance",
        "Radiance emitted by the front side. A texture multiplies it.";
    scalar roughness("roughness", 0.0, 1.0) [Roughness "roughnesstexture"], "",
        "Perceptual roughness; the GGX alpha is its square. A texture replaces it.";
    scalar metallic("metallic", 0.0, 1.0) [Metallic "metallictexture"], "",
        "Mix of dielectric (0) and metal (1). A texture replaces it.";
    scalar opacity("opacity", 0.0, 1.0) [Opacity "opacitytexture"], "",
        "Mix of refractive (0) and opaque (1), for the dielectric part. A texture replaces it.";
    scalar ior("ior", MIN_IOR, 100.0), "",
        "Index of refraction of the inside relative to the outside.";
    scalar subsurface("subsurface", 0.0, 1.0), "",
        "Share of the diffuse reflection that has the flatter falloff of subsurface scattering \
         [Burley 2012].";
    scalar specular_tint("speculartint", 0.0, 1.0), "",
        "Share of the base colour's hue in the dielectric's reflectance at normal incidence.";
    scalar anisotropic("anisotropic", 0.0, 1.0), "",
        "Stretches highlights: the aspect of the GGX lobe is sqrt(1 - 0.9 anisotropic).";
    vector anisotropic_direction("anisotropic_direction", 3, -1e6, 1e6)
        [AnisotropicDirection "anisotropictexture"], "",
        "World-space direction along which highlights are stretched; zero is the direction of \
         increasing u. A texture replaces it with directions in the tangent frame.";
    scalar sheen("sheen", 0.0, 1.0), "",
        "Strength of the cloth sheen at grazing angles [Burley 2012].";
    scalar sheen_tint("sheentint", 0.0, 1.0), "", "Share of the base colour's hue in the sheen.";
    scalar clearcoat("clearcoat", 0.0, 1.0), "",
        "Strength of a clear coat of index 1.5 over all other lobes; 1 is a quarter of a full coat \
         [Burley 2012].";
    scalar clearcoat_gloss("clearcoatgloss", 0.0, 1.0), "",
        "Gloss of the clear coat: 0 is satin, 1 glossy [Burley 2012].";
    choice model(Model), "",
        "`disney` is the adapted Disney BSDF. `lambert` makes surfaces ideal: the opaque part is \
         Lambertian, metal a mirror, glass smooth; roughness and the parameters of the Disney \
         lobes have no effect. `conductor` is a metal of the index `eta` + i `k`, `plastic` a \
         diffuse base of the base colour under an interface of index `ior`, `dielectric` glass of \
         that index; of the other parameters, these three use roughness, anisotropy, \
         `distribution` and `specular`. `translucent` is a thin diffuse sheet such as paper or a \
         leaf, the same on both sides: it reflects by the base colour and transmits by \
         `transmittance`, its only parameters. `oren_nayar` is a rough diffuse surface such as \
         plaster, opaque, of the base colour: the standard deviation of the slopes of its facets \
         is `roughness` times 90 degrees [Oren and Nayar 1994]; 0 is Lambertian.";
    vector specular("specular", 3, 0.0, 1.0), "",
        "Factor on the interface reflection of the models `conductor`, `plastic` and `dielectric`.";
    vector eta("eta", 3, 0.0, 100.0), "",
        "Real part of the index of the model `conductor` by channel, relative to the outside; 0, \
         with `k` of 1, is a perfect mirror.";
    vector k("k", 3, 0.0, 100.0), "",
        "Imaginary part of the index of the model `conductor` by channel, relative to the outside.";
    choice distribution(Distribution), "",
        "Microfacet distribution of the models `conductor`, `plastic` and `dielectric`; the other \
         models use `ggx`.";
    flag thin(), "",
        "Whether the model `dielectric` is a thin pane: transmitted light is not refracted, and \
         there is no inside.";
    flag nonlinear(), "",
        "Whether light that the model `plastic` reflects internally is multiplied by the base \
         colour each time, which makes saturated colours more saturated.";
    scalar smooth_below("smooth_below", 0.0, 1.0), "",
        "Roughness below which specular lobes are perfectly smooth: they become Dirac lobes.";
    scalar normal_strength("normal_strength", 0.0, 100.0) [Normal "normaltexture"], "",
        "Factor on the slope of the normal map; 0 disables it.";
    scalar mask_threshold("mask_threshold", 0.0, 1.0) [Mask "masktexture"], "",
        "Hits where the mask's red channel is below this value are discarded.";
    choice mask_mode(MaskMode), "",
        "`threshold` discards hits below `mask_threshold`; `blend` accepts a hit with the mask's \
         value as probability, decided by a hash of ray and hit.";
    flag shadow_terminator(), "",
        "Whether light that arrives below an opaque triangle still reaches the curved surface that \
         its normals suggest, which hides the hard edge where smooth shading meets shadow [Vives]. \
         It renders a surface that differs from the triangles, so it is off by default.";
    scalar tiling("tiling", -1e6, 1e6), "repeats", "Factor on texture coordinates.";
    vector uv_offset("uv_offset", 2, -1e6, 1e6), "repeats",
        "Offset of texture coordinates, added after the factor.";
};

/// Parameters that are younger than those of delays.
const LATER: &[MaterialParam] = rows! {
    scalar bump_height("bump_height", -1e6, 1e6) [Bump "bumptexture"], "scene units",
        "Height of the value 1 of the bump map along the normal; negative values make dents. Only \
         normals are perturbed, by the gradient of the map on the surface, however texture \
         coordinates are stretched [Blinn 1978; Mikkelsen 2010].";
    flag one_sided(), "",
        "Whether opaque lobes reflect on the front side only: the back is black, as in Mitsuba \
         without `twosided`. Refraction is not affected.";
    choice texture_filter(FilterChoice), "",
        "Interpolation of the material's textures: `bilinear` between the centres of four texels, \
         `nearest` without; `given` leaves to each texture what its file or script gives, which is \
         `bilinear` unless stated.";
    choice shading_normals(ShadingNormals), "",
        "`smooth` shades with the interpolated normals of the vertices and with normal and bump \
         maps, `flat` with the normal of each triangle alone, which also leaves the shadow \
         terminator without effect.";
    vector transmittance("transmittance", 3, 0.0, 1.0) [Transmittance "transmittancetexture"], "",
        "Share of the light that the model `translucent` transmits, in all directions of the other \
         side alike; linear. The base colour is the share that it reflects, and the sum of both \
         should not exceed 1. A texture multiplies it.";
    choice formulas(Formulas), "",
        "Renderer whose formulas hold where renderers differ. With `mitsuba`, the body of a rough \
         `plastic` loses the light that its microfacets scatter more than once; and in the model \
         `disney` a clear coat does not darken the lobes below it and is brighter, and tinted \
         reflections become white by Schlick's formula; slopes of bump maps jump from texel to texel. Scenes of \
         Mitsuba are loaded so.";
    choice roughness_texels(RoughnessTexels), "",
        "Meaning of the texels of the roughness texture, between which it is interpolated: \
         `roughness`, or its square `alpha`, which Mitsuba and pbrt have in theirs.";
    flag by_side(), "",
        "Whether the first of two `parts` is the front of the surface and the second its back. Their \
         `weights` then have no effect.";
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_slot_belongs_to_one_parameter_and_has_a_unique_name() {
        for slot in TextureSlot::ALL {
            assert_eq!(
                MATERIAL_PARAMS
                    .iter()
                    .filter(|row| row.texture == Some(slot))
                    .count(),
                1,
                "{slot:?}"
            );
            assert_eq!(TextureSlot::from_name(slot.name()), Some(slot));
            assert!(MATERIAL_PARAMS.iter().all(|row| row.name != slot.name()));
        }
        let keyed = |row: &&MaterialParam| row.texture.is_some() == row.scn_texture_key.is_empty();
        assert_eq!(MATERIAL_PARAMS.iter().filter(keyed).count(), 0);
    }

    #[test]
    fn every_parameter_returns_what_was_set_and_defaults_are_in_range() {
        for row in MATERIAL_PARAMS {
            let mut m = MaterialDesc::new("m");
            let default = (row.get)(&m);
            row.ty.check("default", row.name, &default).unwrap();
            let other = match row.ty {
                Ty::Nums { len, .. } => {
                    Value::List([Value::Num(0.25), Value::Num(0.5), Value::Int(0)][..len].to_vec())
                }
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
