//! What the CPU backend renders, against analytic truth, brute force and images made by others.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod common;

#[path = "render/agreement.rs"]
mod agreement;
#[path = "render/agreement_lamps.rs"]
mod agreement_lamps;
#[path = "render/bsdf.rs"]
mod bsdf;
#[path = "render/camera.rs"]
mod camera;
#[path = "render/determinism.rs"]
mod determinism;
#[path = "render/film.rs"]
mod film;
#[path = "render/furnace.rs"]
mod furnace;
#[path = "render/intersection.rs"]
mod intersection;
#[path = "render/lights.rs"]
mod lights;
#[path = "render/oracle.rs"]
mod oracle;
#[path = "render/references.rs"]
mod references;
