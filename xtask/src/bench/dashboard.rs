//! CPU time of the dashboard while a night renders.

use std::sync::Arc;
use std::time::Duration;

use super::{metrics, night};
use lumbre::cli::bench::backends::PROTOCOL;
use lumbre_night::experiment::processor_time;
use lumbre_night::experiment::{CellRef, Event, Night, WaveRow};
use lumbre_render::{Device, OpenStats};
use lumbre_tui::tui::model::night::NightModel;
use lumbre_tui::tui::terminal::offscreen::{DrawStats, draw_for};

/// Duration of a measurement.
const TIME: Duration = Duration::from_secs(8);
/// Seconds between two waves of the simulated night, each with a new picture.
const EVERY_S: f64 = 0.5;
/// Columns and rows of the screens.
const SIZES: [(u16, u16); 2] = [(80, 24), (200, 60)];

/// Cost of the dashboard on one screen.
pub struct DashboardCost {
    size: (u16, u16),
    drawn: DrawStats,
    /// Fraction of one core, if the system reports thread times.
    share: Option<f64>,
}

/// Draws a cell of 1280x720 that is measured twice per second, as `lumbre run` does, on screens of
/// two sizes.
///
/// # Errors
/// A message for the user if the simulated night cannot be planned.
pub fn measure() -> Result<Vec<DashboardCost>, String> {
    SIZES.into_iter().map(measure_one).collect()
}

fn measure_one(size: (u16, u16)) -> Result<DashboardCost, String> {
    let plan = night::plan_of_one_cell(metrics::SIZE, &PROTOCOL)?;
    let pictures = [1, 2, 3].map(|seed| Arc::new(metrics::picture(seed)));
    let draw = move || -> Result<DashboardCost, String> {
        // As in the dashboard's own thread, tone mapping must not use other threads.
        let _pool = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .use_current_thread()
            .build();
        let cell = CellRef::Cell(0);
        let mut model = NightModel::new(Night::planned(&plan));
        let night = Arc::new(model.night.clone());
        model.receive(&Event::NightStarted { night }, 0.0);
        let started = Event::CellStarted {
            cell,
            open: OpenStats {
                devices: vec![Device::processor(1)],
                ..OpenStats::default()
            },
            reference: Some(pictures[0].clone()),
            resumed: None,
            settings: None,
        };
        model.receive(&started, 0.0);
        let mut waves = 0u64;
        let mut update = |model: &mut NightModel, now_s: f64| {
            if now_s < waves as f64 * EVERY_S {
                return;
            }
            waves += 1;
            let wave = Event::Wave {
                cell,
                row: synthetic_wave(waves, now_s),
                measure_s: 0.05,
                image: Some(pictures[1 + (waves % 2) as usize].clone()),
                noise: None,
                pow2: false,
            };
            model.receive(&wave, now_s);
        };
        let before = processor_time::thread_time();
        let drawn = draw_for(TIME, size, &mut model, &mut update).map_err(|e| e.to_string())?;
        let spent = before
            .zip(processor_time::thread_time())
            .map(|(before, after)| (after - before).as_secs_f64());
        Ok(DashboardCost {
            size,
            drawn,
            share: spent.map(|s| s / TIME.as_secs_f64()),
        })
    };
    let thread = std::thread::Builder::new()
        .name("dashboard".to_owned())
        .spawn(draw)
        .map_err(|e| e.to_string())?;
    thread
        .join()
        .map_err(|_| "the drawing thread panicked".to_owned())?
}

/// Returns a measurement with Monte Carlo errors.
fn synthetic_wave(wave: u64, now_s: f64) -> WaveRow {
    let samples = 4 * wave;
    let paths = samples * u64::from(metrics::SIZE[0] * metrics::SIZE[1]);
    let error = 1.0 / (samples as f64).sqrt();
    WaveRow {
        wave,
        samples,
        render_s: now_s.max(1e-3),
        wall_s: now_s,
        paths,
        rays: 5 * paths,
        metrics: vec![error * error, error, 1.0 - error, error],
        ..WaveRow::default()
    }
}

/// Formats the figures as text.
pub fn table(rows: &[DashboardCost]) -> String {
    let line = |row: &DashboardCost| {
        let share = row
            .share
            .map_or_else(|| "        -".to_owned(), |s| format!("{:>9.2}", s * 100.0));
        let (columns, lines) = row.size;
        format!(
            "{:<37}{share} % of one core, {} frames, {} bytes\n",
            format!("dashboard, {columns}x{lines}, 1280x720 px"),
            row.drawn.frames,
            row.drawn.bytes
        )
    };
    rows.iter().map(line).collect()
}
