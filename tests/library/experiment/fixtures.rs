//! A small experiment without a script: its hooks are closures, each of which a test can replace.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use glam::Vec3;
use lumbre_light::film::{Film, Image};
use lumbre_light::scene::desc::{CameraDesc, EntityDesc, MaterialDesc, Optics, ShapeDesc};
use lumbre_light::scene::{Note, SceneDesc, SceneError};
use lumbre_light::value::Value;
use lumbre_metrics::MetricSpec;
use lumbre_metrics::tonemap::Tonemap;
use lumbre_night::experiment::event::{FinishedRun, History, SaveState};
use lumbre_night::experiment::hook_error::HookError;
use lumbre_night::experiment::noise_floor::HalfImages;
use lumbre_night::experiment::outcome::Level;
use lumbre_night::experiment::plan::{LoadedScene, expand};
use lumbre_night::experiment::run::{Open, Seams, run_with};
use lumbre_night::experiment::run_progress::{Checkpoint, Claim, RunProgress};
use lumbre_night::experiment::shards::WorkUnit;
use lumbre_night::experiment::spec::{Axis, MeasureSpec, ReferenceRequest, Snapshots};
use lumbre_night::experiment::{
    CellRef, Event, ExperimentSpec, NightControls, NightSummary, Outcome, Overrides, Plan,
    PlanError, Point, RunError, RunId, ScriptHooks, Sink, SinkError, StopRule, WaveRow,
};
use lumbre_render::Settings;
use lumbre_render::mock::MockRenderer;

pub type Hook<T> = Box<dyn Fn(&Point) -> Result<T, HookError>>;
pub type SkipHook = Box<dyn Fn(usize, &Point) -> Result<bool, HookError>>;
pub type PredicateHook = Box<dyn Fn(usize, &[String], &[WaveRow]) -> Result<bool, HookError>>;

/// An experiment whose every hook can be replaced.
pub struct Lab {
    pub spec: ExperimentSpec,
    pub overrides: Overrides,
    pub skip: SkipHook,
    pub render: Hook<Settings>,
    pub reference: Hook<Option<ReferenceRequest>>,
    pub stop: Hook<StopRule>,
    pub predicate: PredicateHook,
    /// Scene files that were requested, in order.
    pub loads: RefCell<Vec<PathBuf>>,
}

impl ScriptHooks for Lab {
    fn skip(&self, rule: usize, point: &Point) -> Result<bool, HookError> {
        (self.skip)(rule, point)
    }

    fn render(&self, point: &Point) -> Result<Settings, HookError> {
        (self.render)(point)
    }

    fn reference(&self, point: &Point) -> Result<Option<ReferenceRequest>, HookError> {
        (self.reference)(point)
    }

    fn stop(&self, point: &Point) -> Result<StopRule, HookError> {
        (self.stop)(point)
    }

    fn predicate(
        &self,
        id: usize,
        columns: &[String],
        rows: &[WaveRow],
    ) -> Result<bool, HookError> {
        (self.predicate)(id, columns, rows)
    }
}

impl Lab {
    /// Creates an experiment with no axes, one repeat, 8x4 pixels on the mock, 16 samples per cell,
    /// no metrics and no reference.
    pub fn new() -> Lab {
        Lab {
            spec: spec(),
            overrides: Overrides::default(),
            skip: Box::new(|_, _| Ok(false)),
            render: Box::new(|_| Ok(config())),
            reference: Box::new(|_| Ok(None)),
            stop: Box::new(|_| Ok(StopRule::Samples(16))),
            predicate: Box::new(|id, _, _| {
                Err(HookError(format!("there is no predicate {id}").into()))
            }),
            loads: RefCell::default(),
        }
    }

    /// Adds an axis.
    pub fn axis(mut self, name: &str, values: impl IntoIterator<Item = impl Into<Value>>) -> Lab {
        let steps = values.into_iter().map(|v| vec![v.into()]).collect();
        self.spec.axes.push(Axis {
            names: vec![name.to_owned()],
            steps,
        });
        self
    }

    /// Adds axes that move together.
    pub fn zip<const N: usize>(mut self, names: [&str; N], steps: &[[Value; N]]) -> Lab {
        let steps = steps.iter().map(|step| step.to_vec()).collect();
        self.spec.axes.push(Axis {
            names: names.map(str::to_owned).to_vec(),
            steps,
        });
        self
    }

