//! A script whose axis is the backend, run by the program: both backends give the same pictures.

use std::process::Command;

use super::{harness, verdict};

const SCENE: &str = r#"{
    "resolution": [24, 16], "maxdepth": 4,
    "camera": { "position": [0, 0, 4], "lookat": [0, 0, 0], "fov": 40 },
    "materials": [
        { "name": "grey", "color": [0.5, 0.5, 0.5] },
        { "name": "late", "color": [0.9, 0.2, 0.1], "delay": "exponential", "delay_rate": 2 },
        { "name": "leaf", "parts": ["grey", "late"], "weights": [0.25, 0.75] },
        { "name": "lamp", "emission": [2, 2, 2] }
    ],
    "entities": [
        { "type": "sphere", "material": "leaf", "position": [0, 0, 0], "radius": 1 },
        { "type": "sphere", "material": "lamp", "position": [0, 3, 0], "radius": 0.5 }
    ]
}"#;

const SCRIPT: &str = r#"
local x = experiment("backends", { seed = 7 })
x:axis("on", { "cpu", "vulkan-compute" })
x:render(function(p) 
  return { scene = "ball.scn", integrator = "bpt", backend = p.on,
           accel = { builder = "sah", bins = 4, max_leaf = 1 },
           film = { time = { start = 3, bin = 0.25, bins = 24 } } }
end)
x:stop(function(p) return stop.samples(1024) end)
return x
"#;

/// Returns the single-precision values of an array in NumPy's format.
fn numbers(file: &[u8]) -> Vec<f32> {
    let head = 10 + usize::from(u16::from_le_bytes([file[8], file[9]]));
    file[head..]
        .chunks_exact(4)
        .map(|b| f32::from_le_bytes(b.try_into().unwrap()))
        .collect()
}

#[test]
fn a_sweep_over_backends_gives_the_same_pictures_and_bins() {
    if harness::device().is_none() {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    std::fs::write(place.path().join("ball.scn"), SCENE).unwrap();
    std::fs::write(place.path().join("night.lua"), SCRIPT).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_lumbre"))
        .current_dir(place.path())
        .args(["run", "night.lua"])
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{message}");
    assert!(message.contains("backend vulkan-compute: "), "{message}");
    let (mut pictures, mut cubes, mut built) = (Vec::new(), Vec::new(), 0);
    for path in crate::common::files_below(&place.path().join("out")) {
        let bytes = || std::fs::read(&path).unwrap();
        if path.ends_with("final.exr") {
            pictures.push(lumbre_report::exr::decode(&bytes()).unwrap().0);
        } else if path.ends_with("time-cube.npy") {
            cubes.push(numbers(&bytes()));
        } else if path.ends_with("done.json") {
            let done: serde_json::Value = serde_json::from_slice(&bytes()).unwrap();
            let message = ["accel_build_s", "accel_bytes", "accel_cost"]
                .map(|key| done["open"][key].as_f64().unwrap());
            assert!(message.iter().all(|x| *x > 0.0), "{done}");
            built += 1;
        }
    }
    assert_eq!((pictures.len(), built), (2, 2));
    let [found, expected] = [0, 1].map(|i: usize| pictures[i].data.as_flattened());
    verdict::compare_values("the cell of another backend", found, expected);
    assert_eq!(cubes.len(), 2);
    let lit = cubes[0].iter().filter(|x| **x != 0.0).count();
    let off = cubes[0]
        .iter()
        .zip(&cubes[1])
        .filter(|(a, b)| (**a - **b).abs() > 1e-3 * a.abs().max(1e-3))
        .count();
    assert!(
        lit > 300 && cubes[0].len() == 24 * 16 * 24 * 3,
        "{lit} of {} are lit",
        cubes[0].len()
    );
    // A path that rounding moves across the edge between two bins changes both.
    assert!(off * 100 <= lit, "{off} of {lit} values in bins differ");
}
