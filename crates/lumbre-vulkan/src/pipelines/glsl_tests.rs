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
fn names_and_unused_declarations_are_removed() {
    let body = "layout(binding = 0) buffer Used { float x; };\n\
                void main() { x = x * 2.0; }\n";
    let unused = "struct Row { vec4 long_member_name; };\n\
                  layout(binding = 1) buffer Unused { Row rows[7]; };\n\
                  uvec3 counter;\n\
                  vec4 never_called() { return rows[counter.x].long_member_name; }\n";
    let make_text = |text: &str| make(&Sources::Embedded, &recipe(text, &[])).unwrap();
    let plain = make_text(&format!("{HEAD}{body}"));
    let with = format!("{HEAD}{unused}{body}");
    let full = compile(&Sources::Embedded, &recipe(&with, &[])).unwrap();
    assert_eq!(make_text(&with).len(), plain.len());
    assert!(
        plain.len() < full.len(),
        "{} of {}",
        plain.len(),
        full.len()
    );
    let contains = |words: &[u32], name: &[u8]| {
        bytemuck::cast_slice::<u32, u8>(words)
            .windows(name.len())
            .any(|part| part == name)
    };
    assert!(contains(&full, b"Used") && !contains(&plain, b"Used"));
}
