//! The CPU backend. It is the default, needs no device or driver, and is the reference that other
//! backends are tested against.
//!
//! Its films have the same bits for any number of threads, any instruction set, and with or without
//! vectorisation.
//!
//! [`bvh`] builds and traverses hierarchies, [`prepared_scene`] is what jobs on one scene share,
//! `clock` measures render time, [`kept_scenes`] holds it between the runs of a night, [`renderer`] loops over pixels and samples of a `prepared` job, [`films`]
//! sums the samples, `wavefront` holds the SIMD path tracers, `path_trace` records the events of
//! single samples, [`guiding_tree`] shows what guides them, and [`rates`] measures the ray rates that
//! `lumbre bench` prints.

pub mod bvh;
mod clock;
pub mod films;
pub mod guiding_tree;
pub mod kept_scenes;
mod path_trace;
mod prepared;
pub mod prepared_scene;
pub mod rates;
pub mod renderer;
pub(crate) mod wavefront;

pub use films::bin_pool::kept_bytes;

use super::BackendRow;
use super::shaders::Shaders;
use lumbre_light::film::layer;
use lumbre_light::scene::desc::Model;

/// Entry of this backend in the table of backends.
pub const ROW: BackendRow = BackendRow {
    name: "cpu",
    doc: "Multi-threaded CPU renderer; needs no GPU, and is the reference for the other backends.",
    probe: || {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        Ok(format!("{threads} hardware threads"))
    },
    layers: &layer::ALL,
    times: true,
    blends: true,
    light_trees: true,
    uniform_directions: true,
    models: &Model::ALL,
    refuses: |_, _| None,
    shaders: Shaders::without_device,
    accel: true,
    open: |scene, job| Ok(Box::new(kept_scenes::open(scene, job)?)),
    paths: path_trace::paths,
};
