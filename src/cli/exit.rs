//! Exit codes of the program, errors that end it, and the functions that print.

use std::io::{IsTerminal, Write};
use std::process::ExitCode;

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};

use lumbre_lua::ScriptError;
use lumbre_night::text::{self, program};
use lumbre_tui::tui;

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
    /// The error in one text, as logs contain it.
    pub message: String,
    /// Error in a script, whose source line is printed below the message.
    script: Option<ScriptError>,
    /// Function of the script in which the error was found, and the point at which it was called.
    call: Option<String>,
}

impl Failure {
    fn new(exit: Exit, error: impl std::fmt::Display) -> Failure {
        Failure {
            exit,
            message: error.to_string(),
            script: None,
            call: None,
        }
    }

    /// Creates a usage error, found before any work.
    pub fn usage(error: impl std::fmt::Display) -> Failure {
        Failure::new(Exit::Usage, error)
    }

    /// Creates a usage error that shows its position in a script.
    pub fn script(error: ScriptError) -> Failure {
        Failure {
            script: Some(error.clone()),
            ..Failure::usage(error)
        }
    }

    /// Creates a usage error inside a call of a function of a script. `call` names the function and
    /// the point at which it was called.
    pub fn script_call(call: &str, error: ScriptError) -> Failure {
        Failure {
            message: format!("{call}: {error}"),
            call: Some(call.to_owned()),
            ..Failure::script(error)
        }
    }

    /// Creates an error about a file that does not match its checksum.
    pub fn damaged(error: impl std::fmt::Display) -> Failure {
        Failure::new(Exit::CellsFailed, error)
    }

    /// Creates an error caused neither by the user nor by a cell, such as a failed write.
    pub fn internal(error: impl std::fmt::Display) -> Failure {
        Failure::new(Exit::Internal, error)
    }

    /// Prints the error to stderr, in colours if stderr shows them and the error has no characters
    /// that control a terminal.
    pub fn print(&self) {
        let plain = self.render(Renderer::plain());
        let colours = tui::use_colors(std::io::stderr().is_terminal(), &|name| {
            std::env::var(name).ok()
        });
        if colours && !plain.contains(text::is_control) {
            let styled = self.render(Renderer::styled());
            let _ = writeln!(std::io::stderr().lock(), "{styled}");
        } else {
            print_status(&plain);
        }
    }

    /// Returns the message. For an error in a script these are its cause, the source line with a mark
    /// and the remedy beside it, and the call in which it was found. Lines are not wrapped, so that
    /// paths can be copied and messages can be searched for.
    fn render(&self, renderer: Renderer) -> String {
        let Some((error, highlight)) = self
            .script
            .as_ref()
            .and_then(|error| Some((error, error.highlight()?)))
        else {
            let title = Level::ERROR.primary_title(self.message.as_str());
            return renderer.render(&[Group::with_title(title)]);
        };
        let title = Level::ERROR.primary_title(error.problem().to_string());
        let mark = AnnotationKind::Primary.span(highlight.span.clone());
        let snippet = Snippet::source(highlight.text.as_ref())
            .path(error.file().to_string_lossy())
            .annotation(mark.label(error.help_text()));
        let mut group = title.element(snippet);
        if let Some(call) = &self.call {
            group = group.element(Level::NOTE.message(format!("found in {call}")));
        }
        renderer.render(&[group])
    }
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
            "{} crashed because of a bug{place}: {}\n\
             Finished runs are safe. Please report this message with the script and the command.",
            program(),
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

    /// Returns the error of loading a script.
    fn load_error(file: &str, text: &str) -> ScriptError {
        let limits = lumbre_lua::Limits::default();
        lumbre_lua::load_text(std::path::Path::new(file), text.to_owned(), limits).unwrap_err()
    }

    #[test]
    fn a_script_error_shows_its_line_with_a_mark() {
        let text = "local x = experiment(\"t\", {})\nx:axis(\"depth\", { 1, \t2 }, \"é\" .. nil)\n";
        let error = load_error("folder/t.lua", text);
        let shown = Failure::script_call("`render` at depth = 1", error).render(Renderer::plain());
        let lines: Vec<&str> = shown.lines().collect();
        assert!(lines[0].starts_with("error: attempt to "), "{shown}");
        assert!(lines[1].ends_with("--> folder/t.lua:2:1"), "{shown}");
        assert!(lines[3].starts_with("2 | x:axis(\"depth\""), "{shown}");
        assert!(lines[4].contains("^^^"), "{shown}");
        assert!(
            lines[6].ends_with("= note: found in `render` at depth = 1"),
            "{shown}"
        );
    }

    #[test]
    fn the_remedy_of_a_script_error_is_beside_its_mark() {
        let text = "local x = experiment(\"t\")\nx:measure { rmse = metric.rmse }\n";
        let error = load_error("t.lua", text);
        let shown = Failure::script(error).render(Renderer::plain());
        let lines: Vec<&str> = shown.lines().collect();
        let cause = "error: measure.rmse: expected a metric, found a function";
        assert_eq!(lines[0], cause, "{shown}");
        assert!(
            lines[4].ends_with("^^^^ add parentheses: metric.rmse()"),
            "{shown}"
        );
    }

    #[test]
    fn a_long_message_stays_on_one_line_and_controls_nothing() {
        let path = "a/long/path/".repeat(40);
        let shown = Failure::usage(format!("no file {path}")).render(Renderer::plain());
        assert_eq!(shown, format!("error: no file {path}"));
        let shown = Failure::usage("bell \u{7} and \u{1b}[31m").render(Renderer::plain());
        assert!(!shown.contains(text::is_control), "{shown:?}");
    }
}
