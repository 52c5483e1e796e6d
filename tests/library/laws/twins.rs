//! GLSL twins have the same relative path as their Rust originals, name them in their first line,
//! and are complete.

use lumbre_light::transport::integrator::INTEGRATORS;

use super::source::{root, rust_files, text};

/// Shaders whose original has another path, with that path: types that Rust defines in `mod.rs` but
/// that GLSL must define before the files that `mod.glsl` includes.
const OTHER_ORIGINAL: &[(&str, &str)] = &[(
    "transport/light/types.glsl",
    "crates/lumbre-light/src/transport/light/mod.rs",
)];

/// Originals without a twin, with the reason.
const HOST: &[(&str, &str)] = &[
    (
        "crates/lumbre-light/src/math/exponential.rs",
        "GLSL has the function `exp`",
    ),
    (
        "crates/lumbre-light/src/math/false_discovery_rate.rs",
        "statistics of nights",
    ),
    (
        "crates/lumbre-light/src/math/luminance.rs",
        "three constants, which shaders repeat",
    ),
    (
        "crates/lumbre-light/src/transport/delay/mixture.rs",
        "densities of delays for figures",
    ),
    (
        "crates/lumbre-light/src/math/simd/x8.rs",
        "GLSL invocations replace SIMD lanes",
    ),
    (
        "crates/lumbre-light/src/math/simd/lanes.rs",
        "GLSL invocations replace SIMD lanes",
    ),
    (
        "crates/lumbre-light/src/math/simd/mod.rs",
        "GLSL invocations replace SIMD lanes",
    ),
    (
        "crates/lumbre-light/src/math/simd/x1.rs",
        "GLSL invocations replace SIMD lanes",
    ),
    (
        "crates/lumbre-light/src/math/simd/pair.rs",
        "GLSL invocations replace SIMD lanes",
    ),
    (
        "crates/lumbre-light/src/math/simd/x16.rs",
        "GLSL invocations replace SIMD lanes",
    ),
    (
        "crates/lumbre-light/src/math/simd/record.rs",
        "GLSL invocations replace SIMD lanes",
    ),
    (
        "crates/lumbre-light/src/transport/light/tree/mod.rs",
        "devices do not choose lights by a tree",
    ),
    (
        "crates/lumbre-light/src/transport/light/tree/bounds.rs",
        "devices do not choose lights by a tree",
    ),
    (
        "crates/lumbre-light/src/transport/light/tree/build.rs",
        "devices do not choose lights by a tree",
    ),
    (
        "crates/lumbre-light/src/transport/arrival.rs",
        "GLSL invocations replace SIMD lanes",
    ),
    (
        "crates/lumbre-light/src/transport/integrator/bdpt/single.rs",
        "GLSL invocations follow one path each",
    ),
    (
        "crates/lumbre-light/src/transport/integrator/bdpt/state.rs",
        "GLSL invocations follow one path each",
    ),
    (
        "crates/lumbre-light/src/transport/integrator/bdpt/store.rs",
        "GLSL invocations follow one path each",
    ),
    (
        "crates/lumbre-light/src/transport/integrator/bdpt/directions.rs",
        "devices continue paths in directions of the BSDF alone",
    ),
    (
        "crates/lumbre-light/src/transport/integrator/bdpt/joins.rs",
        "GLSL invocations follow one path each",
    ),
    (
        "crates/lumbre-light/src/transport/integrator/bdpt/merge.rs",
        "devices merge no vertices",
    ),
    (
        "crates/lumbre-light/src/transport/integrator/directions.rs",
        "devices continue paths in directions of the BSDF alone",
    ),
    (
        "crates/lumbre-light/src/transport/integrator/camera_path/mod.rs",
        "GLSL invocations follow one path each",
    ),
    (
        "crates/lumbre-light/src/transport/integrator/camera_path/state.rs",
        "its twin is part of camera_path/single.glsl",
    ),
    (
        "crates/lumbre-light/src/transport/integrator/camera_path/walk.rs",
        "GLSL invocations follow one path each",
    ),
    (
        "crates/lumbre-light/src/transport/light/direct.rs",
        "its twin is part of light/mod.glsl",
    ),
    (
        "crates/lumbre-light/src/transport/light/emission.rs",
        "its twin is part of light/mod.glsl",
    ),
    (
        "crates/lumbre-light/src/transport/light/environment_source.rs",
        "its twin is part of light/mod.glsl",
    ),
    (
        "crates/lumbre-light/src/transport/light/kinds.rs",
        "its twin is part of light/mod.glsl",
    ),
    (
        "crates/lumbre-light/src/transport/light/source.rs",
        "GLSL has no traits",
    ),
    (
        "crates/lumbre-light/src/transport/light/selected.rs",
        "GLSL invocations choose one light each",
    ),
    (
        "crates/lumbre-light/src/transport/light/table.rs",
        "rows of lights are in the buffers of a scene",
    ),
    (
        "crates/lumbre-light/src/transport/surface/lookup.rs",
        "its twin is part of surface.glsl",
    ),
    (
        "crates/lumbre-light/src/transport/surface/maps.rs",
        "its twin is part of surface.glsl",
    ),
    (
        "crates/lumbre-light/src/transport/surface/mask.rs",
        "its twin is part of surface.glsl",
    ),
    (
        "crates/lumbre-light/src/transport/surface/parameters.rs",
        "its twin is part of surface.glsl",
    ),
    (
        "crates/lumbre-light/src/transport/surface/terminator.rs",
        "its twin is part of surface.glsl",
    ),
    (
        "crates/lumbre-light/src/transport/surface/traits.rs",
        "GLSL invocations replace SIMD lanes",
    ),
    ("crates/lumbre-light/src/math/simd/tests.rs", "tests"),
    ("crates/lumbre-light/src/math/mod.rs", "re-exports only"),
    (
        "crates/lumbre-light/src/math/real.rs",
        "GLSL has built-in number types",
    ),
    (
        "crates/lumbre-light/src/math/stats.rs",
        "statistics of tests",
    ),
    (
        "crates/lumbre-light/src/math/t_test.rs",
        "statistics of nights",
    ),
    (
        "crates/lumbre-light/src/transport/bsdf/disney/parameters.rs",
        "its twin is part of disney.glsl",
    ),
    (
        "crates/lumbre-light/src/transport/bsdf/disney/sampling.rs",
        "its twin is part of disney.glsl",
    ),
    (
        "crates/lumbre-light/src/transport/bsdf/local.rs",
        "shaders choose a model by a constant, without a trait",
    ),
    (
        "crates/lumbre-light/src/transport/bsdf/material.rs",
        "constants of GLSL materials are rows of a buffer",
    ),
    (
        "crates/lumbre-light/src/transport/bsdf/model.rs",
        "its twin is part of bsdf/mod.glsl",
    ),
    (
        "crates/lumbre-light/src/transport/bsdf/numbers.rs",
        "GLSL invocations replace SIMD lanes",
    ),
    (
        "crates/lumbre-light/src/transport/bsdf/outgoing.rs",
        "its twins are parts of disney.glsl and bsdf/interface.glsl",
    ),
    (
        "crates/lumbre-light/src/transport/bsdf/packed.rs",
        "GLSL invocations replace SIMD lanes",
    ),
    (
        "crates/lumbre-light/src/transport/bsdf/scalar.rs",
        "GLSL invocations replace SIMD lanes",
    ),
    (
        "crates/lumbre-light/src/transport/camera/mod.rs",
        "re-exports only",
    ),
    (
        "crates/lumbre-light/src/transport/delay/mod.rs",
        "re-exports only",
    ),
    (
        "crates/lumbre-light/src/transport/integrator/context.rs",
        "GLSL has global buffers and constants",
    ),
    (
        "crates/lumbre-light/src/transport/integrator/external.rs",
        "techniques of other programs",
    ),
    (
        "crates/lumbre-light/src/transport/integrator/iteration/light_batch.rs",
        "its twin is part of iteration/light_paths.glsl",
    ),
    (
        "crates/lumbre-light/src/transport/integrator/iteration/mod.rs",
        "the host records what devices compute before samples",
    ),
    (
        "crates/lumbre-light/src/transport/integrator/iteration/photon_map.rs",
        "devices gather no photons",
    ),
    (
        "crates/lumbre-light/src/transport/integrator/iteration/recorded.rs",
        "devices learn from no samples",
    ),
    (
        "crates/lumbre-light/src/transport/integrator/mod.rs",
        "the table of integrators",
    ),
    (
        "crates/lumbre-light/src/transport/integrator/own.rs",
        "techniques of other crates, which render on the CPU",
    ),
    (
        "crates/lumbre-light/src/transport/integrator/oracle/guide.rs",
        "reference for MIS weights",
    ),
    (
        "crates/lumbre-light/src/transport/integrator/oracle/mod.rs",
        "reference for MIS weights",
    ),
    (
        "crates/lumbre-light/src/transport/integrator/oracle/path.rs",
        "reference for MIS weights",
    ),
    (
        "crates/lumbre-light/src/transport/integrator/oracle/split.rs",
        "reference for MIS weights",
    ),
    (
        "crates/lumbre-light/src/transport/integrator/registry.rs",
        "the table of integrators",
    ),
    (
        "crates/lumbre-light/src/transport/integrator/row.rs",
        "rows of the table of integrators",
    ),
    (
        "crates/lumbre-light/src/transport/light/select.rs",
        "light weights are tabulated on the host",
    ),
    (
        "crates/lumbre-light/src/transport/sampler/sobol_tests.rs",
        "tests",
    ),
    (
        "crates/lumbre-light/src/transport/sampler/zsobol_tests.rs",
        "tests",
    ),
    (
        "crates/lumbre-light/src/transport/time_settings.rs",
        "parses script tables",
    ),
];

