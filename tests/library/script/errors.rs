//! Errors of every class: their line, the path to the field, and the hint.

use lumbre_light::value::Value;
use lumbre_lua::{Problem, ScriptError};
use lumbre_night::experiment::spec::ScriptHooks;

use crate::script::{Folder, GOOD, edited};

pub fn error_of(text: &str) -> ScriptError {
    match Folder::new(text).load() {
        Ok(script) => panic!("this script was accepted: {}\n{text}", script.spec.name),
        Err(e) => e,
    }
}

/// Loads scripts in which one piece of the good script is replaced, and compares the line and text
/// of their errors.
pub fn expect(cases: &[(&str, &str, usize, &str)]) {
    for (from, to, line, expected) in cases {
        let e = error_of(&edited(from, to));
        assert!(
            e.to_string().contains(expected),
            "{to}\n  found:    {e}\n  expected: {expected}"
        );
        assert_eq!(e.line(), Some(*line), "{to}: {e}");
    }
}

const AXIS: &str = "x:axis(\"depth\", { 2, 5 })";
pub const REFERENCE: &str = "x:reference { stop = stop.samples(64) }";
const MEASURE: &str = "x:measure { rmse = metric.rmse(), every = \"1s\" }";
pub const STOP: &str = "x:stop(stop.samples(16))";

#[test]
fn the_good_script_loads() {
    assert!(Folder::new(GOOD).load().is_ok());
}

#[test]
fn invalid_experiments_are_reported_with_line_and_hint() {
    expect(&[
        (
            "seed = 1",
            "sed = 1",
            1,
            "experiment.sed: unknown key `sed` (did you mean `seed`?)",
        ),
        (
            "seed = 1",
            "seed = -1",
            1,
            "experiment.seed: -1 is out of range",
        ),
        (
            "seed = 1",
            "seed = 1.5",
            1,
            "experiment.seed: expected an integer",
        ),
        (
            "seed = 1",
            "seed = 0/0",
            1,
            "experiment.seed: the number is NaN",
        ),
        ("\"t\"", "\"a b\"", 1, "cannot name an experiment"),
        (
            "\"t\"",
            "7",
            1,
            "argument 1 (name): expected a string, found an integer",
        ),
        (
            "return x",
            "experiment(\"u\")\nreturn x",
            9,
            "the first is in line 1",
        ),
        (
            "return x",
            "",
            8,
            "returned nothing: end it with `return x`",
        ),
        (
            "return x",
            "return 7",
            9,
            "returned an integer: end it with `return x`",
        ),
        ("return x", "return { x }", 9, "returned a table"),
        (STOP, "", 1, "does not define when a cell is finished"),
    ]);
    let e = error_of("local y = 1\n");
    assert!(
        e.to_string().contains("begin with: local x = experiment"),
        "{e}"
    );
    let e = error_of("");
    assert!(matches!(e.problem(), Problem::NoExperiment { .. }), "{e}");
    let e = error_of("local x = experiment('t')\nx:stop(stop.samples(1))\nreturn x\n");
    assert!(
        e.to_string().contains("does not define what to render"),
        "{e}"
    );
}

