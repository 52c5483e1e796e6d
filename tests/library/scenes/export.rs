//! Exports to Mitsuba, imported by this project's loader: the same samples give the same picture,
//! and the primitives are the same.

use std::sync::Arc;

use glam::{Affine2, Affine3A, DAffine3, DVec3, Quat, Vec2, Vec3};
use lumbre_light::film::Image;
use lumbre_light::scene::compile;
use lumbre_light::scene::desc::place::double;
use lumbre_light::scene::desc::{
    ConeDesc, ConeEdge, Distribution, EntityDesc, EnvironmentDesc, EnvironmentSource, Formulas,
    LightDesc, LightKind, Lookup, MaskMode, MaterialDesc, Model, RoughnessTexels, SceneDesc,
    ShapeDesc, Texels, TextureDesc, TextureSlot, Transform, Wrap,
};
use lumbre_light::scene::shape::{cuboid, grid};
use lumbre_light::transport::integrator::integrator;
use lumbre_light::transport::sampler::SOBOL;
use lumbre_render::{Job, Renderer, cpu::renderer::CpuRenderer};
use lumbre_scene_io::export;

use super::{Folder, builtin_path, lines, scn};
use crate::common::job;

/// Returns whether a note states a difference of a model from Mitsuba, or a sphere as a mesh.
fn is_expected(note: &str) -> bool {
    [
        "becomes a mesh",
        " %",
        "not supported by Mitsuba",
        "holes of a mask",
    ]
    .iter()
    .any(|words| note.contains(words))
}

/// Returns a scene after export and import, and the notes of both.
fn round_trip(desc: &SceneDesc) -> (SceneDesc, String) {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("m");
    let exported = export::mitsuba(desc, &folder).unwrap();
    assert!(
        exported.files.iter().all(|f| f.is_file())
            && exported.files.last() == Some(&exported.scene)
    );
    assert!(export::can_replace(&folder));
    let (mut imported, notes) =
        lumbre_scene_io::load::load(&exported.scene).unwrap_or_else(|e| panic!("{e}"));
    // Files of Mitsuba are loaded with its formulas, where they matter.
    for material in &mut imported.materials {
        material.formulas = Formulas::Lumbre;
    }
    (
        imported,
        format!("{}{}", lines(&exported.notes), lines(&notes)),
    )
}

/// Width and height of compared pictures.
pub(super) const PICTURE: [u32; 2] = [48, 32];

/// Renders a small picture by `nee`.
pub(super) fn picture(desc: &SceneDesc) -> Image {
    render_nee(desc, PICTURE, 5, 4)
}

/// Renders a picture by `nee`.
pub(super) fn render_nee(
    desc: &SceneDesc,
    resolution: [u32; 2],
    max_depth: u32,
    samples: u64,
) -> Image {
    let (scene, _) = compile(desc).unwrap();
    let job = Job {
        integrator: integrator("nee").unwrap(),
        sampler: SOBOL,
        ..job(resolution, max_depth, 7)
    };
    let mut renderer = CpuRenderer::new(Arc::new(scene), job).unwrap();
    renderer.advance(samples).unwrap();
    renderer.film().mean()
}

/// Compares pictures of the same samples. They agree to 1 in 1000, except in a few pixels where a
/// path diverged by rounding.
fn assert_same_picture(a: &SceneDesc, b: &SceneDesc) {
    let wrong = different_pixels(a, b);
    assert!(wrong <= 15, "{wrong} of 1536 pixels differ");
}

pub(super) fn different_pixels(a: &SceneDesc, b: &SceneDesc) -> usize {
    let (a, b) = (picture(a), picture(b));
    let scale = a.data.as_flattened().iter().sum::<f32>() / a.data.as_flattened().len() as f32;
    assert!(scale > 0.0, "the picture is black");
    let far = |(p, q): (&[f32; 3], &[f32; 3])| {
        (0..3).any(|i| (p[i] - q[i]).abs() > 1e-3 * (p[i].abs() + scale))
    };
    a.data.iter().zip(&b.data).filter(|pair| far(*pair)).count()
}

fn texture(name: &str, texels: Texels) -> Arc<TextureDesc> {
    Arc::new(TextureDesc::new(name, 2, 2, texels))
}

