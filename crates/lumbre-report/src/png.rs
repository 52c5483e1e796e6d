//! PNG files: tone-mapped pictures with 8 bits per channel and metadata as text chunks.

use super::{OutputError, PREFIX, check_shape};
use lumbre_light::film::Image;
use lumbre_metrics::map::ErrorMap;
use lumbre_metrics::tonemap::Tonemap;

/// Encodes an image as 8-bit RGB PNG after applying `tonemap`, marked as sRGB. Each pair of `meta`
/// becomes a text chunk `lumbre.<key>` (`tEXt`, or `iTXt` if the text is not Latin-1). NaN becomes
/// black.
///
/// # Errors
/// Returns an error if the image has no pixels, a key is not a PNG keyword (1 to 79 Latin-1
/// characters), or the encoder fails.
pub fn encode(
    image: &Image,
    tonemap: Tonemap,
    meta: &[(String, String)],
) -> Result<Vec<u8>, OutputError> {
    check_shape(image)?;
    let display = tonemap.apply(image);
    let bytes: Vec<u8> = display
        .data
        .as_flattened()
        .iter()
        .map(|x| (x * 255.0).round() as u8)
        .collect();
    encode_bytes(
        [image.width, image.height],
        png::ColorType::Rgb,
        &bytes,
        meta,
    )
}

/// Encodes an error map as 8-bit RGB PNG in its colours, scaled to the range `scale`, with `meta`
/// as in [`encode`].
///
/// # Errors
/// Returns the errors of [`encode`].
pub fn encode_map(
    map: &ErrorMap,
    scale: [f32; 2],
    meta: &[(String, String)],
) -> Result<Vec<u8>, OutputError> {
    let (width, height, pixels) = (map.width, map.height, map.values.len());
    if pixels == 0 || pixels != width as usize * height as usize {
        return Err(OutputError::Shape {
            width,
            height,
            pixels,
        });
    }
    encode_bytes(
        [width, height],
        png::ColorType::Rgb,
        map.coloured(scale).as_flattened(),
        meta,
    )
}

/// Returns the text chunks of a PNG as pairs of keyword and text, in file order. The prefix of
/// Lumbre's own keys is removed.
///
/// # Errors
/// Returns an error if the bytes are not a PNG or are damaged.
pub fn texts(bytes: &[u8]) -> Result<Vec<(String, String)>, OutputError> {
    let fail = |e: png::DecodingError| OutputError::PictureRead {
        reason: e.to_string(),
    };
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes))
        .read_info()
        .map_err(fail)?;
    reader.finish().map_err(fail)?;
    let info = reader.info();
    let latin = info
        .uncompressed_latin1_text
        .iter()
        .map(|t| (t.keyword.clone(), t.text.clone()));
    let utf8 = info
        .utf8_text
        .iter()
        .filter_map(|t| Some((t.keyword.clone(), t.get_text().ok()?)));
    let plain = |(key, text): (String, String)| {
        (
            key.strip_prefix(PREFIX).map(str::to_owned).unwrap_or(key),
            text,
        )
    };
    Ok(latin.chain(utf8).map(plain).collect())
}

/// Encodes 8-bit samples in row order as PNG. The samples already have the sRGB transfer curve.
pub(super) fn encode_bytes(
    [width, height]: [u32; 2],
    colour: png::ColorType,
    bytes: &[u8],
    meta: &[(String, String)],
) -> Result<Vec<u8>, OutputError> {
    let fail = |e: png::EncodingError| OutputError::PngWrite {
        reason: e.to_string(),
    };
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, width, height);
    encoder.set_color(colour);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    for (key, value) in meta {
        // The encoder checks text only when it writes, so the chunk type is chosen here.
        let latin = value.chars().all(|c| c != '\0' && u32::from(c) < 256);
        let chunk = if latin {
            encoder.add_text_chunk(format!("{PREFIX}{key}"), value.clone())
        } else {
            encoder.add_itxt_chunk(format!("{PREFIX}{key}"), value.clone())
        };
        chunk.map_err(fail)?;
    }
    let mut writer = encoder.write_header().map_err(fail)?;
    writer.write_image_data(bytes).map_err(fail)?;
    writer.finish().map_err(fail)?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    const SRGB: Tonemap = Tonemap::Srgb { exposure: 0.0 };

    fn pairs(pairs: &[(&str, &str)]) -> Vec<(String, String)> {
        pairs
            .iter()
            .map(|(k, v)| ((*k).to_owned(), (*v).to_owned()))
            .collect()
    }

    #[test]
    fn pixels_are_tone_mapped_and_rounded() {
        let image = Image::from_fn(2, 2, |x, y| match (x, y) {
            (0, 0) => [0.0, 0.5, 1.0],
            (1, 0) => [-1.0, 2.0, f32::INFINITY],
            (0, 1) => [f32::NAN, 0.214_041_14, 0.0],
            _ => [0.001; 3],
        });
        let bytes = encode(&image, SRGB, &[]).unwrap();
        let decoded = image::load_from_memory(&bytes).unwrap().to_rgb8();
        assert_eq!(decoded.dimensions(), (2, 2));
        assert_eq!(
            decoded.into_raw(),
            [0, 188, 255, 0, 255, 255, 0, 128, 0, 3, 3, 3]
        );
    }

    #[test]
    fn metadata_is_inside() {
        let meta = pairs(&[("run", "3f9a"), ("render_s", "1.25"), ("note", "σ = 0.5")]);
        let bytes = encode(&Image::new(3, 2), SRGB, &meta).unwrap();
        let mut reader = png::Decoder::new(Cursor::new(&bytes)).read_info().unwrap();
        reader.finish().unwrap();
        let info = reader.info();
        let latin: Vec<_> = info
            .uncompressed_latin1_text
            .iter()
            .map(|t| (t.keyword.clone(), t.text.clone()))
            .collect();
        assert_eq!(
            latin,
            pairs(&[("lumbre.run", "3f9a"), ("lumbre.render_s", "1.25")])
        );
        let utf8 = &info.utf8_text[0];
        assert_eq!(
            (utf8.keyword.as_str(), utf8.get_text().unwrap().as_str()),
            ("lumbre.note", "σ = 0.5")
        );
        assert!(info.srgb.is_some());
        assert_eq!(texts(&bytes).unwrap(), meta);
        assert!(texts(&bytes[..40]).is_err() && texts(b"no PNG").is_err());
    }

    #[test]
    fn error_maps_are_written_in_their_colours() {
        let colours = lumbre_metrics::map::Colours::Magma;
        let mut map = ErrorMap {
            width: 3,
            height: 1,
            values: vec![0.0, 1.0, f32::NAN],
            colours,
            top: None,
        };
        let bytes = encode_map(&map, [0.0, 1.0], &pairs(&[("metric", "mae")])).unwrap();
        let decoded = image::load_from_memory(&bytes)
            .unwrap()
            .to_rgb8()
            .into_raw();
        assert_eq!(decoded, [0, 0, 4, 252, 253, 191, 0, 255, 0]);
        map.height = 2;
        assert!(matches!(
            encode_map(&map, [0.0, 1.0], &[]),
            Err(OutputError::Shape { .. })
        ));
    }

    #[test]
    fn invalid_images_and_keys_are_errors() {
        assert!(matches!(
            encode(&Image::new(0, 0), SRGB, &[]),
            Err(OutputError::Shape { .. })
        ));
        let long = "k".repeat(80);
        assert!(matches!(
            encode(&Image::new(1, 1), SRGB, &pairs(&[(&long, "")])),
            Err(OutputError::PngWrite { .. })
        ));
    }
}
