//! From the first event to the last: references, cells, and what becomes of them.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

use super::agreement::Compared;
use super::cell::{Ended, Running, Work, crowded};
use super::patience::Patience;
use super::references::{Truth, lost};
use super::{CellResult, NightSummary, Options, RunError, Seams};
use crate::experiment::WaveRow;
use crate::experiment::event::{CellRef, Control, Event, History, Level, Outcome, Sink};
use crate::experiment::floors::Floors;
use crate::experiment::forecast::{Kind, Pace, Paces, forecast};
use crate::experiment::plan::{Plan, ReferenceSource};
use crate::experiment::spec::ScriptHooks;
use crate::experiment::standing::{Checkpoint, Claim, Settled};
use crate::film::SharedImage;
use crate::scene::compile::Sharing;
use crate::scene::{CompiledScene, Note, SceneDesc};

/// The least time between two reckonings of what is left.
const RECKON: Duration = Duration::from_secs(2);

/// What came of looking at a cell.
pub(super) enum Look<'a> {
    /// It is to be rendered.
    Ready(Box<(Running<'a>, Floors)>),
    /// It has ended, one way or another.
    Ended,
    /// Another process works on it or on its reference; the text says which.
    Elsewhere(String),
    /// It is for another kind of worker, as the text says.
    Apart(String),
}

/// A night in progress.
pub(super) struct Night<'a, 's> {
    pub(super) seams: &'a Seams<'a>,
    pub(super) plan: &'a Arc<Plan>,
    pub(super) hooks: &'a dyn ScriptHooks,
    pub(super) control: &'a Control,
    pub(super) options: Options,
    pub(super) history: &'a dyn History,
    pub(super) sinks: &'a mut [&'s mut dyn Sink],
    pub(super) truths: Vec<Truth>,
    /// References that another process had a moment ago, and which process that is.
    pub(super) away: BTreeMap<usize, (String, Instant)>,
    /// The reference that was used last: neighbouring cells mostly share it.
    pub(super) recent: Option<(usize, SharedImage)>,
    /// The references that wait for the other side of a comparison.
    pub(super) compared: BTreeMap<usize, Compared>,
    /// Parts of references that nobody keeps, by reference and number.
    pub(super) held: BTreeMap<(usize, usize), Arc<Checkpoint>>,
    /// The noise floors of the references as far as they are known.
    pub(super) floors: Vec<Option<Floors>>,
    /// The scene that was compiled last, and what it was compiled from and how.
    pub(super) compiled: Option<(Arc<SceneDesc>, Sharing, Arc<CompiledScene>)>,
    /// What compiling has had to say, each once a night.
    pub(super) told: BTreeSet<Note>,
    pub(super) summary: NightSummary,
    /// Requests for a checkpoint so far.
    pub(super) asked: u64,
    /// How fast runs were.
    pub(super) paces: Paces,
    /// What has ended, one way or another.
    settled: BTreeSet<CellRef>,
    /// When the rest was reckoned last.
    reckoned: Option<Instant>,
}

