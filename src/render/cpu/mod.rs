//! The CPU backend: the default that needs nothing else, and the oracle of the others.
//!
//! [`accel`] holds the hierarchy, `packed` its compressed form, which `vulkan-compute` walks as well, `traverse` the one loop through it, [`lanes`] the vectors that both use, [`renderer`] the one loop over pixels and samples, `layers`
//! the sums of films beside the main one, `times` those of films with a time axis, `streams` paths in the lanes of vectors, `row` the sums of a row of pixels, `brought` what samples bring there, [`together`] whose paths these can be, `bins` the memory of these, and [`rates`] the measurement of both loops that `lumbre bench` prints.

pub mod accel;
mod bins;
#[cfg_attr(not(target_arch = "x86_64"), expect(dead_code, reason = "paths go alone"))]
mod brought;
pub(super) mod build;
mod compressed;
mod copies;
mod intersect;
pub mod lanes;
mod layers;
pub(super) mod packed;
mod paths;
pub mod rates;
pub mod renderer;
mod row;
#[cfg_attr(not(target_arch = "x86_64"), path = "streams/none.rs")]
mod streams;
mod times;
pub mod together;
mod traverse;
mod wide;

pub use bins::kept_bytes;

use super::BackendRow;
use crate::scene::desc::Model;

/// The row of this backend.
pub const ROW: BackendRow = BackendRow {
    name: "cpu",
    doc: "All cores of this machine; needs nothing else, and is the oracle of the others.",
    probe: || {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        Ok(format!("{threads} hardware threads"))
    },
    layers: true,
    times: true,
    models: &Model::ALL,
    refuses: |_, _| None,
    edited: || Ok(None),
    accel: true,
    open: |scene, job| Ok(Box::new(renderer::CpuRenderer::new(scene, job)?)),
    paths: paths::paths,
};
