//! Files by which processes that work in one folder see each other: claims, heartbeats and device
//! affinities; and the header of the index of finished runs.

use serde::{Deserialize, Serialize};

use super::{files, records};
use crate::experiment::comparison_groups::Affinity;

files! {
    /// Claim of a run: which process renders it.
    pub file ClaimFile = "claim", 1 {
        /// Process that renders the run.
        pub owner: Owner,
        /// Date of the claim, UTC.
        pub since: String,
    }

    /// Heartbeat of a worker or a planner.
    pub file HeartbeatFile = "<worker>.json", 1 {
        /// Process of the worker.
        pub owner: Owner,
        /// Device that it renders on.
        pub device: RenderDevice,
        /// Rule that binds cells to devices.
        pub affinity: Affinity,
        /// Cluster job that it is part of, such as `1207_3`; empty without one.
        pub job: String,
        /// Date at which it joined, UTC.
        pub joined: String,
        /// Current activity: `waiting`, `rendering` with `run` and `path`, or `left` with a reason.
        pub state: WorkerState,
        /// Date at which the state began, UTC.
        pub since: String,
    }

    /// Device affinity of a comparison group: the device on which its cells render.
    pub file AffinityFile = "<group>.json", 1 {
        /// Device of the group.
        pub device: RenderDevice,
        /// First 16 digits of the BLAKE3 hash of the device's key and model, with a newline between
        /// them. A file made by hand may leave it out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub check: Option<String>,
    }

    /// First line of the index of finished runs, `index.jsonl`, whose last files match their
    /// checksums. Each further line is an object with one run: its folder below the output folder, and the values of `fields`.
    pub file IndexHeader = "index.jsonl", 2 {
        /// Names of the values of a line, in order: modification time of the run's last file in
        /// nanoseconds since 1970, its size in bytes, reason of the end, samples per pixel, render
        /// time in seconds.
        pub fields: Vec<String>,
        /// BLAKE3 hash of all further bytes.
        pub blake3: String,
    }
}

records! {
    /// Identity of a process among all processes, on any machine, that share a folder. Neither the
    /// machine's name nor the process number is unique, so a boot id and a random token are added.
    pub struct Owner {
        /// Name of the machine.
        pub host: String,
        /// Boot id of the operating system, empty if unknown. Containers share it with their host,
        /// and with it the file locks.
        pub boot: String,
        /// Number of the process.
        pub process: u32,
        /// Token that distinguishes processes with the same number.
        pub token: String,
    }

    /// Device that cells render on.
    pub struct RenderDevice {
        /// Key that is unique to the device among all machines.
        pub key: String,
        /// Model, for messages. Devices with equal models are interchangeable within a comparison.
        pub model: String,
    }
}

impl Eq for Owner {}

impl Eq for RenderDevice {}

/// Current activity of a worker.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum WorkerState {
    /// It looks for runs to render, or waits for other workers.
    #[default]
    Waiting,
    /// It renders a run, or a shard of a reference.
    Rendering {
        /// Id of the run.
        run: String,
        /// Readable path of the run, or the description of the shard.
        path: String,
    },
    /// It has left, for this reason.
    Left(String),
}
