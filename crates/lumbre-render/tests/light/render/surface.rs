//! From a hit to the shaded surface: normal maps in MikkTSpace, and masks, compared with closed
//! forms.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{Mat2, Vec2, Vec3, Vec4};
use lumbre_light::film::Film;
use lumbre_light::scene::compile::{MaskMode, Material, NONE, Texture, UvMap};
use lumbre_light::scene::desc::{
    CameraDesc, EntityDesc, MaterialDesc, MeshDesc, RoughnessTexels, SceneDesc, ShapeDesc, Texels,
    TextureDesc, TextureSlot, mesh_hash, texture_hash,
};
use lumbre_light::scene::{CompiledScene, compile};
use lumbre_light::transport::integrator::integrator;
use lumbre_light::transport::ray::{Hit, Ray};
use lumbre_light::transport::surface::Surface;
use lumbre_render::hierarchy::Builder;

use crate::common::{SceneBuilder, WHITE, grey, job, light, mean_and_error, render};

/// Returns a texture of one texel.
fn texel(rgb: [f32; 3]) -> Arc<TextureDesc> {
    let texels = Texels::RgbaF32(vec![[rgb[0], rgb[1], rgb[2], 1.0]]);
    let content_hash = texture_hash(1, 1, &texels);
    Arc::new(TextureDesc {
        file: PathBuf::from("n.exr"),
        width: 1,
        height: 1,
        texels,
        content_hash,
    })
}

/// Returns a normal map with the same normal everywhere.
pub fn normal_map(n: Vec3) -> Arc<TextureDesc> {
    texel((n * 0.5 + 0.5).to_array())
}

/// Returns the triangles of one mesh with a material.
pub fn mesh(
    positions: &[Vec3],
    normals: &[Vec3],
    uvs: &[Vec2],
    material: MaterialDesc,
) -> CompiledScene {
    mesh_with_second_uvs(positions, normals, uvs, &[], material)
}

/// Does what [`mesh`] does, with a second set of texture coordinates.
pub fn mesh_with_second_uvs(
    positions: &[Vec3],
    normals: &[Vec3],
    uvs: &[Vec2],
    second_uvs: &[Vec2],
    material: MaterialDesc,
) -> CompiledScene {
    let triangles: Vec<[u32; 3]> = (2..positions.len() as u32).map(|i| [0, i - 1, i]).collect();
    let mut mesh = MeshDesc {
        file: PathBuf::from("m.obj"),
        positions: positions.to_vec(),
        normals: normals.to_vec(),
        uvs: uvs.to_vec(),
        second_uvs: second_uvs.to_vec(),
        triangle_slot: vec![0; triangles.len()],
        triangles,
        slots: vec!["m".to_owned()],
        ..MeshDesc::default()
    };
    mesh.content_hash = mesh_hash(&mesh);
    let camera = CameraDesc::pinhole(Vec3::Z * 3.0, Vec3::ZERO, 40.0);
    let entity = EntityDesc::new("e", ShapeDesc::Mesh(Arc::new(mesh)));
    let desc = SceneDesc {
        resolution: [8, 8],
        max_depth: 3,
        camera,
        materials: vec![MaterialDesc {
            name: "m".to_owned(),
            ..material
        }]
        .into(),
        entities: vec![entity].into(),
        ..SceneDesc::default()
    };
    compile(&desc).unwrap().0
}

/// Returns a material with a constant normal map.
fn mapped(n: Vec3) -> MaterialDesc {
    let mut m = MaterialDesc::new("m");
    m.set_texture(TextureSlot::Normal, Some(normal_map(n)));
    m
}

/// Returns the surface at barycentric weights of a triangle, seen from `+z`.
pub fn at(scene: &CompiledScene, primitive: u32, uv: [f32; 2]) -> Surface<'_> {
    let ray = Ray {
        origin: Vec3::new(0.1, 0.1, 3.0),
        dir: Vec3::NEG_Z,
    };
    Surface::at(
        scene,
        &ray,
        &Hit {
            t: 3.0,
            primitive,
            instance: NONE,
            uv,
        },
    )
}

pub const SQUARE: [Vec3; 4] = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];

