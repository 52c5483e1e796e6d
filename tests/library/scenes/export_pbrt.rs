//! Exports to pbrt, imported by this project's loader: the same materials, the same primitives, and
//! from the same samples the same picture.

use std::sync::Arc;

use lumbre_light::film::Image;
use lumbre_light::scene::desc::{
    Distribution, EnvironmentDesc, EnvironmentSource, LightDesc, LightKind, MaskMode, MaterialDesc,
    Model, RoughnessTexels, SceneDesc, Texels, TextureDesc, TextureSlot, Wrap,
};
use lumbre_light::scene::{CompiledScene, compile};
use lumbre_scene_io::export;
use lumbre_scene_io::load::load;

use glam::{Affine2, Vec2, Vec3};
use lumbre_light::scene::desc::Lookup;

use super::export::{different_pixels, gallery, material, render_nee, stored};
use super::third_party::shared;
use super::{builtin_path, lines};

/// Returns a scene after export and import, and the notes of both.
fn round_trip(desc: &SceneDesc) -> (SceneDesc, String) {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("p");
    let exported = export::pbrt(desc, &folder).unwrap();
    assert_eq!(exported.files.last(), Some(&exported.scene));
    assert!(export::can_replace(&folder));
    let (imported, notes) = load(&exported.scene).unwrap_or_else(|e| panic!("{e}"));
    (
        imported,
        format!("{}{}", lines(&exported.notes), lines(&notes)),
    )
}

/// Returns every material parameter that pbrt has, as materials.
fn exact() -> Vec<MaterialDesc> {
    let grain = || Some(stored([[90; 4], [200; 4], [160; 4], [250; 4]]));
    let diffuse = |m: &mut MaterialDesc| m.model = Model::Lambert;
    vec![
        material("clay", |m| {
            diffuse(m);
            m.base_color = Vec3::new(0.7, 0.4, 0.2);
        }),
        material("tiled", |m| {
            diffuse(m);
            let tile = stored([[255; 4], [200, 40, 0, 255], [0, 90, 200, 255], [60; 4]]);
            let lookup = Lookup {
                wrap: [Wrap::Clamp; 2],
                map: Some(Affine2::from_scale_angle_translation(
                    Vec2::new(2.0, 3.0),
                    0.0,
                    Vec2::new(0.25, -0.5),
                )),
                ..Lookup::default()
            };
            m.set_mapped_texture(TextureSlot::BaseColor, tile, lookup);
        }),
        material("brass", |m| {
            (m.model, m.roughness) = (Model::Conductor, 0.4);
            (m.eta, m.k) = (Vec3::new(0.4, 0.5, 1.1), Vec3::new(3.6, 2.7, 1.8));
        }),
        material("brushed", |m| {
            (m.model, m.roughness, m.anisotropic) = (Model::Conductor, 0.5, 0.6);
        }),
        material("mirror", |m| {
            (m.model, m.roughness) = (Model::Conductor, 0.0)
        }),
        material("worn", |m| {
            m.roughness_texels = RoughnessTexels::Alpha;
            m.model = Model::Conductor;
            m.set_texture(TextureSlot::Roughness, grain());
        }),
        material("lacquer", |m| {
            (m.model, m.roughness, m.nonlinear, m.ior) = (Model::Plastic, 0.0, true, 1.6);
            m.base_color = Vec3::new(0.2, 0.5, 0.3);
        }),
        material("satin", |m| {
            (m.model, m.roughness, m.nonlinear) = (Model::Plastic, 0.5, true);
            m.base_color = Vec3::new(0.9, 0.5, 0.3);
        }),
        material("glass", |m| {
            (m.model, m.roughness, m.opacity) = (Model::Dielectric, 0.0, 0.0)
        }),
        material("frost", |m| {
            (m.model, m.roughness, m.opacity) = (Model::Dielectric, 0.5, 0.0)
        }),
        material("pane", |m| {
            (m.model, m.roughness, m.opacity, m.thin) = (Model::Dielectric, 0.0, 0.0, true);
        }),
        material("paper", |m| {
            m.model = Model::Translucent;
            (m.base_color, m.transmittance) = (Vec3::new(0.5, 0.3, 0.2), Vec3::new(0.2, 0.3, 0.4));
        }),
        material("veined", |m| {
            (m.model, m.base_color) = (Model::Translucent, Vec3::splat(0.3));
            m.transmittance = Vec3::ONE;
            m.set_texture(TextureSlot::Transmittance, grain());
        }),
        material("dented", |m| {
            diffuse(m);
            m.bump_height = 0.3;
            m.set_texture(TextureSlot::Bump, grain());
        }),
        material("carved", |m| {
            diffuse(m);
            let slanted = [
                [128, 128, 255, 255],
                [190, 128, 230, 255],
                [128, 70, 230, 255],
                [128, 128, 255, 255],
            ];
            m.set_texture(TextureSlot::Normal, Some(stored(slanted)));
        }),
        material("leaf", |m| {
            diffuse(m);
            m.mask_mode = MaskMode::Blend;
            m.set_texture(TextureSlot::Mask, grain());
        }),
    ]
}

