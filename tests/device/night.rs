//! A script whose axis is the backend, run by the program itself: the reports of both agree.

use assert_cmd::Command;

use super::harness;

const SCENE: &str = include_str!("../common/ball.scn");

const SCRIPT: &str = r#"
local x = experiment("backends", { seed = 7 })
x:axis("on", { "cpu", "vulkan-compute" })
x:render(function(p) return { scene = "ball.scn", integrator = "nee", backend = p.on } end)
x:stop(function(p) return stop.samples(16) end)
return x
"#;

#[test]
fn a_script_sweeps_over_backends_and_both_render_the_same() {
    if harness::device().is_none() {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    std::fs::write(place.path().join("ball.scn"), SCENE).unwrap();
    std::fs::write(place.path().join("night.lua"), SCRIPT).unwrap();
    let mut command = Command::cargo_bin("lumbre").unwrap();
    let ended = command.current_dir(place.path()).args(["run", "night.lua"]).output().unwrap();
    let said = String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.success(), "{said}");
    assert!(said.contains("backend vulkan-compute: "), "{said}");
    let mut pictures = Vec::new();
    let mut open = vec![place.path().join("out")];
    while let Some(folder) = open.pop() {
        for path in std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()) {
            if path.is_dir() && !path.is_symlink() {
                open.push(path);
            } else if path.file_name().is_some_and(|n| n == "final.exr") {
                pictures.push(lumbre::output::exr::decode(&std::fs::read(path).unwrap()).unwrap().0);
            }
        }
    }
    assert_eq!(pictures.len(), 2);
    let far = pictures[0].data.as_flattened().iter().zip(pictures[1].data.as_flattened());
    let off = far.filter(|(a, b)| (**a - **b).abs() > 1e-3 * a.abs().max(1e-3)).count();
    assert!(off <= 3, "{off} values differ");
    assert!(pictures[0].mean()[0] > 0.0);
}
