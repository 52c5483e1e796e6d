//! Worker processes, on the mock backend: messages through the pipe, and recovery from the loss of
//! a worker.
#![allow(clippy::unwrap_used, reason = "a test that cannot continue has failed")]

use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::{Vec2, Vec3, Vec4};
use lumbre_light::film::layer::Layer;
use lumbre_light::film::time::{TimeAxis, TimeFilter};
use lumbre_light::math::piecewise::Piecewise;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{
    DelayParam, DelayProfile, Distribution, Interface, MaskMode, Material, MaterialComponent,
    Model, Sharing, Texture, UvMap, compile_sharing,
};
use lumbre_light::scene::desc::{DelayDesc, DelayKind};
use lumbre_light::transport::camera::{FilterKind, FilterSpec};
use lumbre_light::transport::delay::Profile;
use lumbre_light::transport::integrator::integrator;
use lumbre_light::transport::sampler::SOBOL;
use lumbre_light::transport::time_settings::Timing;
use lumbre_light::value::Value;
use lumbre_night::backends;
use lumbre_render::cpu::renderer::CpuRenderer;
use lumbre_render::mock::MockRenderer;
use lumbre_render::worker::{HEARTBEAT, Launcher, WorkerPool};
use lumbre_render::{Job, RenderError, Renderer};
use lumbre_scene_io::load::load;

use crate::common::{SceneBuilder, grey, job, light, named_job};

fn scene() -> Arc<CompiledScene> {
    let mut builder = SceneBuilder::new(Vec3::Z * 3.0, Vec3::ZERO, 50.0);
    let texture = builder.texture(Texture::new(1, 2, vec![[0.5; 3], [0.1, 0.2, 0.3]]));
    let sky = Texture::new(1, 1, vec![[1.0, 2.0, 3.0]]);
    builder
        .quad(
            Vec3::NEG_ONE,
            Vec3::X,
            Vec3::Y,
            Material {
                base_color_texture: texture,
                ..grey(0.5)
            },
        )
        .sphere(Vec3::ONE, 0.5, light(2.0))
        .point(Vec3::Y, Vec3::ONE)
        .directional(-Vec3::Y, Vec3::ONE)
        .environment(Some(sky), Vec3::ONE, 30.0)
        // The hash shifts the mock's pattern, and identifies a scene to the worker.
        .with(|s| s.content_hash = [9; 32])
        .build()
}

fn request() -> Job {
    let params = [("mis".to_owned(), Value::from("balance"))].into();
    named_job("nee", [12, 8], 4, 77).with(|settings| {
        settings.params = params;
        settings.rr_start = Some(3);
    })
}

fn pool() -> WorkerPool {
    WorkerPool::new(Launcher::new(
        env!("CARGO_BIN_EXE_lumbre").into(),
        ["worker"],
    ))
}

fn kill(pid: u32) {
    assert!(
        crate::common::kill()
            .args(["-9", &pid.to_string()])
            .status()
            .unwrap()
            .success()
    );
}

fn state(renderer: &dyn Renderer) -> Vec<u8> {
    let mut state = Vec::new();
    assert!(renderer.save(&mut state).unwrap());
    state
}

#[test]
fn a_run_in_a_worker_is_bit_identical_to_a_local_run() {
    let mut local = MockRenderer::new(scene(), request());
    let pool = pool();
    assert_eq!(
        pool.worker_id(),
        None,
        "no worker is started before it is needed"
    );
    let mut remote = pool.open("mock", &scene(), request()).unwrap();
    assert_eq!(
        (remote.open_stats(), remote.film().samples),
        (local.open_stats(), 0)
    );
    for samples in [1, 2, 5] {
        assert_eq!(
            remote.advance(samples).unwrap(),
            local.advance(samples).unwrap()
        );
        assert!(remote.film() == local.film());
    }
    assert_eq!(state(&remote), state(&local));
    // A second run in the same worker uses the scene that the worker already holds.
    let worker = pool.worker_id();
    let mut again = pool.open("mock", &scene(), request()).unwrap();
    again.restore(&state(&remote)).unwrap();
    assert!(again.film() == remote.film());
    drop(remote);
    again.advance(1).unwrap();
    local.advance(1).unwrap();
    assert!(again.film() == local.film());
    assert_eq!(pool.worker_id(), worker, "one worker serves all runs");
}

