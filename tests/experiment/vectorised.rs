//! Vectorised runs: all of a night on the CPU or none, unless its script decides.

use std::collections::BTreeMap;

use lumbre::experiment::Plan;
use lumbre::experiment::plan::ReferenceSource;
use lumbre::experiment::spec::CellConfig;
use lumbre::film::layer::Layer;
use lumbre::render::hierarchy::{AccelSpec, LaneMode};
use lumbre::value::Value;

use crate::fixtures::{Lab, at, config};

/// Returns a night over the axis `way`, on the CPU, whose runs `change` makes different.
fn lab(change: fn(&mut CellConfig, &str)) -> Lab {
    let mut lab = Lab::new().axis("way", ["plain", "special", "other"]);
    lab.render = Box::new(move |point| {
        let mut config = CellConfig {
            backend: "cpu".into(),
            integrator: "nee".into(),
            ..config()
        };
        change(&mut config, at(point, "way").as_str().unwrap());
        Ok(config)
    });
    lab
}

fn lanes(plan: &Plan) -> Vec<LaneMode> {
    plan.cells
        .iter()
        .map(|cell| cell.config.accel.lanes)
        .collect()
}

fn warned(plan: &Plan) -> Option<&String> {
    plan.warnings
        .iter()
        .find(|warning| warning.contains("use the scalar path"))
}

/// A change that prevents vectorised runs, and the text of the reason.
type Keeps = (fn(&mut CellConfig, &str), &'static str);

const KEEPS: [Keeps; 3] = [
    (
        |config, way| {
            if way == "special" {
                config.sampler = "sobol".into()
            }
        },
        "with the sampler `sobol`",
    ),
    (
        |config, way| {
            if way == "special" {
                config.films = vec![Layer::Depth]
            }
        },
        "with `films`",
    ),
    (
        |config, way| {
            if way == "special" {
                config.params = BTreeMap::from([("lights".to_owned(), Value::from("all"))]);
            }
        },
        "with `lights = \"all\"`",
    ),
];

#[test]
fn a_night_all_of_whose_runs_can_leaves_it_to_the_scenes() {
    let plan = lab(|config, way| config.rr_start = (way == "special").then_some(2)).plan();
    assert_eq!(lanes(&plan), [LaneMode::Auto; 3]);
    assert_eq!(warned(&plan), None);
}

#[test]
fn one_run_that_cannot_keeps_all_of_a_night_from_lanes_whatever_is_selected() {
    for (change, words) in KEEPS {
        let plan = lab(change).plan();
        assert_eq!(lanes(&plan), [LaneMode::Never; 3], "{words}");
        assert!(
            warned(&plan).is_some_and(|warning| warning.contains(words)),
            "{:?}",
            plan.warnings
        );

        let mut part = lab(change);
        part.overrides.only = vec![("way".to_owned(), "plain".into())];
        let part = part.plan();
        assert_eq!(
            (part.cells.len(), &part.cells[0].id),
            (1, &plan.cells[0].id),
            "{words}"
        );
        assert!(
            warned(&part).is_some_and(|warning| warning.contains(words)),
            "{:?}",
            part.warnings
        );

        // A run outside the night does not affect its choice.
        let mut without = lab(change);
        without.spec.skips = vec!["special".into()];
        without.skip = Box::new(|_, point| Ok(at(point, "way").as_str() == Some("special")));
        assert_eq!(lanes(&without.plan()), [LaneMode::Auto; 2], "{words}");
    }
}

#[test]
fn no_run_is_warned_about_where_none_could() {
    let plan = lab(|config, _| config.sampler = "sobol".into()).plan();
    assert_eq!(
        (lanes(&plan), warned(&plan)),
        (vec![LaneMode::Never; 3], None)
    );
}

#[test]
fn what_a_script_says_for_itself_is_done_and_counts_for_nobody_else() {
    let change: fn(&mut CellConfig, &str) = |config, way| {
        let lanes = if way == "plain" {
            LaneMode::Auto
        } else {
            LaneMode::Always
        };
        let sampler = if way == "special" {
            "sobol"
        } else {
            "independent"
        };
        config.accel = AccelSpec {
            lanes,
            ..config.accel
        };
        config.sampler = sampler.into();
    };
    assert_eq!(
        lanes(&lab(change).plan()),
        [LaneMode::Auto, LaneMode::Always, LaneMode::Always]
    );
}

#[test]
fn backends_without_lanes_say_nothing_of_them_and_keep_nobody_from_them() {
    let change: fn(&mut CellConfig, &str) = |config, way| {
        if way == "special" {
            (config.backend, config.films) = ("mock".into(), vec![]);
            config.sampler = "sobol".into();
        }
    };
    assert_eq!(
        lanes(&lab(change).plan()),
        [LaneMode::Auto, LaneMode::Never, LaneMode::Auto]
    );
}

#[test]
fn lanes_are_part_of_what_a_cell_is_and_not_of_what_a_reference_is() {
    let ids = |lanes: LaneMode| {
        let mut lab = Lab::new().axis("tag", ["x"]);
        lab.render = Box::new(move |_| {
            let accel = AccelSpec {
                lanes,
                ..AccelSpec::default()
            };
            Ok(CellConfig {
                backend: "cpu".into(),
                integrator: "nee".into(),
                accel,
                ..config()
            })
        });
        let plan = lab.measured().plan();
        let ReferenceSource::Render { config, .. } = &plan.references[0].source else {
            panic!("not rendered")
        };
        assert_eq!(config.accel.lanes, LaneMode::Never);
        (plan.cells[0].id.clone(), plan.references[0].id.clone())
    };
    let (auto, never, always) = (
        ids(LaneMode::Auto),
        ids(LaneMode::Never),
        ids(LaneMode::Always),
    );
    assert!(auto.0 != never.0 && auto.0 != always.0 && never.0 != always.0);
    assert!(auto.1 == never.1 && auto.1 == always.1);
}
