//! Material rows and the textures they share.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::Vec3;

use super::{Material, NONE, Texture, UvMap};
use crate::scene::Note;
use crate::scene::desc::{DEFAULT_MATERIAL, MaterialDesc, Model, SceneDesc, Texels, TextureDesc, TextureSlot};

/// Rows for every material of the scene, and one default row for a scene without any.
pub(super) fn rows(desc: &SceneDesc, notes: &mut Vec<Note>) -> (Vec<Material>, Vec<Texture>) {
    let mut bank = Bank::default();
    let mut rows: Vec<Material> = desc.materials.iter().map(|m| row(m, &mut bank, notes)).collect();
    if rows.is_empty() {
        rows.push(row(&MaterialDesc::new(DEFAULT_MATERIAL), &mut bank, notes));
    }
    (rows, bank.textures)
}

fn row(m: &MaterialDesc, bank: &mut Bank, notes: &mut Vec<Note>) -> Material {
    let shines = m.emission != Vec3::ZERO;
    let reflects = !shines || m.emitter_reflects;
    let mut texture = |slot: TextureSlot, used: bool| match m.texture(slot) {
        Some(t) if used => bank.index(t, slot, notes),
        _ => NONE,
    };
    Material {
        base_color: m.base_color,
        emission: m.emission,
        roughness: m.roughness,
        metallic: m.metallic,
        opacity: m.opacity,
        ior: m.ior,
        model: m.model,
        subsurface: m.subsurface,
        specular_tint: m.specular_tint,
        anisotropic: m.anisotropic,
        anisotropic_direction: m.anisotropic_direction,
        sheen: m.sheen,
        sheen_tint: m.sheen_tint,
        clearcoat: m.clearcoat,
        clearcoat_gloss: m.clearcoat_gloss,
        smooth_below: m.smooth_below,
        normal_strength: m.normal_strength,
        mask_threshold: m.mask_threshold,
        mask_mode: m.mask_mode,
        shadow_terminator: m.shadow_terminator,
        base_color_texture: texture(TextureSlot::BaseColor, reflects),
        emission_texture: texture(TextureSlot::Emission, shines),
        mask_texture: texture(TextureSlot::Mask, true),
        roughness_texture: texture(TextureSlot::Roughness, reflects && m.model == Model::Disney),
        metallic_texture: texture(TextureSlot::Metallic, reflects),
        opacity_texture: texture(TextureSlot::Opacity, reflects),
        anisotropic_texture: texture(TextureSlot::AnisotropicDirection, reflects && m.anisotropic > 0.0),
        normal_texture: texture(TextureSlot::Normal, reflects && m.normal_strength > 0.0),
        tiling: UvMap { scale: m.tiling, offset: m.uv_offset },
        emitter_reflects: reflects,
    }
}

/// Decoded textures, one per content and way of decoding.
#[derive(Default)]
struct Bank {
    textures: Vec<Texture>,
    /// By content, sRGB decoding, and clamping to 0..=1.
    index: BTreeMap<([u8; 32], bool, bool), u32>,
}

impl Bank {
    fn index(&mut self, desc: &Arc<TextureDesc>, slot: TextureSlot, notes: &mut Vec<Note>) -> u32 {
        // Eight-bit texels are in range whatever their role, so that two colour roles share one copy.
        let stays_in_range = !matches!(slot, TextureSlot::Emission | TextureSlot::Mask);
        let bounded = stays_in_range && matches!(desc.texels, Texels::RgbaF32(_));
        *self.index.entry((desc.content_hash, slot.is_srgb(), bounded)).or_insert_with(|| {
            let mut texture = Texture::decode(desc, slot.is_srgb());
            if bounded && clamp(&mut texture) {
                notes.push(Note {
                    file: desc.file.clone(),
                    place: "image".to_owned(),
                    message: "it holds values outside 0 to 1, which mean nothing to a surface: they are clamped"
                        .to_owned(),
                });
            }
            self.textures.push(texture);
            self.textures.len() as u32 - 1
        })
    }
}

