//! Every class of error, with the line it points at, the path to the field, and what helps.

use lumbre::experiment::spec::ScriptHooks;
use lumbre::script::{Problem, ScriptError};
use lumbre::value::Value;
use miette::Diagnostic;

use crate::{Folder, GOOD, edited};

fn error_of(text: &str) -> ScriptError {
    match Folder::new(text).load() {
        Ok(script) => panic!("this script was taken: {}\n{text}", script.spec.name),
        Err(e) => e,
    }
}

/// Loads scripts that differ from the good one in one piece, and compares line and words of their errors.
fn expect(cases: &[(&str, &str, usize, &str)]) {
    for (from, to, line, words) in cases {
        let e = error_of(&edited(from, to));
        assert!(e.to_string().contains(words), "{to}\n  said: {e}\n  not:  {words}");
        assert_eq!(e.line(), Some(*line), "{to}: {e}");
    }
}

const AXIS: &str = "x:axis(\"depth\", { 2, 5 })";
const REFERENCE: &str = "x:reference { stop = stop.samples(64) }";
const MEASURE: &str = "x:measure { rmse = metric.rmse(), every = \"1s\" }";
const STOP: &str = "x:stop(stop.samples(16))";

#[test]
fn the_good_script_is_good() {
    assert!(Folder::new(GOOD).load().is_ok());
}

#[test]
fn wrong_experiments() {
    expect(&[
        ("seed = 1", "sed = 1", 1, "experiment.sed: unknown key `sed` (did you mean `seed`?)"),
        ("seed = 1", "seed = -1", 1, "experiment.seed: -1 is out of range"),
        ("seed = 1", "seed = 1.5", 1, "experiment.seed: expected an integer"),
        ("seed = 1", "seed = 0/0", 1, "experiment.seed: the number is NaN"),
        ("\"t\"", "\"a b\"", 1, "cannot name an experiment"),
        ("\"t\"", "7", 1, "argument 1 (name): expected a string, found an integer"),
        ("return x", "experiment(\"u\")\nreturn x", 9, "the first is in line 1"),
        ("return x", "", 8, "returned nothing: end it with `return x`"),
        ("return x", "return 7", 9, "returned an integer: end it with `return x`"),
        ("return x", "return { x }", 9, "returned a table"),
        (STOP, "", 1, "never says when a cell is finished"),
    ]);
    let e = error_of("local y = 1\n");
    assert!(e.to_string().contains("begin with: local x = experiment"), "{e}");
    let e = error_of("");
    assert!(matches!(e.problem(), Problem::NoExperiment { .. }), "{e}");
    let e = error_of("local x = experiment('t')\nx:stop(stop.samples(1))\nreturn x\n");
    assert!(e.to_string().contains("never says what to render"), "{e}");
}

