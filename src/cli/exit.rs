//! How the program ends: exit codes, and errors shown to people.

use std::io::Write;
use std::process::ExitCode;

/// What the help says below the options: how the program ends, and where its words go.
pub const EXPLAINED: &str = "\
Exit codes:
    0  all done
    1  internal error
    2  usage, script or scene error, found before any work
    3  some cells failed
    4  a limit was reached with work left
    5  verification failed
    6  a second technique contradicts a reference
   75  ended by SIGTERM or SIGUSR1 after the current wave; run again to go on
  130  ended by Ctrl-C (128 plus the signal's number by a second signal, at once)

Every end but the last writes a checkpoint: the same command goes on to the same bytes.
SIGHUP, from a terminal that closed, writes one now, and the night goes on.

Data goes to stdout, talk to stderr. NO_COLOR switches colours off.";

/// How the program ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// All done.
    Done,
    /// Something that should not happen did.
    Internal,
    /// A usage, script or scene error, found before any work.
    Usage,
    /// Some cells failed.
    CellsFailed,
    /// Work is left.
    WorkLeft,
    /// A check of `verify` failed.
    NotVerified,
    /// A second technique contradicts a reference.
    Disagreement,
    /// SIGTERM or SIGUSR1 ended the night between waves; the same command goes on.
    Checkpointed,
    /// The user ended the night.
    Interrupted,
}

impl Exit {
    /// The process's status.
    pub fn code(self) -> u8 {
        match self {
            Exit::Done => 0,
            Exit::Internal => 1,
            Exit::Usage => 2,
            Exit::CellsFailed => 3,
            Exit::WorkLeft => 4,
            Exit::NotVerified => 5,
            Exit::Disagreement => 6,
            Exit::Checkpointed => 75,
            Exit::Interrupted => 130,
        }
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> ExitCode {
        ExitCode::from(exit.code())
    }
}

/// An error that ends the program, and the status it ends with.
#[derive(Debug)]
pub struct Failure {
    /// The status.
    pub exit: Exit,
    /// What people read; a script's error carries the line it is about.
    pub report: miette::Report,
}

impl Failure {
    /// An error of the user's, found before any work.
    pub fn usage(error: impl std::fmt::Display) -> Failure {
        Failure { exit: Exit::Usage, report: miette::Report::msg(error.to_string()) }
    }

    /// The same, with a mark under the place in the source.
    pub fn diagnostic(error: impl miette::Diagnostic + Send + Sync + 'static) -> Failure {
        Failure { exit: Exit::Usage, report: miette::Report::new(error) }
    }

    /// An error that is neither the user's nor a cell's.
    pub fn internal(error: impl std::fmt::Display) -> Failure {
        Failure { exit: Exit::Internal, report: miette::Report::msg(error.to_string()) }
    }

    /// Shows the error on stderr.
    pub fn show(&self) {
        talk(&format!("{:?}", self.report));
    }
}

/// Shows errors without folding their lines, so that a path in one can be copied and a message searched for.
pub fn hook_reports() {
    // A hook that is set already shows errors too.
    let _ = miette::set_hook(Box::new(|_| Box::new(miette::MietteHandlerOpts::new().wrap_lines(false).build())));
}

/// Writes a line for people to stderr. A closed stderr is nobody's loss.
pub fn talk(line: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}

/// Writes data to stdout. A reader that has seen enough (`lumbre ls | head`) is no error.
///
/// # Errors
/// When stdout cannot be written for another reason, such as a full disk.
pub fn data(text: &str) -> Result<(), Failure> {
    let mut stdout = std::io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Failure::internal(format!("cannot write to stdout: {e}")))
        }
        _ => Ok(()),
    }
}

/// Makes a panic end with a short request instead of a backtrace. Tests and developers who set `RUST_BACKTRACE` still
/// get the backtrace.
pub fn hook_panics() {
    let standard = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        if std::env::var_os("RUST_BACKTRACE").is_some() {
            standard(info);
        }
        let place = info.location().map(|l| format!(" at {}:{}", l.file(), l.line())).unwrap_or_default();
        let payload = info.payload();
        let what = payload.downcast_ref::<&str>().copied().or(payload.downcast_ref::<String>().map(String::as_str));
        talk(&format!(
            "lumbre {} stopped because of a mistake of its own{place}: {}\n\
             Finished runs are safe. Please report this with the script and the command.",
            env!("CARGO_PKG_VERSION"),
            what.unwrap_or("no message")
        ));
    }));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_exit_code_is_explained_in_the_help_and_in_the_readme() {
        use Exit::{
            CellsFailed, Checkpointed, Disagreement, Done, Internal, Interrupted, NotVerified, Usage, WorkLeft,
        };
        let readme = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/README.md"));
        let (_, told) = readme.split_once("Exit codes:").unwrap();
        let told: Vec<&str> = told.split("\n\n").next().unwrap().split_whitespace().collect();
        let all = [Done, Internal, Usage, CellsFailed, WorkLeft, NotVerified, Disagreement, Checkpointed, Interrupted];
        for code in all.map(|exit| exit.code().to_string()) {
            let line = format!("{code}  ");
            assert!(EXPLAINED.lines().any(|l| l.trim_start().starts_with(&line)), "{code} in the help");
            assert!(told.contains(&code.as_str()), "{code} in the README");
        }
    }
}
