//! Every shader compiles to SPIR-V with each combination of features that changes its text. Needs
//! no device, so a mistake in GLSL is found where no Vulkan driver is installed.

use lumbre_light::transport::integrator::INTEGRATORS;
use lumbre_vulkan::pipelines::program::shader_of;
use lumbre_vulkan::pipelines::spirv::Sources;
use lumbre_vulkan::pipelines::test_kernel::{KernelStage, compile};

use super::source::{root, text};

/// Entry points that include an integrator.
const ENTRIES: [&str; 3] = [
    "entry/compute.comp",
    "entry/query.comp",
    "entry/generation.rgen",
];

/// Entry points that do not include an integrator.
const OTHERS: [&str; 5] = [
    "entry/miss.rmiss",
    "entry/triangle.rchit",
    "entry/sphere.rchit",
    "entry/mask.rahit",
    "entry/sphere.rint",
];

/// Sets of definitions: none, those of a plain job, and those of a job with every feature.
const DEFINES: [&[(&str, &str)]; 3] = [
    &[],
    &[("SAMPLER_KIND", "0u"), ("MODELS", "2"), ("SPLAT_NONE", "")],
    &[
        ("SAMPLER_KIND", "1u"),
        ("LAYERS", ""),
        ("SPLAT_FLOAT", ""),
        ("TIMES", ""),
        ("PARTS", ""),
        ("COPIES", ""),
        ("SECOND_UVS", ""),
        ("PATHS", ""),
        ("TEXEL_SHIFT", "20u"),
    ],
];

/// Returns the definitions in the form that the compiler takes.
fn owned<'a>(defines: &[(&'a str, &str)]) -> Vec<(&'a str, String)> {
    let pairs = defines.iter();
    pairs
        .map(|(name, value)| (*name, (*value).to_owned()))
        .collect()
}

#[test]
fn every_entry_compiles_with_every_integrator_and_feature() {
    let sources = Sources::Embedded;
    for defines in DEFINES {
        let defines = owned(defines);
        for path in OTHERS {
            sources.compile(path, &defines, &[]).unwrap();
        }
        for integrator in INTEGRATORS {
            let name = integrator.name;
            let shader = shader_of(&sources, name).unwrap();
            let generated = [(
                "generated/integrator.glsl",
                format!(
                    "#define MAX_DEPTH 8u\n#include \"{shader}\"\n\
                     #define INTEGRATOR_SAMPLE {name}_sample\n"
                ),
            )];
            for path in ENTRIES {
                sources.compile(path, &defines, &generated).unwrap();
            }
        }
    }
}

#[test]
fn every_test_kernel_compiles() {
    let folder = root().join("tests/device/parity");
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "comp") {
            continue;
        }
        let name = path.file_stem().unwrap().to_str().unwrap();
        let mut kernel = text(&format!("tests/device/parity/{name}.comp"));
        if ["bpt", "nee", "bdpt"].contains(&name) {
            kernel.push_str(&text("tests/device/parity/brute.glsl"));
        }
        let stage = KernelStage::Generation;
        compile(stage, &Sources::Embedded, name, &kernel, [1, 1], &[]).unwrap();
    }
}
