//! The wavefront renders the same bits as the scalar path for all materials, lights and settings.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::Vec3;
use lumbre_light::film::time::TimeFilter;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{MaskMode, Material, NONE, Texture};
use lumbre_light::transport::camera::{FilterKind, FilterSpec};
use lumbre_light::transport::delay::Profile;
use lumbre_light::transport::time_settings::Timing;
use lumbre_light::value::Value;
use lumbre_render::{Job, Renderer, cpu::renderer::CpuRenderer};

use crate::common::{grey, light};
use crate::render::wavefront_fixtures::{
    DISNEY, assert_same_bits, assert_same_film_bits, interfaces, materials, nee_job, room,
    with_bdpt, with_bpt, with_guided, with_guided_bdpt, with_lvc, with_sppm, with_technique,
    with_time_axis, with_vcm,
};

#[test]
fn every_material_has_the_same_bits_in_lanes() {
    for (name, material) in materials() {
        let scene = room(material).build();
        assert_same_bits(name, &scene, nee_job([19, 11], 6), 7);
        assert_same_bits(name, &scene, with_bpt(nee_job([19, 11], 6)), 7);
        assert_same_bits(name, &scene, with_bdpt(nee_job([19, 11], 6)), 5);
        assert_same_bits(name, &scene, with_sppm(nee_job([19, 11], 6)), 2);
        assert_same_bits(name, &scene, with_vcm(nee_job([19, 11], 6)), 2);
        assert_same_bits(name, &scene, with_lvc(nee_job([19, 11], 6)), 2);
        assert_same_bits(name, &scene, with_guided(nee_job([19, 11], 6)), 5);
        assert_same_bits(name, &scene, with_guided_bdpt(nee_job([19, 11], 6)), 3);
    }
}

#[test]
fn every_model_of_an_interface_has_the_same_bits_in_lanes() {
    for (name, material) in interfaces() {
        let scene = room(material).build();
        let job = nee_job([19, 11], 6);
        assert_same_bits(&name, &scene, job.clone(), 3);
        assert_same_film_bits(&name, &scene, with_bpt(job.clone()), 3);
        assert_same_film_bits(&name, &scene, with_guided(job.clone()), 5);
        assert_same_film_bits(&name, &scene, with_guided_bdpt(job.clone()), 3);
        assert_same_film_bits(&name, &scene, with_vcm(job.clone()), 2);
        assert_same_film_bits(&name, &scene, with_lvc(job.clone()), 2);
        assert_same_bits(&name, &scene, with_bdpt(job), 3);
    }
}

/// Tests scenes of one leaf, whose traversal is vectorised as well, and a larger one.
#[test]
fn every_mask_has_the_same_bits_in_lanes() {
    for (mask_mode, more) in [
        (MaskMode::Threshold, 0),
        (MaskMode::Blend, 0),
        (MaskMode::Blend, 30),
    ] {
        let scene = |masked: bool| {
            let mut scene = room(Material {
                roughness: 0.4,
                ..DISNEY
            });
            let picture = Texture::new(
                3,
                2,
                [0.9, 0.2, 0.7, 0.0, 1.0, 0.4].map(|v| [v; 3]).to_vec(),
            );
            let mask_texture = if masked { scene.texture(picture) } else { NONE };
            let holes = |material| Material {
                mask_texture,
                mask_mode,
                ..material
            };
            let glass = Material {
                opacity: 0.0,
                roughness: 0.0,
                ..DISNEY
            };
            let mut scene = scene
                .quad(
                    Vec3::new(-0.7, -0.5, 0.3),
                    Vec3::X * 0.9,
                    Vec3::new(0.0, 0.8, -0.2),
                    holes(DISNEY),
                )
                // Coincides with the previous quad: rays hit this one only through holes of that
                // one.
                .quad(
                    Vec3::new(-0.7, -0.5, 0.3),
                    Vec3::X * 0.9,
                    Vec3::new(0.0, 0.8, -0.2),
                    grey(0.5),
                )
                .quad(
                    Vec3::new(0.1, 0.8, -0.4),
                    Vec3::X * 0.6,
                    Vec3::Z * 0.6,
                    holes(light(5.0)),
                );
            for i in 0..more {
                let at = Vec3::new(-0.9 + 0.05 * i as f32, -0.7, 0.6);
                scene = scene.quad(at, Vec3::X * 0.1, Vec3::Y * 0.1, holes(DISNEY));
            }
            scene
                .sphere(Vec3::new(-0.3, -0.4, -0.3), 0.3, holes(glass))
                .sphere(Vec3::new(-0.3, -0.4, -0.3), 0.2, holes(DISNEY))
                .build()
        };
        let (scene, unmasked) = (scene(true), scene(false));
        let name = format!("{mask_mode:?}, {} primitives", scene.primitive_count());
        for job in [
            nee_job([29, 17], 6),
            with_bpt(nee_job([29, 17], 6)),
            with_bdpt(nee_job([29, 17], 6)),
            with_vcm(nee_job([29, 17], 6)),
            with_lvc(nee_job([29, 17], 6)),
            with_guided_bdpt(nee_job([29, 17], 6)),
        ] {
            let sum = |scene: &Arc<CompiledScene>| {
                let mut renderer = CpuRenderer::new(Arc::clone(scene), job.clone()).unwrap();
                renderer.advance(1).unwrap();
                renderer.film().sum.clone()
            };
            assert_ne!(sum(&scene), sum(&unmasked), "{name}: no ray hits a mask");
            assert_same_bits(&name, &scene, job, 7);
        }
    }
}

