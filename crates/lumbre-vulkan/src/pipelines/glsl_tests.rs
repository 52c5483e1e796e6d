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
fn shaders_that_the_program_does_not_have_are_hashed_and_other_files_are_not() {
    assert!(TEXTS.iter().all(|(name, _)| is_shader(name)));
    let dir = tempfile::tempdir().unwrap();
    let sources = Sources::Folder(dir.path().to_owned());
    let (_, embedded) = Sources::Embedded.text("scene.glsl").unwrap();
    std::fs::write(dir.path().join("scene.glsl"), &embedded).unwrap();
    std::fs::create_dir(dir.path().join("own")).unwrap();
    std::fs::write(dir.path().join("own/notes.txt"), "nothing").unwrap();
    assert_eq!(sources.edited(), Ok(None));
    let light = dir.path().join("own/light.glsl");
    std::fs::write(&light, "int bright;\n").unwrap();
    let first = sources.edited().unwrap();
    std::fs::write(&light, "int dark;\n").unwrap();
    assert!(first.is_some() && sources.edited().unwrap() != first);
    // What is not hashed cannot be included: other endings, and files outside of the folder.
    let outside = dir.path().with_extension("glsl");
    std::fs::write(&outside, "int outside;\n").unwrap();
    let outside_name = format!("../{}", outside.file_name().unwrap().to_string_lossy());
    for name in ["own/notes.txt", outside_name.as_str()] {
        let text = format!("{HEAD}#include \"{name}\"\nvoid main() {{}}\n");
        let error = compile_text(&sources, &text, &[]).unwrap_err();
        assert_eq!(error, ShaderError::Missing(name.to_owned()));
    }
    std::fs::remove_file(outside).unwrap();
}

#[test]
fn a_folder_that_changed_after_the_plan_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("scene.glsl");
    std::fs::write(&file, "int first;\n").unwrap();
    let sources = Sources::Folder(dir.path().to_owned());
    let planned = sources.resolved().unwrap();
    assert_eq!(Sources::of(&planned), Ok(sources));
    std::fs::write(&file, "int second;\n").unwrap();
    let changed = ShaderError::Changed(dir.path().to_owned());
    assert_eq!(Sources::of(&planned), Err(changed.clone()));
    let (_, embedded) = Sources::Embedded.text("scene.glsl").unwrap();
    std::fs::write(&file, embedded).unwrap();
    assert_eq!(Sources::of(&planned), Err(changed));
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
