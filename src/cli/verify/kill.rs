//! `lumbre verify --kill N`: kills a small night at random times, resumes it, and compares its
//! files with those of the same night run without interruption.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::cli::scene::builtin::BuiltIn;
use lumbre_night::paths::{files_below, name};
use lumbre_night::store::StoredFile;
use lumbre_night::store::schema::journal::{JournalEvent, JournalLine, OutcomeKind};
use lumbre_night::store::schema::run::DoneFile;

/// The night: a sample limit ends every cell, so that results do not depend on a clock. It has two
/// techniques (one with a splat film and layers), a checkpoint in every slice, snapshots, a
/// figure and a table.
const SCRIPT: &str = r#"
local x = experiment("kill", { seed = 5, repeats = 2, order = "ORDER" })
x:axis("technique", { "nee", "bdpt" })
x:render(function(p)
  return { scene = "SCENE", integrator = p.technique, max_depth = 4, resolution = { 24, 24 },
    backend = "cpu",
    films = { "depth", "albedo" } }
end)
x:reference { from = function(p) return { integrator = "nee" } end, stop = stop.samples(96) }
x:measure { every = "1h", rmse = metric.rmse(),
  ssim = metric.ssim { on = tonemap.srgb(), range = 1 },
  keep = { exr = "pow2" } }
x:stop(stop.samples(96))
x:checkpoint("0.005s")
x:figure("error", { x = "samples", y = { "rmse" }, by = "technique" })
x:table("error", { value = "rmse", rows = "technique" })
return x
"#;

/// Longest duration of a night, including all kills.
const TIMEOUT: Duration = Duration::from_secs(600);

/// Columns of measurements and summaries with clock values, or that depend on which of the nights
/// finished a run.
const CLOCKS: [&str; 7] = [
    "render_s",
    "lost_s",
    "wall_s",
    "measure_s",
    "mpaths_per_s",
    "status",
    "reason",
];

/// Result of the kill test.
pub struct KillReport {
    /// Total number of kills.
    pub kills: u32,
    /// Number of nights, each report and resumed until it was done.
    pub nights: u32,
    /// Number of kills that interrupted a run and left a checkpoint.
    pub checkpoints: u32,
    /// Number of files compared in each night.
    pub files: usize,
    /// Differences; empty if the test passed.
    pub problems: Vec<String>,
}

/// Runs nights with `processes` processes and cells in the given `order` until `kills` kills.
///
/// # Errors
/// If the program cannot be started, or a night does not end.
pub fn check(
    kills: u32,
    processes: u32,
    order: &str,
    seed: u64,
    threads: usize,
) -> Result<KillReport, String> {
    let built_in = BuiltIn::unpack()?;
    let scenes = built_in.scenes();
    let scene = scenes.first().ok_or("no built-in scene")?;
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let script = folder.path().join("kill.lua");
    let text = SCRIPT
        .replace("SCENE", &scene.display().to_string().replace('\\', "/"))
        .replace("ORDER", order);
    std::fs::write(&script, text).map_err(|e| e.to_string())?;
    let launcher = NightLauncher { script, threads };

    let uninterrupted = folder.path().join("whole");
    let start = Instant::now();
    launcher.finish(&mut [launcher.start(&uninterrupted)?])?;
    let duration = start.elapsed();
    let expected = contents(&uninterrupted)?;

    let mut random = Random { seed, drawn: 0 };
    let mut report = KillReport {
        kills: 0,
        nights: 0,
        checkpoints: 0,
        files: expected.len(),
        problems: Vec::new(),
    };
    while report.kills < kills && report.problems.is_empty() {
        let out = folder.path().join(format!("killed-{}", report.nights));
        report.nights += 1;
        launcher.run_night(&out, processes, kills, duration, &mut random, &mut report)?;
        report.problems = differences(&expected, &contents(&out)?);
        report.problems.extend(leftovers(&out));
        report.problems.extend(done_twice(&out));
        std::fs::remove_dir_all(&out).map_err(|e| e.to_string())?;
    }
    Ok(report)
}