/// Returns a gallery under light that pbrt supports exactly.
fn plain_gallery(materials: Vec<MaterialDesc>) -> SceneDesc {
    let mut desc = gallery(materials);
    desc.lights.retain(|light| light.name != "spot");
    desc.environment = Some(EnvironmentDesc {
        scale: 2.0,
        ..EnvironmentDesc::new(EnvironmentSource::Color(Vec3::new(0.3, 0.4, 0.5)))
    });
    desc
}

#[test]
fn every_material_parameter_of_pbrt_is_the_same_after_export_and_import() {
    for m in exact() {
        let mut desc = plain_gallery(vec![
            m.clone(),
            material("wall", |m| m.model = Model::Lambert),
        ]);
        // Textured spheres become meshes, whose hits differ by more than rounding.
        desc.entities
            .retain(|e| !e.name.starts_with("ball") || m.textures.is_empty());
        let (imported, notes) = round_trip(&desc);
        let own = |line: &&str| line.contains("not supported by pbrt") || line.contains("left out");
        let lost: Vec<&str> = notes.lines().filter(own).collect();
        assert!(lost.is_empty(), "{}: {lost:?}", m.name);
        // A mask makes a copy of the material for the shapes that have it.
        let name = imported.entities[0].material.clone().unwrap();
        let n = &imported.materials[imported.material_index(&name).unwrap()];
        let near = |a: f32, b: f32| (a - b).abs() < 1e-5;
        assert_eq!(
            (n.model, n.thin, n.nonlinear, n.mask_mode),
            (m.model, m.thin, m.nonlinear, m.mask_mode)
        );
        assert_eq!(
            (n.base_color, n.eta, n.k, n.ior),
            (m.base_color, m.eta, m.k, m.ior),
            "{}",
            m.name
        );
        let rough = m.model != Model::Lambert && m.texture(TextureSlot::Roughness).is_none();
        assert!(
            !rough || near(n.roughness, m.roughness),
            "{}: {}",
            m.name,
            n.roughness
        );
        assert!(
            near(n.anisotropic, m.anisotropic),
            "{}: {}",
            m.name,
            n.anisotropic
        );
        let wrong = different_pixels(&desc, &imported);
        // The bits of a ray decide which hits of a blended mask count.
        let masked = m.texture(TextureSlot::Mask).is_some();
        assert!(
            wrong <= if masked { 150 } else { 15 },
            "{}: {wrong} of 1536 pixels differ",
            m.name
        );
    }
}