#[test]
fn invalid_axes_are_reported_with_line_and_hint() {
    expect(&[
        (AXIS, "x:axis(\"depth\", {})", 2, "axis.depth has no values"),
        (
            AXIS,
            "x:axis(\"depth\", 3)",
            2,
            "argument 2 (values): expected a table, found an integer",
        ),
        (
            AXIS,
            "x:axis(\"depth\", { 2, 2.0 })",
            2,
            "axis.depth[2] repeats the value `2` of [1]",
        ),
        (
            AXIS,
            "x:axis(\"depth\", { 2, print })",
            2,
            "axis.depth[2]: expected plain data, found a function",
        ),
        (
            AXIS,
            "x:axis(\"depth\", { 2, 1/0 })",
            2,
            "axis.depth[2]: inf is not finite",
        ),
        (
            AXIS,
            "x:axis(\"depth\", { 2, { a = 1 } })",
            2,
            "found a table",
        ),
        (
            AXIS,
            "x:axis(\"de pth\", { 2 })",
            2,
            "`de pth` cannot name an axis",
        ),
        (
            AXIS,
            "x:axis(\"rep\", { 2 })",
            2,
            "`rep` cannot name an axis",
        ),
        (
            AXIS,
            "x:axis(\"depth\", { 2 })\nx:axis(\"depth\", { 3 })",
            3,
            "already an axis `depth`",
        ),
        (
            AXIS,
            "x:axis({ \"depth\", \"r\" }, zip({ 1, 2 }, { 1 }))",
            2,
            "the lists differ in length: [2, 1]",
        ),
        (
            AXIS,
            "x:axis({ \"depth\", \"r\" }, { { 1, 2 }, 3 })",
            2,
            "[2] is `3`: expected 2 values",
        ),
        (
            AXIS,
            "x:axis(zip { depth = { 1 }, r = { 2 } }, { 1 })",
            2,
            "expected at least two lists",
        ),
        (
            AXIS,
            "x:axis(\"depth\", range(0, 1, 0))",
            2,
            "the step is zero",
        ),
        (
            AXIS,
            "x:axis(\"depth\", range(0, 1e6))",
            2,
            "an axis has at most 100000",
        ),
        (AXIS, "x:axis(\"depth\", range(5, 1))", 2, "is empty"),
        (
            AXIS,
            "x:axis(\"depth\", linspace(0, 1, 1))",
            2,
            "argument 3 (count) is 1",
        ),
        (
            AXIS,
            "x:axis(\"depth\", logspace(0, 1, 3))",
            2,
            "both ends must be above zero",
        ),
        (
            AXIS,
            "x:axsi(\"depth\", { 2 })",
            2,
            "x.axsi: unknown name `axsi` (did you mean `axis`?)",
        ),
        (
            AXIS,
            "x.axis(\"depth\", { 2 })",
            2,
            "write `x:axis(..)` with a colon",
        ),
        (
            AXIS,
            "x:axis(\"depth\", { 2 }, 3)",
            2,
            "expected at most 2 arguments, found 3",
        ),
    ]);
}

#[test]
fn invalid_references_are_reported_with_line_and_hint() {
    expect(&[
        (
            REFERENCE,
            "x:reference {}",
            6,
            "reference: `stop` is missing",
        ),
        (
            REFERENCE,
            "x:reference { stop = 64 }",
            6,
            "reference.stop: expected a stop rule, found an integer",
        ),
        (
            REFERENCE,
            "x:reference {\n  from = { max_depth = 9 },\n  stop = stop.samples(1),\n}",
            7,
            "reference.from: expected a function, found a table",
        ),
        (
            REFERENCE,
            "x:reference { image = \"a.exr\",\n  stop = stop.waves(1) }",
            7,
            "reference.stop: `stop` does not apply to an `image`",
        ),
        (
            REFERENCE,
            "x:reference { stop = stop.waves(1), halves = 2 }",
            6,
            "reference.halves: unknown key `halves`",
        ),
        (
            REFERENCE,
            "x:reference { stop = stop.any {\n  stop.waves(1),\n  stop.when(\"rmse\", \"<\", 1) } }",
            8,
            "`rmse` cannot be compared here: a reference is not compared with anything",
        ),
        (
            REFERENCE,
            "x:reference { stop = stop.waves(1) }\nx:reference { stop = stop.waves(1) }",
            7,
            "called twice: an experiment has one reference",
        ),
    ]);
}

