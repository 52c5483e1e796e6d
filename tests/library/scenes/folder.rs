//! Scene folders of thesis S1: small ones with every feature that is read.

use glam::{Vec2, Vec3};
use image::codecs::hdr::HdrEncoder;
use lumbre_light::scene::compile;
use lumbre_light::scene::desc::{EnvironmentSource, LightKind, SceneDesc, TextureSlot};
use lumbre_scene_io::load::{is_folder, load, load_with};

use super::export::picture;
use super::samples::FOLDER as TEMPLATE;
use super::{Folder, QUAD, lines, mesh_of};

/// Returns a folder with these texts: `scene.json` and the files below `Objects`.
fn folder(scene: &str) -> Folder {
    let folder = Folder::new(&[("scene.json", scene)]);
    for name in ["Objects", "Textures", "HDRI"] {
        std::fs::create_dir(folder.path(name)).unwrap();
    }
    folder.write("Objects/floor.obj", QUAD);
    folder
}

fn read(folder: &Folder) -> (SceneDesc, String) {
    let (desc, notes) = folder.load("scene.json").unwrap_or_else(|e| panic!("{e}"));
    (desc, lines(&notes))
}

fn bitmap(folder: &Folder, name: &str, pixel: [u8; 3]) {
    image::RgbImage::from_pixel(2, 2, image::Rgb(pixel))
        .save(folder.path(name))
        .unwrap();
}

#[test]
fn the_template_of_the_thesis_is_read_completely() {
    let place = folder(TEMPLATE);
    bitmap(&place, "Textures/mat1_albedo.bmp", [255, 0, 128]);
    bitmap(&place, "Textures/mat1_roughness.bmp", [51; 3]);
    bitmap(&place, "Textures/mat2_normal.bmp", [128, 128, 255]);
    let (desc, notes) = read(&place);
    assert!(notes.is_empty(), "{notes}");
    let camera = &desc.camera;
    assert_eq!(desc.resolution, [1280, 720]);
    assert_eq!(
        (camera.position, camera.target),
        (Vec3::new(0.0, 1.0, 2.0), Vec3::new(0.0, 1.0, 1.0))
    );
    // 36 mm wide and 20.25 mm high at 50 mm.
    assert!((camera.view_deg() - 2.0 * (10.125f32 / 50.0).atan().to_degrees()).abs() < 1e-4);
    assert!(
        (camera.lens_diameter() - 0.05 / 2.8).abs() < 1e-7 && camera.focus_distance == Some(1.05)
    );
    let material = |name: &str| desc.materials[desc.material_index(name).unwrap()].clone();
    let (one, two) = (material("mat1"), material("mat2"));
    assert_eq!(
        (one.base_color, one.roughness, one.ior),
        (Vec3::ONE, 1.0, 1.5),
        "a texture must replace the colour"
    );
    assert!(
        one.texture(TextureSlot::BaseColor).is_some()
            && one.texture(TextureSlot::Roughness).is_some()
    );
    assert_eq!((two.base_color, two.roughness), (Vec3::X, 0.2));
    assert!(
        two.texture(TextureSlot::Normal).is_some() && two.texture(TextureSlot::BaseColor).is_none()
    );
    let names: Vec<&str> = desc.entities.iter().map(|e| e.name.as_str()).collect();
    assert_eq!(names, ["floor", "floor_2"]);
    assert_eq!(desc.entities[1].material.as_deref(), Some("mat2"));
    let (a, b) = (mesh_of(&desc, 0), mesh_of(&desc, 1));
    assert!(std::sync::Arc::ptr_eq(a, b), "the mesh file was read twice");
    let LightKind::Point {
        position,
        intensity,
    } = desc.lights[0].kind
    else {
        panic!()
    };
    assert_eq!((position, intensity), (Vec3::new(1.0, 2.0, -3.0), Vec3::X));
    assert_eq!(compile(&desc).unwrap().0.triangles.len(), 4);
    let root = place.path("scene.json").parent().unwrap().to_owned();
    assert!(is_folder(&root) && load(&root).unwrap().0 == desc);
}

#[test]
fn missing_keys_have_the_defaults_of_the_program_of_the_thesis() {
    let (desc, notes) = read(&folder(
        "{materials: [{name: 'm', specular: 1}], objects: [{name: 'floor'}], hdri: {}}",
    ));
    assert!(notes.is_empty(), "{notes}");
    assert_eq!(
        (desc.resolution, desc.camera.lens_diameter()),
        ([1280, 720], 0.0)
    );
    assert!((desc.camera.view_deg() - 2.0 * (10.125f32 / 35.0).atan().to_degrees()).abs() < 1e-4);
    let m = &desc.materials[0];
    assert_eq!(
        (m.base_color, m.roughness, m.clearcoat_gloss),
        (Vec3::splat(0.5), 1.0, 0.0)
    );
    assert!(((m.ior - 1.0) / (m.ior + 1.0)).powi(2) - 0.08 < 1e-6);
    let grey = desc.entities[0]
        .material
        .as_deref()
        .and_then(|name| desc.material_index(name))
        .unwrap();
    assert_eq!(desc.materials[grey].base_color, Vec3::splat(0.5));
    assert!(desc.environment.is_none());
    let (desc, _) = read(&folder(
        "{camera: {xRes: 64, yRes: 64, aperture: 2, bokeh: false}}",
    ));
    assert_eq!(desc.camera.lens_diameter(), 0.0);
}

