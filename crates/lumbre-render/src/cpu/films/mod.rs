//! Films of the CPU backend: the sums of samples for the picture, for layers and for time bins.
//!
//! [`row_film`] accumulates a row of pixels, [`layers`] and [`time_film`] hold the films beside the
//! main one, [`first_hits`] finds the surfaces that layers show, [`contributions`] sorts the
//! contributions of a batch of vectorised paths, and [`bin_pool`] recycles memory.
//!
//! Invariants: one thread adds the samples of a pixel, in the order of their index; splats are
//! added in fixed point, in any order; and a sample that the main film rejects is rejected by all
//! films, so that layers and time bins still add up to the picture.

pub mod bin_pool;
pub mod contributions;
pub mod first_hits;
pub mod layers;
pub mod row_film;
pub mod time_film;
