//! Nights on many machines: plan snapshots for workers, the workers, and the cluster jobs that
//! start them.

mod job;
mod local_workers;
mod plan_snapshot;
mod queue;
mod submit;
mod work;
mod worker_list;

pub use local_workers::LocalWorkers;
pub use plan_snapshot::save_plan_snapshot;
pub use submit::{cancel, submit};
pub use work::{work, worker_info};
pub use worker_list::WorkerList;
