//! Simulates a night of a thousand workers within minutes. Rendering takes virtual time in a
//! discrete event simulation, while every claim, take-over and last file is real, in a real folder,
//! created by the code that real workers run.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

use lumbre_night::experiment::run::backoff::{BATCH, Backoff, TICK_S};
use lumbre_night::experiment::run_progress::Claim;
use lumbre_night::store::StoreError;
use lumbre_night::store::lock::claim;
use lumbre_night::store::lock::claim::{Claims, HEARTBEAT, LEASE};

/// Parameters of the simulated night. All times are virtual.
#[derive(Clone, Copy, Debug)]
pub struct ClusterSimulation {
    /// Number of cells.
    pub cells: usize,
    /// Number of workers.
    pub workers: usize,
    /// Mean render time of a cell in seconds; single cells are exponentially distributed.
    pub cell_s: f64,
    /// Probability that a worker dies while it renders a cell and is queued again.
    pub death: f64,
    /// Probability that a worker stalls for longer than its lease and then continues.
    pub stall: f64,
    /// Seconds until a worker that died is restarted.
    pub requeue_s: f64,
    /// Seconds of render time between two checkpoints.
    pub checkpoint_s: f64,
    /// Seconds that one operation on the shared folder takes.
    pub operation_s: f64,
    /// Seed of cell durations and failures.
    pub seed: u64,
}

/// Results of a simulated night.
#[derive(Clone, Copy, Debug, Default)]
pub struct SimulationResult {
    /// Virtual seconds until all cells were finished.
    pub night_s: f64,
    /// Lower bound of `night_s` in seconds: the longest cell, or all work evenly spread over
    /// workers that never fail, whichever is longer.
    pub ideal_s: f64,
    /// Virtual seconds of rendering that were lost since a checkpoint or done twice.
    pub wasted_s: f64,
    /// Virtual seconds of rendering in total.
    pub work_s: f64,
    /// Virtual seconds that workers spent waiting for other workers' last cells.
    pub idle_s: f64,
    /// Number of workers that died.
    pub deaths: usize,
    /// Number of workers that stalled.
    pub stalls: usize,
    /// Number of cells that were finished more than once.
    pub finished_twice: usize,
    /// Number of claims that were requested.
    pub claims_requested: usize,
    /// Number of claims that were granted.
    pub claims_granted: usize,
    /// Real seconds spent claiming, finishing and releasing runs.
    pub real_s: f64,
    /// Number of file system operations: opens, links, renames, checks, listings, heartbeats.
    pub operations: u64,
    /// Largest number of operations in one virtual second.
    pub busiest: u64,
}

impl SimulationResult {
    /// Number of runs per second that one process can claim, finish and release in this folder.
    pub fn claims_per_s(&self) -> f64 {
        self.claims_granted as f64 / self.real_s.max(1e-9)
    }
}

