//! Inputs on which a run's id depends, and those on which it does not.

use std::collections::BTreeMap;

use lumbre_light::film::layer::Layer;
use lumbre_light::scene::compile::Sharing;
use lumbre_light::transport::camera::FilterKind;
use lumbre_light::value::Value;
use lumbre_metrics::MetricSpec;
use lumbre_metrics::tonemap::Tonemap;
use lumbre_night::experiment::plan::{Overrides, ReferenceSource};
use lumbre_night::experiment::spec::{
    FigureKind, FigureSpec, FigureX, RunColumn, SheetSpec, Snapshots, TableFormat, TableSpec,
    TableValue,
};
use lumbre_night::experiment::{Plan, StopRule, stop::Comparison};
use lumbre_render::Settings;
use lumbre_render::hierarchy::{Builder, Quality};

use crate::experiment::fixtures::{Lab, at, config, ints, rendered};

/// The inputs of a one-cell experiment, each of which a test may change.
struct Inputs {
    lab: Lab,
    config: Settings,
    stop: StopRule,
    reference_config: Settings,
    reference_stop: StopRule,
}

fn figure() -> FigureSpec {
    let kind = FigureKind::Convergence {
        x: FigureX::Samples,
        y: vec![],
    };
    FigureSpec {
        name: "f".into(),
        kind,
        by: None,
        facet: vec![],
        only: vec![],
    }
}

fn sheet(rows: &[&str]) -> SheetSpec {
    let rows = rows.iter().map(|axis| Value::from(*axis)).collect();
    let options = [("rows".to_owned(), Value::List(rows))];
    SheetSpec::new(options.into()).unwrap()
}

fn over(y: Vec<TableValue>, axis: &str) -> FigureSpec {
    FigureSpec {
        kind: FigureKind::Sweep {
            over: axis.into(),
            y,
        },
        ..figure()
    }
}

impl Inputs {
    fn new() -> Inputs {
        Inputs {
            lab: Lab::new().axis("tag", ["x"]).measured(),
            config: config(),
            stop: StopRule::Samples(16),
            reference_config: config(),
            reference_stop: StopRule::Samples(4096),
        }
    }

    fn plan(self) -> Plan {
        let Inputs {
            mut lab,
            config,
            stop,
            reference_config,
            reference_stop,
        } = self;
        lab.render = Box::new(move |_| Ok(config.clone()));
        lab.stop = Box::new(move |_| Ok(stop.clone()));
        lab.reference = Box::new(move |_| {
            let config = reference_config.clone();
            Ok(Some(rendered(config, reference_stop.clone())))
        });
        lab.plan()
    }
}

type Change = fn(&mut Inputs);

fn ids(change: Change) -> (String, String) {
    let mut inputs = Inputs::new();
    change(&mut inputs);
    let plan = inputs.plan();
    (plan.cells[0].id.0.clone(), plan.references[0].id.0.clone())
}

fn both(inputs: &mut Inputs, change: fn(&mut Settings)) {
    change(&mut inputs.config);
    change(&mut inputs.reference_config);
}

fn rmse_below(hold: u32) -> StopRule {
    StopRule::When {
        column: "rmse".into(),
        op: Comparison::Less,
        value: 0.1,
        hold,
    }
}

