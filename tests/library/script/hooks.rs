//! Functions of a script, called as by the plan and the night.

use lumbre_light::scene::compile::Sharing;
use lumbre_light::transport::camera::FilterKind;
use lumbre_light::value::Value;
use lumbre_lua::{Script, ScriptError};
use lumbre_night::experiment::hook_error::HookError;
use lumbre_night::experiment::spec::{BiasCheckRequest, Point, ReferenceRequest, ScriptHooks};
use lumbre_night::experiment::stop::Comparison;
use lumbre_night::experiment::{StopRule, WaveRow};
use lumbre_render::Settings;
use lumbre_render::hierarchy::{AccelSpec, Builder};

use crate::script::{Folder, GOOD, edited};

const STOP: &str = "x:stop(stop.samples(16))";
const REFERENCE: &str = "x:reference { stop = stop.samples(64) }";
const TABLE: &str = "{ scene = \"s.scn\", integrator = \"bpt\", max_depth = p.depth }";

fn point(depth: i64) -> Point {
    vec![("depth".to_owned(), Value::Int(depth))]
}

fn script_error<T: std::fmt::Debug>(result: Result<T, HookError>) -> ScriptError {
    result
        .unwrap_err()
        .0
        .downcast_ref::<ScriptError>()
        .unwrap()
        .clone()
}

fn load(from: &str, to: &str) -> (Folder, Script) {
    let folder = Folder::new(edited(from, to));
    let script = folder.load().unwrap();
    (folder, script)
}

#[test]
fn a_short_render_table_takes_the_defaults() {
    let folder = Folder::new(GOOD);
    let script = folder.load().unwrap();
    let cell = script.render(&point(5)).unwrap();
    assert_eq!(
        (cell.scene.as_str(), cell.scene_file.clone()),
        ("s.scn", folder.path("s.scn"))
    );
    assert_eq!(
        (cell.integrator.as_str(), cell.backend.as_str()),
        ("bpt", "auto")
    );
    assert_eq!(
        (cell.max_depth, cell.resolution, cell.rr_start),
        (Some(5), None, None)
    );
    assert_eq!(
        (cell.filter.kind, cell.filter.radius),
        (FilterKind::Box, 0.5)
    );
    assert_eq!(cell.sampler, "independent");
    assert!(cell.set.is_empty() && cell.params.is_empty());
    assert_eq!(
        script.render(&point(5)).unwrap(),
        cell,
        "a second call must return the same"
    );
}

