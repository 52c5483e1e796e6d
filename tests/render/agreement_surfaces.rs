//! All integrators render the same picture where surfaces are mapped, cut out or smoothed.

use std::sync::Arc;

use glam::{Vec2, Vec3, Vec4};
use lumbre::scene::CompiledScene;
use lumbre::scene::compile::{MaskMode, Material, Model, Texture, UvMap};

use crate::agreement::{EYE, agree, room};
use crate::common::{SceneBuilder, WHITE, grey, light};

/// A map of bumps: normals tilted by up to 45 degrees in every direction.
fn bumps() -> Texture {
    let n = |i: u32, side: u32| {
        let (x, y) = ((i % side) as f32 / side as f32, (i / side) as f32 / side as f32);
        let tilt = Vec3::new((x * std::f32::consts::TAU).sin(), (y * std::f32::consts::TAU).cos(), 1.0);
        (tilt.normalize_or(Vec3::Z) * 0.5 + 0.5).to_array()
    };
    Texture { width: 8, height: 8, texels: (0..64).map(|i| n(i, 8)).collect() }
}

/// The room with a floor of another material, whose tangents are those of its texture coordinates.
fn floored(builder: SceneBuilder, floor: Material) -> Arc<CompiledScene> {
    let mut scene = Arc::unwrap_or_clone(builder.build());
    scene.tangents = vec![[Vec4::ZERO; 3]; scene.triangles.len()];
    for i in 0..2 {
        scene.tangents[i] = [Vec4::new(1.0, 0.0, 0.0, 1.0); 3];
        scene.materials[scene.attributes[i].material as usize] = floor;
    }
    Arc::new(scene)
}

#[test]
fn normal_mapped_floor() {
    for model in [Model::Lambert, Model::Disney] {
        let mut builder = room(EYE).sphere(Vec3::new(-0.9, 0.9, 0.4), 0.25, light(5.0));
        let map = builder.texture(bumps());
        let tiling = UvMap { scale: 5.0, offset: Vec2::new(0.1, 0.2) };
        let floor = Material { normal_texture: map, tiling, model, roughness: 0.4, ..grey(0.7) };
        agree(&floored(builder, floor), 5, None, 1200);
    }
}

/// A leaf of four by four texels from nothing to all.
fn leaf() -> Texture {
    Texture { width: 4, height: 4, texels: (0..16).map(|i| [(i * 7 % 16) as f32 / 15.0; 3]).collect() }
}

#[test]
fn masked_leaves() {
    for mask_mode in [MaskMode::Threshold, MaskMode::Blend] {
        let mut builder = room(EYE);
        let mask_texture = builder.texture(leaf());
        let leaf = Material { mask_texture, mask_mode, base_color: Vec3::new(0.2, 0.7, 0.2), ..WHITE };
        let lamp = Material { mask_texture, mask_mode, ..light(6.0) };
        let scene = builder
            .quad(Vec3::new(-1.0, 0.5, 0.6), Vec3::X * 1.2, Vec3::new(0.0, 0.9, -0.5), leaf)
            .quad(Vec3::new(0.1, 0.9, -0.3), Vec3::new(1.0, 0.3, 0.4), Vec3::new(0.0, 0.4, 0.8), leaf)
            .quad(Vec3::new(-1.8, 0.4, -1.0), Vec3::Z * 1.2, Vec3::Y * 1.2, lamp)
            .build();
        agree(&scene, 5, None, 1200);
    }
}
