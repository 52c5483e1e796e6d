//! Searches the compiled crates for vector instructions that are called as functions: code on vectors
//! that was not inlined into a function compiled for the instruction set. It has the same bits at
//! half the speed of the scalar path. `tests/library/laws/lanes.rs` finds functions without the
//! attribute; this finds closures too, which cannot have it. Needs `objdump` of the binutils.

use std::collections::BTreeMap;
use std::process::Command;

use serde_json::Value;

use crate::command::{cargo, output};

/// Libraries of the workspace with code on vectors.
const LIBRARIES: [&str; 2] = ["lumbre_light", "lumbre_render"];

/// Part of the names of functions that are one instruction, as the compiler mangles and as it prints
/// them.
const INSTRUCTIONS: [&str; 2] = ["core_arch3x86", "core_arch::x86"];

/// Builds the program and searches its libraries.
///
/// # Errors
/// Returns the functions that call instructions, with the number of calls in each.
pub fn run() -> Result<(), String> {
    let mut build = cargo();
    build.args(["build", "--release", "--locked", "--bin", "lumbre"]);
    let messages = output(build.arg("--message-format=json"))?;
    let files = libraries(&String::from_utf8_lossy(&messages));
    if files.len() != LIBRARIES.len() {
        return Err(format!("expected {LIBRARIES:?}, found {files:?}"));
    }
    let mut problems = Vec::new();
    for file in files {
        let mut dump = Command::new("objdump");
        dump.args([
            "--disassemble",
            "--reloc",
            "--demangle",
            "--no-show-raw-insn",
        ]);
        let code = output(dump.arg(&file))?;
        for (function, calls) in callers(&String::from_utf8_lossy(&code)) {
            problems.push(format!("{calls} in {function}"));
        }
    }
    match problems.is_empty() {
        true => Ok(()),
        false => Err(format!(
            "vector instructions are called as functions; replace the closures that they are in by \
             functions with `#[inline(always)]`, or by `if` and `match`:\n{}",
            problems.join("\n")
        )),
    }
}

/// Returns the files of the libraries that messages of cargo name.
fn libraries(messages: &str) -> Vec<String> {
    let artifacts = messages
        .lines()
        .filter_map(|line| serde_json::from_str::<Value>(line).ok());
    let of_library = artifacts.filter(|artifact| {
        let name = artifact["target"]["name"].as_str().unwrap_or_default();
        LIBRARIES.contains(&name)
    });
    let files = of_library.flat_map(|artifact| {
        let names = artifact["filenames"].as_array().cloned();
        names.unwrap_or_default()
    });
    files
        .filter_map(|file| file.as_str().map(str::to_owned))
        .filter(|file| file.ends_with(".rlib"))
        .collect()
}

/// Returns the functions of disassembled code that call instructions, and how often.
fn callers(code: &str) -> BTreeMap<String, usize> {
    let (mut found, mut function) = (BTreeMap::new(), "");
    for line in code.lines() {
        if let Some((_, name)) = line.split_once('<').filter(|_| line.ends_with(">:")) {
            function = name.trim_end_matches(">:");
        } else if line.contains("R_X86_64") && INSTRUCTIONS.iter().any(|part| line.contains(part)) {
            *found.entry(function.to_owned()).or_default() += 1;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calls_of_instructions_are_counted_for_each_function() {
        let code = "\
0000000000000000 <lumbre_light::inlined>:
   0:\tvaddps %ymm0,%ymm1,%ymm0
0000000000000000 <core::bool::<impl bool>::then>:
   8:\tcall   d <core::bool::<impl bool>::then+0xd>
\t\t\t9: R_X86_64_PLT32\t.text._RNvNtNtNtCs_4core9core_arch3x863avx14__mm256_mul_ps-0x4
  20:\tcall   25 <core::bool::<impl bool>::then+0x25>
\t\t\t21: R_X86_64_PLT32\tcore::core_arch::x86::avx::_mm256_set1_ps-0x4
\t\t\t31: R_X86_64_PLT32\tmemcpy-0x4
";
        let expected = BTreeMap::from([("core::bool::<impl bool>::then".to_owned(), 2)]);
        assert_eq!(callers(code), expected);
    }

    #[test]
    fn libraries_of_vectors_are_found_among_all_artifacts() {
        let messages = r#"{"reason":"compiler-artifact","target":{"name":"glam"},"filenames":["/t/libglam-1.rlib"]}
{"reason":"compiler-artifact","target":{"name":"lumbre_render"},"filenames":["/t/liblumbre_render-1.rlib","/t/liblumbre_render-1.rmeta"]}
{"reason":"compiler-artifact","target":{"name":"lumbre"},"filenames":["/t/lumbre"]}
"#;
        assert_eq!(libraries(messages), ["/t/liblumbre_render-1.rlib"]);
    }
}
