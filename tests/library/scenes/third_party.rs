//! Third-party scenes, if they are present.

use std::path::{Path, PathBuf};

use glam::Vec3;
use lumbre::cli::verify::pictures;
use lumbre_light::scene::compile::NONE;
use lumbre_light::scene::desc::TextureSlot;
use lumbre_light::scene::{Note, compile};
use lumbre_light::value::Value;
use lumbre_lua::scene;
use lumbre_scene_io::load::{MissingTextures, load, load_with};

/// Returns a path in the folder of shared third-party data, if this machine has it.
pub(super) fn shared(what: &str) -> Option<PathBuf> {
    let root = std::env::var_os("LUMBRE_SHARED").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared"),
        PathBuf::from,
    );
    let path = root.join(what);
    if path.exists() {
        return Some(path);
    }
    crate::common::skipped(format_args!("{} is not on this machine", path.display()));
    None
}

/// Returns the files with an extension below a folder, sorted.
pub(super) fn files_below(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let files = crate::common::files_below(folder).into_iter();
    files
        .filter(|path| path.extension().is_some_and(|e| e == extension))
        .collect()
}

#[test]
fn every_third_party_scn_loads_and_compiles() {
    let Some(folder) = shared("scenes/vkraytracing") else {
        return;
    };
    let files = files_below(&folder, "scn");
    assert_eq!(files.len(), 79);
    for file in files {
        let (desc, _) = load(&file).unwrap_or_else(|e| panic!("{e}"));
        let (scene, notes) = compile(&desc).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        assert!(
            !scene.emitters.is_empty(),
            "{} has no light",
            file.display()
        );
        assert!(!notes.iter().any(|n| n.message.contains("black")));
        for (i, points) in (0..).zip(&scene.triangles) {
            let front = (points[1] - points[0])
                .cross(points[2] - points[0])
                .normalize_or(Vec3::ZERO);
            for n in scene.normals.at(i) {
                assert!(
                    (n.length() - 1.0).abs() < 1e-5 && n.dot(front) > -1e-4,
                    "{}",
                    file.display()
                );
            }
        }
        for e in &scene.emitters {
            let material = scene.materials[scene.material_of(e.primitive, NONE) as usize];
            assert!(
                e.area > 0.0 && material.emission.max_element() > 0.0 && !material.emitter_reflects
            );
        }
    }
}

#[test]
fn the_original_cornell_box_has_the_counts_and_orientation_of_its_reference() {
    let Some(file) = shared("scenes/vkraytracing/cornellbox_original.scn") else {
        return;
    };
    let (desc, notes) = load(&file).unwrap();
    assert!(notes.is_empty(), "{notes:?}");
    let (scene, notes) = compile(&desc).unwrap();
    assert!(notes.is_empty(), "{notes:?}");
    assert_eq!(
        (
            scene.triangles.len(),
            scene.spheres.len(),
            scene.emitters.len()
        ),
        (36, 0, 2)
    );
    assert_eq!((scene.resolution, scene.max_depth), ([1280, 720], 5));
    assert_eq!(
        (scene.camera.view_deg(), scene.camera.position),
        (60.0, Vec3::new(0.0, 0.7, 2.2))
    );
    let area: f32 = scene.emitters.iter().map(|e| e.area).sum();
    assert!((area - 0.47 * 0.38).abs() < 1e-6, "{area}");
    for e in &scene.emitters {
        let [a, b, c] = scene.triangles[e.primitive as usize];
        assert!((b - a).cross(c - a).y < 0.0, "the light does not face down");
    }
}

#[test]
fn unusual_keys_of_third_party_scenes_are_read_or_noted() {
    let Some(folder) = shared("scenes/vkraytracing") else {
        return;
    };
    let all = |name: &str| {
        let (desc, mut notes) = load(&folder.join(name)).unwrap();
        notes.extend(compile(&desc).unwrap().1);
        notes.iter().map(|n| format!("{n}\n")).collect::<String>()
    };
    let bubble = all("cornellbox_bubble.scn");
    assert!(
        bubble.contains("cornellbox_bubble.scn: entities[2].inverted_normal"),
        "{bubble}"
    );
    let alt = all("Bidirectional/veach_lamps_alt.scn");
    assert!(
        alt.contains("veach_lamps_alt.obj: line") && alt.contains("line and point elements"),
        "{alt}"
    );
    let specular = all("DisneyTest/specular.scn");
    assert!(
        specular.contains(".ior: 0 is outside 0.01 to 100; 0.01 is used"),
        "{specular}"
    );
    let (desc, _) = load(&folder.join("BRDF/brdf.scn")).unwrap();
    let sky = &desc.materials[desc.material_index("Paredes").unwrap()];
    assert_eq!(
        sky.textures.len(),
        2,
        "the albedo texture of a light must also colour its emission"
    );
}

