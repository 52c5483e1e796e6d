//! Materials of a scene, compiled.

use glam::Vec3;

use super::delays::{self, Delays};
use super::rough_interface::RoughInterface;
use super::texture_bank::TextureBank;
use super::{Interface, Material, NONE, Texture, UvMap};
use crate::scene::desc::{
    DEFAULT_MATERIAL, Formulas, MATERIAL_PARAMS, MaterialDesc, Model, SceneDesc, ShadingNormals,
    TextureSlot,
};
use crate::scene::{Note, SceneError};
use crate::value::Value;
use crate::value::schema::{SchemaError, Ty};

/// Compiled materials, their textures, and their components and profiles.
type CompiledMaterials = (Vec<Material>, Vec<Texture>, Delays);

/// Compiles every material of the scene, or one default material for a scene without any.
///
/// # Errors
/// Fails for a parameter that is not finite or out of range, which loaders and edits never produce.
pub(super) fn compile(
    desc: &SceneDesc,
    notes: &mut Vec<Note>,
) -> Result<CompiledMaterials, SceneError> {
    desc.materials.iter().try_for_each(check)?;
    let mut bank = TextureBank::default();
    let mut materials: Vec<Material> = desc
        .materials
        .iter()
        .map(|m| compile_material(m, &mut bank, notes))
        .collect();
    if materials.is_empty() {
        let default = MaterialDesc::new(DEFAULT_MATERIAL);
        materials.push(compile_material(&default, &mut bank, notes));
    }
    let delays = delays::compile(desc, &mut materials, &mut bank, notes)?;
    Ok((materials, bank.textures, delays))
}

/// Checks that every number of a material is finite and in range.
fn check(m: &MaterialDesc) -> Result<(), SchemaError> {
    for row in MATERIAL_PARAMS {
        let (Ty::Num { min, max } | Ty::Nums { min, max, .. }) = row.ty else {
            continue;
        };
        let value = (row.get)(m);
        // A bound that `f32` cannot represent is satisfied by the nearest number.
        let slack = |bound: f64| f64::from(f32::EPSILON) * bound.abs();
        let fits = |x: &Value| {
            x.as_f64()
                .is_some_and(|x| x >= min - slack(min) && x <= max + slack(max))
        };
        if !value
            .as_list()
            .map_or_else(|| fits(&value), |items| items.iter().all(fits))
        {
            return Err(SchemaError::new(
                format!("materials.{}.{}", m.name, row.name),
                row.name,
                format!("{value} is out of range; expected {}", row.ty.describe()),
            ));
        }
    }
    Ok(())
}

fn compile_material(m: &MaterialDesc, bank: &mut TextureBank, notes: &mut Vec<Note>) -> Material {
    let emits = m.emission != Vec3::ZERO;
    let reflects = !emits || m.emitter_reflects;
    let translucent = m.model == Model::Translucent;
    let smooth = m.shading_normals == ShadingNormals::Smooth;
    notes.extend(excess_note(m));
    notes.extend(constant_transmittance_note(m));
    let mut texture = |slot: TextureSlot, used: bool| {
        if used {
            bank.index(m, slot, notes)
        } else {
            NONE
        }
    };
    Material {
        base_color: m.base_color,
        emission: m.emission,
        roughness: m.roughness,
        metallic: m.metallic,
        opacity: m.opacity,
        transmittance: m.transmittance,
        ior: m.ior,
        model: m.model,
        formulas: m.formulas,
        roughness_texels: m.roughness_texels,
        subsurface: m.subsurface,
        specular_tint: m.specular_tint,
        anisotropic: m.anisotropic,
        anisotropic_direction: m.anisotropic_direction,
        sheen: m.sheen,
        sheen_tint: m.sheen_tint,
        clearcoat: m.clearcoat,
        clearcoat_gloss: m.clearcoat_gloss,
        smooth_below: m.smooth_below,
        one_sided: m.one_sided,
        normal_strength: m.normal_strength,
        bump_height: m.bump_height,
        mask_threshold: m.mask_threshold,
        mask_mode: m.mask_mode,
        // A path that continues on the other side would hit the surface again.
        shadow_terminator: m.shadow_terminator && smooth && !translucent,
        flat_normals: !smooth,
        base_color_texture: texture(TextureSlot::BaseColor, reflects),
        emission_texture: texture(TextureSlot::Emission, emits),
        mask_texture: texture(TextureSlot::Mask, true),
        roughness_texture: texture(TextureSlot::Roughness, reflects && m.model.has_roughness()),
        metallic_texture: texture(TextureSlot::Metallic, reflects && m.model.has_mixture()),
        opacity_texture: texture(TextureSlot::Opacity, reflects && m.model.has_mixture()),
        transmittance_texture: texture(TextureSlot::Transmittance, reflects && translucent),
        anisotropic_texture: texture(
            TextureSlot::AnisotropicDirection,
            reflects && m.anisotropic > 0.0,
        ),
        normal_texture: texture(
            TextureSlot::Normal,
            reflects && smooth && m.normal_strength > 0.0,
        ),
        bump_texture: texture(
            TextureSlot::Bump,
            reflects && smooth && m.bump_height != 0.0,
        ),
        tiling: UvMap {
            scale: m.tiling,
            offset: m.uv_offset,
        },
        emitter_reflects: reflects,
        interface: compile_interface(m),
    }
}

