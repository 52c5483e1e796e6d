//! Tests of the compiler of shaders. Those of texts need an installed one.

use std::io::Write as _;

use super::super::sources::TEXTS;
use super::*;

const HEAD: &str = "#version 460\n#extension GL_GOOGLE_include_directive : require\n";

impl Compiler {
    /// Returns the compiler, or `None` after printing a line `SKIPPED` if none is installed. Written
    /// past the test harness, which keeps what tests that pass print.
    pub(crate) fn installed() -> Option<Compiler> {
        let found = Compiler::find();
        if let Err(reason) = &found {
            let line = format!("SKIPPED: {reason}\n");
            std::io::stderr().write_all(line.as_bytes()).unwrap();
        }
        found.ok()
    }

    /// Compiles a text as a compute shader called `entry/a.comp`.
    fn compile_text(&self, sources: &Sources, text: &str) -> Result<Vec<u32>, ShaderError> {
        self.compile(sources, &recipe(text, &[]))
    }

    /// Returns the message about a text that does not compile.
    fn message(&self, sources: &Sources, text: &str) -> String {
        let error = self.compile_text(sources, text).unwrap_err();
        assert!(matches!(error, ShaderError::Invalid { .. }), "{error:?}");
        error.to_string()
    }
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
    let Some(compiler) = Compiler::installed() else {
        return;
    };
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    write("scene.glsl", "int fine;\nint broken = nothing;\n");
    write("outer.glsl", "/* a\nb */ #include \"scene.glsl\"\n");
    let sources = Sources::Folder(dir.path().to_owned());
    for header in ["scene.glsl", "outer.glsl"] {
        let text = format!("{HEAD}#include \"{header}\"\nvoid main() {{}}\n");
        let message = compiler.message(&sources, &text);
        let expected = "the shader `entry/a.comp` does not compile:\nscene.glsl:2: 'nothing'";
        assert!(message.starts_with(expected), "{message}");
    }
    // Lines are those of the text, also after headers, comments and continued lines.
    write("scene.glsl", "#define ONE \\\n 1\nint fine;");
    write(
        "outer.glsl",
        "#include \"scene.glsl\"\r\n// #include \"gone\"\r\n\nnonsense\n",
    );
    let text = format!("{HEAD}#include \"scene.glsl\"\n/*\n*/ void main() {{ nonsense(); }}\n");
    let message = compiler.message(&sources, &text);
    assert!(
        message.contains("\nentry/a.comp:5: 'nonsense'"),
        "{message}"
    );
    let text = format!("{HEAD}#include \"outer.glsl\"\nvoid main() {{}}\n");
    let message = compiler.message(&sources, &text);
    assert!(message.contains("\nouter.glsl:"), "{message}");
    let text = format!("{HEAD}void function();\nvoid main() {{ function(); }}\n");
    let message = compiler.message(&sources, &text);
    assert!(message.contains("function("), "{message}");
}

#[test]
fn a_missing_header_is_named_where_it_is_needed() {
    let Some(compiler) = Compiler::installed() else {
        return;
    };
    let text = format!("{HEAD}#include \"transport/nowhere.glsl\"\nvoid main() {{}}\n");
    let message = compiler.message(&Sources::Embedded, &text);
    for part in ["entry/a.comp:3", "`transport/nowhere.glsl` does not exist"] {
        assert!(message.contains(part), "{part} in {message}");
    }
    let left_out = text.replace("#include", "#if 0\n#include");
    let left_out = left_out.replace("void main", "#endif\nvoid main");
    let made = compiler.compile_text(&Sources::Embedded, &left_out);
    assert!(made.is_ok(), "{made:?}");
}

#[test]
fn every_include_is_found_and_comments_are_spaces() {
    let text = "a \"//\" b // \"c\n/* d\n*/ #include \"e\" /* f */ g\n#inc\\\r\nlude <h>\r/* i";
    let expected = "a \"//\" b  \n \n #include \"e\"   g\n#include <h>\n\n/* i\n";
    let plain = without_comments(text);
    assert_eq!(plain, expected);
    let names: Vec<_> = plain.lines().filter_map(included).collect();
    assert_eq!(names, [("e", "   g"), ("h", "")]);
}

#[test]
fn the_first_compiler_on_path_is_chosen_and_its_absence_is_reported_with_the_package() {
    let [first, second] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let file = |name: &str| format!("{name}{}", std::env::consts::EXE_SUFFIX);
    let path = std::env::join_paths([first.path(), Path::new("relative"), second.path()]).unwrap();
    assert_eq!(Compiler::in_folders(&path), None);
    let found = || Compiler::in_folders(&path).unwrap();
    std::fs::write(first.path().join(file("glslc")), "").unwrap();
    assert_eq!(found().program, first.path().join(file("glslc")));
    let validator = second.path().join(file("glslangValidator"));
    std::fs::write(&validator, "").unwrap();
    assert_eq!(found().program, validator);
    let message = ShaderError::NoCompiler.to_string();
    assert!(message.contains("apt-get install glslang-tools"));
}

