//! Source files, and their code without comments and strings.

use std::path::{Path, PathBuf};

use crate::common::files_below;

/// Returns the root of the package.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Source folders of the crates of the workspace.
pub const SOURCES: [&str; 10] = [
    "src",
    "crates/lumbre-light/src",
    "crates/lumbre-lua/src",
    "crates/lumbre-metrics/src",
    "crates/lumbre-night/src",
    "crates/lumbre-render/src",
    "crates/lumbre-report/src",
    "crates/lumbre-scene-io/src",
    "crates/lumbre-tui/src",
    "crates/lumbre-vulkan/src",
];

/// Returns every Rust file of the crates' sources, as [`rust_files`] does.
pub fn sources() -> Vec<String> {
    SOURCES
        .iter()
        .flat_map(|folder| rust_files(folder))
        .collect()
}

/// Returns every Rust file below a folder of the package, as sorted paths from the root with `/`.
pub fn rust_files(folder: &str) -> Vec<String> {
    let files = files_below(&root().join(folder)).into_iter();
    let rust = files.filter(|path| path.extension().is_some_and(|e| e == "rs"));
    let mut found: Vec<String> = rust.map(|path| from_root(&path)).collect();
    found.sort();
    assert!(!found.is_empty(), "no Rust files in {folder}");
    found
}

/// Returns a path from the root of the package, with `/`.
pub fn from_root(path: &Path) -> String {
    path.strip_prefix(root())
        .unwrap()
        .to_string_lossy()
        .replace('\\', "/")
}

/// Returns the text of a file, by its path from the root.
pub fn text(path: &str) -> String {
    std::fs::read_to_string(root().join(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// Returns the files of the project: those that git tracks, or, in a copy without git, those in the
/// known places.
pub fn project_files() -> Vec<PathBuf> {
    let git = std::process::Command::new("git")
        .args(["ls-files", "-z"])
        .current_dir(root())
        .output();
    if let Ok(listed) = git
        && listed.status.success()
        && !listed.stdout.is_empty()
    {
        let names = String::from_utf8(listed.stdout).unwrap();
        return names
            .split('\0')
            .filter(|n| !n.is_empty())
            .map(|n| root().join(n))
            .filter(|p| p.is_file())
            .collect();
    }
    let places = [
        "src",
        "crates",
        "shaders",
        "xtask",
        "templates",
        "tests",
        "docs",
        "scripts",
        "scenes",
        ".ci",
    ];
    let mut found: Vec<PathBuf> = ["Cargo.toml", "README.md"].map(|n| root().join(n)).into();
    found.extend(places.iter().flat_map(|n| files_below(&root().join(n))));
    found
}

/// Returns code with comments and the contents of strings and character literals replaced by
/// spaces; line breaks stay.
pub fn code_only(text: &str) -> String {
    let chars: Vec<char> = text.chars().collect();
    let mut out = String::with_capacity(text.len());
    let mut i = 0;
    let blank = |out: &mut String, from: usize, to: usize| {
        chars[from..to]
            .iter()
            .for_each(|c| out.push(if *c == '\n' { '\n' } else { ' ' }));
    };
    while i < chars.len() {
        let end = match chars[i] {
            '/' if chars.get(i + 1) == Some(&'/') => find(&chars, i, |c, j| c[j] == '\n'),
            '/' if chars.get(i + 1) == Some(&'*') => comment_end(&chars, i),
            '"' => string_end(&chars, i),
            'r' if !after_word(&chars, i) && raw_hashes(&chars, i).is_some() => {
                let hashes = raw_hashes(&chars, i).unwrap();
                let closing: Vec<char> = std::iter::once('"')
                    .chain(std::iter::repeat_n('#', hashes))
                    .collect();
                find(&chars, i + hashes + 2, |c, j| c[j..].starts_with(&closing)) + closing.len()
            }
            '\'' if chars.get(i + 1) == Some(&'\\') => find(&chars, i + 3, |c, j| c[j] == '\'') + 1,
            '\'' if chars.get(i + 2) == Some(&'\'') => i + 3,
            c => {
                out.push(c);
                i += 1;
                continue;
            }
        };
        let end = end.min(chars.len());
        blank(&mut out, i, end);
        i = end;
    }
    out
}

fn find(chars: &[char], from: usize, found: impl Fn(&[char], usize) -> bool) -> usize {
    (from..chars.len())
        .find(|j| found(chars, *j))
        .unwrap_or(chars.len())
}

fn after_word(chars: &[char], i: usize) -> bool {
    i > 0 && (chars[i - 1].is_alphanumeric() || chars[i - 1] == '_')
}

fn raw_hashes(chars: &[char], i: usize) -> Option<usize> {
    let hashes = chars[i + 1..].iter().take_while(|c| **c == '#').count();
    (chars.get(i + 1 + hashes) == Some(&'"')).then_some(hashes)
}

fn string_end(chars: &[char], start: usize) -> usize {
    let mut i = start + 1;
    while i < chars.len() && chars[i] != '"' {
        i += if chars[i] == '\\' { 2 } else { 1 };
    }
    i + 1
}

fn comment_end(chars: &[char], start: usize) -> usize {
    let (mut i, mut depth) = (start + 2, 1);
    while i < chars.len() && depth > 0 {
        match (chars[i], chars.get(i + 1)) {
            ('/', Some('*')) => (i, depth) = (i + 2, depth + 1),
            ('*', Some('/')) => (i, depth) = (i + 2, depth - 1),
            _ => i += 1,
        }
    }
    i
}

/// Yields the byte offsets at which `word` stands in `code` as a whole word.
pub fn words<'a>(code: &'a str, word: &'a str) -> impl Iterator<Item = usize> + 'a {
    let part = |c: char| c.is_alphanumeric() || c == '_';
    code.match_indices(word)
        .map(|(at, _)| at)
        .filter(move |at| {
            !code[..*at].chars().next_back().is_some_and(part)
                && !code[at + word.len()..].chars().next().is_some_and(part)
        })
}

#[test]
fn code_only_removes_comments_and_strings() {
    let text = "let a = \"crate::cli // \\\" \"; // crate::tui\n\
                /* crate::x /* y */ */ let b = '\"'; let c = r#\"crate::z\"#; b::c";
    let code = code_only(text);
    assert_eq!(code.len(), text.len());
    assert!(!code.contains("crate"), "{code}");
    assert!(code.ends_with("b::c"));
    let lifetimes = "fn f<'a>(x: &'a str) -> &'a str { crate::cli::x }";
    assert_eq!(code_only(lifetimes), lifetimes);
}