#[test]
fn wrong_axes() {
    expect(&[
        (AXIS, "x:axis(\"depth\", {})", 2, "axis.depth has no values"),
        (AXIS, "x:axis(\"depth\", 3)", 2, "argument 2 (values): expected a table, found an integer"),
        (AXIS, "x:axis(\"depth\", { 2, 2.0 })", 2, "axis.depth[2] repeats the value `2` of [1]"),
        (AXIS, "x:axis(\"depth\", { 2, print })", 2, "axis.depth[2]: expected plain data, found a function"),
        (AXIS, "x:axis(\"depth\", { 2, 1/0 })", 2, "axis.depth[2]: inf is not finite"),
        (AXIS, "x:axis(\"depth\", { 2, { a = 1 } })", 2, "found a table"),
        (AXIS, "x:axis(\"de pth\", { 2 })", 2, "`de pth` cannot name an axis"),
        (AXIS, "x:axis(\"rep\", { 2 })", 2, "`rep` cannot name an axis"),
        (AXIS, "x:axis(\"depth\", { 2 })\nx:axis(\"depth\", { 3 })", 3, "already an axis `depth`"),
        (AXIS, "x:axis({ \"depth\", \"r\" }, zip({ 1, 2 }, { 1 }))", 2, "the lists differ in length: [2, 1]"),
        (AXIS, "x:axis({ \"depth\", \"r\" }, { { 1, 2 }, 3 })", 2, "[2] is `3`: expected 2 values"),
        (AXIS, "x:axis(zip { depth = { 1 }, r = { 2 } }, { 1 })", 2, "expected at least two lists"),
        (AXIS, "x:axis(\"depth\", range(0, 1, 0))", 2, "the step is zero"),
        (AXIS, "x:axis(\"depth\", range(0, 1e6))", 2, "an axis has at most 100000"),
        (AXIS, "x:axis(\"depth\", range(5, 1))", 2, "is empty"),
        (AXIS, "x:axis(\"depth\", linspace(0, 1, 1))", 2, "argument 3 (count) is 1"),
        (AXIS, "x:axis(\"depth\", logspace(0, 1, 3))", 2, "both ends must be above zero"),
        (AXIS, "x:axsi(\"depth\", { 2 })", 2, "x.axsi: unknown name `axsi` (did you mean `axis`?)"),
        (AXIS, "x.axis(\"depth\", { 2 })", 2, "write `x:axis(..)` with a colon"),
        (AXIS, "x:axis(\"depth\", { 2 }, 3)", 2, "expected at most 2 arguments, found 3"),
    ]);
}

#[test]
fn wrong_references() {
    expect(&[
        (REFERENCE, "x:reference {}", 6, "reference: `stop` is missing"),
        (REFERENCE, "x:reference { stop = 64 }", 6, "reference.stop: expected a stop rule, found an integer"),
        (
            REFERENCE,
            "x:reference {\n  from = { max_depth = 9 },\n  stop = stop.samples(1),\n}",
            7,
            "reference.from: expected a function, found a table",
        ),
        (REFERENCE, "x:reference { image = \"a.exr\",\n  stop = stop.waves(1) }", 7, "an image is finished"),
        (REFERENCE, "x:reference { stop = stop.waves(1), halves = 2 }", 6, "reference.halves: unknown key `halves`"),
        (
            REFERENCE,
            "x:reference { stop = stop.any {\n  stop.waves(1),\n  stop.when(\"rmse\", \"<\", 1) } }",
            8,
            "`rmse` cannot be compared here: a reference is not measured",
        ),
        (REFERENCE, "x:reference { stop = stop.waves(1) }\nx:reference { stop = stop.waves(1) }", 7, "said twice"),
    ]);
}

#[test]
fn wrong_measurements() {
    expect(&[
        (MEASURE, "x:measure { rmse = metric.rsme() }", 7, "metric.rsme: unknown name `rsme` (did you mean `rmse`?)"),
        (
            MEASURE,
            "x:measure { rmse = metrics.rmse() }",
            7,
            "metrics: unknown global `metrics` (did you mean `metric`?)",
        ),
        (MEASURE, "x:measure { rmse = metric.rmse }", 7, "expected a metric, found a function (metrics are called"),
        (
            MEASURE,
            "x:measure {\n  evry = \"1s\" }",
            8,
            "measure.evry: expected a metric, found a string (did you mean `every`?)",
        ),
        (MEASURE, "x:measure {\n\n  every = \"1 week\" }", 9, "measure.every: `1 week` is no duration"),
        (MEASURE, "x:measure { every = 0 }", 7, "measure.every: 0 s is too short"),
        (MEASURE, "x:measure { samples = metric.rmse() }", 7, "`samples` is always recorded"),
        (MEASURE, "x:measure { keep = { exr = \"pow3\" } }", 7, "measure.keep.exr: unknown word `pow3`"),
        (MEASURE, "x:measure { keep = {\n  jpg = { \"last\" } } }", 8, "measure.keep.jpg: unknown key `jpg`"),
        (MEASURE, "x:measure { display = \"srgb\" }", 7, "measure.display: expected a tone map"),
        (MEASURE, "x:measure { display = tonemap.reinhart {} }", 7, "did you mean `reinhard`?"),
        (MEASURE, "x:measure { display = tonemap.srgb {\n    exposre = 1 } }", 8, "tonemap.srgb.exposre: unknown key"),
        (MEASURE, "x:measure { relmse = metric.relmse {\n    eps = -1 } }", 8, "metric.relmse.eps: -1 is out of range"),
        (MEASURE, "x:measure { ssim = metric.ssim { on = 1 } }", 7, "metric.ssim.on: expected a tone map"),
        (MEASURE, "x:measure {}\nx:measure {}", 8, "said twice: the first is in line 7"),
    ]);
}

