//! What is asked and answered.

use std::sync::Arc;

use super::wire::{Blob, Garbled, Reader, Wire, decode, encode};
use crate::film::Film;
use crate::film::time::TimeCube;
use crate::render::{Job, OpenStats, RenderError, WaveStats};
use crate::scene::CompiledScene;

/// What this program asks a worker.
#[derive(Debug)]
pub enum Request {
    /// A scene to keep until the next one comes.
    Scene(Arc<CompiledScene>),
    /// To open a run of a backend on that scene, under a number, and where its film is to be left, by the name of a
    /// [`SharedFilm`](super::shared::SharedFilm).
    Open(u64, String, Box<Job>, Option<String>),
    /// To add so many samples, and how many are likely to follow.
    Advance(u64, u64, u64),
    /// The film of a layer.
    Layer(u64, usize),
    /// The light of a run by its time.
    Times(u64),
    /// The state of a run.
    Save(u64),
    /// To take such a state.
    Restore(u64, Blob),
    /// To end a run.
    Close(u64),
}

/// What the worker answers.
#[derive(Debug)]
pub enum Reply {
    /// The first word of a worker: its version.
    Ready(String),
    /// A run is open.
    Opened(OpenStats),
    /// Samples were added, and this is the film now.
    Advanced(WaveStats, Film),
    /// Samples were added, and the film now, of so many, is where it was to be left.
    Left(WaveStats, u64),
    /// A layer's film.
    Layer(Film),
    /// The light by its time, of a film with a time axis.
    Times(Option<TimeCube>),
    /// A run's state.
    Saved(Option<Blob>),
    /// A state was taken, and this is the film now.
    Restored(Film),
    /// A state could not be written.
    Unsaved(String),
    /// It cannot be done.
    Failed(RenderError),
    /// No answer, but a sign of life: one every [`BEAT`](super::process::BEAT).
    Alive(),
}

/// Enums as a number and the fields of the variant.
macro_rules! enums {
    ($($ty:ident { $($number:literal: $variant:ident($($field:ident),*)),+ $(,)? })+) => { $(impl Wire for $ty {
        fn put(&self, to: &mut Vec<u8>) {
            match self {
                $($ty::$variant($($field),*) => { $number.put(to); $($field.put(to);)* })+
            }
        }

        fn take(from: &mut Reader<'_>) -> Result<$ty, Garbled> {
            match u8::take(from)? {
                $($number => { $(let $field = Wire::take(from)?;)* Ok($ty::$variant($($field),*)) })+
                _ => Err(Garbled),
            }
        }
    })+ };
}

enums! {
    Request {
        0u8: Scene(scene), 1u8: Open(run, backend, job, film), 2u8: Advance(run, samples, more), 3u8: Layer(run, index),
        4u8: Save(run), 5u8: Restore(run, state), 6u8: Close(run), 7u8: Times(run),
    }
    Reply {
        0u8: Ready(version), 1u8: Opened(stats), 2u8: Advanced(stats, film), 3u8: Layer(film), 4u8: Saved(state),
        5u8: Restored(film), 6u8: Unsaved(problem), 7u8: Failed(error), 8u8: Times(cube), 9u8: Alive(),
        10u8: Left(stats, samples),
    }
}

impl Request {
    /// Its bytes.
    pub fn encode(&self) -> Vec<u8> {
        encode(self)
    }

    /// From its bytes.
    ///
    /// # Errors
    /// When they are none.
    pub fn decode(bytes: &[u8]) -> Result<Request, Garbled> {
        decode(bytes)
    }
}

impl Reply {
    /// Its bytes.
    pub fn encode(&self) -> Vec<u8> {
        encode(self)
    }

    /// From its bytes.
    ///
    /// # Errors
    /// When they are none.
    pub fn decode(bytes: &[u8]) -> Result<Reply, Garbled> {
        decode(bytes)
    }
}
