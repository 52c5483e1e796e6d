//! `lumbre new`: writes the commented script of an experiment for a scene.

use std::io::{self, BufRead, IsTerminal, Write};
use std::path::PathBuf;

use super::experiment_text::{experiment_name, script_text};
use super::new_technique;
use crate::cli::args::{ComparisonArgs, Global, NewArgs, NewExperimentArgs};
use crate::cli::exit::{Exit, Failure, print_result, print_status};
use crate::cli::format::{display_path, rounded};
use lumbre_light::value::Value;
use lumbre_light::value::schema::duration_s;

/// Runs `lumbre new`.
pub fn main(args: &NewArgs, global: &Global) -> Result<Exit, Failure> {
    match args {
        NewArgs::Experiment(args) => write_script(args, global),
        NewArgs::Technique(args) => new_technique::main(args, global),
    }
}

/// Asks for techniques, time and repeats, and writes the script.
fn write_script(args: &NewExperimentArgs, global: &Global) -> Result<Exit, Failure> {
    let mut comparison = args.comparison.clone();
    let path = args
        .output
        .clone()
        .unwrap_or_else(|| PathBuf::from(format!("{}.lua", experiment_name(&comparison))));
    if path.exists() {
        return Err(Failure::usage(format!(
            "{} exists already; choose another file with -o",
            display_path(&path)
        )));
    }
    if !args.yes && io::stdin().is_terminal() {
        ask(&mut comparison, &mut io::stdin().lock()).map_err(Failure::usage)?;
    }
    let text = script_text(&comparison, &display_path(&path))?;
    lumbre_lua::load_text(&path, text.clone(), lumbre_lua::Limits::default())
        .map_err(Failure::script)?;
    lumbre_night::store::write_atomically(&path, text.as_bytes()).map_err(Failure::internal)?;
    if !global.quiet {
        print_status(&format!(
            "next: lumbre plan {0} shows what it renders; lumbre run {0} renders it",
            display_path(&path)
        ));
    }
    print_result(&format!("{}\n", display_path(&path)))?;
    Ok(Exit::Done)
}

/// Asks three questions; an empty answer keeps what is there.
fn ask(comparison: &mut ComparisonArgs, answers: &mut impl BufRead) -> Result<(), String> {
    let techniques = comparison.techniques.join(",");
    if let Some(answer) = question("Which techniques?", &techniques, answers)? {
        comparison.techniques = answer
            .split(',')
            .map(|name| name.trim().to_owned())
            .collect();
    }
    let time = format!("{}s", rounded(comparison.time));
    if let Some(answer) = question("How long does each run render?", &time, answers)? {
        comparison.time = duration_s(&Value::from(answer.as_str()))
            .filter(|seconds| *seconds > 0.0)
            .ok_or_else(|| format!("`{answer}` is not a duration such as 30s or 5min"))?;
    }
    let repeats = comparison.repeats.to_string();
    if let Some(answer) = question("How many repeats?", &repeats, answers)? {
        comparison.repeats = answer
            .parse()
            .map_err(|_| format!("`{answer}` is not a number of repeats"))?;
    }
    Ok(())
}

/// Asks a question on stderr. Returns `None` for an empty answer, which means `default`.
fn question(
    text: &str,
    default: &str,
    answers: &mut impl BufRead,
) -> Result<Option<String>, String> {
    let mut stderr = io::stderr().lock();
    let _ = write!(stderr, "{text} [{default}] ");
    let _ = stderr.flush();
    let mut answer = String::new();
    answers
        .read_line(&mut answer)
        .map_err(|e| format!("cannot read the answer: {e}"))?;
    let answer = answer.trim();
    Ok((!answer.is_empty()).then(|| answer.to_owned()))
}
