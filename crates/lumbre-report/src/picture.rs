//! Reads pictures of any origin as linear radiance: OpenEXR, Radiance HDR, PNG, JPEG and BMP files.
//!
//! Colour information of a file that is ignored is reported in a note.

use std::io::Cursor;

use exr::prelude::{
    AnyChannels, FlatSamples, Image as ExrImage, Layer, Layers, ReadChannels, ReadLayers, read,
};
use image::codecs::hdr::HdrDecoder;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use super::OutputError;
use lumbre_light::film::Image;
use lumbre_metrics::tonemap::srgb_light;
use lumbre_scene_io::load::{openexr, primaries};

/// Maximum number of pixels of a picture: 2^28, which is 3 GiB of `f32` RGB.
const MAX_PIXELS: usize = 1 << 28;
/// Pixels that a file of any size may have, such as a black picture of 4096x4096.
const SMALL_PIXELS: usize = 1 << 24;
/// Further pixels that it may have for each byte.
const PIXELS_PER_BYTE: usize = 40;

/// Returns the greatest number of pixels of a file, so that a small file takes little memory.
fn max_pixels(file_bytes: usize) -> usize {
    file_bytes
        .saturating_mul(PIXELS_PER_BYTE)
        .saturating_add(SMALL_PIXELS)
        .min(MAX_PIXELS)
}

/// File extensions of the formats that [`decode`] reads.
pub const EXTENSIONS: [&str; 6] = ["bmp", "exr", "hdr", "jpeg", "jpg", "png"];

/// A decoded picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels in linear sRGB. Files with 8 or 16 bits are decoded with the sRGB curve to 0..=1.
    pub image: Image,
    /// Name of the format: `exr`, `hdr`, `png`, `jpeg` or `bmp`.
    pub format: &'static str,
    /// Properties of the file that were ignored, as sentences without a full stop.
    pub notes: Vec<String>,
}

/// Decodes a picture. The format is detected from the first bytes.
///
/// For EXR files with several layers, or with channels such as `Combined.R`, the first complete set
/// of R, G and B is used, otherwise a single luminance channel Y as grey. The pixels are those of
/// the data window. Alpha is ignored. For Radiance files, exposure and colour correction are
/// removed, so that pixels are radiance.
///
/// # Errors
/// Returns an error if the format is unknown, the file is damaged, or it has no or more than 2^28
/// pixels, or more than 2^24 and 40 for each byte of the file.
pub fn decode(bytes: &[u8]) -> Result<Picture, OutputError> {
    let decoded = if bytes.starts_with(&openexr::MAGIC) {
        decode_exr(bytes)
    } else {
        match image::guess_format(bytes) {
            Ok(ImageFormat::Hdr) => decode_hdr(bytes),
            Ok(ImageFormat::Png) => decode_display(bytes, ImageFormat::Png, "png"),
            Ok(ImageFormat::Jpeg) => decode_display(bytes, ImageFormat::Jpeg, "jpeg"),
            Ok(ImageFormat::Bmp) => decode_display(bytes, ImageFormat::Bmp, "bmp"),
            _ => Err("its format is not EXR, HDR, PNG, JPEG or BMP".to_owned()),
        }
    };
    decoded.map_err(|reason| OutputError::PictureRead { reason })
}

fn check_size(width: u32, height: u32, file: &[u8]) -> Result<(), String> {
    let pixels = width as usize * height as usize;
    let max = max_pixels(file.len());
    if pixels == 0 || pixels > max {
        return Err(format!(
            "it has {width}x{height} pixels; 1 to {max} are supported in a file of {} bytes",
            file.len()
        ));
    }
    Ok(())
}

fn limits() -> Limits {
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(16 * MAX_PIXELS as u64);
    limits
}

