//! The switches of studies: uniform directions, uniform sampling of the environment, the nearest
//! texel, and flat normals.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use lumbre_light::film::Film;
use lumbre_light::scene::compile::{Environment, Material, Texture};
use lumbre_light::scene::desc::{
    CameraDesc, EntityDesc, EnvironmentDesc, EnvironmentSampling, EnvironmentSource, MaterialDesc,
    MeshDesc, Optics, SceneDesc, ShadingNormals, ShapeDesc, Texels, TextureDesc, TextureFilter,
    TextureSlot, Transform, mesh_hash,
};
use lumbre_light::scene::{CompiledScene, compile};
use lumbre_light::transport::light::{LightSelection, Lights};
use lumbre_light::value::Value;
use lumbre_render::Job;

use super::agreement::{EYE, Setting, Technique, agree, room, technique};
use super::wavefront_fixtures::{
    DISNEY, assert_same_bits, interfaces, materials, nee_job, room as plain_room, with_bpt,
};
use crate::common::{SceneBuilder, WHITE, grey, job, job_with, light, mean_and_error, render};

/// Returns an integrator that continues paths in uniform directions.
fn uniform(name: &str) -> Technique {
    technique(name, &[("directions", Value::from("uniform"))])
}

/// Returns a room under a lamp with balls of materials that have lobes with and without density, on
/// one side and on both.
fn balls() -> Arc<CompiledScene> {
    let ball = |builder: SceneBuilder, at: Vec3, m: Material| builder.sphere(at, 0.4, m);
    let varnished = Material {
        roughness: 0.0,
        base_color: Vec3::new(0.7, 0.4, 0.2),
        ..DISNEY
    };
    let half = Material {
        opacity: 0.5,
        metallic: 0.2,
        roughness: 0.0,
        ..DISNEY
    };
    let frosted = Material {
        opacity: 0.0,
        roughness: 0.6,
        ..DISNEY
    };
    let builder = room(EYE);
    let builder = ball(builder, Vec3::new(-0.7, 0.45, 0.1), varnished);
    let builder = ball(builder, Vec3::new(0.0, 0.45, -0.3), half);
    ball(builder, Vec3::new(0.7, 0.45, 0.2), frosted).build()
}

#[test]
fn uniform_directions_have_the_same_mean_as_those_of_the_bsdf() {
    let setting = Setting {
        scene: &balls(),
        depth: 4,
        rr_start: None,
        samples: 1200,
        noise: 0.02,
    };
    let others = [uniform("bpt"), uniform("nee")];
    agree(setting, &technique("nee", &[]), &others);
}

#[test]
fn uniform_directions_have_the_same_bits_in_lanes() {
    let uniform = |job: Job| {
        job.with(|settings| {
            settings.params = [("directions".to_owned(), Value::from("uniform"))].into()
        })
    };
    let interfaces = interfaces();
    let others = interfaces.iter().map(|(name, m)| (name.as_str(), *m));
    for (name, material) in materials().into_iter().chain(others) {
        let scene = plain_room(material).build();
        let job = nee_job([13, 7], 4);
        for job in [job.clone(), with_bpt(job)] {
            assert_same_bits(name, &scene, uniform(job), 2);
        }
    }
}

/// In a scene without specular events, the picture has the light of connections and of hits; what is
/// seen directly is only hit.
#[test]
fn the_sum_of_both_estimators_counts_all_but_directly_seen_light_twice() {
    let scene = room(EYE)
        .sphere(Vec3::new(0.0, 0.45, 0.0), 0.4, grey(0.6))
        .build();
    let mean = |name: &str, params: &[(&str, Value)], depth: u32| {
        let (row, params) = technique(name, params);
        let film = render(&scene, job_with(row, params, job([16; 2], depth, 1)), 2048);
        mean_and_error(&film, 0)
    };
    let seen = mean("bpt", &[], 1);
    let both = [mean("nee", &[], 4), mean("bpt", &[], 4)];
    let expected = both[0].0 + both[1].0 - seen.0;
    let error = both[0].1.hypot(both[1].1).hypot(seen.1);
    for (key, word) in [
        ("lights", "all"),
        ("select", "area"),
        ("directions", "uniform"),
    ] {
        let (sum, wider) = mean("nee_sum", &[(key, word.into())], 4);
        let z = (sum - expected) / wider.hypot(error);
        assert!(
            z.abs() < 3.9,
            "{key}: {sum} +- {wider}, {expected} +- {error}"
        );
        assert!(sum > both[0].0 + 20.0 * wider, "{key}: {sum}");
    }
}

/// Variance of a pixel's sample: the square of the relative error of the mean.
fn noise(film: &Film) -> f64 {
    let (mean, error) = mean_and_error(film, 0);
    (error / mean).powi(2)
}

