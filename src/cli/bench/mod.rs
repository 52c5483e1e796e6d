//! `lumbre bench`: the program measuring itself. Figures, never pass or fail: machines are shared and noisy.

mod backends;
mod checkpoint;
mod cluster;
mod dashboard;
mod efficiency;
mod handover;
mod loading;
mod long;
mod metrics;
mod night;
mod rates;
mod ratios;
mod scale;
mod subject;
mod time;
mod turns;

use std::process::Command;
use std::time::Instant;

use serde_json::{Value as Json, json};

use crate::cli::args::BenchArgs;
use crate::cli::builtin::BuiltIn;
use crate::cli::doctor;
use crate::math::stats::median;
use crate::render::cpu::lanes::Isa;
use crate::scene::load::Missing;
use crate::store::Host;

use subject::Subject;

/// Starts of the program whose median is reported.
const STARTS: usize = 11;

/// Everything that was measured, ready to print or to save.
pub struct Report {
    json: Json,
    text: String,
}

impl Report {
    /// The table for people.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The same figures as JSON.
    pub fn json(&self) -> &Json {
        &self.json
    }
}

/// Measures the built-in scenes, the given ones, and the program's own overheads. `say` hears what is being measured.
///
/// # Errors
/// When a given scene cannot be loaded or rendered, with a message for people.
pub fn measure(
    args: &BenchArgs,
    threads: usize,
    missing: Missing,
    say: &mut dyn FnMut(&str),
) -> Result<Report, String> {
    let repeats = args.repeats as usize;
    let asked = args.scenes.iter().map(|arg| Subject::asked(arg, missing)).collect::<Result<Vec<_>, _>>()?;
    if args.loading {
        say("loading a mesh of a million triangles");
        let found = loading::Loading::measure(repeats)?;
        return Ok(Report { text: found.table(), json: json!({ "loading": found.to_json() }) });
    }
    let cpu = ["cpu".to_owned()];
    let built_in = BuiltIn::unpack()?;
    if args.ratios {
        let named = |name: &str| {
            let file = built_in.scenes().into_iter().find(|file| file.ends_with(name));
            file.map(Subject::built_in).ok_or_else(|| format!("no built-in scene `{name}`"))
        };
        let (masked, plain) = (named("masked_leaves.scn")?, named("cornell_spheres.scn")?);
        let found = ratios::Ratios::measure(&masked, &plain, repeats, say)?;
        return Ok(Report {
            text: format!("{}\n\n{}", processor_line(), found.table()),
            json: json!({ "ratios": found.to_json() }),
        });
    }
    let mut scenes: Vec<Subject> = Vec::new();
    if !args.only {
        scenes.extend(built_in.scenes().into_iter().map(Subject::built_in));
    }
    scenes.extend(asked);
    if let (true, Some(first)) = (args.time, scenes.first()) {
        say("measuring what time costs");
        let costs = time::measure(first, if args.backend.is_empty() { &cpu } else { &args.backend }, repeats)?;
        return Ok(Report { text: time::table(&costs), json: json!({ "time": time::to_json(&costs) }) });
    }
    if !args.backend.is_empty() {
        return compare_backends(args, &scenes, say);
    }
    let mut rows = Vec::new();
    for subject in scenes.iter().filter(|_| !args.overheads) {
        say(&format!("measuring {}", subject.name));
        rows.push(rates::measure(subject, threads, repeats, [!args.mpaths, !args.traversal])?);
    }
    let isa = Isa::detect().name();
    let (host, features) = (Host::here(), doctor::cpu_features());
    let mut text = format!("{}\ninstructions of rays: {isa}\n\n{}", processor_line(), rates::table(&rows));
    let mut json = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "threads": if threads == 0 { std::thread::available_parallelism().map_or(1, usize::from) } else { threads },
        "repeats": repeats,
        "processor": host.cpu,
        "cores": host.cores,
        "features": features,
        "instructions": isa,
        "relative_rmse": efficiency::RELATIVE_RMSE,
        "scenes": rows.iter().map(rates::Row::to_json).collect::<Vec<_>>(),
    });
    let alone = args.only || args.traversal || args.mpaths;
    if let (false, Some(first)) = (alone, scenes.first()) {
        say("measuring the program's own overheads");
        let (plan, plan_s) = night::plan_10_000_cells()?;
        let start_up_s = start_up_s();
        let outside = night::share_outside_advance(&first.file, threads)?;
        let checkpoint_s = checkpoint::checkpoint_s(&first.file, threads, repeats)?;
        text += &format!("\nstart-up (--version)                 {:>9.1} ms\n", start_up_s * 1e3);
        text += &format!("plan of 10,000 cells                 {plan_s:>9.3} s\n");
        text += &format!("time outside `advance`, 4 s cell     {:>9.2} %\n", outside * 100.0);
        text += &format!("checkpoint of bdpt at 1280x720        {:>9.1} ms\n", checkpoint_s * 1e3);
        text += &format!("  of the 60 s between two of them     {:>9.2} %\n", checkpoint_s / 60.0 * 100.0);
        json["checkpoint_s"] = checkpoint_s.into();
        say("measuring what it costs to look at 10,000 cells");
        let scale = scale::Scale::measure(&plan)?;
        text += &scale.table();
        json["scale_10000_runs"] = scale.to_json();
        say("measuring a night of short cells");
        let long = long::Long::measure()?;
        text += &long.table();
        json["night_of_short_cells"] = long.to_json();
        say("measuring the dashboard");
        let screens = dashboard::measure()?;
        text += &dashboard::table(&screens);
        json["dashboard"] = dashboard::to_json(&screens);
        say("loading a mesh of a million triangles");
        let found = loading::Loading::measure(1)?;
        text += &format!("\n{}", found.table());
        json["loading"] = found.to_json();
        say("measuring what time costs");
        let costs = time::measure(first, &cpu, repeats)?;
        text += &format!("\n{}", time::table(&costs));
        json["time"] = time::to_json(&costs);
        say("measuring the metrics");
        let times = metrics::measure(repeats);
        text += &format!("\n{}", metrics::table(&times));
        json["metrics"] = metrics::to_json(&times);
        json["start_up_s"] = start_up_s.into();
        json["plan_10000_cells_s"] = plan_s.into();
        json["share_outside_advance"] = outside.into();
    }
    Ok(Report { json, text })
}

