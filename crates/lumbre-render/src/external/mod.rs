//! Techniques of other programs. A [`Technique`] describes how a program is run; a run requests as
//! many samples at a time as the run loop needs next, each wave with a seed of its own.
//!
//! Programs come in two shapes. A one-shot program is started for each wave and renders it to a
//! file. A server is started once for each run and renders waves as lines on its standard input
//! request them; `docs/reference/external.md` describes its protocol, which the bridge to
//! Mitsuba 3 speaks too.
//!
//! An external technique has curves, stop rules, tables and checkpoints like any other. Its render
//! time is what the program reports, or the wall clock of its processes. A run is repeatable to the
//! bit only if its waves end at the same samples and the program repeats itself.
//!
//! Commands of scripts run only if the caller [allows](Access) it. No shell runs them, and nothing
//! in a scene or a picture becomes a part of a command.

mod batch_film;
mod clock;
mod mitsuba;
mod picture;
mod process;
mod renderer;
mod server;
pub mod technique;
pub mod words;

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use super::{Job, RenderError, Renderer};
use lumbre_light::film::layer::Layer;
use lumbre_light::scene::SceneDesc;
use lumbre_light::transport::camera::{FilterKind, FilterSpec};
use lumbre_light::transport::integrator::IntegratorRow;
use lumbre_light::transport::integrator::external::is_declared;
use lumbre_light::value::Value;

pub use process::{end_all, output};
pub use technique::Technique;

use process::{Interruption, Patience, Process, Talk, printable};

/// Name used as backend in runs of external programs.
pub const BACKEND: &str = "external";

/// Whether and how long a run may use other programs.
#[derive(Clone, Copy)]
pub struct Access<'a> {
    /// Whether commands of scripts may run. The bridge to Mitsuba 3 needs no permission.
    pub commands: bool,
    /// Whether the caller no longer wants the result; asked while a program is awaited.
    pub cancelled: &'a dyn Fn() -> bool,
}

/// Returns the technique of a run.
///
/// # Errors
/// Returns a message if a parameter is wrong.
pub fn technique_of(
    row: &IntegratorRow,
    integrator: &str,
    params: &BTreeMap<String, Value>,
) -> Result<Technique, String> {
    if is_declared(row) {
        Technique::declared(integrator, params)
    } else {
        Ok(mitsuba::technique(params))
    }
}

/// Returns the version of a technique's program: the first line that its version command prints, or
/// nothing if it has no such command. Runs that command, so the caller must have permission.
///
/// # Errors
/// Returns a message if the command cannot be started, fails, prints nothing or takes too long.
pub fn probe(technique: &Technique) -> Result<Option<String>, String> {
    let (_, Some(words)) = technique.command_lines() else {
        return Ok(None);
    };
    let shown = words.first().map(String::as_str).unwrap_or_default();
    let mut process = Process::start(&words, Talk::None)?;
    let limit = technique.version_timeout();
    let patience = Patience {
        until: Instant::now() + limit,
        cancelled: &|| false,
    };
    let ended = process.wait(&patience);
    let (status, _) = ended.map_err(|_| {
        format!(
            "`{shown}` did not print its version within {} s",
            limit.as_secs_f64()
        )
    })?;
    if !status.success() {
        return Err(format!(
            "`{shown}` failed ({status}): {}",
            process.last_lines()
        ));
    }
    let output = process.stdout();
    let first = output.lines().map(str::trim).find(|line| !line.is_empty());
    first
        .map(|line| Some(printable(line)))
        .ok_or_else(|| format!("`{shown}` printed no version"))
}

