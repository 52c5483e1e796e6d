//! Films in device memory and their copies on the host. `device_film` holds all films of a run,
//! `time_film` those with a time axis.

pub mod device_film;
pub mod time_film;
