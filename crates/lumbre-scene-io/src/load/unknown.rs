//! The error for files in formats that are not read.

use std::path::Path;

use super::FORMATS;
use lumbre_light::scene::SceneError;

/// Extensions of other files that are given instead of a scene, with what to do about them.
const OTHERS: [(&[&str], &str); 3] = [
    (
        &[
            "3ds", "abc", "blend", "c4d", "dae", "fbx", "ma", "max", "mb", "skp", "step", "stl",
            "stp", "usd", "usda", "usdc", "usdz", "wrl", "x3d",
        ],
        "export the scene as glTF (.glb) from the program that made it, or by Blender",
    ),
    (
        &["7z", "bz2", "gz", "rar", "tar", "tgz", "xz", "zip", "zst"],
        "unpack this archive and give the scene file in it",
    ),
    (
        &[
            "bmp", "exr", "hdr", "jpeg", "jpg", "png", "tga", "tif", "tiff",
        ],
        "this is a picture, which `lumbre metric` and `lumbre diff` measure",
    ),
];

/// Returns the error for a file in a format that is not read.
pub fn unknown_format(path: &Path) -> SceneError {
    let extension = path.extension().unwrap_or_default();
    let extension = extension.to_string_lossy().to_ascii_lowercase();
    let other = OTHERS
        .iter()
        .find(|(extensions, _)| extensions.contains(&extension.as_str()));
    let known: Vec<String> = FORMATS
        .iter()
        .flat_map(|row| row.extensions)
        .map(|e| format!(".{e}"))
        .collect();
    SceneError::UnknownFormat {
        file: path.to_owned(),
        help: other.map_or_else(String::new, |(_, help)| format!("{help}; ")),
        known: known.join(", "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_of_other_programs_are_named_with_a_remedy() {
        for (file, expected) in [
            ("a/room.FBX", "export the scene as glTF"),
            ("room.zip", "unpack this archive"),
            ("room.exr", "this is a picture"),
            ("room.txt", "unknown scene format (supported: .gltf, "),
        ] {
            let message = unknown_format(Path::new(file)).to_string();
            assert!(
                message.starts_with(file) && message.contains(expected),
                "{message}"
            );
        }
        let mut others = OTHERS.iter().flat_map(|(extensions, _)| *extensions);
        assert!(!others.any(|other| FORMATS.iter().any(|row| row.extensions.contains(other))));
    }
}