#[test]
fn goniometric_lights_have_the_same_directions_after_export_and_import() {
    let mut desc = plain_gallery(vec![material("wall", |m| m.model = Model::Lambert)]);
    desc.environment = None;
    // The quarter of the map right of its middle, which is +z, is white, at all heights.
    let texel = |x: u32| {
        [if (32..48).contains(&(x % 64)) {
            1.0
        } else {
            0.25
        }; 4]
    };
    let texels = Texels::RgbaF32((0..64 * 32).map(texel).collect());
    let map = Arc::new(TextureDesc::new("m.exr", 64, 32, texels));
    let lamp = LightKind::Goniometric {
        position: Vec3::new(0.5, 1.0, 5.0),
        intensity: Vec3::new(20.0, 15.0, 9.0),
        map,
        rotation_deg: 70.0,
    };
    desc.lights = vec![LightDesc::new("lamp", lamp)];
    let (imported, notes) = round_trip(&desc);
    assert!(
        notes.contains("equal areas") && !notes.contains("not supported"),
        "{notes}"
    );
    let LightKind::Goniometric { position, .. } = imported.lights[0].kind else {
        panic!("{:?}", imported.lights)
    };
    assert!(position.distance(Vec3::new(0.5, 1.0, 5.0)) < 1e-5);
    // Both resamplings blur edges of the map.
    let wrong = different_pixels(&desc, &imported);
    assert!(wrong < 200, "{wrong} of 1536 pixels differ");
    let mitsuba = tempfile::tempdir().unwrap();
    let exported = export::mitsuba(&desc, &mitsuba.path().join("m")).unwrap();
    let notes = lines(&exported.notes);
    assert!(notes.contains("a point light of the same power"), "{notes}");
    let (imported, _) = load(&exported.scene).unwrap();
    let LightKind::Point { intensity, .. } = imported.lights[0].kind else {
        panic!("{:?}", imported.lights)
    };
    let mean = 0.25 + 0.75 * 0.25;
    assert!(
        (intensity.x / (20.0 * mean) - 1.0).abs() < 0.01,
        "{intensity}"
    );
}

#[test]
fn emission_and_compositions_are_the_same_after_export_and_import() {
    let lamp = |name: &str, reflects| {
        material(name, |m| {
            (m.model, m.emission) = (Model::Lambert, Vec3::new(2.0, 1.0, 0.5));
            m.emitter_reflects = reflects;
        })
    };
    let shown = material("screen", |m| {
        (m.model, m.emission) = (Model::Lambert, Vec3::ONE);
        let image = stored([[255; 4], [0, 0, 0, 255], [128; 4], [255; 4]]);
        let lookup = Lookup {
            wrap: [Wrap::Clamp; 2],
            ..Lookup::default()
        };
        m.set_mapped_texture(TextureSlot::Emission, image, lookup);
    });
    let mut desc = plain_gallery(vec![
        lamp("mute", false),
        lamp("bright", true),
        shown,
        material("red", |m| {
            (m.model, m.base_color) = (Model::Lambert, Vec3::X)
        }),
        material("blue", |m| {
            (m.model, m.base_color) = (Model::Lambert, Vec3::Z)
        }),
        material("both", |m| {
            (m.parts, m.weights) = (vec!["red".into(), "blue".into()], vec![0.25, 0.75]);
        }),
    ]);
    (desc.lights, desc.environment) = (vec![], None);
    desc.entities.retain(|e| !e.name.starts_with("ball"));
    let (imported, notes) = round_trip(&desc);
    assert!(!notes.contains("not supported by pbrt"), "{notes}");
    let both = &imported.materials[imported.material_index("both").unwrap()];
    assert_eq!(
        (&both.parts, &both.weights),
        (&desc.materials[5].parts, &vec![0.25, 0.75])
    );
    let wrong = different_pixels(&desc, &imported);
    assert!(wrong <= 15, "{wrong} of 1536 pixels differ");
}

#[test]
fn what_pbrt_lacks_is_a_note_that_names_the_material() {
    let odd = material("odd", |m| {
        (m.model, m.one_sided, m.shadow_terminator) = (Model::Conductor, true, true);
        m.specular = Vec3::splat(0.5);
    });
    let mixed = material("mixed", |m| {
        (m.model, m.metallic, m.opacity) = (Model::Lambert, 0.3, 0.4)
    });
    let mut desc = gallery(vec![odd, mixed, MaterialDesc::new("disney")]);
    desc.views.push(("side".to_owned(), desc.camera.clone()));
    let (imported, notes) = round_trip(&desc);
    for (place, what) in [
        ("materials.odd", "one_sided"),
        ("materials.odd", "shadow_terminator"),
        ("materials.odd", "specular"),
        ("materials.disney", "the model `disney`"),
        ("views.side", "one camera"),
        ("lights.spot", "falloff"),
        ("environment", "resampled"),
    ] {
        let found = notes
            .lines()
            .any(|n| n.starts_with(place) && n.contains(what));
        assert!(found, "{place} {what}: {notes}");
    }
    // Metal over a mix of glass and a body, by their weights.
    let mixed = &imported.materials[imported.material_index("mixed").unwrap()];
    assert_eq!(mixed.weights, [0.7, 0.3]);
    let inner = &imported.materials[imported.material_index(&mixed.parts[0]).unwrap()];
    assert_eq!(inner.weights, [0.6, 0.4]);
}

