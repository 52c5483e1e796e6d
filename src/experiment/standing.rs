//! What of an unfinished run outlives the process, and who works on it.

use super::event::WaveRow;
use crate::render::WaveStats;

/// Where a run stands between two calls of its renderer, besides the renderer's own sums.
///
/// Stop rules see rows and nothing else, so the rows are their state; and the rows carry the accumulated clock.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Standing {
    /// Its measurements, oldest first.
    pub rows: Vec<WaveRow>,
    /// What it did since the last of them.
    pub part: WaveStats,
    /// Samples that the wave in progress still has to bring.
    pub left: u64,
    /// Most samples of the wave after it.
    pub growth: u64,
    /// Seconds that it has taken, everything included, over all launches.
    pub wall_s: f64,
}

impl Standing {
    /// Samples per pixel so far.
    pub fn samples(&self) -> u64 {
        self.rows.last().map_or(0, |row| row.samples) + self.part.samples
    }

    /// Seconds inside the renderer so far.
    pub fn render_s(&self) -> f64 {
        self.rows.last().map_or(0.0, |row| row.render_s) + self.part.render_s
    }

    /// Samples of every pixel in a second of rendering; not a number before the first.
    pub fn rate(&self) -> f64 {
        self.samples() as f64 / self.render_s()
    }

    /// Whether all that was rendered is measured, and no wave is in progress.
    pub fn between_waves(&self) -> bool {
        self.left == 0 && self.part.samples == 0
    }

    /// Counts what a call of the renderer did.
    pub fn count(&mut self, stats: &WaveStats) {
        self.part.add(stats);
        self.left = self.left.saturating_sub(stats.samples);
    }

    /// What there is to say of invalid samples in the wave in progress.
    pub fn invalid_words(&self) -> String {
        let place = match self.part.first_invalid {
            Some([x, y, sample]) => format!(", the first at column {x}, row {y}, sample {sample}"),
            None => String::new(),
        };
        let wave = self.rows.len() + 1;
        format!("{} invalid samples (NaN or infinite) in wave {wave}{place}; they count as black", self.part.invalid)
    }

    /// Ends the wave: its row, without metrics and wall clock.
    pub fn close_wave(&mut self) -> WaveRow {
        let part = std::mem::take(&mut self.part);
        let last = self.rows.last().cloned().unwrap_or_default();
        WaveRow {
            wave: last.wave + 1,
            samples: last.samples + part.samples,
            render_s: last.render_s + part.render_s,
            paths: last.paths + part.paths,
            rays: last.rays + part.rays,
            invalid: last.invalid + part.invalid,
            first_invalid: last.first_invalid.or(part.first_invalid),
            ..WaveRow::default()
        }
    }
}

/// An unfinished run as an earlier process left it.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// Where it stands.
    pub standing: Standing,
    /// What its renderer saved.
    pub state: Vec<u8>,
}

/// Who works on a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Claim {
    /// This process, from now on.
    Ours,
    /// Another one; the text says which.
    Theirs(String),
    /// None here, whatever happens: it is for another kind of worker, as the text says.
    Never(String),
}

/// What another worker made of a run, as it says; what the run's own files say counts more.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Settled {
    /// It is done, in this folder.
    Done(std::path::PathBuf),
    /// It failed, for this reason.
    Failed(String),
}