/// Event of the simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
struct SimEvent {
    at_s: f64,
    worker: usize,
    /// Restart count of the worker when the event was scheduled. Events of earlier lives are
    /// ignored.
    life: u32,
    action: Action,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Action {
    Seek,
    Finish(usize),
    Die(usize),
    /// The lease of this cell's claim ends.
    Expire(usize),
}

impl Eq for SimEvent {}

impl Ord for SimEvent {
    fn cmp(&self, other: &SimEvent) -> std::cmp::Ordering {
        self.at_s
            .total_cmp(&other.at_s)
            .then(self.worker.cmp(&other.worker))
    }
}

impl PartialOrd for SimEvent {
    fn partial_cmp(&self, other: &SimEvent) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct SimCell {
    /// Render time in seconds.
    length_s: f64,
    /// Seconds of render time that a checkpoint holds.
    saved_s: f64,
    /// Virtual time at which it was finished.
    done_s: Option<f64>,
}

#[derive(Debug)]
struct SimWorker {
    claims: Claims,
    life: u32,
    /// Cells that it has not tried yet, in order.
    ahead: VecDeque<usize>,
    /// Cells that other workers held, in the order of the next attempts.
    elsewhere: VecDeque<usize>,
    /// Virtual time at which it last listed the finished cells.
    listed_s: f64,
    backoff: Backoff,
    /// Virtual time at which it began its current cell.
    began_s: f64,
}

struct Simulator {
    parameters: ClusterSimulation,
    folder: PathBuf,
    cells: Vec<SimCell>,
    workers: Vec<SimWorker>,
    events: BinaryHeap<Reverse<SimEvent>>,
    result: SimulationResult,
    /// The current virtual second, and the number of operations in it.
    current_second: (u64, u64),
    /// Number of cells that are not finished.
    open: usize,
    /// State of the random number generator.
    state: u64,
}

/// Number of operations of one claim request: check, create, write, link, or open and read.
const CLAIM: u64 = 6;
/// Number of operations of finishing a run: last file, marker, release of the claim.
const FINISH: u64 = 9;

/// Longer than any simulation takes in real time.
const FAR: Duration = Duration::from_secs(86_400);

/// Simulates a night in a folder.
///
/// # Errors
/// When files in the folder cannot be read or written.
pub fn simulate(
    folder: &Path,
    parameters: ClusterSimulation,
) -> Result<SimulationResult, StoreError> {
    let mut simulator = Simulator {
        parameters,
        folder: folder.to_owned(),
        cells: vec![SimCell::default(); parameters.cells],
        workers: Vec::new(),
        events: BinaryHeap::new(),
        result: SimulationResult::default(),
        current_second: (0, 0),
        open: parameters.cells,
        state: parameters.seed,
    };
    for i in 0..parameters.cells {
        simulator.cells[i].length_s =
            -parameters.cell_s * (1.0 - simulator.random()).max(1e-12).ln();
    }
    let all: f64 = simulator.cells.iter().map(|cell| cell.length_s).sum();
    let longest = simulator
        .cells
        .iter()
        .map(|cell| cell.length_s)
        .fold(0.0, f64::max);
    simulator.result.ideal_s = (all / parameters.workers as f64).max(longest);
    for worker in 0..parameters.workers {
        // Like the jobs of a queue, they start one after the other.
        let at_s = 60.0 * simulator.random();
        let sim_worker = simulator.new_worker(0);
        simulator.workers.push(sim_worker);
        simulator.push(at_s, worker, Action::Seek);
    }
    simulator.run()?;
    let result = &mut simulator.result;
    result.operations += (result.work_s / HEARTBEAT.as_secs_f64()) as u64 * 2;
    result.busiest += 2 * parameters.workers as u64 / HEARTBEAT.as_secs();
    Ok(simulator.result)
}

impl Simulator {
    fn run(&mut self) -> Result<(), StoreError> {
        while let Some(Reverse(event)) = self.events.pop() {
            if self.open == 0 {
                break;
            }
            if event.life != self.workers[event.worker].life
                && !matches!(event.action, Action::Expire(_))
            {
                continue;
            }
            self.result.night_s = event.at_s;
            match event.action {
                Action::Seek => self.seek(event.worker, event.at_s)?,
                Action::Finish(cell) => self.finish(event.worker, cell, event.at_s)?,
                Action::Die(cell) => self.die(event.worker, cell, event.at_s),
                Action::Expire(cell) => self.expire(cell),
            }
        }
        Ok(())
    }

    fn push(&mut self, at_s: f64, worker: usize, action: Action) {
        let life = self.workers[worker].life;
        self.events.push(Reverse(SimEvent {
            at_s,
            worker,
            life,
            action,
        }));
    }

    /// SplitMix64, converted to a number in [0, 1).
    fn random(&mut self) -> f64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.state;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn new_worker(&mut self, life: u32) -> SimWorker {
        let first = (self.random() * self.parameters.cells as f64) as usize;
        let ahead = (0..self.parameters.cells)
            .map(|i| (first + i) % self.parameters.cells)
            .collect();
        // Simulated workers do not see each other's locks, as on different machines.
        let claims = Claims::without_heartbeat();
        let backoff = Backoff::new(self.state);
        SimWorker {
            claims,
            life,
            ahead,
            elsewhere: VecDeque::new(),
            listed_s: -1e9,
            backoff,
            began_s: 0.0,
        }
    }

