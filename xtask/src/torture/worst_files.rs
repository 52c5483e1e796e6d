//! Hostile files of every format, and files of many parts: those of the tests.

#[path = "../../../tests/library/scenes/growth_files.rs"]
mod growth_files;
#[path = "../../../tests/library/scenes/hostile_cases.rs"]
#[allow(clippy::unwrap_used, reason = "tests use this file too")]
mod hostile_cases;
#[path = "../../../tests/library/scenes/hostile_pbrt.rs"]
#[allow(clippy::unwrap_used, reason = "tests use this file too")]
mod hostile_pbrt;
#[path = "../../../tests/library/scenes/samples.rs"]
#[allow(dead_code, reason = "tests use more of the samples")]
pub mod samples;

use growth_files::KINDS;
use hostile_cases::{documents, meshes, places, scenes_in_xml, textures};
use hostile_pbrt::scenes_of_pbrt;

/// Number of parts of files of many parts.
const PARTS: usize = 16_000;

/// Extensions of pictures.
const PICTURES: [&str; 6] = ["exr", "png", "jpg", "bmp", "hdr", "tga"];

/// Whether a file is a picture, by its name.
pub fn is_picture(name: &str) -> bool {
    let end = name.rsplit('.').next();
    end.is_some_and(|end| PICTURES.contains(&end))
}

/// A file with those that it refers to.
pub struct WorstFile {
    /// What it is.
    pub name: String,
    /// Names and contents; the first is the one to read.
    pub files: Vec<(String, Vec<u8>)>,
}

impl WorstFile {
    /// Returns the name of the format of the file to read.
    pub fn format(&self) -> &'static str {
        let (name, _) = &self.files[0];
        match name.rsplit('.').next().unwrap_or_default() {
            "obj" => "OBJ",
            "ply" => "PLY",
            "gltf" | "glb" => "glTF",
            "xml" => "Mitsuba",
            "pbrt" => "pbrt",
            "json" => "folder",
            "scn" => "scn",
            "lua" => "Lua",
            _ if is_picture(name) => "picture",
            _ => "other",
        }
    }
}

/// Returns all files.
pub fn all() -> Vec<WorstFile> {
    let owned = |files: Vec<(&str, Vec<u8>)>| {
        let files = files.into_iter();
        files
            .map(|(name, bytes)| (name.to_owned(), bytes))
            .collect()
    };
    let mut all = Vec::new();
    for cases in [
        meshes(),
        documents(),
        scenes_in_xml(),
        places(),
        textures(),
        scenes_of_pbrt(),
    ] {
        all.extend(cases.into_iter().map(|(name, files, _)| WorstFile {
            name: name.to_owned(),
            files: owned(files),
        }));
    }
    all.extend(KINDS.iter().map(|(name, files)| {
        WorstFile {
            name: (*name).to_owned(),
            files: files(PARTS)
                .into_iter()
                .map(|(name, text)| (name.to_owned(), text.into_bytes()))
                .collect(),
        }
    }));
    all.extend(samples::samples().into_iter().map(|sample| WorstFile {
        name: sample.name.to_owned(),
        files: owned(sample.files),
    }));
    all
}
