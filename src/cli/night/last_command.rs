//! Recovery of the last command of an experiment from the `env.json` in its folder.

use std::path::{Path, PathBuf};

use clap::Parser;

use crate::cli::args::{Cli, Global, ScriptArgs, Verb};
use crate::cli::exit::Failure;
use crate::cli::format::display_path;
use lumbre_night::paths::SCRIPT_COPY;
use lumbre_night::store::StoredFile;
use lumbre_night::store::schema::plan::EnvFile;
use lumbre_scene_io::load::files;

/// Returns the script with its axis changes and the global options of the command that last ran an
/// experiment. Changes the current folder to the one in which that command was given, since the
/// paths in a script are relative to it.
///
/// # Errors
/// Returns an error if the folder has no record of a command, or the command does not name a
/// script.
pub fn last_command(experiment: &Path, global: &Global) -> Result<(ScriptArgs, Global), Failure> {
    let unknown = |why: &str| {
        Failure::usage(format!(
            "cannot find out how {} was run ({why}); give the script as an argument",
            display_path(experiment)
        ))
    };
    let env = EnvFile::read(experiment)
        .map_err(|e| unknown(&format!("{}{}", display_path(&e.path), e.problem)))?;
    let arguments = env.arguments.iter().map(String::as_str);
    let home = std::path::absolute(experiment).map_err(Failure::usage)?;
    let (script, recorded) = parse(arguments, &home).map_err(unknown)?;
    let out = std::path::absolute(&global.out).map_err(Failure::usage)?;
    let folder = PathBuf::from(&env.folder);
    std::env::set_current_dir(&folder)
        .map_err(|e| unknown(&format!("{}: {e}", folder.display())))?;
    let backend = global.backend.clone().or(recorded.backend);
    let lenient = global.lenient || recorded.lenient;
    let confine = global.confine.clone().or(recorded.confine);
    if let Some(folder) = &confine {
        files::confine(folder).map_err(|e| unknown(&format!("{}: {e}", folder.display())))?;
    }
    Ok((
        script,
        Global {
            out,
            backend,
            lenient,
            confine,
            ..global.clone()
        },
    ))
}

/// Parses the arguments of a command that made a plan. Returns its script with the axis changes,
/// and its global options. The script of `lumbre compare` is the copy in the folder `home` of the
/// experiment, since the next comparison replaces the other one.
///
/// # Errors
/// Returns the reason if the arguments are not those of such a command.
pub fn parse<'a>(
    arguments: impl Iterator<Item = &'a str>,
    home: &Path,
) -> Result<(ScriptArgs, Global), &'static str> {
    let mut words: Vec<&str> = arguments.collect();
    // Earlier versions had a verb for this, which only options can precede.
    let verb = words.iter().position(|word| !word.starts_with('-'));
    if let Some(verb) = verb.filter(|verb| words[*verb] == "retry") {
        words.splice(verb..=verb, ["run", "--retry"]);
    }
    let cli = Cli::try_parse_from(std::iter::once("lumbre").chain(words))
        .map_err(|_| "the recorded command is invalid")?;
    let script = match cli.verb {
        Verb::Run(args) => args
            .script()
            .ok_or("it was last run by `lumbre run --retry` without a script")?,
        Verb::Submit(args) => args.scheduler.job().script.clone(),
        Verb::Compare(_) => ScriptArgs {
            script: home.join(SCRIPT_COPY),
            ..ScriptArgs::default()
        },
        _ => return Err("it was not run by `lumbre run`"),
    };
    Ok((script, cli.global))
}

/// Returns the folder of the experiment that was run last below `out`.
///
/// # Errors
/// Returns an error if there is none.
pub fn latest(out: &Path) -> Result<PathBuf, Failure> {
    let link = out.join("latest");
    let folder = match std::fs::read_to_string(&link) {
        // On systems without symbolic links, `latest` is a file that contains the name.
        Ok(name) => out.join(name.trim()),
        Err(_) => link,
    };
    // Resolve the link, so that messages name the folder itself.
    let folder = std::fs::read_link(&folder).map_or(folder, |name| out.join(name));
    if folder.is_dir() {
        Ok(folder)
    } else {
        Err(Failure::usage(format!(
            "no experiment was run in {} yet; give the script as an argument",
            display_path(out)
        )))
    }
}