/// Decodes files that hold display values.
fn decode_display(
    bytes: &[u8],
    format: ImageFormat,
    name: &'static str,
) -> Result<Picture, String> {
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(limits());
    let mut decoder = reader.into_decoder().map_err(|e| e.to_string())?;
    let (width, height) = decoder.dimensions();
    check_size(width, height, bytes)?;
    let mut notes = Vec::new();
    if format == ImageFormat::Png {
        notes.extend(other_curve(bytes));
    } else if decoder.icc_profile().is_ok_and(|profile| profile.is_some()) {
        notes.push(PROFILE_NOTE.to_owned());
    }
    let image = DynamicImage::from_decoder(decoder).map_err(|e| e.to_string())?;
    if image.color().has_alpha() {
        notes.push("its alpha channel is ignored".to_owned());
    }
    let data = match image {
        DynamicImage::ImageLuma8(_)
        | DynamicImage::ImageLumaA8(_)
        | DynamicImage::ImageRgb8(_)
        | DynamicImage::ImageRgba8(_) => {
            let light: [f32; 256] = std::array::from_fn(|v| srgb_light(v as f32 / 255.0));
            image
                .into_rgb8()
                .pixels()
                .map(|p| p.0.map(|v| light[usize::from(v)]))
                .collect()
        }
        _ => image
            .into_rgb16()
            .pixels()
            .map(|p| p.0.map(|v| srgb_light(f32::from(v) / 65535.0)))
            .collect(),
    };
    Ok(Picture {
        image: Image::from_pixels(width, height, data),
        format: name,
        notes,
    })
}

const PROFILE_NOTE: &str = "its colour profile is ignored and it is read as sRGB";

/// Returns a note if the transfer curve of a PNG is not sRGB.
fn other_curve(bytes: &[u8]) -> Option<String> {
    let reader = png::Decoder::new(Cursor::new(bytes)).read_info().ok()?;
    let info = reader.info();
    if info.srgb.is_some() {
        return None;
    }
    if info.icc_profile.is_some() {
        return Some(PROFILE_NOTE.to_owned());
    }
    let gamma = info
        .gama_chunk
        .map(|g| g.into_value())
        .filter(|g| (g - 1.0 / 2.2).abs() > 0.005)?;
    Some(format!(
        "its gamma of {gamma:.4} is ignored and it is read as sRGB"
    ))
}

/// Decodes Radiance files. Values are divided by the exposure and colour correction of the header.
fn decode_hdr(bytes: &[u8]) -> Result<Picture, String> {
    let decoder = HdrDecoder::new(Cursor::new(bytes)).map_err(|e| e.to_string())?;
    let meta = decoder.metadata();
    check_size(meta.width, meta.height, bytes)?;
    let exposure = meta.exposure.unwrap_or(1.0);
    let [r, g, b] = meta
        .color_correction
        .map_or([1.0; 3], |(r, g, b)| [r, g, b]);
    let divisor = [r, g, b].map(|c| c * exposure);
    if divisor.iter().any(|d| !d.is_finite() || *d <= 0.0) {
        return Err(format!(
            "its header has an invalid exposure ({exposure}) or colour correction ({r} {g} {b})"
        ));
    }
    let pixels = DynamicImage::from_decoder(decoder)
        .map_err(|e| e.to_string())?
        .into_rgb32f();
    let data = pixels
        .pixels()
        .map(|p| [0, 1, 2].map(|c| p.0[c] / divisor[c]))
        .collect();
    Ok(Picture {
        image: Image::from_pixels(meta.width, meta.height, data),
        format: "hdr",
        notes: Vec::new(),
    })
}

/// An EXR file with all layers and channels.
type ExrFile = ExrImage<Layers<AnyChannels<FlatSamples>>>;

