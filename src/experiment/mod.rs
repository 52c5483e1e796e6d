//! The experiment: what a script asks for, the plan it expands to, and the state machine that carries it out.
//!
//! Everything here is plain data or a trait: nothing knows Lua, files, or the terminal. [`Sink`]s listen to
//! [`Event`]s and cannot disturb a timing; [`ScriptHooks`] are called between waves on the control thread.

pub mod agree;
pub mod control;
pub mod event;
pub mod evidence;
pub mod floors;
pub mod forecast;
pub mod groups;
pub mod memory;
pub mod outline;
pub mod parts;
pub mod plan;
pub mod processor;
pub mod run;
pub mod spec;
pub mod standing;
pub mod stop;

pub use event::{CellRef, Control, Event, History, Outcome, PauseAt, Sink, SinkError, WaveRow};
pub use outline::Outline;
pub use plan::{Cell, Overrides, Plan, PlanError, RunId};
pub use run::{CellResult, NightSummary, RunError};
pub use spec::{CellConfig, Point, ScriptHooks, Spec};
pub use stop::StopRule;