#[test]
fn wrong_stop_rules() {
    expect(&[
        (STOP, "x:stop(16)", 8, "argument 1 (rule): expected a stop rule"),
        (STOP, "x:stop(stop.sample(16))", 8, "stop.sample: unknown name `sample` (did you mean `samples`?)"),
        (STOP, "x:stop(stop.samples(0))", 8, "stop.samples: argument 1 (count) is 0"),
        (STOP, "x:stop(stop.samples(1.5))", 8, "stop.samples: argument 1 (count) is 1.5"),
        (STOP, "x:stop(stop.time(\"-3s\"))", 8, "stop.time: `-3s` is no duration above zero"),
        (STOP, "x:stop(stop.time(0))", 8, "no duration above zero"),
        (STOP, "x:stop(stop.when(\"rmse\", \"=\", 1))", 8, "unknown comparison `=` (known: <, <=, >, >=)"),
        (
            STOP,
            "x:stop(stop.any {\n  stop.when(\"rsme\", \"<\", 1) })",
            9,
            "unknown metric column `rsme` (did you mean `rmse`?)",
        ),
        (STOP, "x:stop(stop.when(\"rmse\", \"<\", 1, { hodl = 3 }))", 8, "stop.when.hodl: unknown key"),
        (STOP, "x:stop(stop.when(\"rmse\", \"<\", 1, { hold = 0 }))", 8, "stop.when.hold: 0 is out of range"),
        (STOP, "x:stop(stop.any {})", 8, "stop.any: expected at least one rule"),
        (
            STOP,
            "x:stop(stop.any(stop.waves(1), \"time\"))",
            8,
            "rule 2: expected a stop rule, found a string (write stop.time(..))",
        ),
        (STOP, "x:stop(stop.all { function() end })", 8, "stop.predicate(f)"),
        (STOP, "x:stop(stop.not_(1))", 8, "stop.not_: argument 1 (rule)"),
        (STOP, "x:stop(stop.predicate(true))", 8, "argument 1 (f): expected a function, found a boolean"),
        (STOP, "x:stop(stop.waves(1))\nx:stop(stop.waves(1))", 9, "said twice: the first is in line 8"),
        (
            STOP,
            "local r = stop.waves(1)\nfor i = 1, 99 do r = stop.not_(r) end\nx:stop(r)",
            9,
            "nested more than 16 deep",
        ),
        (STOP, "local r = stop.waves(1)\nfor i = 1, 12 do r = stop.any(r, r) end\nx:stop(r)", 9, "more than 256 parts"),
        (REFERENCE, "\nx:skip(\"s\", function(p) end)\nx:skip(\"\", function(p) end)", 8, "x:skip: the reason"),
    ]);
    let without = edited(REFERENCE, "").replace(STOP, "x:stop(stop.when(\"rmse\", \"<\", 1))");
    let e = error_of(&without);
    assert_eq!(e.line(), Some(8), "{e}");
    assert!(e.to_string().contains("the script has no x:reference"), "{e}");
}