/// Returns the sizes of the unnamed files that this process has open in a folder.
#[cfg(target_os = "linux")]
fn unnamed_in(folder: &std::path::Path) -> Vec<u64> {
    let open = std::fs::read_dir("/proc/self/fd")
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let is_below =
        |file: &std::path::PathBuf| std::fs::read_link(file).is_ok_and(|to| to.starts_with(folder));
    open.filter(is_below)
        .map(|file| std::fs::metadata(file).unwrap().len())
        .collect()
}

#[cfg(target_os = "linux")]
#[test]
fn films_from_shared_memory_and_from_the_pipe_are_bit_identical() {
    let memory = tempfile::tempdir().unwrap();
    let launcher = Launcher::new(env!("CARGO_BIN_EXE_lumbre").into(), ["worker"]);
    let open = |films: Option<&std::path::Path>| {
        let pool = WorkerPool::new(Launcher {
            films: films.map(Into::into),
            ..launcher.clone()
        });
        let run = pool.open("mock", &scene(), request()).unwrap();
        (pool, run)
    };
    let mut local = MockRenderer::new(scene(), request());
    // A missing folder causes no error, since the pipe is used instead.
    let (missing, bytes) = (
        memory.path().join("missing"),
        12 * 8 * size_of::<[f64; 6]>() as u64,
    );
    let (mut runs, mut sizes) = (
        vec![open(Some(memory.path())), open(None), open(Some(&missing))],
        vec![0, bytes],
    );
    for samples in [3, 4] {
        assert_eq!(unnamed_in(memory.path()), [sizes.remove(0)]);
        let stats = local.advance(samples).unwrap();
        for (_, remote) in &mut runs {
            assert_eq!(remote.advance(samples).unwrap(), stats);
            assert!(remote.film() == local.film());
        }
    }
    drop(runs);
    assert!(
        unnamed_in(memory.path()).is_empty(),
        "the memory must be released with its run"
    );
    assert_eq!(std::fs::read_dir(memory.path()).unwrap().count(), 0);
}

