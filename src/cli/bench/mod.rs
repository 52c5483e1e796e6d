//! `lumbre bench`: measures the program itself. It reports figures and never passes or fails, since
//! machines are shared and noisy.

mod backends;
mod checkpoint;
mod cluster;
mod dashboard;
mod efficiency;
mod handover;
mod interleave;
mod loading;
mod long;
mod metrics;
mod night;
mod rates;
mod ratios;
mod scale;
mod subject;
mod time;

use std::path::Path;
use std::process::Command;
use std::time::Instant;

use serde_json::{Value as Json, json};

use super::about::doctor;
use super::scene::builtin::BuiltIn;
use crate::cli::args::BenchArgs;
use crate::store::Host;
use lumbre_light::math::stats::median;
use lumbre_light::scene::load::MissingTextures;
use lumbre_render::cpu::bvh::simd::Isa;

use subject::Subject;

/// Number of program starts whose median is reported.
const STARTS: usize = 11;

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

    /// Appends text and a JSON value under `key`.
    fn append(&mut self, text: &str, key: &str, json: Json) {
        self.text += text;
        self.json[key] = json;
    }
}

/// Measures the built-in scenes, the given ones, and the program's own overheads. `progress`
/// receives a line before each measurement.
///
/// # Errors
/// A message for the user if a given scene cannot be loaded or rendered.
pub fn measure(
    args: &BenchArgs,
    threads: usize,
    missing: MissingTextures,
    progress: &mut dyn FnMut(&str),
) -> Result<BenchReport, String> {
    let repeats = args.repeats as usize;
    let given = args
        .scenes
        .iter()
        .map(|arg| Subject::from_arg(arg, missing))
        .collect::<Result<Vec<_>, _>>()?;
    if args.loading {
        progress("loading a mesh of a million triangles");
        let loading = loading::Loading::measure(repeats)?;
        return Ok(BenchReport {
            text: loading.table(),
            json: json!({ "loading": loading.to_json() }),
        });
    }
    let built_in = BuiltIn::unpack()?;
    if args.ratios {
        return measure_ratios(&built_in, repeats, progress);
    }
    let mut scenes: Vec<Subject> = Vec::new();
    if !args.only {
        scenes.extend(built_in.scenes().into_iter().map(Subject::built_in));
    }
    scenes.extend(given);
    if let (true, Some(first)) = (args.time, scenes.first()) {
        progress("measuring time-resolved films");
        let backends = if args.backend.is_empty() {
            vec!["cpu".to_owned()]
        } else {
            args.backend.clone()
        };
        let costs = time::measure(first, &backends, repeats)?;
        return Ok(BenchReport {
            text: time::table(&costs),
            json: json!({ "time": time::to_json(&costs) }),
        });
    }
    if !args.backend.is_empty() {
        return compare_backends(args, &scenes, progress);
    }
    let mut report = measure_rates(args, &scenes, threads, progress)?;
    let rates_only = args.only || args.traversal || args.mpaths;
    if let (false, Some(first)) = (rates_only, scenes.first()) {
        append_overheads(&mut report, first, threads, repeats, progress)?;
        append_components(&mut report, first, repeats, progress)?;
    }
    Ok(report)
}

