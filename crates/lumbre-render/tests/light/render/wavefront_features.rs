//! Features that every technique has in lanes: samplers, layers, light selection, maps, terminator
//! offsets, composed materials and delays.

use std::sync::Arc;

use glam::{Vec3, Vec4};
use lumbre_light::film::layer::{LAYERS, Layer};
use lumbre_light::scene::compile::{Material, Model, RoughnessTexels, Texture};
use lumbre_light::scene::desc::{CameraKind, SceneDesc};
use lumbre_light::scene::{CompiledScene, compile};
use lumbre_light::transport::camera::{FilterKind, FilterSpec};
use lumbre_light::transport::delay::Profile;
use lumbre_light::transport::sampler::{SOBOL, sampler};
use lumbre_light::transport::time_settings::Timing;
use lumbre_light::value::Value;
use lumbre_render::Job;
use lumbre_render::cpu::bvh::simd::Isa;
use lumbre_render::cpu::renderer::CpuRenderer;

use super::wavefront_fixtures::{
    DISNEY, FLOOR, assert_same_bits, assert_same_film_bits, interfaces, materials, nee_job, room,
    with_bdpt, with_bpt, with_guided_bdpt, with_lvc, with_sppm, with_time_axis, with_vcm,
};
use crate::common::{grey, render};
use crate::transient::composed::{PARTS, desc};

/// Returns the job with every technique.
fn techniques(job: &Job) -> [Job; 7] {
    let with = [
        with_bpt,
        with_bdpt,
        with_sppm,
        with_vcm,
        with_lvc,
        with_guided_bdpt,
    ];
    let [a, b, c, d, e, f] = with.map(|with| with(job.clone()));
    [job.clone(), a, b, c, d, e, f]
}

#[test]
fn samplers_layers_and_light_selection_have_the_same_bits_in_lanes() {
    let scene = room(DISNEY).build();
    let job = nee_job([21, 9], 5);
    let sobol = Job {
        sampler: SOBOL,
        ..job.clone()
    }
    .with(|settings| settings.rr_start = Some(2));
    let zsobol = Job {
        sampler: sampler("zsobol4").unwrap(),
        ..sobol.clone()
    };
    let layers = job
        .clone()
        .with(|settings| settings.films = LAYERS.iter().map(|row| row.layer).collect());
    let all =
        job.with(|settings| settings.params = [("lights".to_owned(), Value::from("all"))].into());
    for (name, job) in [("sobol", sobol), ("zsobol4", zsobol), ("layers", layers)] {
        for job in techniques(&job) {
            assert_same_bits(name, &scene, job, 3);
        }
    }
    assert_same_bits("all lights", &scene, all.clone(), 3);
    let all_by_sobol = Job {
        sampler: SOBOL,
        ..all
    }
    .with(|settings| settings.films = vec![Layer::Depth, Layer::Rays]);
    assert_same_bits("all lights, sobol, layers", &scene, all_by_sobol, 3);
}

#[test]
fn all_kinds_of_cameras_have_the_same_bits_in_lanes() {
    for kind in [CameraKind::Orthographic, CameraKind::Spherical] {
        let scene = room(DISNEY)
            .with(|s| (s.camera.kind, s.camera.view_height) = (kind, 1.3))
            .build();
        for filter in [FilterSpec::PIXEL, TENT] {
            let job = nee_job([21, 9], 5).with(|settings| settings.filter = filter);
            for job in techniques(&job) {
                assert_same_bits(kind.name(), &scene, job, 3);
            }
        }
    }
}

/// A filter that reaches over the edges of a film.
const TENT: FilterSpec = FilterSpec {
    kind: FilterKind::Tent,
    radius: 1.5,
};

/// Gives a parameter of a material the texture with an index.
type SetTexture = fn(&mut Material, u32);

/// Returns a texture whose texels vary.
fn texture(seed: u32) -> Texture {
    let texel = |i: u32| {
        let x = ((i * 7 + seed * 3) % 11) as f32 / 11.0;
        [x, 0.3 + 0.5 * x, 1.0 - x]
    };
    Texture::new(4, 3, (0..12).map(texel).collect::<Vec<_>>())
}

