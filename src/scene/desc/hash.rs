//! What makes two descriptions the same picture: canonical blake3 hashes of meshes, textures and whole scenes.
//!
//! Every field is written with a fixed width or with its length before it, so that no two scenes share an encoding.
//! `-0.0` counts as `0.0`. File paths and the names of entities, materials and lights do not decide a picture and are left
//! out of a scene's hash: a material counts by its row.

use blake3::Hasher;
use glam::{Vec2, Vec3};

use super::material::{MaterialParam, SURFACE};
use super::{
    EntityDesc, EnvironmentSource, LightKind, MATERIAL_PARAMS, MaterialDesc, MeshDesc, SceneDesc, ShapeDesc, Texels,
};

/// Changes whenever the encoding below does, so that hashes of different encodings never meet.
const SCENE_TAG: &[u8] = b"lumbre scene 4";
const MESH_TAG: &[u8] = b"lumbre mesh 1";
const TEXTURE_TAG: &[u8] = b"lumbre texture 1";

/// The hash of everything in a scene that decides its picture, and of nothing else: equal scenes have equal hashes
/// wherever their files lie.
///
/// Meshes and textures enter through their stored `content_hash`.
pub fn content_hash(desc: &SceneDesc) -> [u8; 32] {
    let mut h = Hasher::new();
    h.update(SCENE_TAG);
    desc.resolution.iter().for_each(|n| int(&mut h, u64::from(*n)));
    int(&mut h, u64::from(desc.max_depth));
    let camera = &desc.camera;
    for v in [camera.position, camera.target, camera.up] {
        vec3(&mut h, v);
    }
    float(&mut h, camera.view_deg());
    float(&mut h, camera.lens_diameter());
    int(&mut h, u64::from(camera.focus_distance.is_some()));
    float(&mut h, camera.focus_distance.unwrap_or(0.0));
    int(&mut h, desc.materials.len() as u64);
    desc.materials.iter().for_each(|m| material(&mut h, desc, m));
    int(&mut h, desc.entities.len() as u64);
    desc.entities.iter().for_each(|e| entity(&mut h, desc, e));
    lights(&mut h, desc);
    *h.finalize().as_bytes()
}

fn lights(h: &mut Hasher, desc: &SceneDesc) {
    int(h, desc.lights.len() as u64);
    for light in &desc.lights {
        let (tag, place, color) = match light.kind {
            LightKind::Spot { position, intensity, .. } => (2, position, intensity),
            LightKind::Point { position, intensity } => (0, position, intensity),
            LightKind::Directional { direction, irradiance } => (1, direction, irradiance),
        };
        int(h, tag);
        vec3(h, place);
        vec3(h, color);
        if let LightKind::Spot { direction, cone, .. } = light.kind {
            vec3(h, direction);
            float(h, cone.beam_deg);
            float(h, cone.cutoff_deg);
            int(h, cone.edge as u64);
        }
    }
    let Some(environment) = &desc.environment else { return int(h, 0) };
    match &environment.source {
        EnvironmentSource::Color(color) => {
            int(h, 1);
            vec3(h, *color);
        }
        EnvironmentSource::Map(map) => {
            int(h, 2);
            h.update(&map.content_hash);
        }
    }
    float(h, environment.rotation_deg);
    float(h, environment.scale);
}

fn material(h: &mut Hasher, desc: &SceneDesc, m: &MaterialDesc) {
    let (surface, later) = MATERIAL_PARAMS.split_at(SURFACE.len());
    for row in surface {
        (row.get)(m).hash_into(h);
    }
    int(h, u64::from(m.emitter_reflects));
    int(h, m.textures.len() as u64);
    for (slot, texture) in &m.textures {
        int(h, *slot as u64);
        h.update(&texture.content_hash);
    }
    // Written only where they say something, so that scenes without delays or bumps keep the hashes that they had before.
    let plain = MaterialDesc::new("");
    let said = |row: &MaterialParam| row.name != "parts" && (row.get)(m) != (row.get)(&plain);
    for (i, row) in later.iter().enumerate().filter(|(_, row)| said(row)) {
        h.update(b"delay");
        int(h, i as u64);
        (row.get)(m).hash_into(h);
    }
    // A lookup counts only where there is a texture.
    for (slot, lookup) in m.lookups.iter().filter(|(slot, _)| m.texture(*slot).is_some()) {
        h.update(b"lookup");
        int(h, *slot as u64);
        lookup.key().iter().for_each(|word| int(h, u64::from(*word)));
    }
    // Names do not count, but whom they mean does; the weights, one for each, say how many there are.
    m.parts.iter().for_each(|name| int(h, desc.material_row(name).map_or(u64::MAX, |row| row as u64)));
}