#[test]
fn every_setting_has_the_same_bits_in_lanes() {
    let scene = room(Material {
        roughness: 0.3,
        opacity: 0.6,
        clearcoat: 0.5,
        ..DISNEY
    })
    .build();
    let with = |key: &str, word: &str| {
        nee_job([23, 13], 5)
            .with(|settings| settings.params = [(key.to_owned(), Value::from(word))].into())
    };
    let sample = 1 << 33;
    for (name, job) in [
        ("balance", with("mis", "balance")),
        ("no mis", with("mis", "none")),
        ("uniform", with("select", "uniform")),
        (
            "roulette",
            nee_job([23, 13], 12).with(|settings| settings.rr_start = Some(2)),
        ),
        (
            "later samples, another seed",
            Job {
                first_sample: sample,
                seed: 1 << 40 | 3,
                ..nee_job([23, 13], 4)
            },
        ),
        ("direct light only", nee_job([23, 13], 2)),
        ("threads", nee_job([300, 2], 4).on_threads(3)),
    ] {
        assert_same_bits(name, &scene, job.clone(), 5);
        assert_same_bits(name, &scene, with_bdpt(job.clone()), 5);
        assert_same_bits(name, &scene, with_vcm(job.clone()), 2);
        assert_same_bits(name, &scene, with_guided_bdpt(job.clone()), 2);
        assert_same_bits(name, &scene, with_lvc(job), 2);
    }
    let one = |s: i64, t: i64, more: &[(&str, Value)]| {
        let mut params: BTreeMap<String, Value> = more
            .iter()
            .map(|(k, v)| ((*k).to_owned(), v.clone()))
            .collect();
        params.insert(
            "strategies".to_owned(),
            Value::List(vec![Value::Int(s), Value::Int(t)]),
        );
        with_bdpt(nee_job([23, 13], 5).with(|settings| settings.params = params))
    };
    for (s, t) in [(0, 3), (1, 2), (2, 2), (3, 2), (2, 1)] {
        assert_same_bits("one strategy", &scene, one(s, t, &[]), 5);
        assert_same_bits(
            "one strategy, raw",
            &scene,
            one(s, t, &[("mis", Value::from("none"))]),
            5,
        );
        assert_same_bits(
            "all but one strategy",
            &scene,
            one(s, t, &[("contribution", Value::Bool(false))]),
            5,
        );
    }
    for join in ["connect", "merge"] {
        let job = with_vcm(nee_job([23, 13], 5));
        let job = with_technique(job, "vcm", &[("join", join.into())]);
        assert_same_bits(join, &scene, job, 3);
    }
    // Several pixels use the same light subpath, or one sample connects many to the lens.
    for photons in [17, 9_000] {
        for with in [with_vcm, with_lvc] {
            let job = with(nee_job([23, 13], 4));
            let name = job.integrator.name;
            let job = with_technique(job, name, &[("photons", Value::Int(photons))]);
            assert_same_bits("light subpaths", &scene, job, 2);
        }
    }
    // One vertex has more candidates than one list holds, or merges with as many vertices.
    let many = [
        ("connections", Value::Int(90)),
        ("candidates", Value::Int(100)),
    ];
    let drawn = with_technique(nee_job([5, 3], 4), "lvc", &many);
    let wide = [("radius", Value::Num(3.0)), ("photons", Value::Int(9_000))];
    let merged = with_technique(nee_job([5, 3], 4), "vcm", &wide);
    for job in [drawn, merged] {
        assert_same_film_bits("full lists", &scene, job, 2);
    }
    // Deep paths have more connections than one list holds.
    assert_same_bits("deep", &scene, with_bdpt(nee_job([8, 4], 30)), 5);
    assert_same_bits("emission only", &scene, nee_job([23, 13], 1), 5);
    assert_same_bits(
        "roulette, bpt",
        &scene,
        with_bpt(nee_job([23, 13], 12).with(|settings| settings.rr_start = Some(2))),
        5,
    );
}

