//! The terminal: a dashboard that lives on its own thread, and plain lines where there is no terminal.
//!
//! Both listen to [`Event`](crate::experiment::Event)s, fold them into a [`model::Model`], and can neither disturb a
//! timing nor lose a result: an event is taken in and the listener returns, whatever the terminal does. What is
//! drawn is a pure function of the model and of a [`view::View`], so that whole screens are tested without a
//! terminal.

pub mod axis;
pub mod column;
mod command;
pub mod curve;
mod dashboard;
pub mod device;
pub mod entry;
pub mod eta;
pub mod guard;
pub mod line;
pub mod look;
pub mod model;
pub mod offscreen;
pub mod panes;
pub mod preview;
pub mod reel;
pub mod rows;
pub mod sharp;
pub mod thumbs;
pub mod view;
pub mod words;
pub mod workers;

#[cfg(test)]
mod tests;

pub use dashboard::{Dashboard, LeaveNow, Role, Voice};
pub use line::{LineOptions, LineSink};
pub use look::{Colors, Graphics, Look, Mode, colored, wanted};