/// Moves texels into 0..=1; says whether any moved.
fn clamp(texture: &mut Texture) -> bool {
    let mut moved = false;
    for x in texture.texels.as_flattened_mut() {
        let inside = x.clamp(0.0, 1.0);
        moved |= inside != *x;
        *x = inside;
    }
    moved
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::scene::desc::{CameraDesc, Optics, texture_hash};

    fn texture(texels: Texels) -> Arc<TextureDesc> {
        let content_hash = texture_hash(1, 1, &texels);
        Arc::new(TextureDesc { file: PathBuf::from("t"), width: 1, height: 1, texels, content_hash })
    }

    fn compiled(materials: Vec<MaterialDesc>) -> (Vec<Material>, Vec<Texture>, Vec<Note>) {
        let camera = CameraDesc {
            position: Vec3::Z,
            target: Vec3::ZERO,
            up: Vec3::Y,
            fov_deg: 45.0,
            aperture: 0.0,
            focus_distance: None,
            optics: Optics::default(),
        };
        let desc = SceneDesc {
            resolution: [1, 1],
            max_depth: 1,
            camera,
            materials,
            entities: vec![],
            lights: vec![],
            environment: None,
        };
        let mut notes = Vec::new();
        let (rows, textures) = rows(&desc, &mut notes);
        (rows, textures, notes)
    }

    #[test]
    fn data_textures_are_linear_and_share_their_texels() {
        let grey = || texture(Texels::Rgba8(vec![[128, 128, 128, 255]]));
        let mut m = MaterialDesc { anisotropic: 0.5, ..MaterialDesc::new("m") };
        m.textures = vec![
            (TextureSlot::Roughness, grey()),
            (TextureSlot::Metallic, grey()),
            (TextureSlot::Opacity, grey()),
            (TextureSlot::AnisotropicDirection, grey()),
            (TextureSlot::Normal, grey()),
        ];
        let (rows, textures, _) = compiled(vec![m]);
        assert_eq!(textures.len(), 1);
        assert_eq!(textures[0].texels[0], [128.0 / 255.0; 3]);
        let r = rows[0];
        let used =
            [r.roughness_texture, r.metallic_texture, r.opacity_texture, r.anisotropic_texture, r.normal_texture];
        assert_eq!(used, [0; 5]);
    }

    #[test]
    fn one_file_in_two_roles_is_decoded_for_each() {
        let grey = || texture(Texels::Rgba8(vec![[128, 128, 128, 255]]));
        let mut a = MaterialDesc::new("a");
        a.textures = vec![(TextureSlot::BaseColor, grey()), (TextureSlot::Mask, grey())];
        let mut b = MaterialDesc { emission: Vec3::ONE, ..MaterialDesc::new("b") };
        b.textures = vec![(TextureSlot::BaseColor, grey()), (TextureSlot::Emission, grey())];
        let (rows, textures, notes) = compiled(vec![a, b]);
        assert_eq!(textures.len(), 2);
        assert!((textures[rows[0].base_color_texture as usize].texels[0][0] - 0.215_86).abs() < 1e-4);
        assert_eq!(textures[rows[0].mask_texture as usize].texels[0][0], 128.0 / 255.0);
        assert_eq!(rows[1].emission_texture, rows[0].base_color_texture);
        assert_eq!((rows[0].emission_texture, rows[1].mask_texture), (NONE, NONE));
        assert!(notes.is_empty());
    }

    #[test]
    fn bright_texels_are_clamped_as_albedo_and_kept_as_light() {
        let bright = || texture(Texels::RgbaF32(vec![[4.0, 0.5, 0.0, 1.0]]));
        let mut m = MaterialDesc { emission: Vec3::ONE, ..MaterialDesc::new("m") };
        m.textures = vec![(TextureSlot::BaseColor, bright()), (TextureSlot::Emission, bright())];
        let (rows, textures, notes) = compiled(vec![m]);
        assert_eq!(textures[rows[0].base_color_texture as usize].texels[0], [1.0, 0.5, 0.0]);
        assert_eq!(textures[rows[0].emission_texture as usize].texels[0], [4.0, 0.5, 0.0]);
        assert_eq!(notes.len(), 1);
    }
}
