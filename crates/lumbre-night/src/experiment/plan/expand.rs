//! Expansion of a script's experiment to its plan.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::axes::{self, Overrides, QUICK, describe};
use super::cell_identity::CellIdentity;
use super::path::Paths;
use super::resolve::{LoadScene, Renderable, Resolver};
use super::{
    BiasCheck, Cell, Plan, PlanError, PlannedCommand, Reference, ReferenceSource, RunId, Skipped,
    identity, sheet_check, warnings,
};
use crate::experiment::hook_error::HookError;
use crate::experiment::shards;
use crate::experiment::spec::{
    Axis, BiasCheckRequest, ExperimentSpec, Point, ReferenceRequest, ScriptHooks,
};
use crate::experiment::stop::StopRule;
use lumbre_light::transport::integrator::{bias_of, integrator};
use lumbre_light::value::Value;
use lumbre_render::Settings;

/// Expands an experiment to its plan.
///
/// Points follow the order of the axes, with the first axis slowest; the repeats of a point follow
/// one another. Skip rules are evaluated in their order, and the first one that applies is
/// recorded. Every scene file is read once through `load_scene`; points with the same file and the
/// same changes share one scene.
///
/// # Errors
/// When the night cannot be carried out as requested; nothing has been rendered or written then.
pub fn expand(
    spec: &ExperimentSpec,
    hooks: &dyn ScriptHooks,
    overrides: &Overrides,
    load_scene: &mut LoadScene<'_>,
) -> Result<Plan, PlanError> {
    let axes = axes::select(&spec.axes, overrides, spec.repeats)?;
    let mut builder = Builder::new(spec, &axes, hooks, overrides, load_scene);
    for point in axes::points(&axes) {
        builder.add(point)?;
    }
    let plan = builder.finish();
    sheet_check::check(&plan)?;
    Ok(plan)
}

/// Describes the axes that the script does not declare, which are settings of the command line.
fn given_settings(axes: &[Axis], spec: &ExperimentSpec, quick: bool) -> Vec<String> {
    let declared = |name: &String| spec.axes.iter().any(|axis| axis.names.contains(name));
    let given = axes.iter().filter(|axis| !axis.names.iter().any(declared));
    let describe = |axis: &Axis| {
        let values = axis.steps.iter().flatten().map(Value::to_string);
        let values: Vec<String> = values.collect();
        format!("{} = {}", axis.names.join(", "), values.join(", "))
    };
    let mut settings: Vec<String> = given.map(describe).collect();
    if quick {
        settings.push(QUICK.to_owned());
    }
    settings
}

/// A resolved point whose cells are still to be made.
struct PendingPoint {
    point: Point,
    renderable: Renderable,
    reference: Option<usize>,
    stop: StopRule,
    /// Whether its cells have doubles for the A/A check.
    doubled: bool,
}

/// A plan under construction.
struct Builder<'a> {
    spec: &'a ExperimentSpec,
    hooks: &'a dyn ScriptHooks,
    overrides: &'a Overrides,
    resolver: Resolver<'a>,
    /// Names of the axes, slowest first.
    axes: Vec<String>,
    /// Settings of the command line.
    settings: Vec<String>,
    columns: Vec<String>,
    /// Canonical forms of the measurements, without and with a reference.
    measure: [Arc<Value>; 2],
    paths: Paths,
    pending: Vec<PendingPoint>,
    cells: Vec<Cell>,
    /// Index of the first cell of every run.
    first_cells: BTreeMap<RunId, usize>,
    references: Vec<Reference>,
    /// Index of every reference by its id.
    reference_indices: BTreeMap<RunId, usize>,
    skipped: Vec<Skipped>,
    /// Descriptions of stop rules that may never hold, with the number of runs that have them.
    endless: BTreeMap<String, usize>,
    /// Number of cells without a reference.
    unmeasured: usize,
    /// Pictures that already have a technique with doubles.
    pictures_with_doubles: BTreeSet<RunId>,
}

