//! Cells of a sweep, their order, and the runs they share.

use std::sync::Arc;

use lumbre_light::value::Value;
use lumbre_night::experiment::plan::{Estimate, ReferenceSource};
use lumbre_night::experiment::spec::ReferenceRequest;
use lumbre_night::experiment::{CellRef, Plan, StopRule};

use crate::experiment::fixtures::{Lab, at, config, depths, ints, whole_at};

fn paths(plan: &Plan) -> Vec<&str> {
    plan.cells.iter().map(|cell| cell.path.as_str()).collect()
}

#[test]
fn axes_vary_slowest_first_and_repeats_fastest() {
    let mut lab = Lab::new()
        .axis("scene", ["a", "b"])
        .axis("depth", ints([3, 5, 9]));
    lab.spec.repeats = 2;
    let plan = lab.plan();
    assert_eq!(plan.axes, ["scene", "depth"]);
    assert_eq!(
        paths(&plan),
        [
            "scene=a/depth=3/rep=0",
            "scene=a/depth=3/rep=1",
            "scene=a/depth=5/rep=0",
            "scene=a/depth=5/rep=1",
            "scene=a/depth=9/rep=0",
            "scene=a/depth=9/rep=1",
            "scene=b/depth=3/rep=0",
            "scene=b/depth=3/rep=1",
            "scene=b/depth=5/rep=0",
            "scene=b/depth=5/rep=1",
            "scene=b/depth=9/rep=0",
            "scene=b/depth=9/rep=1",
        ]
    );
    assert_eq!(
        plan.cells[3].point,
        vec![
            ("scene".into(), "a".into()),
            ("depth".into(), Value::Int(5))
        ]
    );
    assert_eq!(plan.cells[3].repeat, 1);
}

#[test]
fn an_experiment_without_axes_has_one_cell() {
    assert_eq!(paths(&Lab::new().plan()), ["rep=0"]);
}

#[test]
fn zipped_axes_move_together() {
    let steps = [["a".into(), Value::Int(1)], ["b".into(), Value::Int(2)]];
    let plan = Lab::new()
        .zip(["scene", "depth"], &steps)
        .axis("z", ints([0, 1]))
        .plan();
    assert_eq!(plan.axes, ["scene", "depth", "z"]);
    assert_eq!(
        paths(&plan),
        [
            "scene=a/depth=1/z=0/rep=0",
            "scene=a/depth=1/z=1/rep=0",
            "scene=b/depth=2/z=0/rep=0",
            "scene=b/depth=2/z=1/rep=0"
        ]
    );
}

#[test]
fn the_first_skip_rule_that_holds_is_recorded_once_per_point() {
    let mut lab = depths([1, 2, 3, 4]);
    lab.spec.repeats = 3;
    lab.spec.skips = vec!["odd ones are dark".into(), "three is too many".into()];
    lab.skip = Box::new(|rule, p| {
        Ok(if rule == 0 {
            whole_at(p, "depth") % 2 == 1
        } else {
            whole_at(p, "depth") >= 3
        })
    });
    let plan = lab.plan();
    assert_eq!(plan.cells.len(), 3);
    let skipped: Vec<(String, &str)> = plan
        .skipped
        .iter()
        .map(|s| (at(&s.point, "depth").to_string(), s.reason.as_str()))
        .collect();
    let expected = [
        ("1", "odd ones are dark"),
        ("3", "odd ones are dark"),
        ("4", "three is too many"),
    ];
    assert_eq!(
        skipped,
        expected.map(|(depth, reason)| (depth.to_owned(), reason))
    );
}

#[test]
fn render_is_not_called_for_skipped_points() {
    let mut lab = depths([1, 2]);
    lab.spec.skips = vec!["no ones".into()];
    lab.skip = Box::new(|_, p| Ok(whole_at(p, "depth") == 1));
    lab.render = Box::new(|p| {
        assert_ne!(whole_at(p, "depth"), 1);
        Ok(config())
    });
    assert_eq!(lab.plan().cells.len(), 1);
}