#[test]
fn third_party_meshes_load_as_scenes() {
    let Some(folder) = shared("scenes") else {
        return;
    };
    let files = files_below(&folder, "obj");
    assert!(files.len() > 30);
    let (mut lit, mut cut_out) = (0, 0);
    for file in files {
        // Some of their textures are missing, or named by paths of another machine.
        let (desc, _) = load_with(&file, MissingTextures::Note).unwrap_or_else(|e| panic!("{e}"));
        let (scene, notes) = compile(&desc).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        assert!(!scene.triangles.is_empty(), "{}", file.display());
        let dark = notes
            .iter()
            .any(|n| n.message.contains("nothing emits light"));
        assert_eq!(dark, scene.emitters.is_empty(), "{}", file.display());
        lit += usize::from(!dark);
        cut_out += usize::from(scene.materials.iter().any(|m| m.mask_texture != NONE));
    }
    assert!(
        lit > 0 && cut_out > 0,
        "no material file has lights ({lit}) or masks ({cut_out})"
    );
}

#[test]
fn third_party_mitsuba_scenes_load_without_notes() {
    let Some(folder) = shared("scenes") else {
        return;
    };
    for (file, triangles, lights, depth) in [
        ("cornell-box/scene.xml", 36, 2, 30),
        ("veach-bidir/scene.xml", 11_544, 4, 7),
        ("veach-mis/scene.xml", 52, 3, 3),
        ("bedroom/scene_local.xml", 449_344, 4, 65),
    ] {
        let (desc, notes) = load(&folder.join(file)).unwrap_or_else(|e| panic!("{e}"));
        // The masks of Mitsuba count as edges.
        let is_model =
            |note: &Note| note.message.contains(" %") || note.message.contains("holes of a mask");
        assert!(notes.iter().all(is_model), "{file}: {notes:?}");
        let (scene, _) = compile(&desc).unwrap();
        assert_eq!(
            (scene.triangles.len(), scene.emitters.len(), scene.max_depth),
            (triangles, lights, depth),
            "{file}"
        );
    }
}

/// Compares Bitterli's scenes with the pictures that Tungsten rendered, by the check of `lumbre
/// verify`: those whose noise is low enough for the samples of a test. docs/reference/formats.md
/// lists all.
#[test]
fn third_party_scenes_agree_with_their_reference_pictures() {
    let Some(folder) = shared("scenes") else {
        return;
    };
    // Lights of veach-mis that are smaller than these pixels make its mean noisy: blocks are more
    // precise.
    for (name, samples, error, block) in [
        ("cornell-box", 64, 0.003, 0.02),
        ("veach-mis", 256, 0.05, 0.01),
    ] {
        let row = pictures::KNOWN_PICTURES
            .iter()
            .find(|row| row.name() == name)
            .unwrap();
        let found = row.compare(&folder, 16, samples, 5, 0).unwrap();
        assert!(
            found.error < error && found.block < block,
            "{name}: {found:?}"
        );
        assert!(row.agrees(&found), "{name}: {found:?}");
        // With one edge less or more the pictures differ.
        let other = pictures::KnownPicture {
            max_depth: if name == "veach-mis" { 3 } else { 4 },
            ..*row
        };
        let found = other.compare(&folder, 16, samples, 5, 0).unwrap();
        assert!(found.block > 2.0 * block, "{name}: {found:?}");
    }
}

#[test]
fn a_lua_scene_imports_sponza_with_all_its_textures() {
    let Some(folder) = shared("scenes/sponza") else {
        return;
    };
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/library/scenes/sponza.lua");
    let folder = folder.canonicalize().unwrap();
    let options = [("folder", folder.to_str().unwrap()), ("light", "lamps")];
    let options = options
        .map(|(key, value)| (key.to_owned(), Value::from(value)))
        .into();
    let (desc, notes) =
        scene::read(&file, &options, MissingTextures::Note).unwrap_or_else(|e| panic!("{e}"));
    let note_count = |what: &str| notes.iter().filter(|n| n.message.contains(what)).count();
    assert_eq!(
        note_count("gi_flag"),
        1,
        "the texture of the banner, which is not distributed"
    );
    assert_eq!(
        (
            note_count("contains normals"),
            note_count("its height is 1 scene unit")
        ),
        (8, 1),
        "{notes:?}"
    );
    let filled = |slot| {
        desc.materials
            .iter()
            .filter(|m| m.texture(slot).is_some())
            .count()
    };
    assert_eq!(
        (
            filled(TextureSlot::Mask),
            filled(TextureSlot::Normal),
            filled(TextureSlot::Bump)
        ),
        (3, 8, 1)
    );
    let (scene, _) = compile(&desc).unwrap();
    assert!(
        (278_000..=279_163).contains(&scene.triangles.len()),
        "{}",
        scene.triangles.len()
    );
    let [low, high] = scene.bounds;
    assert!(
        (low - Vec3::new(-19.21, -1.26, -11.83)).length() < 0.01,
        "{low}"
    );
    assert!(
        (high - Vec3::new(18.0, 14.3, 11.05)).length() < 0.01,
        "{high}"
    );
    assert_eq!((desc.views.len(), scene.emitters.len()), (2, 10));
}