#[test]
fn every_field_that_affects_a_picture_or_its_measurements_changes_the_id() {
    let changes: &[(&str, Change)] = &[
        ("nothing", |_| {}),
        ("scene file", |p| {
            p.config.scene_file = "scenes/other_box.scn".into()
        }),
        ("scene change", |p| {
            p.config
                .set
                .insert("materials.egg.roughness".into(), Value::Num(0.5));
        }),
        ("another scene change", |p| {
            p.config
                .set
                .insert("materials.egg.ior".into(), Value::Num(1.25));
        }),
        ("camera", |p| {
            p.config
                .set
                .insert("camera.aperture".into(), Value::Num(0.5));
        }),
        ("integrator's parameters", |p| {
            p.config.params.insert("mis".into(), "balance".into());
        }),
        ("light selection", |p| {
            p.config.params.insert("select".into(), "area".into());
        }),
        ("depth", |p| p.config.max_depth = Some(6)),
        ("depth of the scene", |p| p.config.max_depth = None),
        ("resolution", |p| both(p, |c| c.resolution = Some([4, 8]))),
        ("resolution of the scene", |p| {
            both(p, |c| c.resolution = None)
        }),
        ("roulette", |p| p.config.rr_start = Some(3)),
        ("roulette from the start", |p| p.config.rr_start = Some(0)),
        ("filter", |p| p.config.filter.kind = FilterKind::Gauss),
        ("filter radius", |p| p.config.filter.radius = 0.75),
        ("sampler", |p| p.config.sampler = "sobol".into()),
        ("backend", |p| p.config.backend = "cpu".into()),
        ("layers", |p| {
            // The mock backend has no films.
            (p.config.backend, p.config.films) = ("cpu".into(), vec![Layer::Depth]);
        }),
        ("other layers", |p| {
            (p.config.backend, p.config.films) = ("cpu".into(), vec![Layer::Depth, Layer::Albedo]);
        }),
        ("builder", |p| p.config.accel.builder = Builder::Sah),
        ("bins", |p| {
            (p.config.accel.builder, p.config.accel.bins) = (Builder::Sah, 8)
        }),
        ("build quality", |p| p.config.accel.quality = Quality::Fast),
        ("instances", |p| p.config.accel.instances = Sharing::Always),
        ("seed", |p| p.lab.spec.seed = 2),
        ("stop", |p| p.stop = StopRule::Samples(17)),
        ("stop rule of another kind", |p| {
            p.stop = StopRule::Waves(16)
        }),
        ("stop by metric", |p| p.stop = rmse_below(1)),
        ("stop by metric for two measurements", |p| {
            p.stop = rmse_below(2)
        }),
        ("stop by predicate", |p| p.stop = StopRule::Predicate(0)),
        ("script of the predicate", |p| {
            p.stop = StopRule::Predicate(0);
            p.lab.spec.script_hash = [6; 32];
        }),
        ("point of the predicate", |p| {
            p.stop = StopRule::Predicate(0);
            p.lab.spec.axes[0].steps[0] = vec!["y".into()];
        }),
        ("measuring interval", |p| p.lab.spec.measure.every_s = 0.5),
        ("longer measuring interval", |p| {
            p.lab.spec.measure.every_s = 0.75
        }),
        ("captures", |p| p.lab.spec.measure.captures = true),
        ("film files", |p| p.lab.spec.measure.film_files = true),
        ("fallback of the backend", |p| {
            p.config.fallback = Some("cpu")
        }),
        ("metrics", |p| p.lab.spec.measure.metrics.clear()),
        ("column", |p| {
            p.lab.spec.measure.metrics[0].column = "error".into()
        }),
        ("another metric", |p| {
            let relative = MetricSpec::new("rmse", "relmse", BTreeMap::new()).unwrap();
            p.lab.spec.measure.metrics = vec![relative];
        }),
        ("snapshots", |p| {
            p.lab.spec.measure.snapshots = Snapshots::Pow2
        }),
        ("reference's depth", |p| {
            p.reference_config.max_depth = Some(9)
        }),
        ("reference's filter", |p| {
            p.reference_config.filter.radius = 0.75
        }),
        ("reference's sampler", |p| {
            p.reference_config.sampler = "sobol".into()
        }),
        ("reference's stop", |p| {
            p.reference_stop = StopRule::Samples(8192)
        }),
    ];
    let ids: Vec<(&str, String)> = changes
        .iter()
        .map(|(name, change)| (*name, ids(*change).0))
        .collect();
    for (i, (name, id)) in ids.iter().enumerate() {
        assert_eq!(id.len(), 32);
        assert!(
            id.chars()
                .all(|c| c.is_ascii_digit() || ('a'..='f').contains(&c)),
            "{id}"
        );
        for (other, other_id) in &ids[i + 1..] {
            assert_ne!(id, other_id, "`{name}` and `{other}` have the same id");
        }
    }
}