pub(super) fn stored(texels: [[u8; 4]; 4]) -> Arc<TextureDesc> {
    texture("stored.png", Texels::Rgba8(texels.to_vec().into()))
}

/// Returns a room with one wall of each material, lit by every kind of light.
pub(super) fn gallery(materials: Vec<MaterialDesc>) -> SceneDesc {
    let (mut desc, _) = scn(r#"{"maxdepth": 5}"#).unwrap();
    desc.camera.position = Vec3::new(0.0, 1.0, 9.0);
    desc.camera.target = Vec3::new(0.0, 0.0, 0.0);
    desc.camera.optics = desc.camera.optics.with_fov_deg(50.0);
    let count = materials.len() as f32;
    let tile = Arc::new(
        grid(Vec2::splat(1.6), [4, 4])
            .unwrap()
            .into_mesh("tile.obj".into(), "m"),
    );
    for (i, m) in materials.iter().enumerate() {
        let turn = Quat::from_rotation_x(1.2) * Quat::from_rotation_y(0.1 * i as f32);
        let at = Vec3::new(1.9 * (i as f32 - (count - 1.0) / 2.0), 0.0, 0.0);
        desc.entities.push(EntityDesc {
            name: format!("tile {i}"),
            transform: Transform::framed(double(Affine3A::from_rotation_translation(turn, at))),
            material: Some(m.name.clone()),
            anisotropic_direction: None,
            shape: ShapeDesc::Mesh(tile.clone()),
        });
        desc.entities.push(EntityDesc {
            name: format!("ball {i}"),
            transform: Transform {
                translate: (at + Vec3::new(0.0, 2.0, 0.0)).as_dvec3(),
                ..Transform::default()
            },
            material: Some(m.name.clone()),
            anisotropic_direction: None,
            shape: ShapeDesc::Sphere { radius: 0.7 },
        });
    }
    let light = |name: &str, kind| LightDesc::new(name, kind);
    desc.lights = vec![
        light(
            "bulb",
            LightKind::Point {
                position: Vec3::new(1.0, 5.0, 4.0),
                intensity: Vec3::new(20.0, 15.0, 9.0),
            },
        ),
        light(
            "spot",
            LightKind::Spot {
                position: Vec3::new(-2.0, 4.0, 5.0),
                direction: Vec3::new(1.0, -2.0, -3.0),
                intensity: Vec3::splat(30.0),
                cone: ConeDesc {
                    beam_deg: 12.0,
                    cutoff_deg: 25.0,
                    edge: ConeEdge::Linear,
                },
                image: None,
            },
        ),
        light(
            "sun",
            LightKind::Directional {
                direction: Vec3::new(1.0, -2.0, -1.0),
                irradiance: Vec3::splat(0.7),
            },
        ),
    ];
    // With as many rows the map is written as it is.
    let rows = [[3.0, 2.0, 1.0, 1.0], [0.5; 4], [0.1; 4], [0.0; 4]];
    let rows: Vec<[f32; 4]> = (0..192).map(|i| rows[i % 4]).collect();
    let sky = Arc::new(TextureDesc::new("sky.hdr", 2, 96, Texels::RgbaF32(rows)));
    desc.environment = Some(EnvironmentDesc {
        rotation_deg: 70.0,
        scale: 0.5,
        ..EnvironmentDesc::new(EnvironmentSource::Map(sky))
    });
    desc.materials = materials.into();
    desc
}

pub(super) fn material(name: &str, change: impl FnOnce(&mut MaterialDesc)) -> MaterialDesc {
    let mut m = MaterialDesc::new(name);
    change(&mut m);
    m
}

#[test]
fn surfaces_give_the_same_picture_after_export_and_import() {
    let grain = || {
        stored([
            [200, 90, 40, 255],
            [90, 220, 100, 255],
            [255; 4],
            [30, 60, 200, 255],
        ])
    };
    let bumps = || {
        stored([
            [150, 140, 240, 255],
            [110, 120, 250, 255],
            [128, 128, 255, 255],
            [128, 160, 240, 255],
        ])
    };
    let all = vec![
        material("Disney; painted", |m| {
            (m.base_color, m.roughness, m.clearcoat, m.sheen) =
                (Vec3::new(0.8, 0.3, 0.9), 0.4, 0.5, 0.3);
            (m.tiling, m.uv_offset) = (3.0, Vec2::new(0.25, 0.5));
            m.set_texture(TextureSlot::BaseColor, Some(grain()));
            m.set_texture(TextureSlot::Roughness, Some(grain()));
        }),
        material("three ways", |m| {
            (m.tiling, m.uv_offset) = (2.0, Vec2::new(0.25, 0.5));
            m.set_texture(TextureSlot::BaseColor, Some(grain()));
            let map = Affine2::from_scale_angle_translation(
                Vec2::new(0.7, 1.6),
                0.5,
                Vec2::new(0.1, -0.4),
            );
            let lookup = Lookup {
                wrap: [Wrap::Mirror; 2],
                filter: Default::default(),
                second: false,
                map: Some(map),
            };
            m.set_mapped_texture(TextureSlot::Roughness, grain(), lookup);
            m.set_mapped_texture(
                TextureSlot::Metallic,
                grain(),
                Lookup {
                    wrap: [Wrap::Clamp; 2],
                    ..Lookup::default()
                },
            );
        }),
        material("brass", |m| {
            (m.metallic, m.roughness, m.anisotropic) = (1.0, 0.35, 0.8);
            m.base_color = Vec3::new(0.9, 0.7, 0.3);
        }),
        material("glass", |m| {
            (m.opacity, m.roughness, m.ior) = (0.0, 0.2, 1.4)
        }),
        material("chalk", |m| {
            (m.model, m.base_color) = (Model::Lambert, Vec3::splat(0.6));
            m.set_texture(TextureSlot::Normal, Some(bumps()));
            m.normal_strength = 1.5;
        }),
        material("hammered", |m| {
            (m.model, m.base_color, m.bump_height) = (Model::Lambert, Vec3::splat(0.6), -0.05);
            (m.tiling, m.uv_offset) = (2.0, Vec2::new(0.25, 0.5));
            m.set_texture(TextureSlot::Bump, Some(grain()));
        }),
        material("copper", |m| {
            (m.model, m.roughness, m.distribution) =
                (Model::Conductor, 0.5, Distribution::Beckmann);
            (m.eta, m.k) = (Vec3::new(0.2, 0.92, 1.1), Vec3::new(3.9, 2.45, 2.14));
            m.specular = Vec3::splat(0.9);
        }),
        material("worn", |m| {
            m.roughness_texels = RoughnessTexels::Alpha;
            (m.model, m.roughness) = (Model::Conductor, 0.5);
            m.set_texture(TextureSlot::Roughness, Some(grain()));
        }),
        material("lacquer", |m| {
            (m.model, m.roughness, m.nonlinear) = (Model::Plastic, 0.0, true);
            m.base_color = Vec3::new(0.2, 0.5, 0.3);
        }),
        material("leaf", |m| {
            (m.model, m.mask_mode) = (Model::Lambert, MaskMode::Blend);
            m.set_texture(TextureSlot::Mask, Some(grain()));
        }),
        material("pane", |m| {
            (m.model, m.thin, m.roughness) = (Model::Dielectric, true, 0.0)
        }),
        material("frost", |m| {
            (m.model, m.opacity, m.roughness) = (Model::Dielectric, 0.0, 0.5)
        }),
    ];
    for m in &all {
        let desc = gallery(vec![m.clone(), MaterialDesc::new("wall")]);
        let (imported, _) = round_trip(&desc);
        let wrong = different_pixels(&desc, &imported);
        // The bits of a ray decide which hits of a blended mask count, so rays with other bits give
        // another sample of the same picture.
        let most = if m.texture(TextureSlot::Mask).is_some() {
            150
        } else {
            15
        };
        assert!(wrong <= most, "{}: {wrong} of 1536 pixels differ", m.name);
    }
    let desc = gallery(all);
    let (imported, notes) = round_trip(&desc);
    let unexpected: Vec<&str> = notes.lines().filter(|note| !is_expected(note)).collect();
    assert!(unexpected.is_empty(), "{unexpected:?}");
    assert!(imported.material_index("Disney__painted").is_some());
    assert_eq!(
        (
            imported.lights.len(),
            imported.resolution,
            imported.max_depth
        ),
        (3, desc.resolution, 5)
    );
}

#[test]
fn emission_gives_the_same_picture_whether_or_not_the_surface_reflects() {
    let lamp = |name: &str, reflects| {
        material(name, |m| {
            (m.emission, m.emitter_reflects) = (Vec3::new(2.0, 1.0, 0.5), reflects);
            m.set_texture(
                TextureSlot::Emission,
                Some(stored([[255; 4], [0, 0, 0, 255], [128; 4], [255; 4]])),
            );
        })
    };
    let mut desc = gallery(vec![
        lamp("mute", false),
        lamp("bright", true),
        MaterialDesc::new("wall"),
    ]);
    (desc.lights, desc.environment) = (vec![], None);
    // Textured spheres become meshes, whose light is sampled by other numbers.
    desc.entities
        .retain(|entity| matches!(entity.shape, ShapeDesc::Mesh(_)));
    let (imported, notes) = round_trip(&desc);
    let unexpected: Vec<&str> = notes.lines().filter(|note| !is_expected(note)).collect();
    assert!(unexpected.is_empty(), "{unexpected:?}");
    assert_same_picture(&desc, &imported);
}

#[test]
fn mirrored_entities_keep_their_front() {
    let mut desc = gallery(vec![
        material("glow", |m| m.emission = Vec3::ONE),
        MaterialDesc::new("wall"),
    ]);
    (desc.lights, desc.environment) = (vec![], None);
    let flat = Arc::new(
        cuboid(Vec3::ONE, 0.0, 1)
            .unwrap()
            .into_mesh("box.obj".into(), "m"),
    );
    assert!(flat.normals.is_empty(), "the shape must have flat faces");
    for entity in &mut desc.entities {
        entity.transform.frame *= DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        if let ShapeDesc::Mesh(mesh) = &mut entity.shape
            && entity.name == "tile 0"
        {
            *mesh = flat.clone();
        }
    }
    let (imported, _) = round_trip(&desc);
    assert_same_picture(&desc, &imported);
    let (a, b) = (compile(&desc).unwrap().0, compile(&imported).unwrap().0);
    assert_eq!(
        (a.triangles.len(), a.emitters.len()),
        (b.triangles.len(), b.emitters.len())
    );
}

#[test]
fn entities_with_one_mesh_share_one_file_and_one_group() {
    let mut desc = gallery(vec![MaterialDesc::new("wall")]);
    let tile = desc.entities[0].clone();
    for i in 0..5 {
        let mut copy = tile.clone();
        copy.name = format!("copy {i}");
        copy.transform.translate = Vec3::new(0.4 * i as f32 - 1.0, 0.5 * i as f32, -1.0).as_dvec3();
        desc.entities.push(copy);
    }
    let dir = tempfile::tempdir().unwrap();
    let exported = export::mitsuba(&desc, &dir.path().join("m")).unwrap();
    assert_eq!(
        exported
            .files
            .iter()
            .filter(|f| f.extension().unwrap() == "ply")
            .count(),
        1
    );
    let text = std::fs::read_to_string(&exported.scene).unwrap();
    let count = |what: &str| text.matches(what).count();
    assert_eq!(
        (count("type=\"shapegroup\""), count("type=\"instance\"")),
        (1, 6)
    );
    let (imported, _) = round_trip(&desc);
    assert_same_picture(&desc, &imported);
}

#[test]
fn the_lens_of_the_camera_is_the_same_after_import() {
    let mut desc = gallery(vec![MaterialDesc::new("wall")]);
    (desc.camera.optics, desc.camera.focus_distance) =
        (desc.camera.optics.with_aperture(0.3), Some(7.0));
    desc.views.push(("side".to_owned(), desc.camera.clone()));
    let (imported, notes) = round_trip(&desc);
    assert!(notes.contains("only the first sensor is used"), "{notes}");
    assert_same_picture(&desc, &imported);
    assert_eq!(
        (
            imported.camera.lens_diameter(),
            imported.camera.focus_distance
        ),
        (0.3, Some(7.0))
    );
}

#[test]
fn features_without_a_counterpart_are_notes_that_name_the_material() {
    let odd = material("odd", |m| {
        (m.anisotropic, m.anisotropic_direction, m.shadow_terminator) = (0.5, Vec3::X, true);
        m.set_texture(
            TextureSlot::Mask,
            Some(stored([[255; 4], [0; 4], [255; 4], [90; 4]])),
        );
    });
    let mixed = material("mixed", |m| {
        (m.model, m.metallic, m.opacity) = (Model::Lambert, 0.3, 0.4)
    });
    let desc = gallery(vec![odd, mixed]);
    let dir = tempfile::tempdir().unwrap();
    let exported = export::mitsuba(&desc, dir.path()).unwrap();
    let notes = lines(&exported.notes);
    for word in ["increasing u", "shadow_terminator", "mask_mode"] {
        assert!(
            notes.contains(word) && notes.contains("materials.odd"),
            "{word}: {notes}"
        );
    }
    assert_eq!(exported.notes.len(), 5, "{notes}");
    let text = std::fs::read_to_string(&exported.scene).unwrap();
    assert_eq!(
        text.matches("type=\"blendbsdf\"").count(),
        2,
        "metal and glass must be blended"
    );
}

#[test]
fn equal_scenes_export_equal_bytes_and_foreign_folders_are_not_replaced() {
    let desc = gallery(vec![material("a", |m| {
        m.set_texture(TextureSlot::BaseColor, Some(stored([[9; 4]; 4])))
    })]);
    let dirs = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let [a, b] = [0, 1].map(|i| export::mitsuba(&desc, dirs[i].path()).unwrap().files);
    for (a, b) in a.iter().zip(&b) {
        assert!(
            std::fs::read(a).unwrap() == std::fs::read(b).unwrap(),
            "{}",
            a.display()
        );
    }
    let foreign = Folder::new(&[("scene.xml", "<scene version=\"3.0.0\"/>")]);
    assert!(!export::can_replace(
        foreign.path("scene.xml").parent().unwrap()
    ));
    let blocked = export::mitsuba(&desc, &foreign.path("scene.xml"))
        .unwrap_err()
        .to_string();
    assert!(blocked.starts_with("cannot write"), "{blocked}");
}

#[test]
fn no_name_in_a_scene_writes_outside_the_folder() {
    let picture = texture(
        "../../t.png",
        Texels::Rgba8(vec![[9, 99, 199, 255]; 4].into()),
    );
    let mut desc = gallery(vec![material("../../m", |m| {
        m.set_texture(TextureSlot::BaseColor, Some(picture))
    })]);
    desc.entities[0].name = "/../../up".to_owned();
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("m");
    let exported = export::mitsuba(&desc, &folder).unwrap();
    assert!(
        exported.files.len() >= 3,
        "expected a scene, a mesh and a texture"
    );
    let within = folder.canonicalize().unwrap();
    for file in &exported.files {
        assert!(
            file.canonicalize().unwrap().starts_with(&within),
            "{}",
            file.display()
        );
    }
}

#[test]
fn builtin_scenes_have_the_same_primitives_after_export_and_import() {
    for name in [
        "cornell_spheres/cornell_spheres.scn",
        "veach_lamps/veach_lamps.scn",
        "masked_leaves/masked_leaves.scn",
    ] {
        let path = builtin_path(name);
        let (desc, _) = lumbre_scene_io::load::load(&path).unwrap_or_else(|e| panic!("{e}"));
        let (imported, _) = round_trip(&desc);
        let (a, b) = (compile(&desc).unwrap().0, compile(&imported).unwrap().0);
        let parts = |s: &lumbre_light::scene::CompiledScene| {
            (s.triangles.len(), s.spheres.len(), s.emitters.len())
        };
        assert_eq!(parts(&a), parts(&b), "{name}");
        let size = (a.bounds[1] - a.bounds[0]).length();
        assert!(
            a.bounds
                .iter()
                .zip(b.bounds)
                .all(|(p, q)| p.distance(q) < 1e-5 * size),
            "{name}"
        );
        let area = |s: &lumbre_light::scene::CompiledScene| {
            s.emitters.iter().map(|e| f64::from(e.area)).sum::<f64>()
        };
        assert!((area(&a) / area(&b) - 1.0).abs() < 1e-5, "{name}");
    }
}
