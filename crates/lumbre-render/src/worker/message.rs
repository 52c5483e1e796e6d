//! Messages between a process and its worker.

use std::sync::Arc;

use super::wire::{Blob, CorruptMessage, Reader, Wire, decode, encode};
use crate::{Job, OpenStats, RenderError, WaveStats};
use lumbre_light::film::Film;
use lumbre_light::film::time::TimeCube;
use lumbre_light::scene::CompiledScene;

/// Request to a worker.
#[derive(Debug)]
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
    Restore(u64, Blob),
    /// Ends a run; there is no reply.
    Close(u64),
}

/// Reply of a worker.
#[derive(Debug)]
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
    Saved(Option<Blob>),
    /// The state was restored; the current film is attached.
    Restored(Film),
    /// The state could not be written.
    SaveFailed(String),
    /// The request failed.
    Failed(RenderError),
    /// Heartbeat, sent every [`HEARTBEAT`](super::process::HEARTBEAT); not a reply.
    Heartbeat(),
}

/// Implements [`Wire`] for enums as a number followed by the fields of the variant.
macro_rules! enums {
    ($($ty:ident {
        $($number:literal: $variant:ident($($field:ident),*)),+ $(,)?
    })+) => { $(impl Wire for $ty {
        fn write_to(&self, to: &mut Vec<u8>) {
            match self {
                $($ty::$variant($($field),*) => { $number.write_to(to); $($field.write_to(to);)* })+
            }
        }

        fn read_from(from: &mut Reader<'_>) -> Result<$ty, CorruptMessage> {
            match u8::read_from(from)? {
                $($number => {
                    $(let $field = Wire::read_from(from)?;)*
                    Ok($ty::$variant($($field),*))
                })+
                _ => Err(CorruptMessage),
            }
        }
    })+ };
}

enums! {
    Request {
        0u8: Scene(scene), 1u8: Open(run, backend, job, film), 2u8: Advance(run, samples, more),
        3u8: Layer(run, index), 4u8: Save(run), 5u8: Restore(run, state), 6u8: Close(run),
        7u8: Times(run),
    }
    Reply {
        0u8: Ready(version), 1u8: Opened(stats), 2u8: Advanced(stats, film), 3u8: Layer(film),
        4u8: Saved(state), 5u8: Restored(film), 6u8: SaveFailed(problem), 7u8: Failed(error),
        8u8: Times(cube), 9u8: Heartbeat(),
        10u8: AdvancedShared(stats, samples),
    }
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