#[test]
fn names_file_locations_and_display_settings_do_not_change_the_id() {
    let changes: &[(&str, Change)] = &[
        ("bins, which the builder ignores", |p| {
            p.config.accel.bins = 8
        }),
        ("experiment's name", |p| p.lab.spec.name = "other".into()),
        ("axis name", |p| {
            p.lab.spec.axes[0].names = vec!["label".into()]
        }),
        ("axis value that is not used", |p| {
            p.lab.spec.axes[0].steps[0] = vec!["y".into()]
        }),
        ("script's path", |p| {
            p.lab.spec.script_file = "elsewhere/night.lua".into()
        }),
        ("script's text", |p| {
            p.lab.spec.script_text = "-- lab, with a remark".into()
        }),
        ("script's hash without predicates", |p| {
            p.lab.spec.script_hash = [6; 32]
        }),
        ("scene as written", |p| p.config.scene = "./box".into()),
        ("scene file of the same content", |p| {
            p.config.scene_file = "szenen/box.scn".into()
        }),
        ("tone map of the PNG", |p| {
            p.lab.spec.measure.display = Tonemap::Srgb { exposure: 2.0 }
        }),
        ("depth equal to the scene's", |p| {
            p.config.max_depth = Some(5)
        }),
        ("number of repeats", |p| p.lab.spec.repeats = 4),
        ("backend by override", |p| {
            p.config.backend = "auto".into();
            p.reference_config.backend = "auto".into();
            p.lab.overrides.backend = Some("mock".into());
        }),
        ("figures", |p| {
            p.lab.spec.figures.push(figure());
        }),
        ("sheets", |p| p.lab.spec.sheets.push(sheet(&["tag"]))),
    ];
    let unchanged = ids(|_| {});
    for (name, change) in changes {
        assert_eq!(ids(*change), unchanged, "{name}");
    }
}

