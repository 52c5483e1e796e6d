//! A device starts the next wave speculatively: that changes no bit of the results, whatever is
//! requested next, and no time is counted twice.

use std::sync::Arc;
use std::time::{Duration, Instant};

use lumbre::film::layer::Layer;
use lumbre::render::vulkan::context::device::Device;
use lumbre::render::vulkan::pipelines::spirv::Sources;
use lumbre::render::vulkan::renderer::VulkanRenderer;
use lumbre::render::{Job, Renderer, WaveStats};

use super::harness;
use super::images::{compare, room, state, with};

/// Samples of each wave, and how many are announced to follow. After the first waves a dispatch of
/// 80 ms has far more than one sample of pictures as small as these, so a wave of one sample is
/// shorter than the work in flight.
const WAVES: [(u64, u64); 7] = [
    (1, 100),
    (1, 100),
    (60, 1000),
    (1, 1),
    (2, 1),
    (40, 100),
    (1, 0),
];

fn open(device: &Arc<Device>, job: &Job) -> VulkanRenderer {
    VulkanRenderer::new(
        device,
        harness::quick(device),
        &Sources::Embedded,
        &room(),
        job,
    )
    .unwrap()
}

fn counts(stats: &WaveStats) -> [u64; 4] {
    [stats.samples, stats.paths, stats.rays, stats.invalid]
}

#[test]
fn what_was_begun_changes_no_bit_of_films_checkpoints_and_counts() {
    let Some(device) = harness::exact() else {
        return;
    };
    for name in ["bpt", "bdpt"] {
        let job = Job {
            resolution: [20, 14],
            ..with(name, 70)
        };
        let (mut plain, mut ahead) = (open(&device, &job), open(&device, &job));
        for (i, (samples, more)) in WAVES.into_iter().enumerate() {
            let expected = plain.advance(samples).unwrap();
            let found = ahead.advance_with_lookahead(samples, more).unwrap();
            assert_eq!(counts(&found), counts(&expected), "{name}, wave {i}");
            assert!(
                ahead.film() == plain.film(),
                "{name}, wave {i}: the picture"
            );
            assert!(
                state(&ahead) == state(&plain),
                "{name}, wave {i}: what further waves need"
            );
        }
        // One renderer resumes from the checkpoint of a run with work in flight, and so does that
        // run itself.
        ahead.advance_with_lookahead(3, 1000).unwrap();
        plain.advance(3).unwrap();
        let saved = state(&ahead);
        let mut other = open(&device, &job);
        for renderer in [&mut other, &mut ahead] {
            renderer.restore(&saved).unwrap();
            assert!(state(renderer) == saved);
        }
        plain.advance(5).unwrap();
        for renderer in [&mut other, &mut ahead] {
            renderer.advance_with_lookahead(5, 1000).unwrap();
            assert!(
                renderer.film() == plain.film(),
                "{name}: after a checkpoint"
            );
        }
    }
    harness::silent();
}

#[test]
fn splats_that_start_from_zero_with_every_wave_are_those_of_the_waves_that_were_asked_for() {
    let Some(device) = harness::device() else {
        return;
    };
    let job = Job {
        resolution: [20, 14],
        ..with("bdpt", 71)
    };
    let (mut plain, mut ahead) = (open(&device, &job), open(&device, &job));
    for (samples, more) in WAVES {
        plain.advance(samples).unwrap();
        ahead.advance_with_lookahead(samples, more).unwrap();
        compare("splats by atomic addition", ahead.film(), plain.film());
    }
    harness::silent();
}

#[test]
fn nothing_is_begun_where_films_would_show_it() {
    let Some(device) = harness::exact() else {
        return;
    };
    let small = |name: &str| Job {
        resolution: [20, 14],
        ..with(name, 5)
    };
    // The pipelines are those of other tests.
    let layers = Job {
        layers: vec![Layer::Depth, Layer::Rays],
        ..small("nee")
    };
    let timing = Some(harness::timing(1.0, 0.2, 60));
    let mut scene = room();
    harness::slow(Arc::make_mut(&mut scene));
    for job in [
        layers,
        Job {
            timing,
            ..small("nee")
        },
    ] {
        let open = || {
            VulkanRenderer::new(
                &device,
                harness::quick(&device),
                &Sources::Embedded,
                &scene,
                &job,
            )
            .unwrap()
        };
        let (mut plain, mut ahead) = (open(), open());
        for (samples, more) in [(1, 100), (2, 100)] {
            plain.advance(samples).unwrap();
            ahead.advance_with_lookahead(samples, more).unwrap();
            assert!(plain.times() == ahead.times() && state(&plain) == state(&ahead));
            assert!((0..plain.layers().len()).all(|i| plain.layer(i) == ahead.layer(i)));
        }
    }
    harness::silent();
}

/// Renders waves with pauses of the host between them, which are announced to the device or not.
/// Returns seconds of rendering, of waiting, and of the host's clock in total.
fn with_pauses(device: &Arc<Device>, more: u64, pause: Duration, pauses: u32) -> [f64; 3] {
    let mut renderer = open(
        device,
        &Job {
            resolution: [20, 14],
            ..with("bpt", 72)
        },
    );
    let start = Instant::now();
    let mut all = WaveStats::default();
    for _ in 0..pauses {
        let wave = renderer.advance_with_lookahead(60, more).unwrap();
        assert!(
            wave.device_s > 0.0 && wave.device_s <= wave.render_s * 1.001,
            "{wave:?}"
        );
        all.add(&wave);
        std::thread::sleep(pause);
    }
    all.add(&renderer.advance(60).unwrap());
    let whole = start.elapsed().as_secs_f64();
    println!(
        "{more} more: {:.3} s of rendering and {:.3} s of waiting in {whole:.3} s",
        all.render_s, all.idle_s
    );
    assert!(
        all.render_s + all.idle_s <= 1.01 * whole,
        "{all:?} in {whole} s"
    );
    [all.render_s, all.idle_s, whole]
}

#[test]
fn the_device_works_while_the_host_is_away_and_no_second_is_counted_twice() {
    let Some(device) = harness::exact() else {
        return;
    };
    let (pause, pauses) = (Duration::from_millis(50), 4);
    let away = pause.as_secs_f64() * f64::from(pauses);
    let [_, waited, _] = with_pauses(&device, 0, pause, pauses);
    assert!(
        waited >= 0.99 * away,
        "the pauses are no rendering: the device waited {waited} s of {away}"
    );
    // A pause may take longer than the previous one, for which the device received work, if
    // processors are shared.
    let covered = (0..5).any(|_| with_pauses(&device, 60, pause, pauses)[1] < 0.5 * away);
    assert!(covered, "the device waited although it knew what comes");
    harness::silent();
}