/// Rehearses a night of many workers in a folder instead.
///
/// # Errors
/// When files cannot be written there, with a message for people.
pub fn cluster(out: &std::path::Path, say: &mut dyn FnMut(&str)) -> Result<Report, String> {
    say("rehearsing 10,000 cells over 1,000 workers");
    let found = cluster::Cluster::measure(out)?;
    let json = json!({ "version": env!("CARGO_PKG_VERSION"), "cluster": found.to_json() });
    Ok(Report { text: found.table(), json })
}

/// The processor and what it can do, for people.
fn processor_line() -> String {
    let host = Host::here();
    format!("processor: {}, {} cores, with {}", host.cpu, host.cores, doctor::cpu_features().join(" "))
}

/// Measures backends side by side instead.
fn compare_backends(args: &BenchArgs, scenes: &[Subject], say: &mut dyn FnMut(&str)) -> Result<Report, String> {
    let mut rows = Vec::new();
    for subject in scenes {
        say(&format!("measuring {}", subject.name));
        let resolution = [args.width, args.height];
        rows.extend(backends::measure(subject, &args.backend, resolution, args.repeats as usize)?);
    }
    let mut text = backends::table(&rows);
    let mut json = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "repeats": args.repeats,
        "backends": rows.iter().map(backends::Row::to_json).collect::<Vec<_>>(),
    });
    if let Some(first) = scenes.first() {
        say("measuring what it costs to bring a picture from a worker");
        let found = handover::HandOver::measure(first, args.repeats as usize)?;
        text += &format!("\n{}", found.lines());
        json["hand_over"] = found.to_json();
    }
    Ok(Report { text, json })
}

/// Seconds from starting this program to its end when it has nothing to do.
fn start_up_s() -> f64 {
    let Ok(program) = std::env::current_exe() else { return f64::NAN };
    median((0..STARTS).map(|_| {
        let start = Instant::now();
        match Command::new(&program).arg("--version").output() {
            Ok(_) => start.elapsed().as_secs_f64(),
            Err(_) => f64::NAN,
        }
    }))
}
