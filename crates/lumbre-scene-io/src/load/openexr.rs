//! OpenEXR files: any compression that the `exr` crate supports; half, float or integer samples,
//! tiles and alpha.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Cursor;

use exr::math::Vec2;
use exr::meta::BlockDescription;
use exr::meta::attribute::AttributeValue;
use exr::meta::header::Header;
use exr::prelude::{FlatImage, MetaData, ReadChannels, ReadLayers, read};

use super::primaries;
use glam::DMat3;
use lumbre_light::film::Image;

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
    check_header(bytes, max_pixels)?;
    let file = read_layers(bytes)?;
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

/// Reads all channels of all layers.
fn read_layers(bytes: &[u8]) -> Result<FlatImage, String> {
    read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(|e| e.to_string())
}

/// Names of a single channel of grey values.
const GREY: [&str; 3] = ["Y", "y", "L"];

/// Colours of a texture that is an EXR file.
pub struct ExrTexture {
    /// The colours in linear sRGB, or grey.
    pub image: Image,
    /// Name of the group of channels that was read, if there are others beside it.
    pub one_of: Option<String>,
    /// Whether the colours were converted from other primaries.
    pub converted: bool,
}

/// Decodes the colours of a texture: the first layer with channels R, G and B, else the first group
/// of channels with such names, such as `diffuse.R`, else a channel Y or the only channel, which is
/// grey. Colours are converted to linear sRGB.
///
/// # Errors
/// Returns a message for data that is not an EXR with such channels, is damaged, or has more than
/// `max_pixels`.
pub fn decode_texture(bytes: &[u8], max_pixels: usize) -> Result<ExrTexture, String> {
    let map = check_header(bytes, max_pixels)?;
    let problem = match decode_rgb(bytes, map) {
        Ok((image, _)) => {
            return Ok(ExrTexture {
                image,
                one_of: None,
                converted: map.is_some(),
            });
        }
        Err(problem) => problem,
    };
    let file = read_layers(bytes).map_err(|_| problem.clone())?;
    for layer in &file.layer_data {
        let list = &layer.channel_data.list;
        let names: Vec<String> = list.iter().map(|c| c.name.to_string()).collect();
        let Some((group, channels)) = colors_of(&names) else {
            continue;
        };
        let mut image = Image::new(layer.size.0 as u32, layer.size.1 as u32);
        for (c, channel) in channels.into_iter().enumerate() {
            let values = list[channel].sample_data.values_as_f32();
            let pixels = image.data.iter_mut();
            pixels.zip(values).for_each(|(pixel, x)| pixel[c] = x);
        }
        let map = map.filter(|_| channels != [channels[0]; 3]);
        map.inspect(|map| primaries::convert(&mut image.data, *map));
        let others = names.iter().any(|name| group_of(name) != group);
        return Ok(ExrTexture {
            image,
            one_of: others.then_some(group),
            converted: map.is_some(),
        });
    }
    Err(problem)
}

/// Returns the group of a channel: what precedes its last dot.
fn group_of(name: &str) -> &str {
    name.rsplit_once('.').map_or("", |(group, _)| group)
}

/// Returns the channels of a layer that are the colours of a texture, and their group.
fn colors_of(names: &[String]) -> Option<(String, [usize; 3])> {
    let groups: BTreeSet<&str> = names.iter().map(|name| group_of(name)).collect();
    let index = |group: &str, component: &str| {
        let name = match group {
            "" => component.to_owned(),
            _ => format!("{group}.{component}"),
        };
        names.iter().position(|n| *n == name)
    };
    for group in &groups {
        for components in [["R", "G", "B"], ["r", "g", "b"]] {
            if let [Some(r), Some(g), Some(b)] = components.map(|name| index(group, name)) {
                return Some(((*group).to_owned(), [r, g, b]));
            }
        }
    }
    for group in &groups {
        // Luminance beside chroma is no grey.
        let chroma = ["RY", "BY"].iter().any(|name| index(group, name).is_some());
        let grey = GREY.iter().find_map(|name| index(group, name));
        if let Some(grey) = grey.filter(|_| !chroma) {
            return Some(((*group).to_owned(), [grey; 3]));
        }
    }
    match names {
        [only] => Some((group_of(only).to_owned(), [0; 3])),
        _ => None,
    }
}