fn decode_exr(bytes: &[u8]) -> Result<Picture, String> {
    check_exr_sizes(bytes)?;
    let file: ExrFile = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(|e| e.to_string())?;
    let layers: Vec<Vec<String>> = file.layer_data.iter().map(channel_names).collect();
    let Some((index, channels)) = layers
        .iter()
        .enumerate()
        .find_map(|(i, names)| Some((i, rgb_channels(names)?)))
    else {
        let all: Vec<&str> = layers.iter().flatten().map(String::as_str).collect();
        return Err(format!(
            "it has no channels R, G and B, nor Y; its channels are {}",
            all.join(", ")
        ));
    };
    let layer = &file.layer_data[index];
    let (width, height) = (layer.size.0 as u32, layer.size.1 as u32);
    let mut data = vec![[0.0; 3]; width as usize * height as usize];
    for (c, channel) in channels.iter().enumerate() {
        let values = layer.channel_data.list[*channel]
            .sample_data
            .values_as_f32();
        data.iter_mut()
            .zip(values)
            .for_each(|(pixel, value)| pixel[c] = value);
    }
    let names: Vec<&str> = channels
        .iter()
        .map(|c| layers[index][*c].as_str())
        .collect();
    let mut notes = exr_notes(&file, index, &names);
    let map = primaries::of_exr(file.attributes.chromaticities);
    if let Some(map) = map.filter(|_| channels != [channels[0]; 3]) {
        primaries::convert(&mut data, map);
        notes.push(primaries::CONVERTED.to_owned());
    }
    Ok(Picture {
        image: Image::from_pixels(width, height, data),
        format: "exr",
        notes,
    })
}

/// Checks the layers' sizes from the headers, before memory is allocated for the pixels.
fn check_exr_sizes(bytes: &[u8]) -> Result<(), String> {
    let headers = exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false)
        .map_err(|e| e.to_string())?
        .headers;
    let side = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    headers.iter().try_for_each(|header| {
        let (width, height) = (side(header.layer_size.0), side(header.layer_size.1));
        check_size(width, height, bytes)
    })
}

fn channel_names(layer: &Layer<AnyChannels<FlatSamples>>) -> Vec<String> {
    layer
        .channel_data
        .list
        .iter()
        .map(|c| c.name.to_string())
        .collect()
}

/// Returns notes on properties of an EXR that are ignored when layer `index` and its channels
/// `names` are read.
fn exr_notes(file: &ExrFile, index: usize, names: &[&str]) -> Vec<String> {
    let layer = &file.layer_data[index];
    let mut notes = Vec::new();
    if names != ["R", "G", "B"] {
        notes.push(format!(
            "its channels {} are read as red, green and blue",
            names.join(", ")
        ));
    }
    if file.layer_data.len() > 1 {
        notes.push(format!(
            "it has {} layers, of which number {} is read",
            file.layer_data.len(),
            index + 1
        ));
    }
    let window = file.attributes.display_window;
    let position = layer.attributes.layer_position;
    if (window.size, window.position) != (layer.size, position) {
        notes.push(format!(
            "its data window of {}x{} pixels at {},{} is read instead of its display window \
             of {}x{} at {},{}",
            layer.size.0,
            layer.size.1,
            position.0,
            position.1,
            window.size.0,
            window.size.1,
            window.position.0,
            window.position.1
        ));
    }
    notes
}

/// Returns the indices of the red, green and blue channels: `R`, `G`, `B` without prefix, else the
/// first prefix that has all three, else `Y` three times. Case is ignored.
fn rgb_channels(names: &[String]) -> Option<[usize; 3]> {
    let find = |name: &str| names.iter().position(|n| n.eq_ignore_ascii_case(name));
    let all = |prefix: &str| -> Option<[usize; 3]> {
        Some([
            find(&format!("{prefix}R"))?,
            find(&format!("{prefix}G"))?,
            find(&format!("{prefix}B"))?,
        ])
    };
    let prefixes = names
        .iter()
        .filter_map(|n| n.rfind('.').map(|dot| &n[..=dot]));
    all("")
        .or_else(|| prefixes.into_iter().find_map(all))
        .or_else(|| find("Y").map(|y| [y; 3]))
}

#[cfg(test)]
mod tests {
    use exr::meta::attribute::Chromaticities;
    use exr::prelude::{AnyChannel, Encoding, LayerAttributes, WritableImage};

    use super::*;

