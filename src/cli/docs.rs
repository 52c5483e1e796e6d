//! `lumbre completions` and `lumbre man`, from the definitions that parse.

use clap::CommandFactory;

use super::args::Cli;
use super::exit::{Exit, Failure, data};

/// Prints completions for a shell.
pub fn completions(shell: clap_complete::Shell) -> Result<Exit, Failure> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "lumbre", &mut script);
    data(&String::from_utf8_lossy(&script))?;
    Ok(Exit::Done)
}

/// Prints the manual page: the program first, then a page for each verb.
pub fn man() -> Result<Exit, Failure> {
    let mut command = Cli::command();
    command.build();
    let mut page = Vec::new();
    let verbs = command.get_subcommands().filter(|verb| verb.get_name() != "help").cloned();
    let pages: Vec<clap::Command> = std::iter::once(command.clone()).chain(verbs).collect();
    for part in pages {
        clap_mangen::Man::new(part)
            .render(&mut page)
            .map_err(|e| Failure::internal(format!("cannot make the manual: {e}")))?;
    }
    data(&String::from_utf8_lossy(&page))?;
    Ok(Exit::Done)
}
