//! Films in device memory and their copies on the host. `device_film` holds all films of a run,
//! `time_film` those with a time axis.

pub(crate) mod device_film;
pub(crate) mod time_film;
