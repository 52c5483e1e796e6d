//! The program of a run: its traversal, and the pipeline made of entry, traversal and integrator.

use std::sync::Arc;

use ash::vk;

use super::bvh::Bvh;
use super::device::Device;
use super::error::VulkanError;
use super::layout::Wave;
use super::pipeline::{Bindings, Bound, Compute};
use super::spirv::Sources;
use crate::render::Job;
use crate::scene::CompiledScene;

/// How rays meet the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A hierarchy of our own, walked in a compute shader.
    Compute,
}

impl Kind {
    /// The name of the backend.
    pub fn backend(self) -> &'static str {
        match self {
            Kind::Compute => "vulkan-compute",
        }
    }
}

/// What rays are traced through.
pub enum Traversal {
    /// For [`Kind::Compute`].
    Bvh(Bvh),
}

impl Traversal {
    /// Builds what a kind needs of a scene.
    ///
    /// # Errors
    /// When it does not fit onto the device.
    pub fn new(device: &Arc<Device>, kind: Kind, scene: &CompiledScene) -> Result<Traversal, VulkanError> {
        match kind {
            Kind::Compute => Ok(Traversal::Bvh(Bvh::new(device, scene)?)),
        }
    }

    /// What is bound after the films.
    pub fn bound(&self) -> [Bound<'_>; 2] {
        match self {
            Traversal::Bvh(bvh) => [Bound::Storage(&bvh.nodes), Bound::Storage(&bvh.primitives)],
        }
    }

    /// Seconds of the build, and number of nodes where they are known.
    pub fn built(&self) -> (f64, u64) {
        match self {
            Traversal::Bvh(bvh) => (bvh.build_s, bvh.node_count as u64),
        }
    }
}

/// The shader of an integrator: at the same place as its Rust original.
pub fn shader_of(sources: &Sources, integrator: &str) -> Option<String> {
    let places = [format!("transport/integrator/{integrator}.glsl"), format!("transport/integrator/{integrator}/mod.glsl")];
    places.into_iter().find(|place| sources.has(place))
}

/// A pipeline that adds waves to films.
pub struct Program {
    compute: Compute,
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
                job.max_depth.max(1)
            ),
        )];
        match kind {
            Kind::Compute => {
                let words = sources.compile("entry/compute.comp", defines, &generated)?;
                let title = format!("{name} by {}", kind.backend());
                let compute = Compute::new(device, &title, &words, bindings, size_of::<Wave>() as u32)?;
                Ok(Program { compute })
            }
        }
    }

    /// Records a dispatch of some rows.
    pub fn dispatch(&self, commands: vk::CommandBuffer, bindings: &Bindings, width: u32, wave: &Wave) {
        self.compute.dispatch(commands, bindings, wave, [width.div_ceil(8), wave.rows.max(1).div_ceil(8), 1]);
    }

    /// The stages that see what is bound.
    pub fn stages(kind: Kind) -> vk::ShaderStageFlags {
        match kind {
            Kind::Compute => vk::ShaderStageFlags::COMPUTE,
        }
    }
}
