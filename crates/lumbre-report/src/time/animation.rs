//! Animations of films with a time axis, as animated PNG and as GIF.

use std::ops::Range;

use super::{Movie, bytes, encode_error};
use crate::{OutputError, PREFIX};
use lumbre_metrics::tonemap::Tonemap;

/// Frames per second.
const RATE: u16 = 20;

/// Encodes an animated PNG with one frame for each group of bins, repeated without end. Viewers
/// without support for animations show the first frame.
///
/// # Errors
/// Returns an error if the encoder fails.
pub fn apng(
    movie: &Movie,
    groups: &[Range<u32>],
    display: Tonemap,
    meta: &[(String, String)],
) -> Result<Vec<u8>, OutputError> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, movie.width, movie.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    for (key, value) in meta {
        encoder
            .add_itxt_chunk(format!("{PREFIX}{key}"), value.clone())
            .map_err(encode_error)?;
    }
    encoder
        .set_animated(groups.len().max(1) as u32, 0)
        .map_err(encode_error)?;
    encoder.set_frame_delay(1, RATE).map_err(encode_error)?;
    let mut writer = encoder.write_header().map_err(encode_error)?;
    for group in groups {
        writer
            .write_image_data(&bytes(&movie.frame(group.clone()), display))
            .map_err(encode_error)?;
    }
    writer.finish().map_err(encode_error)?;
    Ok(out)
}

/// Encodes the same frames as a GIF with 256 colours per frame.
///
/// # Errors
/// Returns an error if a side exceeds the format's limit of 65,535 pixels, or the encoder fails.
pub fn gif(movie: &Movie, groups: &[Range<u32>], display: Tonemap) -> Result<Vec<u8>, OutputError> {
    let side = |n: u32| u16::try_from(n).map_err(encode_error);
    let (width, height) = (side(movie.width)?, side(movie.height)?);
    let mut out = Vec::new();
    let mut encoder = gif::Encoder::new(&mut out, width, height, &[]).map_err(encode_error)?;
    encoder
        .set_repeat(gif::Repeat::Infinite)
        .map_err(encode_error)?;
    for group in groups {
        let pixels = bytes(&movie.frame(group.clone()), display);
        let mut frame = gif::Frame::from_rgb_speed(width, height, &pixels, 10);
        frame.delay = 100 / RATE;
        encoder.write_frame(&frame).map_err(encode_error)?;
    }
    drop(encoder);
    Ok(out)
}
