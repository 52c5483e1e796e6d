//! Execution of a plan: the state machine of a night.
//!
//! Cells are rendered in the order of the plan, each reference once, before the first that needs it. Runs that an
//! earlier night finished are not rendered again. Between two waves, and only then, the night
//! measures, emits events, evaluates stop rules and handles requests of the user. Only the time
//! inside the renderer counts as render time.
//!
//! Waves longer than a second are rendered in slices, between which requests are handled and
//! checkpoints are written. Runs that another process works on are deferred until all others have
//! ended; then the night waits for them or takes them over, polling less and less often.
//!
//! A failed cell (its scene does not compile, its renderer fails or panics, a sink cannot record
//! it, its reference is not available) is recorded with the reason, and the night continues.

mod active_run;
mod attempt;
pub mod backoff;
mod bias_check;
mod cells;
mod checkpoint;
mod night;
mod noise_floor;
mod open;
mod options;
mod references;
mod retry;
mod scenes;
mod smoke;
mod state;
mod summary;
mod turns;
mod waves;
mod work_units;

use std::sync::Arc;
use std::time::Duration;

pub use options::{Open, Options, Seams};
use state::NightRunner;
pub use summary::{Disagreement, NightSummary, RunError};

use super::event::{History, NightControls, Sink};
use super::plan::Plan;
use super::spec::ScriptHooks;

/// Duration of one tick of waiting.
const TICK: Duration = Duration::from_millis(50);

/// Runs a night. The options may be just the number of threads.
///
/// # Errors
/// When a sink fails to receive the first or the last event of the night. Other failures are those
/// of cells.
pub fn run(
    plan: &Arc<Plan>,
    hooks: &dyn ScriptHooks,
    history: &dyn History,
    sinks: &mut [&mut dyn Sink],
    control: &NightControls,
    options: impl Into<Options>,
) -> Result<NightSummary, RunError> {
    let seams = Seams {
        open: &crate::backends::open,
        wait: &|| std::thread::sleep(TICK),
    };
    run_with(&seams, plan, hooks, history, sinks, control, options)
}

/// Runs a night like [`run`], with replaced access to the outside world.
///
/// # Errors
/// The same as for [`run`].
pub fn run_with(
    seams: &Seams<'_>,
    plan: &Arc<Plan>,
    hooks: &dyn ScriptHooks,
    history: &dyn History,
    sinks: &mut [&mut dyn Sink],
    control: &NightControls,
    options: impl Into<Options>,
) -> Result<NightSummary, RunError> {
    NightRunner::new(seams, plan, hooks, history, sinks, control, options.into()).run()
}
