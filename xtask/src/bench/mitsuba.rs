//! Processor time of one path of `nee`, beside Mitsuba 3's `path` on the same scene, both with one
//! thread and in turn.
//!
//! Scenes are chosen by the hash of their names, so that no person chooses them: the same number from
//! each folder, those left out that one of the programs cannot render.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;

use lumbre::cli::bench::subject::Subject;
use lumbre::cli::format::aligned;
use lumbre_light::math::stats::median;
use lumbre_light::scene::compile;
use lumbre_light::transport::integrator::INTEGRATORS;
use lumbre_night::backends::backend;
use lumbre_night::experiment::processor_time;
use lumbre_render::{Job, Renderer};
use lumbre_scene_io::export;

use crate::root;

/// The server, which runs in the Python interpreter of the options.
const SERVER: &str = include_str!("mitsuba.py");

/// Folder of the built-in scenes.
const BUILT_IN: &str = "scenes";

/// Endings of the names of scene files. Meshes alone have no light.
const ENDINGS: [&str; 6] = ["lua", "scn", "xml", "pbrt", "gltf", "glb"];

/// Time after which a reply of Mitsuba counts as none: the longest compilation of kernels of scenes
/// that finish takes a minute.
const PATIENCE: Duration = Duration::from_secs(120);

/// Side of the picture in pixels. It is square, since programs disagree on the axis of `fov`.
const SIDE: u32 = 256;

/// Path depth in edges.
const MAX_DEPTH: u32 = 5;

/// Processor time of one measurement, in seconds.
const ROUND_S: f64 = 1.0;

/// Largest number of samples of one measurement.
const MAX_SAMPLES: u64 = 1 << 12;

/// Options of the measurement.
#[derive(clap::Args)]
pub struct MitsubaArgs {
    /// Scene files to measure, beside those that are chosen
    #[arg(value_name = "SCENE")]
    scenes: Vec<PathBuf>,
    /// Folder to choose scenes from (repeatable) [default: the built-in scenes]
    #[arg(long = "from", value_name = "FOLDER")]
    folders: Vec<PathBuf>,
    /// Number of scenes to choose, in equal parts from every folder
    #[arg(long, value_name = "N", default_value_t = 20)]
    choose: usize,
    /// Python interpreter that has the package `mitsuba`
    #[arg(long, value_name = "FILE", default_value = "python3")]
    python: String,
    /// Variant of Mitsuba
    #[arg(long, value_name = "NAME", default_value = "llvm_ad_rgb")]
    variant: String,
}

/// Figures of one scene.
struct Row {
    scene: String,
    /// Whether the scene was chosen by the hash of its name.
    chosen: bool,
    /// Median nanoseconds of processor time per path: Mitsuba and `nee`.
    ns: [f64; 2],
    /// Median over the rounds of Mitsuba's time divided by that of `nee`.
    ratio: f64,
}

/// Figures of all scenes.
pub struct BesideMitsuba {
    version: String,
    rows: Vec<Row>,
}

impl BesideMitsuba {
    /// Measures scenes in `rounds` rounds, prints each row as soon as it is known, and says which
    /// scenes were left out and why.
    ///
    /// # Errors
    /// Returns a message if a folder cannot be read, or no scene can be rendered by both programs.
    pub fn measure(args: &MitsubaArgs, rounds: usize) -> Result<BesideMitsuba, String> {
        let mut all = BesideMitsuba {
            version: String::new(),
            rows: Vec::new(),
        };
        let built_in = [root().join(BUILT_IN)];
        let folders: &[PathBuf] = match &args.folders[..] {
            [] => &built_in,
            given => given,
        };
        for (i, folder) in folders.iter().enumerate() {
            let share = args.choose * (i + 1) / folders.len() - args.choose * i / folders.len();
            let mut left = share;
            for (name, file) in candidates(folder)? {
                if left == 0 {
                    break;
                }
                left -= usize::from(all.add(&name, file, true, args, rounds));
            }
        }
        for file in &args.scenes {
            let name = Subject::built_in(file.clone()).label;
            all.add(&name, file.clone(), false, args, rounds);
        }
        if all.rows.is_empty() {
            return Err("no scene was rendered by both programs".to_owned());
        }
        Ok(all)
    }

