//! The night that these tests render, and the part of its results that must not depend on the
//! machine.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use super::workplace::Workplace;

/// Returns a script with two depths, three techniques, two seeds and a reference for each depth.
/// Every cell ends after 64 samples and takes little time, apart from a loop of `delay` thousand
/// iterations between waves.
pub fn script(delay: u32) -> String {
    format!(
        r#"
local x = experiment("grid", {{ seed = 7, repeats = 2 }})
x:axis("depth", {{ 2, 4 }})
x:axis("technique", {{ "bpt", "nee", "bdpt" }})
local function wait(row)
  local n = 0
  for i = 1, {delay} * 1000 do n = n + i % 7 end
  return false
end
x:render(function(p)
  return {{ scene = "ball.scn", integrator = p.technique, max_depth = p.depth, resolution = {{ 24, 16 }}, backend = "mock" }}
end)
x:reference {{ from = function(p) return {{ integrator = "bpt" }} end, stop = stop.samples(4096) }}
x:measure {{ every = "1h", rmse = metric.rmse(), keep = {{ exr = "pow2" }} }}
x:stop(function(p) return stop.any {{ stop.predicate(wait), stop.samples(64) }} end)
x:checkpoint("0.001s")
x:figure("convergence", {{ x = "samples", y = {{ "rmse" }}, by = "technique", facet = {{ "depth" }} }})
x:table("errors", {{ value = "rmse", rows = "depth", cols = "technique", format = {{ "md", "csv" }} }})
return x
"#
    )
}

/// Content of a device affinity file that binds a comparison to a device of another model.
pub const OTHER_DEVICE: &str = r#"{"version":1,"program":"lumbre","device":{"key":"far, device 0","model":"a better device"}}"#;

/// Number of cells and references of the night.
pub const RUNS: usize = 14;

/// Returns the results of a night by relative path: tables, figures, and every run's pictures and
/// measurements without times.
pub fn results(place: &Workplace, out: &str) -> BTreeMap<String, Vec<u8>> {
    let home = format!("{out}/latest");
    let home = place.path(&home).canonicalize().unwrap();
    let relative = home
        .strip_prefix(place.path("").canonicalize().unwrap())
        .unwrap()
        .to_string_lossy()
        .into_owned();
    let mut found = BTreeMap::new();
    for file in place.files(&relative) {
        let is_result = ["/tables/", "/figures/"]
            .iter()
            .any(|part| file.contains(part))
            || file.ends_with(".exr");
        if is_result {
            let name = file.strip_prefix(&relative).unwrap().to_owned();
            found.insert(name, std::fs::read(place.path(&file)).unwrap());
        }
    }
    assert!(
        found.keys().any(|name| name.ends_with("errors.csv")),
        "{:?}",
        found.keys()
    );
    found
}

/// Returns the names of the files that differ.
pub fn differing(a: &BTreeMap<String, Vec<u8>>, b: &BTreeMap<String, Vec<u8>>) -> Vec<String> {
    let names = a.keys().chain(b.keys());
    let mut different: Vec<String> = names
        .filter(|name| a.get(*name) != b.get(*name))
        .cloned()
        .collect();
    different.sort();
    different.dedup();
    different
}

/// Returns how often each run was finished according to the journals of a night's folder.
pub fn finished(place: &Workplace, home: &str) -> BTreeMap<String, usize> {
    let mut counts = BTreeMap::new();
    for file in &place.ending(home, ".jsonl") {
        let text = place.read(file);
        for line in text
            .lines()
            .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok())
        {
            if line["event"] == "cell_finished" && line["outcome"] == "done" {
                *counts.entry(line["run"].to_string()).or_default() += 1;
            }
        }
    }
    counts
}

/// Panics if a run was recorded as finished more than once, or if more than `killed` runs were not
/// recorded. A process that is killed between the last file of a run and its line in the journal
/// leaves the run done and the line unwritten.
pub fn finished_once(place: &Workplace, home: &str, killed: usize) {
    let counts = finished(place, home);
    assert!(
        counts.values().all(|n| *n == 1),
        "a run was finished more than once: {counts:?}"
    );
    assert!(
        (RUNS - killed..=RUNS).contains(&counts.len()),
        "{} of {RUNS} runs were finished: {counts:?}",
        counts.len()
    );
}

/// Returns the night's folder below `out`, relative to the workplace.
pub fn home(place: &Workplace, out: &str) -> String {
    let link = std::fs::read_link(place.path(&format!("{out}/latest"))).unwrap();
    format!("{out}/{}", link.display())
}

/// Waits until a condition holds. The limit allows for a busy machine.
pub fn wait_until(what: &str, mut holds: impl FnMut() -> bool) {
    let start = Instant::now();
    while !holds() {
        assert!(
            start.elapsed() < Duration::from_secs(180),
            "waited too long for {what}"
        );
        std::thread::sleep(Duration::from_millis(10));
    }
}