/// Folder of the shaders.
const SHADERS: &str = "shaders";

/// Folder of their originals.
const ORIGINALS: &str = "crates/lumbre-light/src";

/// Returns every shader below a folder of `shaders/`.
fn shaders(folder: &str) -> Vec<String> {
    let shaders = root().join(SHADERS);
    let files = crate::common::files_below(&shaders.join(folder)).into_iter();
    let name = |path: std::path::PathBuf| {
        path.strip_prefix(&shaders)
            .unwrap()
            .to_string_lossy()
            .replace('\\', "/")
    };
    files.map(name).collect()
}

#[test]
fn every_twin_has_the_path_of_its_original_and_names_it() {
    for shader in ["math", "transport"]
        .iter()
        .flat_map(|folder| shaders(folder))
    {
        let first = text(&format!("{SHADERS}/{shader}"))
            .lines()
            .next()
            .unwrap_or_default()
            .to_owned();
        let listed = OTHER_ORIGINAL
            .iter()
            .find(|(name, _)| *name == shader)
            .map(|(_, original)| (*original).to_owned());
        let original =
            listed.unwrap_or_else(|| format!("{ORIGINALS}/{}", shader.replace(".glsl", ".rs")));
        assert!(
            first.contains(&original),
            "shaders/{shader} does not name {original} in its first line"
        );
        assert!(
            root().join(&original).is_file(),
            "shaders/{shader} has no original {original}"
        );
    }
}

