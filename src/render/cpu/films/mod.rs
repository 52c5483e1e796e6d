//! Films of the CPU backend: the sums of samples for the picture, for layers and for time bins.
//! [`row_film`] accumulates a row of pixels, [`layers`] and [`time_film`] the films beside the main
//! one, [`contributions`] sorts what a batch of vectorised paths found, and [`bin_pool`] recycles
//! memory.

pub(crate) mod bin_pool;
#[cfg_attr(
    not(target_arch = "x86_64"),
    expect(dead_code, reason = "the wavefront renderer needs x86-64")
)]
pub(crate) mod contributions;
pub(crate) mod layers;
pub(crate) mod row_film;
pub(crate) mod time_film;