#[test]
fn mapped_normals_follow_rotated_scaled_and_mirrored_coordinates() {
    let local = Vec3::new(0.48, 0.36, 0.8);
    for degrees in [0.0f32, 30.0, 90.0, 135.0, 180.0, 260.0] {
        for (mirror, stretch) in [(1.0f32, 1.0f32), (-1.0, 1.0), (1.0, 3.0), (-1.0, 0.5)] {
            // The directions of increasing u and v in the plane, rotated; v is reversed if
            // mirrored.
            let u = Mat2::from_angle(degrees.to_radians()) * Vec2::X;
            let v = u.perp() * mirror;
            let uvs = SQUARE.map(|p| Vec2::new(p.truncate().dot(u) * stretch, p.truncate().dot(v)));
            let scene = mesh(&SQUARE, &[], &uvs, mapped(local));
            let expected = (u * local.x + v * local.y).extend(local.z);
            for primitive in [0, 1] {
                let n = at(&scene, primitive, [0.2, 0.3]).n_shading;
                assert!(
                    (n - expected).length() < 1e-5,
                    "{degrees} {mirror} {stretch}: {n} instead of {expected}"
                );
            }
        }
    }
}

#[test]
fn tangent_frames_of_smooth_normals_are_interpolated_without_normalisation() {
    let local = Vec3::new(-0.36, 0.48, 0.8);
    let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let normals = [[0.3, 0.1, 0.9], [-0.2, 0.4, 0.8], [0.1, -0.5, 0.7]]
        .map(|n| Vec3::from_array(n).normalize_or(Vec3::Z));
    let scene = mesh(
        &corners,
        &normals,
        &[Vec2::ZERO, Vec2::X, Vec2::Y],
        mapped(local),
    );
    let weights = [0.2, 0.5, 0.3];
    let mut expected = Vec3::ZERO;
    for (n, w) in normals.into_iter().zip(weights) {
        // The face's u direction in the tangent plane of the corner, and its orthogonal complement.
        let t = (Vec3::X - n * n.x).normalize_or(Vec3::ZERO);
        expected += (t * local.x + n.cross(t) * local.y + n * local.z) * w;
    }
    let n = at(&scene, 0, [weights[1], weights[2]]).n_shading;
    assert!(
        (n - expected.normalize_or(Vec3::Z)).length() < 1e-5,
        "{n} instead of {expected}"
    );
}

#[test]
fn flat_normal_maps_and_maps_of_strength_zero_have_no_effect() {
    let normals = [
        [0.3, 0.1, 0.9],
        [-0.2, 0.4, 0.8],
        [0.1, -0.5, 0.7],
        [0.0, 0.2, 0.9],
    ]
    .map(|n| Vec3::from_array(n).normalize_or(Vec3::Z));
    let uvs = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    let plain = mesh(&SQUARE, &normals, &uvs, MaterialDesc::new("m"));
    let flat = mesh(&SQUARE, &normals, &uvs, mapped(Vec3::Z));
    let off = mesh(
        &SQUARE,
        &normals,
        &uvs,
        MaterialDesc {
            normal_strength: 0.0,
            ..mapped(Vec3::X)
        },
    );
    let mut grey = MaterialDesc::new("m");
    let texels = Texels::Rgba8(vec![[128, 128, 255, 255]].into());
    let content_hash = texture_hash(1, 1, &texels);
    let bytes = TextureDesc {
        file: PathBuf::from("n.png"),
        width: 1,
        height: 1,
        texels,
        content_hash,
    };
    grey.set_texture(TextureSlot::Normal, Some(Arc::new(bytes)));
    let rounded = mesh(&SQUARE, &normals, &uvs, grey);
    for primitive in [0, 1] {
        for uv in [[0.0, 0.0], [0.2, 0.3], [0.5, 0.5], [0.1, 0.8]] {
            let n = at(&plain, primitive, uv).n_shading;
            assert!((at(&flat, primitive, uv).n_shading - n).length() < 1e-6);
            assert_eq!(at(&off, primitive, uv).n_shading, n);
            // Eight bits have no level for zero: 128 decodes to 1 / 255.
            assert!(
                (at(&rounded, primitive, uv).n_shading - n).length() < 1.5 / 255.0 * 2f32.sqrt()
            );
        }
    }
    assert_eq!(off.materials[0].normal_texture, NONE);
}

#[test]
fn a_normal_map_never_turns_a_normal_behind_its_triangle() {
    let uvs = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    for local in [
        Vec3::NEG_Z,
        Vec3::new(0.8, 0.0, -0.6),
        Vec3::X,
        Vec3::new(-1.0, -1.0, -1.0),
    ] {
        let scene = mesh(&SQUARE, &[], &uvs, mapped(local));
        let s = at(&scene, 0, [0.2, 0.3]);
        assert!(
            s.n_shading.dot(s.n_geometric) > 0.0 && (s.n_shading.length() - 1.0).abs() < 1e-5,
            "{local}"
        );
    }
}

