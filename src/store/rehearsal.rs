//! A night of a thousand workers in minutes: rendering takes virtual time, from event to event, while every claim, every
//! take-over and every last file is real, in a real folder, by the code that real workers run.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::time::{Instant, SystemTime};

use super::StoreError;
use super::claim::{self, Claims, HEARTBEAT, LEASE};
use crate::experiment::run::patience::{LOOKS, MOMENT_S, Patience};
use crate::experiment::standing::Claim;

/// What is rehearsed. Times are virtual.
#[derive(Clone, Copy, Debug)]
pub struct Rehearsal {
    /// Cells of the night.
    pub cells: usize,
    /// Workers.
    pub workers: usize,
    /// Mean seconds that a cell takes; single ones take from nothing to many times that, exponentially distributed.
    pub cell_s: f64,
    /// Probability that a worker dies while it renders a cell. It is queued again.
    pub death: f64,
    /// Probability that a worker stands still for longer than its lease, and goes on.
    pub stall: f64,
    /// Seconds until a worker that died is back.
    pub requeue_s: f64,
    /// Seconds of render time between two checkpoints.
    pub checkpoint_s: f64,
    /// Seconds that one operation on the shared folder takes.
    pub operation_s: f64,
    /// Seed of durations and failures.
    pub seed: u64,
}

/// What came of it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rehearsed {
    /// Virtual seconds until all was done.
    pub night_s: f64,
    /// The least that it could have taken: all work, evenly spread over workers that never fail; or the longest cell.
    pub ideal_s: f64,
    /// Virtual seconds of rendering that nobody has anything of: lost since a checkpoint, or done twice.
    pub wasted_s: f64,
    /// Virtual seconds of rendering in all.
    pub work_s: f64,
    /// Virtual seconds that workers waited for others' last cells.
    pub idle_s: f64,
    /// Workers that died, and that stood still.
    pub deaths: usize,
    /// See above.
    pub stalls: usize,
    /// Cells that were finished more than once.
    pub twice: usize,
    /// Claims that were asked for, and got.
    pub asked: usize,
    /// See above.
    pub got: usize,
    /// Real seconds that asking, finishing and giving back took.
    pub real_s: f64,
    /// Operations on the folder: opens, links, renames, looks, listings, heartbeats.
    pub operations: u64,
    /// Most of them in one virtual second.
    pub busiest: u64,
}

impl Rehearsed {
    /// Claims, with their last file and their release, that one process gets in a second of this folder.
    pub fn claims_per_s(&self) -> f64 {
        self.got as f64 / self.real_s.max(1e-9)
    }
}

/// An event: when, for whom, which of that worker's lives, and what.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Event {
    at_s: f64,
    worker: usize,
    life: u32,
    what: What,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum What {
    Seek,
    Finish(usize),
    Die(usize),
    /// The lease of a cell's claim ends.
    Expire(usize),
}

impl Eq for Event {}

impl Ord for Event {
    fn cmp(&self, other: &Event) -> std::cmp::Ordering {
        self.at_s.total_cmp(&other.at_s).then(self.worker.cmp(&other.worker))
    }
}

impl PartialOrd for Event {
    fn partial_cmp(&self, other: &Event) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    length_s: f64,
    /// Seconds of it that a checkpoint has.
    kept_s: f64,
    done_s: Option<f64>,
}

#[derive(Debug)]
struct Worker {
    claims: Claims,
    life: u32,
    /// Cells that it has not looked at, and those that others had, in the order of its next looks.
    ahead: VecDeque<usize>,
    elsewhere: VecDeque<usize>,
    /// When it last listed what is finished.
    listed_s: f64,
    patience: Patience,
    began_s: f64,
}

struct Stage {
    plan: Rehearsal,
    folder: PathBuf,
    cells: Vec<Cell>,
    workers: Vec<Worker>,
    events: BinaryHeap<Reverse<Event>>,
    found: Rehearsed,
    /// Operations in the virtual second that is counted.
    second: (u64, u64),
    open: usize,
    state: u64,
}

/// Operations of one claim that is asked for: looking, making, writing, linking, or opening and reading.
const CLAIM: u64 = 6;
/// Of a run that is finished: its last file, its mark, its claim given back.
const FINISH: u64 = 9;