    fn cell_folder(&self, cell: usize) -> PathBuf {
        self.folder
            .join("runs")
            .join((cell / 100).to_string())
            .join(cell.to_string())
    }

    /// Counts operations at a virtual time, and returns the seconds that they take.
    fn count(&mut self, at_s: f64, operations: u64) -> f64 {
        let second = at_s as u64;
        if second != self.current_second.0 {
            self.current_second = (second, 0);
        }
        self.current_second.1 += operations;
        self.result.busiest = self.result.busiest.max(self.current_second.1);
        self.result.operations += operations;
        operations as f64 * self.parameters.operation_s
    }

    /// Searches for a cell to render as a real worker does: once through all cells, then a few at a
    /// time and ever more rarely.
    fn seek(&mut self, w: usize, mut at_s: f64) -> Result<(), StoreError> {
        loop {
            if at_s - self.workers[w].listed_s > 5.0 {
                self.workers[w].listed_s = at_s;
                at_s += self.count(at_s, 1);
            }
            let first_pass = !self.workers[w].ahead.is_empty();
            let attempts = if first_pass {
                1
            } else {
                BATCH.min(self.workers[w].elsewhere.len())
            };
            for _ in 0..attempts {
                let worker = &mut self.workers[w];
                let Some(cell) = worker
                    .ahead
                    .pop_front()
                    .or_else(|| worker.elsewhere.pop_front())
                else {
                    break;
                };
                // Cells that the last listing shows as finished cost no operation.
                if self.cells[cell]
                    .done_s
                    .is_some_and(|done| done <= worker.listed_s)
                {
                    continue;
                }
                at_s += self.count(at_s, 1 + CLAIM);
                if self.try_claim(w, cell)? {
                    self.workers[w].backoff.reset();
                    self.begin(w, cell, at_s);
                    return Ok(());
                }
                if self.cells[cell].done_s.is_none() {
                    self.workers[w].elsewhere.push_back(cell);
                }
            }
            if first_pass {
                continue;
            }
            let listed_s = self.workers[w].listed_s;
            let cells = &self.cells;
            self.workers[w]
                .elsewhere
                .retain(|cell| cells[*cell].done_s.is_none_or(|done| done > listed_s));
            if !self.workers[w].elsewhere.is_empty() {
                let wait_s = self.workers[w].backoff.next_ticks() as f64 * TICK_S;
                self.result.idle_s += wait_s;
                self.push(at_s + wait_s, w, Action::Seek);
            }
            return Ok(());
        }
    }

    fn try_claim(&mut self, w: usize, cell: usize) -> Result<bool, StoreError> {
        let folder = self.cell_folder(cell);
        let start = Instant::now();
        let done = folder.join("done.json");
        let claims = &self.workers[w].claims;
        let mut granted = !done.is_file() && claims.acquire(&folder)? == Claim::Granted;
        self.result.claims_requested += 1;
        // Another worker may have finished the cell between the check and the claim.
        if granted && done.is_file() {
            claims.release(&folder);
            granted = false;
        }
        if granted {
            // The lease must end in virtual time, however long the simulation takes.
            let file = File::options().write(true).open(folder.join(claim::FILE));
            let set = file.and_then(|file| file.set_modified(SystemTime::now() + FAR));
            set.map_err(|e| StoreError::io("claim", &folder, &e))?;
        }
        self.result.claims_granted += usize::from(granted);
        self.result.real_s += start.elapsed().as_secs_f64();
        Ok(granted)
    }

    fn begin(&mut self, w: usize, cell: usize, at_s: f64) {
        self.workers[w].began_s = at_s;
        let left_s = self.cells[cell].length_s - self.cells[cell].saved_s;
        let fate = self.random();
        if fate < self.parameters.death {
            let at_s = at_s + left_s * self.random();
            self.push(at_s, w, Action::Die(cell));
        } else if fate < self.parameters.death + self.parameters.stall {
            self.result.stalls += 1;
            let stop_s = at_s + left_s * self.random();
            self.push(stop_s + LEASE.as_secs_f64(), w, Action::Expire(cell));
            self.push(
                at_s + left_s + 3.0 * LEASE.as_secs_f64(),
                w,
                Action::Finish(cell),
            );
        } else {
            self.push(at_s + left_s, w, Action::Finish(cell));
        }
    }