#[test]
fn overrides_replace_the_values_of_an_axis() {
    let mut lab = depths([1, 2]).axis("tag", ["1", "x"]);
    lab.overrides.axes = vec![
        ("depth".into(), ints([7, 2, 9]).into()),
        ("tag".into(), vec![Value::Int(1)]),
    ];
    let plan = lab.plan();
    assert_eq!(
        paths(&plan),
        [
            "depth=7/tag=1/rep=0",
            "depth=2/tag=1/rep=0",
            "depth=9/tag=1/rep=0"
        ]
    );
    assert_eq!(
        at(&plan.cells[0].point, "tag"),
        "1".into(),
        "a value that the script lists keeps its type"
    );
    assert_eq!(plan.cells[2].config.max_depth, Some(9));
}

#[test]
fn overrides_of_zipped_axes_keep_matching_steps() {
    let steps = [
        ["a".into(), Value::Int(1)],
        ["b".into(), Value::Int(2)],
        ["c".into(), Value::Int(1)],
    ];
    let mut lab = Lab::new().zip(["scene", "depth"], &steps);
    lab.overrides.axes = vec![("depth".into(), vec![Value::Int(1)])];
    assert_eq!(
        paths(&lab.plan()),
        ["scene=a/depth=1/rep=0", "scene=c/depth=1/rep=0"]
    );
}

#[test]
fn a_cell_is_selected_if_every_selected_axis_has_one_of_the_values() {
    let mut lab = Lab::new()
        .axis("scene", ["a", "b", "c"])
        .axis("depth", ints([3, 5]));
    lab.overrides.only = vec![
        ("scene".into(), "a".into()),
        ("scene".into(), "c".into()),
        ("depth".into(), Value::Int(5)),
    ];
    assert_eq!(
        paths(&lab.plan()),
        ["scene=a/depth=5/rep=0", "scene=c/depth=5/rep=0"]
    );
}

#[test]
fn a_selected_cell_is_the_same_run_as_in_the_whole_sweep() {
    let mut lab = depths([3, 5, 9]).measured();
    lab.stop = Box::new(|_| {
        Ok(StopRule::Any(vec![
            StopRule::Predicate(2),
            StopRule::Samples(16),
        ]))
    });
    let whole = lab.plan();
    lab.overrides.only = vec![("depth".into(), Value::Int(5))];
    // Predicates are numbered in the order of their creation; the number is not part of the run.
    lab.stop = Box::new(|_| {
        Ok(StopRule::Any(vec![
            StopRule::Predicate(0),
            StopRule::Samples(16),
        ]))
    });
    let one = lab.plan();
    assert_eq!(one.cells.len(), 1);
    assert_eq!(one.cells[0].id, whole.cells[1].id);
    assert_eq!(one.references[0].id, whole.references[1].id);
    assert_ne!(one.hash, whole.hash);
}

#[test]
fn a_backend_override_reaches_cells_and_references() {
    let mut lab = Lab::new().measured();
    lab.configure(|_, config| config.backend = "nowhere".into());
    assert!(lab.try_plan().is_err());
    lab.overrides.backend = Some("mock".into());
    let plan = lab.plan();
    assert_eq!(plan.cells[0].config.backend, "mock");
    let ReferenceSource::Render { config, .. } = &plan.references[0].source else {
        panic!("not rendered")
    };
    assert_eq!(config.backend, "mock");
}

#[test]
fn auto_is_replaced_by_a_concrete_backend() {
    let mut lab = Lab::new();
    lab.configure(|_, config| config.backend = "auto".into());
    let plan = lab.plan();
    let first = lumbre_night::backends::backend("auto").unwrap().name;
    assert_eq!(plan.cells[0].config.backend, first);
    assert_eq!(*plan.cells[0].identity.field("backend"), first.into());
}