/// Rehearses a night below a folder.
///
/// # Errors
/// When the folder cannot be used.
pub fn rehearse(folder: &Path, plan: Rehearsal) -> Result<Rehearsed, StoreError> {
    let mut stage = Stage {
        plan,
        folder: folder.to_owned(),
        cells: vec![Cell::default(); plan.cells],
        workers: Vec::new(),
        events: BinaryHeap::new(),
        found: Rehearsed::default(),
        second: (0, 0),
        open: plan.cells,
        state: plan.seed,
    };
    for i in 0..plan.cells {
        stage.cells[i].length_s = -plan.cell_s * (1.0 - stage.random()).max(1e-12).ln();
    }
    let all: f64 = stage.cells.iter().map(|cell| cell.length_s).sum();
    let longest = stage.cells.iter().map(|cell| cell.length_s).fold(0.0, f64::max);
    stage.found.ideal_s = (all / plan.workers as f64).max(longest);
    for worker in 0..plan.workers {
        // A queue starts them one after the other.
        let at_s = 60.0 * stage.random();
        let worker_at = stage.newcomer(0);
        stage.workers.push(worker_at);
        stage.push(at_s, worker, What::Seek);
    }
    stage.run()?;
    let found = &mut stage.found;
    found.operations += (found.work_s / HEARTBEAT.as_secs_f64()) as u64 * 2;
    found.busiest += 2 * plan.workers as u64 / HEARTBEAT.as_secs();
    Ok(stage.found)
}

impl Stage {
    fn run(&mut self) -> Result<(), StoreError> {
        while let Some(Reverse(event)) = self.events.pop() {
            if self.open == 0 {
                break;
            }
            if event.life != self.workers[event.worker].life && !matches!(event.what, What::Expire(_)) {
                continue;
            }
            self.found.night_s = event.at_s;
            match event.what {
                What::Seek => self.seek(event.worker, event.at_s)?,
                What::Finish(cell) => self.finish(event.worker, cell, event.at_s)?,
                What::Die(cell) => self.die(event.worker, cell, event.at_s),
                What::Expire(cell) => self.expire(cell),
            }
        }
        Ok(())
    }

    fn push(&mut self, at_s: f64, worker: usize, what: What) {
        let life = self.workers[worker].life;
        self.events.push(Reverse(Event { at_s, worker, life, what }));
    }

    /// SplitMix64, as a number from 0 to 1.
    fn random(&mut self) -> f64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.state;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn newcomer(&mut self, life: u32) -> Worker {
        let first = (self.random() * self.plan.cells as f64) as usize;
        let ahead = (0..self.plan.cells).map(|i| (first + i) % self.plan.cells).collect();
        // Locks of other machines are not seen, and neither are these.
        let claims = Claims::unattended();
        let patience = Patience::new(self.state);
        Worker { claims, life, ahead, elsewhere: VecDeque::new(), listed_s: -1e9, patience, began_s: 0.0 }
    }

    fn place(&self, cell: usize) -> PathBuf {
        self.folder.join("runs").join((cell / 100).to_string()).join(cell.to_string())
    }

    /// Counts operations, and returns how long they take.
    fn count(&mut self, at_s: f64, operations: u64) -> f64 {
        let second = at_s as u64;
        if second != self.second.0 {
            self.second = (second, 0);
        }
        self.second.1 += operations;
        self.found.busiest = self.found.busiest.max(self.second.1);
        self.found.operations += operations;
        operations as f64 * self.plan.operation_s
    }