    fn finish(&mut self, w: usize, cell: usize, at_s: f64) -> Result<(), StoreError> {
        let folder = self.cell_folder(cell);
        let start = Instant::now();
        let holds = self.workers[w].claims.holds(&folder);
        if holds {
            let written = fs::write(folder.join("done.json"), b"{}");
            written.map_err(|e| StoreError::io("write", &folder, &e))?;
        }
        self.workers[w].claims.release(&folder);
        self.result.real_s += start.elapsed().as_secs_f64();
        let rendered_s = self.cells[cell].length_s - self.cells[cell].saved_s;
        self.result.work_s += rendered_s;
        let at_s = at_s + self.count(at_s, FINISH);
        if !holds || self.cells[cell].done_s.is_some() {
            self.result.wasted_s += rendered_s;
            self.result.finished_twice += usize::from(holds);
        } else {
            self.cells[cell].done_s = Some(at_s);
            self.open -= 1;
        }
        self.result.night_s = at_s;
        self.push(at_s, w, Action::Seek);
        Ok(())
    }

    fn die(&mut self, w: usize, cell: usize, at_s: f64) {
        self.result.deaths += 1;
        let spent_s = at_s - self.workers[w].began_s;
        let saved_s =
            (spent_s / self.parameters.checkpoint_s).floor() * self.parameters.checkpoint_s;
        self.result.work_s += spent_s;
        self.result.wasted_s += spent_s - saved_s;
        self.cells[cell].saved_s += saved_s;
        let life = self.workers[w].life + 1;
        // Its claims stay, since no process releases them.
        self.workers[w] = self.new_worker(life);
        let back_s = at_s + self.parameters.requeue_s;
        self.push(back_s, w, Action::Seek);
        self.push(at_s + LEASE.as_secs_f64(), w, Action::Expire(cell));
    }

    /// Gives the claim of a cell the age that it has when its lease has expired.
    fn expire(&mut self, cell: usize) {
        let claim = self.cell_folder(cell).join(claim::FILE);
        let old = SystemTime::now() - 2 * LEASE;
        // A missing claim was released.
        let _ = File::options()
            .write(true)
            .open(claim)
            .and_then(|file| file.set_modified(old));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameters(death: f64, stall: f64) -> ClusterSimulation {
        ClusterSimulation {
            cells: 120,
            workers: 12,
            cell_s: 200.0,
            death,
            stall,
            requeue_s: 60.0,
            checkpoint_s: 60.0,
            operation_s: 1e-3,
            seed: 7,
        }
    }

    #[test]
    fn a_night_without_failures_wastes_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let result = simulate(dir.path(), parameters(0.0, 0.0)).unwrap();
        assert_eq!(
            (
                result.wasted_s,
                result.finished_twice,
                result.deaths,
                result.claims_granted
            ),
            (0.0, 0, 0, 120)
        );
        assert!(
            result.night_s > result.ideal_s && result.night_s < 2.0 * result.ideal_s + 120.0,
            "{result:?}"
        );
    }

    #[test]
    fn failures_cost_little_and_no_cell() {
        let dir = tempfile::tempdir().unwrap();
        let result = simulate(dir.path(), parameters(0.2, 0.05)).unwrap();
        let done = (0..120)
            .filter(|i| {
                dir.path()
                    .join(format!("runs/{}/{i}/done.json", i / 100))
                    .is_file()
            })
            .count();
        assert_eq!(done, 120);
        assert!(
            result.deaths > 5 && result.stalls > 0 && result.wasted_s > 0.0,
            "{result:?}"
        );
        assert!(
            result.wasted_s < 0.25 * result.work_s && result.finished_twice == 0,
            "{result:?}"
        );
        assert!(result.claims_granted > 120 && result.claims_requested >= result.claims_granted);
    }
}
