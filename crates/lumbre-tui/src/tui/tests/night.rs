//! A synthetic night: four cells over two axes, one reference, and a picture with noise.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use glam::Vec3;

use crate::tui::model::night::NightModel;
use lumbre_light::film::{Image, SharedImage};
use lumbre_light::scene::SceneDesc;
use lumbre_light::scene::desc::{CameraDesc, Optics};
use lumbre_light::transport::camera::{FilterKind, FilterSpec};
use lumbre_light::value::Value;
use lumbre_metrics::MetricSpec;
use lumbre_metrics::tonemap::Tonemap;
use lumbre_night::experiment::outcome::Level;
use lumbre_night::experiment::plan::{CellIdentity, Reference, ReferenceSource, Skipped};
use lumbre_night::experiment::spec::{MeasureSpec, Snapshots};
use lumbre_night::experiment::stop::Comparison;
use lumbre_night::experiment::{
    Cell, CellRef, EndCause, Event, Night, Outcome, Plan, RunId, StopRule, WaveRow,
};
use lumbre_render::Settings;
use lumbre_render::{Device, OpenStats};

fn scene() -> SceneDesc {
    SceneDesc {
        resolution: [512, 512],
        max_depth: 5,
        camera: CameraDesc {
            position: Vec3::Z,
            target: Vec3::ZERO,
            optics: Optics::pinhole(40.0),
            ..CameraDesc::default()
        },
        ..SceneDesc::default()
    }
}

fn config(depth: u32, radius: f32) -> Settings {
    Settings {
        scene: "scenes/cornell.scn".to_owned(),
        scene_file: PathBuf::from("scenes/cornell.scn"),
        max_depth: Some(depth),
        resolution: Some([512, 512]),
        rr_start: Some(3),
        filter: FilterSpec {
            kind: FilterKind::Gauss,
            radius,
        },
        set: BTreeMap::from([("materials.egg.ior".to_owned(), Value::Num(1.5))]),
        backend: "cpu".to_owned(),
        ..Settings::new("bpt")
    }
}