/// Returns which setting of a run a technique does not support, as a message.
pub fn refusal(
    technique: &Technique,
    filter: FilterSpec,
    sampler: &str,
    films: &[Layer],
    timed: bool,
    rr_start: Option<u32>,
) -> Option<String> {
    let kind = filter.kind;
    let is_pixel = kind == FilterKind::Box && filter.radius == 0.5;
    if timed {
        Some("external programs do not support `film.time`: leave `film` out".to_owned())
    } else if let Err(reason) = picture::layer_channels(films, &technique.layers) {
        Some(reason)
    } else if technique.filters.is_empty() && !is_pixel {
        Some("it uses a box filter of one pixel: leave `aa` out, or declare `filters`".to_owned())
    } else if !technique.filters.is_empty() && !technique.filters.contains_key(kind.name()) {
        Some(format!("it declares no filter `{}`", kind.name()))
    } else if sampler != "independent" {
        Some("external programs use a sampler of their own: leave `sampler` out".to_owned())
    } else if rr_start.is_some() {
        Some(
            "external programs do not support Russian roulette settings: leave `rr` out".to_owned(),
        )
    } else {
        None
    }
}

/// Why a command failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CommandFailure {
    /// Description for people, with the last output of the command.
    pub reason: String,
    /// Whether it was ended because it took too long.
    pub timed_out: bool,
}

/// Runs a command to its end. Its output is discarded.
///
/// # Errors
/// Returns an error if it cannot be started, takes longer than `limit` or does not exit with status
/// 0.
pub fn run_once(command: &[String], limit: Duration) -> Result<(), CommandFailure> {
    let failure = |reason: String, timed_out: bool| CommandFailure { reason, timed_out };
    let mut process = Process::start(command, Talk::None).map_err(|e| failure(e, false))?;
    let patience = Patience {
        until: Instant::now() + limit,
        cancelled: &|| false,
    };
    let reason = match process.wait(&patience) {
        Ok((status, _)) if status.success() => return Ok(()),
        Ok((status, _)) => format!("it failed ({status})"),
        Err(_) => format!("it was ended after {} s", limit.as_secs_f64()),
    };
    let output = process.last_lines();
    let output = if output.is_empty() {
        output
    } else {
        format!(": {output}")
    };
    let timed_out = reason.starts_with("it was ended");
    Err(failure(reason + &output, timed_out))
}

/// Starts a run of an external program. `integrator` is the name of the technique.
///
/// # Errors
/// Returns an error if the commands of scripts are not allowed, the scene cannot be exported, or a
/// server fails before it is ready.
pub fn open(
    scene: &SceneDesc,
    integrator: &str,
    job: &Job,
    access: &Access<'_>,
) -> Result<Box<dyn Renderer>, RenderError> {
    let technique =
        technique_of(job.integrator, integrator, &job.settings.params).map_err(failed)?;
    if is_declared(job.integrator) && !access.commands {
        return Err(RenderError::unsupported(
            BACKEND,
            format!(
                "{integrator} runs a command of the script, which is not allowed: add \
                 --allow-commands"
            ),
        ));
    }
    let renderer = renderer::ExternalRenderer::start(technique, scene, job, access)?;
    Ok(Box::new(renderer))
}

fn failed(reason: impl ToString) -> RenderError {
    RenderError::failed(BACKEND, reason)
}

/// Returns the error for a program that was not waited for any longer.
fn interrupted(why: Interruption, limit: Duration, process: &Process) -> RenderError {
    match why {
        Interruption::Cancelled => RenderError::Cancelled { backend: BACKEND },
        Interruption::Timeout => failed(with_output(
            format!(
                "it took longer than {} s, the `timeout` of the technique, and was ended",
                limit.as_secs_f64()
            ),
            process,
        )),
    }
}

/// Appends the last lines of a program's output to an error message.
fn with_output(problem: String, process: &Process) -> String {
    let lines = process.last_lines();
    if lines.is_empty() {
        format!("{problem}; it wrote no output")
    } else {
        format!("{problem}; its last output: {lines}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_interpreter_is_reported() {
        let params = BTreeMap::from([("python".to_owned(), Value::from("/nowhere/python"))]);
        let reason = probe(&mitsuba::technique(&params)).unwrap_err();
        assert!(
            reason.contains("`/nowhere/python` cannot be started"),
            "{reason}"
        );
    }
}
