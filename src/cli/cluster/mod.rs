//! Nights on many machines: plans that are frozen for others, workers that take part, and the jobs that start them.

mod frozen;
mod hands;
mod job;
mod queue;
mod roll;
mod submit;
mod work;

pub use frozen::freeze;
pub use hands::Hands;
pub use roll::Roll;
pub use submit::{cancel, submit};
pub use work::{me, say_apart, work};