/// Starts processes of the night.
struct NightLauncher {
    script: PathBuf,
    threads: usize,
}

impl NightLauncher {
    fn start(&self, out: &Path) -> Result<Child, String> {
        let program = std::env::current_exe().map_err(|e| e.to_string())?;
        let threads = self.threads.to_string();
        let mut command = Command::new(program);
        command
            .args([
                "run",
                "-q",
                "--no-tui",
                "--no-smoke",
                "--threads",
                &threads,
                "--out",
            ])
            .arg(out)
            .arg(&self.script);
        command
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        command
            .spawn()
            .map_err(|e| format!("cannot start the program: {e}"))
    }

    /// Kills and restarts processes until the night is done or the number of kills is reached, then
    /// waits for its end.
    fn run_night(
        &self,
        out: &Path,
        processes: u32,
        kills: u32,
        duration: Duration,
        random: &mut Random,
        report: &mut KillReport,
    ) -> Result<(), String> {
        let start = Instant::now();
        let mut children: Vec<Child> = (0..processes)
            .map(|_| self.start(out))
            .collect::<Result<_, _>>()?;
        while report.kills < kills {
            // At most half the duration of the night: most kills hit its middle, some its start.
            std::thread::sleep(duration.mul_f64(0.5 * random.next() / f64::from(processes)));
            let victim = (random.next() * f64::from(processes)) as usize;
            let child = &mut children[victim];
            match child.try_wait().map_err(|e| e.to_string())? {
                Some(status) if status.success() => break,
                Some(_) => return Err(failure(child)),
                None => {}
            }
            child
                .kill()
                .and_then(|()| child.wait())
                .map_err(|e| e.to_string())?;
            report.kills += 1;
            let left = files_below(out);
            report.checkpoints +=
                u32::from(left.iter().any(|file| name(file).starts_with("ckpt.")));
            children[victim] = self.start(out)?;
            if start.elapsed() > TIMEOUT {
                children.iter_mut().for_each(|child| {
                    // The process may have ended already.
                    let _ = child.kill();
                });
                return Err(format!(
                    "the night did not end within {} s",
                    TIMEOUT.as_secs()
                ));
            }
        }
        self.finish(&mut children)
    }

    fn finish(&self, children: &mut [Child]) -> Result<(), String> {
        for child in children {
            let status = child.wait().map_err(|e| e.to_string())?;
            if !status.success() {
                return Err(failure(child));
            }
        }
        Ok(())
    }
}

/// Describes a process that failed: its status and what it printed last.
fn failure(child: &mut Child) -> String {
    let status = match child.wait() {
        Ok(status) => status.to_string(),
        Err(e) => e.to_string(),
    };
    let mut printed = String::new();
    if let Some(stderr) = &mut child.stderr {
        // What cannot be read is not printed.
        let _ = stderr.read_to_string(&mut printed);
    }
    let last: Vec<&str> = printed.lines().rev().take(3).collect();
    let last: Vec<&str> = last.into_iter().rev().collect();
    format!("the night failed with {status}: {}", last.join(" / "))
}

/// Pseudo-random numbers from 0 to 1, reproducible from the seed.
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
        let word = hash
            .as_bytes()
            .iter()
            .take(4)
            .fold(0u32, |word, byte| word << 8 | u32::from(*byte));
        f64::from(word) / f64::from(u32::MAX)
    }
}

