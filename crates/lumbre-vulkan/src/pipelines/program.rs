//! Program of a run: its traversal, and the pipeline made of entry, traversal and integrator.

use std::sync::Arc;

use ash::vk;

use super::compute::{Bindings, BoundResource, ComputePipeline};
use super::light_paths::LightPathPipelines;
use super::modules::{self, Variant};
use super::ray_tracing;
use super::render_pipeline::{PUSH, RenderPipeline, Stages, groups};
use super::sources::Sources;
pub use super::tracing_mode::TracingMode;
use crate::accel::bvh::DeviceBvh;
use crate::accel::structures::AccelerationStructures;
use crate::context::device::Device;
use crate::error::VulkanError;
use crate::films::device_film::SplatMode;
use crate::layout::{Specialization, WaveParams};
use crate::memory::upload::SceneBuffers;
use crate::schedule::dispatch_size::MAX_SAMPLES;
use crate::schedule::pixel_samples::PixelSamples;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::NONE;
use lumbre_render::hierarchy::AccelSpec;
use lumbre_render::{Job, OpenStats};

/// Acceleration structure that rays are traced through.
pub enum Traversal {
    /// Own BVH, for [`TracingMode::Compute`].
    Bvh(DeviceBvh),
    /// Vulkan acceleration structures, for the other modes.
    Structures(AccelerationStructures),
}

impl Traversal {
    /// Builds the acceleration structure of a scene; an own BVH according to `spec`.
    ///
    /// # Errors
    /// Returns an error if it does not fit onto the device.
    pub fn new(
        device: &Arc<Device>,
        kind: TracingMode,
        scene: &CompiledScene,
        spec: &AccelSpec,
        buffers: &SceneBuffers,
    ) -> Result<Traversal, VulkanError> {
        if let Some(needed) = kind.lacking(&device.info) {
            return Err(VulkanError::Lacks {
                device: device.info.line(),
                needed: needed.to_owned(),
            });
        }
        Ok(match kind {
            TracingMode::Compute => Traversal::Bvh(DeviceBvh::new(device, scene, spec)?),
            TracingMode::Pipeline | TracingMode::Query => {
                Traversal::Structures(AccelerationStructures::new(device, scene, buffers)?)
            }
        })
    }

    /// Returns the bindings after those of the films.
    pub fn bindings(&self) -> Vec<BoundResource<'_>> {
        match self {
            Traversal::Bvh(bvh) => [&bvh.nodes, &bvh.primitives, &bvh.transforms]
                .map(BoundResource::Storage)
                .into(),
            Traversal::Structures(accel) => vec![
                BoundResource::Acceleration(accel.top()),
                BoundResource::Storage(&accel.geometry_starts),
            ],
        }
    }

    /// Returns build time, size on the device, and nodes and cost if known.
    pub fn built(&self) -> OpenStats {
        let (accel_build_s, accel_nodes, accel_bytes, accel_cost) = match self {
            Traversal::Bvh(bvh) => (bvh.build_s, bvh.node_count as u64, bvh.bytes(), bvh.cost),
            Traversal::Structures(accel) => (accel.build_s, 0, accel.bytes, 0.0),
        };
        OpenStats {
            accel_build_s,
            accel_nodes,
            accel_bytes,
            accel_cost,
            ..OpenStats::default()
        }
    }
}

/// Pipelines that add waves to films.
pub struct Program {
    render: RenderPipeline,
    /// Pipelines of the light subpaths that the samples of an iteration share, if they share any.
    light: Option<LightPathPipelines>,
    /// Pipeline that adds samples which were rendered at once, and how many of a pixel are.
    sum: Option<(ComputePipeline, u32)>,
}

impl Program {
    /// Creates the pipelines of a job: `splats` is the summation of its splats, and `samples` how
    /// those of a pixel are rendered.
    ///
    /// # Errors
    /// Returns an error if the integrator has no shader, a shader cannot be made, or the device
    /// refuses it.
    pub fn new(
        kind: TracingMode,
        sources: &Sources,
        job: &Job,
        (splats, samples): (SplatMode, PixelSamples),
        constants: &Specialization,
        bindings: &Bindings,
    ) -> Result<Program, VulkanError> {
        let name = job.integrator.name;
        if !sources.has_integrator(name) {
            return Err(VulkanError::Lacks {
                device: kind.backend().to_owned(),
                needed: format!("the integrator `{name}`: it has no shader"),
            });
        }
        let extended =
            constants.times != 0 || constants.instances != 0 || constants.texel_shift != NONE;
        let stages = Stages {
            kind,
            sources,
            extended,
        };
        let recipe = modules::integrator(kind, name, Variant { extended, splats });
        let title = format!("{name} by {}", kind.backend());
        let render = stages.pipeline(&title, &recipe, constants, bindings)?;
        let light = LightPathPipelines::new(&stages, job, constants, bindings)?;
        let sum = match samples.at_once() {
            Some(at_once) => {
                let (module, all) = (sources.module(&modules::sum())?, Specialization::default());
                let pipeline =
                    ComputePipeline::new("sum of samples", &module, &all, bindings, PUSH)?;
                Some((pipeline, at_once))
            }
            None => None,
        };
        Ok(Program { render, light, sum })
    }

    /// Returns the pipelines of the light subpaths that the samples of an iteration share, if they
    /// share any.
    pub fn light(&self) -> Option<&LightPathPipelines> {
        self.light.as_ref()
    }

    /// Returns the greatest number of samples of a pixel in one dispatch.
    pub fn max_samples(&self) -> u64 {
        match self.light {
            // Each sample has subpaths of its own.
            Some(_) => 1,
            None => MAX_SAMPLES,
        }
    }

    /// Records what the samples with this index share, after all earlier work.
    pub fn begin(&self, commands: vk::CommandBuffer, bindings: &Bindings, sample: u64) {
        if let Some(light) = &self.light {
            light.begin(commands, bindings, sample);
        }
    }

    /// Records a dispatch of some rows.
    pub fn dispatch(
        &self,
        commands: vk::CommandBuffer,
        bindings: &Bindings,
        width: u32,
        wave: &WaveParams,
    ) {
        let Some((sum, at_once)) = &self.sum else {
            return self.render.dispatch(commands, bindings, [width, 1], wave);
        };
        let device = &bindings.device;
        for (i, part) in wave.parts(*at_once).enumerate() {
            if i > 0 {
                device.barrier_to_shaders(commands);
            }
            let samples = part.samples.max(1);
            self.render
                .dispatch(commands, bindings, [width, samples], &part);
            device.barrier_to_shaders(commands);
            sum.dispatch(commands, bindings, &part, groups(width, &part, 1));
        }
    }

    /// Runs an empty dispatch: software drivers compile at the first one, which must not count in
    /// the first wave's time.
    ///
    /// # Errors
    /// Returns an error if the device fails.
    pub fn warm_up(&self, device: &Arc<Device>, bindings: &Bindings) -> Result<(), VulkanError> {
        let empty = WaveParams::new(0, 0, 0, 0);
        device.run("warm up", |commands| {
            self.dispatch(commands, bindings, 1, &empty)
        })
    }

    /// Returns the shader stages that access the bindings.
    pub fn stages(kind: TracingMode) -> vk::ShaderStageFlags {
        match kind {
            TracingMode::Compute | TracingMode::Query => vk::ShaderStageFlags::COMPUTE,
            // A compute shader adds samples that were rendered at once.
            TracingMode::Pipeline => ray_tracing::STAGES | vk::ShaderStageFlags::COMPUTE,
        }
    }
}
