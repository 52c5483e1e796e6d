//! OpenEXR files: any compression that the `exr` crate supports; half, float or integer samples,
//! tiles and alpha.

use std::collections::BTreeMap;
use std::io::Cursor;

use exr::math::Vec2;
use exr::meta::BlockDescription;
use exr::meta::attribute::AttributeValue;
use exr::meta::header::Header;
use exr::prelude::{MetaData, ReadChannels, ReadLayers, read};

use crate::film::Image;

/// The first bytes of every OpenEXR file.
pub const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// Names that the channels of a group may have behind the group's name.
const COMPONENTS: [[&str; 3]; 4] = [
    ["R", "G", "B"],
    ["X", "Y", "Z"],
    ["r", "g", "b"],
    ["x", "y", "z"],
];

/// Decodes groups of channels, each to an image: `albedo` is the channels `albedo.R`, `albedo.G` and
/// `albedo.B`, or with X, Y and Z, or the single channel `albedo`. The name of an EXR layer may
/// precede the group.
///
/// # Errors
/// Returns a message for damaged data, for more than `max_pixels`, and for a group that the file does
/// not have.
pub fn decode_channels(
    bytes: &[u8],
    max_pixels: usize,
    groups: &[&str],
) -> Result<Vec<Image>, String> {
    check_sizes(bytes, max_pixels)?;
    let file = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(|e| e.to_string())?;
    let mut channels = BTreeMap::new();
    for layer in &file.layer_data {
        let prefix = layer
            .attributes
            .layer_name
            .as_ref()
            .map(ToString::to_string);
        for channel in &layer.channel_data.list {
            let name = channel.name.to_string();
            if let Some(prefix) = &prefix {
                channels.insert(
                    format!("{prefix}.{name}"),
                    (layer.size, &channel.sample_data),
                );
            }
            channels.insert(name, (layer.size, &channel.sample_data));
        }
    }
    let image = |group: &&str| -> Result<Image, String> {
        let names = COMPONENTS
            .iter()
            .map(|names| names.map(|c| format!("{group}.{c}")))
            .chain([[0; 3].map(|_| (*group).to_owned())])
            .find(|names| names.iter().all(|name| channels.contains_key(name)));
        let names = names.ok_or_else(|| {
            let known: Vec<&str> = channels.keys().map(String::as_str).collect();
            format!(
                "it has no channels of `{group}`; its channels are {}",
                known.join(", ")
            )
        })?;
        let (size, _) = channels[&names[0]];
        let mut image = Image::new(size.0 as u32, size.1 as u32);
        for (c, name) in names.iter().enumerate() {
            let values = channels[name].1.values_as_f32();
            image
                .data
                .iter_mut()
                .zip(values)
                .for_each(|(pixel, value)| pixel[c] = value);
        }
        Ok(image)
    };
    groups.iter().map(image).collect()
}

/// Maximum size of an uncompressed block, tile or rows, that is larger than its whole layer, in bytes:
/// the crate `exr` allocates a block before it reads one.
const MAX_BLOCK_BYTES: usize = 64 << 20;

/// Checks the sizes of all layers and of their blocks from their headers, before memory is allocated
/// for the pixels.
fn check_sizes(bytes: &[u8], max_pixels: usize) -> Result<(), String> {
    let headers = MetaData::read_from_buffered(Cursor::new(bytes), false)
        .map_err(|e| e.to_string())?
        .headers;
    for header in &headers {
        let Vec2(width, height) = header.layer_size;
        let pixels = width.checked_mul(height).filter(|n| *n <= max_pixels);
        let Some(pixels) = pixels else {
            return Err(format!(
                "the image has {width}x{height} pixels; at most {max_pixels} are supported here"
            ));
        };
        let layer = pixels.saturating_mul(header.channels.bytes_per_pixel);
        if block_bytes(header).is_none_or(|block| block > layer.max(MAX_BLOCK_BYTES)) {
            return Err(format!(
                "its tiles, or the rows that it compresses together, are larger than the image and \
                 {} MiB",
                MAX_BLOCK_BYTES >> 20
            ));
        }
    }
    Ok(())
}

/// Returns the size of an uncompressed block of a layer in bytes, unless it exceeds the range.
fn block_bytes(header: &Header) -> Option<usize> {
    match header.blocks {
        BlockDescription::Tiles(tiles) => {
            let Vec2(width, height) = tiles.tile_size;
            let pixels = width.checked_mul(height)?;
            pixels.checked_mul(header.channels.bytes_per_pixel)
        }
        BlockDescription::ScanLines => Some(header.max_block_byte_size()),
    }
}

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
    check_sizes(bytes, max_pixels)?;
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

#[cfg(test)]
mod tests {
    use exr::prelude::{Encoding, Image, Layer, LayerAttributes, SpecificChannels, WritableImage};

    use super::*;

    /// Returns a file of 3x2 pixels in tiles of 16x16.
    fn tiled() -> Vec<u8> {
        let encoding = Encoding {
            blocks: exr::image::Blocks::Tiles(Vec2(16, 16)),
            ..Encoding::FAST_LOSSLESS
        };
        let channels = SpecificChannels::rgb(|at: Vec2<usize>| (at.x() as f32, 0.5_f32, 0.25_f32));
        let layer = Layer::new((3, 2), LayerAttributes::named("a"), encoding, channels);
        let mut file = Cursor::new(Vec::new());
        Image::from_layer(layer)
            .write()
            .to_buffered(&mut file)
            .unwrap();
        file.into_inner()
    }

    #[test]
    fn tiles_that_are_larger_than_the_image_are_read_unless_they_are_enormous() {
        let mut file = tiled();
        assert_eq!(decode(&file, 6).unwrap().0.data[2], [2.0, 0.5, 0.25]);
        let kind = b"tiledesc\0";
        let at = file.windows(kind.len()).position(|w| w == kind).unwrap() + kind.len() + 4;
        for place in [at, at + 4] {
            file[place..place + 4].copy_from_slice(&u32::to_le_bytes(1 << 14));
        }
        let error = decode(&file, 6).unwrap_err();
        assert!(error.contains("64 MiB"), "{error}");
        assert_eq!(decode_channels(&file, 6, &[]).unwrap_err(), error);
    }
}