    /// Looks for something to do, as the night of a worker does: once through all, then a few at a time, ever more rarely.
    fn seek(&mut self, w: usize, mut at_s: f64) -> Result<(), StoreError> {
        loop {
            if at_s - self.workers[w].listed_s > 5.0 {
                self.workers[w].listed_s = at_s;
                at_s += self.count(at_s, 1);
            }
            let first_pass = !self.workers[w].ahead.is_empty();
            let looks = if first_pass { 1 } else { LOOKS.min(self.workers[w].elsewhere.len()) };
            for _ in 0..looks {
                let worker = &mut self.workers[w];
                let Some(cell) = worker.ahead.pop_front().or_else(|| worker.elsewhere.pop_front()) else { break };
                // What was listed as finished costs nothing.
                if self.cells[cell].done_s.is_some_and(|done| done <= worker.listed_s) {
                    continue;
                }
                at_s += self.count(at_s, 1 + CLAIM);
                if self.take(w, cell)? {
                    self.workers[w].patience.forget();
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
            self.workers[w].elsewhere.retain(|cell| cells[*cell].done_s.is_none_or(|done| done > listed_s));
            if !self.workers[w].elsewhere.is_empty() {
                let wait_s = self.workers[w].patience.moments() as f64 * MOMENT_S;
                self.found.idle_s += wait_s;
                self.push(at_s + wait_s, w, What::Seek);
            }
            return Ok(());
        }
    }

    fn take(&mut self, w: usize, cell: usize) -> Result<bool, StoreError> {
        let place = self.place(cell);
        let start = Instant::now();
        let done = place.join("done.json");
        let claims = &self.workers[w].claims;
        let mut ours = !done.is_file() && claims.take(&place)? == Claim::Ours;
        self.found.asked += 1;
        // Between the look and the claim, another may have finished it.
        if ours && done.is_file() {
            claims.release(&place);
            ours = false;
        }
        self.found.got += usize::from(ours);
        self.found.real_s += start.elapsed().as_secs_f64();
        Ok(ours)
    }

    fn begin(&mut self, w: usize, cell: usize, at_s: f64) {
        self.workers[w].began_s = at_s;
        let left_s = self.cells[cell].length_s - self.cells[cell].kept_s;
        let fate = self.random();
        if fate < self.plan.death {
            let at_s = at_s + left_s * self.random();
            self.push(at_s, w, What::Die(cell));
        } else if fate < self.plan.death + self.plan.stall {
            self.found.stalls += 1;
            let stop_s = at_s + left_s * self.random();
            self.push(stop_s + LEASE.as_secs_f64(), w, What::Expire(cell));
            self.push(at_s + left_s + 3.0 * LEASE.as_secs_f64(), w, What::Finish(cell));
        } else {
            self.push(at_s + left_s, w, What::Finish(cell));
        }
    }

    fn finish(&mut self, w: usize, cell: usize, at_s: f64) -> Result<(), StoreError> {
        let place = self.place(cell);
        let start = Instant::now();
        let holds = self.workers[w].claims.holds(&place);
        if holds {
            let written = fs::write(place.join("done.json"), b"{}");
            written.map_err(|e| StoreError::io("write", &place, &e))?;
        }
        self.workers[w].claims.release(&place);
        self.found.real_s += start.elapsed().as_secs_f64();
        let rendered_s = self.cells[cell].length_s - self.cells[cell].kept_s;
        self.found.work_s += rendered_s;
        let at_s = at_s + self.count(at_s, FINISH);
        if !holds || self.cells[cell].done_s.is_some() {
            self.found.wasted_s += rendered_s;
            self.found.twice += usize::from(holds);
        } else {
            self.cells[cell].done_s = Some(at_s);
            self.open -= 1;
        }
        self.found.night_s = at_s;
        self.push(at_s, w, What::Seek);
        Ok(())
    }

    fn die(&mut self, w: usize, cell: usize, at_s: f64) {
        self.found.deaths += 1;
        let spent_s = at_s - self.workers[w].began_s;
        let kept_s = (spent_s / self.plan.checkpoint_s).floor() * self.plan.checkpoint_s;
        self.found.work_s += spent_s;
        self.found.wasted_s += spent_s - kept_s;
        self.cells[cell].kept_s += kept_s;
        let life = self.workers[w].life + 1;
        // Its claims stay where they are: nobody gives them back.
        self.workers[w] = self.newcomer(life);
        let back_s = at_s + self.plan.requeue_s;
        self.push(back_s, w, What::Seek);
        self.push(at_s + LEASE.as_secs_f64(), w, What::Expire(cell));
    }

    /// What nobody has written to for the length of a lease gets the age that it would have by then.
    fn expire(&mut self, cell: usize) {
        let claim = self.place(cell).join(claim::FILE);
        let old = SystemTime::now() - 2 * LEASE;
        // One that is gone was given back.
        let _ = File::options().write(true).open(claim).and_then(|file| file.set_modified(old));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(death: f64, stall: f64) -> Rehearsal {
        Rehearsal {
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
        let found = rehearse(dir.path(), plan(0.0, 0.0)).unwrap();
        assert_eq!((found.wasted_s, found.twice, found.deaths, found.got), (0.0, 0, 0, 120));
        assert!(found.night_s > found.ideal_s && found.night_s < 2.0 * found.ideal_s + 120.0, "{found:?}");
    }

    #[test]
    fn failures_cost_little_and_no_cell() {
        let dir = tempfile::tempdir().unwrap();
        let found = rehearse(dir.path(), plan(0.2, 0.05)).unwrap();
        let done = (0..120).filter(|i| dir.path().join(format!("runs/{}/{i}/done.json", i / 100)).is_file()).count();
        assert_eq!(done, 120);
        assert!(found.deaths > 5 && found.stalls > 0 && found.wasted_s > 0.0, "{found:?}");
        assert!(found.wasted_s < 0.25 * found.work_s && found.twice == 0, "{found:?}");
        assert!(found.got > 120 && found.asked >= found.got);
    }
}