/// Renders a ball of rough metal under a grey sky. Uniform directions miss its lobe most of the time.
#[test]
fn the_bsdf_of_a_metal_has_less_noise_than_uniform_directions() {
    let metal = Material {
        metallic: 1.0,
        roughness: 0.3,
        ..DISNEY
    };
    let scene = SceneBuilder::new(Vec3::Z * 3.0, Vec3::ZERO, 30.0)
        .sphere(Vec3::ZERO, 1.0, metal)
        .environment(None, Vec3::ONE, 0.0)
        .build();
    let film = |(row, params): Technique| {
        let job = job_with(row, params, job([16; 2], 2, 1));
        render(&scene, job, 64)
    };
    let (bsdf, spread) = (film(technique("bpt", &[])), film(uniform("bpt")));
    let ratio = noise(&spread) / noise(&bsdf);
    assert!(ratio > 20.0, "{ratio}");
}

/// Returns a dark sky with a small sun.
fn sky(sampling: EnvironmentSampling) -> Environment {
    let texel = |i: u32| {
        let sun = (100..102).contains(&i);
        if sun { [400.0; 3] } else { [0.3, 0.4, 0.5] }
    };
    let map = Texture::new(32, 16, (0..32 * 16).map(texel).collect::<Vec<_>>());
    Environment {
        map: Some(Arc::new(map)),
        radiance: Vec3::ONE,
        rotation_rad: 0.4,
        sampling,
    }
}

#[test]
fn uniform_sampling_of_the_environment_has_one_density_and_the_same_power() {
    let [by_luminance, uniform] = EnvironmentSampling::ALL.map(|sampling| {
        let builder = SceneBuilder::new(Vec3::Z, Vec3::ZERO, 40.0);
        let scene = builder
            .with(|s| s.environment = Some(sky(sampling)))
            .build();
        let lights = Lights::with_select(&scene, LightSelection::Power);
        lights.environment_light.unwrap()
    });
    assert_eq!(by_luminance.power(), uniform.power());
    let (mut seen, mut varies) = (0, false);
    for i in 0..200_u32 {
        let u = [i as f32 / 200.0, (i * 37 % 200) as f32 / 200.0];
        let (dir, pdf_w) = uniform.sample::<f32, 1>(u, true);
        let again = uniform.pdf_w::<f32, 1>(dir, true);
        for density in [pdf_w, again] {
            let off = (f64::from(density) * 4.0 * PI - 1.0).abs();
            assert!(off < 1e-4, "{density} at {dir}");
        }
        seen += u32::from(dir.y > 0.0);
        let other = by_luminance.pdf_w::<f32, 1>(dir, true);
        varies |= (f64::from(other) * 4.0 * PI - 1.0).abs() > 0.5;
    }
    assert!((90..=110).contains(&seen) && varies, "{seen} of 200 above");
}

#[test]
fn both_samplings_of_the_environment_have_the_same_mean_and_luminance_has_less_noise() {
    let scene = |sampling| {
        let builder = SceneBuilder::new(Vec3::new(0.0, 1.0, 4.0), Vec3::ZERO, 40.0)
            .floor(2.0, -1.0, grey(0.7))
            .sphere(Vec3::new(0.0, -0.2, 0.0), 0.8, grey(0.5));
        builder
            .with(|s| s.environment = Some(sky(sampling)))
            .build()
    };
    let [importance, uniform] = EnvironmentSampling::ALL.map(scene);
    for params in [&[][..], &[("mis", Value::from("none"))][..]] {
        let film = |scene: &Arc<CompiledScene>| {
            let (row, params) = technique("nee", params);
            let job = job_with(row, params, job([16; 2], 3, 1));
            render(scene, job, 512)
        };
        let (a, b) = (film(&importance), film(&uniform));
        let [(mean, error), (other, wider)] = [&a, &b].map(|film| mean_and_error(film, 0));
        let z = (mean - other) / error.hypot(wider);
        assert!(z.abs() < 3.9, "{mean} +- {error} and {other} +- {wider}");
        assert!(wider > 3.0 * error, "{error} {wider}");
    }
}

/// Returns an octahedron with the normals of a sphere, and texture coordinates.
fn octahedron(normals: bool) -> Arc<MeshDesc> {
    let corners = [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z];
    let mut mesh = MeshDesc {
        positions: corners.to_vec(),
        normals: if normals { corners.to_vec() } else { vec![] },
        uvs: corners
            .iter()
            .map(|p| Vec2::new(p.x + p.z, p.y - p.z))
            .collect(),
        triangles: (0..8_u32)
            .map(|i| {
                let corner = |axis: u32| axis + if i >> axis & 1 == 0 { 0 } else { 3 };
                let t = [corner(0), corner(1), corner(2)];
                if i.count_ones() % 2 == 0 {
                    t
                } else {
                    [t[0], t[2], t[1]]
                }
            })
            .collect(),
        slots: vec!["m".to_owned()],
        triangle_slot: vec![0; 8],
        ..MeshDesc::default()
    };
    mesh.content_hash = mesh_hash(&mesh);
    Arc::new(mesh)
}

