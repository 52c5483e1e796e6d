//! Shards of references: each is claimed, rendered and stored on its own, by any process, and the
//! process that finds all of them stored joins them.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::active_run::{EndedRun, RunRequest};
use super::open::catch_panic;
use super::state::NightRunner;
use crate::experiment::event::Event;
use crate::experiment::outcome::{Level, Outcome};
use crate::experiment::run_progress::{Checkpoint, Claim};
use crate::experiment::shards::{JoinedShards, Shard, ShardSums, WorkUnit};
use crate::experiment::stop::StopRule;
use lumbre_light::film::Film;

/// Result of joining the shards of a reference.
pub(super) enum JoinResult {
    /// The finished reference, and the sums that longer references can continue, if any.
    Joined(Box<(EndedRun, Option<Checkpoint>)>),
    /// The shards cannot be joined, for this reason.
    Failed(String),
    /// This shard is missing or damaged.
    Missing(Shard),
}

impl<'a> NightRunner<'a, '_> {
    /// Renders the shards of a reference that are neither stored nor claimed by another process.
    /// Returns how rendering ended if it did not succeed.
    ///
    /// # Errors
    /// The name of the process that renders a missing shard.
    pub(super) fn render_shards(
        &mut self,
        request: &RunRequest<'a>,
        shards: &[Shard],
    ) -> Result<Option<EndedRun>, String> {
        let mut held_by = None;
        let mut available = self.history.available_shards(self.plan, shards);
        for shard in shards {
            if self.is_stored(shard, &available) {
                continue;
            }
            let unit = WorkUnit::Shard(*shard);
            match self.history.claim(self.plan, unit) {
                Ok(Claim::Granted) => {}
                Ok(Claim::HeldBy(owner) | Claim::WrongWorker(owner)) => {
                    held_by = Some(owner);
                    continue;
                }
                Err(error) => return Ok(Some(EndedRun::failed(error.to_string()))),
            }
            // Another process may have finished it, or joined all of them, before the claim was
            // granted.
            available = self.history.available_shards(self.plan, shards);
            let done = self.is_stored(shard, &available)
                || self.history.finished_run(self.plan, request.cell).is_some();
            let ended = if done {
                None
            } else {
                self.render_shard(request, *shard, shards)
            };
            self.history.release(self.plan, unit);
            if ended.is_some() {
                return Ok(ended);
            }
        }
        held_by.map_or(Ok(None), Err)
    }

    /// Whether a shard needs no rendering; `available` are the numbers of those in the history.
    fn is_stored(&self, shard: &Shard, available: &BTreeSet<usize>) -> bool {
        self.shards_in_memory
            .contains_key(&(shard.reference, shard.number))
            || available.contains(&shard.number)
    }

    /// Renders a claimed shard. Returns how rendering ended if the shard is not stored afterwards.
    fn render_shard(
        &mut self,
        request: &RunRequest<'a>,
        shard: Shard,
        shards: &[Shard],
    ) -> Option<EndedRun> {
        let stop = StopRule::Samples(shard.end - shard.first);
        let mut ended = self.render_run(RunRequest {
            shard: Some(shard),
            stop,
            ..request.clone()
        });
        let mut sums = None;
        if let Outcome::Done(_) = ended.outcome {
            if self.history.holds_claim(self.plan, WorkUnit::Shard(shard)) {
                match shard_checkpoint(&mut ended) {
                    Ok(checkpoint) => sums = Some(Arc::new(checkpoint)),
                    Err(reason) => ended.outcome = Outcome::Failed(reason),
                }
            } else {
                let text = format!(
                    "another process took over {} while this process was suspended",
                    shard.label()
                );
                // The shard is not lost, only not recorded here.
                let _ = self.emit_message(Level::Warn, request.cell, text);
            }
        }
        let last = ended.rows.last().cloned();
        let outcome = ended.outcome.clone();
        let emitted = self.emit(&Event::ShardFinished {
            shard,
            outcome,
            last,
            sums: sums.clone(),
        });
        if let (Outcome::Done(_), Err(reason)) = (&ended.outcome, emitted) {
            return Some(EndedRun::failed(format!(
                "{} could not be recorded: {reason}",
                shard.label()
            )));
        }
        if let Outcome::Done(_) = ended.outcome {
            let available = self.history.available_shards(self.plan, shards);
            if let Some(sums) = sums.filter(|_| !self.is_stored(&shard, &available)) {
                // The history does not store it.
                self.shards_in_memory
                    .insert((shard.reference, shard.number), sums);
            }
            return None;
        }
        // The film of a shard is not a picture of the reference.
        Some(EndedRun::without_results(ended.outcome))
    }

    /// Joins the shards of a claimed reference in order. Fails if a stored shard cannot be read,
    /// since it would otherwise be neither rendered nor joined.
    pub(super) fn join(&mut self, request: &RunRequest<'a>, shards: &[Shard]) -> JoinResult {
        let mut unreadable = None;
        loop {
            let result = self.try_join(request, shards);
            let JoinResult::Missing(shard) = result else {
                return result;
            };
            if !self
                .history
                .available_shards(self.plan, shards)
                .contains(&shard.number)
            {
                return result;
            }
            // Another process may have joined a shorter reference meanwhile and removed the shard.
            // The second attempt then finds the joined sums.
            if unreadable.replace(shard) == Some(shard) {
                return JoinResult::Failed(format!(
                    "{} is stored but cannot be read: delete the files of this reference in \
                     `refs/shards` and `refs/sums`",
                    shard.label()
                ));
            }
        }
    }

    fn try_join(&mut self, request: &RunRequest<'a>, shards: &[Shard]) -> JoinResult {
        let mut joined = self
            .history
            .joined_shards(self.plan, shards)
            .and_then(|stored| JoinedShards::from_checkpoint(&stored).ok());
        let from = joined.as_ref().map_or(0, |joined| joined.sums.samples());
        let size = shards.first().map_or(0, |shard| shard.end);
        let mut continuable = None;
        for shard in shards.iter().filter(|shard| shard.first >= from) {
            let in_memory = self
                .shards_in_memory
                .get(&(shard.reference, shard.number))
                .cloned();
            let Some(sums) =
                in_memory.or_else(|| self.history.shard(self.plan, shard).map(Arc::new))
            else {
                return JoinResult::Missing(*shard);
            };
            if shard.end - shard.first != size {
                // A longer reference has a shard of another size here, so it continues the sums
                // before this one.
                continuable = joined
                    .as_ref()
                    .and_then(|joined| joined.to_checkpoint().ok());
            }
            let fits = match &mut joined {
                Some(joined) => joined.append(&sums).is_ok(),
                none => {
                    *none = JoinedShards::from_checkpoint(&sums).ok();
                    none.is_some()
                }
            };
            if !fits {
                return JoinResult::Failed(format!(
                    "{} does not match the other shards",
                    shard.label()
                ));
            }
        }
        let Some(joined) = joined else {
            return JoinResult::Failed("it has no shards".to_owned());
        };
        if shards
            .last()
            .is_some_and(|shard| shard.end - shard.first == size)
        {
            continuable = joined.to_checkpoint().ok();
        }
        match self.joined_reference(request, joined, shards.len()) {
            Ok(ended) => JoinResult::Joined(Box::new((ended, continuable))),
            Err(reason) => JoinResult::Failed(reason),
        }
    }

    /// Makes the result of a reference whose shards are joined.
    fn joined_reference(
        &mut self,
        request: &RunRequest<'a>,
        joined: JoinedShards,
        shards: usize,
    ) -> Result<EndedRun, String> {
        let JoinedShards {
            sums: ShardSums { halves, open },
            rows,
        } = joined;
        let cause = self
            .stop_cause(&request.stop, &rows)?
            .ok_or("its shards do not contain all of its samples")?;
        let resumed = Some(Arc::new(rows.clone()));
        self.emit(&Event::CellStarted {
            cell: request.cell,
            open: open.clone(),
            reference: None,
            resumed,
            settings: None,
        })?;
        let text = format!("joined from {shards} shards");
        self.emit_message(Level::Info, request.cell, text)?;
        let film = Arc::new(catch_panic("joining a reference", || {
            Film::pooled(&halves[0], &halves[1])
        })?);
        let halves = Some(halves.map(Arc::new));
        Ok(EndedRun {
            film: Some(film),
            rows,
            halves,
            open,
            ..EndedRun::without_results(Outcome::Done(cause))
        })
    }

    /// Stores the sums that longer references can continue, and deletes the shards that they
    /// contain. A failure is only reported.
    pub(super) fn save_joined_shards(
        &mut self,
        request: &RunRequest<'a>,
        shards: &[Shard],
        continuable: Option<&Checkpoint>,
    ) {
        self.shards_in_memory
            .retain(|(reference, _), _| shards.iter().all(|shard| shard.reference != *reference));
        if let Err(error) = self
            .history
            .save_joined_shards(self.plan, shards, continuable)
        {
            let text = format!(
                "its sums could not be stored, so longer references will start from zero: {error}"
            );
            // A failed message does not affect the reference.
            let _ = self.emit_message(Level::Warn, request.cell, text);
        }
    }
}

/// Makes the checkpoint of a finished shard, with one row for all of its waves.
fn shard_checkpoint(ended: &mut EndedRun) -> Result<Checkpoint, String> {
    let halves = ended.halves.take().ok_or("a shard has no halves")?;
    let sums = ShardSums {
        halves: halves.map(Arc::unwrap_or_clone),
        open: ended.open.clone(),
    };
    let shard = JoinedShards {
        sums,
        rows: ended
            .rows
            .last()
            .map(|row| row.as_single_wave())
            .into_iter()
            .collect(),
    };
    shard.to_checkpoint().map_err(|e| e.to_string())
}