#[test]
fn a_full_render_table_is_converted() {
    let table = "{ scene = \"s.scn\", integrator = \"bpt\", max_depth = p.depth, resolution = { 160, 120.0 },
      aa = { filter = \"gauss\", radius = 1.5 }, camera = { aperture = 0.25, target = { 0, 1, 0 } },
      set = { [\"materials.egg.ior\"] = 1.5 }, rr = { start = 4 }, backend = \"cpu\", sampler = \"sobol\" }";
    let (_folder, script) = load(TABLE, table);
    let cell = script.render(&point(3)).unwrap();
    assert_eq!(
        (cell.resolution, cell.rr_start, cell.backend.as_str()),
        (Some([160, 120]), Some(4), "cpu")
    );
    assert_eq!(
        (cell.filter.kind, cell.filter.radius),
        (FilterKind::Gauss, 1.5)
    );
    assert_eq!(cell.sampler, "sobol");
    let set: Vec<(&str, String)> = cell
        .set
        .iter()
        .map(|(k, v)| (k.as_str(), v.to_string()))
        .collect();
    assert_eq!(
        set,
        [
            ("camera.aperture", "0.25".to_owned()),
            ("camera.target", "[0, 1, 0]".to_owned()),
            ("materials.egg.ior", "1.5".to_owned()),
        ]
    );
}

#[test]
fn skip_rules_are_called_by_their_number() {
    let rules = format!(
        "{STOP}\nx:skip(\"one\", function(p) return p.depth > 3 end)\nx:skip(\"two\", function(p) end)\n\
         x:skip(\"three\", function(p) return 1 end)"
    );
    let (_folder, script) = load(STOP, &rules);
    assert_eq!(script.spec.skips, ["one", "two", "three"]);
    assert!(script.skip(0, &point(5)).unwrap() && !script.skip(0, &point(2)).unwrap());
    assert!(!script.skip(1, &point(5)).unwrap());
    let e = script_error(script.skip(2, &point(5)));
    assert!(
        e.to_string()
            .contains("skip: the function returned an integer"),
        "{e}"
    );
    assert_eq!(e.line(), Some(11));
}

#[test]
fn a_reference_has_the_configuration_of_its_cell_with_changes() {
    let table =
        "{ scene = \"s.scn\", integrator = \"bpt\", max_depth = p.depth, aa = { filter = \"gauss\", radius = 1 },
      set = { [\"materials.egg.ior\"] = 1.5, [\"materials.egg.roughness\"] = p.depth / 10 } }";
    let from = "x:reference { stop = stop.samples(64), parts = 4, from = function(p)
  return { aa = { radius = 2 }, set = { [\"materials.egg.ior\"] = 2 }, max_depth = 64 }
end }";
    let text = edited(TABLE, table).replace(REFERENCE, from);
    let folder = Folder::new(text);
    let script = folder.load().unwrap();
    let Some(ReferenceRequest::Render {
        config,
        stop,
        shards,
        ..
    }) = script.reference(&point(3)).unwrap()
    else {
        panic!("expected a rendered reference")
    };
    assert_eq!((stop, shards), (StopRule::Samples(64), 4));
    assert_eq!(
        (config.filter.kind, config.filter.radius, config.max_depth),
        (FilterKind::Gauss, 2.0, Some(64))
    );
    let set: Vec<String> = config.set.values().map(Value::to_string).collect();
    assert_eq!(set, ["2", "0.3"]);
    let (_folder, script) = load(REFERENCE, REFERENCE);
    let Some(ReferenceRequest::Render { config, .. }) = script.reference(&point(3)).unwrap() else {
        panic!("expected a rendered reference")
    };
    assert_eq!(
        *config,
        script.render(&point(3)).unwrap(),
        "without `from` it must be the configuration of the cell"
    );
}

/// Returns the configuration of the reference of a script, and its bias check.
fn rendered(table: &str, reference: &str) -> (Settings, Option<Box<BiasCheckRequest>>) {
    let folder = Folder::new(edited(TABLE, table).replace(REFERENCE, reference));
    let script = folder.load().unwrap();
    let Some(ReferenceRequest::Render {
        config, bias_check, ..
    }) = script.reference(&point(3)).unwrap()
    else {
        panic!("expected a rendered reference")
    };
    (*config, bias_check)
}

#[test]
fn a_reference_of_a_biased_technique_is_by_an_unbiased_one() {
    let table = "{ scene = \"s.scn\", integrator = \"sppm\", radius = 0.5, max_depth = 3 }";
    for from in ["", ", from = function(p) return { max_depth = 9 } end"] {
        let reference = format!("x:reference {{ stop = stop.samples(64){from} }}");
        let (config, _) = rendered(table, &reference);
        assert_ne!(config.integrator, "sppm", "{reference}");
        assert!(config.params.is_empty(), "{reference}");
    }
    let own = "from = function(p) return { integrator = \"sppm\" } end";
    let (config, _) = rendered(
        table,
        &format!("x:reference {{ stop = stop.samples(64), {own} }}"),
    );
    assert_eq!(config.integrator, "sppm", "the script asks for it");
}

#[test]
fn a_bias_check_has_its_own_technique_and_stops_at_the_first_of_its_limits() {
    let table = "{ scene = \"s.scn\", integrator = \"bdpt\", mis = \"balance\", max_depth = 3 }";
    let check = |agree: &str| {
        let reference = format!("x:reference {{ stop = stop.samples(64), agree = {agree} }}");
        let (config, check) = rendered(table, &reference);
        assert_eq!(config.params.len(), 1, "the reference has the cell's `mis`");
        *check.unwrap()
    };
    let found = check("{ with = \"nee\", time = \"5s\", samples = 9 }");
    assert_eq!(found.config.integrator, "nee");
    assert_eq!(found.config.max_depth, Some(3));
    assert!(
        found.config.params.is_empty(),
        "the parameters of the reference are those of its technique"
    );
    let limits = vec![StopRule::Time(5.0), StopRule::Samples(9)];
    assert_eq!(found.stop, StopRule::Any(limits));
    let found = check("{ with = \"nee\", samples = 9 }");
    assert_eq!(found.stop, StopRule::Samples(9));
    let found = check("{ with = \"nee\" }");
    assert_eq!(found.stop, StopRule::Samples(64), "that of the reference");
    let found = check("{ with = { integrator = \"bdpt\" } }");
    assert!(
        found.config.params.is_empty(),
        "parameters are those of `with`, also of the same technique"
    );
}

#[test]
fn references_use_the_default_acceleration_structure() {
    let table = "{ scene = \"s.scn\", integrator = \"bpt\", max_depth = p.depth,
      accel = { builder = \"sah\", bins = 8, instances = \"always\" } }";
    let folder = Folder::new(edited(TABLE, table));
    let script = folder.load().unwrap();
    let accel = script.render(&point(3)).unwrap().accel;
    assert_eq!(
        (accel.builder, accel.bins, accel.instances),
        (Builder::Sah, 8, Sharing::Always)
    );
    let Some(ReferenceRequest::Render { config, .. }) = script.reference(&point(3)).unwrap() else {
        panic!("expected a rendered reference")
    };
    assert_eq!(config.accel, AccelSpec::default());
    let (_folder, script) = load(
        "max_depth = p.depth",
        "max_depth = p.depth, accel = { builder = \"bvh\" }",
    );
    let e = script_error(script.render(&point(3)));
    assert!(e.to_string().contains("accel.builder"), "{e}");
}

#[test]
fn errors_in_reference_overrides_have_the_line_of_their_key() {
    let from = |body: &str| {
        format!(
            "x:reference {{ stop = stop.samples(64), from = function(p)\n  return {body}\nend }}"
        )
    };
    let (_folder, script) = load(REFERENCE, &from("{ max_dept = 3 }"));
    let e = script_error(script.reference(&point(3)));
    assert!(
        e.to_string()
            .contains("reference.from.max_dept: unknown key"),
        "{e}"
    );
    assert_eq!(e.line(), Some(7));
    let (_folder, script) = load(REFERENCE, &from("3"));
    assert_eq!(script_error(script.reference(&point(3))).line(), Some(6));
    let text = edited(REFERENCE, &from("{}")).replace("\"s.scn\"", "\"gone.scn\"");
    let folder = Folder::new(text);
    let script = folder.load().unwrap();
    assert_eq!(
        script_error(script.reference(&point(3))).line(),
        Some(4),
        "the scene is named in the render function"
    );
}

#[test]
fn images_may_be_references() {
    let (folder, script) = load(REFERENCE, "x:reference { image = \"truth.exr\" }");
    let e = script_error(script.reference(&point(3)));
    assert!(
        e.to_string()
            .contains("reference.image: there is no file `truth.exr`"),
        "{e}"
    );
    assert_eq!(e.line(), Some(6));
    folder.put("truth.exr", "");
    let found = script.reference(&point(3)).unwrap();
    assert_eq!(
        found,
        Some(ReferenceRequest::File {
            file: folder.path("truth.exr"),
            source: String::new()
        })
    );
    let by_point =
        "x:reference { image = function(p) return \"truth_\" .. p.depth .. \".exr\" end }";
    let (folder, script) = load(REFERENCE, by_point);
    folder.put("truth_3.exr", "");
    assert_eq!(
        script.reference(&point(3)).unwrap(),
        Some(ReferenceRequest::File {
            file: folder.path("truth_3.exr"),
            source: String::new()
        })
    );
    assert!(script.reference(&point(4)).is_err());
    let (_folder, script) = load(REFERENCE, "");
    assert_eq!(script.reference(&point(3)).unwrap(), None);
}

#[test]
fn stop_rules_are_converted_to_data() {
    let rule = "x:stop(function(p) return stop.any {
  stop.when(\"rmse\", \"<=\", 0.1, { hold = 3 }), stop.all(stop.time(\"5min\"), stop.waves(2)),
  stop.not_(stop.nan(1)), stop.samples(p.depth) } end)";
    let (_folder, script) = load(STOP, rule);
    let when = StopRule::When {
        column: "rmse".into(),
        op: Comparison::LessEqual,
        value: 0.1,
        hold: 3,
    };
    let both = StopRule::All(vec![StopRule::Time(300.0), StopRule::Waves(2)]);
    let not = StopRule::Not(Box::new(StopRule::Nan(1)));
    assert_eq!(
        script.stop(&point(7)).unwrap(),
        StopRule::Any(vec![when, both, not, StopRule::Samples(7)])
    );
    let (_folder, script) = load(
        STOP,
        "x:stop(function(p)\n  return stop.when(\"rsme\", \"<\", 1)\nend)",
    );
    let e = script_error(script.stop(&point(7)));
    assert!(e.to_string().contains("did you mean `rmse`?"), "{e}");
    assert_eq!(e.line(), Some(9));
    let (_folder, script) = load(STOP, "x:stop(stop.when(\"rmse\", \"<\", 1))");
    let once = StopRule::When {
        column: "rmse".into(),
        op: Comparison::Less,
        value: 1.0,
        hold: 1,
    };
    assert_eq!(script.stop(&point(7)).unwrap(), once);
    let (_folder, script) = load(STOP, "x:stop(function(p) end)");
    assert!(
        script_error(script.stop(&point(7)))
            .to_string()
            .contains("stop: the function returned nothing")
    );
}

fn rows(errors: &[f64]) -> Vec<WaveRow> {
    let row = |(i, rmse): (usize, &f64)| WaveRow {
        wave: i as u64 + 1,
        samples: 1 << i,
        render_s: 0.5 * (i as f64 + 1.0),
        metrics: vec![*rmse],
        ..WaveRow::default()
    };
    errors.iter().enumerate().map(row).collect()
}

fn predicate(body: &str) -> (Folder, Script, usize) {
    let (folder, script) = load(
        STOP,
        &format!("x:stop(stop.predicate(function(row, history)\n  {body}\nend))"),
    );
    let StopRule::Predicate(id) = script.stop(&point(2)).unwrap() else {
        panic!("expected a predicate")
    };
    (folder, script, id)
}

#[test]
fn predicates_receive_the_row_and_the_history() {
    let columns = ["rmse".to_owned()];
    let (_folder, script, id) = predicate(
        "if #history < 3 then return nil end
  assert(row.wave == #history and row == history[#history] and history[#history + 1] == nil)
  local sum = 0
  for i, r in ipairs(history) do assert(r.samples == 1 << (i - 1)); sum = sum + r.rmse end
  return sum < 1 and row.render_s == 1.5 and row.wall_s == 0",
    );
    assert!(!script.predicate(id, &columns, &rows(&[0.5, 0.2])).unwrap());
    assert!(
        script
            .predicate(id, &columns, &rows(&[0.5, 0.2, 0.1]))
            .unwrap()
    );
    assert!(
        !script
            .predicate(id, &columns, &rows(&[0.9, 0.2, 0.1]))
            .unwrap()
    );
}

#[test]
fn errors_in_predicates_have_their_line() {
    let columns = ["rmse".to_owned()];
    for (body, line, expected) in [
        (
            "return row.rsme < 1",
            9,
            "row.rsme: unknown column `rsme` (did you mean `rmse`?)",
        ),
        ("return history[1].rsme < 1", 9, "did you mean `rmse`?"),
        (
            "return row.samples",
            8,
            "stop.predicate: the function returned an integer",
        ),
        ("return row < 1", 9, "attempt to compare"),
        (
            "while true do end",
            9,
            "a stop predicate ran longer than its limit of 1 s",
        ),
        (
            "local t = {}; for i = 1, 1e9 do t[i] = i end",
            9,
            "exceeded its limit of 256 MiB of memory",
        ),
    ] {
        let (_folder, script, id) = predicate(body);
        let e = script_error(script.predicate(id, &columns, &rows(&[0.5])));
        assert!(e.to_string().contains(expected), "{body}: {e}");
        assert_eq!(e.line(), Some(line), "{body}: {e}");
        assert!(
            script.render(&point(2)).is_ok(),
            "the script must remain usable after {body}"
        );
    }
    let (_folder, script, id) = predicate("return row.rmse < 1");
    let unmeasured = vec![WaveRow {
        wave: 1,
        ..WaveRow::default()
    }];
    assert!(
        script_error(script.predicate(id, &columns, &unmeasured))
            .to_string()
            .contains("unknown column `rmse`")
    );
}

#[test]
fn the_same_predicate_has_the_same_number() {
    let rule = "local calm = function(row) return row.samples > 4 end
x:stop(function(p) return stop.any(stop.predicate(calm), stop.predicate(function(row) return p.depth > 1 end)) end)";
    let (_folder, script) = load(STOP, rule);
    let ids = |depth| match script.stop(&point(depth)).unwrap() {
        StopRule::Any(parts) => parts
            .iter()
            .map(|p| {
                if let StopRule::Predicate(id) = p {
                    *id
                } else {
                    99
                }
            })
            .collect(),
        _ => Vec::new(),
    };
    let (first, second) = (ids(1), ids(2));
    assert_eq!(first[0], second[0]);
    assert_ne!(
        first[1], second[1],
        "closures over different points must be different predicates"
    );
    assert!(!script.predicate(first[1], &[], &rows(&[])).unwrap() || first.is_empty());
    let row = vec![WaveRow {
        samples: 8,
        ..WaveRow::default()
    }];
    assert!(script.predicate(first[0], &[], &row).unwrap());
    assert!(!script.predicate(first[1], &[], &row).unwrap());
    assert!(script.predicate(second[1], &[], &row).unwrap());
}

#[test]
fn points_contain_only_their_axes() {
    let (_folder, script) = load(
        "  return { scene",
        "  local n = 0; for k, v in pairs(p) do assert(k == \"depth\" and v == 2); n = n + 1 end; assert(n == 1)\n  return { scene",
    );
    assert!(script.render(&point(2)).is_ok());
}

#[test]
fn the_stop_rule_of_a_reference_may_depend_on_the_point() {
    let stop = "x:reference { stop = function(p)\n  return stop.samples(64 * p.depth)\nend }";
    let (_folder, script) = load(REFERENCE, stop);
    let Some(ReferenceRequest::Render { stop, .. }) = script.reference(&point(3)).unwrap() else {
        panic!("expected a rendered reference")
    };
    assert_eq!(stop, StopRule::Samples(192));
    let (_folder, script) = load(
        REFERENCE,
        "x:reference { stop = function(p)\n  return 7\nend }",
    );
    let e = script_error(script.reference(&point(3)));
    assert!(
        e.to_string()
            .contains("reference.stop: the function returned an integer"),
        "{e}"
    );
    assert_eq!(e.line(), Some(6));
    let (_folder, script) = load(
        REFERENCE,
        "x:reference { stop = function(p)\n  return stop.when(\"rmse\", \"<\", 1)\nend }",
    );
    let e = script_error(script.reference(&point(3)));
    assert!(
        e.to_string()
            .contains("a reference is not compared with anything"),
        "{e}"
    );
    assert_eq!(e.line(), Some(7));
}

#[test]
fn a_function_selects_the_points_of_the_aa_check() {
    let (_folder, script) = load(REFERENCE, "x:control(function(p) return p.depth > 3 end)");
    assert_eq!(
        (
            script.aa_check(&point(3)).unwrap(),
            script.aa_check(&point(4)).unwrap()
        ),
        (Some(false), Some(true))
    );
    let (_folder, script) = load(REFERENCE, "x:control()");
    assert_eq!(
        script.aa_check(&point(3)).unwrap(),
        None,
        "without a function the plan chooses"
    );
    let (_folder, script) = load(REFERENCE, "x:control(function(p) return 7 end)");
    assert!(
        script_error(script.aa_check(&point(3)))
            .to_string()
            .contains("control: the function returned an integer")
    );
}

#[test]
fn a_plateau_rule_needs_a_known_column() {
    let text = edited(
        "x:stop(stop.samples(16))",
        "x:stop(stop.plateau(\"rmse\", { slope = -0.2, over = 8 }))",
    );
    let script = Folder::new(text).load().unwrap();
    let expected = StopRule::Plateau {
        column: "rmse".to_owned(),
        exponent: -0.2,
        over: 8.0,
        p: 0.01,
    };
    assert_eq!(script.stop(&point(3)).unwrap(), expected);
    let text = edited("x:stop(stop.samples(16))", "x:stop(stop.plateau(\"rmse\"))");
    let script = Folder::new(text).load().unwrap();
    let default = StopRule::Plateau {
        column: "rmse".to_owned(),
        exponent: -0.1,
        over: 4.0,
        p: 0.01,
    };
    assert_eq!(script.stop(&point(3)).unwrap(), default);
    let unknown = edited("x:stop(stop.samples(16))", "x:stop(stop.plateau(\"rsme\"))");
    let e = Folder::new(unknown).load().unwrap_err();
    assert!(
        e.to_string().contains("stop.plateau") && e.to_string().contains("rsme"),
        "{e}"
    );
}
