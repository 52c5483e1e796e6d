//! The choice of the vectorised integrators: no run depends on the others of its night.

use std::collections::BTreeMap;

use lumbre_light::film::layer::Layer;
use lumbre_light::value::Value;
use lumbre_night::experiment::plan::ReferenceSource;
use lumbre_night::experiment::{Plan, RunId};
use lumbre_render::Settings;
use lumbre_render::hierarchy::{AccelSpec, LaneMode};

use crate::experiment::fixtures::{Lab, at, config};

/// Edits the configuration of a variant.
type Change = fn(&mut Settings, &str);

/// Returns an experiment on the CPU over the axis `variant`; `change` edits the configuration of
/// each variant.
fn lab(change: Change) -> Lab {
    let mut lab = Lab::new().axis("variant", ["plain", "special", "other"]);
    lab.render = Box::new(move |point| {
        let mut config = Settings {
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

/// Returns the identities of the first and the last cell.
fn outer_ids(plan: &Plan) -> [RunId; 2] {
    [&plan.cells[0], plan.cells.last().unwrap()].map(|cell| cell.id.clone())
}

/// Changes of the variant `special` that once ruled out vectors.
const CHANGES: [Change; 3] = [
    |config, variant| {
        if variant == "special" {
            config.integrator = "bdpt".into();
            config.sampler = "sobol".into();
        }
    },
    |config, variant| {
        if variant == "special" {
            config.integrator = "bdpt".into();
            config.films = vec![Layer::Depth];
        }
    },
    |config, variant| {
        if variant == "special" {
            config.params = BTreeMap::from([("lights".to_owned(), Value::from("all"))]);
        }
    },
];

#[test]
fn runs_have_the_lane_mode_auto_and_do_not_depend_on_each_other() {
    for change in CHANGES {
        let plan = lab(change).plan();
        assert_eq!(lanes(&plan), [LaneMode::Auto; 3]);
        let warns = |warning: &String| warning.contains("with vectors");
        assert!(!plan.warnings.iter().any(warns), "{:?}", plan.warnings);
        let mut without = lab(change);
        without.spec.skips = vec!["special".into()];
        without.skip = Box::new(|_, point| Ok(at(point, "variant").as_str() == Some("special")));
        assert_eq!(outer_ids(&without.plan()), outer_ids(&plan));
    }
}

#[test]
fn a_lane_mode_of_the_script_is_kept_and_does_not_affect_other_runs() {
    let change: Change = |config, variant| {
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
    let change: Change = |config, variant| {
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
            Ok(Settings {
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