impl<'a, 's> Night<'a, 's> {
    pub(super) fn new(
        seams: &'a Seams<'a>,
        plan: &'a Arc<Plan>,
        hooks: &'a dyn ScriptHooks,
        history: &'a dyn History,
        sinks: &'a mut [&'s mut dyn Sink],
        control: &'a Control,
        mut options: Options,
    ) -> Night<'a, 's> {
        let (paces, settled) = (std::mem::take(&mut options.paces), std::mem::take(&mut options.done));
        Night {
            seams,
            plan,
            hooks,
            control,
            options,
            history,
            sinks,
            truths: plan.references.iter().map(|_| Truth::Ahead).collect(),
            away: BTreeMap::new(),
            recent: None,
            compared: BTreeMap::new(),
            held: BTreeMap::new(),
            floors: vec![None; plan.references.len()],
            compiled: None,
            told: BTreeSet::new(),
            summary: NightSummary::default(),
            asked: 0,
            paces,
            settled,
            reckoned: None,
        }
    }

    pub(super) fn carry_out(mut self) -> Result<NightSummary, RunError> {
        let started = Event::NightStarted { plan: Arc::clone(self.plan) };
        self.emit(&started).map_err(|reason| RunError::Start { reason })?;
        let mut order = self.order();
        if self.options.smoke {
            let broken = self.smoke(&order.concat());
            order.iter_mut().for_each(|heat| heat.retain(|cell| !broken.contains_key(cell)));
            for (cell, reason) in broken {
                let outcome = self.finish(cell, Ended::failed(reason));
                if let CellRef::Reference(place) = cell {
                    self.truths[place] = lost(&outcome);
                }
            }
        }
        self.all(order);
        self.summary.results.sort_by_key(|result| match result.cell {
            CellRef::Reference(place) => (0, place),
            CellRef::Cell(place) => (1, place),
        });
        match self.emit(&Event::NightFinished) {
            Ok(()) => Ok(self.summary),
            Err(reason) => Err(RunError::Finish { reason, summary: self.summary }),
        }
    }

    /// What is to be carried out, in order: references and then the heats of cells, or, with a deadline, heats from coarse
    /// to fine, each after its references.
    fn order(&self) -> Vec<Vec<CellRef>> {
        let plan = self.plan;
        let heats = plan.heats(self.options.deadline.is_some());
        let heats = heats.into_iter().map(|heat| heat.into_iter().map(CellRef::Cell).collect::<Vec<_>>());
        let mut order: Vec<Vec<CellRef>> = match self.options.deadline {
            None => (0..plan.references.len()).map(|i| vec![CellRef::Reference(i)]).chain(heats).collect(),
            Some(_) => {
                let mut seen = BTreeSet::new();
                let mut order = Vec::new();
                for heat in heats {
                    let references = heat.iter().filter_map(|cell| match cell {
                        CellRef::Cell(i) => plan.cells[*i].reference,
                        CellRef::Reference(_) => None,
                    });
                    let sides = |r: usize| [Some(r), plan.references[r].agree.map(|agree| agree.with)];
                    let new = references.flat_map(sides).flatten().filter(|r| seen.insert(*r));
                    order.extend(new.map(|r| vec![CellRef::Reference(r)]));
                    order.push(heat);
                }
                order
            }
        };
        if let Some(only) = &self.options.only {
            order.iter_mut().for_each(|heat| heat.retain(|cell| only.contains(cell)));
        }
        order.retain(|heat| !heat.is_empty());
        match self.options.begin {
            Some(begin) if self.options.deadline.is_none() => begin.turn(plan, order),
            _ => order,
        }
    }

    /// Goes through all that is to be done. What others work on is looked at again, until it is done, its owner has
    /// died, or somebody ends the night.
    fn all(&mut self, mut order: Vec<Vec<CellRef>>) {
        let mut told = false;
        let mut patience = Patience::new(u64::from(std::process::id()));
        loop {
            let mut elsewhere: Vec<(Vec<CellRef>, String)> = Vec::new();
            let before = self.summary.results.len();
            self.away.clear();
            let (now, mut later) = patience.window(order);
            for heat in now {
                if self.over() {
                    return;
                }
                // A request that came too late for the cell before is not meant for this one.
                self.control.take_skip();
                self.control.take_restart();
                self.reckon();
                elsewhere.extend(self.heat(&heat));
            }
            later.iter_mut().for_each(|heat| heat.retain(|cell| !self.is_settled(*cell)));
            later.retain(|heat| !heat.is_empty());
            let whose = elsewhere.first().map_or("", |(_, whose)| whose.as_str());
            if elsewhere.is_empty() && later.is_empty() {
                return;
            }
            if before < self.summary.results.len() {
                patience.forget();
            }
            if !told && before == self.summary.results.len() {
                told = true;
                let all = elsewhere.iter().map(|(heat, _)| heat).chain(&later).map(Vec::len).sum::<usize>();
                let text = format!("waiting for {all} runs of other processes, one of them {whose}");
                // A line that cannot be written is no reason to stop waiting.
                let _ = self.emit(&Event::Message { level: Level::Info, cell: None, text });
            }
            for _ in 0..patience.moments() {
                if self.control.stop_requested() || self.late() {
                    break;
                }
                (self.seams.wait)();
            }
            order = later.into_iter().chain(elsewhere.into_iter().map(|(heat, _)| heat)).collect();
        }
    }

    /// Takes note of what another worker has settled.
    pub(super) fn is_settled(&mut self, cell: CellRef) -> bool {
        if let CellRef::Reference(place) = cell
            && !matches!(self.truths[place], Truth::Ahead)
        {
            return true;
        }
        let Some(settled) = self.history.settled(self.plan, cell) else { return false };
        let ended = match settled {
            Settled::Done(folder) => Ended::only(Outcome::Cached(folder)),
            Settled::Failed(reason) => Ended::failed(reason),
        };
        if let CellRef::Reference(place) = cell {
            self.truths[place] = match &ended.outcome {
                Outcome::Cached(_) => Truth::Recorded,
                outcome => lost(outcome),
            };
        }
        let Ended { outcome, rows, floors, layers, open, .. } = ended;
        let rows = Arc::new(rows);
        if let Outcome::Cached(_) = outcome {
            let (outcome, rows) = (outcome.clone(), Arc::clone(&rows));
            let event = Event::CellFinished { cell, outcome, film: None, layers, times: None, rows };
            // It is recorded already.
            let _ = self.emit(&event);
        }
        self.settled.insert(cell);
        self.summary.results.push(CellResult { cell, outcome, rows, floors, open });
        true
    }

    /// Whether the night ends here, with work left.
    fn over(&mut self) -> bool {
        if self.control.stop_requested() || self.control.stops_after_cell() {
            self.summary.interrupted = true;
            return true;
        }
        let failed = self.summary.results.iter().filter(|r| matches!(r.outcome, Outcome::Failed(_))).count();
        let text = match self.options.max_fails {
            Some(most) if failed >= most.max(1) => format!("the night ends: {failed} runs have failed"),
            _ if self.late() => "the night ends: its deadline has come".to_owned(),
            _ => return false,
        };
        // The night ends whether or not that can be told.
        let _ = self.emit(&Event::Message { level: Level::Warn, cell: None, text });
        true
    }

    /// Whether the deadline has come.
    pub(super) fn late(&self) -> bool {
        self.options.deadline.is_some_and(|deadline| SystemTime::now() >= deadline)
    }

    /// Tells every sink, even after one has failed; the first failure is returned.
    pub(super) fn emit(&mut self, event: &Event) -> Result<(), String> {
        let mut result = Ok(());
        for sink in self.sinks.iter_mut() {
            if let Err(error) = sink.hear(event) {
                result = result.and(Err(error.to_string()));
            }
        }
        result
    }

    /// A line for people. A sink that cannot record it fails the cell.
    pub(super) fn say(&mut self, level: Level, cell: CellRef, text: String) -> Result<(), String> {
        self.emit(&Event::Message { level, cell: Some(cell), text })
    }

    /// Tells how long the rest will take, now and then.
    fn reckon(&mut self) {
        if self.reckoned.is_some_and(|last| last.elapsed() < RECKON) {
            return;
        }
        let only = self.options.only.as_ref();
        let open = |cell: CellRef| !self.settled.contains(&cell) && only.is_none_or(|only| only.contains(&cell));
        let left = forecast(self.plan, &self.paces, &open);
        // Nobody needs it to go on.
        let _ = self.emit(&Event::Forecast(left));
        self.reckoned = Some(Instant::now());
    }

    /// Remembers how fast a finished run was.
    fn learn(&mut self, cell: CellRef, rows: &[WaveRow]) {
        let plan = self.plan;
        let (config, stop) = match cell {
            CellRef::Cell(i) => (&plan.cells[i].config, &plan.cells[i].stop),
            CellRef::Reference(i) => match &plan.references[i].source {
                ReferenceSource::Render { config, stop, .. } => (config, stop),
                ReferenceSource::File { .. } => return,
            },
        };
        if let Some(pace) = rows.last().and_then(|last| Pace::of(last, stop)) {
            self.paces.learn(Kind::of(config), pace);
        }
    }

    /// Renders what is taken together, and returns what of it another process works on, with who that is.
    fn heat(&mut self, heat: &[CellRef]) -> Option<(Vec<CellRef>, String)> {
        let mut elsewhere: Option<(Vec<CellRef>, String)> = None;
        let mut field = Vec::new();
        for cell in heat {
            let look = match cell {
                CellRef::Reference(place) => self.reference(*place),
                CellRef::Cell(place) => self.enter(*place),
            };
            match look {
                Look::Ended => {}
                Look::Apart(why) => self.summary.apart.push((*cell, why)),
                Look::Ready(entrant) => field.push(*entrant),
                Look::Elsewhere(whose) => elsewhere.get_or_insert_with(|| (Vec::new(), whose)).0.push(*cell),
            }
        }
        if let [first, _, ..] = field.as_slice() {
            let text = format!("{} techniques take turns on one picture", field.len());
            // A line that cannot be written is no reason not to render.
            let _ = self.say(Level::Info, first.0.work.cell, text);
        }
        match crowded(&field, self.options.memory) {
            Some(reason) => {
                for (run, _) in field {
                    self.finish(run.work.cell, Ended::failed(reason.clone()));
                    self.history.release(self.plan, run.work.cell.into());
                }
            }
            None => self.race(field),
        }
        elsewhere
    }

    /// Makes a cell ready to be rendered, unless it is done, cannot be, or is with another process.
    fn enter(&mut self, place: usize) -> Look<'a> {
        let plan = self.plan;
        let it = &plan.cells[place];
        let cell = CellRef::Cell(place);
        if self.is_settled(cell) {
            return Look::Ended;
        }
        if let Some(run) = self.history.done(plan, cell) {
            self.finish(cell, Ended::cached(run));
            return Look::Ended;
        }
        if let Some(reference) = it.reference
            && let Truth::Ahead = self.truths[reference]
        {
            // Its reference was with another process when its turn came, and comes before it when all is gone through
            // again; a narrowed night renders it when it is first needed.
            if let Look::Elsewhere(whose) = self.reference(reference) {
                return Look::Elsewhere(whose);
            }
        }
        match self.history.claim(plan, cell.into()) {
            Ok(Claim::Ours) => {}
            Ok(Claim::Theirs(whose)) => return Look::Elsewhere(whose),
            Ok(Claim::Never(why)) => return Look::Apart(why),
            Err(error) => {
                self.finish(cell, Ended::failed(error.to_string()));
                return Look::Ended;
            }
        }
        // Between the look and the claim, another process may have finished it.
        let ended = match self.history.done(plan, cell) {
            Some(run) => Ended::cached(run),
            None => match self.ready(place) {
                Ok(entrant) => return Look::Ready(Box::new(entrant)),
                Err(reason) => Ended::failed(reason),
            },
        };
        self.finish(cell, ended);
        self.history.release(plan, cell.into());
        Look::Ended
    }

    /// What a cell that is claimed needs.
    fn ready(&mut self, place: usize) -> Result<(Running<'a>, Floors), String> {
        let it = &self.plan.cells[place];
        let reference = it.reference.map(|r| self.truth(r, it.config.resolution)).transpose()?;
        let floors = self.floors_of(it.reference.zip(reference.as_ref()))?;
        let work = Work {
            cell: CellRef::Cell(place),
            config: &it.config,
            scene: &it.scene,
            seeds: std::slice::from_ref(&it.seed),
            stop: it.stop.clone(),
            part: None,
            reference,
            resolution: None,
        };
        Ok((Running::new(work), floors))
    }

    /// Tells how a cell ended and keeps it for the summary. If a sink cannot record it, it has failed after all.
    pub(super) fn finish(&mut self, cell: CellRef, ended: Ended) -> Outcome {
        let Ended { mut outcome, film, layers, times, rows, floors, halves: _, open } = ended;
        if let Outcome::Done(_) = outcome
            && !self.history.holds(self.plan, cell.into())
        {
            let text = "another process took this run over while this one stood still; its results are the same";
            // The run is not lost, only not recorded here.
            let _ = self.say(Level::Warn, cell, text.to_owned());
            outcome = Outcome::Interrupted;
        }
        let rows = Arc::new(rows);
        let event =
            Event::CellFinished { cell, outcome: outcome.clone(), film, layers, times, rows: Arc::clone(&rows) };
        if let Err(reason) = self.emit(&event) {
            let reason = format!("it could not be recorded: {reason}");
            // The sink that failed may fail again; the others still hear of it, and the summary has the reason.
            let _ = self.say(Level::Error, cell, reason.clone());
            outcome = Outcome::Failed(reason);
        }
        if outcome == Outcome::Interrupted && self.control.stop_requested() {
            self.summary.interrupted = true;
        }
        self.settled.insert(cell);
        if let Outcome::Done(_) | Outcome::Cached(_) = outcome {
            self.learn(cell, &rows);
        }
        self.summary.results.push(CellResult { cell, outcome: outcome.clone(), rows, floors, open });
        outcome
    }
}