#[test]
fn resolution_and_depth_fall_back_to_the_scene_and_enter_the_identity() {
    let mut lab = Lab::new();
    lab.configure(|_, config| {
        config.resolution = None;
        config.max_depth = None;
    });
    let plan = lab.plan();
    assert_eq!(plan.cells[0].config.resolution, Some([32, 16]));
    assert_eq!(plan.cells[0].config.max_depth, Some(7));
    let identity = &plan.cells[0].identity;
    let resolution = Value::List(ints([32, 16]).into());
    assert_eq!(*identity.field("resolution"), resolution);
    assert_eq!(*identity.field("max_depth"), Value::Int(7));
}

#[test]
fn a_scene_file_is_read_once_and_shared_by_equal_changes() {
    let mut lab = Lab::new()
        .axis("scene", ["a", "b"])
        .axis("rough", [0.25, 0.75])
        .axis("unused", ints([1, 2]));
    lab.spec.repeats = 2;
    lab.configure(|p, config| {
        config.scene_file = format!("{}.scn", at(p, "scene")).into();
        config
            .set
            .insert("materials.egg.roughness".into(), at(p, "rough"));
    });
    let plan = lab.plan();
    assert_eq!(plan.cells.len(), 16);
    assert_eq!(
        *lab.loads.borrow(),
        ["a.scn", "b.scn"].map(std::path::PathBuf::from)
    );
    assert_eq!(
        plan.notes.len(),
        2,
        "one note for each file: {:?}",
        plan.notes
    );
    let shared = |i: usize, j: usize| Arc::ptr_eq(&plan.cells[i].scene, &plan.cells[j].scene);
    assert!(
        shared(0, 1) && shared(0, 3),
        "repeats and unused axes share a scene"
    );
    assert!(!shared(0, 4) && !shared(0, 8));
    let roughness = |i: usize| plan.cells[i].scene.materials[0].roughness;
    assert_eq!(
        [roughness(0), roughness(4), roughness(8)],
        [0.25, 0.75, 0.25]
    );
}

#[test]
fn cells_share_references_and_no_reference_has_the_seed_of_a_cell() {
    let mut lab = depths([3, 5]).axis("tag", ["x", "y"]).measured();
    lab.spec.repeats = 2;
    let plan = lab.plan();
    let places: Vec<Option<usize>> = plan.cells.iter().map(|cell| cell.reference).collect();
    assert_eq!(places, [0, 0, 0, 0, 1, 1, 1, 1].map(Some));
    assert_eq!(plan.references.len(), 2);
    for reference in &plan.references {
        let ReferenceSource::Render { seeds, .. } = &reference.source else {
            panic!("not rendered")
        };
        assert!(seeds[0] != seeds[1] && plan.cells.iter().all(|cell| !seeds.contains(&cell.seed)));
    }
    let seeds: Vec<u64> = plan.cells.iter().map(|cell| cell.seed).collect();
    assert_eq!(seeds[0], seeds[2], "cells of one repeat share a seed");
    assert_ne!(seeds[0], seeds[1], "repeats have different seeds");
}

#[test]
fn a_reference_file_is_identified_by_its_content() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b, c] = ["a.exr", "b.exr", "c.exr"].map(|name| folder.path().join(name));
    std::fs::write(&a, b"truth").unwrap();
    std::fs::write(&b, b"truth").unwrap();
    std::fs::write(&c, b"another truth").unwrap();
    let mut lab = Lab::new().axis("file", ["a.exr", "b.exr", "c.exr"]);
    let root = folder.path().to_owned();
    lab.reference = Box::new(move |p| {
        Ok(Some(ReferenceRequest::File {
            file: root.join(at(p, "file").to_string()),
            source: String::new(),
        }))
    });
    let plan = lab.plan();
    assert_eq!(
        plan.cells
            .iter()
            .map(|cell| cell.reference)
            .collect::<Vec<_>>(),
        [0, 0, 1].map(Some)
    );
    assert_eq!(plan.references.len(), 2);
}