/// Returns the files of a night by relative path, without clock values, logs and locks.
fn contents(out: &Path) -> Result<BTreeMap<String, Vec<u8>>, String> {
    let mut contents = BTreeMap::new();
    for file in files_below(out) {
        let name = name(&file);
        if [
            "journal.jsonl",
            "env.json",
            "snapshot.json",
            "log.txt",
            "lock",
            "index.jsonl",
        ]
        .contains(&name.as_str())
        {
            continue;
        }
        // A process killed while it writes the index leaves a temporary file, which a later writer
        // removes after an hour.
        if file.parent() == Some(out) && name.starts_with(".lumbre-") {
            continue;
        }
        // The film sums of a reference contain clock values; its pictures are compared.
        if file
            .parent()
            .and_then(Path::file_name)
            .is_some_and(|folder| folder == "sums")
        {
            continue;
        }
        let bytes = std::fs::read(&file).map_err(|e| format!("{}: {e}", file.display()))?;
        let bytes = match name.as_str() {
            "metrics.csv" | "summary.csv" | "repeats.csv" => {
                without_clock_columns(&String::from_utf8_lossy(&bytes)).into_bytes()
            }
            "done.json" | "ref.json" => without_clocks(&bytes)?,
            _ => bytes,
        };
        let path = file
            .strip_prefix(out)
            .unwrap_or(&file)
            .to_string_lossy()
            .replace('\\', "/");
        contents.insert(path, bytes);
    }
    if contents.is_empty() {
        Err("the night has written no files".to_owned())
    } else {
        Ok(contents)
    }
}

fn without_clock_columns(csv: &str) -> String {
    let header: Vec<&str> = csv.lines().next().unwrap_or_default().split(',').collect();
    let keep = |line: &str| {
        let cells = line.split(',').enumerate();
        let clock = |column: &str| {
            CLOCKS.contains(&column.trim_end_matches("_low").trim_end_matches("_high"))
        };
        let kept = cells.filter(|(i, _)| !header.get(*i).is_some_and(|column| clock(column)));
        kept.map(|(_, cell)| cell).collect::<Vec<_>>().join(",") + "\n"
    };
    csv.lines().map(keep).collect()
}

/// Returns a last file without clock values and without the checksums that depend on them.
fn without_clocks(bytes: &[u8]) -> Result<Vec<u8>, String> {
    let mut done = DoneFile::parse(bytes).map_err(|problem| format!("done.json{problem}"))?;
    if let DoneFile::Rendered(results) = &mut done {
        (results.render_s, results.wall_s, results.measure_s) = (0.0, 0.0, 0.0);
        results.lost_s = None;
        results.open.accel_build_s = 0.0;
        results.finished.clear();
        results.files.clear();
        results.check.clear();
    }
    Ok(done.text().into_bytes())
}

fn differences(
    expected: &BTreeMap<String, Vec<u8>>,
    actual: &BTreeMap<String, Vec<u8>>,
) -> Vec<String> {
    let missing = expected
        .keys()
        .filter(|name| !actual.contains_key(*name))
        .map(|name| format!("{name} is missing"));
    let other = actual
        .iter()
        .filter_map(|(name, bytes)| match expected.get(name) {
            None => Some(format!("{name} is unexpected")),
            Some(before) if before != bytes => Some(format!("{name} has different contents")),
            Some(_) => None,
        });
    missing.chain(other).collect()
}

/// Returns files that must not exist after the end of a night.
fn leftovers(out: &Path) -> Vec<String> {
    let is_leftover =
        |name: &str| name.starts_with("ckpt.") || name == "claim" || name == "failed.json";
    files_below(out)
        .iter()
        .map(|f| name(f))
        .filter(|n| is_leftover(n))
        .map(|n| format!("{n} was left behind"))
        .collect()
}

/// Returns runs that the journal records as finished more than once.
fn done_twice(out: &Path) -> Vec<String> {
    let mut counts: BTreeMap<String, u32> = BTreeMap::new();
    for file in files_below(out)
        .iter()
        .filter(|file| name(file) == "journal.jsonl")
    {
        let text = std::fs::read_to_string(file).unwrap_or_default();
        let lines = text
            .lines()
            .filter_map(|line| serde_json::from_str::<JournalLine>(line).ok());
        for line in lines {
            if let JournalEvent::CellFinished(end) = line.event
                && end.outcome == OutcomeKind::Done
            {
                *counts.entry(end.run).or_default() += 1;
            }
        }
    }
    counts
        .into_iter()
        .filter(|(_, n)| *n > 1)
        .map(|(run, n)| format!("{run} was finished {n} times"))
        .collect()
}
