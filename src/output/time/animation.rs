//! Moving pictures: PNG with several frames, and GIF.

use std::ops::Range;

use super::{Movie, bytes, refuse};
use crate::metrics::tonemap::Tonemap;
use crate::output::{OutputError, PREFIX};

/// Frames in a second.
const RATE: u16 = 20;

/// The bytes of a PNG whose frames are groups of bins, repeated for ever; what shows no animations shows the first frame.
///
/// # Errors
/// A failure of the encoder.
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
        encoder.add_itxt_chunk(format!("{PREFIX}{key}"), value.clone()).map_err(refuse)?;
    }
    encoder.set_animated(groups.len().max(1) as u32, 0).map_err(refuse)?;
    encoder.set_frame_delay(1, RATE).map_err(refuse)?;
    let mut writer = encoder.write_header().map_err(refuse)?;
    for group in groups {
        writer.write_image_data(&bytes(&movie.frame(group.clone()), display)).map_err(refuse)?;
    }
    writer.finish().map_err(refuse)?;
    Ok(out)
}

/// The bytes of a GIF with the same frames, 256 colours each.
///
/// # Errors
/// A picture beyond the format's 65,535 pixels to a side, or a failure of the encoder.
pub fn gif(movie: &Movie, groups: &[Range<u32>], display: Tonemap) -> Result<Vec<u8>, OutputError> {
    let side = |n: u32| u16::try_from(n).map_err(refuse);
    let (width, height) = (side(movie.width)?, side(movie.height)?);
    let mut out = Vec::new();
    let mut encoder = gif::Encoder::new(&mut out, width, height, &[]).map_err(refuse)?;
    encoder.set_repeat(gif::Repeat::Infinite).map_err(refuse)?;
    for group in groups {
        let pixels = bytes(&movie.frame(group.clone()), display);
        let mut frame = gif::Frame::from_rgb_speed(width, height, &pixels, 10);
        frame.delay = 100 / RATE;
        encoder.write_frame(&frame).map_err(refuse)?;
    }
    drop(encoder);
    Ok(out)
}
