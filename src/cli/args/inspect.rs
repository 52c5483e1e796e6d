//! Options of the verbs that inspect nights and runs: `explain`, `watch`, `status`, `ls`,
//! `note`, `show`.

use std::path::PathBuf;

use clap::Args;

/// Options of `lumbre watch`.
#[derive(Args, Debug)]
pub struct WatchArgs {
    /// Night: its folder, `latest`, or words of its name [default: the latest one].
    pub folder: Option<PathBuf>,
    /// Serve the page of the report instead, for a browser of this machine, until Ctrl-C ends it.
    /// Takes a free port unless one is given.
    #[arg(long, value_name = "PORT", num_args = 0..=1, require_equals = true, default_missing_value = "0")]
    pub page: Option<u16>,
}

/// Options of `lumbre status`.
#[derive(Args, Debug)]
pub struct StatusArgs {
    /// Night: its folder, `latest`, or words of its name [default: the latest one].
    pub folder: Option<PathBuf>,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}

/// Options of `lumbre note`.
#[derive(Args, Debug)]
pub struct NoteArgs {
    /// Night: its folder, `latest`, or words of its name.
    pub night: PathBuf,
    /// Text of the note; words that start with `#` are tags. Without it, all notes are printed.
    pub text: Option<String>,
}

/// States of runs by which `lumbre ls` filters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum StateName {
    /// Finished in its own folder.
    Done,
    /// Finished in another folder of the same experiment.
    Elsewhere,
    /// Its last file is damaged.
    Damaged,
    /// The last attempt failed.
    Failed,
    /// Started but not ended: running or interrupted.
    Unfinished,
    /// Not yet started.
    Pending,
}

/// Options of `lumbre ls`.
#[derive(Args, Debug)]
pub struct LsArgs {
    /// Show only runs that contain all these words in their experiment, the notes on it, their
    /// path, id or reason.
    ///
    /// Examples: `depth=5`, `veach`
    pub words: Vec<String>,
    /// Show only runs in this state (repeatable).
    #[arg(long, value_name = "STATE")]
    pub state: Vec<StateName>,
    /// Show only the latest experiment, with its runs.
    #[arg(long)]
    pub latest: bool,
    /// List the runs of every experiment; without words or a state there is one line for each
    /// experiment.
    #[arg(long)]
    pub runs: bool,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}

/// Options of `lumbre show`.
#[derive(Args, Debug)]
pub struct ShowArgs {
    /// Run: its folder, first digits of its id, `latest`, or words of its path.
    ///
    /// `latest` is the last run to start or end. Example: `"depth=5 technique=nee rep=0"`
    #[arg(default_value = "latest")]
    pub run: String,
    /// Explain why it would or would not be rendered again by a script [default: the one that its
    /// experiment was last run with].
    ///
    /// Prints the setting in which the run differs from the script, a damaged or missing file, the
    /// error of its last attempt, or the checkpoint from which it would resume.
    #[arg(long, value_name = "SCRIPT", num_args = 0..=1, conflicts_with = "tree")]
    pub why: Option<Option<PathBuf>>,
    /// Train the tree of a guided run again, and draw it where the camera sees this pixel.
    ///
    /// The figure has the regions of the tree, and the density of directions in the region of the
    /// first surface in the middle of the pixel.
    #[arg(long, value_name = "X,Y", value_parser = crate::cli::scene::trace::pixel)]
    pub tree: Option<[u32; 2]>,
    /// Write the figure of `--tree` to TO.svg and TO.png [default: tree-RUN].
    #[arg(short = 'o', long = "to", value_name = "TO", requires = "tree")]
    pub to: Option<PathBuf>,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}