/// Returns a lit floor seen from above, with a sheet of uniform coverage at `height`.
fn sheet(height: f32, value: f32, mode: MaskMode) -> Arc<CompiledScene> {
    let mut builder = SceneBuilder::new(Vec3::new(0.0, 2.0, 0.01), Vec3::ZERO, 30.0);
    let mask = builder.texture(Texture::new(1, 1, vec![[value, 1.0, 1.0]]));
    let sheet = Material {
        mask_texture: mask,
        mask_mode: mode,
        ..grey(0.0)
    };
    builder
        .floor(5.0, 0.0, grey(0.5))
        .ceiling(1.0, 3.0, light(4.0))
        .floor(9.0, height, sheet)
        .build()
}

fn picture(scene: &Arc<CompiledScene>, name: &str, threads: usize, samples: u64) -> Film {
    let mut j = job([12, 12], 2, 3);
    (j.integrator, j.threads) = (integrator(name).unwrap(), threads);
    render(scene, j, samples)
}

#[test]
fn a_blended_mask_transmits_the_same_share_of_camera_and_shadow_rays() {
    let open = mean_and_error(
        &picture(&sheet(1.0, 0.0, MaskMode::Blend), "nee", 0, 2000),
        0,
    );
    for name in ["nee", "bpt"] {
        for (height, value, passes) in [
            // Between camera and floor each path crosses the sheet twice: to the floor and on to
            // the light.
            (1.0, 0.3, 0.49),
            // Above the camera only the shadow ray crosses it.
            (2.5, 0.3, 0.7),
            (2.5, 0.0, 1.0),
            (2.5, 1.0, 0.0),
        ] {
            let (mean, error) = mean_and_error(
                &picture(&sheet(height, value, MaskMode::Blend), name, 0, 2000),
                0,
            );
            let expected = open.0 * passes;
            let sigma = (error.powi(2) + (open.1 * passes).powi(2)).sqrt();
            assert!(
                (mean - expected).abs() <= 4.0 * sigma,
                "{name} {height} {value}: {mean} is not {expected} +- {sigma}"
            );
            assert!(
                sigma < 0.02 * open.0,
                "{name}: too noisy for this test: {sigma}"
            );
        }
    }
}

/// Returns a black sphere of coverage `value` in a white environment, with as many further triangles
/// behind the camera.
fn masked_sphere(value: f32, more: usize) -> Arc<CompiledScene> {
    let mut builder = SceneBuilder::new(Vec3::new(0.0, 0.0, 5.0), Vec3::ZERO, 8.0);
    let mask = builder.texture(Texture::new(1, 1, vec![[value, 1.0, 1.0]]));
    let black = Material {
        mask_texture: mask,
        mask_mode: MaskMode::Blend,
        ..grey(0.0)
    };
    let mut builder = builder
        .sphere(Vec3::ZERO, 1.0, black)
        .environment(None, Vec3::ONE, 0.0);
    for i in 0..more {
        let corner = Vec3::new(i as f32, 0.0, 20.0);
        builder = builder.quad(corner, Vec3::X, Vec3::Y, grey(0.0));
    }
    builder.build()
}

#[test]
fn a_ray_crosses_the_mask_of_a_sphere_twice() {
    for (more, builder) in [
        (0, Builder::Ploc),
        (200, Builder::Ploc),
        (200, Builder::Cwbvh),
    ] {
        let mut job = job([8, 8], 2, 3);
        job.settings.accel.builder = builder;
        let film = render(&masked_sphere(0.4, more), job, 4000);
        let (mean, error) = mean_and_error(&film, 0);
        assert!(
            (mean - 0.36).abs() <= 4.0 * error && error < 2e-3,
            "{mean} +- {error} with {more} quads: 0.6 squared was expected"
        );
    }
}

#[test]
fn a_threshold_mask_is_either_opaque_or_invisible() {
    let open = picture(&sheet(1.0, 0.0, MaskMode::Threshold), "nee", 0, 4);
    let through = picture(&sheet(1.0, 0.499, MaskMode::Threshold), "nee", 0, 4);
    assert_eq!(open.sum, through.sum);
    assert!(open.sum.iter().any(|p| p[0] > 0.0));
    assert!(
        picture(&sheet(1.0, 0.5, MaskMode::Threshold), "nee", 0, 4)
            .sum
            .iter()
            .all(|p| *p == [0.0; 3])
    );
    let mut swept = Arc::unwrap_or_clone(sheet(1.0, 0.5, MaskMode::Threshold));
    swept
        .materials
        .iter_mut()
        .for_each(|m| m.mask_threshold = 0.6);
    assert_eq!(picture(&Arc::new(swept), "nee", 0, 4).sum, open.sum);
}

