//! Device memory: [`buffer`] allocates and copies buffers, [`upload`] converts a scene and a job to
//! the buffers of `shaders/scene.glsl`, `job_params` the job to its constants, `texel_blocks` stores
//! texels, `subpaths` the vertices of subpaths, `light_paths` the light subpaths that samples share, and
//! `delay_tables` the tables of composed and delayed materials.

pub mod buffer;
pub mod delay_tables;
mod job_params;
pub mod light_paths;
pub mod subpaths;
pub mod texel_blocks;
pub mod texel_words;
pub mod upload;