impl<'a> Builder<'a> {
    fn new(
        spec: &'a ExperimentSpec,
        axes: &[Axis],
        hooks: &'a dyn ScriptHooks,
        overrides: &'a Overrides,
        load: &'a mut LoadScene<'a>,
    ) -> Builder<'a> {
        let names = axes.iter().flat_map(|axis| axis.names.iter().cloned());
        let measure = overrides.measure(&spec.measure);
        Builder {
            spec,
            hooks,
            overrides,
            resolver: Resolver::new(load, overrides),
            axes: names.collect(),
            settings: given_settings(axes, spec, overrides.quick),
            columns: spec
                .measure
                .metrics
                .iter()
                .map(|metric| metric.column.clone())
                .collect(),
            measure: [false, true].map(|measured| Arc::new(identity::measure(&measure, measured))),
            paths: Paths::default(),
            pending: Vec::new(),
            cells: Vec::new(),
            first_cells: BTreeMap::new(),
            references: Vec::new(),
            reference_indices: BTreeMap::new(),
            skipped: Vec::new(),
            endless: BTreeMap::new(),
            unmeasured: 0,
            pictures_with_doubles: BTreeSet::new(),
        }
    }

    /// Resolves a point and adds it to the plan, unless it is skipped or needs a program that is
    /// not installed.
    fn add(&mut self, point: Point) -> Result<(), PlanError> {
        if let Some(reason) = self.skip_reason(&point)? {
            self.skipped.push(Skipped {
                point,
                reason,
                absent: false,
            });
            return Ok(());
        }
        let config = self
            .hooks
            .render(&point)
            .map_err(|e| hook("`render`", &point, e))?;
        let (renderable, reference) = match self.with_reference(config, &point) {
            Err(absent @ PlanError::Absent { .. }) => {
                self.skipped.push(Skipped {
                    point,
                    reason: absent.to_string(),
                    absent: true,
                });
                return Ok(());
            }
            resolved => resolved?,
        };
        let stop = self
            .hooks
            .stop(&point)
            .map_err(|e| hook("`stop`", &point, e))?;
        let stop = self.overrides.stop(stop);
        stop.validate(&self.spec.measure.metrics, reference.is_some())
            .map_err(|error| PlanError::Stop {
                rule: "stop rule",
                point: describe(&point),
                error: Box::new(error),
            })?;
        self.note_endless(&stop, self.spec.repeats as usize);
        if reference.is_none() {
            self.unmeasured += self.spec.repeats as usize;
        }
        let doubled = self.is_doubled(&renderable, &point)?;
        self.pending.push(PendingPoint {
            point,
            renderable,
            reference,
            stop,
            doubled,
        });
        Ok(())
    }

    /// Whether the cells of a point have doubles for the A/A check.
    fn is_doubled(&mut self, renderable: &Renderable, point: &Point) -> Result<bool, PlanError> {
        if !self.spec.aa_check {
            return Ok(false);
        }
        let requested = self
            .hooks
            .aa_check(point)
            .map_err(|e| hook("`control`", point, e))?;
        Ok(requested.unwrap_or_else(|| {
            let mut picture = renderable.picture.clone();
            for technique in [
                "integrator",
                "sampler",
                "rr_start",
                "films",
                "denoise",
                "shaders",
            ] {
                picture.remove(technique);
            }
            self.pictures_with_doubles
                .insert(identity::run_id(&Value::Map(picture)))
        }))
    }

    /// Returns the reason of the first skip rule that applies to a point.
    fn skip_reason(&self, point: &Point) -> Result<Option<String>, PlanError> {
        for (rule, reason) in self.spec.skips.iter().enumerate() {
            let skipped = self.hooks.skip(rule, point);
            if skipped.map_err(|e| hook(&format!("skip rule `{reason}`"), point, e))? {
                return Ok(Some(reason.clone()));
            }
        }
        Ok(None)
    }

    /// Resolves the cell of a point and its reference.
    fn with_reference(
        &mut self,
        config: Settings,
        point: &Point,
    ) -> Result<(Renderable, Option<usize>), PlanError> {
        let renderable = self.renderable(config, point)?;
        let reference = self.reference(&renderable, point)?;
        Ok((renderable, reference))
    }

    fn renderable(&mut self, mut config: Settings, point: &Point) -> Result<Renderable, PlanError> {
        self.override_backend(&mut config);
        self.resolver.renderable(config, point)
    }

    /// Resolves the reference of a point and adds it to the plan. Returns its index.
    fn reference(&mut self, cell: &Renderable, point: &Point) -> Result<Option<usize>, PlanError> {
        let request = self
            .hooks
            .reference(point)
            .map_err(|e| hook("`reference`", point, e))?;
        let (config, stop, bias_check, shards) = match request {
            None => return Ok(None),
            Some(ReferenceRequest::File { file, source }) => {
                let (id, identity) = self.resolver.reference_file(&file, point)?;
                return Ok(Some(self.add_reference(Reference {
                    id,
                    source: ReferenceSource::File { file, source },
                    identity,
                    bias_check: None,
                })));
            }
            Some(ReferenceRequest::Render {
                config,
                stop,
                bias_check,
                shards,
            }) => (config, stop, bias_check, shards),
        };
        let second = bias_check.as_ref().map(|check| &check.config);
        let denoised = |config: &Settings| config.denoise.is_some();
        if denoised(&config) || second.is_some_and(denoised) {
            return Err(PlanError::DenoisedReference {
                point: describe(point),
            });
        }
        if let Some(check) = &bias_check {
            for name in [&config.integrator, &check.config.integrator] {
                if let Some(bias) = bias_of(name) {
                    return Err(PlanError::BiasedCheck {
                        point: describe(point),
                        name: name.clone(),
                        bias,
                    });
                }
            }
        }
        let seeds = identity::reference_seeds();
        let stop = self.overrides.stop(stop);
        let reference = self.rendered_reference(*config, stop, shards, seeds, cell, point)?;
        let index = self.add_reference(reference);
        if let Some(BiasCheckRequest { config, stop, rate }) = bias_check.map(|check| *check) {
            // A second picture with a time limit cannot be split into shards.
            let stop = self.overrides.stop(stop);
            let shards = if let StopRule::Samples(_) = stop {
                shards
            } else {
                1
            };
            let seeds = identity::bias_check_seeds();
            let second = self.rendered_reference(config, stop, shards, seeds, cell, point)?;
            let with = self.add_reference(second);
            self.references[index].bias_check = Some(BiasCheck { with, rate });
        }
        Ok(Some(index))
    }

    /// Adds a reference to the plan, unless it is already there, and returns its index.
    fn add_reference(&mut self, reference: Reference) -> usize {
        if let Some(index) = self.reference_indices.get(&reference.id) {
            return *index;
        }
        let index = self.references.len();
        if let ReferenceSource::Render { stop, .. } = &reference.source {
            self.note_endless(stop, 1);
        }
        self.reference_indices.insert(reference.id.clone(), index);
        self.references.push(reference);
        index
    }

    /// Resolves a reference that Lumbre renders, split into at most `shards` shards.
    fn rendered_reference(
        &mut self,
        config: Settings,
        stop: StopRule,
        shards: u32,
        seeds: [u64; 2],
        cell: &Renderable,
        point: &Point,
    ) -> Result<Reference, PlanError> {
        let mut renderable = self.renderable(config, point)?;
        // Times of references are not compared. Their identity has no vectorisation setting; they
        // are vectorised wherever possible when they are rendered.
        renderable.use_scalar_path();
        let Renderable {
            config,
            scene,
            picture,
            resolution,
            ..
        } = renderable;
        if resolution != cell.resolution {
            return Err(PlanError::ReferenceSize {
                point: describe(point),
                cell: cell.resolution,
                reference: resolution,
            });
        }
        stop.validate(&[], false).map_err(|error| PlanError::Stop {
            rule: "stop rule of the reference",
            point: describe(point),
            error: Box::new(error),
        })?;
        let end = identity::reference_stop(&stop, &self.spec.script_hash);
        let shard_samples = shard_samples(&config, &stop, shards, point)?;
        let stem = identity::stem(picture, seeds, shard_samples);
        let stem_id = identity::run_id(&Value::Map(stem.clone()));
        let identity = identity::reference(stem, end);
        let source = ReferenceSource::Render {
            config,
            scene,
            seeds,
            stem: stem_id,
            stop,
            shard_samples,
        };
        Ok(Reference {
            id: identity::run_id(&identity),
            source,
            identity,
            bias_check: None,
        })
    }

    /// Makes the cells of a point: its repeats, and their doubles for the A/A check.
    fn add_cells(&mut self, pending: PendingPoint) {
        let PendingPoint {
            point,
            renderable,
            reference,
            stop,
            doubled,
        } = pending;
        let base = self.paths.unique_path(&point);
        let separator = if base.is_empty() { "" } else { "/" };
        let picture = Arc::new(renderable.picture);
        let end = Arc::new(identity::cell_stop(&stop, &self.spec.script_hash, &point));
        let measure = &self.measure[usize::from(reference.is_some())];
        let reference_id = reference.map(|index| &self.references[index].id);
        let repeats = self.spec.repeats;
        // Doubles are numbered after the repeats, so that they can serve as repeats if the script
        // later requests more of them.
        let doubles = (0..if doubled { repeats } else { 0 }).map(|r| (repeats + r, Some(r)));
        for (repeat, double_of) in (0..repeats).map(|r| (r, None)).chain(doubles) {
            let seed = identity::cell_seed(self.spec.seed, repeat);
            let identity = CellIdentity::new(&picture, measure, seed, &end, reference_id);
            let id = identity.run_id();
            let index = self.cells.len();
            self.cells.push(Cell {
                first: *self.first_cells.entry(id.clone()).or_insert(index),
                id,
                point: point.clone(),
                repeat,
                double_of,
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

    /// Records a stop rule that may never hold.
    fn note_endless(&mut self, stop: &StopRule, runs: usize) {
        if !stop.must_end() {
            *self.endless.entry(stop.describe()).or_default() += runs;
        }
    }

    fn override_backend(&self, config: &mut Settings) {
        if let Some(backend) = &self.overrides.backend {
            config.backend.clone_from(backend);
        }
    }

    fn finish(mut self) -> Plan {
        for pending in std::mem::take(&mut self.pending) {
            self.add_cells(pending);
        }
        let mut warnings = self.warnings();
        if self.spec.aa_check && self.cells.iter().all(|cell| cell.double_of.is_none()) {
            warnings
                .push("x:control checks no cell: its function returned true for none".to_owned());
        }
        let has_version = |command: &PlannedCommand| command.version.is_some();
        if !self.overrides.commands && self.resolver.commands.iter().any(has_version) {
            warnings.push(
                "commands of external techniques are not allowed yet, so the versions of their \
                 programs are unknown and their finished runs are not recognised"
                    .to_owned(),
            );
        }
        let mut plan = Plan {
            name: self.spec.name.clone(),
            hash: String::new(),
            seed: self.spec.seed,
            settings: self.settings,
            axes: self.axes,
            cells: self.cells,
            references: self.references,
            skipped: self.skipped,
            notes: self.resolver.notes.into_iter().collect(),
            commands: self
                .resolver
                .commands
                .into_iter()
                .chain(
                    self.spec
                        .night
                        .notices
                        .iter()
                        .map(PlannedCommand::of_notice),
                )
                .collect(),
            commands_allowed: self.overrides.commands,
            warnings,
            measure: self.overrides.measure(&self.spec.measure),
            night: self.spec.night.clone(),
            figures: self.spec.figures.clone(),
            tables: self.spec.tables.clone(),
            sheets: self.spec.sheets.clone(),
            report: self.spec.report.clone(),
            script_text: self.spec.script_text.clone(),
            files: BTreeSet::new(),
        };
        plan.hash = identity::plan_hash(&plan);
        plan
    }

    fn warnings(&self) -> Vec<String> {
        let endless = |(rule, runs): (&String, &usize)| {
            let runs = if *runs == 1 {
                "1 run stops".to_owned()
            } else {
                format!("{runs} runs stop")
            };
            format!("{runs} only at `{rule}`, which may never hold: add stop.time or stop.samples")
        };
        let mut found: Vec<String> = self.endless.iter().map(endless).collect();
        if self.unmeasured > 0 && !self.columns.is_empty() {
            let cells = if self.unmeasured == 1 {
                "1 cell has".to_owned()
            } else {
                format!("{} cells have", self.unmeasured)
            };
            let columns = self.columns.join(", ");
            found.push(format!(
                "{cells} no reference, so {columns} will not be measured"
            ));
        }
        let biased = warnings::biased_references(&self.references);
        let without_bars = |text| format!("{text}; its error bars contain none of that");
        found.extend(biased.into_iter().map(without_bars));
        found.extend(self.checks_with_common_noise());
        found.extend(warnings::denoised_cells(&self.cells));
        found.extend(warnings::short_references(&self.cells, &self.references));
        found.extend(warnings::duplicates(&self.cells));
        found.extend(warnings::few_repeats(&self.cells, self.spec.repeats));
        found
    }

    /// Returns a warning for each integrator of bias checks whose samples share data.
    fn checks_with_common_noise(&self) -> Vec<String> {
        let checked = self.references.iter().filter_map(|r| {
            let second = &self.references[r.bias_check.as_ref()?.with];
            Some([&r.source, &second.source])
        });
        let shares = checked.flatten().filter_map(|source| match source {
            ReferenceSource::Render { config, .. } => {
                let name = config.integrator.as_str();
                integrator(name)?.has_common_noise().then_some(name)
            }
            ReferenceSource::File { .. } => None,
        });
        let warning = |name| {
            format!(
                "the bias check takes pixels for independent, but those of `{name}` share light \
                 subpaths: with fewer of them than pixels it may report noise as a bias. Give \
                 `photons` at least the number of pixels, its default"
            )
        };
        let shares: BTreeSet<&str> = shares.collect();
        shares.into_iter().map(warning).collect()
    }
}

/// Makes a planning error of a failed script function.
fn hook(function: &str, point: &Point, error: HookError) -> PlanError {
    PlanError::Hook {
        function: function.to_owned(),
        point: describe(point),
        error,
    }
}

/// Returns the samples per pixel of a reference's shards, if it is split into more than one.
fn shard_samples(
    config: &Settings,
    stop: &StopRule,
    max_shards: u32,
    point: &Point,
) -> Result<Option<u64>, PlanError> {
    if max_shards <= 1 {
        return Ok(None);
    }
    let refuse = |reason: &str| {
        Err(PlanError::Shards {
            point: describe(point),
            reason: reason.to_owned(),
        })
    };
    match stop {
        _ if !config.films.is_empty() || config.timing.is_some() => refuse(
            "layers and time axes cannot be joined from parts: remove `films` and `film` from its \
             render table",
        ),
        StopRule::Samples(total) => Ok(shards::shard_size(*total, max_shards)),
        _ => {
            refuse("a reference in parts needs a number of samples: use stop = stop.samples(4096)")
        }
    }
}
