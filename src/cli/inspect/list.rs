//! `lumbre ls` and `lumbre show`: lists of experiments and runs, read only from files.

use std::fmt::Write as _;
use std::path::Path;

use clap::ValueEnum;
use serde_json::{Value as Json, json};

use super::{explain, guiding};
use crate::cli::args::{Global, LsArgs, ShowArgs};
use crate::cli::exit::{Exit, Failure, print_result, print_status};
use crate::cli::format::{self, counted, display_path};
use crate::cli::{json, selector};
use lumbre_night::experiment::night::run::RunState;
use lumbre_night::experiment::{CellRef, Night, Outcome, WaveRow};
use lumbre_night::store::schema::journal::WaveRecord;
use lumbre_night::store::schema::run::DoneFile;
use lumbre_night::store::{Listing, Measurements, RunRecord, latest_experiment, list_experiments};

/// A line of the list: a run, or a reference that is rendered.
struct Line<'a> {
    id: &'a str,
    /// Readable path, or the name of a reference.
    path: String,
    state: &'a RunState,
    /// Samples and render time, if it is finished.
    last: Option<&'a WaveRow>,
    /// Folder in which it is finished, or will be.
    folder: &'a Path,
}

/// The runs and references of a night that are listed.
struct Listed<'a> {
    night: &'a Night,
    runs: Vec<Line<'a>>,
    references: Vec<Line<'a>>,
}

impl<'a> Listed<'a> {
    /// Lists all runs and rendered references of a night.
    fn new(night: &'a Night) -> Listed<'a> {
        let line = |cell: CellRef, own: &'a Path| {
            let state = night.state(cell)?;
            Some(Line {
                id: night.id(cell),
                path: night.path(cell),
                last: night.last_row(cell),
                folder: match state {
                    RunState::Ended(Outcome::Cached(folder)) => folder,
                    _ => own,
                },
                state,
            })
        };
        let runs = night.runs.iter().enumerate();
        let references = night.references.iter().enumerate();
        let rendered = references.filter(|(_, reference)| reference.is_rendered());
        Listed {
            night,
            runs: runs
                .filter_map(|(i, run)| line(CellRef::Cell(i), &run.folder))
                .collect(),
            references: rendered
                .filter_map(|(i, reference)| line(CellRef::Reference(i), &reference.folder))
                .collect(),
        }
    }

    fn lines(&self) -> impl Iterator<Item = &Line<'a>> {
        self.references.iter().chain(&self.runs)
    }
}

/// Runs `lumbre ls`: lists experiments, and their runs if they are asked for.
pub fn ls(args: &LsArgs, global: &Global) -> Result<Exit, Failure> {
    let Listing {
        mut nights,
        refused,
    } = list_experiments(&global.out);
    for error in &refused {
        print_status(&format!("not listed: {error}"));
    }
    let all = nights.len() + refused.len();
    if args.latest {
        let newest = latest_experiment(&global.out).and_then(|folder| folder.canonicalize().ok());
        nights.retain(|e| newest.is_some() && e.folder.canonicalize().ok() == newest);
    }
    let mut experiments: Vec<Listed> = nights.iter().map(Listed::new).collect();
    let mut problems = !refused.is_empty();
    for line in experiments.iter().flat_map(Listed::lines) {
        if let RunState::Damaged(problem) = line.state {
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
            let page = |e: &Listed| headline(e, filtered) + &run_lines(e);
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
fn filter_runs(experiments: &mut Vec<Listed>, args: &LsArgs) -> bool {
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
        let folder = experiment.night.folder.file_name().unwrap_or_default();
        let folder = folder.to_string_lossy();
        let notes = experiment.night.plan.report.notes.join(" ");
        let matches = |line: &Line| {
            let reason = line.state.reason();
            let text = format!("{folder} {} {} {reason} {notes}", line.path, line.id);
            let text = text.to_lowercase();
            (states.is_empty() || states.iter().any(|state| state == line.state.name()))
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
fn headline(experiment: &Listed, filtered: bool) -> String {
    let mut counts = Vec::new();
    for word in [
        "done",
        "elsewhere",
        "damaged",
        "failed",
        "unfinished",
        "pending",
    ] {
        let runs = experiment.runs.iter();
        let n = runs.filter(|run| run.state.name() == word).count();
        if n > 0 {
            counts.push(format!("{n} {word}"));
        }
    }
    let cells = counted(
        experiment.runs.len(),
        if filtered { "matching cell" } else { "cell" },
    );
    let tags = experiment.night.plan.report.tags().into_iter();
    let tags: String = tags.map(|tag| format!("  {tag}")).collect();
    format!(
        "{}  {cells}: {}{tags}\n",
        display_path(&experiment.night.folder),
        counts.join(", ")
    )
}

/// Formats the references and runs of an experiment, one line each.
fn run_lines(experiment: &Listed) -> String {
    let cells = |line: &Line| {
        let samples = line.last.map(|row| format!("{} spp", row.samples));
        let time = line.last.map(|row| format::duration(row.render_s));
        let detail = match line.state {
            RunState::Ended(Outcome::Failed(reason)) | RunState::Damaged(reason) => reason.clone(),
            RunState::Ended(Outcome::Cached(folder)) => format!("in {}", display_path(folder)),
            _ => String::new(),
        };
        vec![
            format!("  {}", line.state.name()),
            line.id[..line.id.len().min(8)].to_owned(),
            line.path.clone(),
            samples.unwrap_or_default(),
            time.unwrap_or_default(),
            detail,
        ]
    };
    let lines: Vec<Vec<String>> = experiment.lines().map(cells).collect();
    format::aligned(&lines)
}

/// Returns an experiment and its runs as JSON.
fn experiment_json(experiment: &Listed) -> Json {
    let run = |line: &Line| {
        let reason = match line.state {
            RunState::Ended(Outcome::Done(_) | Outcome::Failed(_)) | RunState::Damaged(_) => {
                Some(line.state.reason())
            }
            _ => None,
        };
        json!({
            "run": line.id, "path": line.path, "state": line.state.name(), "reason": reason,
            "samples": line.last.map(|row| row.samples),
            "render_s": line.last.map(|row| row.render_s),
            "folder": display_path(line.folder),
        })
    };
    json!({
        "name": experiment.night.plan.name,
        "folder": display_path(&experiment.night.folder),
        "hash": experiment.night.plan.hash,
        "notes": experiment.night.plan.report.notes,
        "runs": experiment.runs.iter().map(run).collect::<Vec<_>>(),
        "references": experiment.references.iter().map(run).collect::<Vec<_>>(),
    })
}

/// Runs `lumbre show`: prints one run.
pub fn show(args: &ShowArgs, global: &Global) -> Result<Exit, Failure> {
    let run = selector::run(&args.run, &global.out)?;
    if let Some(script) = &args.why {
        explain::print(&run, script.as_deref(), args.json, global)?;
        return Ok(Exit::Done);
    }
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
