//! OpenEXR files: linear `f32` RGB with metadata as text attributes.
//!
//! Files are written as tiles of 64 x 64 pixels with ZIP compression. Equal input gives
//! equal bytes. Reading uses [`openexr`], which scenes use too.

use std::collections::BTreeMap;
use std::io::Cursor;

use exr::meta::attribute::{AttributeValue, Text};
use exr::prelude::{
    AnyChannel, AnyChannels, Compression, Encoding, FlatSamples, Image as ExrImage,
    ImageAttributes, IntegerBounds, Layer, LayerAttributes, LineOrder, SpecificChannels,
    WritableImage,
};

use super::{OutputError, PREFIX, check_shape};
use lumbre_light::film::Image;
use lumbre_scene_io::load::openexr;

/// Encodes an image as EXR with the channels R, G and B as `f32`. Each pair of `meta` becomes a
/// text attribute `lumbre.<key>`. Keys must be unique and not empty.
///
/// # Errors
/// Returns an error if the image has no pixels, a key is invalid, or the encoder fails.
pub fn encode(image: &Image, meta: &[(String, String)]) -> Result<Vec<u8>, OutputError> {
    let fail = |reason: String| OutputError::ExrWrite { reason };
    check_shape(image)?;
    let mut attributes = LayerAttributes::default();
    for (key, value) in meta {
        if key.is_empty() || key.contains('\0') {
            return Err(fail(format!("`{key}` is not a valid attribute name")));
        }
        let name = Text::from_slice_unchecked(format!("{PREFIX}{key}").as_bytes());
        let text = AttributeValue::Text(Text::from_slice_unchecked(value.as_bytes()));
        if attributes.other.insert(name, text).is_some() {
            return Err(fail(format!("two attributes are named `{key}`")));
        }
    }
    let encoding = Encoding {
        compression: Compression::ZIP16,
        line_order: LineOrder::Increasing,
        ..Encoding::default()
    };
    let size = (image.width as usize, image.height as usize);
    let channels = SpecificChannels::rgb(|at: exr::math::Vec2<usize>| {
        let [r, g, b] = image.data[at.y() * size.0 + at.x()];
        (r, g, b)
    });
    let file = ExrImage::from_layer(Layer::new(size, attributes, encoding, channels));
    let mut bytes = Vec::new();
    file.write()
        .non_parallel()
        .to_buffered(Cursor::new(&mut bytes))
        .map_err(|e| fail(e.to_string()))?;
    sort_attributes(&mut bytes)
        .ok_or_else(|| fail("the encoder wrote a header in an unknown format".to_owned()))?;
    Ok(bytes)
}

/// Encodes images of equal size as one EXR file, each as a named layer with channels R, G and B.
///
/// # Errors
/// Returns an error if there are no images, an image has no pixels, the sizes differ, or the
/// encoder fails.
pub fn encode_layers(layers: Vec<(String, Image)>) -> Result<Vec<u8>, OutputError> {
    let fail = |reason: String| OutputError::ExrWrite { reason };
    let Some(size) = layers
        .first()
        .map(|(_, first)| (first.width as usize, first.height as usize))
    else {
        return Err(fail("there are no layers to write".to_owned()));
    };
    let encoding = Encoding {
        compression: Compression::ZIP16,
        line_order: LineOrder::Increasing,
        ..Encoding::default()
    };
    let mut made = Vec::with_capacity(layers.len());
    for (name, image) in layers {
        check_shape(&image)?;
        if (image.width as usize, image.height as usize) != size {
            return Err(fail(format!(
                "the size of layer `{name}` differs from that of the first layer"
            )));
        }
        let channel = |name: &str, c: usize| {
            let samples: Vec<f32> = image.data.iter().map(|pixel| pixel[c]).collect();
            AnyChannel::new(name, FlatSamples::F32(samples))
        };
        let channels = AnyChannels::sort(
            [channel("R", 0), channel("G", 1), channel("B", 2)]
                .into_iter()
                .collect(),
        );
        let attributes = LayerAttributes::named(Text::from_slice_unchecked(name.as_bytes()));
        made.push(Layer::new(size, attributes, encoding, channels));
    }
    let attributes = ImageAttributes::new(IntegerBounds::from_dimensions(size));
    let mut bytes = Vec::new();
    let file = ExrImage::from_layers(attributes, made);
    file.write()
        .non_parallel()
        .to_buffered(Cursor::new(&mut bytes))
        .map_err(|e| fail(e.to_string()))?;
    Ok(bytes)
}

