//! Messages between a process and its worker.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::codec::{CorruptMessage, decode, encode};
use crate::{Job, OpenStats, RenderError, WaveStats};
use lumbre_light::film::Film;
use lumbre_light::film::time::TimeCube;
use lumbre_light::scene::CompiledScene;

/// Request to a worker.
#[derive(Debug, Serialize, Deserialize)]
pub enum Request {
    /// Caches a scene until the next one arrives.
    Scene(Arc<CompiledScene>),
    /// Opens a run of a backend on that scene, with a run number, and the name of the
    /// [`SharedFilm`](super::shared::SharedFilm) for its film.
    Open(u64, String, Box<Job>, Option<String>),
    /// Adds samples: run, number of samples, and number of samples that may be started
    /// speculatively.
    Advance(u64, u64, u64),
    /// Requests a layer's film: run and index.
    Layer(u64, usize),
    /// Requests the time-resolved film of a run.
    Times(u64),
    /// Requests the checkpoint state of a run.
    Save(u64),
    /// Restores a checkpoint state.
    Restore(u64, Vec<u8>),
    /// Ends a run; there is no reply.
    Close(u64),
    /// Opens the device that runs will be rendered on.
    Device,
}

/// Reply of a worker.
#[derive(Debug, Serialize, Deserialize)]
pub enum Reply {
    /// First message of a worker: its version.
    Ready(String),
    /// The run is open.
    Opened(OpenStats),
    /// Samples were added; the current film is attached.
    Advanced(WaveStats, Film),
    /// Samples were added; the film, whose number of samples is attached, is in shared memory.
    AdvancedShared(WaveStats, u64),
    /// Film of a layer.
    Layer(Film),
    /// Time-resolved film, if the run has a time axis.
    Times(Option<TimeCube>),
    /// Checkpoint state of a run, if its backend supports checkpoints.
    Saved(Option<Vec<u8>>),
    /// The state was restored; the current film is attached.
    Restored(Film),
    /// The state could not be written.
    SaveFailed(String),
    /// The device was opened, or why it cannot be; `None` too if there is no device.
    Device(Option<String>),
    /// The request failed.
    Failed(RenderError),
    /// Heartbeat, sent every [`HEARTBEAT`](super::process::HEARTBEAT); not a reply.
    Heartbeat,
}

impl Request {
    /// Encodes the message.
    pub fn encode(&self) -> Vec<u8> {
        encode(self)
    }

    /// Decodes a message.
    ///
    /// # Errors
    /// Returns [`CorruptMessage`] if the bytes are not a message.
    pub fn decode(bytes: &[u8]) -> Result<Request, CorruptMessage> {
        decode(bytes)
    }
}

impl Reply {
    /// Encodes the message.
    pub fn encode(&self) -> Vec<u8> {
        encode(self)
    }

    /// Decodes a message.
    ///
    /// # Errors
    /// Returns [`CorruptMessage`] if the bytes are not a message.
    pub fn decode(bytes: &[u8]) -> Result<Reply, CorruptMessage> {
        decode(bytes)
    }
}
