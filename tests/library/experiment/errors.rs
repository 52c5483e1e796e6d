//! Errors that prevent a plan, and their messages.

use lumbre_light::value::Value;
use lumbre_night::experiment::hook_error::HookError;
use lumbre_night::experiment::spec::ReferenceRequest;
use lumbre_night::experiment::{StopRule, stop::Comparison};

use crate::experiment::fixtures::{Lab, config, ints, rendered};

fn refusal(lab: &Lab) -> String {
    lab.try_plan().unwrap_err().to_string()
}

fn refusal_of(change: impl Fn(&mut lumbre_render::Settings) + 'static) -> String {
    let mut lab = Lab::new().axis("depth", ints([3]));
    lab.configure(move |_, config| change(config));
    refusal(&lab)
}

#[test]
fn unknown_axes_and_values_of_overrides_and_selections_are_reported_with_the_known_ones() {
    let steps = [["a".into(), Value::Int(1)], ["b".into(), Value::Int(2)]];
    let lab = || {
        Lab::new()
            .axis("depth", ints([3, 5]))
            .zip(["scene", "size"], &steps)
    };
    let with_axis = |name: &str, values: Vec<Value>| {
        let mut lab = lab();
        lab.overrides.axes = vec![(name.into(), values)];
        refusal(&lab)
    };
    assert_eq!(
        with_axis("dpeth", ints([1]).into()),
        "there is no axis `dpeth` (did you mean `depth`?)"
    );
    assert_eq!(
        with_axis("zebra", ints([1]).into()),
        "there is no axis `zebra` (known: depth, scene, size)"
    );
    assert_eq!(
        with_axis("size", ints([1, 77]).into()),
        "axis `size` has no value `77` (known: 1, 2)"
    );
    assert_eq!(
        with_axis("depth", vec![]),
        "axis `depth` has no values: give at least one"
    );
    assert_eq!(
        with_axis("depth", ints([4, 4]).into()),
        "axis `depth` has the value `4` twice: remove one, or use `repeats`"
    );
    let with_only = |only: &[(&str, Value)]| {
        let mut lab = lab();
        lab.overrides.only = only
            .iter()
            .map(|(name, value)| ((*name).to_owned(), value.clone()))
            .collect();
        refusal(&lab)
    };
    assert_eq!(
        with_only(&[("scnee", "a".into())]),
        "there is no axis `scnee` (did you mean `scene`?)"
    );
    assert_eq!(
        with_only(&[("depth", Value::Int(40))]),
        "axis `depth` has no value `40` (known: 3, 5)"
    );
    assert_eq!(
        with_only(&[("scene", "a".into()), ("size", Value::Int(2))]),
        "no point of the sweep matches all of scene = a, size = 2: select other values with `--only`"
    );
}

#[test]
fn duplicate_axes_duplicate_values_and_zero_repeats_are_refused() {
    assert_eq!(
        refusal(&Lab::new().axis("a", ints([1])).axis("a", ints([2]))),
        "two axes are called `a`: rename one of them"
    );
    assert_eq!(
        refusal(&Lab::new().axis("a", ints([]))),
        "axis `a` has no values: give at least one"
    );
    assert_eq!(
        refusal(&Lab::new().axis("a", [1.0, 2.0, 1.0])),
        "axis `a` has the value `1` twice: remove one, or use `repeats`"
    );
    let mut lab = Lab::new();
    lab.spec.repeats = 0;
    assert_eq!(refusal(&lab), "`repeats` is 0: set it to at least 1");
}

#[test]
fn a_sweep_that_is_too_large_is_refused_before_it_is_expanded() {
    let numbers = || (0..2000).map(Value::Int);
    let mut lab = Lab::new()
        .axis("a", numbers())
        .axis("b", numbers())
        .axis("c", numbers());
    lab.spec.repeats = 3;
    lab.render = Box::new(|_| panic!("the sweep must not be expanded"));
    assert_eq!(
        refusal(&lab),
        "the sweep has 24000000000 cells (2000 of `a` x 2000 of `b` x 2000 of `c` x 3 repeats), more than \
         the limit of 1000000: shorten an axis, or select points with `--only`"
    );
}

