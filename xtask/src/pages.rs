//! `cargo xtask pages`: the manual page of the program and its shell completions, from the
//! definition of the command line.

use std::path::{Path, PathBuf};

use clap::Command;
use clap_complete::Shell;

use crate::command::write;

/// Options of the chore.
#[derive(clap::Args)]
pub struct Args {
    /// Folder in which `man/man1/lumbre.1` and `completions/SHELL/` are written
    #[arg(long, value_name = "DIR", default_value = "target/share")]
    out: PathBuf,
}

/// Shells with completions, and the names of their files.
const SHELLS: [(Shell, &str); 4] = [
    (Shell::Bash, "lumbre"),
    (Shell::Elvish, "lumbre.elv"),
    (Shell::Fish, "lumbre.fish"),
    (Shell::Zsh, "_lumbre"),
];

/// Writes the pages and prints their folder.
pub fn run(args: &Args) -> Result<(), String> {
    write_all(&args.out)?;
    println!("{}", args.out.display());
    Ok(())
}

/// Writes the manual page and the completions below a folder.
pub fn write_all(share: &Path) -> Result<(), String> {
    let command = lumbre::cli::command();
    write(&share.join("man/man1/lumbre.1"), &manual(&command)?)?;
    for (shell, file) in SHELLS {
        let mut script = Vec::new();
        clap_complete::generate(shell, &mut command.clone(), "lumbre", &mut script);
        let folder = share.join("completions").join(shell.to_string());
        write(&folder.join(file), &script)?;
    }
    Ok(())
}

/// Returns the manual page of the program in roff, followed by a page for each verb.
fn manual(command: &Command) -> Result<Vec<u8>, String> {
    let verbs = command.get_subcommands();
    let verbs = verbs.filter(|verb| verb.get_name() != "help" && !verb.is_hide_set());
    let mut page = Vec::new();
    for part in std::iter::once(command).chain(verbs) {
        clap_mangen::Man::new(part.clone())
            .render(&mut page)
            .map_err(|e| format!("the manual page: {e}"))?;
    }
    Ok(page)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]

    use std::fs;

    use super::*;

    #[test]
    fn the_pages_cover_the_verbs() {
        let folder = tempfile::tempdir().unwrap();
        write_all(folder.path()).unwrap();
        let page = fs::read_to_string(folder.path().join("man/man1/lumbre.1")).unwrap();
        for expected in [".TH", "lumbre-run", "lumbre-doctor", "Exit codes"] {
            assert!(page.contains(expected), "{expected}");
        }
        for (shell, file) in SHELLS {
            let script = folder.path().join("completions").join(shell.to_string());
            let script = fs::read_to_string(script.join(file)).unwrap();
            assert!(script.contains("doctor"), "{shell}");
        }
    }
}