/// Returns a scene with one element of every kind, and a job that uses all of them.
fn everything() -> (Arc<CompiledScene>, Job) {
    let mut builder = SceneBuilder::new(Vec3::new(0.2, 0.5, 3.0), Vec3::ZERO, 50.0);
    let texels: Vec<[f32; 3]> = (0..6)
        .map(|i| [0.15 * i as f32, 0.9 - 0.1 * i as f32, 0.4])
        .collect();
    let map = builder.texture(Texture::new(3, 2, texels));
    let disney = Material {
        model: Model::Disney,
        metallic: 0.5,
        roughness: 0.4,
        anisotropic: 0.6,
        anisotropic_direction: Vec3::X,
        sheen: 0.5,
        clearcoat: 0.5,
        base_color_texture: map,
        normal_texture: map,
        bump_texture: map,
        bump_height: 0.25,
        tiling: UvMap {
            scale: 2.0,
            offset: Vec2::new(0.25, 0.5),
        },
        shadow_terminator: true,
        ..grey(0.8)
    };
    let metal = Interface {
        distribution: Distribution::Beckmann,
        eta: Vec3::splat(0.2),
        ..Interface::PLAIN
    };
    let leaf = Material {
        mask_texture: map,
        mask_threshold: 0.3,
        ..grey(0.6)
    };
    let paper = Material {
        model: Model::Translucent,
        transmittance: Vec3::new(0.3, 0.2, 0.1),
        transmittance_texture: map,
        ..grey(0.5)
    };
    let cloud = Material {
        mask_texture: map,
        mask_mode: MaskMode::Blend,
        opacity: 0.5,
        ior: 1.3,
        ..grey(0.9)
    };
    let sky = Texture::new(2, 1, vec![[1.0, 2.0, 3.0], [0.5; 3]]);
    let scene = builder
        .floor(2.0, -1.0, disney)
        .quad(Vec3::new(-1.0, -1.0, 0.5), Vec3::X, Vec3::Y, leaf)
        .quad(Vec3::new(0.2, -1.0, 0.3), Vec3::X, Vec3::Y, cloud)
        .quad(Vec3::new(-1.5, -0.5, 0.2), Vec3::X, Vec3::Y, paper)
        .ceiling(0.5, 1.5, light(4.0))
        .sphere(
            Vec3::new(0.5, 0.0, -0.5),
            0.4,
            Material {
                model: Model::Conductor,
                interface: metal,
                ..grey(0.9)
            },
        )
        .sphere(Vec3::new(-0.6, 0.4, -0.5), 0.2, light(2.0))
        .point(Vec3::new(0.0, 1.0, 1.0), Vec3::ONE)
        .goniometric(Vec3::new(0.5, 1.0, 1.0), Vec3::ONE, sky.clone(), 40.0)
        .directional(Vec3::new(0.3, -1.0, 0.1), Vec3::splat(0.5))
        .environment(Some(sky), Vec3::splat(0.3), 30.0)
        .with(|s| {
            (s.camera.optics, s.camera.focus_distance) =
                (s.camera.optics.with_aperture(0.1), Some(2.5));
            s.colors = (0..s.triangles.len())
                .map(|i| [Vec3::X, Vec3::splat(0.1 * i as f32), Vec3::ONE])
                .collect();
            s.tangents = vec![
                [
                    Vec4::new(1.0, 0.0, 0.0, 1.0),
                    Vec4::new(0.8, 0.6, 0.0, -1.0),
                    Vec4::X
                ];
                s.triangles.len()
            ];
            // The first material is made of two components, one of them delayed twice.
            let table = DelayDesc {
                kind: DelayKind::Table,
                table: vec![0.0, 0.0, 1.0, 2.0],
                ..DelayDesc::default()
            };
            let mut spread = DelayProfile::plain(&DelayDesc {
                kind: DelayKind::Epanechnikov,
                ..DelayDesc::default()
            });
            spread.params[0].offset = 0.25;
            spread.params[1] = DelayParam {
                value: 0.5,
                offset: 0.1,
                texture: map,
            };
            s.delays.profiles = vec![DelayProfile::plain(&table), spread];
            s.delays.components = vec![
                MaterialComponent {
                    cumulative_weight: 0.25,
                    material: 1,
                    profiles: [0, 2],
                },
                MaterialComponent {
                    cumulative_weight: 1.0,
                    material: 0,
                    profiles: [0, 0],
                },
            ];
            s.delays.rows = (0..s.materials.len() as u32)
                .map(|row| [0, if row == 0 { 2 } else { 0 }])
                .collect();
        })
        .build();
    let timing = Timing {
        axis: TimeAxis {
            start: 0.5,
            bin: 0.25,
            bins: 40,
        },
        filter: TimeFilter::Gauss(0.5),
        camera: false,
        medium: 1.1,
        emission: Profile::Table(Piecewise::new(&[
            [0.0, 1.0],
            [0.5, 3.0],
            [0.5, 0.5],
            [2.0, 0.0],
        ])),
        metres: 0.01,
    };
    let filter = FilterSpec {
        kind: FilterKind::Gauss,
        radius: 1.25,
    };
    let params = [("mis".to_owned(), Value::from("balance"))].into();
    let layers = vec![Layer::Depth, Layer::Albedo, Layer::Normal];
    let integrator = integrator("bdpt").unwrap();
    (
        scene,
        Job {
            integrator,
            sampler: SOBOL,
            first_sample: 1 << 33 | 5,
            ..job([16, 12], 4, 1 << 40 | 9)
        }
        .with(|settings| {
            settings.params = params;
            settings.filter = filter;
            settings.films = layers;
            settings.timing = Some(timing);
            settings.rr_start = Some(2);
        }),
    )
}

