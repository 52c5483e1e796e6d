//! Whole screens, whole nights, keys and lines, on a made-up experiment.

mod fold;
mod keys;
mod lines;
pub mod night;
mod picture;
mod screens;
mod time;
