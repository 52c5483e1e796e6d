//! `cargo xtask release`: packs the program for machines without Rust: one archive with the
//! stripped program, manual page, completions and licences, and its checksum.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::command::{cargo, execute, output, tar, write};
use crate::pages;

/// Options of the chore.
#[derive(clap::Args)]
pub struct Args {
    /// Folder in which the archive and its checksum are written
    #[arg(long, value_name = "DIR", default_value = "target/dist")]
    out: PathBuf,
    /// Profile with which the program is built; `dev` tries the packing without a release build
    #[arg(long, value_name = "NAME", default_value = "release")]
    profile: String,
}

/// Files of the repository that are in the archive.
const FILES: [&str; 4] = ["README.md", "CHANGELOG.md", "LICENSE-MIT", "LICENSE-APACHE"];

/// Starts of the names of files with the terms of a licence.
const TERMS: [&str; 6] = [
    "LICENSE",
    "LICENCE",
    "COPYING",
    "COPYRIGHT",
    "NOTICE",
    "UNLICENSE",
];

/// Builds the program and packs it.
pub fn run(args: &Args) -> Result<(), String> {
    let root = crate::root();
    execute(cargo().args([
        "build",
        "--locked",
        "-p",
        "lumbre",
        "--profile",
        &args.profile,
    ]))?;
    let metadata = metadata()?;
    let target = metadata["target_directory"].as_str().unwrap_or("target");
    // The profile `dev` has another name as a folder.
    let build = match args.profile.as_str() {
        "dev" => "debug",
        profile => profile,
    };
    let program = Path::new(target).join(build).join("lumbre");
    let name = format!(
        "lumbre-{}-{}-{}",
        env!("CARGO_PKG_VERSION"),
        std::env::consts::ARCH,
        std::env::consts::OS
    );
    fs::create_dir_all(&args.out).map_err(|e| format!("{}: {e}", args.out.display()))?;
    let work = tempfile::tempdir_in(&args.out).map_err(|e| e.to_string())?;
    let folder = work.path().join(&name);
    collect(&root, &program, &folder)?;
    write_licences(&metadata, &folder.join("licences"))?;
    let archive = format!("{name}.tar.gz");
    execute(tar(&args.out.join(&archive), work.path()).arg(&name))?;
    let sums = output(
        Command::new("sha256sum")
            .arg(&archive)
            .current_dir(&args.out),
    )?;
    write(&args.out.join(format!("{archive}.sha256")), &sums)?;
    println!("{}", args.out.join(&archive).display());
    Ok(())
}

/// Returns the description of all packages that a build for this machine may contain.
fn metadata() -> Result<Value, String> {
    let version = output(Command::new("rustc").arg("-vV"))?;
    let version = String::from_utf8_lossy(&version);
    let host = version.lines().find_map(|line| line.strip_prefix("host: "));
    let host = host.ok_or("rustc does not name its platform")?;
    let words = [
        "metadata",
        "--locked",
        "--format-version",
        "1",
        "--filter-platform",
        host,
    ];
    serde_json::from_slice(&output(cargo().args(words))?)
        .map_err(|e| format!("cargo metadata: {e}"))
}

/// Copies the program and makes its manual page and completions.
fn collect(root: &Path, program: &Path, folder: &Path) -> Result<(), String> {
    fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    copy(program, &folder.join("bin/lumbre"))?;
    for file in FILES {
        copy(&root.join(file), &folder.join(file))?;
    }
    pages::write_all(&folder.join("share"))
}

/// Copies the terms of all packages that the program contains, with a list of them.
fn write_licences(metadata: &Value, folder: &Path) -> Result<(), String> {
    let mut list = String::from(
        "Packages that the program contains, with their licences. The terms of each are in the \
         folder of its name.\n\n",
    );
    for package in linked_packages(metadata)? {
        let text = |key: &str| package[key].as_str().unwrap_or_default();
        let name = format!("{}-{}", text("name"), text("version"));
        list += &format!("{name}  {}  {}\n", text("license"), text("repository"));
        let manifest = Path::new(text("manifest_path"));
        let Some(source) = manifest.parent() else {
            continue;
        };
        for file in terms(source)? {
            let target = folder
                .join(&name)
                .join(file.file_name().unwrap_or_default());
            copy(&file, &target)?;
        }
    }
    write(&folder.join("README.txt"), list.as_bytes())
}