/// Sorts the header's attributes by name, since the encoder stores them in a hash map of random
/// order. The header's length does not change, so the offsets that follow it stay valid. Returns
/// `None` if the header cannot be parsed.
fn sort_attributes(bytes: &mut [u8]) -> Option<()> {
    let start = 8; // magic number and version
    let mut attributes: Vec<&[u8]> = Vec::new();
    let mut end = start;
    while *bytes.get(end)? != 0 {
        let rest = &bytes[end..];
        let name = rest.iter().position(|b| *b == 0)? + 1;
        let kind = rest[name..].iter().position(|b| *b == 0)? + 1;
        let length = rest.get(name + kind..)?.first_chunk::<4>()?;
        let length = name + kind + 4 + usize::try_from(i32::from_le_bytes(*length)).ok()?;
        attributes.push(rest.get(..length)?);
        end += length;
    }
    attributes.sort();
    let sorted = attributes.concat();
    bytes[start..end].copy_from_slice(&sorted);
    Some(())
}

/// Decodes the first layer with channels R, G and B, and all text attributes ordered by key. The
/// prefix of Lumbre's own keys is removed, so that the metadata given to [`encode`] is returned
/// unchanged.
///
/// # Errors
/// Returns an error if the file is not an EXR with RGB channels, is damaged, or has more than 2^28
/// pixels, or more than 2^20 and 2048 for each byte of the file, which is more than the compression
/// of pictures of one colour achieves.
pub fn decode(bytes: &[u8]) -> Result<(Image, Vec<(String, String)>), OutputError> {
    let max_pixels = (bytes.len() * 2048 + (1 << 20)).min(1 << 28);
    let (image, texts) =
        openexr::decode(bytes, max_pixels).map_err(|reason| OutputError::ExrRead { reason })?;
    let without_prefix = |(name, text): (String, String)| match name.strip_prefix(PREFIX) {
        Some(key) => (key.to_owned(), text),
        None => (name, text),
    };
    let meta: BTreeMap<String, String> = texts.into_iter().map(without_prefix).collect();
    Ok((image, meta.into_iter().collect()))
}

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::path::PathBuf;

    use exr::prelude::f16;

    use super::*;

    fn picture() -> Image {
        Image::from_fn(37, 41, |x, y| {
            [x as f32 * 0.25, 1e-6 * y as f32, (x * y) as f32 * 13.7]
        })
    }

    fn meta() -> Vec<(String, String)> {
        let pairs = [
            ("device", "cpu, 2 threads"),
            ("a_key_longer_than_thirty_one_letters", "yes"),
            ("note", "2 µs × 3"),
        ];
        let mut meta: Vec<_> = pairs
            .iter()
            .map(|(k, v)| ((*k).to_owned(), (*v).to_owned()))
            .collect();
        meta.sort();
        meta
    }

    #[test]
    fn pixels_and_metadata_come_back_exactly() {
        let (image, back) = decode(&encode(&picture(), &meta()).unwrap()).unwrap();
        assert_eq!(image, picture());
        assert_eq!(back, meta());
    }

    #[test]
    fn special_values_survive() {
        let image = Image::from_fn(2, 1, |x, _| {
            if x == 0 {
                [f32::NAN, f32::INFINITY, -0.0]
            } else {
                [-3.5; 3]
            }
        });
        let (back, _) = decode(&encode(&image, &[]).unwrap()).unwrap();
        assert!(back.at(0, 0)[0].is_nan());
        assert_eq!(
            (back.at(0, 0)[1], back.at(1, 0)),
            (f32::INFINITY, [-3.5; 3])
        );
    }

    #[test]
    fn equal_input_gives_equal_bytes() {
        let mut backwards = meta();
        backwards.reverse();
        let first = encode(&picture(), &meta()).unwrap();
        for _ in 0..8 {
            assert_eq!(encode(&picture(), &backwards).unwrap(), first);
        }
    }

    #[test]
    fn layers_have_their_names_and_pixels_and_the_same_bytes_every_time() {
        let frames = || {
            (0..3).map(|i| {
                (
                    format!("bin-{i}"),
                    Image::from_fn(5, 4, |x, y| [x as f32, y as f32, i as f32]),
                )
            })
        };
        let bytes = encode_layers(frames().collect()).unwrap();
        assert_eq!(encode_layers(frames().collect()).unwrap(), bytes);
        let names = ["bin-0", "bin-1", "bin-2"];
        let back = openexr::decode_channels(&bytes, 20, &names).unwrap();
        let expected = frames().map(|(_, image)| image);
        assert_eq!(back, expected.collect::<Vec<_>>());
        assert_eq!(
            decode(&bytes).unwrap().0,
            frames().next().unwrap().1,
            "the first layer is decoded"
        );
        assert!(encode_layers(Vec::new()).is_err());
        assert!(
            encode_layers(vec![
                ("a".into(), Image::new(2, 2)),
                ("b".into(), Image::new(2, 3))
            ])
            .is_err()
        );
    }

    #[test]
    fn half_floats_alpha_and_piz_are_read() {
        let channels = SpecificChannels::rgba(|at: exr::math::Vec2<usize>| {
            (
                f16::from_f32(at.x() as f32),
                f16::from_f32(at.y() as f32),
                f16::from_f32(0.5),
                f16::ONE,
            )
        });
        let encoding = Encoding {
            compression: Compression::PIZ,
            ..Encoding::default()
        };
        let file = ExrImage::from_layer(Layer::new(
            (9, 5),
            LayerAttributes::named("main"),
            encoding,
            channels,
        ));
        let mut bytes = Vec::new();
        file.write()
            .non_parallel()
            .to_buffered(Cursor::new(&mut bytes))
            .unwrap();
        let (image, _) = decode(&bytes).unwrap();
        assert_eq!(
            image,
            Image::from_fn(9, 5, |x, y| [x as f32, y as f32, 0.5])
        );
    }

    #[test]
    fn damaged_and_foreign_bytes_are_errors() {
        let whole = encode(&picture(), &meta()).unwrap();
        for bytes in [
            &b""[..],
            b"not an image",
            &whole[..whole.len() / 2],
            &whole[..40],
        ] {
            assert!(
                matches!(decode(bytes), Err(OutputError::ExrRead { .. })),
                "{} bytes",
                bytes.len()
            );
        }
        let empty = encode(&Image::new(0, 4), &[]).unwrap_err();
        assert_eq!(
            empty,
            OutputError::Shape {
                width: 0,
                height: 4,
                pixels: 0
            }
        );
        let twice = [
            ("a".to_owned(), "1".to_owned()),
            ("a".to_owned(), "2".to_owned()),
        ];
        assert!(encode(&picture(), &twice).is_err());
    }

    #[test]
    fn mitsuba_references_have_the_mean_that_their_json_states() {
        let shared = std::env::var_os("LUMBRE_SHARED").map_or_else(
            || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared"),
            PathBuf::from,
        );
        let Ok(folder) = std::fs::read_dir(shared.join("references")) else {
            let line = format!(
                "SKIPPED: no folder {}\n",
                shared.join("references").display()
            );
            // Past the test harness, which keeps what tests that pass print.
            std::io::stderr().write_all(line.as_bytes()).unwrap();
            return;
        };
        let mut compared = 0;
        for json in folder
            .map(|entry| entry.unwrap().path())
            .filter(|p| p.extension().is_some_and(|e| e == "json"))
        {
            let facts: serde_json::Value =
                serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap();
            let exr = json.with_extension("exr");
            let Some(stated) = facts["mean_rgb"].as_array().filter(|_| exr.exists()) else {
                continue;
            };
            let (image, _) = decode(&std::fs::read(&exr).unwrap()).unwrap();
            for (mean, stated) in image.mean().iter().zip(stated) {
                let stated = stated.as_f64().unwrap();
                assert!(
                    (mean - stated).abs() < 1e-5 * stated.max(1e-3),
                    "{}: {mean} {stated}",
                    exr.display()
                );
            }
            compared += 1;
        }
        assert!(
            compared > 0,
            "no reference with an image in {}",
            shared.display()
        );
    }
}
