//! Content hashes of meshes, textures and scenes: canonical blake3 hashes that are equal if two
//! descriptions produce the same image.
//!
//! Every field is written with a fixed width or preceded by its length, so that no two scenes share
//! an encoding. `-0.0` counts as `0.0`. File paths and the names of entities, materials and lights
//! do not affect the image and are left out of a scene's hash: a material is identified by its
//! index.

use blake3::Hasher;
use glam::{DVec3, Vec2, Vec3};

use super::material::MaterialParam;
use super::material_params::SURFACE;
use super::{
    CameraDesc, CameraKind, EntityDesc, EnvironmentSampling, EnvironmentSource, MATERIAL_PARAMS,
    MaterialDesc, MaterialNames, MeshDesc, SceneDesc, ShapeDesc, Texels, ViewWindow, place,
};

/// Version of the sampling of environment maps by their luminance, raised when pictures change.
const LUMINANCE_REVISION: u64 = 2;

/// Version tags of the encodings below. A tag changes with its encoding, so that hashes of
/// different encodings never collide.
const SCENE_TAG: &[u8] = b"lumbre scene 4";
const MESH_TAG: &[u8] = b"lumbre mesh 1";
const TEXTURE_TAG: &[u8] = b"lumbre texture 1";

/// Returns the hash of everything in a scene that affects its image, and of nothing else: equal
/// scenes have equal hashes wherever their files are stored.
///
/// Meshes and textures contribute their stored `content_hash`.
pub fn content_hash(desc: &SceneDesc) -> [u8; 32] {
    hash_scene(desc, Some(&desc.camera))
}

/// Returns the [content hash](content_hash) without the camera: scenes that differ in their camera
/// alone have equal hashes.
pub fn hash_without_camera(desc: &SceneDesc) -> [u8; 32] {
    hash_scene(desc, None)
}

fn hash_scene(desc: &SceneDesc, camera: Option<&CameraDesc>) -> [u8; 32] {
    let mut h = Hasher::new();
    h.update(SCENE_TAG);
    desc.resolution
        .iter()
        .for_each(|n| int(&mut h, u64::from(*n)));
    int(&mut h, u64::from(desc.max_depth));
    if let Some(camera) = camera {
        hash_camera(&mut h, camera);
    }
    let names = desc.material_names();
    int(&mut h, desc.materials.len() as u64);
    desc.materials
        .iter()
        .for_each(|m| hash_material(&mut h, &names, m));
    int(&mut h, desc.entities.len() as u64);
    desc.entities
        .iter()
        .for_each(|e| hash_entity(&mut h, &names, e));
    hash_lights(&mut h, desc);
    if place::origin(desc) != DVec3::ZERO {
        hash_rests(&mut h, desc, camera);
    }
    *h.finalize().as_bytes()
}

/// Writes what single precision leaves of the places in a scene far from the origin; nothing if it
/// leaves nothing.
fn hash_rests(h: &mut Hasher, desc: &SceneDesc, camera: Option<&CameraDesc>) {
    let transforms = desc.entities.iter().map(|e| e.transform).enumerate();
    for (i, transform) in transforms.filter(|(_, t)| *t != t.rounded()) {
        h.update(b"transform");
        int(h, i as u64);
        let (frame, translate) = (transform.frame.to_cols_array(), transform.translate);
        frame
            .into_iter()
            .chain(translate.to_array())
            .for_each(|x| double(h, x));
    }
    let rests = camera.into_iter().flat_map(|c| c.rest);
    let rests = rests.chain(desc.lights.iter().map(|light| light.rest));
    for (i, rest) in rests.enumerate().filter(|(_, rest)| *rest != Vec3::ZERO) {
        h.update(b"rest");
        int(h, i as u64);
        vec3(h, rest);
    }
}

fn hash_camera(h: &mut Hasher, camera: &CameraDesc) {
    for v in [camera.position, camera.target, camera.up] {
        vec3(h, v);
    }
    hash_projection(h, camera);
    if camera.window != ViewWindow::WHOLE {
        h.update(b"window");
        for edge in camera.window.to_array() {
            float(h, edge);
        }
    }
}

/// Writes what determines the rays of a camera, beside its position and orientation. Perspective
/// cameras have no tag, so that their scenes keep the hashes that they had before other kinds
/// existed.
fn hash_projection(h: &mut Hasher, camera: &CameraDesc) {
    match camera.kind {
        CameraKind::Perspective => {
            float(h, camera.view_deg());
            float(h, camera.lens_diameter());
            int(h, u64::from(camera.focus_distance.is_some()));
            float(h, camera.focus_distance.unwrap_or(0.0));
        }
        CameraKind::Orthographic => {
            h.update(b"orthographic");
            float(h, camera.view_height);
        }
        CameraKind::Spherical => {
            h.update(b"spherical");
        }
    }
}

