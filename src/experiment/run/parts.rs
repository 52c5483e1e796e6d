//! References in parts: each is claimed, kept and finished by whoever comes, and whoever finds all of them there joins them.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::cell::{Ended, Work, guard};
use super::night::Night;
use crate::experiment::event::{Event, Level, Outcome};
use crate::experiment::parts::{Joined, Part, Piece, Sums};
use crate::experiment::standing::{Checkpoint, Claim};
use crate::experiment::stop::StopRule;
use crate::film::Film;

/// What came of joining the parts of a reference.
pub(super) enum Whole {
    /// It is rendered, and this is what longer ones can go on from.
    Joined(Box<(Ended, Option<Checkpoint>)>),
    /// It cannot be had, for this reason.
    Failed(String),
    /// This part, which was there, is there no more, or was damaged.
    Missing(Part),
}

impl<'a> Night<'a, '_> {
    /// Renders what nobody else works on of the parts of a reference, and returns how that ended if it was not well.
    ///
    /// # Errors
    /// Who else renders a part that is not there yet.
    pub(super) fn render_parts(&mut self, work: &Work<'a>, parts: &[Part]) -> Result<Option<Ended>, String> {
        let mut elsewhere = None;
        let mut there = self.history.parts_there(self.plan, parts);
        for part in parts {
            if self.is_there(part, &there) {
                continue;
            }
            let piece = Piece::Part(*part);
            match self.history.claim(self.plan, piece) {
                Ok(Claim::Ours) => {}
                Ok(Claim::Theirs(whose) | Claim::Never(whose)) => {
                    elsewhere = Some(whose);
                    continue;
                }
                Err(error) => return Ok(Some(Ended::failed(error.to_string()))),
            }
            // Between the look and the claim, another process may have finished it, or joined all of them.
            there = self.history.parts_there(self.plan, parts);
            let done = self.is_there(part, &there) || self.history.done(self.plan, work.cell).is_some();
            let ended = if done { None } else { self.render_part(work, *part, parts) };
            self.history.release(self.plan, piece);
            if ended.is_some() {
                return Ok(ended);
            }
        }
        elsewhere.map_or(Ok(None), Err)
    }

    /// Whether a part needs no more rendering, where the history has those numbers.
    fn is_there(&self, part: &Part, there: &BTreeSet<usize>) -> bool {
        self.held.contains_key(&(part.reference, part.number)) || there.contains(&part.number)
    }

    /// Renders one of these parts that is claimed, and returns how that ended if it is not there now.
    fn render_part(&mut self, work: &Work<'a>, part: Part, parts: &[Part]) -> Option<Ended> {
        let stop = StopRule::Samples(part.end - part.first);
        let mut ended = self.perform(Work { part: Some(part), stop, ..work.clone() });
        let mut kept = None;
        if let Outcome::Done(_) = ended.outcome {
            if self.history.holds(self.plan, Piece::Part(part)) {
                match sums_of(&mut ended) {
                    Ok(checkpoint) => kept = Some(Arc::new(checkpoint)),
                    Err(reason) => ended.outcome = Outcome::Failed(reason),
                }
            } else {
                let text = format!("another process took {} over while this one stood still", part.words());
                // It is not lost, only not recorded here.
                let _ = self.say(Level::Warn, work.cell, text);
            }
        }
        let last = ended.rows.last().cloned();
        let outcome = ended.outcome.clone();
        let told = self.emit(&Event::PartFinished { part, outcome, last, kept: kept.clone() });
        if let (Outcome::Done(_), Err(reason)) = (&ended.outcome, told) {
            return Some(Ended::failed(format!("{} could not be recorded: {reason}", part.words())));
        }
        if let Outcome::Done(_) = ended.outcome {
            let there = self.history.parts_there(self.plan, parts);
            if let Some(kept) = kept.filter(|_| !self.is_there(&part, &there)) {
                // Nobody keeps it.
                self.held.insert((part.reference, part.number), kept);
            }
            return None;
        }
        // Its sums are no picture of the reference.
        Some(Ended::only(ended.outcome))
    }

    /// Joins the parts of a reference that is claimed, in their order. It fails where one is kept and cannot be read: it
    /// would be neither rendered nor joined, for ever.
    pub(super) fn join(&mut self, work: &Work<'a>, parts: &[Part]) -> Whole {
        let mut unread = None;
        loop {
            let whole = self.join_what_is_there(work, parts);
            let Whole::Missing(part) = whole else { return whole };
            if !self.history.parts_there(self.plan, parts).contains(&part.number) {
                return whole;
            }
            // A shorter reference may have been joined in between, and have taken it: then it is found in the second look.
            if unread.replace(part) == Some(part) {
                let what = format!("{} is kept, alone or joined, and cannot be read", part.words());
                return Whole::Failed(format!(
                    "{what}: remove what `refs/parts` and `refs/sums` have of this reference"
                ));
            }
        }
    }

    fn join_what_is_there(&mut self, work: &Work<'a>, parts: &[Part]) -> Whole {
        let mut joined = self.history.joined(self.plan, parts).and_then(|kept| Joined::begin(&kept).ok());
        let from = joined.as_ref().map_or(0, |joined| joined.sums.samples());
        let size = parts.first().map_or(0, |part| part.end);
        let mut ground = None;
        for part in parts.iter().filter(|part| part.first >= from) {
            let held = self.held.get(&(part.reference, part.number)).cloned();
            let Some(kept) = held.or_else(|| self.history.part(self.plan, part).map(Arc::new)) else {
                return Whole::Missing(*part);
            };
            if part.end - part.first != size {
                // A longer reference has another part here, so it goes on from what is before it.
                ground = joined.as_ref().and_then(|joined| joined.keep().ok());
            }
            let fits = match &mut joined {
                Some(joined) => joined.append(&kept).is_ok(),
                none => {
                    *none = Joined::begin(&kept).ok();
                    none.is_some()
                }
            };
            if !fits {
                return Whole::Failed(format!("{} does not fit to the others", part.words()));
            }
        }
        let Some(joined) = joined else { return Whole::Failed("it has no parts".to_owned()) };
        if parts.last().is_some_and(|part| part.end - part.first == size) {
            ground = joined.keep().ok();
        }
        match self.whole(work, joined, parts.len()) {
            Ok(ended) => Whole::Joined(Box::new((ended, ground))),
            Err(reason) => Whole::Failed(reason),
        }
    }

    /// The end of a reference whose parts are joined.
    fn whole(&mut self, work: &Work<'a>, joined: Joined, parts: usize) -> Result<Ended, String> {
        let Joined { sums: Sums { halves, open }, rows } = joined;
        let reason = self.stops(&work.stop, &rows)?.ok_or("its parts are not all of its samples")?;
        let resumed = Some(Arc::new(rows.clone()));
        self.emit(&Event::CellStarted { cell: work.cell, open: open.clone(), reference: None, resumed })?;
        self.say(Level::Info, work.cell, format!("joined from {parts} parts"))?;
        let film = Arc::new(guard("joining a reference", || Film::pooled(&halves[0], &halves[1]))?);
        let halves = Some(halves.map(Arc::new));
        Ok(Ended { film: Some(film), rows, halves, open, ..Ended::only(Outcome::Done(reason)) })
    }

    /// Keeps what longer references go on from, and lets go of the parts that are in it. Nothing is lost where that fails,
    /// and it is said.
    pub(super) fn keep_joined(&mut self, work: &Work<'a>, parts: &[Part], ground: Option<&Checkpoint>) {
        self.held.retain(|(reference, _), _| parts.iter().all(|part| part.reference != *reference));
        if let Err(error) = self.history.keep_joined(self.plan, parts, ground) {
            let text = format!("its sums could not be kept, so that a longer one will start anew: {error}");
            // The reference itself is not in danger.
            let _ = self.say(Level::Warn, work.cell, text);
        }
    }
}

/// What is kept of a part that is done.
fn sums_of(ended: &mut Ended) -> Result<Checkpoint, String> {
    let halves = ended.halves.take().ok_or("a part has no halves")?;
    let sums = Sums { halves: halves.map(Arc::unwrap_or_clone), open: ended.open.clone() };
    let joined = Joined { sums, rows: ended.rows.last().map(|row| row.alone()).into_iter().collect() };
    joined.keep().map_err(|e| e.to_string())
}
