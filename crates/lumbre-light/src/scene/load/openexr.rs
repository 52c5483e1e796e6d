//! OpenEXR files: any compression that the `exr` crate supports; half, float or integer samples,
//! tiles and alpha.

use std::collections::BTreeMap;
use std::io::Cursor;

use exr::meta::attribute::AttributeValue;
use exr::prelude::{MetaData, ReadChannels, ReadLayers, read};

use crate::film::Image;

/// The first bytes of every OpenEXR file.
pub const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// Decodes the first layer with channels R, G and B, and returns it with all text attributes by
/// name.
///
/// # Errors
/// Returns a message for data that is not an EXR with RGB channels, is damaged, or has more than
/// `max_pixels`.
pub fn decode(
    bytes: &[u8],
    max_pixels: usize,
) -> Result<(Image, BTreeMap<String, String>), String> {
    let headers = MetaData::read_from_buffered(Cursor::new(bytes), false)
        .map_err(|e| e.to_string())?
        .headers;
    for size in headers.iter().map(|h| h.layer_size) {
        if size
            .0
            .checked_mul(size.1)
            .is_none_or(|pixels| pixels > max_pixels)
        {
            return Err(format!(
                "the image has {}x{} pixels; at most {max_pixels} are supported here",
                size.0, size.1
            ));
        }
    }
    let file = read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| Image::new(size.0 as u32, size.1 as u32),
            |image: &mut Image, at, (r, g, b): (f32, f32, f32)| {
                let width = image.width as usize;
                image.data[at.1 * width + at.0] = [r, g, b];
            },
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(|e| e.to_string())?;
    let attributes = file
        .attributes
        .other
        .iter()
        .chain(&file.layer_data.attributes.other);
    let texts = attributes.filter_map(|(name, value)| match value {
        AttributeValue::Text(text) => {
            let decode = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
            Some((decode(name.as_slice()), decode(text.as_slice())))
        }
        _ => None,
    });
    let texts = texts.collect();
    Ok((file.layer_data.channel_data.pixels, texts))
}
