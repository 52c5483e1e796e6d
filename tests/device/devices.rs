//! Nights on several devices of one machine: a worker for each, a comparison group on one of them,
//! and references in shards.
#![cfg(unix)]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use lumbre_render::{Job, Renderer};
use lumbre_vulkan::pipelines::program::TracingMode;
use lumbre_vulkan::renderer::VulkanRenderer;

use super::{harness, images, verdict};
use crate::common;

const SCENE: &str = include_str!("../common/ball.scn");

/// Two comparison groups of two repeats, with references in shards. There is only one technique,
/// because a software driver compiles its shader for seconds in every process.
const SCRIPT: &str = r#"
local x = experiment("devices", { seed = 5, repeats = 2 })
x:axis("depth", { 2, 3 })
x:render(function(p)
  return { scene = "ball.scn", integrator = "bpt", max_depth = p.depth, resolution = { 16, 12 },
           backend = "vulkan-compute" }
end)
x:reference { stop = stop.samples(32), parts = 4 }
x:measure { every = "1h", rmse = metric.rmse() }
x:stop(stop.samples(16))
return x
"#;

/// Returns a command in a folder, with two devices: the loader lists a driver that is named twice
/// as two devices.
fn program(place: &Path, args: &[&str]) -> Command {
    let named = std::env::var("VK_DRIVER_FILES")
        .ok()
        .filter(|files| !files.is_empty() && !files.contains(':'));
    let driver = named.unwrap_or_else(|| {
        let folders = ["/etc/vulkan/icd.d", "/usr/share/vulkan/icd.d"];
        let listed = folders
            .iter()
            .flat_map(|folder| std::fs::read_dir(folder).into_iter().flatten().flatten());
        let mut files: Vec<String> = listed
            .map(|entry| entry.path().display().to_string())
            .collect();
        // A software driver if there is one, else that of the graphics card.
        files.sort_by_key(|file| file.contains("lvp_icd"));
        files.pop().unwrap_or_default()
    });
    let second = place.join("second_icd.json");
    if let Ok(text) = std::fs::read(&driver) {
        std::fs::write(&second, text).unwrap();
    }
    let mut command = Command::new(env!("CARGO_BIN_EXE_lumbre"));
    command
        .current_dir(place)
        .args(args)
        .env("NO_COLOR", "1")
        .env_remove("LUMBRE_DEVICE");
    command.env("VK_DRIVER_FILES", format!("{driver}:{}", second.display()));
    command
}

fn text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Returns a folder with the night, and whether there are two devices; `None` if there is none.
fn workplace() -> Option<(tempfile::TempDir, bool)> {
    harness::device()?;
    let place = tempfile::tempdir().unwrap();
    std::fs::write(place.path().join("ball.scn"), SCENE).unwrap();
    std::fs::write(place.path().join("night.lua"), SCRIPT).unwrap();
    let doctor = program(place.path(), &["doctor"]).output().unwrap();
    let two = String::from_utf8_lossy(&doctor.stdout).contains("device 1 ");
    assert!(
        two || !harness::required(),
        "the loader did not list a driver twice"
    );
    Some((place, two))
}

/// Returns the files below a folder by relative path.
fn files(root: &Path) -> BTreeMap<String, PathBuf> {
    let named = |path: PathBuf| (path.strip_prefix(root).unwrap().display().to_string(), path);
    common::files_below(root).into_iter().map(named).collect()
}

/// Returns every picture, except snapshots of unfinished runs, by relative path.
fn pictures(out: &Path) -> BTreeMap<String, Vec<u8>> {
    let all = files(out)
        .into_iter()
        .filter(|(name, _)| name.ends_with(".exr") && !name.contains("snap-"));
    all.map(|(name, path)| (name, std::fs::read(path).unwrap()))
        .collect()
}

/// Panics unless two nights have the same pictures.
fn assert_same_pictures(a: &BTreeMap<String, Vec<u8>>, b: &BTreeMap<String, Vec<u8>>) {
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    let differing: Vec<&String> = a.keys().filter(|name| a[*name] != b[*name]).collect();
    assert!(differing.is_empty(), "{differing:?}");
}

#[test]
fn a_worker_for_a_missing_device_lists_the_present_ones_and_renders_nothing() {
    let (place, _) = or_return!(workplace());
    let place = place.path();
    // The plan snapshot is written even if there is no queue.
    program(place, &["submit", "hq", "night.lua"])
        .output()
        .unwrap();
    let before = files(&place.join("out/latest/"));
    assert!(before.contains_key("snapshot.json"));
    for name in ["7", "no such card"] {
        let output = program(place, &["work", "out/latest", "--device", name])
            .output()
            .unwrap();
        let messages = text(&output)
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ");
        assert_eq!(output.status.code(), Some(2), "{messages}");
        assert!(
            messages.contains(&format!("`{name}` (from "))
                && messages.contains("matches none of: 0 "),
            "{messages}"
        );
    }
    assert_eq!(files(&place.join("out/latest/")), before);
    // If no run of the plan uses a device, the option is ignored with a message.
    std::fs::write(
        place.join("night.lua"),
        SCRIPT.replace("vulkan-compute", "mock"),
    )
    .unwrap();
    program(place, &["submit", "hq", "night.lua"])
        .output()
        .unwrap();
    let output = program(place, &["work", "out/latest", "--device", "7"])
        .output()
        .unwrap();
    assert!(
        output.status.success() && text(&output).contains("--device 7 is ignored"),
        "{}",
        text(&output)
    );
}

