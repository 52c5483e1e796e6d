//! What can be wrong with a script, with the place in its text.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use miette::{Diagnostic, LabeledSpan, NamedSource, SourceCode, SourceSpan};

/// What is wrong.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Problem {
    /// The file cannot be read at all.
    #[error("cannot read the script: {reason}")]
    Unreadable {
        /// What the system said.
        reason: String,
    },
    /// The file is too large to be a script.
    #[error("the script has {bytes} bytes; at most {limit} are read")]
    TooLarge {
        /// Its size, or as much of it as was looked at.
        bytes: u64,
        /// The limit.
        limit: u64,
    },
    /// The file is no Lua text.
    #[error("the script is not text: {found}")]
    NotText {
        /// What it is instead.
        found: String,
    },
    /// Lua cannot parse it.
    #[error("{message}")]
    Syntax {
        /// Lua's own words.
        message: String,
    },
    /// Lua stopped with an error.
    #[error("{message}")]
    Runtime {
        /// Lua's own words.
        message: String,
    },
    /// It ran too long.
    #[error("{what} ran longer than its limit of {seconds} s")]
    Time {
        /// What ran: loading, or one of the script's functions.
        what: &'static str,
        /// The limit.
        seconds: f64,
    },
    /// It wanted too much memory.
    #[error("the script wants more than its limit of {mib} MiB of memory")]
    Memory {
        /// The limit.
        mib: usize,
    },
    /// It did not end with its experiment.
    #[error("the script returned {found}: end it with `return x`")]
    NoExperiment {
        /// What it returned.
        found: String,
    },
    /// An experiment was expected, and it describes a scene.
    #[error("this is a scene, not an experiment")]
    IsScene,
    /// A scene was expected, and it did not end with one.
    #[error("the file returned {found}: a scene ends with `return s`")]
    NoScene {
        /// What it returned.
        found: String,
    },
    /// A field or an argument is wrong.
    #[error("{path}: {problem}")]
    Field {
        /// The path to the field, such as `render.aa.radius`.
        path: String,
        /// What was found and what was expected.
        problem: String,
    },
}

/// A script's error: what is wrong, in which file and line, and what helps.
///
/// As a [`Diagnostic`] it shows the line itself; as text it starts with `file:line:`.
#[derive(Clone)]
pub struct ScriptError(Box<Inner>);

#[derive(Clone)]
struct Inner {
    file: PathBuf,
    problem: Problem,
    help: Option<String>,
    spot: Option<Spot>,
}

/// A place in a text that is at hand.
#[derive(Clone)]
pub(super) struct Spot {
    pub(super) text: Arc<NamedSource<String>>,
    pub(super) span: SourceSpan,
    pub(super) line: usize,
}

impl ScriptError {
    pub(super) fn new(file: &Path, problem: Problem, help: Option<String>, spot: Option<Spot>) -> ScriptError {
        ScriptError(Box::new(Inner { file: file.to_owned(), problem, help, spot }))
    }

    /// The file it is about.
    pub fn file(&self) -> &Path {
        &self.0.file
    }

    /// The line, from 1, unless the file could not be read or no line is to blame.
    pub fn line(&self) -> Option<usize> {
        self.0.spot.as_ref().map(|s| s.line)
    }

    /// What is wrong.
    pub fn problem(&self) -> &Problem {
        &self.0.problem
    }

    /// What would help, if anything is known.
    pub fn help_text(&self) -> Option<&str> {
        self.0.help.as_deref()
    }

    /// The part of the text that the error points at.
    pub fn pointed_at(&self) -> Option<&str> {
        let spot = self.0.spot.as_ref()?;
        spot.text.inner().get(spot.span.offset()..spot.span.offset() + spot.span.len())
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

/// The help stands in the message itself, which logs show too; given here again, a report would say it twice.
impl Diagnostic for ScriptError {
    fn code<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        let code = match self.0.problem {
            Problem::Unreadable { .. } => "script::unreadable",
            Problem::TooLarge { .. } => "script::too_large",
            Problem::NotText { .. } => "script::not_text",
            Problem::Syntax { .. } => "script::syntax",
            Problem::Runtime { .. } => "script::runtime",
            Problem::Time { .. } => "script::time_limit",
            Problem::Memory { .. } => "script::memory_limit",
            Problem::NoExperiment { .. } => "script::no_experiment",
            Problem::IsScene => "script::is_scene",
            Problem::NoScene { .. } => "script::no_scene",
            Problem::Field { .. } => "script::field",
        };
        Some(Box::new(code))
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.0.spot.as_ref().map(|s| s.text.as_ref() as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let spot = self.0.spot.as_ref()?;
        Some(Box::new(std::iter::once(LabeledSpan::new_with_span(Some("here".to_owned()), spot.span))))
    }
}