/// Script that writes the first word of a module.
#[cfg(unix)]
const HALF: &[&str] = &[
    "-c",
    "for a; do case $b in -o) printf '\\3\\2\\43\\7' >$a; esac; b=$a; done",
];

/// Script that writes ten megabytes of messages.
#[cfg(unix)]
const MANY: &[&str] = &[
    "-c",
    "yes \"$(printf 'long\\33%2000s' x)\" | head -n 5000; exit 1",
];

/// Returns the result of a shell script in place of the compiler.
#[cfg(unix)]
fn compile_by(arguments: &'static [&'static str]) -> ShaderError {
    let compiler = Compiler {
        program: "/bin/sh".into(),
        arguments,
    };
    let limit = Duration::from_millis(500);
    let recipe = recipe("void main() {}", &[]);
    let texts = texts(&Sources::Embedded, &recipe).unwrap();
    compiler.compile_texts(&texts, &[], limit).unwrap_err()
}

#[cfg(unix)]
#[test]
fn compilers_that_hang_crash_or_write_no_module_are_errors() {
    let started = std::time::Instant::now();
    let problems: [(&'static [&'static str], &str); 4] = [
        (&["-c", "sleep 60 & sleep 60"], "it ran for 0.5 s"),
        (&["-c", "echo oops; kill -SEGV $$"], "signal: 11"),
        (&["-c", "echo fine"], "it wrote no module: fine"),
        (HALF, "it wrote no module"),
    ];
    for (script, problem) in problems {
        let error = compile_by(script);
        let message = error.to_string();
        assert!(matches!(error, ShaderError::Compiler { .. }), "{error:?}");
        for part in [problem, "/bin/sh", "`entry/a.comp`", "on PATH"] {
            assert!(message.contains(part), "{part} in {message}");
        }
    }
    assert!(started.elapsed() < Duration::from_secs(30));
    let ShaderError::Invalid { log, .. } = compile_by(MANY) else {
        panic!("messages of the compiler are about the text");
    };
    assert!(log.len() < 10_000 && !log.contains('\u{1b}'), "{log}");
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
    assert!(
        TEXTS
            .iter()
            .all(|(name, _)| super::super::sources::is_shader(name))
    );
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
        assert_eq!(
            sources.text(name),
            Err(ShaderError::Missing(name.to_owned()))
        );
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
    let Some(compiler) = Compiler::installed() else {
        return;
    };
    let text = format!("{HEAD}#ifndef WIDE\nnonsense\n#endif\nvoid main() {{}}\n");
    let compile = |defines| compiler.compile(&Sources::Embedded, &recipe(&text, defines));
    assert!(compile(&[]).is_err());
    assert!(compile(&["WIDE"]).is_ok());
}

#[test]
fn names_and_unused_declarations_are_removed() {
    let Some(compiler) = Compiler::installed() else {
        return;
    };
    let body = "layout(binding = 0) buffer Used { float x; };\n\
                void main() { x = x * 2.0; }\n";
    let unused = "struct Row { vec4 long_member_name; };\n\
                  layout(binding = 1) buffer Unused { Row rows[7]; };\n\
                  uvec3 counter;\n\
                  vec4 never_called() { return rows[counter.x].long_member_name; }\n";
    let make_text = |text: &str| {
        let made = compiler.make(&Sources::Embedded, &recipe(text, &[]));
        made.unwrap()
    };
    let plain = make_text(&format!("{HEAD}{body}"));
    let with = format!("{HEAD}{unused}{body}");
    let full = compiler.compile_text(&Sources::Embedded, &with).unwrap();
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

#[test]
fn qualifiers_of_buffers_are_stated_once_at_their_variables() {
    let Some(compiler) = Compiler::installed() else {
        return;
    };
    let body = "layout(binding = 0) restrict readonly buffer From { float x; float y; };\n\
                layout(binding = 1) buffer To { readonly float a; float b; };\n\
                void main() { b = x + y + a; }\n";
    let recipe = recipe(&format!("{HEAD}{body}"), &[]);
    let words = compiler.make(&Sources::Embedded, &recipe).unwrap();
    // OpDecorate has the opcode 71; Restrict is 19 and NonWritable 24.
    let count = |qualifier: u32| {
        let parts = words.windows(3);
        parts
            .filter(|part| part[0] == 3 << 16 | 71 && part[2] == qualifier)
            .count()
    };
    assert_eq!([count(19), count(24)], [1, 1]);
}