#[test]
fn wrong_reports() {
    let after = |text: &str| format!("{STOP}\n{text}");
    for (text, line, words) in [
        ("x:figure(\"f\", {\n  y = \"rsme\" })", 10, "figure.f.y: unknown metric column `rsme` (did you mean `rmse`?)"),
        (
            "x:figure(\"f\", {\n  y = { \"rmse\" },\n  by = \"dept\" })",
            11,
            "figure.f.by: there is no axis `dept` (did you mean `depth`?)",
        ),
        (
            "x:figure(\"f\", { y = \"rmse\", facet = { \"radius\" } })",
            9,
            "figure.f.facet: there is no axis `radius` (axes: depth)",
        ),
        ("x:figure(\"f\", { y = \"rmse\", by = \"depth\", facet = \"depth\" })", 9, "`depth` stands there twice"),
        ("x:figure(\"f\", { y = {} })", 9, "figure.f.y: no metric column"),
        ("x:figure(\"f\", {})", 9, "`y` is missing"),
        (
            "x:figure(\"f\", { y = \"rmse\", x = \"time\" })",
            9,
            "figure.f.x: `time` is neither an axis of the sweep nor `render_s` or `samples` (known: depth, render_s, samples)",
        ),
        ("x:figure(\"f\", { y = \"rmse\", x = \"dept\" })", 9, "(did you mean `depth`?)"),
        ("x:figure(\"f\", { y = \"fsp\", x = \"depth\" })", 9, "unknown metric column `fsp` (did you mean `fps`?)"),
        ("x:figure(\"f\", { y = \"fps\", x = \"samples\" })", 9, "figure.f.y: unknown metric column `fps`"),
        ("x:figure(\"f\", { y = {}, x = \"depth\" })", 9, "figure.f.y: nothing to draw"),
        ("x:figure(\"f\", { y = { 3 }, x = \"depth\" })", 9, "figure.f.y: expected the name of a column or time_to"),
        ("x:figure(\"f\", { y = \"fps\", x = \"depth\", by = \"depth\" })", 9, "`depth` stands there twice"),
        ("x:figure(\"f\", { y = time_to(\"rmse\", 1) })", 9, "one number for each run (draw them over an axis"),
        (
            "x:figure(\"f\", { y = \"rmse\",\n  only = {\n    dept = 3 } })",
            11,
            "figure.f.only: there is no axis `dept` (did you mean `depth`?)",
        ),
        ("x:figure(\"f\", { y = \"rmse\", only = { depth = 4 } })", 9, "only.depth: the axis `depth` has no value `4`"),
        ("x:figure(\"f\", { y = \"rmse\", only = \"depth\" })", 9, "figure.f.only: expected axes with their values"),
        ("x:figure(\"../f\", { y = \"rmse\" })", 9, "`../f` cannot name a file"),
        ("x:figure(\"f\", { y = \"rmse\" })\nx:figure(\"F\", { y = \"rmse\" })", 10, "`F` is already there, in line 9"),
        (
            "x:table(\"t\", { value = \"rmse\", rows = \"dpeth\" })",
            9,
            "table.t.rows: there is no axis `dpeth` (did you mean `depth`?)",
        ),
        ("x:table(\"t\", { value = \"mse\", rows = \"depth\" })", 9, "table.t.value: unknown metric column `mse`"),
        ("x:table(\"t\", { value = time_to(\"ssim\", 0.9), rows = \"depth\" })", 9, "unknown metric column `ssim`"),
        (
            "x:table(\"t\", { value = metric.rmse(), rows = \"depth\" })",
            9,
            "found a metric (a metric is named by its column",
        ),
        ("x:table(\"t\", { rows = \"depth\" })", 9, "`value` is missing"),
        ("x:table(\"t\", { value = \"samples\", rows = \"depth\", cols = \"depth\" })", 9, "stands there twice"),
        (
            "x:table(\"t\", { value = \"samples\", rows = \"depth\",\n  format = { \"tex\" } })",
            10,
            "table.t.format[1]: unknown word `tex`",
        ),
        ("x:order(\"interleave\")", 9, "x.order: unknown name `order`"),
    ] {
        let e = error_of(&edited(STOP, &after(text)));
        assert!(e.to_string().contains(words), "{text}\n  said: {e}\n  not:  {words}");
        assert_eq!(e.line(), Some(line), "{text}: {e}");
    }
    let e = error_of(&edited(REFERENCE, "").replace(STOP, &after("x:figure(\"f\", { y = \"rmse\" })")));
    assert!(e.to_string().contains("metrics need a reference"), "{e}");
}