fn entity(h: &mut Hasher, desc: &SceneDesc, e: &EntityDesc) {
    let row = |name: &str| desc.material_row(name).unwrap_or(0) as u64;
    vec3(h, e.transform.translate);
    e.transform.frame.to_cols_array().iter().for_each(|x| float(h, *x));
    int(h, u64::from(e.anisotropic_direction.is_some()));
    vec3(h, e.anisotropic_direction.unwrap_or(Vec3::ZERO));
    match &e.shape {
        ShapeDesc::Sphere { radius } => {
            int(h, 0);
            float(h, *radius);
            int(h, e.material.as_deref().map_or(0, row));
        }
        ShapeDesc::Mesh(mesh) => {
            int(h, 1);
            vec3(h, e.transform.rotate_rad);
            vec3(h, e.transform.scale);
            h.update(&mesh.content_hash);
            int(h, mesh.slots.len() as u64);
            for slot in &mesh.slots {
                int(h, row(e.material.as_deref().unwrap_or(slot)));
            }
        }
    }
}

/// The hash of a mesh without its file name; what `content_hash` of a [`MeshDesc`] must hold.
pub fn mesh_hash(mesh: &MeshDesc) -> [u8; 32] {
    let mut h = Hasher::new();
    h.update(MESH_TAG);
    int(&mut h, mesh.positions.len() as u64);
    mesh.positions.iter().for_each(|p| vec3(&mut h, *p));
    int(&mut h, mesh.normals.len() as u64);
    mesh.normals.iter().for_each(|n| vec3(&mut h, *n));
    int(&mut h, mesh.uvs.len() as u64);
    for Vec2 { x, y } in &mesh.uvs {
        float(&mut h, *x);
        float(&mut h, *y);
    }
    int(&mut h, mesh.triangles.len() as u64);
    h.update(bytemuck::cast_slice(&little_endian(mesh.triangles.as_flattened())));
    int(&mut h, mesh.slots.len() as u64);
    for slot in &mesh.slots {
        int(&mut h, slot.len() as u64);
        h.update(slot.as_bytes());
    }
    int(&mut h, mesh.triangle_slot.len() as u64);
    h.update(bytemuck::cast_slice(&little_endian(&mesh.triangle_slot)));
    // Written only where there are any, so that meshes without these keep the hashes that they had before.
    if !mesh.colors.is_empty() {
        h.update(b"colors");
        mesh.colors.iter().for_each(|c| vec3(&mut h, *c));
    }
    if !mesh.second_uvs.is_empty() {
        h.update(b"second uvs");
        for Vec2 { x, y } in &mesh.second_uvs {
            float(&mut h, *x);
            float(&mut h, *y);
        }
    }
    *h.finalize().as_bytes()
}

fn little_endian(words: &[u32]) -> Vec<u32> {
    words.iter().map(|w| w.to_le()).collect()
}

/// The hash of a texture's size and texels; what `content_hash` of a [`super::TextureDesc`] must hold.
pub fn texture_hash(width: u32, height: u32, texels: &Texels) -> [u8; 32] {
    let mut h = Hasher::new();
    h.update(TEXTURE_TAG);
    int(&mut h, u64::from(width));
    int(&mut h, u64::from(height));
    match texels {
        Texels::Rgba8(t) => {
            int(&mut h, 8);
            h.update(t.as_flattened());
        }
        Texels::RgbaF32(t) => {
            int(&mut h, 32);
            t.as_flattened().iter().for_each(|x| float(&mut h, *x));
        }
    }
    *h.finalize().as_bytes()
}

fn int(h: &mut Hasher, x: u64) {
    h.update(&x.to_le_bytes());
}

fn float(h: &mut Hasher, x: f32) {
    let x = if x == 0.0 { 0.0 } else { x };
    h.update(&x.to_bits().to_le_bytes());
}

