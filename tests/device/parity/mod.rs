//! Function parity: a shader runs a GLSL twin over many inputs, and its outputs are compared with
//! those of the Rust original.
//!
//! To add a twin: write `tests/device/parity/NAME.comp` and a row in `tests/device/twins/`. The
//! file has neither `#version` nor `main`; it includes its twin and defines `twin`:
//!
//! ```glsl
//! #include "math/rng.glsl"
//! void twin() {
//!     uvec4 v = uvec4(in_word(), in_word(), in_word(), in_word());
//!     out_words(pcg4d(v));
//! }
//! ```
//!
//! `cargo shaders` then makes its module in `tests/device/parity/spirv/`.
//!
//! `in_word`, `in_float`, `in_vec2`, `in_vec3` and `in_vec4` take the next words of this
//! invocation's row of inputs; `out_word`, `out_words`, `out_float`, `out_vec2`, `out_vec3` and
//! `out_vec4` append words to its row of outputs. The declarations of `shaders/scene.glsl` hold the
//! scene and job of the twin.
//!
//! The Rust function takes the same words from a [`Row`], and pushes the same words.

use std::sync::Arc;

use lumbre_light::film::layer::LayerLayout;
use lumbre_light::scene::CompiledScene;
use lumbre_render::Job;
use lumbre_vulkan::context::device::Device;
use lumbre_vulkan::layout::Specialization;
use lumbre_vulkan::memory::subpaths::SubpathRoom;
use lumbre_vulkan::memory::upload::{JobBuffers, SceneBuffers};
use lumbre_vulkan::pipelines::program::TracingMode;
use lumbre_vulkan::pipelines::test_kernel;
use lumbre_vulkan::pipelines::test_kernel::Kernel;
use lumbre_vulkan::prepare::specialization;
use lumbre_vulkan::schedule::pixel_samples::PixelSamples;

use super::harness;
use super::twins::TWINS;

/// Tolerance of an output word relative to that of the original.
#[derive(Clone, Copy, Debug)]
pub enum Near {
    /// The same bits.
    Bits,
    /// A float within an absolute error, or a relative one, whichever is larger. NaN equals NaN.
    Float {
        /// Greatest absolute error.
        absolute: f32,
        /// Greatest relative error.
        relative: f32,
    },
}

/// One row of [`TWINS`].
pub struct Twin {
    /// Stem of the shader `tests/device/parity/NAME.comp`.
    pub name: &'static str,
    /// Module of the shader.
    pub kernel: Kernel,
    /// Scene and job that are bound.
    pub scene: fn() -> (Arc<CompiledScene>, Job),
    /// Number of words in a row of inputs.
    pub in_words: usize,
    /// The inputs, row after row.
    pub inputs: fn() -> Vec<u32>,
    /// The Rust original.
    pub original: fn(&CompiledScene, &Job, &mut Row),
    /// Tolerance of each word of a row of output.
    pub near: &'static [Near],
    /// Largest share of rows that may exceed the tolerance, because they take another branch.
    pub max_outliers: f64,
    /// Reason for the tolerance.
    pub why: &'static str,
}

/// A row of inputs that is being read, and a row of outputs that is being written.
pub struct Row<'a> {
    inputs: std::slice::Iter<'a, u32>,
    outputs: Vec<u32>,
}

impl<'a> Row<'a> {
    /// Creates a row of these inputs.
    pub fn new(inputs: &'a [u32]) -> Row<'a> {
        Row {
            inputs: inputs.iter(),
            outputs: Vec::new(),
        }
    }
}

impl Row<'_> {
    /// Returns the next word.
    pub fn word(&mut self) -> u32 {
        *self
            .inputs
            .next()
            .expect("the original takes more inputs than a row has")
    }

    /// Returns the next float.
    pub fn float(&mut self) -> f32 {
        f32::from_bits(self.word())
    }

    /// Returns the next floats.
    pub fn floats<const N: usize>(&mut self) -> [f32; N] {
        std::array::from_fn(|_| self.float())
    }

