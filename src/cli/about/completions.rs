//! `lumbre completions` and `lumbre man`, generated from the definition of the command line.

use super::reference::command;
use crate::cli::exit::{Exit, Failure, print_result};

/// Runs `lumbre completions`: prints the completion script for a shell.
pub fn completions(shell: clap_complete::Shell) -> Result<Exit, Failure> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut command(), "lumbre", &mut script);
    print_result(&String::from_utf8_lossy(&script))?;
    Ok(Exit::Done)
}

/// Runs `lumbre man`: prints the manual page of the program, followed by a page for each verb.
pub fn man() -> Result<Exit, Failure> {
    let command = command();
    let mut page = Vec::new();
    let verbs = command
        .get_subcommands()
        .filter(|verb| verb.get_name() != "help")
        .cloned();
    let pages: Vec<clap::Command> = std::iter::once(command.clone()).chain(verbs).collect();
    for part in pages {
        clap_mangen::Man::new(part)
            .render(&mut page)
            .map_err(|e| Failure::internal(format!("cannot write the manual page: {e}")))?;
    }
    print_result(&String::from_utf8_lossy(&page))?;
    Ok(Exit::Done)
}
