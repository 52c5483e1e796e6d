//! Nights that many workers render together: plan snapshot, worker registry, reference shards,
//! completion markers, and a simulation of a large cluster.

pub(crate) mod completion_markers;
pub(crate) mod plan_snapshot;
pub(crate) mod registry;
pub(crate) mod session;
pub(crate) mod shards;
pub mod worker_store;
