//! `lumbre new` and `lumbre compare`: experiments made from a scene.

use serde_json::Value as Json;

use super::workplace::Workplace;

#[test]
fn a_new_script_is_complete_and_never_replaces_a_file() {
    let place = Workplace::new();
    let args = [
        "new",
        "ball.scn",
        "--yes",
        "--technique",
        "bpt,nee",
        "--time",
        "1.5s",
        "--repeats",
        "3",
        "--depth",
        "4",
        "camera.fov=30",
    ];
    let output = place.succeed(&args);
    assert_eq!(output.stdout, "ball.lua\n");
    let script = place.read("ball.lua");
    for line in [
        "scene = \"ball.scn\",",
        "integrator = p.technique,",
        "max_depth = 4,",
        "set = { [\"camera.fov\"] = 30 },",
        "x:stop(stop.time(\"1.5s\"))",
        "stop = stop.time(\"12s\"),",
    ] {
        assert!(script.contains(line), "{line} is missing in\n{script}");
    }
    let plan = place.succeed(&["plan", "ball.lua", "--backend", "cpu"]);
    assert!(plan.stdout.contains("6 cells"), "{}", plan.stdout);
    let again = place.fail(2, &args);
    assert!(again.contains("ball.lua exists already"), "{again}");
    let unknown = place.fail(
        2,
        &["new", "ball.scn", "-y", "-t", "nee,bdtp", "-o", "b.lua"],
    );
    assert!(unknown.contains("did you mean `bdpt`"), "{unknown}");
}

#[test]
fn a_parameter_of_some_techniques_is_given_to_those() {
    let place = Workplace::new();
    let written = |name: &str, reference: &str| {
        let args = [
            "new",
            "ball.scn",
            "--yes",
            "--technique",
            "bpt,nee,bdpt",
            "--reference",
            reference,
            "--output",
            name,
            "select=uniform",
            "max_depth=3",
        ];
        place.succeed(&args);
        let planned = place.succeed(&["plan", name, "--backend", "cpu"]).stdout;
        (place.read(name), planned)
    };
    let (script, planned) = written("a.lua", "bdpt");
    for lines in [
        "    max_depth = 3,\n  }\n",
        "  if p.technique == \"bdpt\" then\n    settings.select = \"uniform\"\n  end\n",
        "  if p.technique == \"nee\" then\n    settings.select = \"uniform\"\n  end\n",
        "from = function() return { integrator = \"bdpt\", select = \"uniform\" } end",
    ] {
        assert!(script.contains(lines), "{lines} is missing in\n{script}");
    }
    assert!(!script.contains("technique == \"bpt\""), "{script}");
    // All techniques have one reference.
    assert!(planned.contains(" 1 reference"), "{planned}");
    let (script, planned) = written("b.lua", "bpt");
    assert!(
        script.contains("return { integrator = \"bpt\" } end"),
        "{script}"
    );
    assert!(planned.contains(" 1 reference"), "{planned}");
    let unknown = place.fail(2, &["compare", "ball.scn", "variant=llvm_ad_rgb"]);
    assert!(unknown.contains("unknown key `variant`"), "{unknown}");
}

/// Next event estimation is many times as efficient as `bpt` under a small lamp, which no timing on
/// a busy machine turns around.
#[test]
fn a_comparison_ends_with_a_verdict_and_its_interval() {
    let place = Workplace::new();
    let args = [
        "compare",
        "ball.scn",
        "--technique",
        "bpt,nee",
        "--time",
        "0.2s",
        "--repeats",
        "4",
        "--size",
        "24x16",
        "--backend",
        "cpu",
        "--no-tui",
    ];
    let output = place.succeed(&args);
    assert!(
        output.stdout.contains("nee is ")
            && output.stdout.contains(" times as efficient as bpt (95 %: "),
        "{}",
        output.stdout
    );
    assert!(output.stdout.contains("script: out/scripts/ball.lua"));
    // Nothing is rendered again.
    let mut json = args.to_vec();
    json.extend(["--json", "-q"]);
    let output = place.succeed(&json);
    let verdict: Json = serde_json::from_str(&output.stdout).unwrap();
    let verdicts = verdict["verdicts"].as_array().unwrap();
    assert_eq!(verdicts.len(), 1);
    assert_eq!(verdicts[0]["better"], "nee");
    assert_eq!(verdicts[0]["significant"], true);
    let techniques = verdict["techniques"].as_array().unwrap();
    for technique in techniques {
        assert_eq!(technique["efficiencies"].as_array().unwrap().len(), 4);
    }
    // The night is that of a script, which other verbs find.
    let explained = place.succeed(&["show", "latest", "--why"]).stdout;
    assert!(explained.contains("technique="), "{explained}");
    let retried = place.succeed(&["run", "--retry"]);
    assert!(
        retried.stderr.contains("nothing to do"),
        "{}",
        retried.stderr
    );
    let single = place.fail(2, &["compare", "ball.scn", "--technique", "nee"]);
    assert!(single.contains("two techniques or more"), "{single}");
}

