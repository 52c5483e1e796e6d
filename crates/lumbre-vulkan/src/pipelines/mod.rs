//! Pipelines: [`spirv`] compiles GLSL, [`compute`] and `ray_tracing` create pipelines, [`program`]
//! combines entry, traversal and integrator for a run, `cache` stores the driver's pipeline cache,
//! and [`test_kernel`] runs single GLSL functions in tests.

pub mod cache;
pub mod compute;
pub mod program;
pub mod ray_tracing;
pub mod spirv;
pub mod test_kernel;
