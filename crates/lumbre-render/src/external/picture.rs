//! Pictures that other programs write: linear radiance as OpenEXR, PFM or Radiance HDR.

use std::collections::BTreeMap;
use std::fs;
use std::io::Cursor;
use std::path::Path;

use image::codecs::hdr::HdrDecoder;
use image::{ColorType, ImageDecoder};
use lumbre_light::film::Image;
use lumbre_light::film::layer::Layer;
use lumbre_scene_io::load::openexr;

lumbre_light::named! {
    /// Format of the pictures of a technique; its name is also the ending of its files.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum PictureFormat {
        /// OpenEXR with channels R, G and B.
        Exr = "exr",
        /// Portable float map with three channels or one.
        Pfm = "pfm",
        /// Radiance HDR: three bytes and an exponent.
        Hdr = "hdr",
    }
}

/// Greatest size of a picture file in bytes per pixel; layers share the file.
const MAX_BYTES_PER_PIXEL: u64 = 256;
/// Size of a file that is read whatever the number of pixels.
const MIN_LIMIT: u64 = 1 << 20;

/// A picture with the layers that were requested, in their order.
pub(super) struct Pictures {
    /// Radiance of the picture.
    pub(super) radiance: Image,
    /// Images of the layers.
    pub(super) layers: Vec<Image>,
}

/// Reads the picture of a wave.
///
/// # Errors
/// Returns a message for a file that is missing, damaged, or of another size, and for layers that
/// it lacks.
pub(super) fn read(
    file: &Path,
    format: PictureFormat,
    [width, height]: [u32; 2],
    channels: &[&str],
) -> Result<Pictures, String> {
    let pixels = width as usize * height as usize;
    let length = match fs::metadata(file) {
        Ok(metadata) if metadata.is_file() => metadata.len(),
        _ => return Err("it wrote no picture to {out}".to_owned()),
    };
    if length > MIN_LIMIT + MAX_BYTES_PER_PIXEL * pixels as u64 {
        return Err(format!(
            "its picture file has {length} bytes, which is too large"
        ));
    }
    let bytes = fs::read(file).map_err(|e| format!("its picture cannot be read: {e}"))?;
    let radiance = match format {
        PictureFormat::Exr => openexr::decode(&bytes, pixels.max(1 << 20)).map(|(image, _)| image),
        PictureFormat::Pfm => decode_pfm(&bytes, pixels.max(1 << 20)),
        PictureFormat::Hdr => decode_hdr(&bytes, pixels.max(1 << 20)),
    };
    let radiance = radiance.map_err(|e| format!("its picture cannot be decoded: {e}"))?;
    if [radiance.width, radiance.height] != [width, height] {
        return Err(format!(
            "its picture has {}x{} pixels instead of {width}x{height}",
            radiance.width, radiance.height
        ));
    }
    let layers = if channels.is_empty() {
        Vec::new()
    } else {
        openexr::decode_channels(&bytes, pixels, channels)
            .map_err(|e| format!("its layers cannot be decoded: {e}"))?
    };
    Ok(Pictures { radiance, layers })
}

/// Returns the number of values that are not finite.
pub(super) fn invalid_values(image: &Image) -> u64 {
    let values = image.data.iter().flatten();
    values.filter(|value| !value.is_finite()).count() as u64
}

/// Decodes a portable float map: `PF` or `Pf`, width, height and scale, each followed by one white
/// space, then rows from the bottom to the top. A negative scale means little-endian numbers.
fn decode_pfm(bytes: &[u8], max_pixels: usize) -> Result<Image, String> {
    let mut rest = bytes;
    let mut token = || -> Result<&str, String> {
        let end = rest
            .iter()
            .take(64)
            .position(u8::is_ascii_whitespace)
            .ok_or("the header of the PFM file is incomplete")?;
        let (word, after) = rest.split_at(end);
        rest = &after[1..];
        std::str::from_utf8(word).map_err(|_| "the header of the PFM file is not text".to_owned())
    };
    let channels = match token()? {
        "PF" => 3,
        "Pf" => 1,
        _ => return Err("it is not a PFM file".to_owned()),
    };
    let mut size = || -> Result<u32, String> {
        let word = token()?;
        let size = word.parse().ok().filter(|size| *size > 0);
        size.ok_or_else(|| "the PFM file has no valid size".to_owned())
    };
    let (width, height) = (size()?, size()?);
    let scale: f32 = token()?
        .parse()
        .map_err(|_| "the PFM file has no valid scale")?;
    let pixels = width as usize * height as usize;
    if pixels > max_pixels {
        return Err(format!("the picture has {width}x{height} pixels"));
    }
    if rest.len() != 4 * channels * pixels {
        return Err("the PFM file has the wrong length".to_owned());
    }
    let number = |at: usize| {
        let word = [rest[at], rest[at + 1], rest[at + 2], rest[at + 3]];
        if scale < 0.0 {
            f32::from_le_bytes(word)
        } else {
            f32::from_be_bytes(word)
        }
    };
    Ok(Image::from_fn(width, height, |x, y| {
        let row = (height - 1 - y) as usize;
        let first = 4 * channels * (row * width as usize + x as usize);
        [0, 1, 2].map(|c| number(first + 4 * if channels == 3 { c } else { 0 }))
    }))
}