/// Returns means of blocks of a picture, and its mean.
fn blocks(image: &Image, side: usize) -> (Vec<f32>, f32) {
    let (width, height) = (image.width as usize, image.height as usize);
    let mut means = Vec::new();
    for y in (0..height / side * side).step_by(side) {
        for x in (0..width / side * side).step_by(side) {
            let rows = (y..y + side).flat_map(|y| &image.data[y * width + x..y * width + x + side]);
            let sum: f32 = rows.flatten().sum();
            means.push(sum / (3 * side * side) as f32);
        }
    }
    let mean = means.iter().sum::<f32>() / means.len() as f32;
    (means, mean)
}

/// Compares small pictures of two scenes: returns the ratio of their means, and the median relative
/// difference of blocks of 4 by 4 pixels.
fn compared(a: &SceneDesc, b: &SceneDesc, size: [u32; 2], depth: u32, samples: u64) -> (f32, f32) {
    let [(a, mean_a), (b, mean_b)] =
        [a, b].map(|desc| blocks(&render_nee(desc, size, depth, samples), 4));
    let mut apart: Vec<f32> = a
        .iter()
        .zip(&b)
        .map(|(a, b)| (a - b).abs() / (a.max(*b) + 0.01 * mean_a))
        .collect();
    apart.sort_by(f32::total_cmp);
    (mean_b / mean_a, apart[apart.len() / 2])
}

fn primitives(s: &CompiledScene) -> (usize, usize, usize) {
    (s.triangles.len(), s.spheres.len(), s.emitters.len())
}

/// Compares scenes that Bitterli published for Mitsuba and for pbrt.
#[test]
fn third_party_scenes_of_pbrt_agree_with_those_of_mitsuba() {
    for (name, pbrt, xml, size, error) in [
        ("cornell-box", "scene.pbrt", "scene.xml", [64, 64], 0.001),
        (
            "bedroom",
            "scene_local.pbrt",
            "scene_local.xml",
            [64, 36],
            0.05,
        ),
    ] {
        let Some(folder) = shared(&format!("scenes/{name}")) else {
            return;
        };
        let [(a, _), (b, notes)] =
            [xml, pbrt].map(|file| load(&folder.join(file)).unwrap_or_else(|e| panic!("{e}")));
        let [x, y] = [&a, &b].map(|desc| compile(desc).unwrap().0);
        assert_eq!(primitives(&x), primitives(&y), "{name}");
        for (p, q) in x.bounds.iter().zip(y.bounds) {
            assert!(p.distance(q) < 1e-4, "{name}: {p} {q}");
        }
        assert_eq!(a.resolution, b.resolution);
        let (ratio, block) = compared(&a, &b, size, 9, 64);
        println!("{name}: ratio {ratio}, blocks {block}\n{}", lines(&notes));
        assert!(
            (ratio - 1.0).abs() < error && block < 2.0 * error,
            "{name}: {ratio} {block}"
        );
    }
}

/// Replaces what pbrt lacks by what the export replaces it by: GGX instead of Beckmann, metals and
/// interfaces that reflect fully.
fn as_pbrt_has_it(desc: &SceneDesc) -> SceneDesc {
    let mut desc = desc.clone();
    for m in &mut desc.materials {
        if matches!(
            m.model,
            Model::Conductor | Model::Plastic | Model::Dielectric
        ) {
            (m.distribution, m.specular) = (Distribution::Ggx, Vec3::ONE);
        }
        if m.model == Model::Conductor {
            m.base_color = Vec3::ONE;
        }
    }
    desc
}

