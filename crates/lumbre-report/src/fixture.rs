//! Hand-made plans and results for the unit tests of this module.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use glam::Vec3;

use lumbre_light::scene::SceneDesc;
use lumbre_light::scene::desc::{CameraDesc, Optics};
use lumbre_light::value::Value;
use lumbre_metrics::MetricSpec;
use lumbre_metrics::tonemap::Tonemap;
use lumbre_night::experiment::plan::{Cell, CellIdentity, Plan, RunId};
use lumbre_night::experiment::spec::{MeasureSpec, Snapshots};
use lumbre_night::experiment::{CellRef, EndCause, Event, Night, Outcome, StopRule, WaveRow};
use lumbre_render::OpenStats;
use lumbre_render::Settings;

/// Name of an axis and its values.
pub type AxisValues<'a> = (&'a str, Vec<Value>);

/// Builds a plan with every combination of the axes' values and `repeats` repeats, measured by
/// `rmse`, `ssim` and `psnr`. The axis `technique`, if there is one, selects the integrator.
pub fn plan(axes: &[AxisValues], repeats: u32) -> Plan {
    let mut points = vec![Vec::new()];
    for (name, values) in axes {
        points = points
            .iter()
            .flat_map(|p: &Vec<(String, Value)>| {
                values
                    .iter()
                    .map(|v| [p.as_slice(), &[((*name).to_owned(), v.clone())]].concat())
            })
            .collect();
    }
    let cells = points
        .iter()
        .flat_map(|point| (0..repeats).map(move |repeat| (point, repeat)));
    let cells = cells
        .enumerate()
        .map(|(i, (point, repeat))| cell(i, point.clone(), repeat))
        .collect();
    Plan {
        commands: Vec::new(),
        commands_allowed: false,
        name: "night".to_owned(),
        hash: "3f9a5b".to_owned(),
        seed: 1,
        settings: Vec::new(),
        axes: axes.iter().map(|(name, _)| (*name).to_owned()).collect(),
        cells,
        references: Vec::new(),
        skipped: Vec::new(),
        notes: Vec::new(),
        warnings: Vec::new(),
        measure: MeasureSpec {
            every_s: 0.5,
            metrics: ["rmse", "ssim", "psnr"]
                .map(|m| MetricSpec::new(m, m, BTreeMap::new()).unwrap())
                .to_vec(),
            snapshots: Snapshots::Last,
            captures: false,
            film_files: false,
            display: Tonemap::Srgb { exposure: 0.0 },
        },
        night: Default::default(),
        figures: Vec::new(),
        tables: Vec::new(),
        report: Default::default(),
        script_text: String::new(),
        files: Default::default(),
    }
}

fn cell(index: usize, point: Vec<(String, Value)>, repeat: u32) -> Cell {
    let technique = point
        .iter()
        .find(|(axis, _)| axis == "technique")
        .and_then(|(_, v)| v.as_str());
    let integrator = technique.unwrap_or("bpt").to_owned();
    let path: Vec<String> = point
        .iter()
        .map(|(axis, v)| format!("{axis}={v}"))
        .collect();
    let camera = CameraDesc {
        position: Vec3::ZERO,
        target: Vec3::Z,
        optics: Optics::pinhole(60.0),
        ..CameraDesc::default()
    };
    Cell {
        id: RunId(format!("run{index:02}")),
        first: index,
        path: format!("{}/rep={repeat}", path.join("/")),
        point,
        repeat,
        double_of: None,
        seed: 100 + index as u64,
        config: Arc::new(Settings {
            scene: "box".to_owned(),
            scene_file: PathBuf::from("scenes/box.scn"),
            max_depth: Some(5),
            resolution: Some([64, 36]),
            backend: "mock".to_owned(),
            ..Settings::new(&integrator)
        }),
        scene: Arc::new(SceneDesc {
            resolution: [64, 36],
            max_depth: 5,
            camera,
            ..SceneDesc::default()
        }),
        stop: StopRule::Samples(64),
        reference: None,
        identity: CellIdentity::default(),
    }
}

/// Builds the end of a finished cell from pairs of render time and RMSE of its waves.
pub fn done(cell: usize, waves: &[(f64, f64)]) -> Event {
    let outcome = Outcome::Done(EndCause::limit("64 samples"));
    measured(cell, outcome, waves)
}

/// Builds the end of a cell with the given outcome from pairs of render time and RMSE of its waves.
/// SSIM and PSNR are derived from the RMSE by made-up formulas.
pub fn measured(cell: usize, outcome: Outcome, waves: &[(f64, f64)]) -> Event {
    let rows = waves
        .iter()
        .enumerate()
        .map(|(i, (render_s, rmse))| WaveRow {
            wave: i as u64 + 1,
            samples: 1 << i,
            render_s: *render_s,
            lost_s: 0.0,
            wall_s: render_s * 1.5,
            measure_s: render_s * 0.1,
            paths: 2_000_000 << i,
            rays: 8_000_000 << i,
            invalid: 0,
            first_invalid: None,
            metrics: vec![*rmse, 1.0 - rmse / 2.0, 40.0 - 40.0 * rmse],
        });
    let mut event = Event::ended(CellRef::Cell(cell), outcome, rows.collect());
    if let Event::CellFinished { open, .. } = &mut event {
        *open = Some(OpenStats {
            accel_build_s: 0.25,
            accel_nodes: 100,
            accel_bytes: 3 << 20,
            accel_cost: 12.5,
            ..OpenStats::default()
        });
    }
    event
}

/// Builds the end of a cell with the given outcome and without measurements.
pub fn ended(cell: usize, outcome: Outcome) -> Event {
    Event::ended(CellRef::Cell(cell), outcome, Vec::new())
}

/// Builds the night of a plan after these events.
pub fn night(plan: &Plan, events: &[Event]) -> Night {
    let mut night = Night::planned(plan);
    events.iter().for_each(|event| night.apply(event));
    night
}

/// Converts strings to axis values.
pub fn texts(words: &[&str]) -> Vec<Value> {
    words.iter().map(|w| Value::from(*w)).collect()
}

/// Converts numbers to axis values.
pub fn numbers(numbers: &[f64]) -> Vec<Value> {
    numbers.iter().map(|x| Value::number(*x)).collect()
}
