//! A small experiment without a script: its parts are plain closures that a test replaces one by one.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::Vec3;
use lumbre::experiment::plan::{LoadedScene, expand};
use lumbre::experiment::spec::{Axis, CellConfig, HookError, Measure, ReferenceRequest, Snapshots};
use lumbre::experiment::{Overrides, Plan, PlanError, Point, ScriptHooks, Spec, StopRule, WaveRow};
use lumbre::metrics::MetricSpec;
use lumbre::metrics::tonemap::Tonemap;
use lumbre::scene::desc::{CameraDesc, EntityDesc, MaterialDesc, ShapeDesc, Transform};
use lumbre::scene::{Note, SceneDesc, SceneError};
use lumbre::transport::camera::{FilterKind, FilterSpec};
use lumbre::value::Value;

pub type Hook<T> = Box<dyn Fn(&Point) -> Result<T, HookError>>;
pub type PredicateHook = Box<dyn Fn(usize, &[String], &[WaveRow]) -> Result<bool, HookError>>;

/// An experiment whose every part can be exchanged.
pub struct Lab {
    pub spec: Spec,
    pub overrides: Overrides,
    pub skip: Box<dyn Fn(usize, &Point) -> Result<bool, HookError>>,
    pub render: Hook<CellConfig>,
    pub reference: Hook<Option<ReferenceRequest>>,
    pub stop: Hook<StopRule>,
    pub predicate: PredicateHook,
    /// Files asked for, in order.
    pub loads: RefCell<Vec<PathBuf>>,
}

impl ScriptHooks for Lab {
    fn skip(&self, rule: usize, point: &Point) -> Result<bool, HookError> {
        (self.skip)(rule, point)
    }

    fn render(&self, point: &Point) -> Result<CellConfig, HookError> {
        (self.render)(point)
    }

    fn reference(&self, point: &Point) -> Result<Option<ReferenceRequest>, HookError> {
        (self.reference)(point)
    }

    fn stop(&self, point: &Point) -> Result<StopRule, HookError> {
        (self.stop)(point)
    }

    fn predicate(&self, id: usize, columns: &[String], rows: &[WaveRow]) -> Result<bool, HookError> {
        (self.predicate)(id, columns, rows)
    }
}

impl Lab {
    /// No axes, one repeat, 8x4 pixels on the mock, 16 samples per cell, no metrics and no reference.
    pub fn new() -> Lab {
        Lab {
            spec: spec(),
            overrides: Overrides::default(),
            skip: Box::new(|_, _| Ok(false)),
            render: Box::new(|_| Ok(config())),
            reference: Box::new(|_| Ok(None)),
            stop: Box::new(|_| Ok(StopRule::Samples(16))),
            predicate: Box::new(|id, _, _| Err(HookError(format!("nobody wrote predicate {id}").into()))),
            loads: RefCell::default(),
        }
    }

    /// Adds an axis.
    pub fn axis(mut self, name: &str, values: impl IntoIterator<Item = impl Into<Value>>) -> Lab {
        let steps = values.into_iter().map(|v| vec![v.into()]).collect();
        self.spec.axes.push(Axis { names: vec![name.to_owned()], steps });
        self
    }

    /// Adds axes that move together.
    pub fn zip<const N: usize>(mut self, names: [&str; N], steps: &[[Value; N]]) -> Lab {
        let steps = steps.iter().map(|step| step.to_vec()).collect();
        self.spec.axes.push(Axis { names: names.map(str::to_owned).to_vec(), steps });
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
            Ok(Some(ReferenceRequest::Render { config: Box::new(again(p)?), stop: StopRule::Samples(4096) }))
        });
        self
    }

    /// The plan, or why there is none.
    pub fn try_plan(&self) -> Result<Plan, PlanError> {
        let mut load = |file: &Path| {
            self.loads.borrow_mut().push(file.to_owned());
            load_scene(file)
        };
        expand(&self.spec, self, &self.overrides, &mut load)
    }

    /// The plan.
    pub fn plan(&self) -> Plan {
        self.try_plan().unwrap()
    }
}

fn spec() -> Spec {
    Spec {
        name: "lab".into(),
        seed: 1,
        repeats: 1,
        script_file: "lab.lua".into(),
        script_text: "-- lab".into(),
        script_hash: [5; 32],
        axes: Vec::new(),
        skips: Vec::new(),
        measure: Measure {
            every_s: 1e6,
            metrics: Vec::new(),
            snapshots: Snapshots::Last,
            display: Tonemap::Srgb { exposure: 0.0 },
        },
        figures: Vec::new(),
        tables: Vec::new(),
    }
}

/// What a cell renders unless a test says otherwise.
pub fn config() -> CellConfig {
    CellConfig {
        scene: "box".into(),
        scene_file: "scenes/box.scn".into(),
        integrator: "bpt".into(),
        params: BTreeMap::new(),
        max_depth: Some(5),
        resolution: Some([8, 4]),
        rr_start: None,
        filter: FilterSpec { kind: FilterKind::Box, radius: 0.5 },
        set: BTreeMap::new(),
        backend: "mock".into(),
    }
}

/// A sphere of material `egg` for every file name; files called `missing` are, and every file has one thing that
/// cannot be honoured.
pub fn load_scene(file: &Path) -> LoadedScene {
    if file.ends_with("missing.scn") {
        return Err(SceneError::Unreadable { file: file.to_owned(), reason: "no such file".into() });
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
            fov_deg: 40.0,
            aperture: 0.0,
            focus_distance: None,
        },
        materials: vec![egg],
        entities: vec![EntityDesc {
            name: "ball".into(),
            transform: Transform::default(),
            material: Some("egg".into()),
            shape: ShapeDesc::Sphere { radius: 1.0 },
        }],
    };
    let note = Note { file: file.to_owned(), place: "fog".into(), message: "left out".into() };
    Ok((scene, vec![note]))
}

/// The value of an axis at a point.
pub fn at(point: &Point, axis: &str) -> Value {
    point.iter().find(|(name, _)| name == axis).map(|(_, value)| value.clone()).unwrap()
}

/// A whole number from an axis at a point.
pub fn whole_at(point: &Point, axis: &str) -> u32 {
    u32::try_from(at(point, axis).as_i64().unwrap()).unwrap()
}

/// Integers as values.
pub fn ints<const N: usize>(numbers: [i64; N]) -> [Value; N] {
    numbers.map(Value::Int)
}
