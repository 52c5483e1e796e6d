//! What the dashboard takes of one core while a night renders.

use std::sync::Arc;
use std::time::Duration;

use serde_json::{Value as Json, json};

use super::{metrics, night};
use crate::experiment::{CellRef, Outline, WaveRow, processor};
use crate::render::OpenStats;
use crate::tui::model::Model;
use crate::tui::offscreen::{Drawn, draw_for};

/// How long it is watched.
const TIME: Duration = Duration::from_secs(8);
/// Seconds between two measurements of the night, each with a new picture.
const EVERY_S: f64 = 0.5;
/// Columns and rows of the screens.
const SIZES: [(u16, u16); 2] = [(80, 24), (200, 60)];

/// One screen.
pub struct Row {
    size: (u16, u16),
    drawn: Drawn,
    /// Part of one core, where the system tells.
    share: Option<f64>,
}

/// Shows a cell of 1280x720 that is measured twice a second, as `lumbre run` does, on screens of two sizes.
///
/// # Errors
/// When the night cannot be made up, with a message for people.
pub fn measure() -> Result<Vec<Row>, String> {
    SIZES.into_iter().map(one).collect()
}

fn one(size: (u16, u16)) -> Result<Row, String> {
    let plan = night::plan_of_one_cell(metrics::SIZE, &metrics::PROTOCOL)?;
    let pictures = [1, 2, 3].map(|seed| Arc::new(metrics::picture(seed)));
    let watching = move || -> Result<Row, String> {
        // As the dashboard's own thread: tone maps stay on it.
        let _pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
        let cell = CellRef::Cell(0);
        let mut model = Model::default();
        model.begin(Arc::new(Outline::of(&plan)), 0.0);
        model.start(
            cell,
            OpenStats { device: "cpu".to_owned(), ..OpenStats::default() },
            Some(pictures[0].clone()),
            0.0,
        );
        let mut waves = 0u64;
        let mut news = |model: &mut Model, now_s: f64| {
            if now_s < waves as f64 * EVERY_S {
                return;
            }
            waves += 1;
            let samples = 4 * waves;
            let paths = samples * u64::from(metrics::SIZE[0] * metrics::SIZE[1]);
            let error = 1.0 / (samples as f64).sqrt();
            let values = vec![error * error, error, 1.0 - error, error];
            let row = WaveRow {
                wave: waves,
                samples,
                render_s: now_s.max(1e-3),
                wall_s: now_s,
                paths,
                rays: 5 * paths,
                metrics: values,
                ..WaveRow::default()
            };
            model.wave(cell, &row, 0.05, now_s);
            model.picture(cell, pictures[1 + (waves % 2) as usize].clone());
        };
        let before = processor::of_thread();
        let drawn = draw_for(TIME, size, &mut model, &mut news).map_err(|e| e.to_string())?;
        let spent = before.zip(processor::of_thread()).map(|(before, after)| (after - before).as_secs_f64());
        Ok(Row { size, drawn, share: spent.map(|s| s / TIME.as_secs_f64()) })
    };
    let thread = std::thread::Builder::new().name("dashboard".to_owned()).spawn(watching).map_err(|e| e.to_string())?;
    thread.join().map_err(|_| "drawing failed".to_owned())?
}

/// The lines of the table for people.
pub fn table(rows: &[Row]) -> String {
    let line = |row: &Row| {
        let share = row.share.map_or_else(|| "        -".to_owned(), |s| format!("{:>9.2}", s * 100.0));
        let (columns, lines) = row.size;
        format!("{:<37}{share} % of one core\n", format!("dashboard, {columns}x{lines}, 1280x720 px"))
    };
    rows.iter().map(line).collect()
}

/// The same figures as JSON.
pub fn to_json(rows: &[Row]) -> Json {
    rows.iter()
        .map(|row| {
            json!({ "columns": row.size.0, "rows": row.size.1, "frames": row.drawn.frames, "bytes": row.drawn.bytes,
                    "share_of_core": row.share })
        })
        .collect()
}