    fn encoded_exr(
        names: &[&str],
        change: impl FnOnce(&mut ExrImage<Layer<AnyChannels<FlatSamples>>>),
    ) -> Vec<u8> {
        let channel = |(i, name): (usize, &&str)| {
            AnyChannel::new(*name, FlatSamples::F32(vec![i as f32, 10.0 + i as f32]))
        };
        let channels = AnyChannels::sort(names.iter().enumerate().map(channel).collect());
        let layer = Layer::new(
            (2, 1),
            LayerAttributes::default(),
            Encoding::FAST_LOSSLESS,
            channels,
        );
        let mut file = ExrImage::from_layer(layer);
        change(&mut file);
        let mut bytes = Vec::new();
        file.write().to_buffered(Cursor::new(&mut bytes)).unwrap();
        bytes
    }

    #[test]
    fn small_files_have_no_more_pixels_than_memory_for_them() {
        assert!(max_pixels(20_000) >= 4096 * 4096, "a black picture");
        assert!(max_pixels(420_000) < 12_000 * 12_000 / 4);
        // Twelve bytes for each pixel of both pictures of a comparison.
        for bytes in [1_000, 420_000, 50_000_000] {
            let pixels = 2 * max_pixels(bytes);
            assert!(12 * pixels <= (384 << 20) + 2 * 1024 * bytes, "{bytes}");
        }
    }

    #[test]
    fn a_small_file_has_few_pixels() {
        let mut bytes = Vec::new();
        image::RgbImage::new(8, 8)
            .write_to(&mut Cursor::new(&mut bytes), ImageFormat::Jpeg)
            .unwrap();
        assert_eq!(decode(&bytes).unwrap().image.data.len(), 64);
        let frame = bytes.windows(2).position(|w| w == [0xff, 0xc0]).unwrap();
        bytes[frame + 5..frame + 9].copy_from_slice(&[0x3f; 4]);
        let error = decode(&bytes).unwrap_err().to_string();
        assert!(error.contains("16191x16191 pixels"), "{error}");
        // A large picture of one grey value is an ordinary file.
        let mut bytes = Vec::new();
        image::GrayImage::new(3000, 2000)
            .write_to(&mut Cursor::new(&mut bytes), ImageFormat::Png)
            .unwrap();
        assert_eq!(decode(&bytes).unwrap().image.data.len(), 6_000_000);
    }

    #[test]
    fn exr_channels_are_found_by_name() {
        let plain = decode(&encoded_exr(&["R", "G", "B", "A"], |_| {})).unwrap();
        assert_eq!(
            (plain.format, plain.image.data),
            ("exr", vec![[0.0, 1.0, 2.0], [10.0, 11.0, 12.0]])
        );
        assert_eq!(plain.notes, Vec::<String>::new());
        let layered = decode(&encoded_exr(
            &[
                "Depth.Z",
                "View.Combined.R",
                "View.Combined.G",
                "View.Combined.B",
            ],
            |_| {},
        ));
        let layered = layered.unwrap();
        assert_eq!(layered.image.data[0], [1.0, 2.0, 3.0]);
        assert!(
            layered.notes[0].contains("View.Combined.R"),
            "{:?}",
            layered.notes
        );
        assert_eq!(
            decode(&encoded_exr(&["Y"], |_| {})).unwrap().image.data[1],
            [10.0; 3]
        );
        let e = decode(&encoded_exr(&["Z", "u"], |_| {}))
            .unwrap_err()
            .to_string();
        assert!(
            e.contains("no channels R, G and B") && e.contains("Z, u"),
            "{e}"
        );
    }

    #[test]
    fn ignored_windows_and_primaries_are_noted() {
        let cropped = decode(&encoded_exr(&["R", "G", "B"], |file| {
            file.attributes.display_window.size = exr::math::Vec2(20, 10);
            file.layer_data.attributes.layer_position = exr::math::Vec2(3, 4);
            let wide = exr::math::Vec2(0.7347, 0.2653);
            let [green, blue, white] = [[0.0, 1.0], [0.0001, -0.077], [0.32168, 0.33767]]
                .map(|[x, y]| exr::math::Vec2(x, y));
            file.attributes.chromaticities = Some(Chromaticities {
                red: wide,
                green,
                blue,
                white,
            });
        }));
        let notes = cropped.unwrap().notes;
        assert!(
            notes[0].contains("2x1 pixels at 3,4") && notes[0].contains("20x10"),
            "{notes:?}"
        );
        assert!(notes[1].contains("primaries"), "{notes:?}");
    }