#[test]
fn a_biased_technique_renders_no_reference_unless_it_is_named() {
    let place = Workplace::new();
    let reference = |techniques: &str, more: &[&str]| {
        let file = format!("{techniques}.lua");
        let args = ["new", "ball.scn", "-y", "-t", techniques, "-o", &file];
        place.succeed(&[&args, more].concat());
        let script = place.read(&file);
        let line = script
            .lines()
            .find(|line| line.contains("from = "))
            .unwrap();
        line.split('"').nth(1).unwrap().to_owned()
    };
    assert_eq!(reference("nee,sppm", &[]), "nee");
    assert_eq!(reference("bdpt,nee,vcm", &[]), "nee");
    assert_eq!(reference("sppm,vcm", &[]), "bdpt");
    assert_eq!(reference("bpt,sppm", &["--reference", "sppm"]), "sppm");
    let short = [
        "compare",
        "ball.scn",
        "-t",
        "nee,sppm",
        "--time",
        "0.05s",
        "--size",
        "12x8",
        "--repeats",
        "2",
        "--backend",
        "cpu",
    ];
    let biased = [&short[..], &["--reference", "sppm"]].concat();
    let ended = place.succeed(&biased);
    assert!(
        ended
            .stdout
            .contains("warning: the reference is rendered by `sppm`, which is biased"),
        "{}",
        ended.stdout
    );
    let json = place.succeed(&[&biased[..], &["--json", "-q"]].concat());
    let found: Json = serde_json::from_str(&json.stdout).unwrap();
    assert_eq!(found["reference"]["technique"], "sppm");
    assert!(found["reference"]["bias"].is_string(), "{found}");
    assert!(
        json.stderr.contains("which is biased"),
        "warnings are printed with -q: {}",
        json.stderr
    );
    place.succeed(&["report"]);
    let verdict = place.read("out/latest/report/verdict.md");
    assert!(verdict.contains("which is biased"), "{verdict}");
    let unbiased = place.succeed(&short).stdout;
    assert!(!unbiased.contains("reference is rendered by"), "{unbiased}");
}

/// The sentence of `compare` and the table of its report are one estimate.
#[test]
fn a_comparison_and_its_report_have_the_same_ratio() {
    let place = Workplace::new();
    let args = [
        "compare",
        "ball.scn",
        "-t",
        "bpt,nee",
        "--time",
        "0.2s",
        "--size",
        "24x16",
        "--repeats",
        "3",
        "--backend",
        "cpu",
        "--json",
        "-q",
    ];
    let json: Json = serde_json::from_str(&place.succeed(&args).stdout).unwrap();
    let ratio = json["verdicts"][0]["ratio"].as_f64().unwrap();
    place.succeed(&["report"]);
    let table = place.read("out/latest/report/tables/equal-time-relmse.csv");
    let mut lines = table
        .lines()
        .map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().unwrap();
    let value = header.iter().position(|name| *name == "value").unwrap();
    let values: Vec<f64> = lines.map(|line| line[value].parse().unwrap()).collect();
    assert_eq!(values.len(), 2, "{table}");
    let by_report = values[0] / values[1];
    assert!(
        (by_report / ratio - 1.0).abs() < 1e-3,
        "{by_report} {ratio}"
    );
}
