//! The further workers of `lumbre run`: one for every device of this machine but the one that it renders on itself.

use std::collections::BTreeSet;
use std::fs::OpenOptions;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use super::job;
use crate::cli::args::{Global, NightArgs};
use crate::cli::exit::{Failure, talk};
use crate::cli::load::shown;
use crate::experiment::groups::{Affinity, group};
use crate::experiment::{CellRef, Control, Plan};
use crate::render;

/// How often it is looked whether they have left.
const GLANCE: Duration = Duration::from_millis(100);

/// Workers that leave with a checkpoint when this is dropped, or this process dies.
#[derive(Debug, Default)]
pub struct Hands(Vec<Hand>);

#[derive(Debug)]
struct Hand {
    process: Child,
    device: String,
    log: PathBuf,
}

impl Hands {
    /// The places of the devices that further workers of a plan are to render on: those that were named behind the first,
    /// or those that are like the one that this process renders on.
    ///
    /// # Errors
    /// When a device that was named is not there.
    pub fn devices(plan: &Plan, night: &NightArgs) -> Result<Vec<String>, Failure> {
        if !night.devices.is_empty() {
            let places = render::device_places(&night.devices).map_err(Failure::usage)?;
            return Ok(places.into_iter().skip(1).collect());
        }
        let backends: BTreeSet<&str> = plan.cells.iter().map(|cell| cell.config.backend.as_str()).collect();
        let alike: BTreeSet<String> = backends.into_iter().flat_map(render::devices_alike).collect();
        Ok(alike.into_iter().collect())
    }

    /// Starts a worker for each of these devices, as far as there is something for it to do. `open` says what is not done.
    ///
    /// # Errors
    /// When one cannot be started.
    pub fn start(
        devices: &[String],
        plan: &Plan,
        home: &Path,
        night: &NightArgs,
        global: &Global,
        open: &dyn Fn(CellRef) -> bool,
    ) -> Result<Hands, Failure> {
        let mut hands = Hands::default();
        for device in devices.iter().take(places(plan, night.affinity, open).saturating_sub(1)) {
            hands
                .0
                .push(Hand::start(device, home, night, global).map_err(|e| {
                    Failure::internal(format!("the worker for device {device} cannot be started: {e}"))
                })?);
            if !global.quiet {
                talk(&format!("device {device} has a worker of its own"));
            }
        }
        Ok(hands)
    }

    /// Waits until all have left, or the night is to stop, and says how those left whose night did not go well.
    pub fn wait(&mut self, control: &Control) {
        while !control.stop_requested() && self.0.iter_mut().any(|hand| matches!(hand.process.try_wait(), Ok(None))) {
            std::thread::sleep(GLANCE);
        }
        self.end();
    }

    /// Asks all to leave, waits until they have, and says how.
    pub fn end(&mut self) {
        // All are asked before one is waited for.
        self.0.iter_mut().for_each(|hand| drop(hand.process.stdin.take()));
        for mut hand in std::mem::take(&mut self.0) {
            let Ok(status) = hand.process.wait() else { continue };
            // Work that is left, and cells that failed, are seen by who started it.
            if !matches!(status.code(), Some(0 | 3 | 4 | 6 | 75 | 130)) {
                talk(&format!("the worker of device {} ended by {status}: {}", hand.device, shown(&hand.log)));
            }
        }
    }
}

impl Drop for Hands {
    fn drop(&mut self) {
        self.end();
    }
}

impl Hand {
    fn start(device: &str, home: &Path, night: &NightArgs, global: &Global) -> std::io::Result<Hand> {
        let home = home.canonicalize()?;
        let log = job::log_file(&home, &format!("device-{device}"));
        std::fs::create_dir_all(log.parent().unwrap_or(&home))?;
        let said = OpenOptions::new().create(true).append(true).open(&log)?;
        let mut command = Command::new(std::env::current_exe()?);
        command.arg("work").arg(&home).args(["--device", device, "--affinity", night.affinity.word()]);
        command.args(["--no-tui", "--while-stdin", "--threads", &global.threads.to_string()]);
        let process = command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(said).spawn()?;
        Ok(Hand { process, device: device.to_owned(), log })
    }
}

/// How many workers find something to do at once.
fn places(plan: &Plan, affinity: Affinity, open: &dyn Fn(CellRef) -> bool) -> usize {
    let cells = || (0..plan.cells.len()).filter(|i| open(CellRef::Cell(*i)));
    let references = (0..plan.references.len()).filter(|i| open(CellRef::Reference(*i))).count();
    match affinity {
        Affinity::Device => cells().map(|i| group(&plan.cells[i])).collect::<BTreeSet<String>>().len().max(references),
        Affinity::Model | Affinity::None => cells().count() + references,
    }
}
