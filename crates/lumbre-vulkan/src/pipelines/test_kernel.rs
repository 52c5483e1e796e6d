//! Test kernels: small shaders over rows of words, with a scene bound, to compare a GLSL function
//! with its Rust original.

use std::ffi::OsStr;
use std::io;
use std::path::Path;
use std::sync::Arc;

use ash::vk;

use super::compute::{Bindings, BoundResource, ComputePipeline};
use super::modules::{self, Variant};
use super::program::TracingMode;
use super::ray_tracing;
use super::ray_tracing::RayTracingPipeline;
use super::recipe::Recipe;
use super::sources::words;
use crate::context::device::Device;
use crate::error::VulkanError;
use crate::films::device_film::SplatMode;
use crate::layout::Specialization;
use crate::memory::buffer::Buffer;
use crate::memory::subpaths::{SubpathBuffers, SubpathRoom};
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

/// Push constants of a kernel: numbers of rows and of the words of a row.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct KernelPush {
    rows: u32,
    in_words: u32,
    out_words: u32,
}

/// Returns the text before a kernel's own: the scene, buffers of input and output words, and
/// functions that read and write them.
fn head(stage: KernelStage) -> String {
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
         layout(push_constant, scalar) uniform KernelPush {{\n\
         uint kernel_rows, kernel_in_words, kernel_out_words;\n}};\n\
         uint kernel_in = 0u, kernel_out = 0u;\n\
         uint in_word() {{ return kernel_inputs[{row} * kernel_in_words + kernel_in++]; }}\n\
         float in_float() {{ return uintBitsToFloat(in_word()); }}\n\
         void out_word(uint w) {{ kernel_outputs[{row} * kernel_out_words + kernel_out++] = w; }}\n\
         void out_float(float f) {{ out_word(floatBitsToUint(f)); }}\n{accessors}#line 1\n"
    )
}

/// Returns the recipe of a kernel called `name`: a text that defines `void twin()` with the
/// functions of [`head`]. It may include the `included` texts as if they were files.
fn recipe(stage: KernelStage, name: &str, text: &str, included: &[(String, String)]) -> Recipe {
    let (end, _, row) = stage.syntax();
    let tail = format!("\nvoid main() {{ if ({row} < kernel_rows) twin(); }}\n");
    let mut defines = vec!["SPLAT_NONE"];
    if EXTENDED.contains(&name) {
        defines.push("EXTENDED");
    }
    Recipe {
        file: format!("{name}.{end}.spv"),
        entry: format!("{name}.{end}"),
        text: Some(format!("{}{text}{tail}", head(stage))),
        defines,
        generated: included.to_vec(),
    }
}

/// Kernels that need double precision or buffer addresses.
const EXTENDED: [&str; 5] = ["bdpt", "bpt", "delay", "nee", "texels"];

/// Kernels that have a module for compute shaders, too: those that test this. Others need
/// ray-tracing pipelines.
const COMPUTE: [&str; 2] = ["echo", "texels"];

/// Returns the recipes of the test modules in a folder, in the order of their files: those of each
/// kernel `NAME.comp`; one for each tracing mode of an integrator `NAME.integrator`, which takes the
/// place of `bpt`; and one for each any-hit shader `NAME.rahit`. Files with the extension `glsl` may
/// be included.
///
/// # Errors
/// Returns an error if the folder or one of its files cannot be read.
pub fn recipes(folder: &Path) -> io::Result<Vec<Recipe>> {
    let mut files: Vec<(String, String, String)> = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        let part = |part: Option<&OsStr>| part.unwrap_or_default().to_string_lossy().into_owned();
        let (name, extension) = (part(path.file_stem()), part(path.extension()));
        if ["comp", "glsl", "integrator", "rahit"].contains(&extension.as_str()) {
            files.push((name, extension, std::fs::read_to_string(&path)?));
        }
    }
    files.sort();
    let of = |wanted: &'static str| files.iter().filter(move |(_, found, _)| found == wanted);
    let included: Vec<(String, String)> = of("glsl")
        .map(|(name, _, text)| (format!("{name}.glsl"), text.clone()))
        .collect();
    let mut recipes = Vec::new();
    for (name, _, text) in of("comp") {
        recipes.push(recipe(KernelStage::Generation, name, text, &included));
        if COMPUTE.contains(&name.as_str()) {
            recipes.push(recipe(KernelStage::Compute, name, text, &included));
        }
    }
    let variant = Variant {
        extended: false,
        splats: SplatMode::None,
    };
    for (name, _, text) in of("integrator") {
        for mode in TracingMode::ALL {
            let mut replaced = modules::integrator(mode, "bpt", variant);
            let renamed = format!("{text}\n#define INTEGRATOR_SAMPLE {name}_sample\n");
            replaced.file = replaced.file.replacen("bpt", name, 1);
            replaced.generated = vec![("generated/integrator.glsl".to_owned(), renamed)];
            recipes.push(replaced);
        }
    }
    for (name, extension, text) in of("rahit") {
        let entry = format!("{name}.{extension}");
        recipes.push(Recipe {
            file: format!("{entry}.spv"),
            entry,
            text: Some(text.clone()),
            defines: Vec::new(),
            generated: included.clone(),
        });
    }
    recipes.sort_by(|a, b| a.file.cmp(&b.file));
    Ok(recipes)
}

/// Module of a kernel: its stage, and the bytes of its SPIR-V.
pub type Kernel = (KernelStage, &'static [u8]);

/// The scene and the job of a kernel, and the room for subpaths for which the job was copied, of one
/// sample for each row.
pub type KernelScene<'a> = (&'a SceneBuffers, &'a JobBuffers, &'a SubpathRoom);

/// Number of bindings of films after those of a kernel's words.
const FILMS: usize = 8;

/// Runs a kernel with these constants over rows of `in_words` words each and returns `out_words`
/// words per row.
///
/// # Errors
/// Returns an error if the device fails.
pub fn run(
    device: &Arc<Device>,
    (scene, job, room): KernelScene,
    ((stage, spirv), constants): (Kernel, &Specialization),
    inputs: &[u32],
    [in_words, out_words]: [usize; 2],
) -> Result<Vec<u32>, VulkanError> {
    let spirv = words(spirv);
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
    // Kernels have no films.
    bound.extend((0..FILMS).map(|_| BoundResource::Storage(&output)));
    let subpaths = SubpathBuffers::new(device, room, true)?;
    bound.extend(subpaths.bindings());
    let push = KernelPush {
        rows,
        in_words: in_words as u32,
        out_words: out_words as u32,
    };
    let bytes = size_of::<KernelPush>() as u32;
    match stage {
        KernelStage::Compute => {
            let bindings = Bindings::new(device, vk::ShaderStageFlags::COMPUTE, &bound)?;
            let compute = ComputePipeline::new("kernel", &spirv, constants, &bindings, bytes)?;
            device.run("kernel", |commands| {
                compute.dispatch(commands, &bindings, &push, [rows.div_ceil(GROUP), 1, 1]);
                device.barrier_to_copy(commands);
            })?;
        }
        KernelStage::Generation => {
            let bindings = Bindings::new(device, ray_tracing::STAGES, &bound)?;
            let kernel =
                RayTracingPipeline::generation_only("kernel", &spirv, constants, &bindings, bytes)?;
            device.run("kernel", |commands| {
                kernel.trace(commands, &bindings, &push, [rows, 1, 1]);
                device.barrier_to_copy(commands);
            })?;
        }
    }
    output.read(rows as usize * out_words)
}