fn hash_lights(h: &mut Hasher, desc: &SceneDesc) {
    int(h, desc.lights.len() as u64);
    for light in &desc.lights {
        let (tag, numbers, words) = light.kind.content();
        int(h, tag);
        numbers.iter().for_each(|x| float(h, *x));
        words.iter().for_each(|word| int(h, *word));
    }
    let Some(environment) = &desc.environment else {
        return int(h, 0);
    };
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
    // Omitted without a map, so that older hashes of such scenes stay.
    let is_map = matches!(environment.source, EnvironmentSource::Map(_));
    if is_map && environment.sampling == EnvironmentSampling::Luminance {
        h.update(b"luminance");
        int(h, LUMINANCE_REVISION);
    }
    // Omitted at its default, like all that is younger.
    if environment.sampling != EnvironmentSampling::default() {
        h.update(b"sampling");
        int(h, environment.sampling as u64);
    }
}

fn hash_material(h: &mut Hasher, names: &MaterialNames, m: &MaterialDesc) {
    let (surface, later) = MATERIAL_PARAMS.split_at(SURFACE.len());
    for param in surface {
        (param.get)(m).hash_into(h);
    }
    int(h, u64::from(m.emitter_reflects));
    int(h, m.textures.len() as u64);
    for (slot, texture) in &m.textures {
        int(h, *slot as u64);
        h.update(&texture.content_hash);
    }
    // Parameters at their defaults are skipped, so that scenes without delays or bumps keep their
    // older hashes.
    let default = MaterialDesc::new("");
    let differs =
        |param: &MaterialParam| param.name != "parts" && (param.get)(m) != (param.get)(&default);
    for (i, param) in later.iter().enumerate().filter(|(_, param)| differs(param)) {
        h.update(b"delay");
        int(h, i as u64);
        (param.get)(m).hash_into(h);
    }
    // A lookup counts only if its slot has a texture.
    for (slot, lookup) in m
        .lookups
        .iter()
        .filter(|(slot, _)| m.texture(*slot).is_some())
    {
        h.update(b"lookup");
        int(h, *slot as u64);
        lookup
            .key()
            .iter()
            .for_each(|word| int(h, u64::from(*word)));
    }
    // The indices of the components count, their names do not; the number of weights is the number
    // of components.
    m.parts
        .iter()
        .for_each(|name| int(h, names.index(name).map_or(u64::MAX, |index| index as u64)));
}

fn hash_entity(h: &mut Hasher, names: &MaterialNames, e: &EntityDesc) {
    let index = |name: &str| names.index(name).unwrap_or(0) as u64;
    vec3(h, e.transform.translate.as_vec3());
    e.transform
        .frame
        .as_affine3a()
        .to_cols_array()
        .iter()
        .for_each(|x| float(h, *x));
    int(h, u64::from(e.anisotropic_direction.is_some()));
    vec3(h, e.anisotropic_direction.unwrap_or(Vec3::ZERO));
    match &e.shape {
        ShapeDesc::Sphere { radius } => {
            int(h, 0);
            float(h, *radius);
            int(h, e.material.as_deref().map_or(0, index));
        }
        ShapeDesc::Mesh(mesh) => {
            int(h, 1);
            vec3(h, e.transform.rotate_rad);
            vec3(h, e.transform.scale);
            h.update(&mesh.content_hash);
            int(h, mesh.slots.len() as u64);
            for slot in &mesh.slots {
                int(h, index(e.material.as_deref().unwrap_or(slot)));
            }
        }
    }
}

/// Returns the hash of a mesh without its file name: the value of `content_hash` of a [`MeshDesc`].
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
    h.update(bytemuck::cast_slice(&little_endian(
        mesh.triangles.as_flattened(),
    )));
    int(&mut h, mesh.slots.len() as u64);
    for slot in &mesh.slots {
        int(&mut h, slot.len() as u64);
        h.update(slot.as_bytes());
    }
    int(&mut h, mesh.triangle_slot.len() as u64);
    h.update(bytemuck::cast_slice(&little_endian(&mesh.triangle_slot)));
    // Empty arrays are skipped, so that meshes without these attributes keep their older hashes.
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
    if !mesh.tangents.is_empty() {
        h.update(b"tangents");
        for t in &mesh.tangents {
            vec3(&mut h, t.truncate());
            float(&mut h, t.w);
        }
    }
    if mesh.origin != DVec3::ZERO {
        h.update(b"origin");
        mesh.origin
            .to_array()
            .iter()
            .for_each(|x| double(&mut h, *x));
    }
    *h.finalize().as_bytes()
}