    /// Appends a word of output.
    pub fn push(&mut self, word: u32) {
        self.outputs.push(word);
    }

    /// Appends words of output.
    pub fn push_words(&mut self, words: impl IntoIterator<Item = u32>) {
        self.outputs.extend(words);
    }

    /// Appends floats of output.
    pub fn push_floats(&mut self, floats: impl IntoIterator<Item = f32>) {
        self.outputs.extend(floats.into_iter().map(f32::to_bits));
    }
}

impl Near {
    /// Returns whether a word of the twin is within the tolerance.
    fn holds(self, twin: u32, original: u32) -> bool {
        match self {
            Near::Bits => twin == original,
            Near::Float { absolute, relative } => {
                let (twin, original) = (f32::from_bits(twin), f32::from_bits(original));
                let allowed = absolute.max(relative * original.abs());
                let near = original.is_finite() && (twin - original).abs() <= allowed;
                near || twin == original || (twin.is_nan() && original.is_nan())
            }
        }
    }

    /// Returns a word as text.
    fn shown(self, word: u32) -> String {
        match self {
            Near::Bits => format!("{word:#010x}"),
            Near::Float { .. } => format!("{:e}", f32::from_bits(word)),
        }
    }
}

/// Returns the rows in which a twin differs from its original, one line each. Empty if their share
/// is allowed.
fn differences(
    twin: &Twin,
    inputs: &[u32],
    outputs: &[u32],
    scene: &CompiledScene,
    job: &Job,
) -> Vec<String> {
    let rows = inputs.len() / twin.in_words;
    let mut wrong = Vec::new();
    for (i, (input, output)) in inputs
        .chunks(twin.in_words)
        .zip(outputs.chunks(twin.near.len()))
        .enumerate()
    {
        let mut row = Row::new(input);
        (twin.original)(scene, job, &mut row);
        if row.outputs.len() != twin.near.len() {
            return vec![format!(
                "{} words of the original instead of {}",
                row.outputs.len(),
                twin.near.len()
            )];
        }
        let far = |((near, a), b): ((&Near, &u32), &u32)| !near.holds(*a, *b);
        if let Some(word) = twin.near.iter().zip(output).zip(&row.outputs).position(far) {
            let (shown, inputs) = (
                |w: u32| twin.near[word].shown(w),
                input.iter().map(|w| format!("{:e}", f32::from_bits(*w))),
            );
            wrong.push(format!(
                "row {i}, word {word}: {} instead of {}; inputs {}",
                shown(output[word]),
                shown(row.outputs[word]),
                inputs.collect::<Vec<_>>().join(" ")
            ));
        }
    }
    if wrong.len() as f64 <= twin.max_outliers * rows as f64 {
        wrong.clear();
    }
    wrong
}

/// Returns the device if it has ray-tracing pipelines, in which kernels run, and may use them.
fn kernel_device() -> Option<Arc<Device>> {
    let device = harness::device()?;
    let lacking = TracingMode::Pipeline.lacking(&device.info);
    if lacking.is_some() || !device.info.caps.extended() {
        crate::common::skipped(format_args!(
            "{} lacks ray-tracing pipelines or double precision",
            device.info.line()
        ));
        return None;
    }
    Some(device)
}

/// Returns the room for the subpaths of a sample for each of `rows` rows.
fn room_of(job: &Job, rows: usize) -> SubpathRoom {
    SubpathRoom {
        samples: rows as u32,
        ..SubpathRoom::new(job, None, u64::MAX)
    }
}

