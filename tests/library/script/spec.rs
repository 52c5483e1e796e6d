//! The experiment that a correct script describes.

use lumbre_light::value::Value;
use lumbre_lua::Script;
use lumbre_metrics::tonemap::Tonemap;
use lumbre_night::experiment::spec::{
    FigureKind, FigureX, Order, RunColumn, Snapshots, TableFormat, TableValue, Warmup,
};

use crate::script::{Folder, GOOD, edited};

fn load(text: &str) -> Script {
    Folder::new(text).load().unwrap()
}

/// Returns the values of the only axis of a script with this axis line.
fn axis(values: &str) -> Vec<Value> {
    let script = load(&edited("{ 2, 5 }", values));
    script.spec.axes[0]
        .steps
        .iter()
        .map(|step| step[0].clone())
        .collect()
}

fn shown(values: &[Value]) -> String {
    values
        .iter()
        .map(Value::to_string)
        .collect::<Vec<_>>()
        .join(" ")
}

#[test]
fn name_seed_repeats_text_and_measurements_are_read() {
    let spec = load(GOOD).spec;
    assert_eq!((spec.name.as_str(), spec.seed, spec.repeats), ("t", 1, 2));
    assert_eq!(spec.script_text, GOOD);
    assert!(spec.script_file.ends_with("t.lua"));
    assert_eq!(spec.measure.every_s, 1.0);
    assert_eq!(spec.measure.snapshots, Snapshots::Last);
    assert_eq!(spec.measure.display, Tonemap::Srgb { exposure: 0.0 });
    assert_eq!(spec.measure.metrics[0].column, "rmse");
    let plain = load(&edited(", { seed = 1, repeats = 2 }", "")).spec;
    assert_eq!((plain.seed, plain.repeats), (0, 1));
}

#[test]
fn ranges_are_exact_and_whole_numbers_become_integers() {
    assert_eq!(shown(&axis("range(0.1, 0.5, 0.1)")), "0.1 0.2 0.3 0.4 0.5");
    assert_eq!(
        axis("range(1, 3)"),
        [Value::Int(1), Value::Int(2), Value::Int(3)]
    );
    assert_eq!(shown(&axis("range(1, 0.25, -0.25)")), "1 0.75 0.5 0.25");
    assert_eq!(
        shown(&axis("linspace(0, 1, 11)")),
        "0 0.1 0.2 0.3 0.4 0.5 0.6 0.7 0.8 0.9 1"
    );
    assert_eq!(
        shown(&axis("logspace(0.001, 1000, 7)")),
        "0.001 0.01 0.1 1 10 100 1000"
    );
    assert_eq!(axis("range(1, 100000)").len(), 100_000);
    assert_eq!(
        axis("{ 2.0, 'bpt', true, { 64, 48 } }"),
        [
            Value::Int(2),
            "bpt".into(),
            Value::Bool(true),
            Value::List(vec![Value::Int(64), Value::Int(48)]),
        ]
    );
}

#[test]
fn zipped_axes_move_together_in_the_order_of_their_names() {
    let script = load(&edited(
        "x:axis(\"depth\", { 2, 5 })",
        "x:axis({ \"depth\", \"radius\" }, zip({ 3, 5 }, range(0.5, 1, 0.5)))\nx:axis(\"scene\", { \"a\" })",
    ));
    let [zipped, scene] = script.spec.axes.as_slice() else {
        panic!("expected two axes")
    };
    assert_eq!(zipped.names, ["depth", "radius"]);
    assert_eq!(
        zipped.steps,
        [
            vec![Value::Int(3), Value::Num(0.5)],
            vec![Value::Int(5), Value::Int(1)]
        ]
    );
    assert_eq!(scene.names, ["scene"]);
}

