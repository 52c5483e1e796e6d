//! Progress of an unfinished run, its checkpoints, and claims on it.

use super::outcome::WaveRow;
use lumbre_render::WaveStats;

/// State of a run between two calls of its renderer, apart from the renderer's own sums.
///
/// Stop rules depend on nothing but the rows, so the rows are also the state of the rules. The rows
/// carry the accumulated clocks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunProgress {
    /// Measurements, oldest first.
    pub rows: Vec<WaveRow>,
    /// Work since the last measurement.
    pub current_wave: WaveStats,
    /// Samples per pixel that the wave in progress still has to render.
    pub samples_left: u64,
    /// Upper limit of the next wave's size, in samples per pixel.
    pub next_wave_max: u64,
    /// Wall-clock seconds of the run over all launches.
    pub wall_s: f64,
}

impl RunProgress {
    /// Samples per pixel so far.
    pub fn samples(&self) -> u64 {
        self.rows.last().map_or(0, |row| row.samples) + self.current_wave.samples
    }

    /// Seconds inside the renderer so far.
    pub fn render_s(&self) -> f64 {
        self.rows.last().map_or(0.0, |row| row.render_s) + self.current_wave.render_s
    }

    /// Samples per pixel per second of render time; NaN before the first sample.
    pub fn rate(&self) -> f64 {
        self.samples() as f64 / self.render_s()
    }

    /// Whether no wave is in progress, so that everything rendered has been measured.
    pub fn between_waves(&self) -> bool {
        self.samples_left == 0 && self.current_wave.samples == 0
    }

    /// Adds the work of one call of the renderer to the wave in progress.
    pub fn add(&mut self, stats: &WaveStats) {
        self.current_wave.add(stats);
        self.samples_left = self.samples_left.saturating_sub(stats.samples);
    }

    /// Message about the invalid samples of the wave in progress.
    pub fn describe_invalid(&self) -> String {
        let first = match self.current_wave.first_invalid {
            Some([x, y, sample]) => format!(", the first at column {x}, row {y}, sample {sample}"),
            None => String::new(),
        };
        let wave = self.rows.len() + 1;
        format!(
            "{} invalid samples (NaN or infinite) in wave {wave}{first}; they count as black",
            self.current_wave.invalid
        )
    }

    /// Ends the wave in progress and returns its row, without metrics and wall-clock time.
    pub fn close_wave(&mut self) -> WaveRow {
        let wave = std::mem::take(&mut self.current_wave);
        let last = self.rows.last().cloned().unwrap_or_default();
        WaveRow {
            wave: last.wave + 1,
            samples: last.samples + wave.samples,
            render_s: last.render_s + wave.render_s,
            lost_s: last.lost_s + wave.lost_s,
            paths: last.paths + wave.paths,
            rays: last.rays + wave.rays,
            invalid: last.invalid + wave.invalid,
            first_invalid: last.first_invalid.or(wave.first_invalid),
            ..WaveRow::default()
        }
    }
}

/// Checkpoint of an unfinished run or of a shard.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// Progress at the time of the checkpoint.
    pub progress: RunProgress,
    /// State saved by the renderer.
    pub state: Vec<u8>,
}

/// Result of claiming a run or shard.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Claim {
    /// This process holds the claim from now on.
    Granted,
    /// Another process holds it; the text identifies that process.
    HeldBy(String),
    /// This process may never hold it, because the run needs another kind of worker; the text is
    /// the reason.
    WrongWorker(String),
}

/// Outcome of a run as reported by another worker. The files of the run itself take precedence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ReportedOutcome {
    /// Finished, in this folder.
    Done(std::path::PathBuf),
    /// Failed, for this reason.
    Failed(String),
}
