//! Errors in stop rules, figures and tables.

use super::errors::{REFERENCE, STOP, error_of, expect};
use crate::script::edited;

#[test]
fn invalid_stop_rules_are_reported_with_line_and_hint() {
    expect(&[
        (
            STOP,
            "x:stop(16)",
            8,
            "argument 1 (rule): expected a stop rule",
        ),
        (
            STOP,
            "x:stop(stop.sample(16))",
            8,
            "stop.sample: unknown name `sample` (did you mean `samples`?)",
        ),
        (
            STOP,
            "x:stop(stop.samples(0))",
            8,
            "stop.samples: argument 1 (count) is 0",
        ),
        (
            STOP,
            "x:stop(stop.samples(1.5))",
            8,
            "stop.samples: argument 1 (count) is 1.5",
        ),
        (
            STOP,
            "x:stop(stop.time(\"-3s\"))",
            8,
            "stop.time: `-3s` is not a duration above zero",
        ),
        (STOP, "x:stop(stop.time(0))", 8, "not a duration above zero"),
        (
            STOP,
            "x:stop(stop.when(\"rmse\", \"=\", 1))",
            8,
            "unknown comparison `=` (known: <, <=, >, >=)",
        ),
        (
            STOP,
            "x:stop(stop.any {\n  stop.when(\"rsme\", \"<\", 1) })",
            9,
            "unknown metric column `rsme` (did you mean `rmse`?)",
        ),
        (
            STOP,
            "x:stop(stop.when(\"rmse\", \"<\", 1, { hodl = 3 }))",
            8,
            "stop.when.hodl: unknown key",
        ),
        (
            STOP,
            "x:stop(stop.when(\"rmse\", \"<\", 1, { hold = 0 }))",
            8,
            "stop.when.hold: 0 is out of range",
        ),
        (
            STOP,
            "x:stop(stop.any {})",
            8,
            "stop.any: expected at least one rule",
        ),
        (
            STOP,
            "x:stop(stop.any(stop.waves(1), \"time\"))",
            8,
            "rule 2: expected a stop rule, found a string (write stop.time(..))",
        ),
        (
            STOP,
            "x:stop(stop.all { function() end })",
            8,
            "stop.predicate(f)",
        ),
        (
            STOP,
            "x:stop(stop.not_(1))",
            8,
            "stop.not_: argument 1 (rule)",
        ),
        (
            STOP,
            "x:stop(stop.predicate(true))",
            8,
            "argument 1 (f): expected a function, found a boolean",
        ),
        (
            STOP,
            "x:stop(stop.waves(1))\nx:stop(stop.waves(1))",
            9,
            "called twice: the first call is in line 8",
        ),
        (
            STOP,
            "local r = stop.waves(1)\nfor i = 1, 99 do r = stop.not_(r) end\nx:stop(r)",
            9,
            "nested more than 16 deep",
        ),
        (
            STOP,
            "local r = stop.waves(1)\nfor i = 1, 12 do r = stop.any(r, r) end\nx:stop(r)",
            9,
            "more than 256 rules",
        ),
        (
            REFERENCE,
            "\nx:skip(\"s\", function(p) end)\nx:skip(\"\", function(p) end)",
            8,
            "x:skip: the reason",
        ),
    ]);
    let without = edited(REFERENCE, "").replace(STOP, "x:stop(stop.when(\"rmse\", \"<\", 1))");
    let e = error_of(&without);
    assert_eq!(e.line(), Some(8), "{e}");
    assert!(
        e.to_string().contains("the script has no x:reference"),
        "{e}"
    );
}