#[test]
fn every_camera_has_the_same_bits_in_lanes() {
    let scene = || {
        room(Material {
            roughness: 0.3,
            ..DISNEY
        })
    };
    for kind in FilterKind::ALL {
        let name = kind.name();
        let filter = FilterSpec { kind, radius: 1.25 };
        let job = Job {
            first_sample: 1 << 32,
            seed: 3 << 32,
            ..nee_job([21, 13], 3)
        }
        .with(|settings| settings.filter = filter);
        assert_same_bits(name, &scene().build(), job.clone(), 5);
        assert_same_bits(name, &scene().build(), with_bdpt(job.clone()), 5);
        assert_same_film_bits(name, &scene().build(), with_vcm(job.clone()), 3);
        assert_same_film_bits(name, &scene().build(), with_lvc(job), 3);
    }
    let lens = scene()
        .with(|s| {
            (s.camera.optics, s.camera.focus_distance) =
                (s.camera.optics.with_aperture(0.1), Some(0.7))
        })
        .build();
    assert_same_bits("lens", &lens, nee_job([21, 13], 3), 5);
    assert_same_bits("lens", &lens, with_bdpt(nee_job([21, 13], 3)), 5);
    assert_same_bits("lens", &lens, with_vcm(nee_job([21, 13], 3)), 3);
    assert_same_bits("lens", &lens, with_lvc(nee_job([21, 13], 3)), 3);
    // Columns beyond 2^16 are a separate part of a sample's key.
    assert_same_bits("very wide", &scene().build(), nee_job([65_600, 1], 2), 1);
}

#[test]
fn every_time_axis_has_the_same_bits_in_lanes() {
    let half = Material {
        roughness: 0.2,
        opacity: 0.4,
        clearcoat: 0.5,
        ..DISNEY
    };
    let glass = Material {
        opacity: 0.0,
        roughness: 0.0,
        ior: 1.7,
        ..DISNEY
    };
    let scene = room(half)
        .sphere(Vec3::new(-0.4, -0.2, 0.2), 0.3, glass)
        .sphere(Vec3::new(-0.4, -0.2, 0.2), 0.1, light(3.0))
        .environment(None, Vec3::splat(0.2), 0.0)
        .build();
    let timed_job = with_time_axis(&nee_job([23, 13], 6));
    let axis = timed_job.settings.timing.clone().unwrap();
    let wave = timed_job
        .clone()
        .on_threads(3)
        .with(|settings| settings.rr_start = Some(3));
    let with = |change: &dyn Fn(&mut Timing)| {
        let mut timing = axis.clone();
        change(&mut timing);
        timed_job
            .clone()
            .with(|settings| settings.timing = Some(timing))
    };
    for (name, job) in [
        (
            "without the edge to the camera",
            with(&|t| t.camera = false),
        ),
        ("medium of index 1.33", with(&|t| t.medium = 1.33)),
        (
            "exponential emission",
            with(&|t| t.emission = Profile::Exponential(2.0)),
        ),
        (
            "box filter in time",
            with(&|t| t.filter = TimeFilter::Box(1.5)),
        ),
        (
            "Gaussian filter in time",
            with(&|t| t.filter = TimeFilter::Gauss(0.7)),
        ),
        ("all light after the axis", with(&|t| t.axis.start = -90.0)),
        ("threads and roulette", wave),
    ] {
        let shared = [with_sppm, with_vcm, with_lvc].map(|with| with(job.clone()));
        for job in [job.clone(), with_bpt(job.clone()), with_bdpt(job)] {
            assert_same_film_bits(name, &scene, job, 5);
        }
        for job in shared {
            assert_same_film_bits(name, &scene, job, 2);
        }
    }
    // The comparison is meaningful: more than 20 slots have light.
    let mut renderer = CpuRenderer::new(Arc::clone(&scene), timed_job).unwrap();
    renderer.advance(4).unwrap();
    let cube = renderer.times().unwrap();
    let lit = (0..cube.axis.slots()).filter(|slot| {
        cube.sum
            .iter()
            .skip(*slot)
            .step_by(cube.axis.slots())
            .any(|s| s[0] > 0.0)
    });
    assert!(lit.count() > 20);
}

#[test]
fn waves_and_checkpoints_of_a_film_with_a_time_axis_have_the_same_bits_in_lanes() {
    let scene = room(Material {
        roughness: 0.3,
        ..DISNEY
    })
    .build();
    for job in [
        with_time_axis(&nee_job([19, 11], 4)),
        with_time_axis(&with_bdpt(nee_job([19, 11], 4))),
        with_time_axis(&with_guided_bdpt(nee_job([19, 11], 4))),
        with_time_axis(&with_vcm(nee_job([19, 11], 4))),
        with_time_axis(&with_lvc(nee_job([19, 11], 4))),
    ] {
        let open = |threads: usize| {
            CpuRenderer::new(Arc::clone(&scene), job.clone().on_threads(threads)).unwrap()
        };
        let (mut whole, mut parts, mut after) = (open(1), open(2), open(3));
        whole.advance(7).unwrap();
        for samples in [1, 4, 2] {
            parts.advance(samples).unwrap();
        }
        let mut before = open(1);
        before.advance(3).unwrap();
        let mut state = Vec::new();
        assert!(before.save(&mut state).unwrap());
        after.restore(&state).unwrap();
        after.advance(4).unwrap();
        let cube = whole.times().unwrap();
        assert!(
            parts.times().unwrap() == cube && after.times().unwrap() == cube,
            "{}",
            job.integrator.name
        );
        assert_eq!(parts.film(), whole.film());
    }
}
