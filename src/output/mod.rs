//! Evidence: pictures, figures, tables and summaries, as bytes or text. Nothing here touches the disk.
//!
//! The same input gives the same bytes on every machine: no clock, no system font, no order of a hash map. Metadata
//! comes from the caller as pairs of key and value and goes inside every file that has room for it.

mod bound;
pub mod devices;
pub mod exr;
mod labels;
pub mod layer;
pub mod pdf;
pub mod picture;
pub mod plot;
pub mod png;
mod quantity;
pub mod report;
pub mod summary;
pub mod table;
pub mod time;

#[cfg(test)]
mod fixture;

/// Why evidence could not be written or read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OutputError {
    /// An EXR file that cannot be read.
    #[error("cannot read this EXR: {reason}")]
    ExrRead {
        /// What the decoder says.
        reason: String,
    },
    /// A picture that cannot be read.
    #[error("cannot read this picture: {reason}")]
    PictureRead {
        /// What is wrong with it.
        reason: String,
    },
    /// An image that cannot become an EXR.
    #[error("cannot write an EXR: {reason}")]
    ExrWrite {
        /// What the encoder says.
        reason: String,
    },
    /// An image that cannot become a PNG.
    #[error("cannot write a PNG: {reason}")]
    PngWrite {
        /// What the encoder says.
        reason: String,
    },
    /// A figure that cannot become a picture.
    #[error("cannot draw this SVG: {reason}")]
    Svg {
        /// What the renderer says.
        reason: String,
    },
    /// An image without pixels, or one whose buffer has another size than it says.
    #[error("the image says {width}x{height} pixels but holds {pixels}; at least one is needed")]
    Shape {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// Pixels in its buffer.
        pixels: usize,
    },
}

/// Prefix of the names under which files carry our metadata, so that none is mistaken for one of a format's own.
const PREFIX: &str = "lumbre.";

/// Refuses images that no file format could hold.
fn check_shape(image: &crate::film::Image) -> Result<(), OutputError> {
    let (width, height, pixels) = (image.width, image.height, image.data.len());
    if pixels == 0 || pixels != width as usize * height as usize {
        return Err(OutputError::Shape { width, height, pixels });
    }
    Ok(())
}