#[test]
fn every_device_has_a_worker_and_every_comparison_group_stays_on_one_device() {
    let (place, two) = or_return!(workplace());
    let place = place.path();
    let single_worker = program(
        place,
        &[
            "run",
            "night.lua",
            "-q",
            "--no-smoke",
            "--out",
            "single_worker",
        ],
    )
    .output()
    .unwrap();
    assert!(single_worker.status.success(), "{}", text(&single_worker));
    let whole = pictures(&place.join("single_worker"));
    assert_eq!(
        whole.len(),
        2 * 4 + 4,
        "pictures of two references with halves and noise, and of four cells"
    );

    // The references equal those of the CPU, because every shard has its own range of samples.
    let cpu_night = program(
        place,
        &[
            "run",
            "night.lua",
            "-q",
            "--no-smoke",
            "--backend",
            "cpu",
            "--out",
            "cpu",
        ],
    )
    .output();
    assert!(cpu_night.unwrap().status.success());
    let means = |out: &str| -> Vec<Vec<f32>> {
        let refs = pictures(&place.join(out))
            .into_iter()
            .filter(|(name, _)| name.ends_with("/ref.exr"));
        let mut means: Vec<Vec<f32>> = refs
            .map(|(_, bytes)| lumbre_report::exr::decode(&bytes).unwrap().0.data.concat())
            .collect();
        means.sort_by(|a, b| a.iter().sum::<f32>().total_cmp(&b.iter().sum()));
        means
    };
    for (found, expected) in means("single_worker").iter().zip(&means("cpu")) {
        assert_eq!(found.len(), 16 * 12 * 3);
        verdict::compare_values("a reference", found, expected);
    }
    if !two {
        return common::skipped("the loader does not list a driver twice");
    }
    let refused = program(place, &["run", "night.lua", "--devices", "0,7"])
        .output()
        .unwrap();
    assert_eq!(refused.status.code(), Some(2), "{}", text(&refused));
    assert!(
        text(&refused).contains("`7` (from ") && text(&refused).contains("matches none of: 0 "),
        "{}",
        text(&refused)
    );
    let refused = program(place, &["run", "night.lua", "--devices", "1,1"])
        .output()
        .unwrap();
    assert_eq!(refused.status.code(), Some(2), "{}", text(&refused));

    let night = program(
        place,
        &[
            "run",
            "night.lua",
            "--no-tui",
            "--no-smoke",
            "--devices",
            "0,1",
        ],
    )
    .output()
    .unwrap();
    let messages = text(&night);
    assert!(night.status.success(), "{messages}");
    assert!(
        messages.contains("started a worker process for device 1"),
        "{messages}"
    );
    assert_same_pictures(&pictures(&place.join("out")), &whole);
    let found = files(&place.join("out"));
    let named = |folder: &str, end: &str| -> Vec<String> {
        let fits = found
            .iter()
            .filter(|(name, _)| name.contains(folder) && name.ends_with(end));
        fits.map(|(_, path)| std::fs::read_to_string(path).unwrap())
            .collect()
    };
    let worker = named("/workers/", ".json").concat();
    assert!(
        worker.contains(", device 1\"") && worker.contains("\"state\":{\"left\":"),
        "{worker}"
    );
    // Any worker renders shards of references.
    let events = [named("journal", ".jsonl"), named("/workers/", ".jsonl")]
        .concat()
        .concat();
    assert_eq!(events.matches("shard_finished").count(), 8, "{events}");
    // Each comparison group stays on one device, whichever worker is faster.
    let affinities: BTreeSet<String> = named("/affinity/", ".json").into_iter().collect();
    assert!(
        affinities
            .iter()
            .all(|affinity| affinity.contains(", device 0") || affinity.contains(", device 1")),
        "{affinities:?}"
    );
    assert_eq!(named("/affinity/", ".json").len(), 2);
}

/// The bits of a shard do not depend on its waves: sums of integer splats do not depend on their
/// order, and all other sums begin at the first sample of the shard, whichever worker renders it.
#[test]
fn a_shard_with_splats_has_the_same_bits_in_any_waves_and_the_samples_of_the_cpu() {
    let device = or_return!(harness::integer_splat_device());
    let scene = images::room();
    // This job has the same pipeline as a test in `images.rs`.
    let shard = Job {
        first_sample: 4,
        ..images::technique_job("bdpt", 3)
    };
    let once = images::render(&device, TracingMode::Compute, &scene, &shard, 4);
    let mut waves = VulkanRenderer::new(
        &device,
        TracingMode::Compute,
        &harness::sources(),
        &scene,
        &shard,
    )
    .unwrap();
    for samples in [3, 1] {
        waves.advance(samples).unwrap();
    }
    assert!(
        *waves.film() == once,
        "other waves change the bits of the shard"
    );
    verdict::compare("samples 4 to 7", &once, &common::render(&scene, shard, 4));
    harness::assert_no_validation_messages();
}

#[test]
fn splats_in_fixed_point_can_be_requested() {
    let (place, _) = or_return!(workplace());
    let splats = |word: &str| {
        let doctor = program(place.path(), &["doctor"])
            .env("LUMBRE_SPLATS", word)
            .output()
            .unwrap();
        String::from_utf8_lossy(&doctor.stdout).contains("splats in fixed point")
    };
    assert!(splats("whole"), "`whole` must select splats in fixed point");
    let adds = harness::device().is_some_and(|device| device.info.caps.float_atomics);
    assert_eq!(splats(""), !adds);
}