#[test]
fn wrong_render_tables_point_at_the_key() {
    let good = "  return { scene = \"s.scn\", integrator = \"bpt\", max_depth = p.depth }";
    let with = |more: &str| good.replace(" }", &format!(",\n{more} }}"));
    for (line_4, line, words) in [
        (with("    max_dept = 3"), 5, "render.max_dept: unknown key `max_dept` (did you mean `max_depth`?)"),
        (
            with("    aa = { filter = \"box\",\n      raduis = 1 }"),
            6,
            "render.aa.raduis: unknown key `raduis` (did you mean `radius`?)",
        ),
        (with("    aa = { radius = 17 }"), 5, "render.aa.radius: 17 is out of range"),
        (with("    aa = { filter = \"gaus\" }"), 5, "did you mean `gauss`?"),
        (with("    sampler = \"sobel\""), 5, "did you mean `sobol`?"),
        (with("    resolution = { 64 }"), 5, "render.resolution: expected 2 numbers"),
        (with("    resolution = { 64, 0.5 }"), 5, "render.resolution[2]: 0.5 is out of range"),
        (with("    resolution = { 64, 64.5 }"), 5, "a whole number of pixels"),
        (with("    camera = {\n      fov = 190 }"), 6, "render.camera.fov: 190 is out of range"),
        (with("    set = { [\"camera.fov\"] = 3 },\n    camera = { fov = 4 }"), 6, "said twice"),
        (
            with("    set = {\n      [\"materials.egg.ior\"] = { x = 1 } }"),
            6,
            "render.set.materials.egg.ior: expected a value, found a table",
        ),
        (with("    set = { 1, 2 }"), 5, "render.set: expected a table of changes by path"),
        (with("    rr = {}"), 5, "`start` is missing"),
        (with("    backend = \"vulcan\""), 5, "render.backend: unknown backend `vulcan`"),
        (with("    aa = print"), 5, "render.aa: expected plain data, found a function"),
        (good.replace("\"bpt\"", "\n\"btp\""), 4, "render.integrator: unknown integrator `btp` (did you mean `bpt`?)"),
        (good.replace("\"s.scn\"", "\"t.scn\""), 4, "render.scene: there is no file `t.scn` (tried t.scn and "),
        (good.replace("scene = \"s.scn\",", ""), 4, "render: `scene` is missing"),
        (good.replace("p.depth", "p.dpeth"), 4, "p.dpeth: unknown axis `dpeth` (did you mean `depth`?)"),
        (good.replace("p.depth", "p.depth + nil"), 4, "attempt to perform arithmetic on a nil value"),
        (
            "  local t = {}\n  t.scene = \"s.scn\"\n  t.integrater = \"bpt\"\n  return t".to_owned(),
            6,
            "render.integrater: unknown key",
        ),
        ("  return 3".to_owned(), 3, "the function returned an integer"),
        ("  p.depth = nil; p.x = 1".to_owned(), 4, "cannot be changed"),
        ("  while true do end".to_owned(), 4, "the render function ran longer than its limit of 1 s"),
        ("  require(\"late\")".to_owned(), 4, "can no longer be loaded"),
        ("  x:axis(\"late\", { 1 })".to_owned(), 4, "already described"),
    ] {
        let folder = Folder::new(edited(good, &line_4));
        let script = folder.load().unwrap();
        let e = script.render(&vec![("depth".to_owned(), Value::Int(2))]).unwrap_err();
        let e = e.0.downcast_ref::<ScriptError>().unwrap();
        assert!(e.to_string().contains(words), "{line_4}\n  said: {e}\n  not:  {words}");
        assert_eq!(e.line(), Some(line), "{line_4}: {e}");
    }
}

