//! GLSL twins have the same relative path as their Rust originals, name them in their first line,
//! and are complete.

use super::source::{root, rust_files, text};

/// Shaders whose original has another path, with that path: types that Rust defines in `mod.rs` but
/// that GLSL must define before the files that `mod.glsl` includes.
const OTHER_ORIGINAL: &[(&str, &str)] =
    &[("transport/light/types.glsl", "src/transport/light/mod.rs")];

/// Originals without a twin, with the reason.
const HOST: &[(&str, &str)] = &[
    ("src/math/false_discovery_rate.rs", "statistics of nights"),
    ("src/math/simd/x8.rs", "GLSL invocations replace SIMD lanes"),
    (
        "src/math/simd/mod.rs",
        "GLSL invocations replace SIMD lanes",
    ),
    (
        "src/math/simd/x16.rs",
        "GLSL invocations replace SIMD lanes",
    ),
    ("src/math/simd/tests.rs", "tests"),
    ("src/math/mod.rs", "re-exports only"),
    ("src/math/real.rs", "GLSL has built-in number types"),
    ("src/math/stats.rs", "statistics of tests"),
    ("src/math/t_test.rs", "statistics of nights"),
    (
        "src/transport/bsdf/disney/sampling.rs",
        "its twin is part of disney.glsl",
    ),
    ("src/transport/camera/mod.rs", "re-exports only"),
    ("src/transport/delay/mod.rs", "re-exports only"),
    (
        "src/transport/integrator/external.rs",
        "techniques of other programs",
    ),
    (
        "src/transport/integrator/mod.rs",
        "the table of integrators",
    ),
    (
        "src/transport/integrator/oracle/mod.rs",
        "reference for MIS weights",
    ),
    (
        "src/transport/integrator/oracle/path.rs",
        "reference for MIS weights",
    ),
    (
        "src/transport/integrator/oracle/split.rs",
        "reference for MIS weights",
    ),
    (
        "src/transport/light/select.rs",
        "light weights are tabulated on the host",
    ),
    ("src/transport/sampler/sobol_tests.rs", "tests"),
    ("src/transport/time_settings.rs", "parses script tables"),
];

/// Returns every shader below a folder of `shaders/`.
fn shaders(folder: &str) -> Vec<String> {
    let (mut open, mut found) = (vec![root().join("shaders").join(folder)], Vec::new());
    while let Some(next) = open.pop() {
        for path in std::fs::read_dir(next).unwrap().map(|e| e.unwrap().path()) {
            if path.is_dir() {
                open.push(path);
            } else {
                found.push(
                    path.strip_prefix(root().join("shaders"))
                        .unwrap()
                        .to_string_lossy()
                        .replace('\\', "/"),
                );
            }
        }
    }
    found.sort();
    found
}

#[test]
fn every_twin_has_the_path_of_its_original_and_names_it() {
    for shader in ["math", "transport"]
        .iter()
        .flat_map(|folder| shaders(folder))
    {
        let first = text(&format!("shaders/{shader}"))
            .lines()
            .next()
            .unwrap_or_default()
            .to_owned();
        let listed = OTHER_ORIGINAL
            .iter()
            .find(|(name, _)| *name == shader)
            .map(|(_, original)| (*original).to_owned());
        let original = listed.unwrap_or_else(|| format!("src/{}", shader.replace(".glsl", ".rs")));
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

#[test]
fn every_original_has_a_twin_or_a_stated_reason_for_having_none() {
    let twins: Vec<String> = ["math", "transport"]
        .iter()
        .flat_map(|folder| shaders(folder))
        .collect();
    for original in ["src/math", "src/transport"]
        .iter()
        .flat_map(|folder| rust_files(folder))
    {
        let twin = original.trim_start_matches("src/").replace(".rs", ".glsl");
        let listed_without_twin = HOST
            .iter()
            .any(|(name, reason)| *name == original && !reason.is_empty());
        assert!(
            twins.contains(&twin) != listed_without_twin,
            "{original}: shaders/{twin} is missing, or HOST lists it although it exists"
        );
    }
}
