//! References in shards: their bytes do not depend on the workers that render them, or on killed
//! workers.

use std::collections::BTreeMap;
use std::process::{Child, Stdio};

use super::night::{differing, home, results, wait_until};
use super::workplace::Workplace;

/// Returns a script with one cell on the CPU backend, and a reference with splats in `parts`
/// shards.
fn script(samples: u32, parts: u32) -> String {
    format!(
        r#"
local x = experiment("parts", {{ seed = 3 }})
x:axis("depth", {{ 3 }})
x:render(function(p)
  return {{ scene = "ball.scn", integrator = "nee", max_depth = p.depth, resolution = {{ 24, 16 }}, backend = "cpu" }}
end)
x:reference {{
  from = function(p) return {{ integrator = "bdpt" }} end,
  stop = stop.samples({samples}), parts = {parts},
}}
x:measure {{ every = "1h", rmse = metric.rmse() }}
x:stop(stop.samples(4))
x:checkpoint("0.02s")
x:table("errors", {{ value = "rmse", rows = "depth", format = {{ "csv" }} }})
return x
"#
    )
}

/// Returns the pictures of all references below `out`.
fn references(place: &Workplace, out: &str) -> BTreeMap<String, Vec<u8>> {
    let refs = format!("{out}/refs");
    let pictures = place.ending(&refs, ".exr").into_iter();
    let found: BTreeMap<String, Vec<u8>> = pictures
        .map(|file| {
            (
                file.strip_prefix(&refs).unwrap().to_owned(),
                std::fs::read(place.path(&file)).unwrap(),
            )
        })
        .collect();
    assert_eq!(found.len() % 4, 0, "{:?}", found.keys());
    found
}

/// Returns `ref.json` of the reference with this number of samples, and its `metrics.csv`.
fn reference(place: &Workplace, out: &str, samples: u64) -> (serde_json::Value, String) {
    let files = place
        .ending(&format!("{out}/refs"), "/ref.json")
        .into_iter();
    let mut found = files.map(|file| {
        (
            place.json(&file),
            place.read(&file.replace("ref.json", "metrics.csv")),
        )
    });
    found.find(|(json, _)| json["samples"] == samples).unwrap()
}

fn start(place: &Workplace, home: &str) -> Child {
    let mut command = place.command(&[
        "work",
        home,
        "--no-tui",
        "--threads",
        "1",
        "--affinity",
        "none",
    ]);
    command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Sends a signal to all workers.
fn send(workers: &[Child], signal: &str) {
    for worker in workers {
        assert!(
            crate::common::kill()
                .args([signal, &worker.id().to_string()])
                .status()
                .unwrap()
                .success()
        );
    }
}

#[test]
fn a_sharded_reference_has_the_same_bytes_with_any_workers_and_after_kills() {
    let place = Workplace::new();
    place.write("parts.lua", &script(4096, 4));
    place.succeed(&["run", "parts.lua", "--out", "alone", "-q", "--threads", "1"]);
    let (json, metrics) = reference(&place, "alone", 4096);
    assert_eq!(json["halves"], serde_json::json!([2048, 2048]));
    let samples: Vec<&str> = metrics
        .lines()
        .skip(1)
        .map(|line| line.split(',').nth(1).unwrap())
        .collect();
    assert_eq!(
        samples,
        ["1024", "2048", "3072", "4096"],
        "one row per shard"
    );

    place.run(&["submit", "hq", "parts.lua", "-q"]);
    let home = home(&place, "out");
    let mut workers: Vec<Child> = (0..3).map(|_| start(&place, &home)).collect();
    // Returns whether at least two workers render shards, and some shard has a checkpoint but no
    // result.
    let is_in_progress = || {
        let journals = place
            .ending(&format!("{home}/workers"), ".jsonl")
            .into_iter();
        let rendering = journals
            .filter(|file| place.read(file).contains("shard_started"))
            .count();
        let shard_files = place.files("out/refs/shards");
        let open = |file: &String| {
            let folder = file.split_once("/ckpt.").map(|(folder, _)| folder);
            folder.is_some_and(|folder| !shard_files.contains(&format!("{folder}/sums")))
        };
        rendering >= 2 && shard_files.iter().any(open)
    };
    // Files of stopped workers do not change, so the checkpoint still exists when they are killed.
    wait_until("a shard with a checkpoint", || {
        is_in_progress() && {
            send(&workers, "-STOP");
            let still = is_in_progress();
            if !still {
                send(&workers, "-CONT");
            }
            still
        }
    });
    for worker in &mut workers {
        worker.kill().unwrap();
        worker.wait().unwrap();
    }
    let status = place.succeed(&["status", &home]).stdout;
    assert!(
        status.contains("0 of 1; ") && status.contains("of 4 shards of the others are done"),
        "{status}"
    );
    let workers: Vec<Child> = (0..3).map(|_| start(&place, &home)).collect();
    let errors: Vec<String> = workers
        .into_iter()
        .map(|worker| {
            let output = worker.wait_with_output().unwrap();
            let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
            assert!(output.status.success(), "{stderr}");
            stderr
        })
        .collect();
    let all = errors.concat();
    assert!(all.contains("resumes from its checkpoint after"), "{all}");
    assert_eq!(
        differing(&references(&place, "out"), &references(&place, "alone")),
        Vec::<String>::new()
    );
    assert_eq!(
        differing(&results(&place, "out"), &results(&place, "alone")),
        Vec::<String>::new()
    );
    let floors = |out: &str| {
        let done = place.first_ending(out, "/done.json");
        place.json(&done)["floors"]["rmse"].as_f64().unwrap()
    };
    assert_eq!(floors("out"), floors("alone"));
    let status = place.succeed(&["status", &home]).stdout;
    assert!(status.contains("references  1 of 1\n"), "{status}");
    assert!(place.files("out/refs/shards").is_empty());
}

#[test]
fn twice_the_samples_in_twice_the_shards_continue_the_stored_shards_to_the_same_bytes() {
    let place = Workplace::new();
    place.write("short.lua", &script(150, 3));
    place.write("long.lua", &script(300, 6));
    place.succeed(&["run", "short.lua", "-q"]);
    let output = place.succeed(&["plan", "long.lua"]).stdout;
    assert!(
        output.contains("in shards of 50") && output.contains("resumes from 150 samples per pixel"),
        "{output}"
    );
    let output = place.succeed(&["run", "long.lua"]).stderr;
    assert!(
        output.contains("shard 4 of 6") && !output.contains("shard 3 of 6"),
        "{output}"
    );
    place.succeed(&["run", "long.lua", "--out", "fresh", "-q"]);
    let (all, fresh) = (references(&place, "out"), references(&place, "fresh"));
    assert_eq!((all.len(), fresh.len()), (8, 4));
    assert!(fresh.iter().all(|(name, bytes)| all[name] == *bytes));

    // Damaged shards are rendered again.
    place.write("longest.lua", &script(350, 7));
    let sums = place.files("out/refs/sums");
    assert_eq!(
        sums.len(),
        1,
        "only the sums of the longest reference are stored: {sums:?}"
    );
    std::fs::write(place.path(&sums[0]), b"damaged").unwrap();
    let output = place.succeed(&["run", "longest.lua"]).stderr;
    assert!(
        output.contains("shard 1 of 7") && output.contains("shard 7 of 7"),
        "{output}"
    );
    let picture = place.first_ending("fresh/refs", "/ref.exr");
    let output = place
        .succeed(&["reproduce", &picture, "--out", "fresh"])
        .stdout;
    assert!(output.ends_with("identical\n"), "{output}");
}
