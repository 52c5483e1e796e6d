//! Permission to run the commands of a script's external techniques and notices: by `--allow-commands`, or by a
//! question in the terminal that is answered once for a script and its commands.
//!
//! The answer is remembered in the user's configuration, never in a folder of results, which may
//! come from someone else: `$XDG_CONFIG_HOME/lumbre/allowed-commands`, by default in `~/.config`.
//! Each line holds the hash of a script with its modules and commands, and the path of the script.

use std::fs::OpenOptions;
use std::io::{self, BufRead, IsTerminal, Write};
use std::path::{Path, PathBuf};

use crate::cli::args::Global;
use crate::cli::exit::{Failure, print_status};
use crate::cli::format::display_path;
use lumbre_lua::Script;
use lumbre_night::experiment::plan::PlannedCommand;
use lumbre_night::text::visible;
use lumbre_render::external::words;

/// Use that a command of the program makes of a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanUse {
    /// The plan is rendered: without permission, an error ends the program.
    Render,
    /// The plan is only shown: without permission, versions of programs remain unknown.
    Show,
}

/// Returns whether the commands of a script may run. Asks in the terminal if the plan is rendered
/// and the question was not answered before.
///
/// # Errors
/// Returns an error if the plan is to be rendered and there is no permission.
pub fn commands_allowed(
    script: &Script,
    commands: &[PlannedCommand],
    usage: PlanUse,
    global: &Global,
) -> Result<bool, Failure> {
    if commands.is_empty() || global.allow_commands {
        return Ok(true);
    }
    let hash = permission_hash(&script.spec.script_hash, commands);
    let file = answers_file();
    if file
        .as_deref()
        .is_some_and(|file| is_remembered(file, &hash))
    {
        return Ok(true);
    }
    if usage == PlanUse::Show {
        return Ok(false);
    }
    let path = &script.spec.script_file;
    if !io::stdin().is_terminal() || !io::stderr().is_terminal() {
        return Err(Failure::usage(format!(
            "{} runs commands of other programs, which needs permission:\n{}add --allow-commands \
             to run them, or answer the question once in a terminal",
            display_path(path),
            listing(commands)
        )));
    }
    if !ask(path, commands) {
        return Err(Failure::usage(
            "the commands of the script are not allowed, so nothing was rendered",
        ));
    }
    match file {
        Some(file) => {
            if let Err(e) = remember(&file, &hash, path) {
                print_status(&format!(
                    "warning: the answer cannot be remembered in {}: {e}",
                    display_path(&file)
                ));
            }
        }
        None => print_status("warning: the answer is not remembered: HOME is not set"),
    }
    Ok(true)
}

/// Returns the commands as lines for people.
pub fn listing(commands: &[PlannedCommand]) -> String {
    let mut out = String::new();
    for command in commands {
        out += &format!(
            "  {}  {}\n",
            command.technique,
            words::line(&command.command)
        );
        if let Some(version) = &command.version {
            out += &format!(
                "  {}  version: {}\n",
                command.technique,
                words::line(version)
            );
        }
    }
    out
}

/// Asks whether the commands may run.
fn ask(script: &Path, commands: &[PlannedCommand]) -> bool {
    let question = format!(
        "{} runs these commands of other programs:\n{}They run with your rights. Allow them for \
         this script? [y/N] ",
        display_path(script),
        listing(commands)
    );
    let mut stderr = io::stderr().lock();
    let _ = write!(stderr, "{}", visible(&question));
    let _ = stderr.flush();
    let mut answer = String::new();
    let read = io::stdin().lock().read_line(&mut answer);
    read.is_ok() && ["y", "yes"].contains(&answer.trim().to_lowercase().as_str())
}

/// Returns the hash of a script with its modules and its commands, in hexadecimal.
fn permission_hash(script_hash: &[u8; 32], commands: &[PlannedCommand]) -> String {
    let mut hasher = blake3::Hasher::new_derive_key("lumbre 1 permission to run commands");
    hasher.update(script_hash);
    let words = commands.iter().flat_map(|command| {
        let version = command.version.iter().flatten();
        command.command.iter().chain(version)
    });
    for word in words {
        hasher.update(&(word.len() as u64).to_le_bytes());
        hasher.update(word.as_bytes());
    }
    hasher.finalize().to_hex().to_string()
}

/// Returns the file of remembered answers, if the user has a configuration folder.
fn answers_file() -> Option<PathBuf> {
    let given = |name: &str| {
        std::env::var_os(name)
            .filter(|value| !value.is_empty())
            .map(PathBuf::from)
    };
    let folder = given("XDG_CONFIG_HOME").or_else(|| Some(given("HOME")?.join(".config")))?;
    Some(folder.join("lumbre").join("allowed-commands"))
}

fn is_remembered(file: &Path, hash: &str) -> bool {
    let text = std::fs::read_to_string(file).unwrap_or_default();
    text.lines()
        .any(|line| line.split(' ').next() == Some(hash))
}

fn remember(file: &Path, hash: &str, script: &Path) -> io::Result<()> {
    if let Some(folder) = file.parent() {
        std::fs::create_dir_all(folder)?;
    }
    let mut answers = OpenOptions::new().create(true).append(true).open(file)?;
    let script = std::path::absolute(script).unwrap_or_else(|_| script.to_owned());
    let line = format!("{hash} {}", script.display());
    answers.write_all(format!("{}\n", visible(&line).replace('\n', " ")).as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn command(words: &str, version: Option<&str>) -> PlannedCommand {
        let split = |line: &str| words::split(line).unwrap();
        PlannedCommand {
            technique: "external:toy".to_owned(),
            command: split(words),
            version: version.map(split),
        }
    }

    #[test]
    fn a_change_of_the_script_or_of_a_command_needs_another_answer() {
        let hash =
            |script: u8, commands: &[PlannedCommand]| permission_hash(&[script; 32], commands);
        let toy = command("toy {spp}", Some("toy --version"));
        let known = hash(1, std::slice::from_ref(&toy));
        assert_eq!(known, hash(1, std::slice::from_ref(&toy)));
        assert_ne!(known, hash(2, std::slice::from_ref(&toy)));
        assert_ne!(
            known,
            hash(1, &[command("toy  {spp}x", Some("toy --version"))])
        );
        assert_ne!(known, hash(1, &[command("toy {spp}", None)]));
        assert_ne!(
            hash(1, &[command("a bc", None)]),
            hash(1, &[command("ab c", None)])
        );
    }

    #[test]
    fn answers_are_remembered_by_their_hash() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("lumbre").join("allowed-commands");
        assert!(!is_remembered(&file, "aa"));
        remember(&file, "aa", Path::new("a.lua")).unwrap();
        remember(&file, "bb", Path::new("b c\n.lua")).unwrap();
        assert!(is_remembered(&file, "aa") && is_remembered(&file, "bb"));
        assert!(!is_remembered(&file, "a") && !is_remembered(&file, ".lua"));
        assert_eq!(std::fs::read_to_string(&file).unwrap().lines().count(), 2);
    }
}
