//! Coordination between processes: run claims, process identities, device affinity, and detection
//! of network file systems.

pub mod claim;
pub(crate) mod device_affinity;
pub(crate) mod exclusive_file;
pub mod filesystem_kind;
pub(crate) mod owner;
