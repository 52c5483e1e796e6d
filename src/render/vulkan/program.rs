//! The program of a run: its traversal, and the pipeline made of entry, traversal and integrator.

use std::sync::Arc;

use ash::vk;

use super::accel::Accel;
use super::bvh::Bvh;
use super::device::{Caps, Device};
use super::error::VulkanError;
use super::layout::Wave;
use super::pipeline::{Bindings, Bound, Compute};
use super::spirv::Sources;
use super::tracing::{self, Shaders, Tracing};
use super::upload::SceneBuffers;
use crate::render::hierarchy::AccelSpec;
use crate::render::{Job, OpenStats};
use crate::scene::CompiledScene;

/// How rays meet the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A ray-tracing pipeline.
    Pipeline,
    /// Ray queries in a compute shader.
    Query,
    /// A hierarchy of our own, walked in a compute shader.
    Compute,
}

impl Kind {
    /// Every kind.
    pub const ALL: [Kind; 3] = [Kind::Pipeline, Kind::Query, Kind::Compute];

    /// The name of the backend.
    pub fn backend(self) -> &'static str {
        match self {
            Kind::Pipeline => "vulkan",
            Kind::Query => "vulkan-query",
            Kind::Compute => "vulkan-compute",
        }
    }

    /// What a device lacks for this kind, if anything.
    pub fn lacking(self, caps: &Caps) -> Option<&'static str> {
        let (there, what) = match self {
            _ if !caps.scalar_layout => (false, "scalar block layout"),
            Kind::Pipeline => (caps.pipeline, "ray-tracing pipelines (VK_KHR_ray_tracing_pipeline)"),
            Kind::Query => (caps.query, "ray queries (VK_KHR_ray_query)"),
            Kind::Compute => (true, ""),
        };
        (!there).then_some(what)
    }
}

/// What rays are traced through.
pub enum Traversal {
    /// For [`Kind::Compute`].
    Bvh(Bvh),
    /// For the others.
    Accel(Accel),
}

impl Traversal {
    /// Builds what a kind needs of a scene; a hierarchy of our own as it is asked for.
    ///
    /// # Errors
    /// When it does not fit onto the device.
    pub fn new(
        device: &Arc<Device>,
        kind: Kind,
        scene: &CompiledScene,
        spec: &AccelSpec,
        buffers: &SceneBuffers,
    ) -> Result<Traversal, VulkanError> {
        if let Some(needed) = kind.lacking(&device.info.caps) {
            return Err(VulkanError::Lacks { device: device.info.line(), needed: needed.to_owned() });
        }
        Ok(match kind {
            Kind::Compute => Traversal::Bvh(Bvh::new(device, scene, spec)?),
            Kind::Pipeline | Kind::Query => Traversal::Accel(Accel::new(device, scene, buffers)?),
        })
    }

    /// What is bound after the films.
    pub fn bound(&self) -> Vec<Bound<'_>> {
        match self {
            Traversal::Bvh(bvh) => [&bvh.nodes, &bvh.primitives, &bvh.entrances].map(Bound::Storage).into(),
            Traversal::Accel(accel) => vec![Bound::Acceleration(accel.top())],
        }
    }

    /// Seconds of the build, bytes on the device, and nodes and cost where they are known.
    pub fn built(&self) -> OpenStats {
        let (accel_build_s, accel_nodes, accel_bytes, accel_cost) = match self {
            Traversal::Bvh(bvh) => (bvh.build_s, bvh.node_count as u64, bvh.bytes(), bvh.cost),
            Traversal::Accel(accel) => (accel.build_s, 0, accel.bytes, 0.0),
        };
        OpenStats { accel_build_s, accel_nodes, accel_bytes, accel_cost, ..OpenStats::default() }
    }
}

/// Shaders that keep the vertices of subpaths have room for a multiple of so many edges, so that a sweep over depths makes few
/// pipelines.
const DEPTH_STEP: u32 = 4;

/// The shader of an integrator: at the same place as its Rust original.
pub fn shader_of(sources: &Sources, integrator: &str) -> Option<String> {
    let places =
        [format!("transport/integrator/{integrator}.glsl"), format!("transport/integrator/{integrator}/mod.glsl")];
    places.into_iter().find(|place| sources.has(place))
}

/// A pipeline that adds waves to films.
pub enum Program {
    /// Of a compute shader.
    Compute(Compute),
    /// Of ray-tracing shaders.
    Tracing(Box<Tracing>),
}

impl Program {
    /// Compiles the shaders of a job and makes its pipeline.
    ///
    /// # Errors
    /// When the integrator has no shader, a shader does not compile, or the device refuses it.
    pub fn new(
        device: &Arc<Device>,
        kind: Kind,
        sources: &Sources,
        job: &Job,
        defines: &[(&str, String)],
        bindings: &Bindings,
    ) -> Result<Program, VulkanError> {
        let name = job.integrator.name;
        let shader = shader_of(sources, name).ok_or_else(|| VulkanError::Lacks {
            device: kind.backend().to_owned(),
            needed: format!("a shader for the integrator `{name}`"),
        })?;
        let generated = [(
            "generated/integrator.glsl",
            format!(
                "#define MAX_DEPTH {}u\n#include \"{shader}\"\n#define INTEGRATOR_SAMPLE {name}_sample\n",
                job.max_depth.max(1).next_multiple_of(DEPTH_STEP)
            ),
        )];
        let compile = |path: &str| sources.compile(path, defines, &generated);
        let (title, push) = (format!("{name} by {}", kind.backend()), size_of::<Wave>() as u32);
        Ok(match kind {
            Kind::Compute => {
                Program::Compute(Compute::new(device, &title, &compile("entry/compute.comp")?, bindings, push)?)
            }
            Kind::Query => {
                Program::Compute(Compute::new(device, &title, &compile("entry/query.comp")?, bindings, push)?)
            }
            Kind::Pipeline => {
                let shaders = Shaders {
                    generation: compile("entry/generation.rgen")?,
                    miss: compile("entry/miss.rmiss")?,
                    triangle: compile("entry/triangle.rchit")?,
                    sphere: compile("entry/sphere.rchit")?,
                    any: compile("entry/mask.rahit")?,
                    intersection: compile("entry/sphere.rint")?,
                };
                Program::Tracing(Box::new(Tracing::new(device, &title, &shaders, bindings, push)?))
            }
        })
    }

    /// Records a dispatch of some rows.
    pub fn dispatch(&self, commands: vk::CommandBuffer, bindings: &Bindings, width: u32, wave: &Wave) {
        match self {
            Program::Compute(compute) => {
                compute.dispatch(commands, bindings, wave, [width.div_ceil(8), wave.rows.max(1).div_ceil(8), 1]);
            }
            Program::Tracing(tracing) => tracing.trace(commands, bindings, wave, [width, wave.rows.max(1)]),
        }
    }

    /// The stages that see what is bound.
    pub fn stages(kind: Kind) -> vk::ShaderStageFlags {
        match kind {
            Kind::Compute | Kind::Query => vk::ShaderStageFlags::COMPUTE,
            Kind::Pipeline => tracing::STAGES,
        }
    }
}