/// Measures the cost ratios of masks, instances, lights and threads on built-in scenes.
fn measure_ratios(
    built_in: &BuiltIn,
    repeats: usize,
    progress: &mut dyn FnMut(&str),
) -> Result<BenchReport, String> {
    let subject = |name: &str| {
        let file = built_in
            .scenes()
            .into_iter()
            .find(|file| file.ends_with(name));
        file.map(Subject::built_in)
            .ok_or_else(|| format!("no built-in scene `{name}`"))
    };
    let (masked, plain) = (
        subject("masked_leaves.scn")?,
        subject("cornell_spheres.scn")?,
    );
    let ratios = ratios::Ratios::measure(&masked, &plain, repeats, progress)?;
    Ok(BenchReport {
        text: format!("{}\n\n{}", processor_line(), ratios.table()),
        json: json!({ "ratios": ratios.to_json() }),
    })
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
    for subject in scenes.iter().filter(|_| !args.overheads) {
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

/// Measures the overheads of a night: start-up, planning, bookkeeping, checkpoints and listing.
fn append_overheads(
    report: &mut BenchReport,
    subject: &Subject,
    threads: usize,
    repeats: usize,
    progress: &mut dyn FnMut(&str),
) -> Result<(), String> {
    progress("measuring the program's own overheads");
    let (plan, plan_s) = night::plan_10_000_cells()?;
    let start_up_s = start_up_s();
    let outside = night::share_outside_advance(&subject.file, threads)?;
    let checkpoint_s = checkpoint::checkpoint_s(&subject.file, threads, repeats)?;
    report.append(
        &format!(
            "\nstart-up (--version)                 {:>9.1} ms\n",
            start_up_s * 1e3
        ),
        "start_up_s",
        start_up_s.into(),
    );
    report.append(
        &format!("plan of 10,000 cells                 {plan_s:>9.3} s\n"),
        "plan_10000_cells_s",
        plan_s.into(),
    );
    report.append(
        &format!(
            "time outside `advance`, 4 s cell     {:>9.2} %\n",
            outside * 100.0
        ),
        "share_outside_advance",
        outside.into(),
    );
    report.append(
        &format!(
            "checkpoint of bdpt at 1280x720        {:>9.1} ms\n\
             \x20 share of the 60 s interval          {:>9.2} %\n",
            checkpoint_s * 1e3,
            checkpoint_s / 60.0 * 100.0
        ),
        "checkpoint_s",
        checkpoint_s.into(),
    );
    progress("measuring ls, status and watch with 10,000 runs");
    let listing = scale::ListingCost::measure(&plan)?;
    report.append(&listing.table(), "scale_10000_runs", listing.to_json());
    progress("measuring a night of short cells");
    let short_cells = long::ShortCellCost::measure()?;
    report.append(
        &short_cells.table(),
        "night_of_short_cells",
        short_cells.to_json(),
    );
    Ok(())
}

/// Measures the dashboard, loading, time-resolved films and metrics.
fn append_components(
    report: &mut BenchReport,
    subject: &Subject,
    repeats: usize,
    progress: &mut dyn FnMut(&str),
) -> Result<(), String> {
    progress("measuring the dashboard");
    let screens = dashboard::measure()?;
    report.append(
        &dashboard::table(&screens),
        "dashboard",
        dashboard::to_json(&screens),
    );
    progress("loading a mesh of a million triangles");
    let loading = loading::Loading::measure(1)?;
    report.append(
        &format!("\n{}", loading.table()),
        "loading",
        loading.to_json(),
    );
    progress("measuring time-resolved films");
    let costs = time::measure(subject, &["cpu".to_owned()], repeats)?;
    report.append(
        &format!("\n{}", time::table(&costs)),
        "time",
        time::to_json(&costs),
    );
    progress("measuring the metrics");
    let times = metrics::measure(repeats);
    report.append(
        &format!("\n{}", metrics::table(&times)),
        "metrics",
        metrics::to_json(&times),
    );
    Ok(())
}

/// Simulates a night of many workers in a temporary folder below `out`.
///
/// # Errors
/// A message for the user if files cannot be written there.
pub fn cluster(out: &Path, progress: &mut dyn FnMut(&str)) -> Result<BenchReport, String> {
    progress("simulating 10,000 cells on 1,000 workers");
    let cost = cluster::ClusterCost::measure(out)?;
    let json = json!({ "version": env!("CARGO_PKG_VERSION"), "cluster": cost.to_json() });
    Ok(BenchReport {
        text: cost.table(),
        json,
    })
}

/// Describes the processor and its instruction sets.
fn processor_line() -> String {
    let host = Host::detect();
    format!(
        "processor: {}, {} cores, with {}",
        host.cpu,
        host.cores,
        doctor::cpu_features().join(" ")
    )
}

/// Measures backends side by side, and the transfer of images from a worker.
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
    let mut text = backends::table(&rows);
    let mut hand_over = None;
    if let Some(first) = scenes.first() {
        progress("measuring the transfer of images from a worker");
        let transfer = handover::ImageTransfer::measure(first, args.repeats as usize)?;
        text += &format!("\n{}", transfer.table());
        hand_over = Some(transfer.to_json());
    }
    let json = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "repeats": args.repeats,
        "backends": rows.iter().map(backends::BackendRates::to_json).collect::<Vec<_>>(),
        "hand_over": hand_over,
    });
    Ok(BenchReport { text, json })
}

/// Median seconds from starting this program to its end when it has nothing to do.
fn start_up_s() -> f64 {
    let Ok(program) = std::env::current_exe() else {
        return f64::NAN;
    };
    median((0..STARTS).map(|_| {
        let start = Instant::now();
        match Command::new(&program).arg("--version").output() {
            Ok(_) => start.elapsed().as_secs_f64(),
            Err(_) => f64::NAN,
        }
    }))
}
