//! From a script's experiment to its plan.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::axes::{self, Overrides, describe};
use super::path::Paths;
use super::resolve::{LoadScene, Renderable, Resolver};
use super::{Agree, Cell, Plan, PlanError, Reference, ReferenceSource, RunId, Skipped, identity};
use crate::experiment::parts;
use crate::experiment::spec::{AgreeRequest, CellConfig, HookError, Point, ReferenceRequest, ScriptHooks, Spec};
use crate::experiment::stop::StopRule;
use crate::render::hierarchy::InLanes;
use crate::value::Value;

/// Expands an experiment to its plan.
///
/// Points come in the order of the axes, the first axis slowest; the repeats of a point follow one another. Skip rules
/// are asked in their order and the first that says yes is recorded. Every scene file is read once through
/// `load_scene`; points with the same file and the same changes share one scene.
///
/// # Errors
/// Whatever keeps the night from being carried out as asked; nothing has been rendered or written then.
pub fn expand(
    spec: &Spec,
    hooks: &dyn ScriptHooks,
    overrides: &Overrides,
    load_scene: &mut LoadScene<'_>,
) -> Result<Plan, PlanError> {
    let axes = axes::select(&spec.axes, overrides, spec.repeats)?;
    let mut builder = Builder::new(spec, hooks, overrides, load_scene);
    for point in axes::points(&axes) {
        builder.add(point)?;
    }
    builder.settle_lanes();
    Ok(builder.finish())
}

/// A point of which only its cells are still to be made.
struct Ready {
    point: Point,
    renderable: Renderable,
    reference: Option<usize>,
    stop: StopRule,
    doubled: bool,
}

/// A plan in the making.
struct Builder<'a> {
    spec: &'a Spec,
    hooks: &'a dyn ScriptHooks,
    overrides: &'a Overrides,
    resolver: Resolver<'a>,
    columns: Vec<String>,
    /// The canonical measurements, without and with a reference.
    measure: [Value; 2],
    paths: Paths,
    ready: Vec<Ready>,
    cells: Vec<Cell>,
    references: Vec<Reference>,
    reference_places: BTreeMap<RunId, usize>,
    skipped: Vec<Skipped>,
    /// Stop rules that may never hold, with the number of runs that have them.
    endless: BTreeMap<String, usize>,
    unmeasured: usize,
    /// The pictures of which one technique has its doubles already.
    controlled: BTreeSet<RunId>,
    /// The warning that runs have no lanes which could have them.
    kept_alone: Option<String>,
}

