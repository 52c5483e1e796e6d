//! What nights left behind, as plain data: the ground on which reports stand.
//!
//! Nothing here was planned in this process. It is read back from folders, perhaps of another machine, so every fact
//! that a folder may lack is an option, and nothing is filled in that it does not say.

use std::path::PathBuf;

use super::WaveRow;
use crate::metrics::MetricSpec;
use crate::value::Value;

/// One night's folder.
#[derive(Clone, Debug)]
pub struct Night {
    /// The folder.
    pub folder: PathBuf,
    /// The experiment's name.
    pub name: String,
    /// The plan's hash, hex.
    pub plan: String,
    /// Seed of the experiment.
    pub seed: u64,
    /// Axis names in order.
    pub axes: Vec<String>,
    /// Metrics with their definitions, in the order of [`WaveRow::metrics`] of every run here.
    pub metrics: Vec<MetricSpec>,
    /// The machine on which it last rendered, if it said.
    pub machine: Option<Machine>,
    /// The runs of its cells in the order of the plan, whatever their state.
    pub runs: Vec<Run>,
    /// Its references, in the order of the plan.
    pub references: Vec<Truth>,
    /// What could not be read or has no place here, in sentences.
    pub notes: Vec<String>,
}

/// A machine, as `env.json` describes it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Machine {
    /// Its name, empty if unknown.
    pub host: String,
    /// Operating system and architecture.
    pub os: String,
    /// The processor's model.
    pub cpu: String,
    /// Cores that the process could use.
    pub cores: u64,
    /// The program and its version.
    pub program: String,
    /// When the night last rendered, UTC.
    pub date: String,
    /// The command line's arguments.
    pub arguments: Vec<String>,
}

/// How far a run is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum State {
    /// Finished by its stop rule; the text says by which part of it.
    Done(String),
    /// It has measurements but did not finish.
    Unfinished,
    /// Nothing is there.
    Pending,
}

/// One run of a cell.
#[derive(Clone, Debug)]
pub struct Run {
    /// Its identity.
    pub id: String,
    /// Readable path.
    pub path: String,
    /// Its folder, whether or not it is there.
    pub folder: PathBuf,
    /// Axis values in the order of the axes.
    pub point: Vec<(String, Value)>,
    /// Number of the repeat, from 0.
    pub repeat: u64,
    /// Seed of its random numbers.
    pub seed: u64,
    /// Name of its integrator.
    pub integrator: String,
    /// The scene as the script wrote it.
    pub scene: String,
    /// Width and height in pixels, if known.
    pub resolution: Option<[u32; 2]>,
    /// The device that rendered it, if it is finished.
    pub device: Option<String>,
    /// The other program that rendered it, with its version, if another did.
    pub peer: Option<String>,
    /// How far it is.
    pub state: State,
    /// Its measurements, oldest first.
    pub rows: Vec<WaveRow>,
    /// Index into [`Night::references`].
    pub reference: Option<usize>,
    /// Kept pictures by samples per pixel, ascending; the final one is the last if the run is done.
    pub pictures: Vec<(u64, PathBuf)>,
    /// Names of its films, without extension.
    pub films: Vec<String>,
    /// Seconds spent building acceleration structures, and their nodes.
    pub accel: Option<(f64, u64)>,
    /// Their bytes and cost by the surface area heuristic, where the run says them.
    pub accel_size: Option<(u64, f64)>,
    /// What the true picture would measure against its reference because of the reference's own noise, by column; empty
    /// if unknown.
    pub floors: Vec<(String, f64)>,
}

impl Run {
    /// Whether it finished.
    pub fn done(&self) -> bool {
        matches!(self.state, State::Done(_))
    }

    /// The text of its value on an axis.
    pub fn value(&self, axis: &str) -> Option<String> {
        self.point.iter().find(|(name, _)| name == axis).map(|(_, value)| value.to_string())
    }

    /// Samples per pixel and second of render time over the whole run; `None` before the first wave.
    pub fn samples_per_s(&self) -> Option<f64> {
        let last = self.rows.last().filter(|row| row.render_s > 0.0)?;
        Some(last.samples as f64 / last.render_s)
    }

    /// Millions of rays per second of render time over the whole run.
    pub fn mrays_per_s(&self) -> Option<f64> {
        let last = self.rows.last().filter(|row| row.render_s > 0.0 && row.rays > 0)?;
        Some(last.rays as f64 / last.render_s / 1e6)
    }
}

/// A reference that runs were measured against.
#[derive(Clone, Debug)]
pub struct Truth {
    /// Its identity.
    pub id: String,
    /// Its picture, if it is there.
    pub picture: Option<PathBuf>,
    /// In words: integrator and samples per pixel, or the file's name.
    pub words: String,
}

impl Night {
    /// What a run was rendered on, for people: the processor's model for the `cpu` backend, which only says how many
    /// threads it had, and otherwise what the backend called its device. `None` if the folder does not say.
    pub fn device(&self, run: &Run) -> Option<String> {
        let device = run.device.as_deref().filter(|d| !d.is_empty())?;
        match (&self.machine, device.starts_with("cpu")) {
            (Some(machine), true) if !machine.cpu.is_empty() => {
                let threads = device.split(',').map(str::trim).find(|part| part.contains("thread"));
                Some(threads.map_or(machine.cpu.clone(), |threads| format!("{}, {threads}", machine.cpu)))
            }
            _ => Some(device.to_owned()),
        }
    }

    /// Every device of its finished runs, once, in the order of the plan.
    pub fn devices(&self) -> Vec<String> {
        let mut devices: Vec<String> = Vec::new();
        for device in self.runs.iter().filter(|run| run.done()).filter_map(|run| self.device(run)) {
            if !devices.contains(&device) {
                devices.push(device);
            }
        }
        devices
    }

    /// The place of a column among [`Night::metrics`].
    pub fn column(&self, name: &str) -> Option<usize> {
        self.metrics.iter().position(|metric| metric.column == name)
    }
}
