//! Output files as bytes or text: pictures, figures, tables, summaries and reports. Nothing in this
//! module accesses the disk.
//!
//! Equal input gives equal bytes on every machine: no clock, no system font and no hash-map order
//! is used. The caller passes metadata as key-value pairs. They are embedded in every file format
//! that supports it.

pub mod benchmark;
mod censored;
pub mod clock;
pub mod common_error;
pub mod comparison;
mod dependent_axes;
mod exposure;
pub mod exr;
mod format;
pub mod guiding;
pub mod lanes;
mod latex;
pub mod layer;
pub mod lobe;
pub mod metric_display;
pub mod pdf;
pub mod picture;
pub mod plot;
pub mod png;
pub mod provenance;
pub mod quantity;
pub mod repeats;
pub mod report;
pub mod summary;
pub mod table;
pub mod time;

#[cfg(test)]
pub(crate) mod fixture;

/// Errors of encoding and decoding output files.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OutputError {
    /// The EXR file could not be decoded.
    #[error("cannot read this EXR: {reason}")]
    ExrRead {
        /// Error message of the decoder.
        reason: String,
    },
    /// The picture file could not be decoded.
    #[error("cannot read this picture: {reason}")]
    PictureRead {
        /// Description of the defect.
        reason: String,
    },
    /// The image could not be encoded as EXR.
    #[error("cannot write an EXR: {reason}")]
    ExrWrite {
        /// Error message of the encoder.
        reason: String,
    },
    /// The image could not be encoded as PNG.
    #[error("cannot write a PNG: {reason}")]
    PngWrite {
        /// Error message of the encoder.
        reason: String,
    },
    /// The SVG figure could not be parsed or rendered.
    #[error("cannot draw this SVG: {reason}")]
    Svg {
        /// Error message of the parser or renderer.
        reason: String,
    },
    /// The image has no pixels, or its buffer does not match its size.
    #[error(
        "the image is declared as {width}x{height} pixels but its buffer has {pixels}; the numbers \
         must be equal and positive"
    )]
    Shape {
        /// Declared width in pixels.
        width: u32,
        /// Declared height in pixels.
        height: u32,
        /// Number of pixels in the buffer.
        pixels: usize,
    },
}

/// Prefix of the metadata keys in files. It avoids clashes with the keys of the file format.
const PREFIX: &str = "lumbre.";

/// Returns an error if the image has no pixels or its buffer does not match its size.
fn check_shape(image: &lumbre_light::film::Image) -> Result<(), OutputError> {
    let (width, height, pixels) = (image.width, image.height, image.data.len());
    if pixels == 0 || pixels != width as usize * height as usize {
        return Err(OutputError::Shape {
            width,
            height,
            pixels,
        });
    }
    Ok(())
}
