//! Device memory: [`buffer`] allocates and copies buffers, [`upload`] converts a scene and a job to
//! the buffers of `shaders/scene.glsl`, `job_params` the job to its constants, `texel_blocks` stores
//! texels, and `delay_tables` the tables of composed and delayed materials.

pub mod buffer;
pub mod delay_tables;
mod job_params;
pub mod texel_blocks;
pub mod upload;