/// Returns whether the twin of a file would belong to an integrator without a shader: those need no
/// reason, since backends refuse them.
fn belongs_to_host_integrator(twin: &str, twins: &[String]) -> bool {
    INTEGRATORS.iter().any(|row| {
        let stem = format!("transport/integrator/{}", row.name);
        let belongs = |file: &str| {
            file.strip_prefix(&stem)
                .is_some_and(|rest| rest.starts_with(['.', '/']))
        };
        belongs(twin) && !twins.iter().any(|file| belongs(file))
    })
}

#[test]
fn every_original_has_a_twin_or_a_stated_reason_for_having_none() {
    let twins: Vec<String> = ["math", "transport"]
        .iter()
        .flat_map(|folder| shaders(folder))
        .collect();
    for original in [
        "crates/lumbre-light/src/math",
        "crates/lumbre-light/src/transport",
    ]
    .iter()
    .flat_map(|folder| rust_files(folder))
    .filter(|original| !original.ends_with("/tests.rs"))
    {
        let twin = original
            .trim_start_matches(ORIGINALS)
            .trim_start_matches('/')
            .replace(".rs", ".glsl");
        let listed_without_twin = HOST
            .iter()
            .any(|(name, reason)| *name == original && !reason.is_empty())
            || belongs_to_host_integrator(&twin, &twins);
        assert!(
            twins.contains(&twin) != listed_without_twin,
            "{original}: shaders/{twin} is missing, or HOST lists it although it exists"
        );
    }
}
