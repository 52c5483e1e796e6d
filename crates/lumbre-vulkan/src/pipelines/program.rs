//! Program of a run: its traversal, and the pipeline made of entry, traversal and integrator.

use std::sync::Arc;

use ash::vk;

use super::compute::{Bindings, BoundResource, ComputePipeline};
use super::ray_tracing;
use super::ray_tracing::{RayTracingPipeline, Shaders};
use super::spirv::Sources;
use crate::accel::bvh::DeviceBvh;
use crate::accel::structures::AccelerationStructures;
use crate::context::{device::Device, physical_device::Caps};
use crate::error::VulkanError;
use crate::layout::WaveParams;
use crate::memory::upload::SceneBuffers;
use lumbre_light::scene::CompiledScene;
use lumbre_render::hierarchy::AccelSpec;
use lumbre_render::{Job, OpenStats};

/// Method by which rays are traced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TracingMode {
    /// Rays of a ray-tracing pipeline.
    Pipeline,
    /// Ray queries in a compute shader.
    Query,
    /// Own BVH, traversed in a compute shader.
    Compute,
}

impl TracingMode {
    /// All modes of tracing.
    pub const ALL: [TracingMode; 3] = [
        TracingMode::Pipeline,
        TracingMode::Query,
        TracingMode::Compute,
    ];

