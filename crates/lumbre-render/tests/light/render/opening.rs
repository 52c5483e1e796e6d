//! Opening a run: what it states of the processor, and the hierarchies that runs share.

use std::sync::Arc;

use lumbre_light::scene::{CompiledScene, compile};
use lumbre_light::transport::integrator::integrator;
use lumbre_render::cpu::ROW;
use lumbre_render::cpu::bvh::simd::Isa;
use lumbre_render::cpu::kept_scenes::{SceneKeeper, scene_bytes};
use lumbre_render::cpu::renderer::CpuRenderer;
use lumbre_render::hierarchy::{AccelSpec, Builder, LaneMode};
use lumbre_render::{Job, Renderer, View};
use lumbre_scene_io::load::load;

fn scene() -> Arc<CompiledScene> {
    let file = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../scenes/cornell/cornell.scn"
    );
    let (desc, _) = load(file.as_ref()).unwrap();
    Arc::new(compile(&desc).unwrap().0)
}

fn job(builder: Builder, lanes: LaneMode) -> Job {
    let mut job = Job::plain(integrator("nee").unwrap(), [8, 8], 3, 7);
    job.threads = 2;
    (job.settings.accel.builder, job.settings.accel.lanes) = (builder, lanes);
    job
}

fn opened(scene: &Arc<CompiledScene>, builder: Builder, lanes: LaneMode) -> Vec<u32> {
    let mut renderer = (ROW.open)(Arc::clone(scene), job(builder, lanes)).unwrap();
    renderer.advance(2).unwrap();
    let image = renderer.film().mean();
    image.data.iter().flatten().map(|v| v.to_bits()).collect()
}

#[test]
fn runs_share_a_hierarchy_with_their_settings_until_the_keeper_goes() {
    let scene = scene();
    let without = scene_bytes(&scene);
    let alone = opened(&scene, Builder::Ploc, LaneMode::Auto);
    assert_eq!(
        scene_bytes(&scene),
        without,
        "nothing is kept without a keeper"
    );
    let keeper = SceneKeeper::new(Arc::clone(&scene));
    assert_eq!(opened(&scene, Builder::Ploc, LaneMode::Auto), alone);
    let with_one = scene_bytes(&scene);
    assert!(with_one > without, "its hierarchy is counted");
    for lanes in [LaneMode::Always, LaneMode::Never] {
        assert_eq!(opened(&scene, Builder::Ploc, lanes), alone);
        assert_eq!(scene_bytes(&scene), with_one, "lanes share a hierarchy");
    }
    let _ = opened(&scene, Builder::Sah, LaneMode::Auto);
    assert!(
        scene_bytes(&scene) > with_one,
        "another builder builds another one"
    );
    drop(keeper);
    assert_eq!(scene_bytes(&scene), without);
}

#[test]
fn a_view_renders_the_same_bits_as_a_scene_with_its_camera() {
    let shared = scene();
    let mut moved = (*shared).clone();
    moved.camera.position.x += 0.25;
    let moved = Arc::new(moved);
    let film = |scene: &Arc<CompiledScene>, job| {
        let mut renderer = (ROW.open)(Arc::clone(scene), job).unwrap();
        renderer.advance(2).unwrap();
        renderer.film().mean()
    };
    for lanes in [LaneMode::Always, LaneMode::Never] {
        let plain = job(Builder::Ploc, lanes);
        let view = View {
            camera: moved.camera.clone(),
            content_hash: [1; 32],
        };
        let seen = Job {
            view: Some(view),
            ..plain.clone()
        };
        let expected = film(&moved, plain.clone());
        assert!(film(&shared, plain) != expected);
        assert!(film(&shared, seen.clone()) == expected);
        let _keeper = SceneKeeper::new(Arc::clone(&shared));
        assert!(film(&shared, seen.clone()) == expected);
        assert!(film(&shared, seen) == expected, "with a kept hierarchy");
    }
}

#[test]
fn the_device_states_threads_hierarchy_instructions_and_lanes() {
    let scene = scene();
    let open = |builder, lanes| {
        let renderer = CpuRenderer::new(Arc::clone(&scene), job(builder, lanes)).unwrap();
        renderer.open_stats().clone()
    };
    let isa = Isa::detect().name();
    let plain = AccelSpec::default().builder;
    for (builder, hierarchy) in [
        (plain, "eight-wide BVH"),
        (Builder::None, "no hierarchy"),
        (Builder::Cwbvh, "compressed BVH by cwbvh medium"),
        (Builder::Median, "eight-wide BVH by median"),
    ] {
        let open = open(builder, LaneMode::Never);
        let line = format!("cpu, 2 threads, {hierarchy}, {isa}");
        assert_eq!(open.device_line(), line);
        assert_eq!(open.devices[0].features.lanes, Some(1));
    }
    let open = open(plain, LaneMode::Always);
    let line = format!("cpu, 2 threads, eight-wide BVH, {isa}, vectorised");
    assert_eq!(open.device_line(), line);
    assert!(open.devices[0].features.lanes > Some(1));
}
