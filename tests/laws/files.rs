//! Laws about files: size, names, printing, and paths that exist on one machine only.

use super::source::{code_only, project_files, root, rust_files, text, words};

const MOST_LINES: usize = 600;

#[test]
fn no_file_is_too_long_to_read() {
    let all = rust_files("src").into_iter().chain(rust_files("tests"));
    let long: Vec<String> = all
        .map(|f| (text(&f).lines().count(), f))
        .filter(|(n, _)| *n > MOST_LINES)
        .map(|(n, f)| format!("{f}: {n} lines"))
        .collect();
    assert!(
        long.is_empty(),
        "over {MOST_LINES} lines, cut along a concept:\n{}",
        long.join("\n")
    );
}

#[test]
fn no_room_is_a_drawer_for_odds_and_ends() {
    for file in rust_files("src") {
        let drawer = file
            .split('/')
            .any(|p| ["util", "utils", "common", "misc"].contains(&p.trim_end_matches(".rs")));
        assert!(!drawer, "{file}: name it after what it is about");
    }
}

#[test]
fn only_the_command_line_prints() {
    for file in rust_files("src")
        .into_iter()
        .filter(|f| !f.starts_with("src/cli/") && !f.contains("tests"))
    {
        let code = code_only(&text(&file));
        // Tests print what they skip and why.
        let code = code
            .split("#[cfg(test)]\nmod tests {")
            .next()
            .unwrap_or_default();
        for name in ["println", "print", "eprintln", "eprint", "dbg"] {
            let calls = words(code, name).any(|at| code[at + name.len()..].starts_with('!'));
            assert!(!calls, "{file}: {name}! belongs to src/cli");
        }
    }
}

#[test]
fn nothing_names_a_place_on_one_machine() {
    // Assembled here so that this file does not match itself.
    let places: Vec<String> = ["home", "Users", "root", "work"]
        .iter()
        .map(|p| format!("/{p}/"))
        .collect();
    let mut found = Vec::new();
    for path in project_files() {
        let Ok(text) = std::fs::read_to_string(&path) else {
            continue;
        };
        for (number, line) in text.lines().enumerate() {
            let absolute = |place: &String| {
                line.match_indices(place.as_str()).any(|(at, _)| {
                    !line[..at]
                        .chars()
                        .next_back()
                        .is_some_and(|c| c.is_alphanumeric() || "_-.*}/".contains(c))
                })
            };
            if places.iter().any(absolute) {
                found.push(format!(
                    "{}:{}: {line}",
                    path.strip_prefix(root()).unwrap().display(),
                    number + 1
                ));
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}
