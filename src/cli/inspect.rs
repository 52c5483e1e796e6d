//! `lumbre ls` and `lumbre show`: what is there, read from files alone.

use std::fmt::Write as _;

use clap::ValueEnum;
use serde_json::{Value as Json, json};

use super::args::{Global, LsArgs, ShowArgs};
use super::exit::{Exit, Failure, data, talk};
use super::load::shown;
use super::run::counted;
use super::text;
use crate::experiment::WaveRow;
use crate::store::{ExperimentEntry, RunEntry, RunRecord, RunState, latest, list, read_run};

/// Lists experiments and their runs.
pub fn ls(args: &LsArgs, global: &Global) -> Result<Exit, Failure> {
    let mut experiments = list(&global.out);
    let all = experiments.len();
    if args.latest {
        let newest = latest(&global.out).and_then(|folder| folder.canonicalize().ok());
        experiments.retain(|e| newest.is_some() && e.folder.canonicalize().ok() == newest);
    }
    let filtered = narrow(&mut experiments, args);
    if args.json {
        data(&format!("{:#}\n", Json::from(experiments.iter().map(experiment_json).collect::<Vec<_>>())))?;
    } else if all == 0 {
        if !global.quiet {
            talk(&format!("no experiments in {}; `lumbre run SCRIPT` makes one", shown(&global.out)));
        }
    } else if experiments.is_empty() {
        if !global.quiet {
            talk(&format!("no runs like that in {}", shown(&global.out)));
        }
    } else {
        data(&experiments.iter().map(|e| experiment_page(e, filtered)).collect::<Vec<_>>().join("\n"))?;
    }
    Ok(Exit::Done)
}

/// Leaves the runs that are asked for, and the experiments that have some; whether anything was asked for.
fn narrow(experiments: &mut Vec<ExperimentEntry>, args: &LsArgs) -> bool {
    let words: Vec<String> = args.words.iter().map(|word| word.to_lowercase()).collect();
    let states: Vec<String> =
        args.state.iter().filter_map(|s| Some(s.to_possible_value()?.get_name().to_owned())).collect();
    if words.is_empty() && states.is_empty() {
        return false;
    }
    for experiment in experiments.iter_mut() {
        let folder = experiment.folder.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let wanted = |run: &RunEntry| {
            let reason = match &run.state {
                RunState::Done(reason) | RunState::Failed(reason) => reason.as_str(),
                _ => "",
            };
            let path = if run.path.is_empty() { "reference" } else { &run.path };
            let text = format!("{folder} {path} {} {reason}", run.run).to_lowercase();
            (states.is_empty() || states.iter().any(|state| state == run.state.word()))
                && words.iter().all(|word| text.contains(word))
        };
        experiment.runs.retain(&wanted);
        experiment.references.retain(wanted);
    }
    experiments.retain(|e| !e.runs.is_empty() || !e.references.is_empty());
    true
}

/// An experiment with its runs; `filtered` says that these are not all.
fn experiment_page(experiment: &ExperimentEntry, filtered: bool) -> String {
    let mut counts = Vec::new();
    for word in ["done", "elsewhere", "failed", "unfinished", "pending"] {
        let n = experiment.runs.iter().filter(|r| r.state.word() == word).count();
        if n > 0 {
            counts.push(format!("{n} {word}"));
        }
    }
    let cells = counted(experiment.runs.len(), if filtered { "matching cell" } else { "cell" });
    let mut out = format!("{}  {cells}: {}\n", shown(&experiment.folder), counts.join(", "));
    let line = |run: &RunEntry, name: &str| {
        let samples = run.samples.map(|n| format!("{n} spp")).unwrap_or_default();
        let time = run.render_s.map(text::duration).unwrap_or_default();
        let detail = match &run.state {
            RunState::Failed(reason) => reason.clone(),
            RunState::Elsewhere(folder) => format!("in {}", shown(folder)),
            RunState::Done(_) | RunState::Unfinished | RunState::Pending => String::new(),
        };
        let id = run.run[..run.run.len().min(8)].to_owned();
        vec![format!("  {}", run.state.word()), id, name.to_owned(), samples, time, detail]
    };
    let references = experiment.references.iter().map(|r| line(r, "(reference)"));
    let lines: Vec<Vec<String>> = references.chain(experiment.runs.iter().map(|r| line(r, &r.path))).collect();
    out += &text::aligned(&lines);
    out
}

