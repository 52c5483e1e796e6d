//! Compresses the SPIR-V of `spirv/` for the program, which needs a few of its modules at a time.
//! Writes `modules.rs` into the folder of outputs: a slice of file names and compressed bytes.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs, io};

use flate2::Compression;
use flate2::write::DeflateEncoder;

fn main() -> io::Result<()> {
    println!("cargo::rerun-if-changed=spirv");
    let variable = |name| env::var_os(name).map(PathBuf::from).unwrap_or_default();
    let out = variable("OUT_DIR");
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