#[test]
fn errors_of_lua_itself_have_lines() {
    let e = error_of("local x = = 1\n");
    assert!(matches!(e.problem(), Problem::Syntax { .. }), "{e}");
    assert_eq!(e.line(), Some(1));
    let e = error_of("local x = 1\nlocal y = {\n\n");
    assert!(matches!(e.problem(), Problem::Syntax { .. }) && e.line() == Some(4), "{e}");
    for (text, line, words) in [
        ("local t\nlocal y = t.z\n", 2, "attempt to index a nil value"),
        ("\n\nerror(\"my own words\")", 3, "my own words"),
        ("\nerror({ code = 1 })", 2, ""),
        ("\nerror()", 2, ""),
        ("\nlocal s = (\"x\"):rpe(3)", 2, "string.rpe: unknown name `rpe` (did you mean `rep`?)"),
        ("\ntable.concat({ {} })", 2, "invalid value (table) at index 1"),
        ("\nlocal y = 1 + ('x'):find()", 2, "bad argument #2 to 'string.find' (string expected"),
        ("local function f() return f() + 1 end\nf()", 1, "stack overflow"),
    ] {
        let e = error_of(text);
        assert!(matches!(e.problem(), Problem::Runtime { .. } | Problem::Field { .. }), "{text}: {e}");
        assert!(e.to_string().contains(words), "{text}: {e}");
        assert_eq!(e.line(), Some(line), "{text}: {e}");
    }
}

#[test]
fn errors_in_modules_point_into_the_module() {
    let folder = Folder::new("local lib = require(\"lib.scenes\")\nreturn lib\n");
    folder.put("lib/scenes.lua", "local a = 1\nlocal b = metrics.rmse\n");
    let e = folder.load().unwrap_err();
    assert_eq!((e.line(), e.file()), (Some(2), folder.path("lib/scenes.lua").as_path()), "{e}");
    folder.put("lib/scenes.lua", "local a = 1\nlocal b = = 2\n");
    let e = folder.load().unwrap_err();
    assert!(matches!(e.problem(), Problem::Syntax { .. }), "{e}");
    assert_eq!((e.line(), e.file()), (Some(2), folder.path("lib/scenes.lua").as_path()), "{e}");
}

#[test]
fn files_that_are_no_scripts() {
    let folder = Folder::new("x");
    let at = |name: &str| lumbre::script::load(&folder.path(name)).unwrap_err();
    assert!(matches!(at("none.lua").problem(), Problem::Unreadable { .. }));
    assert!(matches!(at("").problem(), Problem::Unreadable { .. }), "a folder");
    folder.put("big.lua", vec![b'-'; (4 << 20) + 1]);
    assert!(matches!(at("big.lua").problem(), Problem::TooLarge { bytes, .. } if *bytes == (4 << 20) + 1));
    #[cfg(target_os = "linux")]
    {
        std::os::unix::fs::symlink("/proc/version", folder.path("system.lua")).unwrap();
        assert!(!matches!(at("system.lua").problem(), Problem::Syntax { .. }), "it has no length, so nothing is read");
    }
    folder.put("code.lua", b"\x1bLua\x54");
    assert!(at("code.lua").to_string().contains("bytecode"));
    folder.put("latin.lua", b"-- one\n-- caf\xe9\n");
    assert!(at("latin.lua").to_string().contains("byte 14 in line 2 is not UTF-8"), "{}", at("latin.lua"));
    folder.put("bom.lua", format!("\u{feff}{GOOD}"));
    assert!(lumbre::script::load(&folder.path("bom.lua")).is_ok());
}

#[test]
fn diagnostics_show_the_line() {
    let e = error_of(&edited(MEASURE, "x:measure { rmse = metric.rmse(),\n  keep = { exr = \"pow3\" } }"));
    assert_eq!(e.pointed_at(), Some("exr"));
    assert_eq!(e.code().unwrap().to_string(), "script::field");
    let mut shown = String::new();
    let theme = miette::GraphicalTheme::unicode_nocolor();
    miette::GraphicalReportHandler::new_themed(theme).render_report(&mut shown, &e).unwrap();
    assert!(shown.contains("t.lua:8:12"), "{shown}");
    assert_eq!(shown.matches("known: last, pow2").count(), 1, "{shown}");
    assert!(shown.contains("keep = { exr = \"pow3\" } }"), "{shown}");
}
