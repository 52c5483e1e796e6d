//! How light moves.
pub mod camera;
pub mod integrator;
