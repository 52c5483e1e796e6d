//! Processor time of one path of `nee`, beside Mitsuba 3's `path` on the same scene, both with one
//! thread and in turn.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::Arc;

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

/// Scenes that are measured without a choice: one for each kind of surface and light.
const SCENES: [&str; 10] = [
    "cornell.lua",
    "hare_box.lua",
    "material_ball.lua",
    "veach_lamps.lua",
    "veach_mis.lua",
    "bedroom.lua",
    "forest.lua",
    "many_lights.lua",
    "masked_leaves/masked_leaves.scn",
    "door_ajar.lua",
];

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
    /// Scene files; by default ten built-in scenes
    #[arg(value_name = "SCENE")]
    scenes: Vec<PathBuf>,
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
    /// Measures each scene in `rounds` rounds.
    ///
    /// # Errors
    /// Returns a message if a scene cannot be loaded, exported or rendered, Mitsuba does not start
    /// or fails, or the system does not report processor time.
    pub fn measure(args: &MitsubaArgs, rounds: usize) -> Result<BesideMitsuba, String> {
        let built_in = || SCENES.map(|name| root().join("scenes").join(name)).to_vec();
        let scenes = if args.scenes.is_empty() {
            built_in()
        } else {
            args.scenes.clone()
        };
        let mut all = BesideMitsuba {
            version: String::new(),
            rows: Vec::new(),
        };
        for scene in scenes {
            let subject = Subject::built_in(scene);
            eprintln!("measuring {}", subject.label);
            let (version, row) = measure_scene(&subject, args, rounds)
                .map_err(|problem| format!("{}: {problem}", subject.label))?;
            all.version = version;
            all.rows.push(row);
        }
        Ok(all)
    }

    /// Formats the figures as text.
    pub fn table(&self) -> String {
        let head = ["scene", "Mitsuba ns", "nee ns", "ratio"];
        let mut lines = vec![head.map(str::to_owned).to_vec()];
        lines.extend(self.rows.iter().map(|row| {
            let [theirs, ours] = row.ns;
            vec![
                row.scene.clone(),
                format!("{theirs:.0}"),
                format!("{ours:.0}"),
                format!("{:.2}", row.ratio),
            ]
        }));
        let ratio = median(self.rows.iter().map(|row| row.ratio));
        format!(
            "Mitsuba {}, {SIDE}x{SIDE}, depth {MAX_DEPTH}, processor time per path, one thread\n\n\
             {}\n\nmedian ratio {ratio:.2}\n",
            self.version,
            aligned(&lines)
        )
    }
}

/// Measures one scene. Also returns Mitsuba's version.
fn measure_scene(
    subject: &Subject,
    args: &MitsubaArgs,
    rounds: usize,
) -> Result<(String, Row), String> {
    let mut desc = subject.load()?;
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
        scene: subject.label.clone(),
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
    replies: BufReader<ChildStdout>,
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
        let mut mitsuba = Mitsuba {
            process,
            requests,
            replies: BufReader::new(replies),
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

    fn reply(&mut self) -> Result<String, String> {
        let mut line = String::new();
        match self.replies.read_line(&mut line) {
            Ok(0) => Err("Mitsuba ended; its messages are above".to_owned()),
            Ok(_) => Ok(line.trim_end().to_owned()),
            Err(e) => Err(format!("cannot read from Mitsuba: {e}")),
        }
    }
}

impl Drop for Mitsuba {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