#[test]
fn runs_that_may_never_end_and_metrics_without_a_reference_cause_warnings() {
    let mut lab = depths([3, 5]).measured();
    assert_eq!(lab.plan().warnings, Vec::<String>::new());
    lab.stop = Box::new(|p| {
        Ok(if whole_at(p, "depth") == 3 {
            StopRule::Nan(1)
        } else {
            StopRule::Samples(4)
        })
    });
    let warnings = lab.plan().warnings;
    assert_eq!(warnings.len(), 1);
    assert!(
        warnings[0].starts_with("1 run stops only at `1 invalid sample`, which may never hold"),
        "{warnings:?}"
    );
    lab.stop = Box::new(|_| Ok(StopRule::Samples(4)));
    lab.reference = Box::new(|_| Ok(None));
    assert_eq!(
        lab.plan().warnings,
        ["2 cells have no reference, so rmse will not be measured"]
    );
}

#[test]
fn cells_of_an_axis_without_effect_are_one_run() {
    let mut lab = depths([3, 5]).axis("idle", ints([1, 2, 3]));
    lab.stop = Box::new(|_| Ok(StopRule::Samples(100)));
    let plan = lab.plan();
    assert_eq!(
        plan.warnings,
        ["axis `idle` has no effect in 6 of 6 cells, which are 2 runs"]
    );
    assert_eq!(plan.cells[0].id, plan.cells[1].id);
    let firsts: Vec<usize> = plan.cells.iter().map(|cell| cell.first).collect();
    assert_eq!(firsts, [0, 0, 0, 3, 3, 3]);
    // The cost of each is counted once, whichever of its cells is rendered.
    assert_eq!(plan.estimate(&|_| true).by_samples, 2);
    let without_first = |cell| cell != CellRef::Cell(0) && cell != CellRef::Cell(3);
    assert_eq!(plan.estimate(&without_first).by_samples, 2);
    let mut paths = paths(&plan);
    paths.dedup();
    assert_eq!(paths.len(), 6);
}

#[test]
fn ten_thousand_cells_are_planned() {
    let mut lab = Lab::new()
        .axis("depth", (1..=25).map(Value::Int))
        .axis("rough", (0..20).map(|i| f64::from(i) / 20.0))
        .measured();
    lab.spec.repeats = 20;
    lab.configure(|p, config| {
        config.max_depth = Some(whole_at(p, "depth"));
        config
            .set
            .insert("materials.egg.roughness".into(), at(p, "rough"));
    });
    let plan = lab.plan();
    assert_eq!(plan.cells.len(), 10_000);
    let ids: std::collections::BTreeSet<_> = plan.cells.iter().map(|cell| &cell.id).collect();
    assert_eq!(ids.len(), 10_000);
    assert_eq!(lab.loads.borrow().len(), 1);
}

#[test]
fn an_estimate_counts_every_run_once() {
    let mut lab = depths([1, 2, 3]).measured();
    lab.stop = Box::new(|p| {
        Ok(match whole_at(p, "depth") {
            1 => StopRule::Any(vec![StopRule::Time(30.0), StopRule::Samples(4)]),
            2 => StopRule::Samples(100),
            _ => StopRule::Waves(3),
        })
    });
    let plan = lab.plan();
    let references = 3.0 * 4096.0 * 32.0;
    let whole = plan.estimate(&|_| true);
    let expected = Estimate {
        by_time: 1,
        seconds: 30.0,
        by_samples: 4,
        paths: references + 3200.0,
        unbounded: 1,
        // Sums and the buffers of measuring of 8x4 pixels.
        run_bytes: 32 * (48 + 80),
        ..Estimate::default()
    };
    assert_eq!(whole, expected);
    let left = plan.estimate(&|cell| cell == CellRef::Cell(1));
    assert_eq!(
        left,
        Estimate {
            by_samples: 1,
            paths: 3200.0,
            run_bytes: expected.run_bytes,
            ..Estimate::default()
        }
    );
}

#[test]
fn a_scene_is_loaded_once_for_each_choice_of_its_options() {
    let mut lab = Lab::new().axis("light", ["day", "night"]);
    lab.spec.repeats = 2;
    lab.configure(|p, config| config.scene_options = [("light".to_owned(), at(p, "light"))].into());
    lab.plan();
    assert_eq!(lab.loads.borrow().len(), 2);
}
