//! Readers of results: files that do not match their checksums are left out, named, and give exit
//! code 3.

use super::workplace::Workplace;

/// A finished night, with the folder of its first run and that of a reference.
fn night() -> (Workplace, String, String) {
    let place = Workplace::new();
    place.succeed(&["run", "night.lua", "-q"]);
    let run = place.finished()[0].0.clone();
    let run = run.trim_end_matches("/done.json").to_owned();
    let reference = place.first_ending("out/refs", "/ref.json");
    let reference = reference.trim_end_matches("/ref.json").to_owned();
    (place, run, reference)
}

/// Changes one byte in the middle of a file. Returns the content before.
fn change(place: &Workplace, file: &str) -> Vec<u8> {
    let before = std::fs::read(place.path(file)).unwrap();
    let mut after = before.clone();
    let middle = after.len() / 2;
    after[middle] ^= 1;
    std::fs::write(place.path(file), after).unwrap();
    before
}

#[test]
fn a_report_leaves_out_what_does_not_match_its_checksum_and_says_so_at_the_top() {
    let (place, run, reference) = night();
    place.succeed(&["report", "out/latest", "-q"]);
    for (name, is_run) in [
        (format!("{run}/metrics.csv"), true),
        (format!("{run}/done.json"), true),
        (format!("{run}/final.exr"), false),
        (format!("{reference}/ref.exr"), false),
        (format!("{reference}/ref.json"), false),
    ] {
        let before = change(&place, &name);
        let ended = place.run(&["report", "out/latest", "-q"]);
        let file = name.rsplit('/').next().unwrap();
        let said = format!("{file} is damaged");
        assert_eq!(ended.status, 3, "{name}: {}", ended.stderr);
        assert!(ended.stderr.contains(&said), "{name}: {}", ended.stderr);
        let page = place.read("out/latest/report/index.html");
        let top = page.split("<nav>").next().unwrap();
        assert!(
            top.contains("id=\"problems\"") && top.contains(&said),
            "{name}"
        );
        let runs = place.read("out/latest/report/data/runs.csv");
        let left_out = runs
            .lines()
            .filter(|line| line.contains(",damaged,"))
            .count();
        assert_eq!(left_out, usize::from(is_run), "{name}: {runs}");
        std::fs::write(place.path(&name), before).unwrap();
        place.succeed(&["report", "out/latest", "-q"]);
    }
}

#[test]
fn a_report_says_which_file_of_a_finished_night_was_removed() {
    let (place, run, reference) = night();
    for (name, state) in [
        (format!("{run}/done.json"), "damaged"),
        (format!("{reference}/ref.json"), "done"),
        ("out/latest/env.json".to_owned(), "done"),
    ] {
        let before = std::fs::read(place.path(&name)).unwrap();
        std::fs::remove_file(place.path(&name)).unwrap();
        let ended = place.run(&["report", "out/latest", "-q"]);
        let said = format!("{} is missing", name.rsplit('/').next().unwrap());
        assert_eq!(ended.status, 3, "{name}: {}", ended.stderr);
        assert!(ended.stderr.contains(&said), "{name}: {}", ended.stderr);
        let page = place.read("out/latest/report/index.html");
        let top = page.split("<nav>").next().unwrap();
        assert!(top.contains(&said), "{name}");
        let runs = place.read("out/latest/report/data/runs.csv");
        let unfinished = runs.contains(",unfinished,");
        assert!(
            !unfinished && runs.contains(&format!(",{state},")),
            "{name}: {runs}"
        );
        std::fs::write(place.path(&name), before).unwrap();
        place.succeed(&["report", "out/latest", "-q"]);
    }
}