/// Returns a scene of some octahedra of two materials, the first of which may be flat, rough and
/// mapped.
fn octahedra(mesh: Arc<MeshDesc>, kind: ShadingNormals, maps: bool, count: u32) -> SceneDesc {
    let texels: Vec<[u8; 4]> = (0..16).map(|i| [100 + 10 * i, 150, 220, 255]).collect();
    let image = Arc::new(TextureDesc::new("", 4, 4, Texels::Rgba8(texels.into())));
    let mut first = MaterialDesc {
        shading_normals: kind,
        shadow_terminator: maps,
        ..MaterialDesc::new("m")
    };
    if maps {
        first.set_texture(TextureSlot::Normal, Some(Arc::clone(&image)));
        first.set_texture(TextureSlot::Bump, Some(image));
    }
    let entity = |i: u32| EntityDesc {
        name: format!("e{i}"),
        transform: Transform {
            translate: Vec3::new(2.2 * (i % 2) as f32 - 1.1, 2.2 * (i / 2) as f32 - 1.1, 0.0)
                .as_dvec3(),
            ..Transform::default()
        },
        material: Some(if i.is_multiple_of(2) { "m" } else { "other" }.to_owned()),
        anisotropic_direction: None,
        shape: ShapeDesc::Mesh(Arc::clone(&mesh)),
    };
    SceneDesc {
        resolution: [24, 24],
        max_depth: 3,
        camera: CameraDesc {
            position: Vec3::new(0.5, 0.3, 8.0),
            optics: Optics::pinhole(40.0),
            ..CameraDesc::default()
        },
        materials: vec![first, MaterialDesc::new("other")].into(),
        entities: (0..count).map(entity).collect(),
        environment: Some(EnvironmentDesc {
            sampling: EnvironmentSampling::Luminance,
            ..EnvironmentDesc::new(EnvironmentSource::Color(Vec3::ONE))
        }),
        ..SceneDesc::default()
    }
}

fn picture(desc: &SceneDesc) -> Vec<[f64; 3]> {
    let (scene, _) = compile(desc).unwrap();
    let (row, params) = technique("nee", &[]);
    let job = job_with(row, params, job(desc.resolution, 3, 5));
    render(&Arc::new(scene), job, 4).sum
}

#[test]
fn flat_normals_are_those_of_a_mesh_without_normals_and_maps() {
    use ShadingNormals::{Flat, Smooth};
    for count in [1, 4] {
        let flat = picture(&octahedra(octahedron(true), Flat, true, count));
        let smooth = picture(&octahedra(octahedron(true), Smooth, true, count));
        assert_ne!(flat, smooth, "{count}");
        if count == 1 {
            let geometry = picture(&octahedra(octahedron(false), Smooth, false, count));
            assert_eq!(flat, geometry);
        }
    }
    // The shading normals of every triangle of the flat material are its geometric normal, and only
    // there.
    let (scene, _) = compile(&octahedra(octahedron(true), Flat, true, 4)).unwrap();
    let flat = scene.flattened(usize::MAX).unwrap_or(scene);
    let mut counts = [0; 2];
    for (i, (points, attributes)) in (0..).zip(flat.triangles.iter().zip(&flat.attributes)) {
        let [a, b, c] = *points;
        let front = (b - a).cross(c - a).normalize_or_zero();
        let off = flat.normals.at(i).map(|n| (n - front).length());
        let is_flat = off.iter().all(|off| *off < 1e-5);
        assert_eq!(is_flat, attributes.material == 0, "{off:?}");
        counts[attributes.material as usize] += 1;
    }
    assert_eq!(counts, [16, 16]);
}

/// Renders a textured emissive quad whose texels each cover 4 by 5 pixels.
#[test]
fn the_nearest_texel_is_seen_without_interpolation() {
    let (width, height) = (5, 3);
    let color = |i: u32| [i as f32 + 1.0, 0.5 * i as f32, 2.0];
    let nearest = || {
        let mut texture = Texture::new(width, height, (0..15).map(color).collect::<Vec<_>>());
        texture.lookup.filter = TextureFilter::Nearest;
        texture
    };
    let mut builder = SceneBuilder::new(Vec3::Z * 100.0, Vec3::ZERO, 1.0);
    let lamp = Material {
        emission_texture: builder.texture(nearest()),
        ..light(1.0)
    };
    let high = 100.0 * 2.0 * 0.5f32.to_radians().tan();
    let wide = high * 20.0 / 15.0;
    let corner = Vec3::new(-wide / 2.0, -high / 2.0, 0.0);
    let scene = builder
        .quad(corner, Vec3::X * wide, Vec3::Y * high, lamp)
        .build();
    let film = render(&scene, job([20, 15], 1, 1), 4);
    for (i, sum) in film.sum.iter().enumerate() {
        let (x, y) = (i as u32 % 20, i as u32 / 20);
        let expected = color(y / 5 * width + x / 4).map(|c| 4.0 * f64::from(c));
        let off = sum.iter().zip(expected).map(|(a, b)| (a - b).abs());
        assert!(
            off.fold(0.0, f64::max) < 1e-4,
            "{x} {y}: {sum:?} {expected:?}"
        );
    }
    let same = plain_room(WHITE).with(|s| {
        s.textures.push(nearest());
        for m in &mut s.materials {
            m.roughness_texture = s.textures.len() as u32 - 1;
        }
    });
    assert_same_bits("nearest", &same.build(), nee_job([13, 7], 4), 2);
}