/// Compares scenes of Mitsuba with the same after export to pbrt and import: as they are, with
/// differences that the models explain, and without what pbrt lacks, where none is left.
#[test]
fn third_party_scenes_of_mitsuba_are_the_same_after_export_to_pbrt() {
    let Some(folder) = shared("scenes") else {
        return;
    };
    for (file, size, explained) in [
        ("cornell-box/scene.xml", [32, 32], 0.001),
        // pbrt has neither the distribution nor the factors of these metals.
        ("veach-mis/scene.xml", [64, 36], 0.15),
        // The lamps are of metal with the distribution `beckmann`, which pbrt lacks.
        ("veach-bidir/scene.xml", [32, 32], 0.05),
    ] {
        let (desc, _) = load(&folder.join(file)).unwrap();
        for (desc, error) in [(as_pbrt_has_it(&desc), 0.001), (desc, explained)] {
            let (imported, notes) = round_trip(&desc);
            let [x, y] = [&desc, &imported].map(|desc| compile(desc).unwrap().0);
            assert_eq!(primitives(&x), primitives(&y), "{file}");
            let (ratio, block) = compared(&desc, &imported, size, 5, 64);
            println!("{file}: ratio {ratio}, blocks {block}\n{notes}");
            assert!(
                (ratio - 1.0).abs() < error && block < 2.0 * error,
                "{file}: {ratio} {block}"
            );
        }
    }
}

#[test]
fn builtin_scenes_have_the_same_primitives_after_export_to_pbrt() {
    for name in [
        "cornell_spheres/cornell_spheres.scn",
        "veach_lamps/veach_lamps.scn",
        "masked_leaves/masked_leaves.scn",
    ] {
        let (desc, _) = load(&builtin_path(name)).unwrap_or_else(|e| panic!("{e}"));
        let (imported, _) = round_trip(&desc);
        let [a, b] = [&desc, &imported].map(|desc| compile(desc).unwrap().0);
        assert_eq!(primitives(&a), primitives(&b), "{name}");
        let size = (a.bounds[1] - a.bounds[0]).length();
        let near = |(p, q): (&Vec3, &Vec3)| p.distance(*q) < 1e-5 * size;
        assert!(a.bounds.iter().zip(&b.bounds).all(near), "{name}");
        let area = |s: &CompiledScene| s.emitters.iter().map(|e| f64::from(e.area)).sum::<f64>();
        assert!((area(&a) / area(&b) - 1.0).abs() < 1e-5, "{name}");
    }
}

#[test]
fn the_lens_and_instances_are_the_same_after_export_to_pbrt() {
    let mut desc = plain_gallery(vec![material("wall", |m| m.model = Model::Lambert)]);
    (desc.camera.optics, desc.camera.focus_distance) =
        (desc.camera.optics.with_aperture(0.3), Some(7.0));
    desc.resolution = [40, 64];
    let tile = desc.entities[0].clone();
    for i in 0..3 {
        let mut copy = tile.clone();
        copy.name = format!("copy {i}");
        copy.transform.translate = Vec3::new(0.4 * i as f32 - 1.0, 0.5 * i as f32, -1.0).as_dvec3();
        desc.entities.push(copy);
    }
    let dir = tempfile::tempdir().unwrap();
    let exported = export::pbrt(&desc, dir.path()).unwrap();
    let text = std::fs::read_to_string(&exported.scene).unwrap();
    let count = |what: &str| text.matches(what).count();
    assert_eq!(
        (
            count("ObjectBegin"),
            count("ObjectInstance"),
            count("plymesh")
        ),
        (1, 4, 1)
    );
    let (imported, notes) = round_trip(&desc);
    assert_eq!(imported.camera.lens_diameter(), 0.3, "{notes}");
    assert!((imported.camera.view_deg() - desc.camera.view_deg()).abs() < 1e-4);
    assert_eq!(
        (imported.resolution, imported.max_depth),
        (desc.resolution, desc.max_depth)
    );
    let wrong = different_pixels(&desc, &imported);
    assert!(wrong <= 15, "{wrong} of 1536 pixels differ");
}
