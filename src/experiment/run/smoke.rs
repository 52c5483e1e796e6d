//! The smoke pass: one sample of every kind of cell before the night begins, so that what cannot work is known while
//! the user still looks.

use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

use super::cell::{Work, advance, guard};
use super::night::Night;
use super::tries::Broken;
use crate::experiment::event::{CellRef, Event, Level};
use crate::experiment::forecast::Kind;
use crate::experiment::plan::ReferenceSource;

/// Longest side of what the pass renders, in pixels. It finds what is broken, not what is slow or too large.
const SIDE: u32 = 64;

/// Longest time that the pass takes before it leaves the rest to the night.
const PATIENCE: Duration = Duration::from_secs(60);

impl Night<'_, '_> {
    /// Renders one small sample of every cell and reference that is still open, repeats aside, and returns the reasons
    /// of those that failed.
    pub(super) fn smoke(&mut self, order: &[CellRef]) -> BTreeMap<CellRef, String> {
        let start = Instant::now();
        let mut failed = BTreeMap::new();
        let mut tried = 0;
        let mut seen = BTreeSet::new();
        let mut open: Vec<CellRef> = order.iter().copied().filter(|cell| seen.insert(self.kind(*cell))).collect();
        open.retain(|cell| self.history.done(self.plan, *cell).is_none());
        for cell in &open {
            if self.control.stop_requested() || start.elapsed() > PATIENCE {
                break;
            }
            tried += 1;
            let Err(broken) = self.try_one(*cell) else { continue };
            // A device that was lost may come back, and where the script leaves the choice there is another backend: the
            // night will see.
            let again = match broken {
                Broken::Lost(_) => true,
                Broken::Backend(_) => self.fallback(*cell),
                Broken::Other(_) => false,
            };
            if !again {
                let reason = broken.reason();
                let kind = self.kind(*cell);
                let alike = order.iter().filter(|other| self.kind(**other) == kind);
                failed.extend(alike.map(|other| (*other, format!("in the smoke pass: {reason}"))));
            }
        }
        let seconds = start.elapsed().as_secs_f64();
        let (all, broken) = (open.len(), failed.len());
        let text = format!("smoke pass: {tried} of {all} kinds of runs tried in {seconds:.1} s, {broken} runs fail");
        let level = if broken > 0 { Level::Warn } else { Level::Info };
        // Listeners that cannot note it will fail where it matters.
        let _ = self.emit(&Event::Message { level, cell: None, text });
        failed
    }

    /// What distinguishes cells but for their seeds. References are all different.
    fn kind(&self, cell: CellRef) -> (bool, usize, String) {
        match cell {
            CellRef::Reference(i) => (true, i, String::new()),
            CellRef::Cell(i) => {
                let cell = &self.plan.cells[i];
                // Repeats of a point differ in nothing else, and share their scene.
                (false, std::sync::Arc::as_ptr(&cell.scene) as usize, format!("{:?}", cell.config))
            }
        }
    }

    /// Whether there is another backend for a run.
    fn fallback(&self, cell: CellRef) -> bool {
        match cell {
            CellRef::Cell(i) => self.plan.cells[i].config.fallback.is_some(),
            CellRef::Reference(i) => match &self.plan.references[i].source {
                ReferenceSource::Render { config, .. } => config.fallback.is_some(),
                ReferenceSource::File { .. } => false,
            },
        }
    }

    fn try_one(&mut self, cell: CellRef) -> Result<(), Broken> {
        let plan = self.plan;
        let (config, scene, seed, stop) = match cell {
            CellRef::Cell(i) => {
                let it = &plan.cells[i];
                (&it.config, &it.scene, it.seed, &it.stop)
            }
            CellRef::Reference(i) => match &plan.references[i].source {
                ReferenceSource::Render { config, scene, seeds, stop, .. } => (config, scene, seeds[0], stop),
                ReferenceSource::File { .. } => return Ok(()),
            },
        };
        let [width, height] = config.resolution.unwrap_or(scene.resolution);
        let shrink = width.max(height).div_ceil(SIDE).max(1);
        let resolution = Some([width.div_ceil(shrink), height.div_ceil(shrink)]);
        let seeds = &[seed];
        let work = Work { cell, config, scene, seeds, stop: stop.clone(), part: None, reference: None, resolution };
        let scene = self.compiled(&work)?;
        let mut renderer = Some(self.open(&work, scene, None)?);
        let stats = advance(&mut renderer, 1)?;
        self.paces.tried(Kind::of(config), stats.paths as f64 / stats.render_s);
        Ok(guard("closing the backend", || drop(renderer))?)
    }
}