#[test]
fn invalid_measurements_are_reported_with_line_and_hint() {
    expect(&[
        (
            MEASURE,
            "x:measure { rmse = metric.rsme() }",
            7,
            "metric.rsme: unknown name `rsme` (did you mean `rmse`?)",
        ),
        (
            MEASURE,
            "x:measure { rmse = metrics.rmse() }",
            7,
            "metrics: unknown global `metrics` (did you mean `metric`?)",
        ),
        (
            MEASURE,
            "x:measure { rmse = metric.rmse }",
            7,
            "expected a metric, found a function (add parentheses: metric.rmse()",
        ),
        (
            MEASURE,
            "x:measure {\n  evry = \"1s\" }",
            8,
            "measure.evry: expected a metric, found a string (did you mean `every`?)",
        ),
        (
            MEASURE,
            "x:measure {\n\n  every = \"1 week\" }",
            9,
            "measure.every: `1 week` is not a duration",
        ),
        (
            MEASURE,
            "x:measure { every = 0 }",
            7,
            "measure.every: 0 s is too short",
        ),
        (
            MEASURE,
            "x:measure { samples = metric.rmse() }",
            7,
            "`samples` is always recorded",
        ),
        (
            MEASURE,
            "x:measure { keep = { exr = \"pow3\" } }",
            7,
            "measure.keep.exr: unknown value `pow3`",
        ),
        (
            MEASURE,
            "x:measure { keep = {\n  jpg = { \"last\" } } }",
            8,
            "measure.keep.jpg: unknown key `jpg`",
        ),
        (
            MEASURE,
            "x:measure { display = \"srgb\" }",
            7,
            "measure.display: expected a tone map",
        ),
        (
            MEASURE,
            "x:measure { display = tonemap.reinhart {} }",
            7,
            "did you mean `reinhard`?",
        ),
        (
            MEASURE,
            "x:measure { display = tonemap.srgb {\n    exposre = 1 } }",
            8,
            "tonemap.srgb.exposre: unknown key",
        ),
        (
            MEASURE,
            "x:measure { relmse = metric.relmse {\n    eps = -1 } }",
            8,
            "metric.relmse.eps: -1 is out of range",
        ),
        (
            MEASURE,
            "x:measure { ssim = metric.ssim { on = 1 } }",
            7,
            "metric.ssim.on: expected a tone map",
        ),
        (
            MEASURE,
            "x:measure {}\nx:measure {}",
            8,
            "called twice: the first call is in line 7",
        ),
    ]);
}

