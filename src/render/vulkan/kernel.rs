//! Small shaders over rows of words, with a scene bound: how a GLSL function is asked the same as its Rust original.

use std::sync::Arc;

use ash::vk;

use super::buffer::Buffer;
use super::device::Device;
use super::error::VulkanError;
use super::pipeline::{Bindings, Bound, Compute};
use super::spirv::{self, Sources};
use super::upload::{self, JobBuffers, SceneBuffers};

/// Rows that one workgroup works on.
const GROUP: u32 = 64;

/// What stands before the text of a kernel: the scene, rows of words in and out, and functions that take and give words.
fn head(in_words: usize, out_words: usize) -> String {
    let (scene, extension) = ("#include \"scene.glsl\"", "#extension GL_GOOGLE_include_directive : require");
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
        "#version 460\n{extension}\n{scene}\n\
         layout(local_size_x = {GROUP}) in;\n\
         layout(set = 0, binding = 20, scalar) readonly buffer KernelInputs {{ uint kernel_inputs[]; }};\n\
         layout(set = 0, binding = 21, scalar) writeonly buffer KernelOutputs {{ uint kernel_outputs[]; }};\n\
         layout(push_constant, scalar) uniform KernelPush {{ uint kernel_rows; }};\n\
         uint kernel_in = 0u, kernel_out = 0u;\n\
         uint in_word() {{ return kernel_inputs[gl_GlobalInvocationID.x * {in_words}u + kernel_in++]; }}\n\
         float in_float() {{ return uintBitsToFloat(in_word()); }}\n\
         void out_word(uint w) {{ kernel_outputs[gl_GlobalInvocationID.x * {out_words}u + kernel_out++] = w; }}\n\
         void out_float(float f) {{ out_word(floatBitsToUint(f)); }}\n{takers}#line 1\n"
    )
}

/// What stands after it.
const TAIL: &str = "\nvoid main() { if (gl_GlobalInvocationID.x < kernel_rows) twin(); }\n";

/// Compiles a kernel: a text that defines `void twin()` with the functions of the head; `defines` as for [`spirv::compile`].
///
/// # Errors
/// When it does not compile.
pub fn compile(
    sources: &Sources,
    name: &str,
    text: &str,
    in_words: usize,
    out_words: usize,
    defines: &[(&str, String)],
) -> Result<Vec<u32>, VulkanError> {
    let whole = format!("{}{text}{TAIL}", head(in_words, out_words));
    Ok(spirv::compile(sources, name, &whole, defines, &[])?)
}

/// Runs a compiled kernel over rows of `in_words` words each; every row answers with `out_words` words.
///
/// # Errors
/// When the device fails.
pub fn run(
    device: &Arc<Device>,
    (scene, job): (&SceneBuffers, &JobBuffers),
    spirv: &[u32],
    inputs: &[u32],
    [in_words, out_words]: [usize; 2],
) -> Result<Vec<u32>, VulkanError> {
    let rows = inputs.len() / in_words.max(1);
    let none = vk::BufferUsageFlags::empty();
    let input = Buffer::with(device, "inputs", inputs, none)?;
    let output = Buffer::new(device, "outputs", (rows * out_words * 4).max(16) as u64, none)?;
    let mut bound = upload::bound(scene, job);
    bound.extend([Bound::Storage(&input), Bound::Storage(&output)]);
    let bindings = Bindings::new(device, vk::ShaderStageFlags::COMPUTE, &bound)?;
    let compute = Compute::new(device, "kernel", spirv, &bindings, 4)?;
    device.run("kernel", |commands| {
        compute.dispatch(commands, &bindings, &(rows as u32), [(rows as u32).div_ceil(GROUP), 1, 1]);
        device.barrier_to_copy(commands);
    })?;
    output.read(rows * out_words)
}