/// Plans cells over `depths` x `radii`, measured by RMSE, SSIM and PSNR.
pub fn plan_over(depths: &[u32], radii: &[f32]) -> Plan {
    let stop = StopRule::Any(vec![
        StopRule::Samples(1024),
        StopRule::When {
            column: "rmse".to_owned(),
            op: Comparison::Less,
            value: 0.01,
            hold: 1,
        },
        StopRule::Nan(1000),
    ]);
    let scene = Arc::new(scene());
    let mut cells = Vec::new();
    for depth in depths {
        for radius in radii {
            cells.push(Cell {
                id: RunId(format!("{:032x}", cells.len())),
                first: cells.len(),
                point: vec![
                    ("depth".to_owned(), Value::Int(i64::from(*depth))),
                    ("aa".to_owned(), Value::number(f64::from(*radius))),
                ],
                repeat: 0,
                double_of: None,
                seed: 1,
                config: Arc::new(config(*depth, *radius)),
                scene: scene.clone(),
                stop: stop.clone(),
                reference: Some(0),
                path: format!("depth={depth}/aa={radius}"),
                identity: CellIdentity::default(),
            });
        }
    }
    let metric = |name: &str| MetricSpec::new(name, name, BTreeMap::new()).unwrap();
    let display = Value::Map(BTreeMap::from([("kind".to_owned(), "srgb".into())]));
    let ssim = BTreeMap::from([
        ("on".to_owned(), display),
        ("range".to_owned(), Value::Int(1)),
    ]);
    Plan {
        commands: Vec::new(),
        commands_allowed: false,
        name: "first_light".to_owned(),
        hash: "3f9a2b1c00".to_owned(),
        seed: 1,
        settings: Vec::new(),
        axes: vec!["depth".to_owned(), "aa".to_owned()],
        cells,
        references: vec![Reference {
            id: RunId("ff".to_owned()),
            source: ReferenceSource::Render {
                config: Arc::new(config(9, 0.5)),
                scene,
                seeds: [2, 3],
                stem: RunId("fe".to_owned()),
                stop: StopRule::Time(20.0),
                shard_samples: None,
            },
            identity: Value::Nil,
            bias_check: None,
        }],
        skipped: vec![Skipped {
            point: Vec::new(),
            reason: "black".to_owned(),
            absent: false,
        }],
        notes: Vec::new(),
        warnings: Vec::new(),
        measure: MeasureSpec {
            every_s: 0.5,
            metrics: vec![
                metric("rmse"),
                MetricSpec::new("ssim", "ssim", ssim).unwrap(),
                metric("psnr"),
            ],
            snapshots: Snapshots::Pow2,
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

/// Returns the default plan: two depths and two radii.
pub fn plan() -> Arc<Plan> {
    Arc::new(plan_over(&[3, 5], &[0.5, 1.0]))
}

/// Draws a box with coloured walls, a light and a ball, with the noise of `samples` samples.
pub fn picture(samples: u64) -> SharedImage {
    let n = 64;
    let noise = 0.6 / (samples as f32).sqrt();
    let mut state = 0x9e37_79b9u32;
    Arc::new(Image::from_fn(n, n, |x, y| {
        let (u, v) = (x as f32 / n as f32, y as f32 / n as f32);
        let ball = (u - 0.6).powi(2) + (v - 0.7).powi(2) < 0.03;
        let base = if (0.35..0.65).contains(&u) && v < 0.08 {
            [4.0, 3.2, 2.2]
        } else if ball {
            [0.7, 0.65, 0.2]
        } else if u < 0.18 {
            [0.5, 0.06, 0.04]
        } else if u > 0.82 {
            [0.08, 0.4, 0.07]
        } else if v > 0.82 {
            [0.4, 0.36, 0.3]
        } else {
            [0.25, 0.23, 0.2]
        };
        base.map(|b: f32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (b + noise * ((state >> 8) as f32 / (1 << 24) as f32 - 0.5)).max(0.0)
        })
    }))
}

/// Returns the measurement of a run after `2^k` samples.
pub fn row(k: u32) -> WaveRow {
    let samples = 1u64 << k;
    let render_s = samples as f64 * 0.0625;
    let paths = samples * 512 * 512;
    let rmse = 0.31 / (samples as f64).sqrt() * (1.0 + 0.05 * f64::from(k % 3));
    WaveRow {
        wave: u64::from(k) + 1,
        samples,
        render_s,
        lost_s: 0.0,
        wall_s: render_s * 1.05 + 0.1,
        measure_s: render_s * 0.02,
        paths,
        rays: paths * 5,
        invalid: 0,
        first_invalid: None,
        metrics: vec![rmse, 1.0 - rmse, -20.0 * rmse.log10()],
    }
}

/// Builds the events of a night, with a clock that follows the measurements.
pub struct NightBuilder {
    /// Events and their times in seconds.
    pub events: Vec<(Event, f64)>,
    clock_s: f64,
}

impl NightBuilder {
    /// Begins a night of `plan`.
    pub fn new(plan: Arc<Plan>) -> NightBuilder {
        let night = Arc::new(Night::planned(&plan));
        NightBuilder {
            events: vec![(Event::NightStarted { night }, 0.2)],
            clock_s: 0.2,
        }
    }

    /// Adds a message.
    pub fn message(
        &mut self,
        level: Level,
        cell: Option<CellRef>,
        text: &str,
    ) -> &mut NightBuilder {
        self.events.push((
            Event::Message {
                level,
                cell,
                text: text.to_owned(),
            },
            self.clock_s,
        ));
        self
    }

    /// Opens a cell and renders `2^0` to `2^last` samples.
    pub fn render(&mut self, cell: CellRef, last: u32) -> &mut NightBuilder {
        let open = OpenStats {
            accel_build_s: 0.0021,
            accel_nodes: 1234,
            devices: vec![Device::from_line("cpu, 2 threads, PLOC BVH")],
            ..OpenStats::default()
        };
        let reference = matches!(cell, CellRef::Cell(_)).then(|| picture(1 << 20));
        let start = self.clock_s;
        self.events.push((
            Event::CellStarted {
                cell,
                open,
                reference: reference.clone(),
                resumed: None,
                settings: None,
            },
            start,
        ));
        for k in 0..=last {
            let mut row = row(k);
            if reference.is_none() {
                row.metrics.clear();
            }
            self.clock_s = start + row.wall_s;
            let image = picture(row.samples);
            let wave = Event::Wave {
                cell,
                row,
                measure_s: 0.001,
                image: Some(image),
                noise: None,
                pow2: true,
            };
            self.events.push((wave, self.clock_s));
        }
        self
    }

    /// Ends a cell after `2^last` samples, if it rendered any.
    pub fn finish(
        &mut self,
        cell: CellRef,
        last: Option<u32>,
        outcome: Outcome,
    ) -> &mut NightBuilder {
        let mut rows: Vec<WaveRow> =
            last.map_or_else(Vec::new, |last| (0..=last).map(row).collect());
        if matches!(cell, CellRef::Reference(_)) {
            rows.iter_mut().for_each(|row| row.metrics.clear());
        }
        let event = Event::ended(cell, outcome, rows);
        self.events.push((event, self.clock_s));
        self
    }

    /// Ends the night.
    pub fn end(&mut self) -> &mut NightBuilder {
        self.events.push((Event::NightFinished, self.clock_s));
        self
    }

    /// Returns the model after all events, and the time of the last one.
    pub fn model(&self) -> (NightModel, f64) {
        let mut model = NightModel::default();
        for (event, at_s) in &self.events {
            model.receive(event, *at_s);
        }
        (model, self.clock_s)
    }
}

/// Returns a night whose reference and first cell are done, the second is cached, the third runs.
pub fn in_the_middle() -> NightBuilder {
    let mut night = NightBuilder::new(plan());
    night
        .message(
            Level::Warn,
            None,
            "cornell.scn: materials[2].displacementtexture: not supported, the surface stays flat",
        )
        .render(CellRef::Reference(0), 8)
        .finish(
            CellRef::Reference(0),
            Some(8),
            Outcome::Done(EndCause::limit("20 s of render time")),
        )
        .render(CellRef::Cell(0), 9)
        .finish(
            CellRef::Cell(0),
            Some(9),
            Outcome::Done(EndCause::other("rmse < 0.01")),
        )
        .finish(
            CellRef::Cell(1),
            Some(10),
            Outcome::Cached(PathBuf::from("out/first_light-3f9a/runs/b")),
        )
        .message(Level::Info, Some(CellRef::Cell(2)), "opened in 0.02 s")
        .render(CellRef::Cell(2), 7);
    night
}