impl<'a> Builder<'a> {
    fn new(
        spec: &'a Spec,
        hooks: &'a dyn ScriptHooks,
        overrides: &'a Overrides,
        load: &'a mut LoadScene<'a>,
    ) -> Builder<'a> {
        Builder {
            spec,
            hooks,
            overrides,
            resolver: Resolver::new(load, overrides.elsewhere),
            columns: spec.measure.metrics.iter().map(|metric| metric.column.clone()).collect(),
            measure: [false, true].map(|measured| identity::measure(&spec.measure, measured)),
            paths: Paths::default(),
            ready: Vec::new(),
            cells: Vec::new(),
            references: Vec::new(),
            reference_places: BTreeMap::new(),
            skipped: Vec::new(),
            endless: BTreeMap::new(),
            unmeasured: 0,
            controlled: BTreeSet::new(),
            kept_alone: None,
        }
    }

    fn add(&mut self, point: Point) -> Result<(), PlanError> {
        if let Some(reason) = self.skip_reason(&point)? {
            self.skipped.push(Skipped { point, reason, absent: false });
            return Ok(());
        }
        let config = self.hooks.render(&point).map_err(|e| hook("`render`", &point, e))?;
        let (renderable, reference) = match self.with_reference(config, &point) {
            Err(absent @ PlanError::Absent { .. }) => {
                self.skipped.push(Skipped { point, reason: absent.to_string(), absent: true });
                return Ok(());
            }
            found => found?,
        };
        let stop = self.hooks.stop(&point).map_err(|e| hook("`stop`", &point, e))?;
        stop.validate(&self.columns, reference.is_some()).map_err(|error| PlanError::Stop {
            whose: "stop rule",
            point: describe(&point),
            error: Box::new(error),
        })?;
        self.note_endless(&stop, self.spec.repeats as usize);
        if reference.is_none() {
            self.unmeasured += self.spec.repeats as usize;
        }
        let doubled = self.doubled(&renderable, &point)?;
        self.ready.push(Ready { point, renderable, reference, stop, doubled });
        Ok(())
    }

    /// Whether the cells of a point have doubles for the A/A check.
    fn doubled(&mut self, renderable: &Renderable, point: &Point) -> Result<bool, PlanError> {
        if !self.spec.control {
            return Ok(false);
        }
        let said = self.hooks.control(point).map_err(|e| hook("`control`", point, e))?;
        Ok(said.unwrap_or_else(|| {
            let mut others = renderable.picture.clone();
            for technique in ["integrator", "sampler", "rr_start", "films"] {
                others.remove(technique);
            }
            self.controlled.insert(identity::run_id(&Value::Map(others)))
        }))
    }

    fn skip_reason(&self, point: &Point) -> Result<Option<String>, PlanError> {
        for (rule, reason) in self.spec.skips.iter().enumerate() {
            let asked = self.hooks.skip(rule, point);
            if asked.map_err(|e| hook(&format!("skip rule `{reason}`"), point, e))? {
                return Ok(Some(reason.clone()));
            }
        }
        Ok(None)
    }

    fn with_reference(&mut self, config: CellConfig, point: &Point) -> Result<(Renderable, Option<usize>), PlanError> {
        let renderable = self.renderable(config, point)?;
        let reference = self.reference(&renderable, point)?;
        Ok((renderable, reference))
    }

    fn renderable(&mut self, mut config: CellConfig, point: &Point) -> Result<Renderable, PlanError> {
        self.override_backend(&mut config);
        self.resolver.renderable(config, point)
    }

    fn reference(&mut self, cell: &Renderable, point: &Point) -> Result<Option<usize>, PlanError> {
        let request = self.hooks.reference(point).map_err(|e| hook("`reference`", point, e))?;
        let reference = match request {
            None => return Ok(None),
            Some(ReferenceRequest::File { file, source }) => {
                let (id, identity) = self.resolver.reference_file(&file, point)?;
                Reference { id, source: ReferenceSource::File { file, source }, identity, agree: None }
            }
            Some(ReferenceRequest::Render { config, stop, agree, parts }) => {
                let seeds = identity::reference_seeds();
                let reference = self.rendered_reference(*config, stop, parts, seeds, cell, point)?;
                let place = self.place(reference);
                if let Some(AgreeRequest { config, stop, rate }) = agree.map(|agree| *agree) {
                    // Where time ends it, it has no parts.
                    let parts = if let StopRule::Samples(_) = stop { parts } else { 1 };
                    let seeds = identity::second_seeds();
                    let second = self.rendered_reference(config, stop, parts, seeds, cell, point)?;
                    let with = self.place(second);
                    self.references[place].agree = Some(Agree { with, rate });
                }
                return Ok(Some(place));
            }
        };
        Ok(Some(self.place(reference)))
    }

    /// The place of a reference in the plan, in which each stands once.
    fn place(&mut self, reference: Reference) -> usize {
        if let Some(place) = self.reference_places.get(&reference.id) {
            return *place;
        }
        let place = self.references.len();
        if let ReferenceSource::Render { stop, .. } = &reference.source {
            self.note_endless(stop, 1);
        }
        self.reference_places.insert(reference.id.clone(), place);
        self.references.push(reference);
        place
    }

    fn rendered_reference(
        &mut self,
        config: CellConfig,
        stop: StopRule,
        parts: u32,
        seeds: [u64; 2],
        cell: &Renderable,
        point: &Point,
    ) -> Result<Reference, PlanError> {
        let mut renderable = self.renderable(config, point)?;
        // Its time is nobody's, so that nothing has to be equal: it has lanes wherever there are any, and says nothing of them.
        renderable.go_alone();
        let Renderable { config, scene, picture, resolution, .. } = renderable;
        if resolution != cell.resolution {
            return Err(PlanError::ReferenceSize {
                point: describe(point),
                cell: cell.resolution,
                reference: resolution,
            });
        }
        stop.validate(&[], false).map_err(|error| PlanError::Stop {
            whose: "stop rule of the reference",
            point: describe(point),
            error: Box::new(error),
        })?;
        let end = identity::reference_stop(&stop, &self.spec.script_hash);
        let part = part_of(&config, &stop, parts, point)?;
        let stem = identity::stem(picture, seeds, part);
        let stem_id = identity::run_id(&Value::Map(stem.clone()));
        let identity = identity::reference(stem, end);
        let source = ReferenceSource::Render { config, scene, seeds, stem: stem_id, stop, part };
        Ok(Reference { id: identity::run_id(&identity), source, identity, agree: None })
    }

    fn add_cells(&mut self, ready: Ready) {
        let Ready { point, renderable, reference, stop, doubled } = ready;
        let base = self.paths.of(&point);
        let separator = if base.is_empty() { "" } else { "/" };
        let end = identity::cell_stop(&stop, &self.spec.script_hash, &point);
        let measure = &self.measure[usize::from(reference.is_some())];
        let truth = reference.map(|place| &self.references[place].id);
        let repeats = self.spec.repeats;
        // Doubles count on where the repeats end, so that a script which later asks for more repeats has them already.
        let doubles = (0..if doubled { repeats } else { 0 }).map(|r| (repeats + r, Some(r)));
        for (repeat, control) in (0..repeats).map(|r| (r, None)).chain(doubles) {
            let seed = identity::cell_seed(self.spec.seed, repeat);
            let run = identity::run(renderable.picture.clone(), seed, end.clone());
            let identity = identity::cell(run, measure.clone(), truth);
            self.cells.push(Cell {
                id: identity::run_id(&identity),
                point: point.clone(),
                repeat,
                control,
                seed,
                config: Arc::clone(&renderable.config),
                scene: Arc::clone(&renderable.scene),
                stop: stop.clone(),
                reference,
                path: format!("{base}{separator}rep={repeat}"),
                identity,
            });
        }
    }

    fn note_endless(&mut self, stop: &StopRule, runs: usize) {
        if !stop.must_end() {
            *self.endless.entry(stop.describe()).or_default() += runs;
        }
    }

    /// Lets the paths of all runs on the CPU go one by one where those of one have to, unless the script says for itself how
    /// they go: times would compare who has lanes. All points of the night count, selected or not, so that a run stays the
    /// same run whoever else is selected.
    fn settle_lanes(&mut self) {
        let reasons: BTreeSet<String> = self.ready.iter().filter_map(|ready| ready.renderable.alone.clone()).collect();
        let mut reasons: Vec<String> = reasons.into_iter().collect();
        if reasons.is_empty() && !self.overrides.only.is_empty() {
            reasons.extend(self.alone_elsewhere());
        }
        if reasons.is_empty() {
            return;
        }
        let left_open = |ready: &&mut Ready| ready.renderable.config.accel.lanes == InLanes::Auto;
        let mut open: Vec<&mut Ready> = self.ready.iter_mut().filter(left_open).collect();
        if open.iter().any(|ready| ready.renderable.alone.is_none()) {
            let all = reasons.join(" and ");
            self.kept_alone = Some(format!(
                "paths go one by one in all runs on `cpu`, since those {all} have to: times compare techniques, not who has \
                 lanes (accel = {{ lanes = \"always\" }} gives them to who can)"
            ));
        }
        open.iter_mut().for_each(|ready| ready.renderable.go_alone());
    }

    /// Why the paths of some run that is not selected have to go one by one, if they have to in any.
    fn alone_elsewhere(&mut self) -> Option<String> {
        let whole = Overrides { only: Vec::new(), ..self.overrides.clone() };
        // What cannot be made a plan of has no runs beside the selected ones.
        let axes = axes::select(&self.spec.axes, &whole, self.spec.repeats).ok()?;
        axes::points(&axes).find_map(|point| {
            let skipped = self.skip_reason(&point).ok()?;
            let mut config = self.hooks.render(&point).ok().filter(|_| skipped.is_none())?;
            self.override_backend(&mut config);
            self.resolver.alone(&config, &point)
        })
    }

    fn override_backend(&self, config: &mut CellConfig) {
        if let Some(backend) = &self.overrides.backend {
            config.backend.clone_from(backend);
        }
    }

    fn finish(mut self) -> Plan {
        for ready in std::mem::take(&mut self.ready) {
            self.add_cells(ready);
        }
        let mut warnings = self.warnings();
        if self.spec.control && self.cells.iter().all(|cell| cell.control.is_none()) {
            warnings.push("x:control has no cell to check: its function chose none".to_owned());
        }
        let mut plan = Plan {
            name: self.spec.name.clone(),
            hash: String::new(),
            seed: self.spec.seed,
            axes: self.spec.axes.iter().flat_map(|axis| axis.names.iter().cloned()).collect(),
            cells: self.cells,
            references: self.references,
            skipped: self.skipped,
            notes: self.resolver.notes.into_iter().collect(),
            warnings,
            measure: self.spec.measure.clone(),
            night: self.spec.night.clone(),
            figures: self.spec.figures.clone(),
            tables: self.spec.tables.clone(),
            script_text: self.spec.script_text.clone(),
            files: BTreeSet::new(),
        };
        plan.hash = identity::plan_hash(&plan);
        plan
    }

    fn warnings(&self) -> Vec<String> {
        let endless = |(rule, runs): (&String, &usize)| {
            format!("{runs} runs end only when `{rule}`, which may never be: add stop.time or stop.samples")
        };
        let mut warnings: Vec<String> = self.endless.iter().map(endless).collect();
        if self.unmeasured > 0 && !self.columns.is_empty() {
            let columns = self.columns.join(", ");
            warnings.push(format!("{} cells have no reference, so {columns} will not be measured", self.unmeasured));
        }
        warnings.extend(self.kept_alone.clone());
        warnings.extend(self.twins());
        warnings
    }

    /// The warning that several cells are the same run, if any are.
    fn twins(&self) -> Option<String> {
        let mut by_id: BTreeMap<&RunId, Vec<&Cell>> = BTreeMap::new();
        for cell in &self.cells {
            by_id.entry(&cell.id).or_default().push(cell);
        }
        let groups: Vec<&Vec<&Cell>> = by_id.values().filter(|cells| cells.len() > 1).collect();
        let mut idle: BTreeSet<usize> = BTreeSet::new();
        for cells in &groups {
            let differs = |axis: &usize| cells.iter().any(|cell| cell.point[*axis].1 != cells[0].point[*axis].1);
            idle.extend((0..cells[0].point.len()).filter(differs));
        }
        let name = |axis: usize| format!("`{}`", self.cells[0].point[axis].0);
        let names: Vec<String> = idle.into_iter().map(name).collect();
        let subject = match names.as_slice() {
            [] => return None,
            [one] => format!("axis {one} changes"),
            _ => format!("axes {} change", names.join(", ")),
        };
        let cells: usize = groups.iter().map(|cells| cells.len()).sum();
        Some(format!(
            "{subject} nothing in {cells} of {} cells, which share {} run ids",
            self.cells.len(),
            groups.len()
        ))
    }
}

fn hook(function: &str, point: &Point, error: HookError) -> PlanError {
    PlanError::Hook { function: function.to_owned(), point: describe(point), error }
}

/// Samples per pixel of a reference's parts, where it has several.
fn part_of(config: &CellConfig, stop: &StopRule, parts: u32, point: &Point) -> Result<Option<u64>, PlanError> {
    if parts <= 1 {
        return Ok(None);
    }
    let refuse = |reason: &str| Err(PlanError::Parts { point: describe(point), reason: reason.to_owned() });
    match stop {
        _ if !config.films.is_empty() || config.timing.is_some() => {
            refuse("layers and time axes are not joined: leave `films` and `film` out of its render table")
        }
        StopRule::Samples(total) => Ok(parts::size(*total, parts)),
        _ => refuse("only a number of samples can be divided: stop = stop.samples(4096)"),
    }
}