#[test]
fn a_scene_change_without_effect_does_not_change_the_id() {
    let with = |set: &[(&'static str, f64)]| {
        let mut inputs = Inputs::new();
        inputs.config.set = set
            .iter()
            .map(|(path, x)| ((*path).to_owned(), Value::number(*x)))
            .collect();
        inputs.plan().cells[0].id.clone()
    };
    assert_eq!(with(&[]), with(&[("camera.aperture", 0.0)]));
    assert_ne!(with(&[]), with(&[("camera.aperture", 0.25)]));
}

#[test]
fn the_id_of_a_reference_does_not_depend_on_its_cell() {
    let changes: &[(&str, Change)] = &[
        ("cell's depth", |p| p.config.max_depth = Some(6)),
        ("cell's stop", |p| p.stop = StopRule::Samples(99)),
        ("measuring interval", |p| p.lab.spec.measure.every_s = 0.5),
        ("metrics", |p| p.lab.spec.measure.metrics.clear()),
        ("snapshots", |p| {
            p.lab.spec.measure.snapshots = Snapshots::Pow2
        }),
        ("repeats", |p| p.lab.spec.repeats = 3),
    ];
    let unchanged = ids(|_| {}).1;
    for (name, change) in changes {
        assert_eq!(ids(*change).1, unchanged, "{name}");
    }
    let changes: &[(&str, Change)] = &[
        ("its depth", |p| p.reference_config.max_depth = Some(6)),
        ("its stop", |p| p.reference_stop = StopRule::Samples(99)),
        ("its predicate", |p| {
            p.reference_stop = StopRule::Predicate(0)
        }),
    ];
    for (name, change) in changes {
        assert_ne!(ids(*change).1, unchanged, "{name}");
    }
    // Experiments with other seeds share references.
    assert_eq!(ids(|p| p.lab.spec.seed = 2).1, unchanged);
}

#[test]
fn references_that_differ_only_in_their_stop_rule_have_the_same_stem() {
    let stem = |change: Change| {
        let mut inputs = Inputs::new();
        change(&mut inputs);
        let ReferenceSource::Render { stem, .. } = inputs.plan().references.remove(0).source else {
            panic!("the reference is a file")
        };
        stem
    };
    let unchanged = stem(|_| {});
    assert_eq!(
        stem(|p| p.reference_stop = StopRule::Samples(99)),
        unchanged
    );
    assert_ne!(stem(|p| p.reference_config.max_depth = Some(6)), unchanged);
}

#[test]
fn a_reference_never_has_the_id_or_the_seed_of_its_cell() {
    let mut inputs = Inputs::new();
    inputs.stop = StopRule::Samples(4096);
    let plan = inputs.plan();
    let ReferenceSource::Render { seeds, .. } = &plan.references[0].source else {
        panic!("not rendered")
    };
    assert!(!seeds.contains(&plan.cells[0].seed));
    assert_ne!(plan.cells[0].id, plan.references[0].id);
}

#[test]
fn the_identities_of_repeats_differ_only_in_their_seed() {
    let mut lab = Lab::new();
    lab.spec.repeats = 2;
    let plan = lab.plan();
    let [a, b] = [0, 1].map(|i| plan.cells[i].identity.to_value());
    let [a, b] = [&a, &b].map(|value| value.as_map().unwrap());
    let differing: Vec<&String> = a.keys().filter(|key| a[*key] != b[*key]).collect();
    assert_eq!(differing, ["seed"]);
    assert_ne!(plan.cells[0].id, plan.cells[1].id);
}

#[test]
fn a_cell_without_a_reference_does_not_depend_on_metrics() {
    let mut lab = Lab::new().measured();
    lab.reference = Box::new(|_| Ok(None));
    let with = lab.plan().cells[0].id.clone();
    lab.spec.measure.metrics.clear();
    assert_eq!(lab.plan().cells[0].id, with);
}

#[test]
fn the_hash_of_a_plan_depends_on_its_name_cells_figures_tables_and_sheets() {
    let lab = || {
        let mut lab = Lab::new().axis("depth", ints([3, 5]));
        lab.configure(|p, config| config.max_depth = at(p, "depth").as_i64().map(|d| d as u32));
        lab
    };
    let table = || TableSpec {
        name: "t".into(),
        value: TableValue::Run(RunColumn::Samples),
        rows: vec!["depth".into()],
        cols: vec![],
        formats: vec![TableFormat::Md],
    };
    let changes: &[fn(&mut Lab, TableSpec)] = &[
        |_, _| {},
        |lab, _| lab.spec.name = "other".into(),
        |lab, _| lab.spec.axes[0].steps.reverse(),
        |lab, _| {
            lab.overrides = Overrides {
                only: vec![("depth".into(), Value::Int(3))],
                ..Overrides::default()
            }
        },
        |lab, table| lab.spec.tables = vec![table],
        |lab, table| {
            lab.spec.tables = vec![TableSpec {
                value: TableValue::Run(RunColumn::RenderS),
                ..table
            }]
        },
        |lab, table| {
            lab.spec.tables = vec![TableSpec {
                formats: vec![TableFormat::Csv],
                ..table
            }]
        },
        |lab, _| lab.spec.figures = vec![figure()],
        |lab, _| lab.spec.figures = vec![over(vec![TableValue::Run(RunColumn::Samples)], "depth")],
        |lab, _| lab.spec.figures = vec![over(vec![TableValue::Run(RunColumn::RenderS)], "depth")],
        |lab, _| lab.spec.figures = vec![over(vec![TableValue::Run(RunColumn::RenderS)], "radius")],
        |lab, _| {
            let only = vec![("depth".to_owned(), vec![Value::Int(3)])];
            lab.spec.figures = vec![FigureSpec { only, ..figure() }];
        },
        |lab, _| lab.spec.sheets = vec![sheet(&[])],
        |lab, _| lab.spec.sheets = vec![sheet(&["depth"])],
    ];
    let hashes: std::collections::BTreeSet<String> = changes
        .iter()
        .map(|change| {
            let mut lab = lab();
            change(&mut lab, table());
            lab.plan().hash
        })
        .collect();
    assert_eq!(hashes.len(), changes.len());
    assert_eq!(lab().plan().hash, lab().plan().hash);
}