    /// Measures RMSE against a reference of 4096 samples of the same configuration.
    pub fn measured(mut self) -> Lab {
        self.spec.measure.metrics = vec![MetricSpec::new("rmse", "rmse", BTreeMap::new()).unwrap()];
        let render = std::mem::replace(&mut self.render, Box::new(|_| Ok(config())));
        let render = std::rc::Rc::new(render);
        let again = std::rc::Rc::clone(&render);
        self.render = Box::new(move |p| render(p));
        self.reference = Box::new(move |p| {
            Ok(Some(ReferenceRequest::Render {
                config: Box::new(again(p)?),
                stop: StopRule::Samples(4096),
                bias_check: None,
                shards: 1,
            }))
        });
        self
    }

    /// Returns the plan, or the reason why there is none.
    pub fn try_plan(&self) -> Result<Plan, PlanError> {
        let mut load = |file: &Path, _: &BTreeMap<String, Value>| {
            self.loads.borrow_mut().push(file.to_owned());
            load_scene(file)
        };
        expand(&self.spec, self, &self.overrides, &mut load)
    }

    /// Returns the plan.
    pub fn plan(&self) -> Plan {
        self.try_plan().unwrap()
    }
}

fn spec() -> ExperimentSpec {
    ExperimentSpec {
        name: "lab".into(),
        seed: 1,
        repeats: 1,
        script_file: "lab.lua".into(),
        script_text: "-- lab".into(),
        script_hash: [5; 32],
        axes: Vec::new(),
        skips: Vec::new(),
        measure: MeasureSpec {
            every_s: 1e6,
            metrics: Vec::new(),
            snapshots: Snapshots::Last,
            captures: false,
            film_files: false,
            display: Tonemap::Srgb { exposure: 0.0 },
        },
        night: Default::default(),
        aa_check: false,
        figures: Vec::new(),
        tables: Vec::new(),
        report: Default::default(),
    }
}

/// Returns the configuration of a cell unless a test changes it.
pub fn config() -> Settings {
    Settings {
        scene: "box".into(),
        scene_file: "scenes/box.scn".into(),
        max_depth: Some(5),
        resolution: Some([8, 4]),
        backend: "mock".into(),
        ..Settings::new("bpt")
    }
}

/// Returns a sphere of material `egg` for every file name, with one unsupported feature; files
/// called `missing` do not exist.
pub fn load_scene(file: &Path) -> LoadedScene {
    if file.ends_with("missing.scn") {
        return Err(SceneError::Unreadable {
            file: file.to_owned(),
            reason: "no such file".into(),
        });
    }
    let mut egg = MaterialDesc::new("egg");
    egg.roughness = file.to_string_lossy().len() as f32 / 100.0;
    let scene = SceneDesc {
        resolution: [32, 16],
        max_depth: 7,
        camera: CameraDesc {
            position: Vec3::new(0.0, 0.0, 4.0),
            target: Vec3::ZERO,
            up: Vec3::Y,
            optics: Optics::pinhole(40.0),
            focus_distance: None,
            ..CameraDesc::default()
        },
        materials: vec![egg].into(),
        entities: vec![EntityDesc {
            material: Some("egg".into()),
            ..EntityDesc::new("ball", ShapeDesc::Sphere { radius: 1.0 })
        }]
        .into(),
        ..SceneDesc::default()
    };
    let note = Note::new(file, "fog", "left out");
    Ok((scene, vec![note]))
}

/// Returns an experiment with a cell for each depth, so that points render different pictures.
pub fn depths(values: impl IntoIterator<Item = i64>) -> Lab {
    let mut lab = Lab::new().axis("depth", values.into_iter().map(Value::Int));
    lab.render = Box::new(|p| {
        Ok(Settings {
            max_depth: Some(whole_at(p, "depth")),
            ..config()
        })
    });
    lab
}

/// Returns the value of an axis at a point.
pub fn at(point: &Point, axis: &str) -> Value {
    point
        .iter()
        .find(|(name, _)| name == axis)
        .map(|(_, value)| value.clone())
        .unwrap()
}

/// Returns an integer from an axis at a point.
pub fn whole_at(point: &Point, axis: &str) -> u32 {
    u32::try_from(at(point, axis).as_i64().unwrap()).unwrap()
}

/// Returns integers as values.
pub fn ints<const N: usize>(numbers: [i64; N]) -> [Value; N] {
    numbers.map(Value::Int)
}

/// A listener that stores the events it receives, with a short label for each.
#[derive(Default)]
pub struct Recorder {
    /// Whether the listener requests previews of the time bins.
    pub wants_times: bool,
    pub labels: Vec<String>,
    pub events: Vec<Event>,
}