#[test]
fn errors_in_render_tables_have_the_line_of_their_key() {
    let good = "  return { scene = \"s.scn\", integrator = \"bpt\", max_depth = p.depth }";
    let with = |more: &str| good.replace(" }", &format!(",\n{more} }}"));
    for (line_4, line, expected) in [
        (
            with("    max_dept = 3"),
            5,
            "render.max_dept: unknown key `max_dept` (did you mean `max_depth`?)",
        ),
        (
            with("    aa = { filter = \"box\",\n      raduis = 1 }"),
            6,
            "render.aa.raduis: unknown key `raduis` (did you mean `radius`?)",
        ),
        (
            with("    aa = { radius = 17 }"),
            5,
            "render.aa.radius: 17 is out of range",
        ),
        (
            with("    aa = { filter = \"gaus\" }"),
            5,
            "did you mean `gauss`?",
        ),
        (with("    sampler = \"sobel\""), 5, "did you mean `sobol`?"),
        (
            with("    resolution = { 64 }"),
            5,
            "render.resolution: expected 2 numbers",
        ),
        (
            with("    resolution = { 64, 0.5 }"),
            5,
            "render.resolution[2]: 0.5 is out of range",
        ),
        (
            with("    resolution = { 64, 64.5 }"),
            5,
            "a whole number of pixels",
        ),
        (
            with("    camera = {\n      fov = 190 }"),
            6,
            "render.camera.fov: 190 is out of range",
        ),
        (
            with("    set = { [\"camera.fov\"] = 3 },\n    camera = { fov = 4 }"),
            6,
            "given twice: `set` also has `camera.fov`",
        ),
        (
            with("    set = {\n      [\"materials.egg.ior\"] = { x = 1 } }"),
            6,
            "render.set.materials.egg.ior: expected a value, found a table",
        ),
        (
            with("    set = { 1, 2 }"),
            5,
            "render.set: expected a table of changes by path",
        ),
        (with("    rr = {}"), 5, "`start` is missing"),
        (
            with("    backend = \"vulcan\""),
            5,
            "render.backend: unknown backend `vulcan`",
        ),
        (
            with("    aa = print"),
            5,
            "render.aa: expected plain data, found a function",
        ),
        (
            good.replace("\"bpt\"", "\n\"btp\""),
            4,
            "render.integrator: unknown integrator `btp` (did you mean `bpt`?)",
        ),
        (
            good.replace("\"bpt\"", "\"bpt\", strategies = \"all\""),
            4,
            "render.strategies: unknown key `strategies` (it is a key of `bdpt`, `guided_bdpt`)",
        ),
        (
            good.replace("\"bpt\"", "\"nee\", params = { mis = \"none\" }"),
            4,
            "render.params: unknown key `params` (parameters of a technique are keys of the same \
             table: integrator = \"nee\", mis = \"balance\")",
        ),
        (
            good.replace("\"bpt\"", "{ \"nee\" }"),
            4,
            "render.integrator: expected a name, found a list (parameters of a technique are keys \
             of the same table: integrator = \"nee\", mis = \"balance\")",
        ),
        (
            good.replace("\"s.scn\"", "\"t.scn\""),
            4,
            "render.scene: there is no file `t.scn` (did you mean `",
        ),
        (
            good.replace("\"s.scn\"", "\"elephant.glb\""),
            4,
            "render.scene: there is no file `elephant.glb` (tried elephant.glb and ",
        ),
        (
            good.replace("scene = \"s.scn\",", ""),
            4,
            "render: `scene` is missing",
        ),
        (
            good.replace("p.depth", "p.dpeth"),
            4,
            "p.dpeth: unknown axis `dpeth` (did you mean `depth`?)",
        ),
        (
            good.replace("p.depth", "p.depth + nil"),
            4,
            "attempt to perform arithmetic on a nil value",
        ),
        (
            "  local t = {}\n  t.scene = \"s.scn\"\n  t.integrater = \"bpt\"\n  return t"
                .to_owned(),
            6,
            "render.integrater: unknown key",
        ),
        (
            "  return 3".to_owned(),
            3,
            "the function returned an integer",
        ),
        (
            "  p.depth = nil; p.x = 1".to_owned(),
            4,
            "cannot be changed",
        ),
        (
            "  while true do end".to_owned(),
            4,
            "the render function ran longer than its limit of 1 s",
        ),
        (
            "  require(\"late\")".to_owned(),
            4,
            "cannot be loaded after the script has ended",
        ),
        (
            "  x:axis(\"late\", { 1 })".to_owned(),
            4,
            "already complete",
        ),
    ] {
        let folder = Folder::new(edited(good, &line_4));
        let script = folder.load().unwrap();
        let e = script
            .render(&vec![("depth".to_owned(), Value::Int(2))])
            .unwrap_err();
        let e = e.0.downcast_ref::<ScriptError>().unwrap();
        assert!(
            e.to_string().contains(expected),
            "{line_4}\n  found:    {e}\n  expected: {expected}"
        );
        assert_eq!(e.line(), Some(line), "{line_4}: {e}");
    }
}

#[test]
fn an_error_points_at_the_key() {
    let e = error_of(&edited(
        MEASURE,
        "x:measure { rmse = metric.rmse(),\n  keep = { exr = \"pow3\" } }",
    ));
    assert_eq!(e.line(), Some(8));
    assert_eq!(e.pointed_at(), Some("exr"));
}
