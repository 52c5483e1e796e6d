//! Tests of `x:notify`: which events run the command, permission, and commands that fail or hang.

use std::time::Instant;

use super::workplace::Workplace;

/// Night on the mock backend with a notice, given as the options of `x:notify`.
fn script(options: &str) -> String {
    format!(
        r#"
local x = experiment("told", {{ seed = 1 }})
x:axis("depth", {{ 2, 3 }})
x:render(function(p)
  return {{ scene = "ball.scn", integrator = "nee", max_depth = p.depth, resolution = {{ 8, 6 }} }}
end)
x:stop(function(p) return stop.samples(2) end)
x:notify {{ {options} }}
return x
"#
    )
}

const APPEND: &str = r#"command = "sh -c 'echo \"$0 $1\" >> notes.txt' {event} {text}""#;

fn run(place: &Workplace, options: &str) -> super::workplace::ProgramOutput {
    place.write("told.lua", &script(options));
    place.run(&["run", "told.lua", "--backend", "mock", "--allow-commands"])
}

#[test]
fn the_end_of_a_night_is_told_once_and_not_when_nothing_was_left_to_do() {
    let place = Workplace::new();
    assert_eq!(run(&place, APPEND).status, 0);
    assert_eq!(place.read("notes.txt"), "end told: 2 runs done\n");
    assert_eq!(run(&place, APPEND).status, 0);
    assert_eq!(place.read("notes.txt").lines().count(), 1);
}

#[test]
fn failures_are_told_with_their_reason_and_only_events_that_were_asked_for() {
    let place = Workplace::new();
    let failing = |options: &str| {
        // Fails when it is rendered: the command does not exist.
        let text = script(options).replace(
            "x:render(",
            "external { name = \"none\", command = \"./missing {scene} {out} {spp} {seed}\" }\nx:render(",
        );
        place.write(
            "told.lua",
            &text.replace("\"nee\", max_depth", "\"external:none\", max_depth"),
        );
        place.run(&["run", "told.lua", "--allow-commands", "--no-smoke"])
    };
    let ended = failing(&format!("{APPEND}, on = \"failure\""));
    assert_ne!(ended.status, 0);
    let notes = place.read("notes.txt");
    assert_eq!(notes.lines().count(), 2, "{notes}\n{}", ended.stderr);
    assert!(
        notes.starts_with("failure depth=2/rep=0 failed: "),
        "{notes}"
    );
    assert!(notes.contains("cannot be started"), "{notes}");
}

#[test]
fn commands_that_fail_or_hang_are_warnings() {
    for (options, reason) in [
        (r#"command = "./missing""#, "cannot be started"),
        (r#"command = "sh -c 'echo broken >&2; exit 3'""#, "broken"),
        (
            r#"command = "sleep 1000", timeout = "300ms""#,
            "it was ended after 0.3 s",
        ),
    ] {
        let place = Workplace::new();
        let start = Instant::now();
        let ended = run(&place, options);
        assert_eq!(ended.status, 0, "{}", ended.stderr);
        let words: Vec<&str> = ended.stderr.split_whitespace().collect();
        assert!(words.join(" ").contains(reason), "{}", ended.stderr);
        assert!(
            start.elapsed().as_secs() < 100,
            "it does not wait for the command"
        );
        assert_eq!(place.finished().len(), 2);
    }
}

#[test]
fn commands_need_permission_and_the_plan_shows_them() {
    let place = Workplace::new();
    place.write("told.lua", &script(APPEND));
    let shown = place.succeed(&["plan", "told.lua"]).stdout;
    assert!(shown.contains("notify (end, failure, alarm)"), "{shown}");
    assert!(
        shown.contains("not allowed yet") && shown.contains("notes.txt"),
        "{shown}"
    );
    let refused = place.fail(2, &["run", "told.lua", "--backend", "mock"]);
    assert!(refused.contains("--allow-commands"), "{refused}");
    assert!(!place.path("notes.txt").exists());
}

#[test]
fn wrong_options_are_errors_of_the_script() {
    let place = Workplace::new();
    for (options, words) in [
        ("", "`command` is missing"),
        (r#"command = """#, "no program to run"),
        (r#"command = "a {what}""#, "unknown placeholder {what}"),
        (r#"command = "a", on = "start""#, "unknown value `start`"),
        (r#"command = "a", on = {}"#, "names no event"),
        (r#"command = "a", timeout = 0"#, "above 0"),
    ] {
        place.write("told.lua", &script(options));
        let error = place.fail(2, &["plan", "told.lua"]);
        assert!(error.contains(words), "{options}: {error}");
    }
}

#[test]
fn the_status_has_a_version_and_reads_back() {
    use lumbre_night::store::StoredFile;
    use lumbre_night::store::schema::status::StatusReport;
    use lumbre_render::Device;
    let place = Workplace::new();
    run(&place, APPEND);
    let text = place.succeed(&["status", "--json"]).stdout;
    let report = StatusReport::parse(text.as_bytes()).unwrap();
    assert_eq!((report.state.as_str(), report.cells.done), ("finished", 2));
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(json["version"], 1);
    // A run that has only started is rendered by devices, which are fields and a line.
    let (done, _) = &place.finished()[0];
    let run = done.rsplit('/').nth(1).unwrap();
    let started = |line: &&str| {
        line.contains("\"night_started\"")
            || line.contains("\"cell_started\"") && line.contains(run)
    };
    let journal = place.read("out/latest/journal.jsonl");
    let cut: Vec<&str> = journal.lines().filter(started).collect();
    assert_eq!(cut.len(), 2, "{journal}");
    place.write("out/latest/journal.jsonl", &format!("{}\n", cut.join("\n")));
    std::fs::remove_file(place.path(done)).unwrap();
    let text = place.succeed(&["status", "--json"]).stdout;
    let current = StatusReport::parse(text.as_bytes())
        .unwrap()
        .current
        .unwrap();
    assert_eq!(current.devices, [Device::mock()]);
    assert_eq!(current.device, "mock, on a fake clock");
}
