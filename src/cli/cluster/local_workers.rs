//! Additional worker processes of `lumbre run`: one for each device of this machine except the one
//! on which the process itself renders.

use std::collections::BTreeSet;
use std::fs::OpenOptions;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use super::job;
use crate::cli::args::{Global, NightArgs};
use crate::cli::exit::{Failure, print_status};
use crate::cli::format::display_path;
use lumbre_night::experiment::comparison_groups::{Affinity, comparison_group};
use lumbre_night::experiment::{CellRef, NightControls, Plan};

/// Time between two checks whether the workers have exited.
const POLL_INTERVAL: Duration = Duration::from_millis(100);

/// Local worker processes. They save a checkpoint and exit when this is dropped or this process
/// dies, since their stdin closes.
#[derive(Debug, Default)]
pub struct LocalWorkers(Vec<LocalWorker>);

/// One local worker process.
#[derive(Debug)]
struct LocalWorker {
    process: Child,
    /// Index of its device.
    device: String,
    /// File that receives its stderr.
    log: PathBuf,
}

impl LocalWorkers {
    /// Returns the indices of the devices for additional workers: those given to `--devices` after
    /// the first, or else the devices of the same model as the one on which this process renders.
    ///
    /// # Errors
    /// Returns an error if a given device does not exist.
    pub fn devices(plan: &Plan, night: &NightArgs) -> Result<Vec<String>, Failure> {
        if !night.devices.is_empty() {
            let indices =
                lumbre_night::backends::resolve_devices(&night.devices).map_err(Failure::usage)?;
            return Ok(indices.into_iter().skip(1).collect());
        }
        let backends: BTreeSet<&str> = plan
            .cells
            .iter()
            .map(|cell| cell.config.backend.as_str())
            .collect();
        let same_model: BTreeSet<String> = backends
            .into_iter()
            .flat_map(lumbre_night::backends::same_model_devices)
            .collect();
        Ok(same_model.into_iter().collect())
    }

    /// Starts a worker for each of these devices, but no more than can work at once. `is_open`
    /// returns whether a run is not finished yet.
    ///
    /// # Errors
    /// Returns an error if a worker cannot be started.
    pub fn start(
        devices: &[String],
        plan: &Plan,
        home: &Path,
        night: &NightArgs,
        global: &Global,
        is_open: &dyn Fn(CellRef) -> bool,
    ) -> Result<LocalWorkers, Failure> {
        let mut workers = LocalWorkers::default();
        let useful = max_parallel_workers(plan, night.affinity, is_open).saturating_sub(1);
        for device in devices.iter().take(useful) {
            let worker = LocalWorker::start(device, home, night, global, plan.commands_allowed)
                .map_err(|e| {
                    Failure::internal(format!("cannot start the worker for device {device}: {e}"))
                })?;
            workers.0.push(worker);
            if !global.quiet {
                print_status(&format!("started a worker process for device {device}"));
            }
        }
        Ok(workers)
    }

    /// Waits until all workers have exited or a stop is requested, then stops them as
    /// [`Self::stop`] does.
    pub fn wait(&mut self, control: &NightControls) {
        while !control.stop_requested()
            && self
                .0
                .iter_mut()
                .any(|worker| matches!(worker.process.try_wait(), Ok(None)))
        {
            std::thread::sleep(POLL_INTERVAL);
        }
        self.stop();
    }

    /// Asks all workers to save a checkpoint and exit, waits for them, and prints which of them
    /// failed.
    pub fn stop(&mut self) {
        // Close every stdin before waiting for the first process, so that all stop at the same
        // time.
        self.0
            .iter_mut()
            .for_each(|worker| drop(worker.process.stdin.take()));
        for mut worker in std::mem::take(&mut self.0) {
            let Ok(status) = worker.process.wait() else {
                continue;
            };
            // This process reports failed cells and work that is left.
            if !matches!(status.code(), Some(0 | 3 | 4 | 6 | 75 | 130)) {
                print_status(&format!(
                    "the worker for device {} failed ({status}); see {}",
                    worker.device,
                    display_path(&worker.log)
                ));
            }
        }
    }
}

impl Drop for LocalWorkers {
    fn drop(&mut self) {
        self.stop();
    }
}

impl LocalWorker {
    /// Starts `lumbre work` on one device; `commands` is whether commands of the script may run.
    /// Its stderr is appended to a log in the night's folder.
    fn start(
        device: &str,
        home: &Path,
        night: &NightArgs,
        global: &Global,
        commands: bool,
    ) -> std::io::Result<LocalWorker> {
        let home = home.canonicalize()?;
        let log = job::log_file(&home, &format!("device-{device}"));
        std::fs::create_dir_all(log.parent().unwrap_or(&home))?;
        let stderr = OpenOptions::new().create(true).append(true).open(&log)?;
        let mut command = Command::new(std::env::current_exe()?);
        command.arg("work").arg(&home).args([
            "--device",
            device,
            "--affinity",
            night.affinity.name(),
        ]);
        command.args([
            "--no-tui",
            "--while-stdin",
            "--threads",
            &global.threads.to_string(),
        ]);
        if let Some(bytes) = global.memory {
            command.arg("--memory").arg(format!("{bytes}B"));
        }
        if commands {
            command.arg("--allow-commands");
        }
        if let Some(folder) = &global.confine {
            command.arg("--confine").arg(folder);
        }
        let process = command
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(stderr)
            .spawn()?;
        Ok(LocalWorker {
            process,
            device: device.to_owned(),
            log,
        })
    }
}

/// Returns the number of workers that can work on a plan at the same time.
fn max_parallel_workers(
    plan: &Plan,
    affinity: Affinity,
    is_open: &dyn Fn(CellRef) -> bool,
) -> usize {
    let cells = || (0..plan.cells.len()).filter(|i| is_open(CellRef::Cell(*i)));
    let references = (0..plan.references.len())
        .filter(|i| is_open(CellRef::Reference(*i)))
        .count();
    match affinity {
        Affinity::Device => cells()
            .map(|i| comparison_group(&plan.cells[i]))
            .collect::<BTreeSet<String>>()
            .len()
            .max(references),
        Affinity::Model | Affinity::None => cells().count() + references,
    }
}