impl Sink for Recorder {
    fn receive(&mut self, event: &Event) -> Result<(), SinkError> {
        // Forecasts have no label, since their times depend on the machine.
        if !matches!(event, Event::Forecast(_)) {
            self.labels.push(label(event));
        }
        self.events.push(event.clone());
        Ok(())
    }

    fn wants_times(&self) -> bool {
        self.wants_times
    }
}

impl Recorder {
    /// Returns the measurements of a cell in the order of their events.
    pub fn rows(&self, wanted: CellRef) -> Vec<&WaveRow> {
        let mut rows = Vec::new();
        for event in &self.events {
            match event {
                Event::Wave { cell, row, .. } if *cell == wanted => rows.push(row),
                _ => {}
            }
        }
        rows
    }

    /// Returns the samples per pixel after each wave of a cell.
    pub fn totals(&self, wanted: CellRef) -> Vec<u64> {
        self.rows(wanted).iter().map(|row| row.samples).collect()
    }

    /// Returns the final sums of a cell, if it ended with any.
    pub fn film(&self, wanted: CellRef) -> Option<Arc<Film>> {
        self.events.iter().find_map(|event| match event {
            Event::CellFinished { cell, film, .. } if *cell == wanted => film.clone(),
            _ => None,
        })
    }

    /// Returns the texts of all messages of a level.
    pub fn messages(&self, wanted: Level) -> Vec<String> {
        let text = |event: &Event| match event {
            Event::Message { level, text, .. } if *level == wanted => Some(text.clone()),
            _ => None,
        };
        self.events.iter().filter_map(text).collect()
    }
}

/// Returns the label of an event: `wave c0 4`, `done r0`.
pub fn label(event: &Event) -> String {
    let name = |cell: &CellRef| match cell {
        CellRef::Cell(i) => format!("c{i}"),
        CellRef::Reference(i) => format!("r{i}"),
    };
    match event {
        Event::NightStarted { .. } => "night started".into(),
        Event::CellStarted { cell, .. } => format!("start {}", name(cell)),
        Event::Wave { cell, row, .. } => format!("wave {} {}", name(cell), row.samples),
        Event::CellFinished { cell, outcome, .. } => {
            let how = match outcome {
                Outcome::Done(_) => "done",
                Outcome::Cached(_) => "cached",
                Outcome::Failed(_) => "failed",
                Outcome::Interrupted => "interrupted",
            };
            format!("{how} {}", name(cell))
        }
        Event::Message { cell, .. } => {
            format!("message {}", cell.as_ref().map(name).unwrap_or_default())
        }
        Event::NoiseFloors { reference, .. } => format!("floors r{reference}"),
        Event::BiasCheck {
            reference,
            compared,
            ..
        } => format!("compared r{reference} r{}", compared.as_ref().unwrap().0),
        Event::Times { cell, .. } => format!("times {}", name(cell)),
        Event::Halves { reference, .. } => format!("halves r{reference}"),
        Event::ShardStarted { shard, .. } => format!("start r{} {}", shard.reference, shard.number),
        Event::ShardFinished {
            shard,
            outcome: Outcome::Done(_),
            ..
        } => {
            format!("done r{} {}", shard.reference, shard.number)
        }
        Event::ShardFinished { shard, .. } => {
            format!("interrupted r{} {}", shard.reference, shard.number)
        }
        Event::Forecast(_) => "forecast".into(),
        Event::NightFinished => "night finished".into(),
        Event::RunActive { .. }
        | Event::ShardActive { .. }
        | Event::Picture { .. }
        | Event::Layer { .. } => unreachable!("only readers of a journal send {event:?}"),
    }
}

/// Returns the outcomes of references, then of cells, that have ended, in the order of the plan.
pub fn outcomes(summary: &NightSummary) -> Vec<&Outcome> {
    let night = &summary.night;
    let outcomes = night.all().filter_map(|cell| night.outcome(cell));
    outcomes.collect()
}

/// Returns whether all references and cells of the plan are done.
pub fn all_done(summary: &NightSummary) -> bool {
    let counts = summary.night.counts();
    counts.done == counts.total()
}

/// Results of earlier nights and of other processes, in memory.
#[derive(Default)]
pub struct Memory {
    pub done: RefCell<BTreeMap<RunId, FinishedRun>>,
    pub images: BTreeMap<RunId, Result<Image, String>>,
    pub halves: BTreeMap<RunId, Result<HalfImages, String>>,
    pub noise: BTreeMap<RunId, Image>,
    /// Number of further claims of cell 0 that find it held by another process, which has finished
    /// it after the last one.
    pub held: Cell<u32>,
    /// Whether checkpoints are kept.
    pub has_checkpoints: bool,
    /// Checkpoints of each run, oldest first.
    pub checkpoints: RefCell<BTreeMap<RunId, Vec<Checkpoint>>>,
    /// Whether writing checkpoints fails.
    pub full: Cell<bool>,
    /// Time that writing a checkpoint takes.
    pub delay: Duration,
}