#[test]
fn a_worker_tells_shared_and_copied_meshes_of_one_scene_apart() {
    let folder = tempfile::tempdir().unwrap();
    let fan: String = (0..40).fold("v 0 0 1\n".to_owned(), |text, i| {
        let (sin, cos) = (i as f32 * 0.15).sin_cos();
        let face = if i == 0 {
            String::new()
        } else {
            format!("f 1 {} {}\n", i + 1, i + 2)
        };
        format!("{text}v {cos} {sin} 0\n{face}")
    });
    std::fs::write(folder.path().join("fan.obj"), fan).unwrap();
    let scene = r#"{ "camera": { "position": [0, 0, 9], "lookat": [0, 0, 0] }, "entities": [
        { "type": "mesh", "file": "fan.obj" },
        { "type": "mesh", "file": "fan.obj", "position": [3, 0, 0] },
        { "type": "mesh", "file": "fan.obj", "position": [-3, 0, 0] } ] }"#;
    let file = folder.path().join("fans.scn");
    std::fs::write(&file, scene).unwrap();
    let (desc, _) = load(&file).unwrap();
    let pool = pool();
    let sizes = [Sharing::Always, Sharing::Never].map(|sharing| {
        let (scene, _) = compile_sharing(&desc, sharing).unwrap();
        let scene = Arc::new(scene);
        let remote = pool.open("cpu", &scene, request()).unwrap();
        let local = CpuRenderer::new(scene, request()).unwrap();
        let [remote, local] = [remote.open_stats(), local.open_stats()]
            .map(|stats| (stats.accel_nodes, stats.accel_bytes));
        assert_eq!(remote, local, "{sharing:?}");
        remote
    });
    assert_ne!(sizes[0], sizes[1]);
}

#[test]
fn a_worker_receives_scene_and_job_unchanged() {
    let (scene, job) = everything();
    let mut local = CpuRenderer::new(Arc::clone(&scene), job.clone()).unwrap();
    let pool = pool();
    let mut remote = pool.open("cpu", &scene, job).unwrap();
    remote.advance(3).unwrap();
    local.advance(3).unwrap();
    assert!(local.film().sum.iter().any(|s| s[0] > 0.0));
    assert!(
        remote.film() == local.film(),
        "the pictures must be bit-identical"
    );
    assert!(
        local.times().is_some() && remote.times() == local.times(),
        "the time bins must be bit-identical"
    );
    assert_eq!(remote.layers(), local.layers());
    for i in 0..local.layers().len() {
        assert!(
            remote.layer(i).unwrap() == local.layer(i).unwrap(),
            "{}",
            local.layers()[i].name()
        );
    }
}

#[test]
fn a_worker_refuses_unsupported_jobs_like_a_local_renderer_and_keeps_running() {
    let pool = pool();
    let wanted = request().with(|settings| settings.films = vec![Layer::Depth]);
    let local = backends::open("mock", scene(), wanted.clone()).err();
    assert!(matches!(local, Some(RenderError::Unsupported { .. })));
    assert_eq!(pool.open("mock", &scene(), wanted).err(), local);
    let worker = pool.worker_id().unwrap();
    let mut run = pool.open("mock", &scene(), request()).unwrap();
    assert!(matches!(
        run.restore(&[1, 2, 3]),
        Err(RenderError::Failed { .. })
    ));
    assert!(run.layer(0).is_err());
    run.advance(1).unwrap();
    assert_eq!(pool.worker_id(), Some(worker));
}

#[test]
fn a_killed_worker_loses_its_runs_and_the_next_run_starts_another_worker() {
    let pool = pool();
    let mut first = pool.open("mock", &scene(), request()).unwrap();
    let second = pool.open("mock", &scene(), request()).unwrap();
    first.advance(3).unwrap();
    let saved = state(&first);
    let worker = pool.worker_id().unwrap();
    kill(worker);
    let error = first.advance(1).unwrap_err();
    let message = error.to_string();
    assert!(
        matches!(
            error,
            RenderError::Lost {
                backend: "mock",
                ..
            }
        ),
        "{error:?}"
    );
    assert!(
        message.contains("worker process was lost") && message.contains("signal: 9"),
        "{message}"
    );
    assert_eq!(
        first.film().samples,
        3,
        "the film keeps the samples from before the loss"
    );
    assert!(
        second.save(&mut Vec::new()).is_err(),
        "the other run of the worker is lost as well"
    );
    assert_eq!(pool.worker_id(), None);
    let mut third = pool.open("mock", &scene(), request()).unwrap();
    assert_ne!(pool.worker_id(), Some(worker));
    third.restore(&saved).unwrap();
    third.advance(1).unwrap();
    assert_eq!(third.film().samples, 4);
}