#[test]
fn measurements_figures_and_tables_are_read() {
    let more = "local display = tonemap.reinhard { exposure = 1 }
x:measure { rmse = metric.rmse(), ssim = metric.ssim { on = display, range = 1.0 }, keep = { exr = \"pow2\" },
            error = metric.relmse { eps = 0.02 }, display = display, every = 0.25 }
x:figure(\"convergence\", { x = \"samples\", y = { \"rmse\", \"ssim\" }, by = \"depth\" })
x:figure(\"plain\", { y = \"error\", facet = \"depth\" })
x:figure(\"over\", { x = \"depth\", y = { \"fps\", \"rmse\", time_to(\"ssim\", 0.95) }, only = { depth = 5 } })
x:table(\"time_to_0.95\", { value = time_to(\"ssim\", 0.95), rows = \"depth\", format = \"csv\" })
x:table(\"final\", { value = \"rmse\", rows = { \"depth\" }, format = { \"csv\", \"md\" } })
x:table(\"speed\", { value = \"mpaths_s\", rows = \"depth\", cols = {} })";
    let spec = load(&edited(
        "x:measure { rmse = metric.rmse(), every = \"1s\" }",
        more,
    ))
    .spec;
    let columns: Vec<&str> = spec
        .measure
        .metrics
        .iter()
        .map(|m| m.column.as_str())
        .collect();
    assert_eq!(columns, ["error", "rmse", "ssim"]);
    assert_eq!(spec.measure.metrics[0].row.name, "relmse");
    assert_eq!(
        spec.measure.metrics[2].tonemap(),
        Some(Tonemap::Reinhard {
            exposure: 1.0,
            gamma: 2.2
        })
    );
    assert_eq!(
        spec.measure.display,
        Tonemap::Reinhard {
            exposure: 1.0,
            gamma: 2.2
        }
    );
    assert_eq!(
        (spec.measure.snapshots, spec.measure.every_s),
        (Snapshots::Pow2, 0.25)
    );
    let [convergence, plain, over] = spec.figures.as_slice() else {
        panic!("expected three figures")
    };
    let y = vec!["rmse".to_owned(), "ssim".to_owned()];
    assert_eq!(
        convergence.kind,
        FigureKind::Convergence {
            x: FigureX::Samples,
            y
        }
    );
    assert_eq!(
        (convergence.by.as_deref(), convergence.only.len()),
        (Some("depth"), 0)
    );
    assert_eq!(
        plain.kind,
        FigureKind::Convergence {
            x: FigureX::RenderS,
            y: vec!["error".to_owned()]
        }
    );
    assert_eq!(plain.facet, ["depth".to_owned()]);
    let y = vec![
        TableValue::Run(RunColumn::Fps),
        TableValue::Metric("rmse".into()),
        TableValue::TimeTo {
            column: "ssim".into(),
            threshold: 0.95,
        },
    ];
    assert_eq!(
        over.kind,
        FigureKind::Sweep {
            over: "depth".into(),
            y
        }
    );
    assert_eq!(over.only, [("depth".to_owned(), vec![Value::Int(5)])]);
    let [time, last, speed] = spec.tables.as_slice() else {
        panic!("expected three tables")
    };
    assert_eq!(
        time.value,
        TableValue::TimeTo {
            column: "ssim".into(),
            threshold: 0.95
        }
    );
    assert_eq!(
        (time.formats.as_slice(), time.cols.len()),
        ([TableFormat::Csv].as_slice(), 0)
    );
    assert_eq!(
        (&last.value, last.formats.len()),
        (&TableValue::Metric("rmse".into()), 2)
    );
    assert_eq!(
        (&speed.value, speed.formats.len()),
        (&TableValue::Run(RunColumn::MpathsPerS), 2)
    );
}

#[test]
fn the_script_hash_depends_on_the_script_and_its_modules() {
    let with = |text: &str, module: &str| {
        let folder = Folder::new(text);
        folder.put("lib/a.lua", module);
        folder.load().unwrap().spec.script_hash
    };
    let text = format!("require('lib.a')\n{GOOD}");
    assert_eq!(with(&text, "return 1"), with(&text, "return 1"));
    assert_ne!(with(&text, "return 1"), with(&text, "return 2"));
    assert_ne!(with(GOOD, "return 1"), with(&text, "return 1"));
    let folder = Folder::new(GOOD);
    folder.put("other.lua", GOOD);
    let renamed = lumbre_lua::load(&folder.path("other.lua")).unwrap();
    assert_eq!(renamed.spec.script_hash, with(GOOD, "return 1"));
}

#[test]
fn an_experiment_needs_only_render_and_stop() {
    let text = "local x = experiment('small')\nx:render(function() return { scene = 's.scn', integrator = 'bpt' } end)\n\
                x:stop(stop.samples(1))\nreturn x";
    let spec = load(text).spec;
    assert!(spec.axes.is_empty() && spec.measure.metrics.is_empty() && spec.figures.is_empty());
}

#[test]
fn the_first_script_of_the_readme_loads() {
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/first_light.lua");
    let script = lumbre_lua::load(&file).unwrap();
    assert_eq!(script.spec.name, "first_light");
    assert_eq!(
        script
            .spec
            .axes
            .iter()
            .map(|a| a.steps.len())
            .product::<usize>(),
        3
    );
    assert_eq!(script.spec.figures.len(), 1);
    assert_eq!(script.spec.tables.len(), 1);
}

#[test]
fn order_warm_up_and_aa_check_are_read() {
    let with = |options: &str, more: &str| {
        let head = format!(", {{ seed = 1, repeats = 2, {options} }}");
        load(
            &edited(", { seed = 1, repeats = 2 }", &head)
                .replace("return x", &format!("{more}\nreturn x")),
        )
        .spec
    };
    let plain = with("", "");
    assert_eq!(
        (plain.night.order, plain.night.warmup, plain.aa_check),
        (Order::Interleave, None, false)
    );
    let spec = with(
        "order = \"interleave\", warmup = { time = \"500ms\" }",
        "x:control()",
    );
    assert_eq!(
        (spec.night.order, spec.night.warmup, spec.aa_check),
        (Order::Interleave, Some(Warmup::Time(0.5)), true)
    );
    let spec = with("order = \"shuffled\", warmup = { samples = 8 }", "");
    assert_eq!(
        (spec.night.order, spec.night.warmup),
        (Order::Shuffled, Some(Warmup::Samples(8)))
    );
    let wrong = [
        ("order = \"random\"", "shuffled"),
        ("warmup = {}", "expected `time` or `samples`, found neither"),
        ("warmup = { time = 1, samples = 2 }", "exclude each other"),
        ("warmup = { time = 0 }", "a time above 0"),
    ];
    for (options, expected) in wrong {
        let text = edited(", { seed = 1, repeats = 2 }", &format!(", {{ {options} }}"));
        let error = Folder::new(text).load().unwrap_err();
        assert!(
            error.to_string().contains(expected) || format!("{error:?}").contains(expected),
            "{options}: {error:?}"
        );
    }
}

#[test]
fn the_presentation_changes_no_plan() {
    let plain = load(GOOD);
    assert_eq!(plain.spec.report, Default::default());
    let report = "x:report { names = { bpt = \"paths\" }, colours = { bpt = \"#a1B2c3\" }, \
                  display = tonemap.srgb { exposure = 2 } }";
    let script = load(&edited("return x", &format!("{report}\nreturn x")));
    let shown = &script.spec.report;
    assert_eq!(shown.name("bpt"), "paths");
    assert_eq!(shown.name("nee"), "nee");
    assert_eq!(shown.colour("bpt"), Some("#a1B2c3"));
    assert_eq!(shown.display, Some(Tonemap::Srgb { exposure: 2.0 }));
    assert_eq!(script.spec.figures, plain.spec.figures);
}