/// Returns the note about a translucent sheet that returns more light than it receives; `None` if
/// textures may keep the sum below 1.
fn excess_note(m: &MaterialDesc) -> Option<Note> {
    let slots = [TextureSlot::BaseColor, TextureSlot::Transmittance];
    let plain = slots.iter().all(|slot| m.texture(*slot).is_none());
    let exceeds = (m.base_color + m.transmittance).max_element() > 1.0;
    let message = "`base_color` and `transmittance` add up to more than 1: the sheet returns more \
                   light than it receives";
    (m.model == Model::Translucent && plain && exceeds)
        .then(|| Note::new("", format!("materials.{}", m.name), message))
}

/// Returns whether the transmittance of a plastic's interface is that of its microfacets.
fn has_rough_body(m: &MaterialDesc) -> bool {
    m.model == Model::Plastic
        && m.formulas == Formulas::Mitsuba
        && m.roughness >= m.smooth_below
        && m.roughness > 0.0
}

/// Returns the note about a plastic whose transmittance does not follow the texture of its
/// roughness.
fn constant_transmittance_note(m: &MaterialDesc) -> Option<Note> {
    let textured = m.texture(TextureSlot::Roughness).is_some();
    let message = "with `formulas` of `mitsuba`, light passes a plastic's interface as its parameter \
                   `roughness` lets it, whatever the texture";
    (textured && has_rough_body(m)).then(|| Note::new("", format!("materials.{}", m.name), message))
}

fn compile_interface(m: &MaterialDesc) -> Interface {
    let rough = has_rough_body(m).then(|| {
        let alpha = f64::from(m.roughness).powi(2);
        RoughInterface::new(m.distribution, alpha, f64::from(m.ior))
    });
    Interface {
        specular: m.specular,
        eta: m.eta,
        k: m.k,
        distribution: m.distribution,
        thin: m.thin,
        nonlinear: m.nonlinear,
        // The interface transmits equally in both directions, but outwards only from 1 / ior^2 of
        // the solid angle.
        internal_reflectance: match &rough {
            Some(rough) => rough.internal_reflectance(),
            None if m.model == Model::Plastic => {
                1.0 - (1.0 - diffuse_reflectance(m.ior)) / (m.ior * m.ior)
            }
            None => 0.0,
        },
        transmittance: rough.map(|rough| rough.transmittance()),
    }
}

