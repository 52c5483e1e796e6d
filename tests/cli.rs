//! The program end to end, on the mock backend: what is printed, what is written, and how it exits.

#[path = "cli/errors.rs"]
mod errors;
#[path = "cli/nights.rs"]
mod nights;
#[path = "cli/reading.rs"]
mod reading;
#[cfg(unix)]
#[path = "cli/signals.rs"]
mod signals;
#[path = "cli/workplace.rs"]
mod workplace;
