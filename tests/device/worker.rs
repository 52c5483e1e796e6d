//! Device workers that are killed at random instants: the night continues and leaves the same
//! pictures.
#![cfg(target_os = "linux")]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use lumbre_light::film::Image;
use lumbre_light::math::rng::{pcg4d, unit};

use super::harness;

const SCENE: &str = include_str!("../common/ball.scn");

/// Two cells of SAMPLES samples each, with a checkpoint many times a second: one with films by
/// depth, and one in which the device continues while waves are measured. There is one technique,
/// whose shader every new worker finds in the cache of a software driver, so that it is killed
/// while it renders and not while it compiles.
const SCRIPT: &str = r#"
local x = experiment("frail", { seed = 7 })
x:axis("depth", { 3, 4 })
x:checkpoint(0.05)
x:render(function(p)
  return { scene = "ball.scn", integrator = "bpt", max_depth = p.depth,
           backend = "vulkan-compute", resolution = { 32, 20 },
           films = p.depth == 4 and { "depth" } or nil }
end)
x:stop(function(p) return stop.samples(SAMPLES) end)
return x
"#;

/// Shortest time in seconds that a night must last for its worker to be killed while it renders.
const LONG_ENOUGH: f64 = 2.0;

/// Starts the night in a folder, with this many samples in each cell.
fn start(place: &Path, samples: u64) -> Child {
    std::fs::write(place.join("ball.scn"), SCENE).unwrap();
    let script = SCRIPT.replace("SAMPLES", &samples.to_string());
    std::fs::write(place.join("night.lua"), script).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_lumbre"));
    command
        .current_dir(place)
        .args(["run", "night.lua", "--no-tui"]);
    command
        .stdout(Stdio::null())
        .stderr(std::fs::File::create(place.join("stderr")).unwrap())
        .spawn()
        .unwrap()
}

/// Returns the pictures of a night: the final one of every cell, and its films by depth.
fn pictures(place: &Path) -> Vec<(PathBuf, Image)> {
    let mut files = crate::common::files_below(&place.join("out"));
    files.retain(|path| {
        path.extension().is_some_and(|e| e == "exr") && !path.to_string_lossy().contains("snap-")
    });
    let decoded = files.into_iter().map(|path| {
        let image = lumbre_report::exr::decode(&std::fs::read(&path).unwrap())
            .unwrap()
            .0;
        (path.strip_prefix(place).unwrap().to_owned(), image)
    });
    decoded.collect()
}

/// Returns the id of the worker process of a process, if it has one.
fn worker_of(pid: u32) -> Option<u32> {
    let threads = std::fs::read_dir(format!("/proc/{pid}/task"))
        .ok()?
        .flatten();
    let lists =
        threads.filter_map(|thread| std::fs::read_to_string(thread.path().join("children")).ok());
    let children: Vec<u32> = lists
        .flat_map(|list| {
            list.split_whitespace()
                .filter_map(|pid| pid.parse().ok())
                .collect::<Vec<_>>()
        })
        .collect();
    let works = |pid: &u32| {
        std::fs::read_to_string(format!("/proc/{pid}/cmdline"))
            .is_ok_and(|line| line.ends_with("worker\0"))
    };
    children.into_iter().find(works)
}

/// Runs the night in `place` and kills up to three of its workers, each after a random time.
/// Returns the number of kills.
///
/// The number is bounded, because each run and each smoke pass is tried only four times.
fn run_and_kill(place: &Path, samples: u64) -> u32 {
    let mut night = start(place, samples);
    let (mut kills, mut pauses) = (0, 0u32);
    let status = loop {
        if let Some(status) = night.try_wait().unwrap() {
            break status;
        }
        pauses += 1;
        let wait = 0.1 + 0.9 * unit(pcg4d([pauses, 3, 1, 4])[0]);
        std::thread::sleep(Duration::from_secs_f32(wait));
        if let (Some(worker), true) = (worker_of(night.id()), kills < 3) {
            kills += u32::from(
                crate::common::kill()
                    .args(["-9", &worker.to_string()])
                    .status()
                    .unwrap()
                    .success(),
            );
        }
    };
    assert!(status.success(), "{}", messages(place));
    kills
}

/// Returns what the night in `place` printed.
fn messages(place: &Path) -> String {
    std::fs::read_to_string(place.join("stderr")).unwrap()
}

#[test]
fn a_night_whose_worker_is_killed_at_random_instants_leaves_the_same_pictures() {
    if harness::device().is_none() {
        return;
    }
    // A fast device, or one whose shaders are in the cache of the driver by now, needs more samples
    // to be still rendering when its worker is killed.
    let mut samples = 600;
    let (whole, interrupted, kills) = loop {
        let (whole, interrupted) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let begin = Instant::now();
        let status = start(whole.path(), samples).wait().unwrap();
        assert!(status.success(), "{}", messages(whole.path()));
        if begin.elapsed().as_secs_f64() >= LONG_ENOUGH {
            let kills = run_and_kill(interrupted.path(), samples);
            if kills > 0 {
                break (whole, interrupted, kills);
            }
        }
        samples *= 8;
        assert!(
            samples <= 1 << 24,
            "no worker was killed: {}",
            messages(whole.path())
        );
    };
    let log = messages(interrupted.path());
    println!(
        "{kills} workers killed; {} retries",
        log.matches("retrying from the newest checkpoint").count()
    );
    let expected = pictures(whole.path());
    assert_eq!(expected.len(), 1 + (1 + 4), "{expected:?}");
    let found = pictures(interrupted.path());
    assert_eq!(found.len(), expected.len());
    for ((path, image), (_, other)) in found.iter().zip(&expected) {
        assert!(image == other, "{} differs: {log}", path.display());
    }
}
