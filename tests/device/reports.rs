//! The same script on the CPU and on a device: `lumbre report` compares both nights, and the values
//! in its tables agree.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use super::harness;

/// Balls that illuminate one another, so that every depth contributes.
const SCENE: &str = r#"{
    "resolution": [20, 14], "maxdepth": 4,
    "camera": { "position": [0, 0.3, 4], "lookat": [0, 0, 0], "fov": 45 },
    "materials": [
        { "name": "white", "color": [0.8, 0.8, 0.8], "model": "lambert" },
        { "name": "red", "color": [0.9, 0.3, 0.2], "model": "lambert" },
        { "name": "lamp", "emission": [6, 5, 4], "model": "lambert" }
    ],
    "entities": [
        { "type": "sphere", "material": "white", "position": [0, -21, 0], "radius": 20 },
        { "type": "sphere", "material": "red", "position": [-0.6, -0.4, 0], "radius": 0.6 },
        { "type": "sphere", "material": "white", "position": [0.7, -0.4, 0], "radius": 0.6 },
        { "type": "sphere", "material": "lamp", "position": [0, 2.5, 1], "radius": 0.5 }
    ]
}"#;

const SCRIPT: &str = r#"
local x = experiment("agree", { seed = 5, repeats = 2 })
x:axis("technique", { "nee", "bdpt" })
x:axis("depth", { 2, 4 })
x:render(function(p)
  return { scene = "balls.scn", integrator = p.technique, max_depth = p.depth }
end)
x:reference { from = function(p) return { integrator = "nee" } end, stop = stop.samples(256) }
x:measure { every = "60s", rmse = metric.rmse(),
            ssim = metric.ssim { on = tonemap.srgb { exposure = 0 } } }
x:stop(function(p) return stop.samples(16) end)
return x
"#;

/// Largest relative difference of a metric: a path that rounding sends another way changes one of 840
/// values per repeat.
const MAX_DIFFERENCE: f64 = 5e-3;

/// Runs the program in a folder.
fn lumbre(place: &Path, arguments: &[&str]) {
    let output = Command::new(env!("CARGO_BIN_EXE_lumbre"))
        .current_dir(place)
        .args(arguments)
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{arguments:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
}

/// A line of a report's table: depth and technique, then the night, the mean over repeats, and the
/// distance to the farther end of its interval.
type Entry = ((String, String), (String, f64, f64));

/// Returns the lines of a report's table as CSV. Device names may hold commas, and are quoted then.
fn entries(table: &str) -> Vec<Entry> {
    let fields = |line: &str| {
        let quoted: Vec<String> = line
            .split('"')
            .enumerate()
            .map(|(i, part)| {
                if i % 2 == 1 {
                    part.replace(',', ";")
                } else {
                    part.to_owned()
                }
            })
            .collect();
        quoted
            .concat()
            .split(',')
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    let mut lines = table.lines().map(fields);
    let header = lines.next().unwrap();
    let at = |name: &str| header.iter().position(|n| n == name).unwrap();
    let [depth, group, column, value, low, high] =
        ["depth", "group", "column", "value", "ci95_low", "ci95_high"].map(at);
    let number = |field: &str| field.parse::<f64>().unwrap();
    lines
        .map(|f| {
            let [value, low, high] = [value, low, high].map(|i| number(&f[i]));
            (
                (f[depth].clone(), f[column].clone()),
                (f[group].clone(), value, (high - value).max(value - low)),
            )
        })
        .collect()
}

#[test]
fn reports_of_the_same_script_on_the_cpu_and_on_a_device_agree() {
    let device = or_return!(harness::device());
    let of_device = harness::fastest_to_compile(&device).backend();
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    std::fs::write(place.join("balls.scn"), SCENE).unwrap();
    std::fs::write(place.join("agree.lua"), SCRIPT).unwrap();
    for backend in ["cpu", of_device] {
        lumbre(
            place,
            &[
                "run",
                "agree.lua",
                "--backend",
                backend,
                "--out",
                backend,
                "-q",
            ],
        );
    }
    lumbre(
        place,
        &[
            "report",
            "cpu/latest",
            &format!("{of_device}/latest"),
            "--name",
            "cpu",
            "--name",
            of_device,
            "--to",
            "both",
        ],
    );
    let mut depths = BTreeMap::new();
    for metric in ["rmse", "ssim"] {
        let table =
            std::fs::read_to_string(place.join(format!("both/tables/final-{metric}.csv"))).unwrap();
        let mut cells = BTreeMap::<_, Vec<_>>::new();
        entries(&table)
            .into_iter()
            .for_each(|(cell, entry)| cells.entry(cell).or_default().push(entry));
        assert_eq!(cells.len(), 4, "{table}");
        for (cell, nights) in &cells {
            let [(first, a, a_half), (second, b, b_half)] = &nights[..] else {
                panic!("{cell:?}: {table}")
            };
            assert!(
                first.contains("cpu") && second.contains(of_device),
                "{table}"
            );
            // The values agree within the noise of the repeats and, since the seeds are the same,
            // much closer.
            assert!(
                (a - b).abs() <= a_half + b_half,
                "{metric} of {cell:?}: {a} and {b}"
            );
            assert!(
                (a - b).abs() <= MAX_DIFFERENCE * a.abs(),
                "{metric} of {cell:?}: {a} and {b}"
            );
            assert!(*a > 0.0 && *a_half > 0.0, "{table}");
            depths
                .entry((metric, cell.1.clone()))
                .or_insert_with(Vec::new)
                .push(*a);
        }
    }
    for (measured, values) in &depths {
        assert!(
            (values[0] / values[1] - 1.0).abs() > 1e-3,
            "{measured:?}: depth makes no difference, {values:?}"
        );
    }
}
