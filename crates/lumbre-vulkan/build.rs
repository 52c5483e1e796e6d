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
    let (out, home) = (variable("OUT_DIR"), variable("CARGO_MANIFEST_DIR"));
    let (shaders, spirv) = (home.join(SHADERS), home.join("spirv"));
    let texts: String = files(&shaders)?
        .iter()
        .map(|path| format!("    ({path:?}, include_str!({:?})),\n", shaders.join(path)))
        .collect();
    fs::write(out.join("texts.rs"), format!("&[\n{texts}]\n"))?;
    let mut modules = String::new();
    for file in files(&spirv)?.iter().filter(|file| file.ends_with(".spv")) {
        fs::write(out.join(file), deflate(&fs::read(spirv.join(file))?)?)?;
        // Writing to a string cannot fail.
        let _ = writeln!(
            modules,
            "    ({file:?}, include_bytes!(concat!(env!(\"OUT_DIR\"), \"/\", {file:?}))),"
        );
    }
    fs::write(out.join("modules.rs"), format!("&[\n{modules}]\n"))
}

/// Returns the paths of the files below a folder, with slashes between the folders, sorted. Hidden
/// files, which editors leave, are none of them.
fn files(folder: &Path) -> io::Result<Vec<String>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.starts_with('.') {
            continue;
        }
        if entry.file_type()?.is_dir() {
            let inner = files(&entry.path())?;
            found.extend(inner.iter().map(|path| format!("{name}/{path}")));
        } else {
            found.push(name);
        }
    }
    found.sort();
    Ok(found)
}

/// Returns the raw deflate stream of bytes.
fn deflate(bytes: &[u8]) -> io::Result<Vec<u8>> {
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes)?;
    encoder.finish()
}