impl Memory {
    /// Returns an empty memory that keeps checkpoints.
    pub fn with_checkpoints() -> Memory {
        Memory {
            has_checkpoints: true,
            ..Memory::default()
        }
    }
}

/// Returns a run that was finished in this folder, without rows.
pub fn finished_in(folder: &str) -> FinishedRun {
    FinishedRun {
        folder: folder.into(),
        rows: Vec::new(),
        floors: Default::default(),
        open: Default::default(),
    }
}

impl History for Memory {
    fn finished_run(&self, plan: &Plan, cell: CellRef) -> Option<FinishedRun> {
        self.done.borrow().get(plan.id(cell)).cloned()
    }

    fn image(&self, plan: &Plan, reference: usize) -> Result<Option<Image>, SinkError> {
        let image = self.images.get(plan.id(CellRef::Reference(reference)));
        image.cloned().transpose().map_err(SinkError)
    }

    fn noise(&self, plan: &Plan, reference: usize) -> Result<Option<Image>, SinkError> {
        let noise = self.noise.get(plan.id(CellRef::Reference(reference)));
        Ok(noise.cloned())
    }

    fn halves(&self, plan: &Plan, reference: usize) -> Result<Option<HalfImages>, SinkError> {
        let halves = self.halves.get(plan.id(CellRef::Reference(reference)));
        halves.cloned().transpose().map_err(SinkError)
    }

    fn claim(&self, plan: &Plan, unit: WorkUnit) -> Result<Claim, SinkError> {
        let cell = unit.cell();
        if cell != CellRef::Cell(0) || self.held.get() == 0 {
            return Ok(Claim::Granted);
        }
        self.held.set(self.held.get() - 1);
        if self.held.get() == 0 {
            let id = plan.id(cell).clone();
            self.done.borrow_mut().insert(id, finished_in("theirs"));
        }
        Ok(Claim::HeldBy("process 7".to_owned()))
    }

    fn checkpoint(&self, plan: &Plan, unit: WorkUnit) -> Option<Checkpoint> {
        let checkpoints = self.checkpoints.borrow();
        checkpoints.get(plan.id(unit.cell()))?.last().cloned()
    }

    fn save_checkpoint(
        &self,
        plan: &Plan,
        unit: WorkUnit,
        progress: &RunProgress,
        save: SaveState<'_>,
    ) -> Result<bool, SinkError> {
        if !self.has_checkpoints {
            return Ok(false);
        }
        if self.full.get() {
            return Err(SinkError("no space".to_owned()));
        }
        std::thread::sleep(self.delay);
        let mut state = Vec::new();
        let saved = save(&mut state).map_err(|e| SinkError(e.to_string()))?;
        let progress = progress.clone();
        let mut checkpoints = self.checkpoints.borrow_mut();
        let own = checkpoints.entry(plan.id(unit.cell()).clone());
        own.or_default().push(Checkpoint { progress, state });
        Ok(saved)
    }
}

/// A night on the mock backend: its history, its controls, and the functions that open renderers
/// and wait during a pause.
pub struct Night<'a> {
    pub history: Memory,
    pub control: NightControls,
    pub open: Open<'a>,
    pub wait: &'a dyn Fn(),
}

impl Default for Night<'_> {
    fn default() -> Self {
        Night {
            history: Memory::default(),
            control: NightControls::default(),
            open: &|_, scene, job| Ok(Box::new(MockRenderer::new(scene, job))),
            wait: &|| panic!("unexpected pause"),
        }
    }
}

impl Night<'_> {
    /// Renders a plan with the given listeners.
    pub fn render(
        &self,
        lab: &Lab,
        plan: &Arc<Plan>,
        sinks: &mut [&mut dyn Sink],
    ) -> Result<NightSummary, RunError> {
        let seams = Seams {
            open: self.open,
            wait: self.wait,
        };
        run_with(&seams, plan, lab, &self.history, sinks, &self.control, 1)
    }

    /// Plans and renders a night, and returns its summary and its events.
    pub fn record(&self, lab: &Lab) -> (NightSummary, Recorder) {
        let mut recorder = Recorder::default();
        let summary = self
            .render(lab, &Arc::new(lab.plan()), &mut [&mut recorder])
            .unwrap();
        (summary, recorder)
    }
}