    fn encoded_png(change: impl FnOnce(&mut png::Encoder<&mut Vec<u8>>)) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 1, 1);
        encoder.set_color(png::ColorType::Rgb);
        change(&mut encoder);
        encoder
            .write_header()
            .unwrap()
            .write_image_data(&[0, 188, 255])
            .unwrap();
        bytes
    }

    #[test]
    fn display_values_become_light() {
        let picture = decode(&encoded_png(|e| {
            e.set_source_srgb(png::SrgbRenderingIntent::Perceptual)
        }))
        .unwrap();
        let [r, g, b] = picture.image.data[0];
        assert!(
            r == 0.0 && (g - 0.502_886).abs() < 1e-5 && b == 1.0,
            "{r} {g} {b}"
        );
        assert_eq!((picture.format, picture.notes.len()), ("png", 0));
        let note = |change: fn(&mut png::Encoder<&mut Vec<u8>>)| {
            decode(&encoded_png(change)).unwrap().notes.join(" ")
        };
        assert!(
            note(|e| e.set_source_gamma(png::ScaledFloat::new(1.0))).contains("gamma of 1.0000")
        );
        assert_eq!(
            note(|e| e.set_source_gamma(png::ScaledFloat::new(0.45455))),
            ""
        );
        assert_eq!(note(|_| {}), "");
    }

    #[test]
    fn deep_grey_and_transparent_pngs_are_read() {
        let encode = |image: DynamicImage| {
            let mut bytes = Vec::new();
            image
                .write_to(&mut Cursor::new(&mut bytes), ImageFormat::Png)
                .unwrap();
            decode(&bytes).unwrap()
        };
        let deep = encode(DynamicImage::ImageLuma16(image::ImageBuffer::from_pixel(
            1,
            1,
            image::Luma([32_896]),
        )));
        let eight = encode(DynamicImage::ImageLuma8(image::ImageBuffer::from_pixel(
            1,
            1,
            image::Luma([128]),
        )));
        // 32896 / 65535 is 128 / 255.
        assert_eq!(deep.image, eight.image);
        let clear = encode(DynamicImage::ImageRgba8(image::ImageBuffer::from_pixel(
            1,
            1,
            image::Rgba([255, 0, 0, 9]),
        )));
        assert_eq!(clear.image.data, [[1.0, 0.0, 0.0]]);
        assert!(clear.notes[0].contains("alpha"));
    }

    #[test]
    fn radiance_files_are_radiance_again() {
        let pixels = [[128u8, 64, 32, 129], [0, 0, 0, 0]];
        let file = |header: &str| {
            let head = format!("#?RADIANCE\n{header}FORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n");
            decode(&[head.as_bytes(), pixels.as_flattened()].concat())
        };
        let plain = file("").unwrap();
        assert_eq!(
            (plain.format, plain.image.data[0]),
            ("hdr", [1.0, 0.5, 0.25])
        );
        assert_eq!(
            file("EXPOSURE=2\nCOLORCORR=1 1 0.5\n").unwrap().image.data[0],
            [0.5, 0.25, 0.25]
        );
        assert!(
            file("EXPOSURE=0\n")
                .unwrap_err()
                .to_string()
                .contains("invalid exposure (0)")
        );
    }

    #[test]
    fn damaged_and_foreign_files_are_errors() {
        let good = [encoded_png(|_| {}), encoded_exr(&["R", "G", "B"], |_| {})];
        for whole in &good {
            for cut in [0, 3, 20, whole.len() / 2] {
                assert!(
                    matches!(decode(&whole[..cut]), Err(OutputError::PictureRead { .. })),
                    "{cut} bytes"
                );
            }
        }
        assert!(
            decode(b"a text")
                .unwrap_err()
                .to_string()
                .contains("EXR, HDR, PNG")
        );
        let mut huge = good[0].clone();
        huge[16] = 0x7f;
        assert!(decode(&huge).is_err(), "a header that claims 2^31 columns");
    }
}
