//! Pipelines: [`modules`] lists the shader modules, [`sources`] provides their SPIR-V, [`compute`]
//! and `ray_tracing` create pipelines, [`program`] combines entry, traversal and integrator for a
//! run, [`light_paths`] traces the subpaths that its samples share, `cache` stores the driver's pipeline cache, [`statistics`] what drivers report of compiled
//! pipelines, `once_per_key` creates every pipeline once, and [`test_kernel`] runs single GLSL functions
//! in tests. [`glsl`] compiles modules by an installed compiler, and `shrink` makes them smaller.

mod bound_resource;
pub mod cache;
mod committed;
pub mod compute;
pub mod glsl;
pub mod light_paths;
pub mod modules;
mod once_per_key;
pub mod program;
pub mod ray_tracing;
pub mod recipe;
mod registry;
mod render_pipeline;
mod shader_error;
pub mod shrink;
pub mod sources;
pub mod statistics;
pub mod test_kernel;
mod tracing_mode;