    /// Returns the name of its backend.
    pub fn backend(self) -> &'static str {
        match self {
            TracingMode::Pipeline => "vulkan",
            TracingMode::Query => "vulkan-query",
            TracingMode::Compute => "vulkan-compute",
        }
    }

    /// Returns the feature that a device lacks for this mode, if any.
    pub fn lacking(self, caps: &Caps) -> Option<&'static str> {
        let (there, what) = match self {
            _ if !caps.scalar_layout => (false, "scalar block layout"),
            TracingMode::Pipeline => (
                caps.pipeline,
                "ray-tracing pipelines (VK_KHR_ray_tracing_pipeline)",
            ),
            TracingMode::Query => (caps.query, "ray queries (VK_KHR_ray_query)"),
            TracingMode::Compute => (true, ""),
        };
        (!there).then_some(what)
    }
}

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
        if let Some(needed) = kind.lacking(&device.info.caps) {
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
            Traversal::Structures(accel) => vec![BoundResource::Acceleration(accel.top())],
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

/// Granularity of the maximum depth that shaders are compiled for, in edges, if they store the
/// vertices of subpaths; a sweep over depths then needs few pipelines.
const DEPTH_STEP: u32 = 4;

/// Returns the shader of an integrator, which has the same path as its Rust original.
pub fn shader_of(sources: &Sources, integrator: &str) -> Option<String> {
    let paths = [
        format!("transport/integrator/{integrator}.glsl"),
        format!("transport/integrator/{integrator}/mod.glsl"),
    ];
    paths.into_iter().find(|path| sources.has(path))
}

/// Returns the name and text of the generated file that selects an integrator's shader.
fn generated_integrator(name: &str, shader: &str, max_depth: u32) -> (&'static str, String) {
    let depth = max_depth.max(1).next_multiple_of(DEPTH_STEP);
    let text = format!(
        "#define MAX_DEPTH {depth}u\n#include \"{shader}\"\n\
         #define INTEGRATOR_SAMPLE {name}_sample\n"
    );
    ("generated/integrator.glsl", text)
}

/// Pipeline that adds waves to films.
pub enum Program {
    /// Pipeline of a compute shader.
    Compute(ComputePipeline),
    /// Pipeline of ray-tracing shaders.
    RayTracingPipeline(Box<RayTracingPipeline>),
}

impl Program {
    /// Compiles the shaders of a job and creates its pipeline.
    ///
    /// # Errors
    /// Returns an error if the integrator has no shader, a shader does not compile, or the device
    /// refuses it.
    pub fn new(
        device: &Arc<Device>,
        kind: TracingMode,
        sources: &Sources,
        job: &Job,
        defines: &[(&str, String)],
        bindings: &Bindings,
    ) -> Result<Program, VulkanError> {
        let name = job.integrator.name;
        let shader = shader_of(sources, name).ok_or_else(|| VulkanError::Lacks {
            device: kind.backend().to_owned(),
            needed: format!("the integrator `{name}`: it has no shader"),
        })?;
        let generated = [generated_integrator(name, &shader, job.max_depth)];
        let compile = |path: &str| sources.compile(path, defines, &generated);
        let (title, push) = (
            format!("{name} by {}", kind.backend()),
            size_of::<WaveParams>() as u32,
        );
        Ok(match kind {
            TracingMode::Compute => Program::Compute(ComputePipeline::new(
                device,
                &title,
                &compile("entry/compute.comp")?,
                bindings,
                push,
            )?),
            TracingMode::Query => Program::Compute(ComputePipeline::new(
                device,
                &title,
                &compile("entry/query.comp")?,
                bindings,
                push,
            )?),
            TracingMode::Pipeline => {
                let shaders = Shaders {
                    generation: compile("entry/generation.rgen")?,
                    miss: compile("entry/miss.rmiss")?,
                    triangle: compile("entry/triangle.rchit")?,
                    sphere: compile("entry/sphere.rchit")?,
                    any: compile("entry/mask.rahit")?,
                    intersection: compile("entry/sphere.rint")?,
                };
                Program::RayTracingPipeline(Box::new(RayTracingPipeline::new(
                    device, &title, &shaders, bindings, push,
                )?))
            }
        })
    }

    /// Records a dispatch of some rows.
    pub fn dispatch(
        &self,
        commands: vk::CommandBuffer,
        bindings: &Bindings,
        width: u32,
        wave: &WaveParams,
    ) {
        match self {
            Program::Compute(compute) => {
                compute.dispatch(
                    commands,
                    bindings,
                    wave,
                    [width.div_ceil(8), wave.rows.max(1).div_ceil(8), 1],
                );
            }
            Program::RayTracingPipeline(tracing) => {
                tracing.trace(commands, bindings, wave, [width, wave.rows.max(1)])
            }
        }
    }

    /// Runs an empty dispatch: software drivers compile at the first one, which must not count in
    /// the first wave's time.
    ///
    /// # Errors
    /// Returns an error if the device fails.
    pub fn warm_up(&self, device: &Arc<Device>, bindings: &Bindings) -> Result<(), VulkanError> {
        let empty = WaveParams {
            first_sample: [0; 2],
            samples: 0,
            first_row: 0,
            rows: 0,
        };
        device.run("warm up", |commands| {
            self.dispatch(commands, bindings, 1, &empty)
        })
    }

    /// Returns the shader stages that access the bindings.
    pub fn stages(kind: TracingMode) -> vk::ShaderStageFlags {
        match kind {
            TracingMode::Compute | TracingMode::Query => vk::ShaderStageFlags::COMPUTE,
            TracingMode::Pipeline => ray_tracing::STAGES,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipelines::spirv::EMBEDDED;

    #[test]
    fn every_entry_compiles_with_all_features_and_with_none() {
        let all = [
            "LAYERS",
            "TIMES",
            "PARTS",
            "COPIES",
            "SECOND_UVS",
            "TEXEL_SHIFT",
            "PATHS",
        ];
        let common = [("SAMPLER_KIND", "0u"), ("MODELS", "31")];
        let features = [("SPLAT_FLOAT", &all[..]), ("SPLAT_NONE", &[])];
        let entries = EMBEDDED
            .iter()
            .filter(|(path, _)| path.starts_with("entry/") && !path.ends_with(".glsl"));
        for (path, _) in entries {
            for (splats, names) in features {
                let mut defines: Vec<(&str, String)> =
                    common.map(|(name, value)| (name, value.to_owned())).into();
                defines.push((splats, String::new()));
                defines.extend(names.iter().map(|name| (*name, "20u".to_owned())));
                let generated = [generated_integrator(
                    "bdpt",
                    "transport/integrator/bdpt/mod.glsl",
                    8,
                )];
                let compiled = Sources::Embedded.compile(path, &defines, &generated);
                assert!(
                    compiled.is_ok(),
                    "{path} {splats}: {}",
                    compiled.unwrap_err()
                );
            }
        }
    }
}
