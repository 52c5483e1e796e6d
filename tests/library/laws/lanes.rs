//! Functions that use SIMD vector types must be force-inlined.
//!
//! The vector types carry no target feature. A function that uses them and is not inlined into a
//! function compiled for the instruction set is compiled for the baseline, where every vector
//! instruction becomes a call: the same bits at half the speed of the scalar path. No other test
//! would notice, since none measures time.
//!
//! Closures cannot be force-inlined, and this test does not detect those that use vectors: `cargo
//! xtask inlining` finds them in the compiled program.

use super::source::{code_only, rust_files, text, words};

/// Names of the traits and types of SIMD vectors.
const LANES: [&str; 11] = [
    "Real", "Lanes", "Word", "Vector", "Mask", "Double", "F32xN", "U32xN", "Vec3xN", "MaskN",
    "F64xN",
];

/// The modules in which these names are SIMD vectors.
const MODULES: [&str; 3] = [
    "crates/lumbre-light/src/math",
    "crates/lumbre-light/src/transport",
    "crates/lumbre-render/src/cpu/wavefront",
];

/// Attributes that a function with vectors must have one of.
const REQUIRED: [&str; 2] = ["#[inline(always)]", "#[target_feature("];

/// Function of one lane that is meant to be a function of its own.
const OUTLINED: &str = "fn outline<K: Outlined>(computation: K) -> K::Output";

/// Returns the functions of code without comments, each with its attributes and the header of the
/// item that contains it.
fn functions(code: &str) -> Vec<(String, String, String)> {
    let mut found = Vec::new();
    let (mut around, mut attributes) = (String::new(), String::new());
    let mut lines = code.lines().peekable();
    while let Some(line) = lines.next() {
        let bare = line.trim_start();
        let indent = line.len() - bare.len();
        if line.starts_with('}') {
            around.clear();
        }
        if bare.starts_with("#[") {
            attributes.push_str(bare);
            continue;
        }
        if indent == 0
            && ["impl", "pub trait", "trait", "macro_rules!"]
                .iter()
                .any(|word| bare.starts_with(word))
        {
            around = bare.to_owned();
        } else if words(bare.split('(').next().unwrap_or_default(), "fn")
            .next()
            .is_some()
        {
            let mut whole = bare.to_owned();
            let open = |text: &str| text.contains('{') || text.trim_end().ends_with(';');
            while !open(&whole) {
                whole.push_str(lines.next().unwrap_or("{"));
            }
            let ends_here = whole.trim_end().ends_with(['}', ';']);
            while !ends_here && let Some(next) = lines.next() {
                whole.push_str(next);
                if next.trim_start() == "}" && next.len() - next.trim_start().len() == indent {
                    break;
                }
            }
            found.push((whole, attributes.clone(), around.clone()));
        }
        if !bare.is_empty() {
            attributes.clear();
        }
    }
    found
}

/// Returns whether code contains any of the names as a word.
fn names_lanes(code: &str) -> bool {
    LANES.iter().any(|name| words(code, name).next().is_some())
}

/// Returns the signatures of functions that use vectors, and whether they are force-inlined.
fn vector_functions(text: &str) -> Vec<(String, bool)> {
    let code = code_only(text);
    let code = code
        .split("#[cfg(test)]\nmod tests {")
        .next()
        .unwrap_or_default();
    let with_bodies = functions(code)
        .into_iter()
        .filter(|(whole, ..)| whole.contains('{'));
    with_bodies
        .filter(|(whole, _, around)| names_lanes(whole) || names_lanes(around))
        .map(|(whole, attributes, _)| {
            let begin = whole
                .split('{')
                .next()
                .unwrap_or_default()
                .trim()
                .to_owned();
            (begin, REQUIRED.iter().any(|fit| attributes.contains(fit)))
        })
        .collect()
}

/// Returns the signatures of functions that use vectors and are not force-inlined.
fn not_inlined(text: &str) -> Vec<String> {
    vector_functions(text)
        .into_iter()
        .filter(|(begin, fit)| !fit && begin != OUTLINED)
        .map(|(begin, _)| begin)
        .collect()
}

#[test]
fn functions_that_use_vectors_are_force_inlined() {
    let files = MODULES
        .iter()
        .flat_map(|module| rust_files(module))
        .filter(|file| !file.ends_with("tests.rs"));
    let files: Vec<String> = files.collect();
    let seen: usize = files.iter().map(|f| vector_functions(&text(f)).len()).sum();
    assert!(
        seen > 150,
        "only {seen} functions with vectors were found: the names in this test are out of date"
    );
    let missing = files.iter().flat_map(|f| {
        not_inlined(&text(f))
            .into_iter()
            .map(move |begin| format!("{f}: {begin}"))
    });
    let missing: Vec<String> = missing.collect();
    assert!(
        missing.is_empty(),
        "#[inline(always)] is missing before\n{}",
        missing.join("\n")
    );
}

#[test]
fn the_check_of_lanes_finds_functions_that_use_vectors() {
    let slow = "#[inline]\npub fn f<R: Real>(x: R) -> R {\n    x\n}\n";
    let fast = slow.replace("inline", "inline(always)");
    let method = "impl<V: Vector> A<V> {\n    /// Real.\n    \
                  fn g(self) -> Self {\n        self\n    }\n    \
                  #[inline(always)]\n    fn h() {}\n}\n";
    let inside = "fn k(x: f32) {\n    let y = F32xN::splat(x);\n}\nfn l() {}\n";
    assert_eq!(not_inlined(slow), ["pub fn f<R: Real>(x: R) -> R"]);
    assert!(
        not_inlined(&fast).is_empty()
            && not_inlined("trait A: Real {\n    fn b();\n}\n").is_empty()
    );
    assert_eq!(not_inlined(method), ["fn g(self) -> Self"]);
    assert_eq!(not_inlined(inside), ["fn k(x: f32)"]);
}
