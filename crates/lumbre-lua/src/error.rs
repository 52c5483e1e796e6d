//! Errors of scripts, with their position in the source text: [`ScriptError`] and the list of
//! causes, [`Problem`].

use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Cause of a script error.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Problem {
    /// The file cannot be read.
    #[error("cannot read the script: {reason}")]
    Unreadable {
        /// Reason reported by the operating system.
        reason: String,
    },
    /// The file is too large to be a script.
    #[error("the script has {bytes} bytes; at most {limit} are read")]
    TooLarge {
        /// Size of the file in bytes.
        bytes: u64,
        /// Largest accepted size in bytes.
        limit: u64,
    },
    /// The file is not Lua text.
    #[error("the script is not text: {found}")]
    NotText {
        /// Description of the actual content.
        found: String,
    },
    /// Lua cannot parse the text.
    #[error("{message}")]
    Syntax {
        /// Message of the Lua parser.
        message: String,
    },
    /// Running the script raised an error.
    #[error("{message}")]
    Runtime {
        /// Message of the Lua error.
        message: String,
    },
    /// The script exceeded its time limit.
    #[error("{what} ran longer than its limit of {seconds} s")]
    Time {
        /// Activity that ran: loading, or one of the script's functions.
        what: &'static str,
        /// Time limit in seconds.
        seconds: f64,
    },
    /// The script exceeded its memory limit.
    #[error("the script exceeded its limit of {mib} MiB of memory")]
    Memory {
        /// Memory limit in MiB.
        mib: usize,
    },
    /// The script did not return its experiment.
    #[error("the script returned {found}: end it with `return x`")]
    NoExperiment {
        /// Kind of the value that it returned.
        found: String,
    },
    /// An experiment was expected, but the file describes a scene.
    #[error("this is a scene, not an experiment")]
    IsScene,
    /// A scene was expected, but the file did not return one.
    #[error("the file returned {found}: a scene ends with `return s`")]
    NoScene {
        /// Kind of the value that it returned.
        found: String,
    },
    /// No plan can be made of the experiment.
    #[error("{message}")]
    Plan {
        /// Cause and remedy.
        message: String,
    },
    /// A field or an argument is invalid.
    #[error("{path}: {problem}")]
    Field {
        /// Path to the field, such as `render.aa.radius`.
        path: String,
        /// The actual value and the expected one.
        problem: String,
    },
}

/// Error in a script: cause, file, line and help. Its text form starts with `file:line:`.
#[derive(Clone)]
pub struct ScriptError(Box<Inner>);

#[derive(Clone)]
struct Inner {
    file: PathBuf,
    problem: Problem,
    help: Option<String>,
    highlight: Option<Highlight>,
}

/// Part of a source text that an error report marks.
#[derive(Clone)]
pub struct Highlight {
    /// The whole text.
    pub text: Arc<str>,
    /// Marked bytes of the text.
    pub span: Range<usize>,
    /// Line in which the marked bytes begin, from 1.
    pub line: usize,
}

impl ScriptError {
    pub(super) fn new(
        file: &Path,
        problem: Problem,
        help: Option<String>,
        highlight: Option<Highlight>,
    ) -> ScriptError {
        ScriptError(Box::new(Inner {
            file: file.to_owned(),
            problem,
            help,
            highlight,
        }))
    }

    /// Returns the error with another cause and without help, at the same position.
    pub(super) fn with_problem(mut self, problem: Problem) -> ScriptError {
        self.0.problem = problem;
        self.0.help = None;
        self
    }

    /// Returns the file that contains the error.
    pub fn file(&self) -> &Path {
        &self.0.file
    }

    /// Returns the line, from 1; `None` if the file could not be read or the error has no line.
    pub fn line(&self) -> Option<usize> {
        self.0.highlight.as_ref().map(|s| s.line)
    }

    /// Returns the cause of the error.
    pub fn problem(&self) -> &Problem {
        &self.0.problem
    }

    /// Returns the help text, if there is one.
    pub fn help_text(&self) -> Option<&str> {
        self.0.help.as_deref()
    }

    /// Returns the source text with the range that the error marks; `None` if the file could not be
    /// read or the error has no line.
    pub fn highlight(&self) -> Option<&Highlight> {
        self.0.highlight.as_ref()
    }

    /// Returns the part of the source text that the error marks.
    pub fn pointed_at(&self) -> Option<&str> {
        let highlight = self.highlight()?;
        highlight.text.get(highlight.span.clone())
    }
}

impl fmt::Display for ScriptError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:", self.0.file.display())?;
        if let Some(line) = self.line() {
            write!(f, "{line}:")?;
        }
        write!(f, " {}", self.0.problem)?;
        match &self.0.help {
            Some(help) => write!(f, " ({help})"),
            None => Ok(()),
        }
    }
}

impl fmt::Debug for ScriptError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ScriptError({self})")
    }
}

impl std::error::Error for ScriptError {}
