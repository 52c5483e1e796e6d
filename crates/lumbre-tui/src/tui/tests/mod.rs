//! Tests of screens, keys and progress lines with the events of a synthetic night.

mod comparison;
mod fold;
mod graphics;
mod keys;
mod lines;
mod model;
pub mod night;
mod picture;
mod screens;
mod time;
