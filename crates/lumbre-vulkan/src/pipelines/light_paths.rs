//! Pipelines of the light subpaths that the samples of an iteration share.

use ash::vk;

use super::compute::{Bindings, ComputePipeline};
use super::modules;
use super::render_pipeline::{PUSH, RenderPipeline, Stages};
use crate::error::VulkanError;
use crate::layout::{LIGHT_PATHS_ROW, LIST_BLOCK, ListStep, Specialization, WaveParams};
use crate::memory::light_paths::LightPathBuffers;
use crate::memory::subpaths::light_path_count;
use lumbre_light::transport::integrator::Settings;
use lumbre_light::transport::integrator::iteration::{NO_PIXEL, PREPARED};
use lumbre_light::transport::integrator::lvc::cache;
use lumbre_render::Job;

/// Most workgroups in a row: below the least limit of devices.
const MAX_GROUPS: u32 = 1 << 15;

/// Pipelines that trace light subpaths and list their vertices.
pub struct LightPathPipelines {
    trace: RenderPipeline,
    list: ComputePipeline,
    /// Number of subpaths of an iteration.
    count: u32,
}

impl LightPathPipelines {
    /// Creates the pipelines of a job, or `None` if its samples share no subpaths. Films get nothing
    /// from these subpaths.
    ///
    /// # Errors
    /// Returns an error if a shader cannot be made, or the device refuses it.
    pub(super) fn new(
        stages: &Stages,
        job: &Job,
        constants: &Specialization,
        bindings: &Bindings,
    ) -> Result<Option<LightPathPipelines>, VulkanError> {
        let Some(count) = light_path_count(job) else {
            return Ok(None);
        };
        let name = job.integrator.name;
        let without_films = Specialization {
            layers: 0,
            paths: 0,
            parallel_samples: 0,
            regenerated: 0,
            ..*constants
        };
        let recipe = modules::light_paths(stages.kind, name, stages.extended);
        let title = format!("light subpaths of {name}");
        let list = stages.sources.module(&modules::light_list())?;
        Ok(Some(LightPathPipelines {
            trace: stages.pipeline(&title, &recipe, &without_films, bindings)?,
            list: ComputePipeline::new(
                "list of light vertices",
                &list,
                &Specialization::default(),
                bindings,
                PUSH,
            )?,
            count,
        }))
    }

    /// Records the subpaths of the iteration with this index, after all earlier work.
    pub fn begin(&self, commands: vk::CommandBuffer, bindings: &Bindings, iteration: u64) {
        let first = iteration.wrapping_mul(u64::from(self.count));
        self.record(commands, bindings, (NO_PIXEL[0], first), self.count);
    }

    /// Estimates the mean number of vertices of a subpath, for the weights of all iterations.
    ///
    /// # Errors
    /// Returns an error if the device fails.
    pub fn prepare(
        &self,
        bindings: &Bindings,
        buffers: &LightPathBuffers,
        job: &Job,
    ) -> Result<(), VulkanError> {
        let device = &bindings.device;
        buffers.set_connecting(1.0)?;
        device.run("prepare", |commands| {
            device.barrier_to_shaders(commands);
            let count = cache::PREPARED_PATHS as u32;
            self.record(commands, bindings, (PREPARED[0], 0), count);
            device.barrier_to_copy(commands);
        })?;
        let (listed, settings) = (buffers.listed()?, Settings::new(&job.settings.params));
        buffers.set_connecting(cache::connecting(&settings, listed.into()) as f32)
    }

    /// Records `count` subpaths, samples of the pixel in column and row `pixel` from number `first`
    /// on, and the list of their vertices.
    fn record(
        &self,
        commands: vk::CommandBuffer,
        bindings: &Bindings,
        (pixel, first): (u32, u64),
        count: u32,
    ) {
        let device = &bindings.device;
        let rows = count.div_ceil(LIGHT_PATHS_ROW);
        let wave = WaveParams::new(first, count, pixel, rows);
        self.trace
            .dispatch(commands, bindings, [LIGHT_PATHS_ROW, 1], &wave);
        let blocks = count.div_ceil(LIST_BLOCK);
        let (width, height) = (blocks.min(MAX_GROUPS), blocks.div_ceil(MAX_GROUPS));
        for (step, groups) in [
            (ListStep::Paths, [width, height, 1]),
            (ListStep::Blocks, [1; 3]),
            (ListStep::Vertices, [width, height, 1]),
        ] {
            device.barrier_to_shaders(commands);
            let wave = WaveParams {
                step: step as u32,
                ..wave
            };
            self.list.dispatch(commands, bindings, &wave, groups);
        }
        device.barrier_to_shaders(commands);
    }
}