    /// Measures a scene. Returns whether both programs render it.
    fn add(
        &mut self,
        name: &str,
        file: PathBuf,
        chosen: bool,
        args: &MitsubaArgs,
        rounds: usize,
    ) -> bool {
        match measure_scene(name, file, args, rounds) {
            Ok((version, row)) => {
                let row = Row { chosen, ..row };
                eprintln!("{}", row.cells().join("  "));
                self.version = version;
                self.rows.push(row);
                true
            }
            Err(problem) => {
                let line = problem.lines().next().unwrap_or_default();
                eprintln!("{name}: left out: {line}");
                false
            }
        }
    }

    /// Formats the figures as text.
    pub fn table(&self) -> String {
        let head = ["scene", "Mitsuba ns", "nee ns", "ratio"];
        let mut lines = vec![head.map(str::to_owned).to_vec()];
        lines.extend(self.rows.iter().map(Row::cells));
        let chosen = || {
            self.rows
                .iter()
                .filter(|row| row.chosen)
                .map(|row| row.ratio)
        };
        format!(
            "Mitsuba {}, {SIDE}x{SIDE}, depth {MAX_DEPTH}, processor time per path, one thread\n\n\
             {}\n\n{} scenes chosen by the hash of their names: median ratio {:.2}, least {:.2}\n",
            self.version,
            aligned(&lines),
            chosen().count(),
            median(chosen()),
            chosen().fold(f64::INFINITY, f64::min),
        )
    }
}

impl Row {
    fn cells(&self) -> Vec<String> {
        let [theirs, ours] = self.ns;
        let mark = if self.chosen { "" } else { " (named)" };
        vec![
            format!("{}{mark}", self.scene),
            format!("{theirs:.0}"),
            format!("{ours:.0}"),
            format!("{:.2}", self.ratio),
        ]
    }
}

/// Returns the scene files of a folder with their names, in the order of the hashes of these. Of
/// several files in one folder that differ in their endings alone, the first of [`ENDINGS`] counts.
fn candidates(folder: &Path) -> Result<Vec<(String, PathBuf)>, String> {
    let unreadable = |e: std::io::Error| format!("cannot read {}: {e}", folder.display());
    let mut found: BTreeMap<PathBuf, (usize, PathBuf)> = BTreeMap::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(&next).map_err(unreadable)? {
            let path = entry.map_err(unreadable)?.path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let ending = path.extension().and_then(|ending| ending.to_str());
            let Some(rank) = ENDINGS.iter().position(|known| Some(*known) == ending) else {
                continue;
            };
            let kept = found
                .entry(path.with_extension(""))
                .or_insert((rank, path.clone()));
            if rank < kept.0 {
                *kept = (rank, path);
            }
        }
    }
    let named = |(_, file): (usize, PathBuf)| {
        let name = file.strip_prefix(folder).unwrap_or(&file);
        (name.display().to_string(), file)
    };
    let mut named: Vec<_> = found.into_values().map(named).collect();
    named.sort_by_key(|(name, _)| *blake3::hash(name.as_bytes()).as_bytes());
    Ok(named)
}

