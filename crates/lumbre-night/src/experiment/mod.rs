//! Experiments: the request of a script, the plan that it expands to, and the night that renders
//! it.
//!
//! A script's [`ExperimentSpec`] is expanded to a [`Plan`] of cells and references, which [`run`]
//! carries out. This module holds plain data and traits and does not depend on Lua, files or the
//! terminal. [`Sink`]s receive [`Event`]s between waves, where they cannot disturb a timing;
//! [`ScriptHooks`] are also called between waves, on the control thread.

pub mod aa_check;
pub mod bias_check;
pub mod comparison_groups;
pub mod event;
pub mod figure_x;
pub mod forecast;
pub mod hook_error;
pub mod memory;
pub mod night;
pub mod noise_floor;
pub mod outcome;
pub mod plan;
pub mod processor_time;
pub mod run;
pub mod run_progress;
pub mod shards;
pub mod sheet;
pub mod spec;
pub mod stop;
pub mod table_value;

pub use event::{Event, History, NightControls, PauseAt, Sink, SinkError};
pub use night::Night;
pub use outcome::{CellRef, EndCause, Outcome, WaveRow};
pub use plan::{Cell, Overrides, Plan, PlanError, RunId};
pub use run::{NightSummary, RunError};
pub use spec::{ExperimentSpec, Point, ScriptHooks};
pub use stop::StopRule;