fn vec3(h: &mut Hasher, v: Vec3) {
    v.to_array().iter().for_each(|x| float(h, *x));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::desc::{CameraDesc, EnvironmentDesc, LightDesc, Transform};
    use std::path::PathBuf;
    use std::sync::Arc;

    fn mesh() -> MeshDesc {
        let mut m = MeshDesc {
            file: PathBuf::from("a.obj"),
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            normals: vec![],
            uvs: vec![],
            colors: vec![],
            second_uvs: vec![],
            triangles: vec![[0, 1, 2]],
            slots: vec!["m".to_owned()],
            triangle_slot: vec![0],
            content_hash: [0; 32],
        };
        m.content_hash = mesh_hash(&m);
        m
    }

    fn scene() -> SceneDesc {
        let entity = |name: &str, shape| EntityDesc {
            name: name.to_owned(),
            transform: Transform::default(),
            material: None,
            anisotropic_direction: None,
            shape,
        };
        SceneDesc {
            views: Vec::new(),
            resolution: [4, 4],
            max_depth: 3,
            camera: CameraDesc { position: Vec3::Z, target: Vec3::ZERO, ..CameraDesc::default() },
            materials: vec![MaterialDesc::new("m"), MaterialDesc::new("n")],
            entities: vec![
                entity("a", ShapeDesc::Mesh(Arc::new(mesh()))),
                entity("s", ShapeDesc::Sphere { radius: 1.0 }),
            ],
            lights: vec![],
            environment: None,
        }
    }

    #[test]
    fn names_and_files_do_not_count_but_bindings_do() {
        let a = scene();
        let mut b = scene();
        b.entities[0].name = "elsewhere".to_owned();
        let mut m = mesh();
        m.file = PathBuf::from("b.obj");
        assert_eq!(m.content_hash, mesh_hash(&m));
        b.entities[0].shape = ShapeDesc::Mesh(Arc::new(m));
        b.camera.position.x = -0.0;
        assert_eq!(content_hash(&a), content_hash(&b));
        b.entities[0].material = Some("n".to_owned());
        assert_ne!(content_hash(&a), content_hash(&b));
        b.entities[0].material = Some("nobody".to_owned());
        assert_eq!(content_hash(&a), content_hash(&b), "an unknown name is the first material");
    }

    #[test]
    fn every_value_of_a_light_and_of_the_environment_counts_but_no_name() {
        let lit = || {
            let mut s = scene();
            let sun = LightKind::Directional { direction: Vec3::X, irradiance: Vec3::Y };
            let lamp = LightKind::Point { position: Vec3::X, intensity: Vec3::Y };
            s.lights = [sun, lamp].map(|kind| LightDesc { name: "l".to_owned(), kind }).to_vec();
            let source = EnvironmentSource::Color(Vec3::ONE);
            s.environment = Some(EnvironmentDesc { source, rotation_deg: 0.0, scale: 1.0 });
            s
        };
        let changes: [fn(&mut SceneDesc); 8] = [
            |s| s.lights[0].kind = LightKind::Point { position: Vec3::X, intensity: Vec3::Y },
            |s| s.lights[0].kind = LightKind::Directional { direction: Vec3::Z, irradiance: Vec3::Y },
            |s| s.lights[1].kind = LightKind::Point { position: Vec3::X, intensity: Vec3::Z },
            |s| s.lights.truncate(1),
            |s| s.environment = None,
            |s| s.environment.as_mut().unwrap().source = EnvironmentSource::Color(Vec3::X),
            |s| s.environment.as_mut().unwrap().rotation_deg = 1.0,
            |s| s.environment.as_mut().unwrap().scale = 2.0,
        ];
        let mut seen = std::collections::BTreeSet::from([content_hash(&lit()), content_hash(&scene())]);
        for change in changes {
            let mut s = lit();
            change(&mut s);
            assert!(seen.insert(content_hash(&s)), "{:?} {:?}", s.lights, s.environment);
        }
        let mut renamed = lit();
        renamed.lights[0].name = "other".to_owned();
        assert_eq!(content_hash(&renamed), content_hash(&lit()));
    }

    #[test]
    fn a_focus_distance_differs_from_none_even_at_zero() {
        let a = scene();
        let mut b = scene();
        b.camera.focus_distance = Some(0.0);
        assert_ne!(content_hash(&a), content_hash(&b));
    }

    #[test]
    fn a_mesh_hash_sees_every_array() {
        let base = mesh_hash(&mesh());
        let changes: [fn(&mut MeshDesc); 8] = [
            |m| m.positions[0].x = 1.0,
            |m| m.normals = vec![Vec3::Z; 3],
            |m| m.uvs = vec![Vec2::ZERO; 3],
            |m| m.second_uvs = vec![Vec2::ZERO; 3],
            |m| m.colors = vec![Vec3::ONE; 3],
            |m| m.triangles[0] = [0, 2, 1],
            |m| m.slots[0] = "other".to_owned(),
            |m| m.triangle_slot.clear(),
        ];
        for change in changes {
            let mut m = mesh();
            change(&mut m);
            assert_ne!(mesh_hash(&m), base);
        }
    }
}
