//! Screens: the dashboard and progress lines of a night ([`tui`]), and the interactive program, a
//! picture that renders while its settings change ([`explore`]).

pub mod explore;
pub mod tui;
