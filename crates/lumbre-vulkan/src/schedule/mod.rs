//! Scheduling of waves: `dispatch_size` splits a wave into dispatches of bounded duration,
//! `pixel_samples` decides how a dispatch renders the samples of a pixel, and `submission` submits
//! dispatches to the queue and measures their time.

pub mod dispatch_size;
pub mod pixel_samples;
pub mod submission;