fn little_endian(words: &[u32]) -> Vec<u32> {
    words.iter().map(|w| w.to_le()).collect()
}

/// Returns the hash of a texture's size and texels: the value of `content_hash` of a
/// [`super::TextureDesc`].
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

fn double(h: &mut Hasher, x: f64) {
    h.update(&x.to_bits().to_le_bytes());
}

fn vec3(h: &mut Hasher, v: Vec3) {
    v.to_array().iter().for_each(|x| float(h, *x));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::desc::{
        CAMERA_KINDS, CameraDesc, ConeDesc, ConeEdge, EnvironmentDesc, LightDesc, LightKind,
        SpotImage, TextureDesc,
    };
    use std::path::PathBuf;
    use std::sync::Arc;

    fn mesh() -> MeshDesc {
        let mut m = MeshDesc {
            file: PathBuf::from("a.obj"),
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            triangles: vec![[0, 1, 2]],
            slots: vec!["m".to_owned()],
            triangle_slot: vec![0],
            ..MeshDesc::default()
        };
        m.content_hash = mesh_hash(&m);
        m
    }

    fn scene() -> SceneDesc {
        SceneDesc {
            resolution: [4, 4],
            max_depth: 3,
            camera: CameraDesc {
                position: Vec3::Z,
                target: Vec3::ZERO,
                ..CameraDesc::default()
            },
            materials: vec![MaterialDesc::new("m"), MaterialDesc::new("n")].into(),
            entities: vec![
                EntityDesc::new("a", ShapeDesc::Mesh(Arc::new(mesh()))),
                EntityDesc::new("s", ShapeDesc::Sphere { radius: 1.0 }),
            ]
            .into(),
            ..SceneDesc::default()
        }
    }

    #[test]
    fn names_and_files_do_not_affect_the_hash_but_material_bindings_do() {
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
        b.entities[0].material = Some("unknown".to_owned());
        assert_eq!(
            content_hash(&a),
            content_hash(&b),
            "an unknown name is the first material"
        );
    }

    #[test]
    fn every_value_of_lights_and_environment_affects_the_hash_but_no_name() {
        fn grey(x: f32) -> Arc<TextureDesc> {
            Arc::new(TextureDesc::new("m", 1, 1, Texels::RgbaF32(vec![[x; 4]])))
        }
        let lit = || {
            let mut s = scene();
            let sun = LightKind::Directional {
                direction: Vec3::X,
                irradiance: Vec3::Y,
            };
            let point = LightKind::Point {
                position: Vec3::X,
                intensity: Vec3::Y,
            };
            let goniometric = LightKind::Goniometric {
                position: Vec3::X,
                intensity: Vec3::Y,
                map: grey(0.5),
                rotation_deg: 0.0,
            };
            s.lights = [sun, point, goniometric]
                .map(|kind| LightDesc::new("l", kind))
                .to_vec();
            let source = EnvironmentSource::Color(Vec3::ONE);
            s.environment = Some(EnvironmentDesc::new(source));
            s
        };
        let changes: [fn(&mut SceneDesc); 11] = [
            |s| {
                s.environment.as_mut().unwrap().sampling = EnvironmentSampling::Uniform;
            },
            |s| {
                s.lights[0].kind = LightKind::Point {
                    position: Vec3::X,
                    intensity: Vec3::Y,
                }
            },
            |s| {
                s.lights[0].kind = LightKind::Directional {
                    direction: Vec3::Z,
                    irradiance: Vec3::Y,
                }
            },
            |s| {
                s.lights[1].kind = LightKind::Point {
                    position: Vec3::X,
                    intensity: Vec3::Z,
                }
            },
            |s| {
                if let LightKind::Goniometric { map, .. } = &mut s.lights[2].kind {
                    *map = grey(0.25);
                }
            },
            |s| {
                if let LightKind::Goniometric { rotation_deg, .. } = &mut s.lights[2].kind {
                    *rotation_deg = 5.0;
                }
            },
            |s| s.lights.truncate(1),
            |s| s.environment = None,
            |s| s.environment.as_mut().unwrap().source = EnvironmentSource::Color(Vec3::X),
            |s| s.environment.as_mut().unwrap().rotation_deg = 1.0,
            |s| s.environment.as_mut().unwrap().scale = 2.0,
        ];
        let mut seen =
            std::collections::BTreeSet::from([content_hash(&lit()), content_hash(&scene())]);
        for change in changes {
            let mut s = lit();
            change(&mut s);
            assert!(
                seen.insert(content_hash(&s)),
                "{:?} {:?}",
                s.lights,
                s.environment
            );
        }
        let mut renamed = lit();
        renamed.lights[0].name = "other".to_owned();
        assert_eq!(content_hash(&renamed), content_hash(&lit()));
    }

    #[test]
    fn the_camera_alone_is_left_out_of_the_hash_without_it() {
        let (a, mut b) = (scene(), scene());
        b.camera.position.x = 2.0;
        b.camera.kind = CAMERA_KINDS[1].0;
        assert_eq!(hash_without_camera(&a), hash_without_camera(&b));
        assert_ne!(hash_without_camera(&a), content_hash(&a));
        b.max_depth += 1;
        assert_ne!(hash_without_camera(&a), hash_without_camera(&b));
    }

    #[test]
    fn a_focus_distance_differs_from_none_even_at_zero() {
        let a = scene();
        let mut b = scene();
        b.camera.focus_distance = Some(0.0);
        assert_ne!(content_hash(&a), content_hash(&b));
    }

    #[test]
    fn a_hash_depends_on_the_kind_of_the_camera_and_what_that_uses() {
        let hash = |kind: CameraKind, change: fn(&mut CameraDesc)| {
            let mut s = scene();
            s.camera.kind = kind;
            change(&mut s.camera);
            content_hash(&s)
        };
        let plain = CAMERA_KINDS.map(|(kind, _)| hash(kind, |_| ()));
        assert!(plain[0] != plain[1] && plain[1] != plain[2] && plain[2] != plain[0]);
        let wider =
            CAMERA_KINDS.map(|(kind, _)| hash(kind, |c| c.optics = c.optics.with_fov_deg(77.0)));
        assert!(wider[0] != plain[0] && wider[1..] == plain[1..]);
        let higher = CAMERA_KINDS.map(|(kind, _)| hash(kind, |c| c.view_height = 77.0));
        assert!(higher[1] != plain[1] && [higher[0], higher[2]] == [plain[0], plain[2]]);
    }

    #[test]
    fn a_mesh_hash_depends_on_every_array() {
        let base = mesh_hash(&mesh());
        let changes: [fn(&mut MeshDesc); 9] = [
            |m| m.positions[0].x = 1.0,
            |m| m.normals = vec![Vec3::Z; 3],
            |m| m.uvs = vec![Vec2::ZERO; 3],
            |m| m.second_uvs = vec![Vec2::ZERO; 3],
            |m| m.tangents = vec![glam::Vec4::X; 3],
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

    #[test]
    fn images_of_spot_lights_count() {
        let spot = |image: Option<(f32, f32)>| {
            let direction = Vec3::NEG_Y;
            let image = image.map(|(texel, angle)| {
                let texels = Texels::RgbaF32(vec![[texel; 4]]);
                let texture = TextureDesc::new("a.exr", 1, 1, texels);
                SpotImage::projected(Arc::new(texture), direction, Vec3::Z, angle)
            });
            let kind = LightKind::Spot {
                position: Vec3::X,
                direction,
                intensity: Vec3::ONE,
                cone: ConeDesc {
                    beam_deg: 10.0,
                    cutoff_deg: 20.0,
                    edge: ConeEdge::Linear,
                },
                image,
            };
            let desc = SceneDesc {
                lights: vec![LightDesc::new("spot", kind)],
                ..SceneDesc::default()
            };
            content_hash(&desc)
        };
        let hashes = [
            None,
            Some((1.0, 30.0)),
            Some((0.5, 30.0)),
            Some((1.0, 31.0)),
        ]
        .map(spot);
        for (i, hash) in hashes.iter().enumerate() {
            assert!(!hashes[..i].contains(hash), "{i}");
        }
    }

    #[test]
    fn the_materials_of_triangles_affect_the_hash_of_a_mesh() {
        let two = |slots: [u32; 2]| MeshDesc {
            triangles: vec![[0, 1, 2], [0, 2, 1]],
            slots: vec!["m".to_owned(), "n".to_owned()],
            triangle_slot: slots.to_vec(),
            ..mesh()
        };
        assert_ne!(mesh_hash(&two([0, 1])), mesh_hash(&two([1, 0])));
        assert_eq!(mesh_hash(&two([0, 1])), mesh_hash(&two([0, 1])));
    }
}