#[test]
fn lists_and_measurements_name_what_does_not_match_its_checksum() {
    let (place, run, reference) = night();
    let picture = format!("{run}/final.exr");
    let truth = format!("{reference}/ref.exr");
    let all = [
        vec!["ls"],
        vec!["ls", "--json"],
        vec!["show", &run],
        vec!["show", &run, "--json"],
        vec!["status", "out/latest"],
        vec!["status", "out/latest", "--json"],
        vec!["metric", &picture, &truth],
        vec!["reproduce", &run],
    ];
    for command in &all[..7] {
        place.succeed(command);
    }
    // The same number of digits, so that only the checksum tells.
    let done = place.read(&format!("{run}/done.json"));
    let changed = done.replace("\"samples\": 16", "\"samples\": 61");
    assert_ne!(done, changed);
    place.write(&format!("{run}/done.json"), &changed);
    for command in &all {
        let ended = place.run(command);
        let text = ended.stdout + &ended.stderr;
        assert_eq!(ended.status, 3, "{command:?}: {text}");
        assert!(text.contains("done.json is damaged"), "{command:?}: {text}");
        assert!(!text.contains("61 spp"), "{command:?}: {text}");
    }
    assert!(
        place
            .run(&["ls", "--state", "damaged"])
            .stdout
            .contains("1 damaged")
    );
    place.write(&format!("{run}/done.json"), &done);
    for file in [&picture, &truth] {
        let before = change(&place, file);
        let damaged = format!("{} is damaged", file.rsplit('/').next().unwrap());
        assert!(
            place
                .fail(3, &["metric", &picture, &truth])
                .contains(&damaged)
        );
        std::fs::write(place.path(file), before).unwrap();
    }
    change(&place, &format!("{run}/metrics.csv"));
    assert!(
        place
            .fail(3, &["show", &run])
            .contains("metrics.csv is damaged")
    );
}

#[test]
fn a_changed_plan_is_no_plan() {
    let (place, run, _) = night();
    let id = run.rsplit('/').next().unwrap();
    let plan = place.read("out/latest/plan.json");
    let other = plan.replace(id, &"0".repeat(32));
    assert_ne!(plan, other);
    place.write("out/latest/plan.json", &other);
    for command in [vec!["report", "out/latest"], vec!["status", "out/latest"]] {
        let error = place.fail(2, &command);
        assert!(error.contains("does not match its checksum"), "{error}");
    }
    let listed = place.run(&["ls"]);
    assert!(listed.status == 3 && listed.stderr.contains("plan.json is damaged"));
    place.succeed(&["run", "night.lua", "-q"]);
    assert_eq!(place.read("out/latest/plan.json"), plan);
}

#[cfg(unix)]
#[test]
fn a_pipe_in_place_of_a_file_blocks_no_reader() {
    let (place, run, reference) = night();
    for file in [
        format!("{run}/done.json"),
        format!("{run}/metrics.csv"),
        format!("{run}/final.exr"),
        format!("{reference}/ref.exr"),
        "out/latest/env.json".to_owned(),
        "out/latest/journal.jsonl".to_owned(),
        "out/index.jsonl".to_owned(),
    ] {
        let path = place.path(&file);
        let before = std::fs::read(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        let made = std::process::Command::new("mkfifo").arg(&path).status();
        assert!(made.unwrap().success());
        let is_evidence = file.contains("/runs/") || file.contains("/refs/");
        for command in [
            vec!["report", "out/latest", "-q"],
            vec!["ls"],
            vec!["show", &run],
        ] {
            let mut child = place.command(&command);
            let child = child.stdout(std::process::Stdio::null());
            let mut child = child.stderr(std::process::Stdio::null()).spawn().unwrap();
            let start = std::time::Instant::now();
            let status = loop {
                if let Some(status) = child.try_wait().unwrap() {
                    break status;
                }
                if start.elapsed().as_secs() > 60 {
                    child.kill().unwrap();
                    panic!("{command:?} waits for {file}");
                }
                std::thread::sleep(std::time::Duration::from_millis(20));
            };
            if command[0] == "report" && is_evidence {
                assert_eq!(status.code(), Some(3), "{file}");
            }
        }
        std::fs::remove_file(&path).unwrap();
        std::fs::write(&path, before).unwrap();
    }
}

#[test]
fn what_a_killed_report_left_is_removed_by_the_next_one() {
    let (place, _, _) = night();
    place.succeed(&["report", "out/latest", "-q"]);
    let left = ["", "figures/", "data/"].map(|f| format!("out/latest/report/{f}.lumbre-x1.tmp"));
    left.iter()
        .for_each(|file| place.write(file, "half of a figure"));
    place.succeed(&["report", "out/latest", "-q"]);
    for file in &left {
        assert!(!place.path(file).exists(), "{file}");
    }
}

#[test]
fn damaged_device_affinities_and_sums_are_named() {
    let (place, _, _) = night();
    for part in ["/affinity/", "/sums/"] {
        let files = place.files("out");
        let Some(file) = files.iter().find(|f| f.contains(part)) else {
            panic!("no file in {part}: {files:?}");
        };
        change(&place, file);
        let name = file.rsplit('/').next().unwrap();
        let ended = place.succeed(&["run", "night.lua"]);
        assert!(
            ended.stderr.contains(&format!("{name} is damaged")),
            "{}",
            ended.stderr
        );
        assert!(
            !place
                .succeed(&["run", "night.lua"])
                .stderr
                .contains("damaged")
        );
    }
}
