//! Small shaders over rows of words, with a scene bound: how a GLSL function is asked the same as its Rust original.

use std::sync::Arc;

use ash::vk;

use super::buffer::Buffer;
use super::device::Device;
use super::error::VulkanError;
use super::pipeline::{Bindings, Bound, Compute};
use super::spirv::{self, Sources};
use super::tracing::{self, Tracing};
use super::upload::{self, JobBuffers, SceneBuffers};

/// Rows that one workgroup works on.
const GROUP: u32 = 64;

/// The stage that a kernel runs in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// A compute shader.
    Compute,
    /// Ray generation that traces nothing. A software driver that makes a coroutine of every compute shader, whose frame costs
    /// the square of its branches, compiles the same text several times as fast so.
    Generation,
}

impl Stage {
    /// The one that a device compiles sooner.
    pub fn of(device: &Device) -> Stage {
        if device.info.caps.pipeline { Stage::Generation } else { Stage::Compute }
    }

    /// The end of the names of its shaders, what declares it, and the row of an invocation.
    fn words(self) -> (&'static str, String, &'static str) {
        match self {
            Stage::Compute => ("comp", format!("layout(local_size_x = {GROUP}) in;"), "gl_GlobalInvocationID.x"),
            Stage::Generation => ("rgen", "#extension GL_EXT_ray_tracing : require".to_owned(), "gl_LaunchIDEXT.x"),
        }
    }
}

/// What stands before the text of a kernel: the scene, rows of words in and out, and functions that take and give words.
fn head(stage: Stage, in_words: usize, out_words: usize) -> String {
    let (scene, extension) = ("#include \"scene.glsl\"", "#extension GL_GOOGLE_include_directive : require");
    let (_, declared, row) = stage.words();
    let takers: String = [2, 3, 4]
        .map(|n| {
            let list = |call: &str| vec![call; n].join(", ");
            let gives: String = ["x", "y", "z", "w"][..n].iter().map(|c| format!(" out_float(v.{c});")).collect();
            let words: String = ["x", "y", "z", "w"][..n].iter().map(|c| format!(" out_word(v.{c});")).collect();
            format!(
                "vec{n} in_vec{n}() {{ return vec{n}({}); }}\nvoid out_vec{n}(vec{n} v) {{{gives} }}\n\
                 void out_words(uvec{n} v) {{{words} }}\n",
                list("in_float()")
            )
        })
        .concat();
    format!(
        "#version 460\n{extension}\n{declared}\n{scene}\n\
         layout(set = 0, binding = 20, scalar) readonly buffer KernelInputs {{ uint kernel_inputs[]; }};\n\
         layout(set = 0, binding = 21, scalar) writeonly buffer KernelOutputs {{ uint kernel_outputs[]; }};\n\
         layout(push_constant, scalar) uniform KernelPush {{ uint kernel_rows; }};\n\
         uint kernel_in = 0u, kernel_out = 0u;\n\
         uint in_word() {{ return kernel_inputs[{row} * {in_words}u + kernel_in++]; }}\n\
         float in_float() {{ return uintBitsToFloat(in_word()); }}\n\
         void out_word(uint w) {{ kernel_outputs[{row} * {out_words}u + kernel_out++] = w; }}\n\
         void out_float(float f) {{ out_word(floatBitsToUint(f)); }}\n{takers}#line 1\n"
    )
}

/// Compiles a kernel called `name`: a text that defines `void twin()` with the functions of the head; `defines` as for
/// [`spirv::compile`].
///
/// # Errors
/// When it does not compile.
pub fn compile(
    stage: Stage,
    sources: &Sources,
    name: &str,
    text: &str,
    [in_words, out_words]: [usize; 2],
    defines: &[(&str, String)],
) -> Result<Vec<u32>, VulkanError> {
    let (end, _, row) = stage.words();
    let tail = format!("\nvoid main() {{ if ({row} < kernel_rows) twin(); }}\n");
    let whole = format!("{}{text}{tail}", head(stage, in_words, out_words));
    Ok(spirv::compile(sources, &format!("{name}.{end}"), &whole, defines, &[])?)
}

/// Runs a compiled kernel over rows of `in_words` words each; every row answers with `out_words` words.
///
/// # Errors
/// When the device fails.
pub fn run(
    device: &Arc<Device>,
    stage: Stage,
    (scene, job): (&SceneBuffers, &JobBuffers),
    spirv: &[u32],
    inputs: &[u32],
    [in_words, out_words]: [usize; 2],
) -> Result<Vec<u32>, VulkanError> {
    let rows = (inputs.len() / in_words.max(1)) as u32;
    let none = vk::BufferUsageFlags::empty();
    let input = Buffer::with(device, "inputs", inputs, none)?;
    let output = Buffer::new(device, "outputs", (rows as usize * out_words * 4).max(16) as u64, none)?;
    let mut bound = upload::bound(scene, job);
    bound.extend([Bound::Storage(&input), Bound::Storage(&output)]);
    match stage {
        Stage::Compute => {
            let bindings = Bindings::new(device, vk::ShaderStageFlags::COMPUTE, &bound)?;
            let compute = Compute::new(device, "kernel", spirv, &bindings, 4)?;
            device.run("kernel", |commands| {
                compute.dispatch(commands, &bindings, &rows, [rows.div_ceil(GROUP), 1, 1]);
                device.barrier_to_copy(commands);
            })?;
        }
        Stage::Generation => {
            let bindings = Bindings::new(device, tracing::STAGES, &bound)?;
            let kernel = Tracing::alone(device, "kernel", spirv, &bindings, 4)?;
            device.run("kernel", |commands| {
                kernel.trace(commands, &bindings, &rows, [rows, 1]);
                device.barrier_to_copy(commands);
            })?;
        }
    }
    output.read(rows as usize * out_words)
}