#[test]
fn textures_and_maps_have_the_same_bits_in_lanes() {
    let slots: [(&str, SetTexture); 9] = [
        ("base colour", |m, t| m.base_color_texture = t),
        ("roughness", |m, t| m.roughness_texture = t),
        ("alpha", |m, t| {
            (m.roughness_texture, m.roughness_texels) = (t, RoughnessTexels::Alpha);
        }),
        ("metallic", |m, t| m.metallic_texture = t),
        ("opacity", |m, t| m.opacity_texture = t),
        ("transmittance", |m, t| {
            (m.model, m.transmittance) = (Model::Translucent, Vec3::splat(0.4));
            m.transmittance_texture = t;
        }),
        ("normals", |m, t| m.normal_texture = t),
        ("bumps", |m, t| m.bump_texture = t),
        ("direction", |m, t| {
            (m.anisotropic, m.anisotropic_texture) = (0.7, t);
        }),
    ];
    for model in [DISNEY, grey(0.6)] {
        for (name, set) in slots {
            let scene = room(model)
                .with(|scene| {
                    let index = scene.textures.len() as u32;
                    scene.textures.push(texture(index));
                    for m in &mut scene.materials {
                        m.bump_height = 0.05;
                        set(m, index);
                    }
                    let tangent = Vec4::new(0.6, 0.0, 0.8, -1.0);
                    scene.tangents = vec![[tangent; 3]; scene.triangles.len()];
                })
                .build();
            for job in techniques(&nee_job([17, 8], 4)) {
                assert_same_film_bits(name, &scene, job, 2);
            }
        }
    }
}

/// Every model, each with a white base colour and equal vertex colours against that base colour and
/// no vertex colours.
#[test]
fn vertex_colors_are_factors_on_base_colors_in_every_model() {
    let color = Vec3::new(0.7, 0.4, 0.2);
    let interfaces = interfaces();
    let models = materials()
        .into_iter()
        .chain(interfaces.iter().map(|(name, m)| (name.as_str(), *m)));
    for (name, m) in models {
        let scene = |base_color: Vec3, colors: bool| {
            room(Material { base_color, ..m })
                .with(|scene| {
                    if colors {
                        scene.colors = vec![[Vec3::ONE; 3]; scene.triangles.len()];
                        scene.colors[FLOOR].fill([color; 3]);
                    }
                    for sphere in &scene.spheres {
                        scene.materials[sphere.material as usize].base_color = color;
                    }
                })
                .build()
        };
        let (colored, plain) = (scene(Vec3::ONE, true), scene(color, false));
        for job in techniques(&nee_job([16, 12], 4)) {
            let pictures = [&colored, &plain].map(|scene| render(scene, job.clone(), 4).mean());
            let [a, b] = pictures.each_ref().map(|picture| &picture.data);
            let off = a.iter().zip(b).filter(|(a, b)| differ(**a, **b)).count();
            // Rounding may send a path elsewhere.
            assert!(
                off <= a.len() / 100,
                "{name} by {}: {off} pixels differ",
                job.integrator.name
            );
        }
    }
}

/// Returns whether two pixels differ by more than rounding.
fn differ(a: [f32; 3], b: [f32; 3]) -> bool {
    std::iter::zip(a, b).any(|(a, b)| (a - b).abs() > 1e-3 * (a.abs() + b.abs()))
}

#[test]
fn terminator_offsets_have_the_same_bits_in_lanes() {
    let soft = Material {
        shadow_terminator: true,
        ..DISNEY
    };
    let scene = room(soft).build();
    let job = nee_job([21, 9], 5);
    let all = job
        .clone()
        .with(|settings| settings.params = [("lights".to_owned(), Value::from("all"))].into());
    let sobol = with_bdpt(Job {
        sampler: SOBOL,
        ..job.clone()
    });
    for job in techniques(&job).into_iter().chain([all, sobol]) {
        assert_same_bits("terminator", &scene, job, 3);
    }
}

fn compiled(desc: &SceneDesc) -> Arc<CompiledScene> {
    Arc::new(compile(desc).unwrap().0)
}

#[test]
fn composed_and_delayed_materials_have_the_same_bits_in_lanes() {
    for ball in ["red", "leaf", "gloss", "nested", "pane"] {
        let scene = compiled(&desc(PARTS, ball));
        for job in techniques(&nee_job([12, 12], 4)) {
            assert_same_bits(ball, &scene, job.clone(), 4);
            let pulse = with_time_axis(&job);
            let timing = pulse.settings.timing.clone().map(|timing| Timing {
                emission: Profile::Exponential(2.0),
                camera: false,
                ..timing
            });
            assert_same_film_bits(
                ball,
                &scene,
                pulse.with(|settings| settings.timing = timing),
                4,
            );
        }
    }
}

#[test]
fn every_technique_goes_in_lanes_unless_the_job_says_never() {
    let has_vectors = Isa::detect() != Isa::Portable;
    let is_vectorised = |job: Job| {
        let renderer = CpuRenderer::new(room(DISNEY).build(), job).unwrap();
        renderer.is_vectorised()
    };
    let job = nee_job([4, 4], 3);
    for job in techniques(&job) {
        assert_eq!(is_vectorised(job.clone()), has_vectors);
        let accel = job.settings.accel.scalar();
        assert!(!is_vectorised(job.with(|settings| settings.accel = accel)));
    }
}
