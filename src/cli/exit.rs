//! Exit codes of the program, errors that end it, and the functions that print.

use std::io::Write;
use std::process::ExitCode;

use crate::text;

/// Text below the options of `--help`: exit codes, signals and output streams.
pub const EXIT_CODES_HELP: &str = "\
Exit codes:
    0  all done
    1  internal error
    2  usage, script or scene error, found before any work
    3  some cells failed, or files of runs do not match their checksums and were left out
    4  a limit was reached with work left
    5  verification failed
    6  a second technique contradicts a reference
   75  stopped by SIGTERM or SIGUSR1 after the current wave; run the same command to resume
  130  stopped by Ctrl-C (a second signal exits at once with 128 plus its number)

Every exit except the one by a second signal saves a checkpoint. Run the same command to resume; \
the results are identical.
If the terminal closes (SIGHUP), lumbre saves a checkpoint and keeps running without the dashboard; \
a SIGHUP more than a second later exits at once.

Results go to stdout, status messages to stderr. Set NO_COLOR to disable colours.";

/// Reasons for which the program ends, each with its exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// Everything was done.
    Done,
    /// An internal error occurred, such as a bug or an unwritable file.
    Internal,
    /// A usage, script or scene error was found before any work.
    Usage,
    /// Some cells failed, or files of runs do not match their checksums.
    CellsFailed,
    /// A limit was reached with work left.
    WorkLeft,
    /// A check of `verify` failed, or `reproduce` found a difference.
    NotVerified,
    /// A second technique contradicts a reference.
    Disagreement,
    /// SIGTERM or SIGUSR1 ended the night between waves; the same command resumes it.
    Checkpointed,
    /// The user stopped the night.
    Interrupted,
}

impl Exit {
    /// Returns the exit of a command that left out what does not match its checksum, or of one that
    /// found no such problems.
    pub fn unless_problems(found: bool) -> Exit {
        if found { Exit::CellsFailed } else { Exit::Done }
    }

    /// Returns the exit code of the process.
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

/// Error that ends the program, with its exit code.
#[derive(Debug)]
pub struct Failure {
    /// Exit code of the program.
    pub exit: Exit,
    /// Message to print. An error in a script includes the source line.
    pub report: miette::Report,
}

impl Failure {
    /// Creates a usage error, found before any work.
    pub fn usage(error: impl std::fmt::Display) -> Failure {
        Failure {
            exit: Exit::Usage,
            report: miette::Report::msg(error.to_string()),
        }
    }

    /// Creates a usage error that marks its position in the source.
    pub fn diagnostic(error: impl miette::Diagnostic + Send + Sync + 'static) -> Failure {
        Failure {
            exit: Exit::Usage,
            report: miette::Report::new(error),
        }
    }

    /// Creates an error about a file that does not match its checksum.
    pub fn damaged(error: impl std::fmt::Display) -> Failure {
        Failure {
            exit: Exit::CellsFailed,
            report: miette::Report::msg(error.to_string()),
        }
    }

    /// Creates an error caused neither by the user nor by a cell, such as a failed write.
    pub fn internal(error: impl std::fmt::Display) -> Failure {
        Failure {
            exit: Exit::Internal,
            report: miette::Report::msg(error.to_string()),
        }
    }

    /// Prints the error to stderr, in colours if stderr is a terminal and the error has no
    /// characters that control it.
    pub fn print(&self) {
        let theme = miette::GraphicalTheme::unicode_nocolor();
        let handler = miette::GraphicalReportHandler::new_themed(theme).with_wrap_lines(false);
        let mut plain = String::new();
        let rendered = handler.render_report(&mut plain, self.report.as_ref());
        if rendered.is_ok() && !plain.contains(text::is_control) {
            let _ = writeln!(std::io::stderr().lock(), "{:?}", self.report);
        } else {
            print_status(&plain);
        }
    }
}

/// Configures error reports without line wrapping, so that paths can be copied and messages can be
/// searched for.
pub fn install_report_hook() {
    // If another hook is already installed, it prints the errors.
    let _ = miette::set_hook(Box::new(|_| {
        Box::new(miette::MietteHandlerOpts::new().wrap_lines(false).build())
    }));
}

/// Prints a status line to stderr, with control characters made visible. Write errors, such as a
/// closed stderr, are ignored.
pub fn print_status(line: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{}", text::visible(line));
}

/// Writes result text to stdout, with control characters made visible. A closed pipe, as in `lumbre ls | head`, is not an error.
///
/// # Errors
/// Returns an error if stdout cannot be written for another reason, such as a full disk.
pub fn print_result(text: &str) -> Result<(), Failure> {
    let mut stdout = std::io::stdout().lock();
    match stdout
        .write_all(text::visible(text).as_bytes())
        .and_then(|()| stdout.flush())
    {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Failure::internal(format!("cannot write to stdout: {e}")))
        }
        _ => Ok(()),
    }
}

/// Makes a panic print a short bug report request instead of a backtrace. With `RUST_BACKTRACE` set
/// the backtrace is printed as well.
pub fn install_panic_hook() {
    let standard = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        if std::env::var_os("RUST_BACKTRACE").is_some() {
            standard(info);
        }
        let place = info
            .location()
            .map(|l| format!(" at {}:{}", l.file(), l.line()))
            .unwrap_or_default();
        let payload = info.payload();
        let what = payload
            .downcast_ref::<&str>()
            .copied()
            .or(payload.downcast_ref::<String>().map(String::as_str));
        print_status(&format!(
            "lumbre {} crashed because of a bug{place}: {}\n\
             Finished runs are safe. Please report this message with the script and the command.",
            env!("CARGO_PKG_VERSION"),
            what.unwrap_or("no message")
        ));
    }));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_exit_code_is_explained_in_the_help() {
        use Exit::{
            CellsFailed, Checkpointed, Disagreement, Done, Internal, Interrupted, NotVerified,
            Usage, WorkLeft,
        };
        let all = [
            Done,
            Internal,
            Usage,
            CellsFailed,
            WorkLeft,
            NotVerified,
            Disagreement,
            Checkpointed,
            Interrupted,
        ];
        for code in all.map(|exit| exit.code().to_string()) {
            let line = format!("{code}  ");
            assert!(
                EXIT_CODES_HELP
                    .lines()
                    .any(|l| l.trim_start().starts_with(&line)),
                "{code} in the help"
            );
        }
    }
}
