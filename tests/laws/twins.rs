//! GLSL twins lie where their originals lie, say so in their first line, and none is forgotten.

use super::source::{root, rust_files, text};

/// Shaders without an original of the same name: what Rust takes from its libraries, and types that Rust keeps in `mod.rs`
/// but that GLSL must read before what `mod.glsl` includes.
const ALONE: &[(&str, &str)] = &[
    ("transport/bsdf/lobe.glsl", "src/transport/bsdf/mod.rs"),
    ("transport/light/types.glsl", "src/transport/light/mod.rs"),
];

/// Originals without a twin, and why.
const HOST: &[(&str, &str)] = &[
    ("src/math/discovery.rs", "statistics of nights"),
    ("src/math/lanes/eight.rs", "GLSL has lanes of its own"),
    ("src/math/lanes/mod.rs", "GLSL has lanes of its own"),
    ("src/math/lanes/sixteen.rs", "GLSL has lanes of its own"),
    ("src/math/lanes/tests.rs", "tests"),
    ("src/math/mod.rs", "nothing but names"),
    ("src/math/real.rs", "GLSL has numbers of its own"),
    ("src/math/stats.rs", "tests of statistics"),
    ("src/math/student.rs", "statistics of nights"),
    ("src/transport/camera/mod.rs", "nothing but names"),
    ("src/transport/delay/mod.rs", "nothing but names"),
    ("src/transport/integrator/external.rs", "names of what other programs compute"),
    ("src/transport/integrator/mod.rs", "the table of integrators"),
    ("src/transport/integrator/oracle/mod.rs", "the slow judge of weights"),
    ("src/transport/integrator/oracle/path.rs", "the slow judge of weights"),
    ("src/transport/integrator/oracle/split.rs", "the slow judge of weights"),
    ("src/transport/light/select.rs", "weights of lights become a table on the host"),
    ("src/transport/sampler/sobol_tests.rs", "tests"),
    ("src/transport/timing.rs", "the words of scripts"),
];

/// Every shader below a folder of `shaders/`.
fn shaders(folder: &str) -> Vec<String> {
    let (mut open, mut found) = (vec![root().join("shaders").join(folder)], Vec::new());
    while let Some(next) = open.pop() {
        for path in std::fs::read_dir(next).unwrap().map(|e| e.unwrap().path()) {
            if path.is_dir() {
                open.push(path);
            } else {
                found.push(path.strip_prefix(root().join("shaders")).unwrap().to_string_lossy().replace('\\', "/"));
            }
        }
    }
    found.sort();
    found
}

#[test]
fn every_twin_lies_where_its_original_lies_and_names_it() {
    for shader in ["math", "transport"].iter().flat_map(|folder| shaders(folder)) {
        let first = text(&format!("shaders/{shader}")).lines().next().unwrap_or_default().to_owned();
        let alone = ALONE.iter().find(|(name, _)| *name == shader).map(|(_, original)| (*original).to_owned());
        let original = alone.unwrap_or_else(|| format!("src/{}", shader.replace(".glsl", ".rs")));
        assert!(first.contains(&original), "shaders/{shader} does not name {original} in its first line");
        assert!(root().join(&original).is_file(), "shaders/{shader} has no original {original}");
    }
}

#[test]
fn every_original_has_a_twin_or_a_reason_to_have_none() {
    let twins: Vec<String> = ["math", "transport"].iter().flat_map(|folder| shaders(folder)).collect();
    for original in ["src/math", "src/transport"].iter().flat_map(|folder| rust_files(folder)) {
        let twin = original.trim_start_matches("src/").replace(".rs", ".glsl");
        let excused = HOST.iter().any(|(name, reason)| *name == original && !reason.is_empty());
        assert!(twins.contains(&twin) != excused, "{original}: shaders/{twin} is missing, or need not be excused");
    }
}