#[test]
fn the_camera_sees_the_same_column_of_the_map_as_in_the_thesis() {
    // Straight ahead, along its +z, the renderer of S1 looks up the column at a quarter of the map
    // plus the offset.
    for (offset, columns) in [("0", [1, 2]), ("0.5", [5, 6]), ("-0.25", [7, 0])] {
        let place = folder(&format!(
            "{{xRes: 1, hdri: {{name: 'sky', xOffset: {offset}}}}}"
        ));
        let mut texels = vec![image::Rgb([0.0f32; 3]); 8];
        columns
            .iter()
            .for_each(|c| texels[*c] = image::Rgb([1.0f32; 3]));
        let file = std::fs::File::create(place.path("HDRI/sky.hdr")).unwrap();
        HdrEncoder::new(file).encode(&texels, 8, 1).unwrap();
        let (desc, _) = read(&place);
        assert!(matches!(
            desc.environment.as_ref().unwrap().source,
            EnvironmentSource::Map(_)
        ));
        let image = picture(&desc);
        let [x, ..] = image.at(image.width / 2, image.height / 2);
        assert!(x > 0.9, "offset {offset}: {x}");
        let behind = SceneDesc {
            camera: lumbre_light::scene::desc::CameraDesc {
                target: Vec3::Z,
                ..desc.camera.clone()
            },
            environment: desc.environment.clone(),
            ..desc
        };
        let dark = picture(&behind);
        assert!(
            dark.at(dark.width / 2, dark.height / 2)[0] < 0.1,
            "offset {offset}"
        );
    }
}

#[test]
fn the_environment_may_be_a_colour() {
    let (desc, _) = read(&folder("{xRes: 1, hdri: {color: {r: 1, g: 2, b: 3}}}"));
    assert_eq!(
        desc.environment.unwrap().source,
        EnvironmentSource::Color(Vec3::new(1.0, 2.0, 3.0))
    );
}

#[test]
fn errors_name_their_key_and_unknown_keys_are_noted() {
    for (scene, words) in [
        (
            "{objects: [{name: 'lost'}]}",
            &["objects[0].name", "lost.obj"][..],
        ),
        (
            "{objects: [{name: '../../etc/passwd'}]}",
            &["objects[0].name", "is not the name of a file"],
        ),
        (
            "{materials: [{name: '/etc/x'}]}",
            &["materials[0]", "is not the name of a file"],
        ),
        (
            "{hdri: {name: 'C:sky'}}",
            &["hdri.name", "is not the name of a file"],
        ),
        ("{materials: [{}]}", &["materials[0]", "`name`"]),
        ("{camera: {xRes: 1.5}}", &["camera.xRes", "whole number"]),
        (
            "{camera: {focalLength: 0}}",
            &["camera.focalLength", "positive"],
        ),
        (
            "{camera: {position: [0, 1, 2]}}",
            &["camera.position", "expected {x"],
        ),
        (
            "{pointLights: [{radiance: {r: -1}}]}",
            &[
                "pointLights[0].radiance",
                "expected a radiance of 0 or more",
            ],
        ),
        ("{'a' : ", &["line 1, column 8", "end of the file"]),
    ] {
        let error = folder(scene).load("scene.json").unwrap_err().to_string();
        assert!(words.iter().all(|w| error.contains(w)), "{scene}: {error}");
    }
    let (_, notes) = read(&folder(
        "{objekts: [], materials: [{name: 'm', roughnes: 1, albedo: {r: 2}}]}",
    ));
    assert!(
        notes.contains("objects") && notes.contains("roughness") && notes.contains("outside"),
        "{notes}"
    );
}

#[test]
fn textures_that_cannot_be_read_are_refused_or_noted() {
    let place = folder("{materials: [{name: 'm'}]}");
    place.write("Textures/m_albedo.bmp", "BM");
    let e = place.load("scene.json").unwrap_err().to_string();
    assert!(
        e.contains("m_albedo.bmp") && e.contains("`--lenient`"),
        "{e}"
    );
    let (desc, notes) = load_with(
        &place.path("scene.json"),
        lumbre_scene_io::load::MissingTextures::Note,
    )
    .unwrap();
    assert!(desc.materials[0].textures.is_empty() && lines(&notes).contains("m_albedo.bmp"));
    assert_eq!(desc.materials[0].uv_offset, Vec2::ZERO);
}
