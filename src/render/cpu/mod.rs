//! The CPU backend. It is the default, has no dependencies, and is the reference that other
//! backends are tested against.
//!
//! [`bvh`] holds the hierarchies and their traversal, [`renderer`] the loop over pixels and
//! samples, [`films`] the sums that samples are added to, `wavefront` the SIMD path tracers,
//! [`vectorizable`] the rule which runs can use them, and [`rates`] the ray rates that `lumbre
//! bench` prints.

pub mod bvh;
pub mod films;
mod path_trace;
pub mod rates;
pub mod renderer;
pub mod vectorizable;
#[cfg_attr(not(target_arch = "x86_64"), path = "wavefront/unsupported.rs")]
mod wavefront;

pub use films::bin_pool::kept_bytes;

use super::BackendRow;
use crate::scene::desc::Model;

/// Table row of this backend.
pub const ROW: BackendRow = BackendRow {
    name: "cpu",
    doc: "Multi-threaded CPU renderer; needs no GPU, and is the reference for the other backends.",
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
    paths: path_trace::paths,
};
