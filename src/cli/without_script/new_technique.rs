//! `lumbre new technique`: writes a project with a technique of one's own.

use std::path::{Path, PathBuf};

use crate::cli::args::{Global, NewTechniqueArgs};
use crate::cli::exit::{Exit, Failure, print_result, print_status};
use crate::cli::format::display_path;
use lumbre_light::transport::integrator::integrator;
use lumbre_light::transport::integrator::own::is_valid_name;

/// Name of the technique in the template, which is replaced by the one of the project.
const PLACEHOLDER: &str = "own_technique";

/// Name of the class of parameters in the template.
const CLASS_PARAMS: &str = "OwnTechniqueParams";

/// Folder with the sources from which this program was built. It need not exist any more.
const BUILT_FROM: &str = env!("CARGO_MANIFEST_DIR");

/// Manifest of this program, whose release profile projects have too.
const PROGRAM_MANIFEST: &str = include_str!("../../../Cargo.toml");

/// First line of the release profile, which ends the manifest.
const RELEASE_PROFILE: &str = "[profile.release]\n";

/// Files of the template, by their paths in a project.
const FILES: [(&str, &str); 6] = [
    (
        "README.md",
        include_str!("../../../templates/technique/README.md"),
    ),
    (
        "src/main.rs",
        include_str!("../../../templates/technique/src/main.rs"),
    ),
    (
        "src/lib.rs",
        include_str!("../../../templates/technique/src/lib.rs"),
    ),
    (
        "tests/technique.rs",
        include_str!("../../../templates/technique/tests/technique.rs"),
    ),
    (
        "own_technique.lua",
        include_str!("../../../templates/technique/script.lua"),
    ),
    (
        "scene.lua",
        include_str!("../../../templates/technique/scene.lua"),
    ),
];

/// Words that cannot be the name of a crate: keywords of Rust, and crates that the project uses.
const RESERVED: &str = "abstract as async await become box break const continue crate do dyn else \
                        enum extern false final fn for gen if impl in let loop macro match mod \
                        move mut override priv pub ref return self static struct super trait true \
                        try type typeof union unsafe unsized use virtual where while yield alloc \
                        core lumbre lumbre_light lumbre_render proc_macro std test";

/// Runs `lumbre new technique`: writes the folder, and prints it.
pub(super) fn main(args: &NewTechniqueArgs, global: &Global) -> Result<Exit, Failure> {
    let name = args.name.as_str();
    check_name(name).map_err(Failure::usage)?;
    let sources = sources(args.lumbre.as_deref()).map_err(Failure::usage)?;
    let folder = PathBuf::from(name);
    // Creates the folder and fails if there is anything of this name, a dangling link included.
    std::fs::create_dir(&folder).map_err(|e| {
        Failure::usage(format!(
            "cannot create the folder {name}: {e}; choose another name, or remove what is there"
        ))
    })?;
    write_project(&folder, name, &sources)
        .map_err(|e| Failure::internal(format!("cannot write to the folder {name}: {e}")))?;
    if !global.quiet {
        print_status(&format!(
            "the project uses the sources in {}\nnext: cd {name}; cargo test --release; \
             cargo run --release -- run {name}.lua",
            display_path(&sources)
        ));
    }
    print_result(&format!("{name}\n"))?;
    Ok(Exit::Done)
}

/// Returns the error if a technique or a crate cannot have this name.
fn check_name(name: &str) -> Result<(), String> {
    if !is_valid_name(name) || RESERVED.split_whitespace().any(|word| word == name) {
        return Err(format!(
            "`{name}` cannot be the name of a technique and of its crate: use a lower-case letter, \
             then at most 39 lower-case letters, digits and `_`, and no keyword of Rust"
        ));
    }
    if integrator(name).is_some() {
        return Err(format!(
            "there is a technique `{name}` already: choose another name"
        ));
    }
    Ok(())
}

/// Returns the folder with the sources of this program: the given one, or the one it was built from.
fn sources(given: Option<&Path>) -> Result<PathBuf, String> {
    sources_or(given, Path::new(BUILT_FROM))
}

/// Returns the given folder, or else `built_from`.
///
/// # Errors
/// Returns an error if the folder has no sources of Lumbre.
fn sources_or(given: Option<&Path>, built_from: &Path) -> Result<PathBuf, String> {
    let folder = given.unwrap_or(built_from);
    let has_sources = ["Cargo.toml", "src/lib.rs", "crates/lumbre-light/Cargo.toml"]
        .iter()
        .all(|file| folder.join(file).is_file());
    match (has_sources, given) {
        (true, _) => folder
            .canonicalize()
            .map_err(|e| format!("cannot open {}: {e}", display_path(folder))),
        (false, Some(_)) => Err(format!(
            "--lumbre {}: this is not a folder with the sources of Lumbre, which has Cargo.toml and \
             crates/lumbre-light",
            display_path(folder)
        )),
        (false, None) => Err(format!(
            "a project is built from the sources of Lumbre, and those that this program was built \
             from are not in {}: clone the repository, and name the clone by --lumbre CLONE",
            display_path(folder)
        )),
    }
}