/// Stops the worker process, as a debugger or a hanging driver would: it is alive, but does not
/// answer.
#[cfg(unix)]
#[test]
fn a_stopped_worker_is_killed_after_the_heartbeat_timeout_and_its_run_resumes_in_another() {
    let arguments = vec!["worker".to_owned()];
    let heartbeat_timeout = 4 * HEARTBEAT;
    let program = env!("CARGO_BIN_EXE_lumbre").into();
    let pool = WorkerPool::new(Launcher {
        program,
        arguments,
        heartbeat_timeout,
        films: None,
    });
    let mut first = pool.open("mock", &scene(), request()).unwrap();
    first.advance(3).unwrap();
    let saved = state(&first);
    // Heartbeats while no request is open are not answers.
    std::thread::sleep(3 * HEARTBEAT);
    first.advance(1).unwrap();
    let worker = pool.worker_id().unwrap();
    assert!(
        crate::common::kill()
            .args(["-STOP", &worker.to_string()])
            .status()
            .unwrap()
            .success()
    );
    // On a busy machine its threads stop a little later than the signal is sent.
    std::thread::sleep(HEARTBEAT);
    let start = Instant::now();
    let error = first.advance(1).unwrap_err();
    assert!(
        matches!(
            error,
            RenderError::Lost {
                backend: "mock",
                ..
            }
        ),
        "{error:?}"
    );
    assert!(
        error.to_string().contains("it sent no heartbeat for 2 s"),
        "{error}"
    );
    assert!(
        start.elapsed() >= heartbeat_timeout,
        "the worker was given up too early, after {:?}",
        start.elapsed()
    );
    assert_eq!(
        pool.worker_id(),
        None,
        "the stopped worker must be killed, not only abandoned"
    );
    let mut second = pool.open("mock", &scene(), request()).unwrap();
    second.restore(&saved).unwrap();
    second.advance(2).unwrap();
    assert_eq!(second.film().samples, 5);
}

#[test]
fn a_worker_exits_when_its_pool_is_dropped() {
    let pool = pool();
    let run = pool.open("mock", &scene(), request()).unwrap();
    let worker = pool.worker_id().unwrap();
    drop((run, pool));
    let alive = crate::common::kill()
        .args(["-0", &worker.to_string()])
        .output()
        .unwrap()
        .status
        .success();
    assert!(!alive, "process {worker} is still running");
}

#[test]
fn programs_that_are_not_workers_are_reported() {
    // The timeout is short for programs that never answer, and long for programs that may take a
    // while to start.
    let open = |program: &str, arguments: &[&str], heartbeat_timeout: Duration| {
        let arguments = arguments.iter().map(|a| (*a).to_owned()).collect();
        let pool = WorkerPool::new(Launcher {
            program: program.into(),
            arguments,
            heartbeat_timeout,
            films: None,
        });
        pool.open("mock", &scene(), request())
            .err()
            .unwrap()
            .to_string()
    };
    #[cfg(unix)]
    {
        let message = open("sleep", &["100"], 2 * HEARTBEAT);
        assert!(
            message.contains("it sent no heartbeat for 1 s"),
            "{message}"
        );
    }
    let message = open("/nowhere/lumbre", &[], 2 * HEARTBEAT);
    assert!(
        message.contains("cannot start the worker process /nowhere/lumbre"),
        "{message}"
    );
    let message = open(
        env!("CARGO_BIN_EXE_lumbre"),
        &["--version"],
        120 * HEARTBEAT,
    );
    assert!(
        message.contains("its reply was cut off or corrupt"),
        "{message}"
    );
    let message = open(env!("CARGO_BIN_EXE_lumbre"), &["sing"], 120 * HEARTBEAT);
    assert!(
        message.contains("it exited") && message.contains("unrecognized subcommand"),
        "{message}"
    );
}
