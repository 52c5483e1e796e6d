//! `lumbre ls` and `lumbre show`: lists of experiments and runs, read only from files.

use std::fmt::Write as _;
use std::path::Path;

use clap::ValueEnum;
use serde_json::{Value as Json, json};

use super::guiding;
use crate::cli::args::{Global, LsArgs, ShowArgs};
use crate::cli::exit::{Exit, Failure, print_result, print_status};
use crate::cli::format::{self, counted, display_path};
use crate::cli::{json, selector};
use crate::store::schema::journal::WaveRecord;
use crate::store::schema::run::DoneFile;
use crate::store::{
    ExperimentEntry, Listing, Measurements, RunEntry, RunRecord, RunState, latest_experiment,
    list_experiments,
};

/// Runs `lumbre ls`: lists experiments, and their runs if they are asked for.
pub fn ls(args: &LsArgs, global: &Global) -> Result<Exit, Failure> {
    let Listing {
        mut experiments,
        refused,
    } = list_experiments(&global.out);
    for error in &refused {
        print_status(&format!("not listed: {error}"));
    }
    let all = experiments.len() + refused.len();
    if args.latest {
        let newest = latest_experiment(&global.out).and_then(|folder| folder.canonicalize().ok());
        experiments.retain(|e| newest.is_some() && e.folder.canonicalize().ok() == newest);
    }
    let mut problems = !refused.is_empty();
    for run in experiments
        .iter()
        .flat_map(|e| e.references.iter().chain(&e.runs))
    {
        if let RunState::Damaged(problem) = &run.state {
            print_status(&format!("damaged: {problem}"));
            problems = true;
        }
    }
    let filtered = filter_runs(&mut experiments, args);
    if args.json {
        let experiments: Vec<Json> = experiments.iter().map(experiment_json).collect();
        json::print(json!({ "experiments": experiments }))?;
    } else if all == 0 {
        if !global.quiet {
            print_status(&format!(
                "no experiments in {}; run one with `lumbre run SCRIPT`",
                display_path(&global.out)
            ));
        }
    } else if experiments.is_empty() {
        if !global.quiet {
            print_status(&format!(
                "no runs like that in {}",
                display_path(&global.out)
            ));
        }
    } else {
        let text = if filtered || args.runs || args.latest {
            let page = |e: &ExperimentEntry| headline(e, filtered) + &run_lines(e);
            experiments.iter().map(page).collect::<Vec<_>>().join("\n")
        } else {
            experiments.iter().map(|e| headline(e, false)).collect()
        };
        print_result(&text)?;
    }
    Ok(Exit::unless_problems(problems))
}

/// Removes the runs that do not match the words and states of the arguments, and experiments
/// without matching runs. Returns whether the arguments contain a filter.
fn filter_runs(experiments: &mut Vec<ExperimentEntry>, args: &LsArgs) -> bool {
    let words: Vec<String> = args.words.iter().map(|word| word.to_lowercase()).collect();
    let states: Vec<String> = args
        .state
        .iter()
        .filter_map(|s| Some(s.to_possible_value()?.get_name().to_owned()))
        .collect();
    if words.is_empty() && states.is_empty() {
        return false;
    }
    for experiment in experiments.iter_mut() {
        let folder = experiment
            .folder
            .file_name()
            .map(|n| n.to_string_lossy().into_owned())
            .unwrap_or_default();
        let matches = |run: &RunEntry| {
            let reason = match &run.state {
                RunState::Done(reason) | RunState::Failed(reason) | RunState::Damaged(reason) => {
                    reason.as_str()
                }
                _ => "",
            };
            let text = format!("{folder} {} {} {reason}", run.path, run.run).to_lowercase();
            (states.is_empty() || states.iter().any(|state| state == run.state.name()))
                && words.iter().all(|word| text.contains(word))
        };
        experiment.runs.retain(&matches);
        experiment.references.retain(matches);
    }
    experiments.retain(|e| !e.runs.is_empty() || !e.references.is_empty());
    true
}

/// Formats folder and number of runs of an experiment. `filtered` means that these are not all of
/// its runs.
fn headline(experiment: &ExperimentEntry, filtered: bool) -> String {
    let mut counts = Vec::new();
    for word in [
        "done",
        "elsewhere",
        "damaged",
        "failed",
        "unfinished",
        "pending",
    ] {
        let n = experiment
            .runs
            .iter()
            .filter(|r| r.state.name() == word)
            .count();
        if n > 0 {
            counts.push(format!("{n} {word}"));
        }
    }
    let cells = counted(
        experiment.runs.len(),
        if filtered { "matching cell" } else { "cell" },
    );
    format!(
        "{}  {cells}: {}\n",
        display_path(&experiment.folder),
        counts.join(", ")
    )
}

/// Formats the references and runs of an experiment, one line each.
fn run_lines(experiment: &ExperimentEntry) -> String {
    let line = |run: &RunEntry, name: &str| {
        let samples = run.samples.map(|n| format!("{n} spp")).unwrap_or_default();
        let time = run.render_s.map(format::duration).unwrap_or_default();
        let detail = match &run.state {
            RunState::Failed(reason) | RunState::Damaged(reason) => reason.clone(),
            RunState::Elsewhere(folder) => format!("in {}", display_path(folder)),
            RunState::Done(_) | RunState::Unfinished | RunState::Pending => String::new(),
        };
        let id = run.run[..run.run.len().min(8)].to_owned();
        vec![
            format!("  {}", run.state.name()),
            id,
            name.to_owned(),
            samples,
            time,
            detail,
        ]
    };
    let references = experiment.references.iter().map(|r| line(r, &r.path));
    let lines: Vec<Vec<String>> = references
        .chain(experiment.runs.iter().map(|r| line(r, &r.path)))
        .collect();
    format::aligned(&lines)
}