#[test]
fn blended_masks_have_the_same_bits_for_any_number_of_threads() {
    let scene = sheet(1.0, 0.4, MaskMode::Blend);
    for name in ["bpt", "nee", "bdpt"] {
        let [one, four] = [1, 4].map(|threads| picture(&scene, name, threads, 8));
        assert_eq!(one, four, "{name}");
    }
}

#[test]
fn tiling_and_offset_determine_where_textures_are_looked_up() {
    let uvs = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    // The left half is dark, the right half bright. The texture is repeated twice and shifted by a
    // quarter.
    let texels = Texels::RgbaF32(vec![[0.25, 0.25, 0.25, 1.0], [0.75, 0.75, 0.75, 1.0]]);
    let content_hash = texture_hash(2, 1, &texels);
    let desc = Arc::new(TextureDesc {
        file: PathBuf::from("t.exr"),
        width: 2,
        height: 1,
        texels,
        content_hash,
    });
    let mut m = MaterialDesc {
        tiling: 2.0,
        uv_offset: Vec2::new(0.25, 0.0),
        ..MaterialDesc::new("m")
    };
    m.set_texture(TextureSlot::BaseColor, Some(desc));
    m.base_color = Vec3::new(1.0, 0.5, 0.0);
    let scene = mesh(&SQUARE, &[], &uvs, m);
    assert_eq!(
        scene.materials[0].tiling,
        UvMap {
            scale: 2.0,
            offset: Vec2::new(0.25, 0.0)
        }
    );
    for (x, expected) in [
        (0.0, 0.25),
        (0.25, 0.75),
        (0.125, 0.5),
        (0.5, 0.25),
        (0.75, 0.75),
    ] {
        // The points lie on the edge of the first triangle along x.
        let found = at(&scene, 0, [x, 0.0])
            .shading_parameters(&scene.textures)
            .base_color;
        assert!(
            (found - Vec3::new(1.0, 0.5, 0.0) * expected).length() < 1e-6,
            "{x}: {found}"
        );
    }
}

#[test]
fn a_roughness_texture_is_interpolated_in_what_its_texels_mean() {
    // Two texels of 0.09 and 0.49, and the point in the middle between them.
    let texels = Texels::RgbaF32(vec![[0.09, 0.0, 0.0, 1.0], [0.49, 0.0, 0.0, 1.0]]);
    let map = Arc::new(TextureDesc::new("r.exr", 2, 1, texels));
    let uvs = SQUARE.map(|_| Vec2::splat(0.5));
    for (roughness_texels, expected) in [
        (RoughnessTexels::Roughness, 0.29),
        (RoughnessTexels::Alpha, 0.29f32.sqrt()),
    ] {
        let mut m = MaterialDesc {
            roughness_texels,
            ..MaterialDesc::new("m")
        };
        m.set_texture(TextureSlot::Roughness, Some(Arc::clone(&map)));
        let scene = mesh(&SQUARE, &[], &uvs, m);
        let found = at(&scene, 0, [0.2, 0.3])
            .shading_parameters(&scene.textures)
            .roughness;
        assert!((found - expected).abs() < 1e-6, "{found}, not {expected}");
    }
}

