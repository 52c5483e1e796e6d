//! Names, measurements and outcomes of the runs of a night.

/// A cell of the plan, or one of its references.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum CellRef {
    /// Index into [`Plan::cells`](super::Plan::cells).
    Cell(usize),
    /// Index into [`Plan::references`](super::Plan::references).
    Reference(usize),
}

/// One measurement: cumulative counters and metrics of a run at the end of a wave.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WaveRow {
    /// Number of the wave, from 1.
    pub wave: u64,
    /// Samples per pixel so far.
    pub samples: u64,
    /// Seconds inside the renderer so far.
    pub render_s: f64,
    /// Wall-clock seconds so far, with measuring and without pauses. For an interleaved run only
    /// its own turns count.
    pub wall_s: f64,
    /// Seconds so far that other work on the machine took from the renderer, or during which the
    /// process was stopped; not included in `render_s`, and 0 where that is not watched.
    pub lost_s: f64,
    /// Seconds spent measuring so far; not included in `render_s`.
    pub measure_s: f64,
    /// Camera paths so far.
    pub paths: u64,
    /// Rays so far.
    pub rays: u64,
    /// Invalid samples so far.
    pub invalid: u64,
    /// Column, row and sample of the first invalid sample.
    pub first_invalid: Option<[u64; 3]>,
    /// Metrics in the order of the plan's columns; empty for references and for cells without one.
    pub metrics: Vec<f64>,
}

impl WaveRow {
    /// Returns the same totals as a single wave, number 1.
    pub fn as_single_wave(&self) -> WaveRow {
        WaveRow {
            wave: 1,
            ..self.clone()
        }
    }

    /// Millions of camera paths per second of render time; zero before the first wave.
    pub fn mpaths_per_s(&self) -> f64 {
        if self.render_s > 0.0 {
            self.paths as f64 / self.render_s / 1e6
        } else {
            0.0
        }
    }

    /// Frames per second of render time; zero before the first wave. A frame is one sample per
    /// pixel.
    pub fn fps(&self) -> f64 {
        if self.render_s > 0.0 {
            self.samples as f64 / self.render_s
        } else {
            0.0
        }
    }
}

/// Clause of a stop rule that ended a run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EndCause {
    /// The clause, for people: `ssim > 0.95`.
    pub clause: String,
    /// Whether it is a limit of render time or of samples, and nothing else.
    pub is_limit: bool,
}

impl EndCause {
    /// Creates a limit of render time or of samples.
    pub fn limit(clause: impl Into<String>) -> EndCause {
        EndCause {
            clause: clause.into(),
            is_limit: true,
        }
    }

    /// Creates a clause that is no such limit.
    pub fn other(clause: impl Into<String>) -> EndCause {
        EndCause {
            clause: clause.into(),
            is_limit: false,
        }
    }
}

/// Outcome of a cell or reference.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// Finished by its stop rule, by the clause that held.
    Done(EndCause),
    /// Found finished in this folder; nothing was rendered.
    Cached(std::path::PathBuf),
    /// Failed for this reason; the night continues.
    Failed(String),
    /// Ended early by the user, a signal or the deadline.
    Interrupted,
}

/// Severity of a message.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    serde::Serialize,
    serde::Deserialize,
)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// Progress, a few lines per cell.
    #[default]
    Info,
    /// Something deviated from the request, without loss of results.
    Warn,
    /// A result was lost or is in doubt.
    Error,
}
