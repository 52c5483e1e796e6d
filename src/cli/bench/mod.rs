//! `lumbre bench`: rates of rays and techniques on scenes and backends. It reports figures and never
//! passes or fails, since machines are shared and noisy. Chores of developers measure the program
//! itself.

pub mod backends;
mod efficiency;
pub mod interleave;
mod rates;
pub mod subject;

use serde_json::{Value as Json, json};

use super::about::doctor;
use super::scene::builtin::BuiltIn;
use crate::cli::args::BenchArgs;
use lumbre_night::store::Host;
use lumbre_render::cpu::bvh::simd::Isa;
use lumbre_scene_io::load::MissingTextures;

use subject::Subject;

/// All measured figures, as text and as JSON.
pub struct BenchReport {
    json: Json,
    text: String,
}

impl BenchReport {
    /// Returns the figures as text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Returns the figures as JSON.
    pub fn json(&self) -> &Json {
        &self.json
    }
}

/// Measures the built-in scenes and the given ones. `progress` receives a line before each
/// measurement.
///
/// # Errors
/// A message for the user if a given scene cannot be loaded or rendered.
pub fn measure(
    args: &BenchArgs,
    threads: usize,
    missing: MissingTextures,
    progress: &mut dyn FnMut(&str),
) -> Result<BenchReport, String> {
    let given = args
        .scenes
        .iter()
        .map(|arg| Subject::from_arg(arg, missing))
        .collect::<Result<Vec<_>, _>>()?;
    let built_in = BuiltIn::unpack()?;
    let mut scenes: Vec<Subject> = Vec::new();
    if !args.only {
        scenes.extend(built_in.scenes().into_iter().map(Subject::built_in));
    }
    scenes.extend(given);
    if args.backend.is_empty() {
        measure_rates(args, &scenes, threads, progress)
    } else {
        compare_backends(args, &scenes, progress)
    }
}

/// Measures the ray and path rates of scenes.
fn measure_rates(
    args: &BenchArgs,
    scenes: &[Subject],
    threads: usize,
    progress: &mut dyn FnMut(&str),
) -> Result<BenchReport, String> {
    let repeats = args.repeats as usize;
    let mut rows = Vec::new();
    for subject in scenes {
        progress(&format!("measuring {}", subject.name));
        rows.push(rates::measure(
            subject,
            threads,
            repeats,
            [!args.mpaths, !args.traversal],
        )?);
    }
    let isa = Isa::detect().name();
    let (host, features) = (Host::detect(), doctor::cpu_features());
    let text = format!(
        "{}\nray traversal instructions: {isa}\n\n{}",
        processor_line(),
        rates::table(&rows)
    );
    let used_threads = if threads == 0 {
        std::thread::available_parallelism().map_or(1, usize::from)
    } else {
        threads
    };
    let json = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "threads": used_threads,
        "repeats": repeats,
        "processor": host.cpu,
        "cores": host.cores,
        "features": features,
        "instructions": isa,
        "relative_rmse": efficiency::RELATIVE_RMSE,
        "scenes": rows.iter().map(rates::SceneRates::to_json).collect::<Vec<_>>(),
    });
    Ok(BenchReport { json, text })
}

/// Describes the processor and its instruction sets.
pub fn processor_line() -> String {
    let host = Host::detect();
    format!(
        "processor: {}, {} cores, with {}",
        host.cpu,
        host.cores,
        doctor::cpu_features().join(" ")
    )
}

/// Measures backends side by side.
fn compare_backends(
    args: &BenchArgs,
    scenes: &[Subject],
    progress: &mut dyn FnMut(&str),
) -> Result<BenchReport, String> {
    let mut rows = Vec::new();
    for subject in scenes {
        progress(&format!("measuring {}", subject.name));
        let resolution = [args.width, args.height];
        rows.extend(backends::measure(
            subject,
            &args.backend,
            resolution,
            args.repeats as usize,
        )?);
    }
    let json = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "repeats": args.repeats,
        "backends": rows.iter().map(backends::BackendRates::to_json).collect::<Vec<_>>(),
    });
    Ok(BenchReport {
        text: backends::table(&rows),
        json,
    })
}
