//! The command with which an experiment was last run, from what its folder recorded.

use std::path::{Path, PathBuf};

use clap::Parser;
use serde_json::Value as Json;

use super::args::{Cli, Global, ScriptArgs, Verb};
use super::exit::Failure;
use super::load::shown;

/// The script of the command that last ran in an experiment's folder, as it was narrowed then, and the options that go
/// with it. The current folder becomes the one in which it was given, since scripts name scenes from there.
///
/// # Errors
/// When the folder does not say, or says something that is no such command.
pub fn last_command(experiment: &Path, global: &Global) -> Result<(ScriptArgs, Global), Failure> {
    let file = experiment.join("env.json");
    let unknown = |why: &str| {
        Failure::usage(format!("{} does not say how it was run ({why}); name the script", shown(experiment)))
    };
    let text = std::fs::read(&file).map_err(|e| unknown(&format!("{}: {e}", shown(&file))))?;
    let env: Json = serde_json::from_slice(&text).map_err(|e| unknown(&format!("{}: {e}", shown(&file))))?;
    let given = env["arguments"].as_array().into_iter().flatten().filter_map(Json::as_str);
    let (script, then) = parse(given).map_err(unknown)?;
    let out = std::path::absolute(&global.out).map_err(Failure::usage)?;
    let folder = PathBuf::from(env["folder"].as_str().unwrap_or("."));
    std::env::set_current_dir(&folder).map_err(|e| unknown(&format!("{}: {e}", folder.display())))?;
    let backend = global.backend.clone().or(then.backend);
    let lenient = global.lenient || then.lenient;
    Ok((script, Global { out, backend, lenient, ..global.clone() }))
}

/// The script of a command that made a plan, as it was narrowed, and the options that went with it.
///
/// # Errors
/// Why it is no such command.
pub fn parse<'a>(arguments: impl Iterator<Item = &'a str>) -> Result<(ScriptArgs, Global), &'static str> {
    let cli = Cli::try_parse_from(std::iter::once("lumbre").chain(arguments)).map_err(|_| "no command")?;
    let script = match cli.verb {
        Verb::Run(args) => args.script,
        Verb::Submit(args) => args.to.job().script.clone(),
        Verb::Retry(args) => args.script().ok_or("it was run by `lumbre retry` alone")?,
        _ => return Err("it was not run by `lumbre run`"),
    };
    Ok((script, cli.global))
}

/// The experiment that was run last below `out`.
///
/// # Errors
/// When there is none.
pub fn latest(out: &Path) -> Result<PathBuf, Failure> {
    let link = out.join("latest");
    let folder = match std::fs::read_to_string(&link) {
        // Where there are no links, the file holds the name.
        Ok(name) => out.join(name.trim()),
        Err(_) => link,
    };
    // The link itself is not what later commands should say.
    let folder = std::fs::read_link(&folder).map_or(folder, |name| out.join(name));
    if folder.is_dir() {
        Ok(folder)
    } else {
        Err(Failure::usage(format!("nothing was run in {} yet; name the script", shown(out))))
    }
}