#[test]
fn vertex_colours_multiply_the_base_colour_of_their_own_mesh() {
    let file = |colors: Vec<Vec3>| {
        let mut mesh = MeshDesc {
            file: PathBuf::from("m.obj"),
            positions: SQUARE.to_vec(),
            uvs: vec![Vec2::splat(0.5); 4],
            colors,
            triangles: vec![[0, 1, 1], [0, 1, 2], [0, 2, 3]],
            slots: vec!["m".to_owned()],
            triangle_slot: vec![0; 3],
            ..MeshDesc::default()
        };
        mesh.content_hash = mesh_hash(&mesh);
        EntityDesc::new("e", ShapeDesc::Mesh(Arc::new(mesh)))
    };
    let colors = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE];
    let mut m = MaterialDesc {
        base_color: Vec3::new(0.8, 0.4, 1.0),
        ..MaterialDesc::new("m")
    };
    m.set_texture(TextureSlot::BaseColor, Some(texel([0.5, 1.0, 0.25])));
    let base = Vec3::new(0.4, 0.4, 0.25);
    let plain = mesh(&SQUARE, &[], &[], MaterialDesc::new("m"));
    let desc = |entities: Vec<EntityDesc>| SceneDesc {
        resolution: [8, 8],
        max_depth: 3,
        camera: plain.camera.clone(),
        materials: vec![m.clone()].into(),
        entities: entities.into(),
        ..SceneDesc::default()
    };
    // The triangle without area is left out, and the meshes before and after it have no colours.
    let entities = vec![file(vec![]), file(colors.to_vec()), file(vec![])];
    let (scene, notes) = compile(&desc(entities)).unwrap();
    assert!(
        notes
            .iter()
            .all(|n| n.message.contains("without area") || n.message.contains("nothing emits")),
        "{notes:?}"
    );
    assert_eq!((scene.triangles.len(), scene.colors.len()), (6, 6));
    for (primitive, expected) in [
        (0, Vec3::ONE),
        (2, Vec3::X * 0.5 + Vec3::Y * 0.2 + Vec3::Z * 0.3),
        (3, Vec3::X * 0.5 + Vec3::Z * 0.2 + Vec3::ONE * 0.3),
        (5, Vec3::ONE),
    ] {
        let found = at(&scene, primitive, [0.2, 0.3])
            .shading_parameters(&scene.textures)
            .base_color;
        assert!(
            (found - base * expected).length() < 1e-6,
            "{primitive}: {found}"
        );
    }
    assert!(
        compile(&desc(vec![file(vec![])]))
            .unwrap()
            .0
            .colors
            .is_empty(),
        "colours are stored although no mesh has any"
    );
    let e = compile(&desc(vec![file(vec![Vec3::ONE; 3])]))
        .unwrap_err()
        .to_string();
    assert!(e.contains("4 positions but 3 colours"), "{e}");
}

#[test]
fn a_direction_texture_rotates_the_direction_of_anisotropy() {
    let uvs = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    let mut m = MaterialDesc {
        anisotropic: 0.8,
        ..MaterialDesc::new("m")
    };
    let along = |m: &MaterialDesc| {
        at(&mesh(&SQUARE, &[], &uvs, m.clone()), 0, [0.2, 0.3])
            .tangent
            .normalize_or(Vec3::ZERO)
    };
    assert!(
        (along(&m) - Vec3::X).length() < 1e-6,
        "the default direction is increasing u"
    );
    m.anisotropic_direction = Vec3::Y;
    assert!(
        (along(&m) - Vec3::Y).length() < 1e-6,
        "the direction of the material"
    );
    m.set_texture(
        TextureSlot::AnisotropicDirection,
        Some(texel([0.2, 0.9, 0.0])),
    );
    assert!(
        (along(&m) - Vec3::new(-0.6, 0.8, 0.0)).length() < 1e-6,
        "the direction of the texture"
    );
}

#[test]
fn degenerate_normals_tangents_and_coordinates_give_no_invalid_samples() {
    let mut builder = SceneBuilder::new(Vec3::new(0.0, 0.0, 3.0), Vec3::ZERO, 40.0);
    let map = builder.texture(Texture::new(2, 1, vec![[0.5, 0.5, 0.0], [0.5, 0.5, 0.5]]));
    let m = Material {
        normal_texture: map,
        bump_texture: map,
        anisotropic: 1.0,
        anisotropic_texture: map,
        roughness: 0.2,
        ..WHITE
    };
    let mut scene = Arc::unwrap_or_clone(
        builder
            .quad(Vec3::new(-1.0, -1.0, 0.0), Vec3::X * 2.0, Vec3::Y * 2.0, m)
            .quad(
                Vec3::new(-1.0, -1.0, 4.0),
                Vec3::Y * 2.0,
                Vec3::X * 2.0,
                light(1.0),
            )
            .build(),
    );
    // render() asserts that no sample was invalid.
    for normals in [
        [Vec3::ZERO; 3],
        [Vec3::X, Vec3::NEG_X, Vec3::ZERO],
        [Vec3::NEG_Z; 3],
    ] {
        for tangent in [
            Vec4::ZERO,
            Vec4::new(0.0, 0.0, 1.0, 1.0),
            Vec4::new(1.0, 0.0, 0.0, -1.0),
        ] {
            for uv in [
                Vec2::ZERO,
                Vec2::splat(f32::NAN),
                Vec2::splat(f32::INFINITY),
                Vec2::splat(1e30),
            ] {
                scene.normals.make_smooth()[..2].fill(normals);
                scene.uvs[..2].fill([uv; 3]);
                scene.tangents = vec![[tangent; 3]; scene.triangles.len()];
                for name in ["bpt", "nee", "bdpt"] {
                    picture(&Arc::new(scene.clone()), name, 0, 2);
                }
            }
        }
    }
}
