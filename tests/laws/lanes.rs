//! What runs in the lanes of vectors is inlined, all of it.
//!
//! The types of lanes say nothing of the processor. A function that takes them and is not inlined into one that is compiled
//! for it is compiled for the baseline, where every instruction of a vector becomes a call: the same bits, at half the speed
//! of single paths. Nothing else would say so, since no test measures time.
//!
//! Closures cannot be told so, and this law does not see whether they hold lanes: `docs/performance.md` says what they cost
//! and how to look.

use super::source::{code_only, rust_files, text, words};

/// Names that mean any number of lanes, or so many.
const LANES: [&str; 11] =
    ["Real", "Lanes", "Word", "Vector", "Mask", "Double", "Reals", "Words", "Vectors", "Yes", "Doubles"];

/// The rooms in which these names mean that.
const ROOMS: [&str; 3] = ["src/math", "src/transport", "src/render/cpu/streams"];

/// Attributes of a function that lanes may run through.
const FIT: [&str; 2] = ["#[inline(always)]", "#[target_feature("];

/// The functions of code without comments, each with its attributes and whatever it stands in says of types before it.
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
        if indent == 0 && ["impl", "pub trait", "trait", "macro_rules!"].iter().any(|word| bare.starts_with(word)) {
            around = bare.to_owned();
        } else if words(bare.split('(').next().unwrap_or_default(), "fn").next().is_some() {
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

/// Whether any of the names stands there as a word.
fn names_lanes(code: &str) -> bool {
    LANES.iter().any(|name| words(code, name).next().is_some())
}

/// The beginnings of functions that name lanes, and whether they are inlined by force.
fn in_lanes(text: &str) -> Vec<(String, bool)> {
    let code = code_only(text);
    let code = code.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    let with_bodies = functions(code).into_iter().filter(|(whole, ..)| whole.contains('{'));
    with_bodies
        .filter(|(whole, _, around)| names_lanes(whole) || names_lanes(around))
        .map(|(whole, attributes, _)| {
            let begin = whole.split('{').next().unwrap_or_default().trim().to_owned();
            (begin, FIT.iter().any(|fit| attributes.contains(fit)))
        })
        .collect()
}

/// Those that are not.
fn unfit(text: &str) -> Vec<String> {
    in_lanes(text).into_iter().filter(|(_, fit)| !fit).map(|(begin, _)| begin).collect()
}

#[test]
fn whatever_runs_in_lanes_is_inlined_by_force() {
    let files = ROOMS.iter().flat_map(|room| rust_files(room)).filter(|file| !file.ends_with("tests.rs"));
    let files: Vec<String> = files.collect();
    let seen: usize = files.iter().map(|f| in_lanes(&text(f)).len()).sum();
    assert!(seen > 150, "only {seen} functions name lanes: has the law gone blind?");
    let unfit = files.iter().flat_map(|f| unfit(&text(f)).into_iter().map(move |begin| format!("{f}: {begin}")));
    let unfit: Vec<String> = unfit.collect();
    assert!(unfit.is_empty(), "#[inline(always)] is missing before\n{}", unfit.join("\n"));
}

#[test]
fn the_law_of_lanes_sees_functions_that_name_them() {
    let slow = "#[inline]\npub fn f<R: Real>(x: R) -> R {\n    x\n}\n";
    let fast = slow.replace("inline", "inline(always)");
    let method = "impl<V: Vector> A<V> {\n    /// Real.\n    fn g(self) -> Self {\n        self\n    }\n    #[inline(always)]\n    fn h() {}\n}\n";
    let inside = "fn k(x: f32) {\n    let y = Reals::of(x);\n}\nfn l() {}\n";
    assert_eq!(unfit(slow), ["pub fn f<R: Real>(x: R) -> R"]);
    assert!(unfit(&fast).is_empty() && unfit("trait A: Real {\n    fn b();\n}\n").is_empty());
    assert_eq!(unfit(method), ["fn g(self) -> Self"]);
    assert_eq!(unfit(inside), ["fn k(x: f32)"]);
}
