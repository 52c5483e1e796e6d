//! Figures that a verb writes beside its text.

use std::path::{Path, PathBuf};

use super::exit::{Failure, print_status};
use super::format::display_path;
use lumbre_night::store;
use lumbre_report::plot::rasterize;

/// Writes a figure as SVG and PNG to files of this name; returns their paths.
///
/// # Errors
/// Returns an error if the figure cannot be drawn or a file cannot be written.
pub fn write(stem: &Path, svg: &str) -> Result<[PathBuf; 2], Failure> {
    let png = rasterize(svg).map_err(Failure::internal)?;
    let file = |extension: &str| {
        let mut name = stem.as_os_str().to_owned();
        name.push(extension);
        PathBuf::from(name)
    };
    let files = [file(".svg"), file(".png")];
    for (file, bytes) in files.iter().zip([svg.as_bytes(), &png]) {
        store::write_atomically(file, bytes).map_err(Failure::usage)?;
    }
    Ok(files)
}

/// Prints which files were written.
pub fn print(files: &[PathBuf; 2]) {
    let shown: Vec<String> = files.iter().map(|file| display_path(file)).collect();
    print_status(&format!("wrote {}", shown.join(" and ")));
}
