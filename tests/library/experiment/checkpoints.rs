//! Checkpoints: the clock of a run that resumes in the middle of a wave, and when they are written.

use std::sync::Arc;
use std::time::Duration;

use lumbre_night::experiment::run::Open;
use lumbre_night::experiment::{NightSummary, Outcome, StopRule, WaveRow};
use lumbre_render::mock::{MockRenderer, SECONDS_PER_PATH};
use lumbre_render::{Renderer, WaveStats};

use crate::experiment::fixtures::{Lab, Memory, Night, Wrapped, outcomes};

/// Render time of a sample of [`Lab::new`] in seconds: that of 8x4 paths.
const SAMPLE_S: f64 = 32.0 * SECONDS_PER_PATH;

fn render(night: &Night<'_>, lab: &Lab) -> NightSummary {
    night.render(lab, &Arc::new(lab.plan()), &mut []).unwrap()
}

#[test]
fn a_run_that_ends_in_mid_wave_resumes_with_the_clock_of_its_checkpoint() {
    let mut lab = Lab::new();
    // Slices of two samples, and a checkpoint after every second slice.
    lab.spec.night.checkpoint_s = Some(2.5 * SAMPLE_S);
    let mut resumed_mid_wave = 0;
    for limit in 0..16 {
        let failing: Open<'_> =
            &|_, scene, job| Ok(Box::new(MockRenderer::new(scene, job).failing_after(limit)));
        let mut night = Night {
            history: Memory::with_checkpoints(),
            ..Night::default()
        };
        let whole = std::mem::replace(&mut night.open, failing);
        let failed = render(&night, &lab);
        assert!(matches!(outcomes(&failed)[0], Outcome::Failed(_)));
        if let Some(last) = night.history.checkpoints.borrow().values().flatten().last() {
            let (samples, clock) = (last.progress.samples(), last.progress.render_s());
            assert!((clock / (samples as f64 * SAMPLE_S) - 1.0).abs() < 1e-9);
            resumed_mid_wave += u32::from(last.progress.samples_left > 0);
        }
        night.open = whole;
        let whole = render(&night, &lab);
        let rows: &[WaveRow] = &whole.night.runs[0].rows;
        let samples: Vec<u64> = rows.iter().map(|row| row.samples).collect();
        assert_eq!(samples, [1, 3, 7, 15, 16], "failed after {limit}");
        for row in rows {
            let expected = row.samples as f64 * SAMPLE_S;
            assert!(
                (row.render_s / expected - 1.0).abs() < 1e-9,
                "failed after {limit}: {} s for {} samples, not {expected} s",
                row.render_s,
                row.samples
            );
            assert_eq!(row.paths, 32 * row.samples, "failed after {limit}");
        }
    }
    assert!(resumed_mid_wave > 3, "{resumed_mid_wave}");
}

/// Renders a run without interruption and returns the render times of its checkpoints in seconds.
fn checkpoint_clocks(
    interval_s: Option<f64>,
    sample_s: f64,
    samples: u64,
    delay: Duration,
) -> Vec<f64> {
    let mut lab = Lab::new();
    lab.spec.night.checkpoint_s = interval_s;
    lab.stop = Box::new(move |_| Ok(StopRule::Samples(samples)));
    let night = Night {
        history: Memory {
            delay,
            ..Memory::with_checkpoints()
        },
        open: &|_, scene, job| {
            let mock = MockRenderer::new(scene, job);
            Ok(Box::new(Wrapped::new(mock, move |mock, request| {
                Ok(WaveStats {
                    render_s: sample_s * request.samples as f64,
                    ..mock.render(request)?
                })
            })))
        },
        ..Night::default()
    };
    let summary = render(&night, &lab);
    assert!(matches!(outcomes(&summary)[0], Outcome::Done(_)));
    let checkpoints = night.history.checkpoints.borrow();
    let written = checkpoints.values().flatten();
    written.map(|c| c.progress.render_s()).collect()
}

/// The run takes minutes of render time, but only milliseconds of wall-clock time.
#[test]
fn the_interval_of_checkpoints_is_one_of_render_time() {
    let clocks = |interval_s| checkpoint_clocks(interval_s, 25.0, 12, Duration::ZERO);
    assert_eq!(clocks(Some(60.0)), [75.0, 150.0, 225.0, 300.0]);
    assert_eq!(clocks(Some(100.0)), [100.0, 200.0, 300.0]);
}

/// Writing takes at least the delay, on any machine. A hundred times as much is 61 s, longer than the
/// second sample takes.
#[test]
fn writing_checkpoints_takes_at_most_a_hundredth_of_the_render_time_by_default() {
    let delay = Duration::from_millis(610);
    assert_eq!(checkpoint_clocks(None, 60.5, 2, delay), [60.5]);
}