/// Returns the files with the terms of a package, in its folder, and of the fonts in it.
fn terms(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let entries = |folder: &Path| -> Result<Vec<PathBuf>, String> {
        let entries = fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        Ok(entries
            .filter_map(|entry| Some(entry.ok()?.path()))
            .collect())
    };
    let is_terms = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default();
        let name = name.to_string_lossy().to_uppercase();
        path.is_file() && TERMS.iter().any(|start| name.starts_with(start))
    };
    let mut files = entries(folder)?;
    files.retain(is_terms);
    let fonts = folder.join("fonts");
    if fonts.is_dir() {
        let mut texts = entries(&fonts)?;
        texts.retain(|path| path.extension().is_some_and(|extension| extension == "txt"));
        files.extend(texts);
    }
    files.sort();
    Ok(files)
}

/// Returns the packages from elsewhere that the program contains, by name and version, found by
/// following the dependencies of the program that are not for tests alone. Those of builds count,
/// since they may bring sources in C: the package with Lua is one.
fn linked_packages(metadata: &Value) -> Result<Vec<&Value>, String> {
    let list = |value: &'_ Value| value.as_array().cloned().unwrap_or_default();
    let packages: BTreeMap<&str, &Value> = metadata["packages"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(|package| Some((package["id"].as_str()?, package)))
        .collect();
    let nodes: BTreeMap<&str, &Value> = metadata["resolve"]["nodes"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(|node| Some((node["id"].as_str()?, node)))
        .collect();
    let program = packages
        .iter()
        .find(|(_, package)| package["name"] == "lumbre");
    let (program, _) = program.ok_or("cargo metadata does not name the program")?;
    let (mut found, mut open) = (BTreeSet::new(), vec![(*program).to_owned()]);
    while let Some(id) = open.pop() {
        if !found.insert(id.clone()) {
            continue;
        }
        let node = nodes.get(id.as_str());
        for dependency in node.map(|node| list(&node["deps"])).unwrap_or_default() {
            let kinds = list(&dependency["dep_kinds"]);
            if kinds.iter().any(|kind| kind["kind"] != "dev") {
                open.extend(dependency["pkg"].as_str().map(str::to_owned));
            }
        }
    }
    let mut linked: Vec<&Value> = found
        .iter()
        .filter_map(|id| packages.get(id.as_str()).copied())
        // Packages of the workspace have no source.
        .filter(|package| !package["source"].is_null())
        .collect();
    linked.sort_by_key(|package| (package["name"].to_string(), package["version"].to_string()));
    Ok(linked)
}

fn copy(from: &Path, to: &Path) -> Result<(), String> {
    let made = to.parent().map_or(Ok(()), fs::create_dir_all);
    made.and_then(|()| fs::copy(from, to).map(|_| ()))
        .map_err(|e| format!("{} to {}: {e}", from.display(), to.display()))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;

    #[test]
    fn packages_of_the_program_are_listed_without_those_of_tests_and_tools() {
        let metadata = metadata().unwrap();
        let linked = linked_packages(&metadata).unwrap();
        let names: BTreeSet<&str> = linked.iter().filter_map(|p| p["name"].as_str()).collect();
        // Direct, through a crate of the workspace, and through another package.
        assert!(
            ["mlua", "ash", "simd-adler32", "lua-src"]
                .iter()
                .all(|name| names.contains(name))
        );
        for absent in ["insta", "proptest", "lumbre", "lumbre-light"] {
            assert!(!names.contains(absent), "{absent}");
        }
        let with_terms = linked.iter().filter(|package| {
            let manifest = Path::new(package["manifest_path"].as_str().unwrap());
            !terms(manifest.parent().unwrap()).unwrap().is_empty()
        });
        assert!(
            with_terms.count() * 10 > linked.len() * 9,
            "most packages bring their terms"
        );
    }
}
