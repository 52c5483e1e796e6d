//! `lumbre verify --kill N`: kills a small night at random instants, and compares what it leaves in the end with what the
//! same night leaves when nobody disturbs it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value as Json;

use crate::cli::builtin::BuiltIn;

/// The night: samples end every cell, so that nothing of its results depends on a clock. Two techniques, one of them with
/// splats and layers; checkpoints at every slice; snapshots, a figure and a table.
const SCRIPT: &str = r#"
local x = experiment("kill", { seed = 5, repeats = 2, order = "ORDER" })
x:axis("technique", { "nee", "bdpt" })
x:render(function(p)
  return { scene = "SCENE", integrator = p.technique, max_depth = 4, resolution = { 24, 24 }, backend = "cpu",
    films = { "depth", "albedo" } }
end)
x:reference { from = function(p) return { integrator = "nee" } end, stop = stop.samples(96) }
x:measure { every = "1h", rmse = metric.rmse(), ssim = metric.ssim { on = tonemap.srgb(), range = 1 }, keep = { exr = "pow2" } }
x:stop(stop.samples(96))
x:checkpoint("0.005s")
x:figure("error", { x = "samples", y = { "rmse" }, by = "technique" })
x:table("error", { value = "rmse", rows = "technique" })
return x
"#;

/// Longest that one night may take, however often it is killed.
const PATIENCE: Duration = Duration::from_secs(600);

/// Columns of measurements and summaries that hold clocks, or tell in which of the nights a run was finished.
const CLOCKS: [&str; 6] = ["render_s", "wall_s", "measure_s", "mpaths_per_s", "status", "reason"];

/// Fields of a run's last file that hold clocks, or hashes of files with clocks.
const CLOCK_FIELDS: [&str; 7] = ["render_s", "wall_s", "measure_s", "accel_build_s", "finished", "files", "check"];

/// What a check found.
pub struct Killed {
    /// Kills in all.
    pub kills: u32,
    /// Nights that were killed, each until it was done.
    pub nights: u32,
    /// Kills that hit a run in its middle and left a checkpoint.
    pub checkpoints: u32,
    /// Files that were compared in each night.
    pub files: usize,
    /// What differs; empty when all is well.
    pub problems: Vec<String>,
}

/// Kills nights of `processes` processes and cells in an `order` `kills` times in all.
///
/// # Errors
/// When the program cannot be started, or a night does not end.
pub fn check(kills: u32, processes: u32, order: &str, seed: u64, threads: usize) -> Result<Killed, String> {
    let built_in = BuiltIn::unpack()?;
    let scenes = built_in.scenes();
    let scene = scenes.first().ok_or("there is no built-in scene")?;
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let script = folder.path().join("kill.lua");
    let text = SCRIPT.replace("SCENE", &scene.display().to_string().replace('\\', "/")).replace("ORDER", order);
    std::fs::write(&script, text).map_err(|e| e.to_string())?;
    let place = Place { script, threads };

    let whole = folder.path().join("whole");
    let start = Instant::now();
    place.finish(&mut [place.start(&whole)?])?;
    let undisturbed = start.elapsed();
    let expected = contents(&whole)?;

    let mut random = Random { seed, drawn: 0 };
    let mut killed = Killed { kills: 0, nights: 0, checkpoints: 0, files: expected.len(), problems: Vec::new() };
    while killed.kills < kills && killed.problems.is_empty() {
        let out = folder.path().join(format!("killed-{}", killed.nights));
        killed.nights += 1;
        place.one_night(&out, processes, kills, undisturbed, &mut random, &mut killed)?;
        killed.problems = differences(&expected, &contents(&out)?);
        killed.problems.extend(leftovers(&out));
        killed.problems.extend(done_twice(&out));
        std::fs::remove_dir_all(&out).map_err(|e| e.to_string())?;
    }
    Ok(killed)
}

struct Place {
    script: PathBuf,
    threads: usize,
}

impl Place {
    fn start(&self, out: &Path) -> Result<Child, String> {
        let program = std::env::current_exe().map_err(|e| e.to_string())?;
        let threads = self.threads.to_string();
        let mut command = Command::new(program);
        command
            .args(["run", "-q", "--no-tui", "--no-smoke", "--threads", &threads, "--out"])
            .arg(out)
            .arg(&self.script);
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        command.spawn().map_err(|e| format!("cannot start the program: {e}"))
    }

    /// Kills and starts again until the night is done, or there have been enough kills; then lets it end.
    fn one_night(
        &self,
        out: &Path,
        processes: u32,
        kills: u32,
        undisturbed: Duration,
        random: &mut Random,
        killed: &mut Killed,
    ) -> Result<(), String> {
        let start = Instant::now();
        let mut children: Vec<Child> = (0..processes).map(|_| self.start(out)).collect::<Result<_, _>>()?;
        while killed.kills < kills {
            // Up to half of what the night takes: most kills hit its middle, and some its very beginning.
            std::thread::sleep(undisturbed.mul_f64(0.5 * random.next() / f64::from(processes)));
            let victim = (random.next() * f64::from(processes)) as usize;
            let child = &mut children[victim];
            match child.try_wait().map_err(|e| e.to_string())? {
                Some(status) if status.success() => break,
                Some(status) => return Err(format!("the night ended with {status}")),
                None => {}
            }
            child.kill().and_then(|()| child.wait()).map_err(|e| e.to_string())?;
            killed.kills += 1;
            let found = files(out);
            killed.checkpoints += u32::from(found.iter().any(|file| name(file).starts_with("ckpt.")));
            children[victim] = self.start(out)?;
            if start.elapsed() > PATIENCE {
                children.iter_mut().for_each(|child| {
                    // It may have ended by itself.
                    let _ = child.kill();
                });
                return Err("the night does not end".to_owned());
            }
        }
        self.finish(&mut children)
    }

