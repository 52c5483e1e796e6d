//! Pipelines that trace paths, by a compute shader or by ray-tracing shaders.

use ash::vk;

use super::compute::{Bindings, ComputePipeline};
use super::modules::HitStage;
use super::ray_tracing::{RayTracingPipeline, Shaders};
use super::recipe::Recipe;
use super::sources::Sources;
use super::tracing_mode::TracingMode;
use crate::error::VulkanError;
use crate::layout::{Specialization, WaveParams};

/// Bytes of push constants.
pub(super) const PUSH: u32 = size_of::<WaveParams>() as u32;

/// Pipeline that traces paths.
pub(super) enum RenderPipeline {
    /// Pipeline of a compute shader.
    Compute(ComputePipeline),
    /// Pipeline of ray-tracing shaders.
    RayTracing(Box<RayTracingPipeline>),
}

/// The parts that pipelines of a run are made of.
pub(super) struct Stages<'a> {
    /// Method by which rays are traced.
    pub kind: TracingMode,
    /// Source of modules.
    pub sources: &'a Sources,
    /// Whether modules are extended.
    pub extended: bool,
}

impl Stages<'_> {
    /// Creates a pipeline that traces paths, with the module of `recipe`.
    pub fn pipeline(
        &self,
        title: &str,
        recipe: &Recipe,
        constants: &Specialization,
        bindings: &Bindings,
    ) -> Result<RenderPipeline, VulkanError> {
        let entry = self.sources.module(recipe)?;
        if self.kind != TracingMode::Pipeline {
            let made = ComputePipeline::new(title, &entry, constants, bindings, PUSH)?;
            return Ok(RenderPipeline::Compute(made));
        }
        let module = |stage: HitStage| self.sources.module(&stage.recipe(self.extended));
        let shaders = Shaders {
            generation: entry,
            miss: module(HitStage::Miss)?,
            triangle: module(HitStage::Triangle)?,
            sphere: module(HitStage::Sphere)?,
            any: module(HitStage::Mask)?,
            intersection: module(HitStage::Intersection)?,
        };
        let made = RayTracingPipeline::new(title, &shaders, constants, bindings, PUSH)?;
        Ok(RenderPipeline::RayTracing(Box::new(made)))
    }
}

impl RenderPipeline {
    /// Records a dispatch of some rows of `width` pixels, each with `depth` invocations.
    pub(super) fn dispatch(
        &self,
        commands: vk::CommandBuffer,
        bindings: &Bindings,
        [width, depth]: [u32; 2],
        wave: &WaveParams,
    ) {
        match self {
            RenderPipeline::Compute(compute) => {
                compute.dispatch(commands, bindings, wave, groups(width, wave, depth));
            }
            RenderPipeline::RayTracing(tracing) => {
                tracing.trace(commands, bindings, wave, [width, wave.rows.max(1), depth]);
            }
        }
    }
}

/// Returns the numbers of workgroups of 8x8 pixels.
pub(super) fn groups(width: u32, wave: &WaveParams, depth: u32) -> [u32; 3] {
    [width.div_ceil(8), wave.rows.max(1).div_ceil(8), depth]
}