/// Writes all files of a project to a new folder.
fn write_project(folder: &Path, name: &str, sources: &Path) -> std::io::Result<()> {
    let class: String = name
        .split('_')
        .map(|word| {
            let (first, rest) = word.split_at(word.len().min(1));
            first.to_uppercase() + rest
        })
        .collect();
    let personal = |text: &str| {
        text.replace(PLACEHOLDER, name)
            .replace(CLASS_PARAMS, &format!("{class}Params"))
    };
    for (path, text) in FILES {
        let path = folder.join(personal(path));
        if let Some(parent) = path.parent() {
            std::fs::create_dir_all(parent)?;
        }
        std::fs::write(path, personal(text))?;
    }
    std::fs::write(folder.join("Cargo.toml"), manifest(name, sources))?;
    std::fs::write(folder.join(".gitignore"), "/target\n/out\n")?;
    // The tested versions of all dependencies; cargo adds the project to them.
    let lock = sources.join("Cargo.lock");
    if lock.is_file() {
        std::fs::copy(lock, folder.join("Cargo.lock"))?;
    }
    Ok(())
}

/// Returns the release profile of this program.
fn release_profile() -> &'static str {
    let start = PROGRAM_MANIFEST.find(RELEASE_PROFILE);
    start.map_or("", |start| &PROGRAM_MANIFEST[start..])
}

/// Returns the manifest of a project.
fn manifest(name: &str, sources: &Path) -> String {
    // Strings of TOML and of JSON have the same escapes.
    let path = |folder: &Path| serde_json::Value::from(folder.to_string_lossy()).to_string();
    format!(
        "[package]
name = \"{name}\"
version = \"0.1.0\"
edition = \"2024\"
publish = false

[dependencies]
# For a program without Vulkan, add: default-features = false
lumbre = {{ path = {} }}
lumbre-light = {{ path = {} }}

# A project of its own, wherever its folder is.
[workspace]

# For `cargo test` without --release: tests render pictures, so they are optimised.
[profile.dev]
opt-level = 2
debug = false

# That of the program lumbre, so that times can be compared.
{}",
        path(sources),
        path(&sources.join("crates/lumbre-light")),
        release_profile()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn projects_have_their_own_names_and_the_sources_they_are_built_from() {
        let folder = tempfile::tempdir().unwrap();
        let sources = sources(None).unwrap();
        write_project(folder.path(), "some_links", &sources).unwrap();
        let text = |file: &str| std::fs::read_to_string(folder.path().join(file)).unwrap();
        for file in [
            "README.md",
            "src/main.rs",
            "src/lib.rs",
            "tests/technique.rs",
            "some_links.lua",
        ] {
            let text = text(file);
            assert!(text.contains("some_links"), "{file}");
            assert!(!text.contains(PLACEHOLDER), "{file}");
        }
        assert!(text("src/lib.rs").contains("\"SomeLinksParams\""));
        assert!(text("src/lib.rs").contains("lumbre::OwnTechnique"));
        assert!(text("Cargo.toml").contains("crates/lumbre-light\" }"));
    }

    #[test]
    fn projects_have_the_release_profile_of_the_program() {
        let manifest = manifest("some_links", Path::new("lumbre"));
        let (_, profile) = manifest.split_once(RELEASE_PROFILE).unwrap();
        let (_, program) = PROGRAM_MANIFEST.split_once(RELEASE_PROFILE).unwrap();
        assert_eq!(profile, program);
        // Nothing of the workspace follows the profile.
        let sections = program.lines().filter(|line| line.starts_with('['));
        assert!(
            sections
                .into_iter()
                .all(|line| line.starts_with("[profile.release"))
        );
    }

    #[test]
    fn a_program_without_its_sources_asks_for_a_clone() {
        let folder = tempfile::tempdir().unwrap();
        let missing = sources_or(None, &folder.path().join("gone")).unwrap_err();
        assert!(missing.contains("--lumbre CLONE"), "{missing}");
        let given = sources_or(Some(Path::new(BUILT_FROM)), folder.path());
        assert!(given.is_ok(), "{given:?}");
    }

    #[test]
    fn names_that_no_crate_or_technique_can_have_are_refused() {
        for name in [
            "", "A", "a-b", "../a", "2a", "fn", "test", "lumbre", "nee", "pt",
        ] {
            assert!(check_name(name).is_err(), "{name}");
        }
        assert_eq!(check_name("some_links"), Ok(()));
        let missing = sources(Some(Path::new("src"))).unwrap_err();
        assert!(
            missing.contains("not a folder with the sources"),
            "{missing}"
        );
    }
}