#[test]
fn invalid_figures_and_tables_are_reported_with_line_and_hint() {
    let after = |text: &str| format!("{STOP}\n{text}");
    for (text, line, expected) in [
        (
            "x:figure(\"f\", {\n  y = \"rsme\" })",
            10,
            "figure.f.y: unknown metric column `rsme` (did you mean `rmse`?)",
        ),
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
        (
            "x:figure(\"f\", { y = \"rmse\", by = \"depth\", facet = \"depth\" })",
            9,
            "the axis `depth` is used twice",
        ),
        (
            "x:figure(\"f\", { y = {} })",
            9,
            "figure.f.y: no metric column",
        ),
        ("x:figure(\"f\", {})", 9, "`y` is missing"),
        (
            "x:figure(\"f\", { y = \"rmse\", x = \"time\" })",
            9,
            "figure.f.x: `time` is neither an axis of the sweep nor `render_s` or `samples` (known: depth, render_s, samples)",
        ),
        (
            "x:figure(\"f\", { y = \"rmse\", x = \"dept\" })",
            9,
            "(did you mean `depth`?)",
        ),
        (
            "x:figure(\"f\", { y = \"fsp\", x = \"depth\" })",
            9,
            "unknown metric column `fsp` (did you mean `fps`?)",
        ),
        (
            "x:figure(\"f\", { y = \"fps\", x = \"samples\" })",
            9,
            "figure.f.y: unknown metric column `fps`",
        ),
        (
            "x:figure(\"f\", { y = {}, x = \"depth\" })",
            9,
            "figure.f.y: nothing to draw",
        ),
        (
            "x:figure(\"f\", { y = { 3 }, x = \"depth\" })",
            9,
            "figure.f.y: expected the name of a column or time_to",
        ),
        (
            "x:figure(\"f\", { y = \"fps\", x = \"depth\", by = \"depth\" })",
            9,
            "the axis `depth` is used twice",
        ),
        (
            "x:figure(\"f\", { y = time_to(\"rmse\", 1) })",
            9,
            "one number per run and has no curve (draw it over an axis",
        ),
        (
            "x:figure(\"f\", { y = \"rmse\",\n  only = {\n    dept = 3 } })",
            11,
            "figure.f.only: there is no axis `dept` (did you mean `depth`?)",
        ),
        (
            "x:figure(\"f\", { y = \"rmse\", only = { depth = 4 } })",
            9,
            "only.depth: the axis `depth` has no value `4`",
        ),
        (
            "x:figure(\"f\", { y = \"rmse\", only = \"depth\" })",
            9,
            "figure.f.only: expected a table of axes with their values",
        ),
        (
            "x:figure(\"../f\", { y = \"rmse\" })",
            9,
            "`../f` cannot name a file",
        ),
        (
            "x:figure(\"f\", { y = \"rmse\" })\nx:figure(\"F\", { y = \"rmse\" })",
            10,
            "`F` is already defined in line 9",
        ),
        (
            "x:table(\"t\", { value = \"rmse\", rows = \"dpeth\" })",
            9,
            "table.t.rows: there is no axis `dpeth` (did you mean `depth`?)",
        ),
        (
            "x:table(\"t\", { value = \"mse\", rows = \"depth\" })",
            9,
            "table.t.value: unknown metric column `mse` (add mse = metric.mse() to x:measure)",
        ),
        (
            "x:table(\"t\", { value = time_to(\"ssim\", 0.9), rows = \"depth\" })",
            9,
            "unknown metric column `ssim` (add ssim = metric.ssim() to x:measure)",
        ),
        (
            "x:table(\"t\", { value = metric.rmse(), rows = \"depth\" })",
            9,
            "found a metric (use the name of a metric column",
        ),
        (
            "x:table(\"t\", { rows = \"depth\" })",
            9,
            "`value` is missing",
        ),
        (
            "x:table(\"t\", { value = \"samples\", rows = \"depth\", cols = \"depth\" })",
            9,
            "the axis `depth` is used twice",
        ),
        (
            "x:table(\"t\", { value = \"samples\", rows = \"depth\",\n  format = { \"tex\" } })",
            10,
            "table.t.format[1]: unknown value `tex`",
        ),
        (
            "x:order(\"interleave\")",
            9,
            "x.order: unknown name `order`",
        ),
    ] {
        let e = error_of(&edited(STOP, &after(text)));
        assert!(
            e.to_string().contains(expected),
            "{text}\n  found:    {e}\n  expected: {expected}"
        );
        assert_eq!(e.line(), Some(line), "{text}: {e}");
    }
    let e =
        error_of(&edited(REFERENCE, "").replace(STOP, &after("x:figure(\"f\", { y = \"rmse\" })")));
    assert!(e.to_string().contains("metrics need a reference"), "{e}");
}

#[test]
fn an_invalid_presentation_is_reported_with_line_and_key() {
    let with = |options: &str| format!("{STOP} x:report {options}");
    let cases = [
        ("{ name = { bpt = \"a\" } }", "did you mean `names`"),
        (
            "{ colours = { bpt = \"red\" } }",
            "report.colours.bpt: expected a colour",
        ),
        (
            "{ names = { bpt = \"\" } }",
            "report.names.bpt: expected a name",
        ),
        ("{ names = \"a\" }", "report.names: expected a name"),
        ("{ display = 3 }", "report.display"),
        ("{} x:report {}", "called twice"),
    ];
    let texts = cases.map(|(options, _)| with(options));
    for (text, (_, message)) in texts.iter().zip(cases) {
        expect(&[(STOP, text, 8, message)]);
    }
}
