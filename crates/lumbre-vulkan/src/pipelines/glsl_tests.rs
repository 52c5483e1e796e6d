//! Tests of the compiler of shaders.

use super::*;

const HEAD: &str = "#version 460\n#extension GL_GOOGLE_include_directive : require\n";

/// Compiles a text as a compute shader called `entry/a.comp`.
fn compile_text(
    sources: &Sources,
    text: &str,
    defines: &[&'static str],
) -> Result<Vec<u32>, ShaderError> {
    compile(sources, &recipe(text, defines))
}

fn recipe(text: &str, defines: &[&'static str]) -> Recipe {
    Recipe {
        file: "a.spv".to_owned(),
        entry: "entry/a.comp".to_owned(),
        text: Some(text.to_owned()),
        defines: defines.to_vec(),
        generated: Vec::new(),
    }
}

#[test]
fn errors_name_file_and_line_also_in_headers() {
    let dir = tempfile::tempdir().unwrap();
    let scene = dir.path().join("scene.glsl");
    std::fs::write(scene, "int fine;\nint broken = nothing;\n").unwrap();
    let sources = Sources::Folder(dir.path().to_owned());
    let text = format!("{HEAD}#include \"scene.glsl\"\nvoid main() {{}}\n");
    let error = compile_text(&sources, &text, &[]).unwrap_err().to_string();
    assert!(
        error.contains("scene.glsl:2") && error.contains("nothing"),
        "{error}"
    );
    let text = format!("{HEAD}void main() {{ nonsense(); }}\n");
    let error = compile_text(&Sources::Embedded, &text, &[])
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("entry/a.comp:3") && error.contains("nonsense"),
        "{error}"
    );
}

#[test]
fn a_missing_header_is_named() {
    let text = format!("{HEAD}#include \"transport/nowhere.glsl\"\nvoid main() {{}}\n");
    let error = compile_text(&Sources::Embedded, &text, &[]).unwrap_err();
    assert_eq!(
        error,
        ShaderError::Missing("transport/nowhere.glsl".to_owned())
    );
}

#[test]
fn a_folder_is_hashed_by_its_differences() {
    let dir = tempfile::tempdir().unwrap();
    let sources = Sources::Folder(dir.path().to_owned());
    assert_eq!(Sources::Embedded.edited(), Ok(None));
    assert!(
        sources
            .edited()
            .unwrap_err()
            .to_string()
            .contains("none of the files")
    );
    let gone = Sources::Folder(dir.path().join("nowhere"))
        .edited()
        .unwrap_err()
        .to_string();
    assert!(
        gone.contains("nowhere") && gone.contains("no such folder"),
        "{gone}"
    );
    let (_, embedded) = Sources::Embedded.text("scene.glsl").unwrap();
    std::fs::write(dir.path().join("scene.glsl"), &embedded).unwrap();
    assert_eq!(
        sources.edited(),
        Ok(None),
        "an identical copy is not a modification"
    );
    std::fs::write(dir.path().join("scene.glsl"), format!("{embedded}// mine")).unwrap();
    let first = sources.edited().unwrap();
    std::fs::write(dir.path().join("scene.glsl"), format!("{embedded}// yours")).unwrap();
    assert!(first.is_some() && sources.edited().unwrap() != first);
}

#[test]
fn defines_reach_the_text() {
    let text = format!("{HEAD}#ifndef WIDE\nnonsense\n#endif\nvoid main() {{}}\n");
    assert!(compile_text(&Sources::Embedded, &text, &[]).is_err());
    assert!(compile_text(&Sources::Embedded, &text, &["WIDE"]).is_ok());
}

#[test]
fn names_and_unused_functions_and_variables_are_removed() {
    let body = "layout(binding = 0) buffer Used { float x; };\n\
                void main() { x = x * 2.0; }\n";
    let unused = "layout(binding = 1) buffer Unused { vec4 y[7]; };\n\
                  uvec3 counter;\n\
                  vec4 inner() { return y[counter.x] * 17.0; }\n\
                  vec4 never_called() { return inner() + inner(); }\n";
    let plain = make(&Sources::Embedded, &recipe(&format!("{HEAD}{body}"), &[])).unwrap();
    let with = recipe(&format!("{HEAD}{unused}{body}"), &[]);
    let (full, made) = (
        compile(&Sources::Embedded, &with).unwrap(),
        make(&Sources::Embedded, &with).unwrap(),
    );
    assert_eq!(made.len(), plain.len());
    assert!(
        2 * made.len() < full.len(),
        "{} of {}",
        made.len(),
        full.len()
    );
    let contains = |words: &[u32], name: &[u8]| {
        bytemuck::cast_slice::<u32, u8>(words)
            .windows(name.len())
            .any(|part| part == name)
    };
    assert!(contains(&full, b"never_called") && !contains(&made, b"never_called"));
    assert!(contains(&made, b"main"));
}

#[test]
fn committed_modules_are_those_of_the_texts() {
    for recipe in crate::pipelines::modules::recipes() {
        let made = make(&Sources::Embedded, &recipe).unwrap();
        let committed = Sources::Embedded.module(&recipe).unwrap();
        assert!(
            made == committed,
            "{} is outdated: run `cargo run -p xtask -- shaders`",
            recipe.file
        );
    }
}