fn experiment_json(experiment: &ExperimentEntry) -> Json {
    let run = |run: &RunEntry| {
        let reason = match &run.state {
            RunState::Done(reason) | RunState::Failed(reason) => Some(reason.clone()),
            RunState::Elsewhere(_) | RunState::Unfinished | RunState::Pending => None,
        };
        let folder = match &run.state {
            RunState::Elsewhere(folder) => folder,
            _ => &run.folder,
        };
        json!({
            "run": run.run, "path": run.path, "state": run.state.word(), "reason": reason,
            "samples": run.samples, "render_s": run.render_s, "folder": shown(folder),
        })
    };
    json!({
        "name": experiment.name,
        "folder": shown(&experiment.folder),
        "hash": experiment.hash,
        "runs": experiment.runs.iter().map(run).collect::<Vec<_>>(),
        "references": experiment.references.iter().map(run).collect::<Vec<_>>(),
    })
}

/// Shows one run.
pub fn show(args: &ShowArgs, global: &Global) -> Result<Exit, Failure> {
    let run = read_run(&global.out, &args.run).map_err(Failure::usage)?;
    if args.json {
        data(&format!("{:#}\n", run_json(&run)))?;
    } else {
        data(&run_page(&run))?;
    }
    Ok(Exit::Done)
}

fn run_page(run: &RunRecord) -> String {
    let mut out = format!("{}\n\n", shown(&run.folder));
    let mut lines = Vec::new();
    flatten("", &run.config, &mut lines);
    // The identity repeats all of it in canonical form; `--json` has it.
    lines.retain(|l| !l[0].starts_with("identity"));
    out += &text::aligned(&lines);
    let state = match &run.done {
        Some(done) => format!("done: {}", done["reason"].as_str().unwrap_or_default()),
        None => "not done".to_owned(),
    };
    // Writing to a String cannot fail.
    let _ = writeln!(out, "\n{state}");
    if let Some(row) = run.rows.last() {
        let _ = writeln!(
            out,
            "after {}: {} spp, {} of render time, {} million paths per second, {} invalid",
            counted(run.rows.len(), "wave"),
            row.samples,
            text::duration(row.render_s),
            text::rounded(row.mpaths_per_s()),
            row.invalid
        );
        if let Some([x, y, sample]) = row.first_invalid {
            let _ = writeln!(out, "the first invalid sample is number {sample} of pixel {x},{y}");
        }
        let metrics = run.columns.iter().zip(&row.metrics).map(|(c, v)| vec![c.clone(), v.to_string()]);
        out += &text::aligned(&metrics.collect::<Vec<_>>());
    }
    out.push('\n');
    let files = run.files.iter().map(|(name, bytes)| vec![name.clone(), text::size(*bytes)]);
    out += &text::aligned(&files.collect::<Vec<_>>());
    out
}

fn flatten(path: &str, json: &Json, lines: &mut Vec<Vec<String>>) {
    match json {
        Json::Object(map) => map.iter().for_each(|(key, value)| {
            let at = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
            flatten(&at, value, lines);
        }),
        Json::Null => {}
        Json::String(text) => lines.push(vec![path.to_owned(), text.clone()]),
        other => lines.push(vec![path.to_owned(), other.to_string()]),
    }
}

fn run_json(run: &RunRecord) -> Json {
    json!({
        "folder": shown(&run.folder),
        "config": run.config,
        "done": run.done,
        "columns": run.columns,
        "last": run.rows.last().map(|row| row_json(row, &run.columns)),
        "waves": run.rows.len(),
        "files": run.files.iter().map(|(name, bytes)| json!({ "name": name, "bytes": bytes })).collect::<Vec<_>>(),
    })
}

fn row_json(row: &WaveRow, columns: &[String]) -> Json {
    let number = |x: &f64| serde_json::Number::from_f64(*x).map_or_else(|| json!(x.to_string()), Json::Number);
    let metrics: serde_json::Map<_, _> = columns.iter().cloned().zip(row.metrics.iter().map(number)).collect();
    json!({
        "wave": row.wave, "samples": row.samples, "render_s": row.render_s, "wall_s": row.wall_s,
        "measure_s": row.measure_s,
        "paths": row.paths, "rays": row.rays, "invalid": row.invalid, "first_invalid": row.first_invalid,
        "metrics": metrics,
    })
}