#[test]
fn invalid_configurations_are_refused() {
    assert_eq!(
        refusal_of(|c| c.integrator = "btp".into()),
        "at depth = 3: unknown integrator `btp` (did you mean `bpt`?)"
    );
    assert_eq!(
        refusal_of(|c| c.backend = "mokc".into()),
        "at depth = 3: unknown backend `mokc` (did you mean `mock`?)"
    );
    assert!(refusal_of(|c| c.resolution = Some([0, 4])).contains("a picture of 0x4 pixels"));
    assert!(refusal_of(|c| c.resolution = Some([1 << 20, 1 << 20])).contains("at most 268435456"));
    assert!(refusal_of(|c| c.max_depth = Some(0)).contains("`max_depth` is 0"));
    assert_eq!(
        refusal_of(|c| c.scene_file = "missing.scn".into()),
        "scene at depth = 3: cannot read missing.scn: no such file"
    );
    let unknown = refusal_of(|c| {
        c.set
            .insert("materials.egg.rougness".into(), Value::Num(0.5));
    });
    assert!(unknown.starts_with("`set` at depth = 3: "), "{unknown}");
    assert!(unknown.contains("roughness"), "{unknown}");
}

#[test]
fn stop_rules_that_cannot_apply_to_their_run_are_refused() {
    let rmse = StopRule::When {
        column: "rmse".into(),
        op: Comparison::Less,
        value: 0.1,
        hold: 1,
    };
    let mut lab = Lab::new().axis("depth", ints([3])).measured();
    let rule = rmse.clone();
    lab.stop = Box::new(move |_| Ok(rule.clone()));
    assert_eq!(lab.plan().cells.len(), 1);
    lab.stop = Box::new(|_| Ok(StopRule::Any(vec![])));
    assert_eq!(
        refusal(&lab),
        "stop rule at depth = 3: `stop.any` is empty: it needs at least one rule"
    );
    let rule = rmse.clone();
    lab.stop = Box::new(|_| Ok(StopRule::Samples(4)));
    lab.reference = Box::new(move |_| Ok(Some(rendered(config(), rule.clone()))));
    assert_eq!(
        refusal(&lab),
        "stop rule of the reference at depth = 3: the stop rule uses `rmse`, which is not measured \
         (no metrics are measured here)"
    );
    lab.stop = Box::new(move |_| Ok(rmse.clone()));
    lab.reference = Box::new(|_| Ok(None));
    assert_eq!(
        refusal(&lab),
        "stop rule at depth = 3: `rmse < 0.1` can never hold: there is no reference to measure against"
    );
}

#[test]
fn references_of_another_size_or_without_a_readable_file_are_refused() {
    let mut lab = Lab::new();
    lab.reference = Box::new(|_| {
        let mut config = config();
        config.resolution = Some([8, 5]);
        Ok(Some(rendered(config, StopRule::Samples(4))))
    });
    assert_eq!(
        refusal(&lab),
        "the picture has 8x4 pixels but its reference 8x5: use the same `resolution`"
    );
    lab.reference = Box::new(|_| {
        Ok(Some(ReferenceRequest::File {
            file: "no/such/truth.exr".into(),
            source: String::new(),
        }))
    });
    assert!(refusal(&lab).starts_with("reference: cannot read no/such/truth.exr: "));
}

#[test]
fn an_error_in_a_function_is_reported_with_the_function_and_the_point() {
    let fail = || HookError("attempt to index a nil value".into());
    let mut lab = Lab::new().axis("depth", ints([3]));
    lab.stop = Box::new(move |_| Err(fail()));
    assert_eq!(
        refusal(&lab),
        "`stop` at depth = 3: attempt to index a nil value"
    );
    lab.reference = Box::new(move |_| Err(fail()));
    assert_eq!(
        refusal(&lab),
        "`reference` at depth = 3: attempt to index a nil value"
    );
    lab.render = Box::new(move |_| Err(fail()));
    assert_eq!(
        refusal(&lab),
        "`render` at depth = 3: attempt to index a nil value"
    );
    lab.spec.skips = vec!["dark ones".into()];
    lab.skip = Box::new(move |_, _| Err(fail()));
    assert_eq!(
        refusal(&lab),
        "skip rule `dark ones` at depth = 3: attempt to index a nil value"
    );
}
