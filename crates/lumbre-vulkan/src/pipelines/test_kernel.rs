//! Test kernels: small shaders over rows of words, with a scene bound, to compare a GLSL function
//! with its Rust original.

use std::sync::Arc;

use ash::vk;

use super::compute::{Bindings, BoundResource, ComputePipeline};
use super::ray_tracing;
use super::ray_tracing::RayTracingPipeline;
use super::spirv;
use super::spirv::Sources;
use crate::context::device::Device;
use crate::error::VulkanError;
use crate::memory::buffer::Buffer;
use crate::memory::upload;
use crate::memory::upload::{JobBuffers, SceneBuffers};

/// Number of rows per workgroup.
const GROUP: u32 = 64;

/// Shader stage of a kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KernelStage {
    /// Stage of compute shaders.
    Compute,
    /// Stage of ray-generation shaders that trace nothing. Some software drivers compile compute
    /// shaders to coroutines, at a cost quadratic in the number of branches; ray generation
    /// compiles several times faster there.
    Generation,
}

impl KernelStage {
    /// Returns the stage that the device compiles faster.
    pub fn fastest_to_compile(device: &Device) -> KernelStage {
        if device.info.caps.pipeline {
            KernelStage::Generation
        } else {
            KernelStage::Compute
        }
    }

    /// Returns the file extension of its shaders, its declaration, and the GLSL expression of the
    /// row.
    fn syntax(self) -> (&'static str, String, &'static str) {
        match self {
            KernelStage::Compute => (
                "comp",
                format!("layout(local_size_x = {GROUP}) in;"),
                "gl_GlobalInvocationID.x",
            ),
            KernelStage::Generation => (
                "rgen",
                "#extension GL_EXT_ray_tracing : require".to_owned(),
                "gl_LaunchIDEXT.x",
            ),
        }
    }
}

/// Returns the text before a kernel's own: the scene, buffers of input and output words, and
/// functions that read and write them.
fn head(stage: KernelStage, in_words: usize, out_words: usize) -> String {
    let (scene, extension) = (
        "#include \"scene.glsl\"",
        "#extension GL_GOOGLE_include_directive : require",
    );
    let (_, declared, row) = stage.syntax();
    let accessors: String = [2, 3, 4]
        .map(|n| {
            let list = |call: &str| vec![call; n].join(", ");
            let each = |call: &str| {
                let calls = ["x", "y", "z", "w"][..n].iter();
                calls
                    .map(|c| format!(" {call}(v.{c});"))
                    .collect::<String>()
            };
            format!(
                "vec{n} in_vec{n}() {{ return vec{n}({}); }}\n\
                 void out_vec{n}(vec{n} v) {{{} }}\n\
                 void out_words(uvec{n} v) {{{} }}\n",
                list("in_float()"),
                each("out_float"),
                each("out_word")
            )
        })
        .concat();
    format!(
        "#version 460\n{extension}\n{declared}\n{scene}\n\
         layout(set = 0, binding = 20, scalar) readonly buffer KernelInputs {{\n\
         uint kernel_inputs[];\n}};\n\
         layout(set = 0, binding = 21, scalar) writeonly buffer KernelOutputs {{\n\
         uint kernel_outputs[];\n}};\n\
         layout(push_constant, scalar) uniform KernelPush {{ uint kernel_rows; }};\n\
         uint kernel_in = 0u, kernel_out = 0u;\n\
         uint in_word() {{ return kernel_inputs[{row} * {in_words}u + kernel_in++]; }}\n\
         float in_float() {{ return uintBitsToFloat(in_word()); }}\n\
         void out_word(uint w) {{ kernel_outputs[{row} * {out_words}u + kernel_out++] = w; }}\n\
         void out_float(float f) {{ out_word(floatBitsToUint(f)); }}\n{accessors}#line 1\n"
    )
}

/// Compiles a kernel called `name`: a text that defines `void twin()` with the functions of
/// [`head`]; `defines` as in [`spirv::compile`].
///
/// # Errors
/// Returns an error if it does not compile.
pub fn compile(
    stage: KernelStage,
    sources: &Sources,
    name: &str,
    text: &str,
    [in_words, out_words]: [usize; 2],
    defines: &[(&str, String)],
) -> Result<Vec<u32>, VulkanError> {
    let (end, _, row) = stage.syntax();
    let tail = format!("\nvoid main() {{ if ({row} < kernel_rows) twin(); }}\n");
    let whole = format!("{}{text}{tail}", head(stage, in_words, out_words));
    Ok(spirv::compile(
        sources,
        &format!("{name}.{end}"),
        &whole,
        defines,
        &[],
    )?)
}

/// Runs a compiled kernel over rows of `in_words` words each and returns `out_words` words per row.
///
/// # Errors
/// Returns an error if the device fails.
pub fn run(
    device: &Arc<Device>,
    stage: KernelStage,
    (scene, job): (&SceneBuffers, &JobBuffers),
    spirv: &[u32],
    inputs: &[u32],
    [in_words, out_words]: [usize; 2],
) -> Result<Vec<u32>, VulkanError> {
    let rows = (inputs.len() / in_words.max(1)) as u32;
    let none = vk::BufferUsageFlags::empty();
    let input = Buffer::with(device, "inputs", inputs, none)?;
    let output = Buffer::new(
        device,
        "outputs",
        (rows as usize * out_words * 4).max(16) as u64,
        none,
    )?;
    let mut bound = upload::bindings(scene, job);
    bound.extend([
        BoundResource::Storage(&input),
        BoundResource::Storage(&output),
    ]);
    match stage {
        KernelStage::Compute => {
            let bindings = Bindings::new(device, vk::ShaderStageFlags::COMPUTE, &bound)?;
            let compute = ComputePipeline::new(device, "kernel", spirv, &bindings, 4)?;
            device.run("kernel", |commands| {
                compute.dispatch(commands, &bindings, &rows, [rows.div_ceil(GROUP), 1, 1]);
                device.barrier_to_copy(commands);
            })?;
        }
        KernelStage::Generation => {
            let bindings = Bindings::new(device, ray_tracing::STAGES, &bound)?;
            let kernel =
                RayTracingPipeline::generation_only(device, "kernel", spirv, &bindings, 4)?;
            device.run("kernel", |commands| {
                kernel.trace(commands, &bindings, &rows, [rows, 1]);
                device.barrier_to_copy(commands);
            })?;
        }
    }
    output.read(rows as usize * out_words)
}