#[test]
fn every_twin_computes_the_values_of_its_original() {
    let device = or_return!(kernel_device());
    let mut failed = Vec::new();
    for &twin in TWINS {
        let (scene, job) = (twin.scene)();
        let inputs = (twin.inputs)();
        let room = room_of(&job, inputs.len() / twin.in_words);
        let buffers = (
            SceneBuffers::new(&device, &scene).unwrap(),
            JobBuffers::new(&device, &scene, &job, &LayerLayout::default(), &room).unwrap(),
        );
        assert!(
            !inputs.is_empty() && inputs.len().is_multiple_of(twin.in_words),
            "{}: inputs",
            twin.name
        );
        let words = [twin.in_words, twin.near.len()];
        // Kernels have all models, and a time axis whatever the job.
        let constants = Specialization {
            models: Specialization::default().models,
            times: 1,
            parts: 1,
            ..specialization(&scene, &job, None, PixelSamples::InTurn)
        };
        let outputs = test_kernel::run(
            &device,
            (&buffers.0, &buffers.1, &room),
            (twin.kernel, &constants),
            &inputs,
            words,
        )
        .unwrap_or_else(|e| panic!("{}: {e}", twin.name));
        let wrong = differences(twin, &inputs, &outputs, &scene, &job);
        if !wrong.is_empty() {
            let rows = inputs.len() / twin.in_words;
            let shown = wrong[..wrong.len().min(5)].join("\n  ");
            failed.push(format!(
                "{}: {} of {rows} rows ({}):\n  {shown}",
                twin.name,
                wrong.len(),
                twin.why
            ));
        }
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
    harness::assert_no_validation_messages();
}

#[test]
fn every_shader_of_the_folder_has_a_row_and_every_row_a_reason() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/device/parity");
    let files = std::fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().path());
    let mut shaders: Vec<String> = files
        .filter(|p| p.extension().is_some_and(|e| e == "comp"))
        .map(|p| p.file_stem().unwrap().to_string_lossy().into_owned())
        .collect();
    shaders.sort();
    let mut rows: Vec<String> = TWINS.iter().map(|t| t.name.to_owned()).collect();
    // Kernels of other tests.
    rows.extend(["echo", "texels"].map(str::to_owned));
    rows.sort();
    rows.dedup();
    assert_eq!(shaders, rows);
    assert!(
        TWINS
            .iter()
            .all(|t| t.why.len() > 10 && (0.0..0.05).contains(&t.max_outliers))
    );
}

#[test]
fn a_wrong_twin_is_detected() {
    let device = or_return!(kernel_device());
    let (scene, job) = (ECHO.scene)();
    let room = room_of(&job, 100);
    let buffers = (
        SceneBuffers::new(&device, &scene).unwrap(),
        JobBuffers::new(&device, &scene, &job, &LayerLayout::default(), &room).unwrap(),
    );
    let wrong = |kernel: Kernel, added: u32| {
        let inputs: Vec<u32> = (0..100).flat_map(|word| [word, added]).collect();
        let outputs = test_kernel::run(
            &device,
            (&buffers.0, &buffers.1, &room),
            (kernel, &Specialization::default()),
            &inputs,
            [2, 1],
        )
        .unwrap();
        differences(&ECHO, &inputs, &outputs, &scene, &job).len()
    };
    for kernel in [kernel!(Compute "echo.comp"), ECHO.kernel] {
        assert_eq!(wrong(kernel, 1), 100);
        assert_eq!(wrong(kernel, 0), 0);
    }
}

#[test]
fn tolerances_are_absolute_or_relative_and_nan_equals_nan() {
    let near = Near::Float {
        absolute: 0.1,
        relative: 0.01,
    };
    let holds = |a: f32, b: f32| near.holds(a.to_bits(), b.to_bits());
    assert!(
        holds(0.05, 0.0)
            && holds(100.9, 100.0)
            && holds(f32::NAN, f32::NAN)
            && holds(f32::INFINITY, f32::INFINITY)
    );
    assert!(
        !holds(0.2, 0.0)
            && !holds(102.0, 100.0)
            && !holds(f32::NAN, 0.0)
            && !holds(0.0, f32::INFINITY)
    );
}

/// A twin that returns its first input, plus the second one.
const ECHO: Twin = Twin {
    name: "echo",
    kernel: kernel!(Generation "echo.rgen"),
    scene: super::twins::plain,
    in_words: 2,
    inputs: Vec::new,
    original: |_, _, row| {
        let [echo, _]: [f32; 2] = row.floats();
        row.push_floats([echo]);
    },
    near: &[Near::Bits],
    max_outliers: 0.0,
    why: "the words are copied",
};
