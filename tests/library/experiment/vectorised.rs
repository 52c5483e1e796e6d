//! The choice of the vectorised integrators: no run depends on the others of its night, and a
//! mixture is reported.

use std::collections::BTreeMap;

use lumbre::experiment::Plan;
use lumbre::experiment::plan::ReferenceSource;
use lumbre::experiment::spec::CellConfig;
use lumbre_light::film::layer::Layer;
use lumbre_light::value::Value;
use lumbre_render::hierarchy::{AccelSpec, LaneMode};

use crate::experiment::fixtures::{Lab, at, config};

/// Returns an experiment on the CPU over the axis `variant`; `change` edits the configuration of
/// each variant.
fn lab(change: fn(&mut CellConfig, &str)) -> Lab {
    let mut lab = Lab::new().axis("variant", ["plain", "special", "other"]);
    lab.render = Box::new(move |point| {
        let mut config = CellConfig {
            backend: "cpu".into(),
            integrator: "nee".into(),
            ..config()
        };
        change(&mut config, at(point, "variant").as_str().unwrap());
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
        .find(|warning| warning.contains("follow one path at a time"))
}

/// A change that prevents vectorised runs, and the reason in the warning.
type ScalarCause = (fn(&mut CellConfig, &str), &'static str);

const SCALAR_CAUSES: [ScalarCause; 3] = [
    (
        |config, variant| {
            if variant == "special" {
                config.integrator = "bdpt".into();
                config.sampler = "sobol".into();
            }
        },
        "with the sampler `sobol`",
    ),
    (
        |config, variant| {
            if variant == "special" {
                config.integrator = "bdpt".into();
                config.films = vec![Layer::Depth];
            }
        },
        "with `films`",
    ),
    (
        |config, variant| {
            if variant == "special" {
                config.integrator = "bdpt".into();
                config.params = BTreeMap::from([("lights".to_owned(), Value::from("all"))]);
            }
        },
        "with `lights = \"all\"`",
    ),
];

#[test]
fn a_night_of_vectorisable_runs_has_the_lane_mode_auto() {
    let plan = lab(|config, variant| config.rr_start = (variant == "special").then_some(2)).plan();
    assert_eq!(lanes(&plan), [LaneMode::Auto; 3]);
    assert_eq!(warned(&plan), None);
}

#[test]
fn a_mixture_is_reported_and_changes_no_run() {
    for (change, reason) in SCALAR_CAUSES {
        let plan = lab(change).plan();
        assert_eq!(lanes(&plan), [LaneMode::Auto; 3], "{reason}");
        assert!(
            warned(&plan).is_some_and(|warning| warning.contains(reason)),
            "{:?}",
            plan.warnings
        );
        let mut without = lab(change);
        without.spec.skips = vec!["special".into()];
        without.skip = Box::new(|_, point| Ok(at(point, "variant").as_str() == Some("special")));
        let without = without.plan();
        assert_eq!(warned(&without), None, "{reason}");
        let ids = |plan: &Plan| [&plan.cells[0], plan.cells.last().unwrap()].map(|c| c.id.clone());
        assert_eq!(ids(&without), ids(&plan), "{reason}");
    }
}

#[test]
fn a_night_without_vectorisable_runs_causes_no_warning() {
    let plan = lab(|config, _| {
        config.integrator = "bdpt".into();
        config.sampler = "sobol".into();
    })
    .plan();
    assert_eq!(
        (lanes(&plan), warned(&plan)),
        (vec![LaneMode::Auto; 3], None)
    );
}

#[test]
fn a_lane_mode_of_the_script_is_kept_and_does_not_affect_other_runs() {
    let change: fn(&mut CellConfig, &str) = |config, variant| {
        let lanes = if variant == "plain" {
            LaneMode::Auto
        } else {
            LaneMode::Always
        };
        let sampler = if variant == "special" {
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
fn runs_on_backends_without_lanes_do_not_affect_other_runs() {
    let change: fn(&mut CellConfig, &str) = |config, variant| {
        if variant == "special" {
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
fn the_lane_mode_is_part_of_the_id_of_a_cell_but_not_of_a_reference() {
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