fn decode_hdr(bytes: &[u8], max_pixels: usize) -> Result<Image, String> {
    let decoder = HdrDecoder::new(Cursor::new(bytes)).map_err(|e| e.to_string())?;
    let (width, height) = decoder.dimensions();
    if width as usize * height as usize > max_pixels || decoder.color_type() != ColorType::Rgb32F {
        return Err(format!("the picture has {width}x{height} pixels"));
    }
    let mut data = vec![[0.0f32; 3]; width as usize * height as usize];
    decoder
        .read_image(bytemuck::cast_slice_mut(&mut data))
        .map_err(|e| e.to_string())?;
    Ok(Image::from_pixels(width, height, data))
}

/// Layers that another program may render, with the meaning of their channels: means over the
/// samples for [`Layer::Albedo`] and [`Layer::Normal`], the mean distance for [`Layer::Distance`],
/// which is zero or not finite where nothing was hit.
pub const LAYERS: [Layer; 3] = [Layer::Albedo, Layer::Normal, Layer::Distance];

/// Adds an image of `samples` samples per pixel to the sums of a layer. Values that are not finite
/// count as zero.
pub(super) fn add_layer(sums: &mut [[f64; 3]], layer: Layer, image: &Image, samples: u64) {
    let n = samples as f64;
    for (sum, pixel) in sums.iter_mut().zip(&image.data) {
        let pixel = pixel.map(|x| if x.is_finite() { f64::from(x) } else { 0.0 });
        let pixel = match layer {
            Layer::Distance if pixel[0] > 0.0 => [pixel[0], 1.0, 0.0],
            Layer::Distance => [0.0; 3],
            _ => pixel,
        };
        for (sum, value) in sum.iter_mut().zip(pixel) {
            *sum += n * value;
        }
    }
}

/// Returns the channels of the layers of a run: for each layer the group that the technique
/// declares.
///
/// # Errors
/// Returns a message for a layer that the technique does not declare.
pub(super) fn layer_channels<'a>(
    layers: &[Layer],
    declared: &'a BTreeMap<String, String>,
) -> Result<Vec<&'a str>, String> {
    let channels = |layer: &Layer| {
        let name = layer.row().name;
        declared.get(name).map(String::as_str).ok_or_else(|| {
            format!("the technique declares no layer `{name}`: leave it out of `films`")
        })
    };
    layers.iter().map(channels).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pfm(header: &str, numbers: &[f32], little: bool) -> Vec<u8> {
        let mut bytes = header.as_bytes().to_vec();
        for x in numbers {
            bytes.extend(if little {
                x.to_le_bytes()
            } else {
                x.to_be_bytes()
            });
        }
        bytes
    }

    #[test]
    fn float_maps_have_their_last_row_first_and_either_byte_order() {
        let numbers = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        for (header, little) in [("PF\n1 2\n-1.0\n", true), ("PF 1 2 1\n", false)] {
            let image = decode_pfm(&pfm(header, &numbers, little), 2).unwrap();
            assert_eq!(
                (image.at(0, 0), image.at(0, 1)),
                ([4.0, 5.0, 6.0], [1.0, 2.0, 3.0])
            );
        }
        let grey = decode_pfm(&pfm("Pf\n2 1\n-1\n", &[0.5, 0.25], true), 2).unwrap();
        assert_eq!(grey.data, [[0.5; 3], [0.25; 3]]);
        for wrong in [
            "",
            "PF",
            "P6\n1 1\n1\n",
            "PF\n0 1\n1\n",
            "PF\n9999 9999\n1\n",
            "PF\n1 1\n-1\n",
        ] {
            assert!(decode_pfm(wrong.as_bytes(), 2).is_err(), "{wrong}");
        }
    }

    #[test]
    fn layers_are_means_and_distances_count_only_samples_that_hit() {
        let image = Image::from_pixels(2, 1, vec![[4.0; 3], [f32::INFINITY; 3]]);
        let mut sums = vec![[0.0; 3]; 2];
        add_layer(&mut sums, Layer::Distance, &image, 3);
        assert_eq!(sums, [[12.0, 3.0, 0.0], [0.0; 3]]);
        add_layer(&mut sums, Layer::Albedo, &image, 1);
        assert_eq!(sums[0], [16.0, 7.0, 4.0]);
    }
}