/// Measures one scene. Also returns Mitsuba's version.
fn measure_scene(
    name: &str,
    file: PathBuf,
    args: &MitsubaArgs,
    rounds: usize,
) -> Result<(String, Row), String> {
    let mut desc = Subject::built_in(file).load()?;
    desc.resolution = [SIDE; 2];
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let exported = export::mitsuba(&desc, &folder.path().join("scene"));
    let exported = exported.map_err(|e| e.to_string())?;
    let (mut mitsuba, version) = Mitsuba::start(args, folder.path(), &exported.scene)?;
    let scene = compile(&desc).map_err(|e| e.to_string())?.0;
    let nee = INTEGRATORS.iter().find(|row| row.name == "nee");
    let nee = nee.ok_or("no integrator `nee`")?;
    let job = Job::plain(nee, [SIDE; 2], MAX_DEPTH, 1).on_threads(1);
    let cpu = backend("cpu").ok_or("no cpu backend")?;
    let mut renderer = (cpu.open)(Arc::new(scene), job).map_err(|e| e.to_string())?;
    let mut ours = |samples| advance(renderer.as_mut(), samples);
    let mut theirs = |samples| mitsuba.render(samples);
    // The first renders load kernels and touch memory; the second ones determine the samples.
    let samples = [
        round_samples(theirs(1).and_then(|_| theirs(2))? / 2.0),
        round_samples(ours(1).and_then(|_| ours(2))? / 2.0),
    ];
    // Mitsuba compiles kernels for each number of samples.
    theirs(samples[0])?;
    let paths = samples.map(|n| n as f64 * f64::from(SIDE) * f64::from(SIDE));
    let mut times: [Vec<f64>; 2] = [Vec::new(), Vec::new()];
    for _ in 0..rounds {
        times[0].push(theirs(samples[0])? / paths[0] * 1e9);
        times[1].push(ours(samples[1])? / paths[1] * 1e9);
    }
    let ratios = times[0].iter().zip(&times[1]).map(|(a, b)| a / b);
    let ratio = median(ratios);
    let row = Row {
        scene: name.to_owned(),
        chosen: false,
        ns: times.map(median),
        ratio,
    };
    Ok((version, row))
}

/// Returns the number of samples of a measurement, given the seconds of one sample.
fn round_samples(sample_s: f64) -> u64 {
    ((ROUND_S / sample_s) as u64).clamp(1, MAX_SAMPLES)
}

/// Renders samples and returns the processor time of this process in seconds.
fn advance(renderer: &mut dyn Renderer, samples: u64) -> Result<f64, String> {
    let spent = || {
        let spent = processor_time::process_time(std::process::id());
        spent.ok_or("this system does not report processor time")
    };
    let before = spent()?;
    renderer.advance(samples).map_err(|e| e.to_string())?;
    Ok((spent()? - before).as_secs_f64())
}

/// A running server, which is stopped when this is dropped.
struct Mitsuba {
    process: Child,
    requests: ChildStdin,
    /// Lines of its standard output, which a thread reads.
    replies: Receiver<String>,
}

impl Mitsuba {
    /// Starts the server for an exported scene. Also returns Mitsuba's version.
    fn start(args: &MitsubaArgs, folder: &Path, scene: &Path) -> Result<(Mitsuba, String), String> {
        // A script named like the package would be imported in its place.
        let script = folder.join("server.py");
        std::fs::write(&script, SERVER).map_err(|e| e.to_string())?;
        let numbers = [SIDE, SIDE, MAX_DEPTH].map(|n| n.to_string());
        let mut process = Command::new(&args.python)
            .arg(&script)
            .arg(&args.variant)
            .arg(scene)
            .args(numbers)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|e| format!("cannot start `{}`: {e}", args.python))?;
        let (Some(requests), Some(replies)) = (process.stdin.take(), process.stdout.take()) else {
            return Err("no pipes to Mitsuba".to_owned());
        };
        // Each request has one reply.
        let (lines, received) = sync_channel(1);
        let reader = std::thread::Builder::new().name("replies".to_owned());
        let reader = reader.spawn(move || {
            let mut all = BufReader::new(replies).lines().map_while(Result::ok);
            while let Some(line) = all.next()
                && lines.send(line).is_ok()
            {}
        });
        reader.map_err(|e| format!("cannot start a thread: {e}"))?;
        let mitsuba = Mitsuba {
            process,
            requests,
            replies: received,
        };
        let version = mitsuba.reply()?;
        Ok((mitsuba, version))
    }

    /// Renders samples and returns the processor time of the server in seconds.
    fn render(&mut self, samples: u64) -> Result<f64, String> {
        writeln!(self.requests, "{samples}").map_err(|e| format!("Mitsuba ended: {e}"))?;
        let reply = self.reply()?;
        reply
            .parse()
            .map_err(|_| format!("Mitsuba replied `{reply}` instead of a time"))
    }

    fn reply(&self) -> Result<String, String> {
        self.replies.recv_timeout(PATIENCE).map_err(|e| match e {
            RecvTimeoutError::Timeout => format!("Mitsuba took more than {PATIENCE:?}"),
            RecvTimeoutError::Disconnected => "Mitsuba ended; its messages are above".to_owned(),
        })
    }
}

impl Drop for Mitsuba {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
