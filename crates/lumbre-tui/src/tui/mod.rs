//! Terminal output of a night: the dashboard, which draws on a thread of its own, and plain
//! progress lines for outputs that are not a capable terminal.
//!
//! Both receive [`Event`](lumbre_night::experiment::Event)s, fold them into a [`model::night::NightModel`] and
//! return at once, so neither can disturb a timing or lose a result. A frame is a pure function
//! of the model and a [`view::View`]; tests therefore draw whole screens without a terminal.

pub mod axis;
mod command;
mod confirmation;
mod dashboard;
pub mod format;
mod keys;
pub mod live_picture;
pub mod model;
pub(crate) mod modes;
pub mod panes;
pub mod preview;
pub mod progress_lines;
pub mod terminal;
pub mod view;

#[cfg(test)]
mod tests;

pub use dashboard::{Dashboard, LeaveNow, LogHandle, Role};
pub use progress_lines::{ProgressLineOptions, ProgressLines};
pub use terminal::terminal_caps::{
    Colors, Graphics, OutputMode, TerminalCaps, output_mode, use_colors,
};
