//! The files to which `lumbre render` writes a picture.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use image::ImageFormat;
use image::codecs::hdr::HdrEncoder;

use crate::cli::scene::builtin::scene_name;
use lumbre_light::film::Image;
use lumbre_metrics::tonemap::Tonemap;
use lumbre_night::paths::{extension, folder_of};
use lumbre_report::{exr, png};

/// Format of a picture file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    /// OpenEXR: linear radiance in single precision, with metadata.
    Exr,
    /// Radiance HDR: linear radiance with a shared exponent, without metadata.
    Hdr,
    /// PNG: tone-mapped, with metadata.
    Png,
    /// Windows bitmap: tone-mapped, without metadata.
    Bmp,
}

/// File extensions of the formats.
const FORMATS: [(&str, Format); 4] = [
    ("exr", Format::Exr),
    ("hdr", Format::Hdr),
    ("png", Format::Png),
    ("bmp", Format::Bmp),
];

/// A file to write.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutputFile {
    /// Path of the file.
    pub path: PathBuf,
    format: Format,
}

/// Returns the files to write: the given ones, or an EXR and a PNG file in the current folder named
/// after the scene.
///
/// # Errors
/// Returns a message if a file has an unknown extension, is a folder, or its folder does not exist.
pub fn outputs(given: &[PathBuf], scene: &Path) -> Result<Vec<OutputFile>, String> {
    if given.is_empty() {
        let stem = scene_name(scene);
        return Ok(["exr", "png"]
            .map(|extension| PathBuf::from(format!("{stem}.{extension}")))
            .into_iter()
            .filter_map(|path| OutputFile::new(path).ok())
            .collect());
    }
    given.iter().cloned().map(OutputFile::new).collect()
}

impl OutputFile {
    fn new(path: PathBuf) -> Result<OutputFile, String> {
        let extension = extension(&path);
        let known = FORMATS.iter().find(|(name, _)| *name == extension);
        let Some((_, format)) = known else {
            return Err(format!(
                "{}: pictures are written as .exr, .hdr, .png or .bmp",
                path.display()
            ));
        };
        if path.is_dir() {
            return Err(format!("{} is a folder", path.display()));
        }
        let output = OutputFile {
            path,
            format: *format,
        };
        let folder = output.folder();
        if folder.is_dir() {
            Ok(output)
        } else {
            let folder = folder.display();
            Err(format!(
                "there is no folder {folder}: create it, or give another file with -o"
            ))
        }
    }

    /// Returns the folder of the file.
    pub fn folder(&self) -> &Path {
        folder_of(&self.path)
    }

    /// Encodes a picture in this file's format. `extras` are stored in OpenEXR files, `display` is
    /// the tone map of PNG and BMP files.
    ///
    /// # Errors
    /// Returns a message if the encoder fails.
    pub fn encode(
        &self,
        image: &Image,
        extras: &exr::Extras<'_>,
        display: Tonemap,
        metadata: &[(String, String)],
    ) -> Result<Vec<u8>, String> {
        match self.format {
            Format::Exr => exr::encode_with(image, extras, metadata).map_err(|e| e.to_string()),
            Format::Png => png::encode(image, display, metadata).map_err(|e| e.to_string()),
            Format::Hdr => encode_hdr(image).map_err(|e| e.to_string()),
            Format::Bmp => {
                let png = png::encode(image, display, &[]).map_err(|e| e.to_string())?;
                to_bmp(&png).map_err(|e| e.to_string())
            }
        }
    }
}

fn to_bmp(png: &[u8]) -> image::ImageResult<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    image::load_from_memory_with_format(png, ImageFormat::Png)?
        .write_to(&mut bytes, ImageFormat::Bmp)?;
    Ok(bytes.into_inner())
}

fn encode_hdr(image: &Image) -> image::ImageResult<Vec<u8>> {
    let pixels: Vec<image::Rgb<f32>> = image.data.iter().copied().map(image::Rgb).collect();
    let mut bytes = Cursor::new(Vec::new());
    HdrEncoder::new(&mut bytes).encode(&pixels, image.width as usize, image.height as usize)?;
    Ok(bytes.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_report::picture;

    fn paths(given: &[&str], scene: &str) -> Result<Vec<PathBuf>, String> {
        let given: Vec<PathBuf> = given.iter().map(PathBuf::from).collect();
        let found = outputs(&given, Path::new(scene))?;
        Ok(found.into_iter().map(|output| output.path).collect())
    }

    #[test]
    fn a_picture_without_a_name_is_named_after_its_scene() {
        let expected = ["room.exr", "room.png"].map(PathBuf::from).to_vec();
        assert_eq!(paths(&[], "scenes/room.lua"), Ok(expected));
        assert_eq!(paths(&["a.HDR"], "b.scn"), Ok(vec!["a.HDR".into()]));
    }

    #[test]
    fn files_that_cannot_be_written_are_refused_before_rendering() {
        for (file, reason) in [
            ("a.jpg", ".exr, .hdr, .png or .bmp"),
            ("a", ".exr, .hdr, .png or .bmp"),
            ("no/such/folder/a.exr", "there is no folder"),
        ] {
            let message = paths(&[file], "b.scn").unwrap_err();
            assert!(message.contains(reason), "{message}");
        }
    }

    #[test]
    fn every_format_is_decoded_as_the_same_picture() {
        let image = Image::from_fn(5, 3, |x, y| [0.1 * x as f32, 0.2 * y as f32, 0.5]);
        let display = Tonemap::Srgb { exposure: 0.0 };
        for (extension, _) in FORMATS {
            let output = OutputFile::new(format!("a.{extension}").into()).unwrap();
            let bytes = output
                .encode(&image, &exr::Extras::default(), display, &[])
                .unwrap();
            let decoded = picture::decode(&bytes).unwrap();
            assert_eq!(decoded.format, extension);
            for (a, b) in std::iter::zip(&decoded.image.data, &image.data) {
                assert!(std::iter::zip(a, b).all(|(a, b)| (a - b).abs() < 0.01));
            }
        }
    }
}
