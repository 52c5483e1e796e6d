//! Lists the shaders for the program, in two files of the folder of outputs: `texts.rs` has a slice
//! of the paths and texts of `shaders/`, `modules.rs` one of the file names and bytes of `spirv/`,
//! compressed, since the program needs a few of them at a time.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs, io};

use flate2::Compression;
use flate2::write::DeflateEncoder;

/// Folder of the shaders, from that of the crate.
const SHADERS: &str = "../../shaders";

fn main() -> io::Result<()> {
    println!("cargo::rerun-if-changed=spirv");
    println!("cargo::rerun-if-changed={SHADERS}");
    let variable = |name| env::var_os(name).map(PathBuf::from).unwrap_or_default();
    let out = variable("OUT_DIR");
    let shaders = variable("CARGO_MANIFEST_DIR").join(SHADERS);
    let mut texts = Vec::new();
    list(&shaders, "", &mut texts)?;
    texts.sort();
    let rows: String = texts
        .iter()
        .map(|path| format!("    ({path:?}, include_str!({:?})),\n", shaders.join(path)))
        .collect();
    fs::write(out.join("texts.rs"), format!("&[\n{rows}]\n"))?;
    let mut table = String::from("&[\n");
    for path in modules(&variable("CARGO_MANIFEST_DIR").join("spirv"))? {
        let file = path.file_name().unwrap_or_default().to_string_lossy();
        fs::write(out.join(&*file), deflate(&fs::read(&path)?)?)?;
        // Writing to a string cannot fail.
        let _ = writeln!(
            table,
            "    ({file:?}, include_bytes!(concat!(env!(\"OUT_DIR\"), \"/\", {file:?}))),"
        );
    }
    table.push_str("]\n");
    fs::write(out.join("modules.rs"), table)
}

/// Adds the paths of the files below a folder, each after `prefix`, with slashes between the folders.
fn list(folder: &Path, prefix: &str, paths: &mut Vec<String>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let path = format!("{prefix}{name}");
        if name.starts_with('.') {
            // A file of an editor.
        } else if entry.file_type()?.is_dir() {
            list(&entry.path(), &format!("{path}/"), paths)?;
        } else {
            paths.push(path);
        }
    }
    Ok(())
}

/// Returns the paths of the modules in a folder, sorted.
fn modules(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let entries: io::Result<Vec<_>> = fs::read_dir(folder)?.collect();
    let mut paths: Vec<PathBuf> = entries?.iter().map(fs::DirEntry::path).collect();
    paths.retain(|path| path.extension().is_some_and(|end| end == "spv"));
    paths.sort();
    Ok(paths)
}

/// Returns the raw deflate stream of bytes.
fn deflate(bytes: &[u8]) -> io::Result<Vec<u8>> {
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes)?;
    encoder.finish()
}