/// Maximum size of an uncompressed block, tile or rows, that is larger than its whole layer, in bytes:
/// the crate `exr` allocates a block before it reads one.
const MAX_BLOCK_BYTES: usize = 64 << 20;

/// Checks the sizes of all layers and of their blocks from their headers, before memory is allocated
/// for the pixels. Returns the map of colours to linear sRGB if the primaries are others.
fn check_header(bytes: &[u8], max_pixels: usize) -> Result<Option<DMat3>, String> {
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
    let first = headers.first();
    Ok(primaries::of_exr(first.and_then(|header| {
        header.shared_attributes.chromaticities
    })))
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

/// Decodes the first layer with channels R, G and B, converts it to linear sRGB, and returns it with
/// all text attributes by name.
///
/// # Errors
/// Returns a message for data that is not an EXR with RGB channels, is damaged, or has more than
/// `max_pixels`.
pub fn decode(
    bytes: &[u8],
    max_pixels: usize,
) -> Result<(Image, BTreeMap<String, String>), String> {
    decode_rgb(bytes, check_header(bytes, max_pixels)?)
}

/// Decodes a file whose header was checked like [`decode`]; `map` is that to linear sRGB.
fn decode_rgb(
    bytes: &[u8],
    map: Option<DMat3>,
) -> Result<(Image, BTreeMap<String, String>), String> {
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
    let mut image = file.layer_data.channel_data.pixels;
    map.inspect(|map| primaries::convert(&mut image.data, *map));
    Ok((image, texts))
}

#[cfg(test)]
mod tests {
    use exr::prelude::{
        AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes,
        SpecificChannels, WritableImage,
    };

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

    /// Returns a file of two pixels with these channels, each of one value.
    fn channels(channels: &[(&str, f32)]) -> Vec<u8> {
        let list = channels
            .iter()
            .map(|(name, value)| AnyChannel::new(*name, FlatSamples::F32(vec![*value; 2])));
        let channels = AnyChannels::sort(list.collect());
        let attributes = LayerAttributes::default();
        let layer = Layer::new((2, 1), attributes, Encoding::FAST_LOSSLESS, channels);
        let mut file = Cursor::new(Vec::new());
        let image = Image::from_layer(layer);
        image.write().to_buffered(&mut file).unwrap();
        file.into_inner()
    }

    #[test]
    fn textures_have_colours_of_any_layer_or_one_grey_channel() {
        let read = |list: &[(&str, f32)]| {
            let texture = decode_texture(&channels(list), 2).unwrap();
            let pixels = texture.image.data;
            assert_eq!(pixels[0], pixels[1]);
            (pixels[0], texture.one_of)
        };
        assert_eq!(read(&[("Y", 0.4)]), ([0.4; 3], None));
        assert_eq!(read(&[("Y", 0.4), ("A", 1.0)]), ([0.4; 3], None));
        assert_eq!(read(&[("height", 2.0)]), ([2.0; 3], None));
        assert_eq!(read(&[("depth.Z", 3.0)]), ([3.0; 3], None));
        let colors = [("skin.R", 0.1), ("skin.G", 0.2), ("skin.B", 0.3)];
        assert_eq!(read(&colors), ([0.1, 0.2, 0.3], None));
        let with = [&colors[..], &[("wear.Y", 0.5)]].concat();
        assert_eq!(read(&with), ([0.1, 0.2, 0.3], Some("skin".to_owned())));
        for refused in [
            &[("Y", 0.4), ("RY", 0.0), ("BY", 0.0)][..],
            &[("u", 0.0), ("v", 1.0)],
        ] {
            assert!(decode_texture(&channels(refused), 2).is_err());
        }
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
