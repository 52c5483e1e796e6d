//! Scheduling of waves: `dispatch_size` splits a wave into dispatches of bounded duration, and
//! `submission` submits them to the queue and measures their time.

pub mod dispatch_size;
pub mod submission;