/// Returns the fraction of diffuse light that a smooth dielectric of this index reflects from
/// outside: the mean of the Fresnel equations over the projected hemisphere, in closed form
/// [Duntley 1942].
pub fn diffuse_reflectance(ior: f32) -> f32 {
    let n = f64::from(ior);
    if (n - 1.0).abs() < 1e-3 {
        return 0.0;
    }
    if n < 1.0 {
        return (1.0 - (1.0 - f64::from(diffuse_reflectance((1.0 / n) as f32))) * n * n) as f32;
    }
    let (n2, n4) = (n * n, n.powi(4));
    let sum = 0.5
        + (n - 1.0) * (3.0 * n + 1.0) / (6.0 * (n + 1.0).powi(2))
        + n2 * (n2 - 1.0).powi(2) / (n2 + 1.0).powi(3) * ((n - 1.0) / (n + 1.0)).ln()
        - 2.0 * n.powi(3) * (n2 + 2.0 * n - 1.0) / ((n2 + 1.0) * (n4 - 1.0))
        + 8.0 * n4 * (n4 + 1.0) / ((n2 + 1.0) * (n4 - 1.0).powi(2)) * n.ln();
    sum.clamp(0.0, 1.0) as f32
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;
    use std::sync::Arc;

    use glam::{Affine2, Vec2};

    use super::*;
    use crate::scene::desc::{
        CameraDesc, Lookup, Texels, TextureDesc, TextureFilter, Wrap, texture_hash,
    };

    fn texture(texels: Texels) -> Arc<TextureDesc> {
        let content_hash = texture_hash(1, 1, &texels);
        Arc::new(TextureDesc {
            file: PathBuf::from("t"),
            width: 1,
            height: 1,
            texels,
            content_hash,
        })
    }

    fn scene(materials: Vec<MaterialDesc>) -> SceneDesc {
        let camera = CameraDesc {
            position: Vec3::Z,
            target: Vec3::ZERO,
            ..CameraDesc::default()
        };
        SceneDesc {
            resolution: [1, 1],
            max_depth: 1,
            camera,
            materials: materials.into(),
            ..SceneDesc::default()
        }
    }

    fn compiled(materials: Vec<MaterialDesc>) -> (Vec<Material>, Vec<Texture>, Vec<Note>) {
        let mut notes = Vec::new();
        let (rows, textures, _) = compile(&scene(materials), &mut notes).unwrap();
        (rows, textures, notes)
    }

    #[test]
    fn values_out_of_range_are_errors_that_name_material_and_parameter() {
        type Break = (&'static str, fn(&mut MaterialDesc));
        let breaks: [Break; 7] = [
            ("roughness", |m| m.roughness = f32::NAN),
            ("roughness", |m| m.roughness = -0.1),
            ("ior", |m| m.ior = 0.0),
            ("ior", |m| m.ior = -1.5),
            ("base_color", |m| m.base_color.y = f32::NAN),
            ("emission", |m| m.emission.x = f32::INFINITY),
            ("tiling", |m| m.tiling = f32::INFINITY),
        ];
        for (name, change) in breaks {
            let mut m = MaterialDesc::new("oak");
            change(&mut m);
            let e = compile(&scene(vec![MaterialDesc::new("fine"), m]), &mut Vec::new())
                .unwrap_err()
                .to_string();
            assert!(e.contains(&format!("materials.oak.{name}")), "{e}");
        }
        let edge = MaterialDesc {
            ior: crate::scene::desc::material_params::MIN_IOR as f32,
            ..MaterialDesc::new("m")
        };
        assert!(compile(&scene(vec![edge]), &mut Vec::new()).is_ok());
    }

    #[test]
    fn data_textures_are_linear_and_share_their_texels() {
        let grey = || texture(Texels::Rgba8(vec![[128, 128, 128, 255]].into()));
        let mut m = MaterialDesc {
            anisotropic: 0.5,
            ..MaterialDesc::new("m")
        };
        m.textures = vec![
            (TextureSlot::Roughness, grey()),
            (TextureSlot::Metallic, grey()),
            (TextureSlot::Opacity, grey()),
            (TextureSlot::AnisotropicDirection, grey()),
            (TextureSlot::Normal, grey()),
        ];
        let (rows, textures, _) = compiled(vec![m]);
        assert_eq!(textures.len(), 1);
        assert_eq!(textures[0].texels.at(0), [128.0 / 255.0; 3]);
        let r = rows[0];
        let used = [
            r.roughness_texture,
            r.metallic_texture,
            r.opacity_texture,
            r.anisotropic_texture,
            r.normal_texture,
        ];
        assert_eq!(used, [0; 5]);
    }

    #[test]
    fn a_sheet_that_returns_more_light_than_it_receives_is_noted() {
        let notes = |base_color: f32, transmittance: f32, model| {
            let sheet = MaterialDesc {
                base_color: Vec3::splat(base_color),
                transmittance: Vec3::new(0.0, transmittance, 0.0),
                model,
                ..MaterialDesc::new("paper")
            };
            let mut notes = Vec::new();
            compile(&scene(vec![sheet]), &mut notes).unwrap();
            notes.iter().map(Note::to_string).collect::<Vec<_>>()
        };
        assert!(notes(0.5, 0.5, Model::Translucent).is_empty());
        assert!(notes(0.5, 0.6, Model::Lambert).is_empty());
        let all = notes(0.5, 0.6, Model::Translucent);
        assert!(
            all.len() == 1 && all[0].starts_with("materials.paper:"),
            "{all:?}"
        );
    }

    #[test]
    fn a_file_in_two_slots_is_decoded_for_each() {
        let grey = || texture(Texels::Rgba8(vec![[128, 128, 128, 255]].into()));
        let mut a = MaterialDesc::new("a");
        a.textures = vec![
            (TextureSlot::BaseColor, grey()),
            (TextureSlot::Mask, grey()),
        ];
        let mut b = MaterialDesc {
            emission: Vec3::ONE,
            ..MaterialDesc::new("b")
        };
        b.textures = vec![
            (TextureSlot::BaseColor, grey()),
            (TextureSlot::Emission, grey()),
        ];
        let (rows, textures, notes) = compiled(vec![a, b]);
        assert_eq!(textures.len(), 2);
        assert!(
            (textures[rows[0].base_color_texture as usize].texels.at(0)[0] - 0.215_86).abs() < 1e-4
        );
        assert_eq!(
            textures[rows[0].mask_texture as usize].texels.at(0)[0],
            128.0 / 255.0
        );
        assert_eq!(rows[1].emission_texture, rows[0].base_color_texture);
        assert_eq!(
            (rows[0].emission_texture, rows[1].mask_texture),
            (NONE, NONE)
        );
        assert!(notes.is_empty());
    }

    #[test]
    fn bright_texels_are_clamped_as_base_color_but_not_as_emission() {
        let bright = || texture(Texels::RgbaF32(vec![[4.0, 0.5, 0.0, 1.0]]));
        let mut m = MaterialDesc {
            emission: Vec3::ONE,
            ..MaterialDesc::new("m")
        };
        m.textures = vec![
            (TextureSlot::BaseColor, bright()),
            (TextureSlot::Emission, bright()),
        ];
        let (rows, textures, notes) = compiled(vec![m]);
        assert_eq!(
            textures[rows[0].base_color_texture as usize].texels.at(0),
            [1.0, 0.5, 0.0]
        );
        assert_eq!(
            textures[rows[0].emission_texture as usize].texels.at(0),
            [4.0, 0.5, 0.0]
        );
        assert_eq!(notes.len(), 1);
    }

    #[test]
    fn negative_emission_is_black_and_noted() {
        let mut m = MaterialDesc {
            emission: Vec3::ONE,
            ..MaterialDesc::new("m")
        };
        m.textures = vec![(
            TextureSlot::Emission,
            texture(Texels::RgbaF32(vec![[4.0, -0.5, 0.0, 1.0]])),
        )];
        let (rows, textures, notes) = compiled(vec![m]);
        assert_eq!(
            textures[rows[0].emission_texture as usize].texels.at(0),
            [4.0, 0.0, 0.0]
        );
        assert!(
            notes.len() == 1 && notes[0].message.contains("negative"),
            "{notes:?}"
        );
    }
    #[test]
    fn textures_of_one_image_keep_their_own_mappings() {
        let grey = || texture(Texels::Rgba8(vec![[128, 128, 128, 255]].into()));
        let lookups = [
            Lookup::default(),
            Lookup {
                wrap: [Wrap::Clamp, Wrap::Mirror],
                ..Lookup::default()
            },
            Lookup {
                filter: TextureFilter::Nearest,
                ..Lookup::default()
            },
            Lookup {
                second: true,
                ..Lookup::default()
            },
            Lookup {
                map: Some(Affine2::from_scale(Vec2::splat(2.0))),
                ..Lookup::default()
            },
        ];
        let materials = lookups.map(|lookup| {
            let mut m = MaterialDesc::new("m");
            m.set_mapped_texture(TextureSlot::BaseColor, grey(), lookup);
            m
        });
        let (rows, textures, _) = compiled(materials.to_vec());
        for (row, lookup) in rows.iter().zip(lookups) {
            assert_eq!(textures[row.base_color_texture as usize].lookup, lookup);
        }
    }

    /// Returns the reflectance of a dielectric for a ray inside with a cosine, from Fresnel's
    /// amplitudes.
    fn reflected_inside(cos: f64, ior: f64) -> f64 {
        let sin_outside = ior * (1.0 - cos * cos).sqrt();
        if sin_outside >= 1.0 {
            return 1.0;
        }
        let outside = (1.0 - sin_outside * sin_outside).sqrt();
        let s = (ior * cos - outside) / (ior * cos + outside);
        let p = (cos - ior * outside) / (cos + ior * outside);
        0.5 * (s * s + p * p)
    }

    #[test]
    fn plastic_reflects_diffuse_light_internally_by_the_mean_of_the_fresnel_equations() {
        for ior in [1.3f32, 1.5, 2.4] {
            let plastic = MaterialDesc {
                model: Model::Plastic,
                ior,
                ..MaterialDesc::new("m")
            };
            let (rows, ..) = compiled(vec![plastic]);
            let n = 20_000;
            let mean = |i: i32| {
                let cos = (f64::from(i) + 0.5) / f64::from(n);
                2.0 * cos * reflected_inside(cos, f64::from(ior)) / f64::from(n)
            };
            let expected = (0..n).map(mean).sum::<f64>();
            let found = f64::from(rows[0].interface.internal_reflectance);
            assert!(
                (found - expected).abs() < 1e-3,
                "{ior}: {found}, expected {expected}"
            );
        }
    }
}