    fn finish(&self, children: &mut [Child]) -> Result<(), String> {
        for child in children {
            let status = child.wait().map_err(|e| e.to_string())?;
            if !status.success() {
                return Err(format!("the night ended with {status}"));
            }
        }
        Ok(())
    }
}

/// Numbers from 0 to 1, the same for every run with the same seed.
struct Random {
    seed: u64,
    drawn: u64,
}

impl Random {
    fn next(&mut self) -> f64 {
        self.drawn += 1;
        let mut bytes = [0; 16];
        bytes[..8].copy_from_slice(&self.seed.to_le_bytes());
        bytes[8..].copy_from_slice(&self.drawn.to_le_bytes());
        let hash = blake3::hash(&bytes);
        let word = hash.as_bytes().iter().take(4).fold(0u32, |word, byte| word << 8 | u32::from(*byte));
        f64::from(word) / f64::from(u32::MAX)
    }
}

fn name(file: &Path) -> String {
    file.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Every file below a folder, links left out.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut open = vec![folder.to_owned()];
    while let Some(next) = open.pop() {
        for entry in std::fs::read_dir(next).into_iter().flatten().flatten() {
            match entry.file_type() {
                Ok(kind) if kind.is_dir() => open.push(entry.path()),
                Ok(kind) if kind.is_file() => found.push(entry.path()),
                _ => {}
            }
        }
    }
    found
}

/// What a night leaves, by relative path, without clocks and without what tells its story.
fn contents(out: &Path) -> Result<BTreeMap<String, Vec<u8>>, String> {
    let mut found = BTreeMap::new();
    for file in files(out) {
        let name = name(&file);
        if ["journal.jsonl", "env.json", "frozen.json", "log.txt", "lock", "index.sqlite"].contains(&name.as_str()) {
            continue;
        }
        // The sums that a longer reference goes on from tell the clocks of the shorter one; its pictures are compared.
        if file.parent().and_then(Path::file_name).is_some_and(|folder| folder == "sums") {
            continue;
        }
        let bytes = std::fs::read(&file).map_err(|e| format!("{}: {e}", file.display()))?;
        let bytes = match name.as_str() {
            "metrics.csv" | "summary.csv" | "repeats.csv" => {
                without_clock_columns(&String::from_utf8_lossy(&bytes)).into_bytes()
            }
            "done.json" | "ref.json" => without_clock_fields(&bytes)?,
            _ => bytes,
        };
        let path = file.strip_prefix(out).unwrap_or(&file).to_string_lossy().replace('\\', "/");
        found.insert(path, bytes);
    }
    if found.is_empty() { Err("the night left nothing".to_owned()) } else { Ok(found) }
}

fn without_clock_columns(csv: &str) -> String {
    let header: Vec<&str> = csv.lines().next().unwrap_or_default().split(',').collect();
    let keep = |line: &str| {
        let cells = line.split(',').enumerate();
        let clock = |column: &str| CLOCKS.contains(&column.trim_end_matches("_low").trim_end_matches("_high"));
        let kept = cells.filter(|(i, _)| !header.get(*i).is_some_and(|column| clock(column)));
        kept.map(|(_, cell)| cell).collect::<Vec<_>>().join(",") + "\n"
    };
    csv.lines().map(keep).collect()
}

fn without_clock_fields(bytes: &[u8]) -> Result<Vec<u8>, String> {
    let mut json: Json = serde_json::from_slice(bytes).map_err(|e| e.to_string())?;
    if let Some(fields) = json.as_object_mut() {
        for field in CLOCK_FIELDS {
            fields.shift_remove(field);
        }
    }
    Ok(json.to_string().into_bytes())
}

fn differences(expected: &BTreeMap<String, Vec<u8>>, found: &BTreeMap<String, Vec<u8>>) -> Vec<String> {
    let missing = expected.keys().filter(|name| !found.contains_key(*name)).map(|name| format!("{name} is missing"));
    let other = found.iter().filter_map(|(name, bytes)| match expected.get(name) {
        None => Some(format!("{name} is new")),
        Some(before) if before != bytes => Some(format!("{name} has other bytes")),
        Some(_) => None,
    });
    missing.chain(other).collect()
}

/// What a night that is over must not leave.
fn leftovers(out: &Path) -> Vec<String> {
    let odd = |name: &str| name.starts_with("ckpt.") || name == "claim" || name == "failed.json";
    files(out).iter().map(|f| name(f)).filter(|n| odd(n)).map(|n| format!("{n} was left behind")).collect()
}

/// Runs that were recorded as finished more than once.
fn done_twice(out: &Path) -> Vec<String> {
    let mut counts: BTreeMap<String, u32> = BTreeMap::new();
    for file in files(out).iter().filter(|file| name(file) == "journal.jsonl") {
        let text = std::fs::read_to_string(file).unwrap_or_default();
        let lines = text.lines().filter_map(|line| serde_json::from_str::<Json>(line).ok());
        for line in lines.filter(|line| line["event"] == "cell_finished" && line["outcome"] == "done") {
            *counts.entry(line["run"].to_string()).or_default() += 1;
        }
    }
    counts.into_iter().filter(|(_, n)| *n > 1).map(|(run, n)| format!("{run} was finished {n} times")).collect()
}
