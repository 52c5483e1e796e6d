//! A device starts the next wave speculatively. This changes no bit of the results, whatever is
//! requested next, and no time is counted twice.

use std::sync::Arc;
use std::time::{Duration, Instant};

use lumbre_light::film::layer::Layer;
use lumbre_render::{Job, Renderer, WaveStats};
use lumbre_vulkan::context::device::Device;
use lumbre_vulkan::renderer::VulkanRenderer;

use super::harness;
use super::images::{room, state, technique_job};
use super::verdict::compare;

/// Samples of each wave, and number of samples announced to follow. After the first waves, a
/// dispatch of 80 ms has far more than one sample of such small pictures, so a wave of one sample
/// is shorter than the work in flight.
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
        harness::fastest_to_compile(device),
        &harness::sources(),
        &room(),
        job,
    )
    .unwrap()
}

/// Returns the counts of a wave that do not depend on time.
pub fn counts(stats: &WaveStats) -> [u64; 4] {
    [stats.samples, stats.paths, stats.rays, stats.invalid]
}

#[test]
fn speculative_work_changes_no_bit_of_films_checkpoints_and_counts() {
    let device = or_return!(harness::integer_splat_device());
    for name in ["bpt", "bdpt"] {
        let job = Job {
            resolution: [20, 14],
            ..technique_job(name, 70)
        };
        let (mut plain, mut ahead) = (open(&device, &job), open(&device, &job));
        for (i, (samples, more)) in WAVES.into_iter().enumerate() {
            let expected = plain.advance(samples).unwrap();
            let found = ahead.render(&harness::ahead(samples, more)).unwrap();
            assert_eq!(counts(&found), counts(&expected), "{name}, wave {i}");
            assert!(
                ahead.film() == plain.film(),
                "{name}, wave {i}: the films differ"
            );
            assert!(
                state(&ahead) == state(&plain),
                "{name}, wave {i}: the checkpoints differ"
            );
        }
        // One renderer resumes from the checkpoint of a run with work in flight, and so does that
        // run itself.
        ahead.render(&harness::ahead(3, 1000)).unwrap();
        plain.advance(3).unwrap();
        let saved = state(&ahead);
        let mut other = open(&device, &job);
        for renderer in [&mut other, &mut ahead] {
            renderer.restore(&saved).unwrap();
            assert!(state(renderer) == saved);
        }
        plain.advance(5).unwrap();
        for renderer in [&mut other, &mut ahead] {
            renderer.render(&harness::ahead(5, 1000)).unwrap();
            assert!(
                renderer.film() == plain.film(),
                "{name}: the films differ after a checkpoint"
            );
        }
    }
    harness::assert_no_validation_messages();
}

#[test]
fn speculative_work_does_not_change_splats_of_floats() {
    let device = or_return!(harness::device());
    let job = Job {
        resolution: [20, 14],
        ..technique_job("bdpt", 71)
    };
    let (mut plain, mut ahead) = (open(&device, &job), open(&device, &job));
    for (samples, more) in WAVES {
        plain.advance(samples).unwrap();
        ahead.render(&harness::ahead(samples, more)).unwrap();
        compare("splats by atomic addition", ahead.film(), plain.film());
    }
    harness::assert_no_validation_messages();
}

#[test]
fn speculative_work_does_not_change_layers_and_films_with_a_time_axis() {
    let device = or_return!(harness::integer_splat_device());
    let small = |name: &str| Job {
        resolution: [20, 14],
        ..technique_job(name, 5)
    };
    // These jobs have the same pipelines as other tests.
    let layers = small("nee").with(|settings| settings.films = vec![Layer::Depth, Layer::Rays]);
    let timing = Some(harness::timing(1.0, 0.2, 60));
    let mut scene = room();
    harness::add_delays(Arc::make_mut(&mut scene));
    for job in [
        layers,
        small("nee").with(|settings| settings.timing = timing),
    ] {
        let open = || {
            VulkanRenderer::new(
                &device,
                harness::fastest_to_compile(&device),
                &harness::sources(),
                &scene,
                &job,
            )
            .unwrap()
        };
        let (mut plain, mut ahead) = (open(), open());
        for (samples, more) in [(1, 100), (2, 100)] {
            plain.advance(samples).unwrap();
            ahead.render(&harness::ahead(samples, more)).unwrap();
            assert!(plain.times() == ahead.times() && state(&plain) == state(&ahead));
            assert!((0..plain.layers().len()).all(|i| plain.layer(i) == ahead.layer(i)));
        }
    }
    harness::assert_no_validation_messages();
}

/// Returns the job of the test with pauses.
fn paused_job() -> Job {
    Job {
        resolution: [20, 14],
        ..technique_job("bpt", 72)
    }
}

/// Returns the number of samples that the device renders in about this many seconds, at least 60: a
/// fast device must have as much to do during a pause as a slow one.
fn samples_of_a_wave(device: &Arc<Device>, seconds: f64) -> u64 {
    let (mut renderer, mut samples) = (open(device, &paused_job()), 60);
    for _ in 0..4 {
        let took = renderer.advance(samples).unwrap().device_s;
        let wanted = (samples as f64 * seconds / took.max(1e-6)).ceil() as u64;
        samples = wanted.clamp(60, 64 * samples);
    }
    samples
}

/// Renders waves of `samples` samples with pauses of the host between them. `more` samples are
/// announced to the device before each pause. Returns seconds of rendering, of idle time of the device, and of the host's
/// clock in total.
fn with_pauses(
    device: &Arc<Device>,
    samples: u64,
    more: u64,
    pause: Duration,
    pauses: u32,
) -> [f64; 3] {
    let mut renderer = open(device, &paused_job());
    let start = Instant::now();
    let mut all = WaveStats::default();
    for _ in 0..pauses {
        let wave = renderer.render(&harness::ahead(samples, more)).unwrap();
        assert!(
            wave.device_s > 0.0 && wave.device_s <= wave.render_s * 1.001,
            "{wave:?}"
        );
        all.add(&wave);
        std::thread::sleep(pause);
    }
    all.add(&renderer.advance(samples).unwrap());
    let whole = start.elapsed().as_secs_f64();
    println!(
        "{more} samples announced: {:.3} s of rendering and {:.3} s idle in {whole:.3} s",
        all.render_s, all.idle_s
    );
    assert!(
        all.render_s + all.idle_s <= 1.01 * whole,
        "{all:?} in {whole} s"
    );
    [all.render_s, all.idle_s, whole]
}

#[test]
fn the_device_renders_while_the_host_pauses_and_no_time_is_counted_twice() {
    let device = or_return!(harness::integer_splat_device());
    let (pause, pauses) = (Duration::from_millis(50), 4);
    let away = pause.as_secs_f64() * f64::from(pauses);
    let samples = samples_of_a_wave(&device, 1.5 * pause.as_secs_f64());
    let [_, waited, _] = with_pauses(&device, samples, 0, pause, pauses);
    assert!(
        waited >= 0.99 * away,
        "pauses were counted as rendering: the device was idle for {waited} s of {away} s"
    );
    // On shared processors a pause may take longer than the previous one, which determines how much
    // work the device receives.
    let covered =
        (0..5).any(|_| with_pauses(&device, samples, samples, pause, pauses)[1] < 0.5 * away);
    assert!(
        covered,
        "the device was idle although samples were announced"
    );
    harness::assert_no_validation_messages();
}