/// Returns an experiment and its runs as JSON.
fn experiment_json(experiment: &ExperimentEntry) -> Json {
    let run = |run: &RunEntry| {
        let reason = match &run.state {
            RunState::Done(reason) | RunState::Failed(reason) | RunState::Damaged(reason) => {
                Some(reason.clone())
            }
            RunState::Elsewhere(_) | RunState::Unfinished | RunState::Pending => None,
        };
        let folder = match &run.state {
            RunState::Elsewhere(folder) => folder,
            _ => &run.folder,
        };
        json!({
            "run": run.run, "path": run.path, "state": run.state.name(), "reason": reason,
            "samples": run.samples, "render_s": run.render_s, "folder": display_path(folder),
        })
    };
    json!({
        "name": experiment.name,
        "folder": display_path(&experiment.folder),
        "hash": experiment.hash,
        "runs": experiment.runs.iter().map(run).collect::<Vec<_>>(),
        "references": experiment.references.iter().map(run).collect::<Vec<_>>(),
    })
}

/// Runs `lumbre show`: prints one run.
pub fn show(args: &ShowArgs, global: &Global) -> Result<Exit, Failure> {
    let run = selector::run(&args.run, &global.out)?;
    for problem in &run.problems {
        print_status(&format!(
            "left out: {}: {problem}",
            display_path(&run.folder)
        ));
    }
    if let Some(pixel) = args.tree {
        guiding::show(args, global, &run, pixel)?;
    } else if args.json {
        json::print(run_json(&run))?;
    } else {
        print_result(&run_page(&run))?;
    }
    Ok(Exit::unless_problems(!run.problems.is_empty()))
}

/// Formats the configuration, last measurements and files of a run.
fn run_page(run: &RunRecord) -> String {
    let mut out = format!("{}\n\n", display_path(&run.folder));
    let mut lines = Vec::new();
    flatten("", &json!(run.config), &mut lines);
    // The identity repeats the configuration in canonical form; it is printed only with `--json`.
    lines.retain(|l| !l[0].starts_with("identity"));
    out += &format::aligned(&lines);
    let state = match &run.done {
        None if !run.problems.is_empty() => format!("damaged: {}", run.problems.join("; ")),
        Some(DoneFile::Rendered(results)) => format!("done: {}", results.reason),
        Some(DoneFile::Imported(reference)) => {
            format!(
                "copy of {}",
                display_path(Path::new(&reference.imported_from))
            )
        }
        None => "not done".to_owned(),
    };
    // Writing to a String cannot fail.
    let _ = writeln!(out, "\n{state}");
    if let Some(line) = memory_line(run) {
        let _ = writeln!(out, "{line}");
    }
    let measured = &run.measurements;
    if let Some(row) = measured.rows.last() {
        let _ = writeln!(
            out,
            "after {}: {} spp, {} of render time, {} million paths per second, {} invalid",
            counted(measured.rows.len(), "wave"),
            row.samples,
            format::duration(row.render_s),
            format::rounded(row.mpaths_per_s()),
            row.invalid
        );
        if let Some([x, y, sample]) = row.first_invalid {
            let _ = writeln!(
                out,
                "the first invalid sample is sample {sample} of pixel {x},{y}"
            );
        }
        let metrics = measured
            .columns
            .iter()
            .zip(&row.metrics)
            .map(|(c, v)| vec![c.clone(), format::precise(*v)]);
        out += &format::aligned(&metrics.collect::<Vec<_>>());
    }
    out.push('\n');
    let files = run
        .files
        .iter()
        .map(|(name, bytes)| vec![name.clone(), format::size(*bytes)]);
    out += &format::aligned(&files.collect::<Vec<_>>());
    out
}

/// Returns the memory of a finished run's scene and hierarchy; `None` if it is not known.
fn memory_line(run: &RunRecord) -> Option<String> {
    let Some(DoneFile::Rendered(results)) = &run.done else {
        return None;
    };
    let open = &results.open;
    Some(format!(
        "memory: geometry {}, textures {}, hierarchy {}",
        format::size(open.geometry_bytes?),
        format::size(open.texture_bytes?),
        format::size(open.accel_bytes)
    ))
}

/// Appends a line of path and value for every leaf of a JSON value, except nulls.
fn flatten(path: &str, json: &Json, lines: &mut Vec<Vec<String>>) {
    match json {
        Json::Object(map) => map.iter().for_each(|(key, value)| {
            let at = if path.is_empty() {
                key.clone()
            } else {
                format!("{path}.{key}")
            };
            flatten(&at, value, lines);
        }),
        Json::Null => {}
        Json::String(text) => lines.push(vec![path.to_owned(), text.clone()]),
        other => lines.push(vec![path.to_owned(), other.to_string()]),
    }
}

/// Returns a run with its last measurements and files as JSON.
fn run_json(run: &RunRecord) -> Json {
    let Measurements { columns, rows } = &run.measurements;
    json!({
        "folder": display_path(&run.folder),
        "config": run.config,
        "done": run.done,
        "problems": run.problems,
        "columns": columns,
        "last": rows.last().map(|row| WaveRecord::new(row, columns)),
        "waves": rows.len(),
        "files": run.files.iter().map(|(name, bytes)| json!({ "name": name,
            "bytes": bytes })).collect::<Vec<_>>(),
    })
}
