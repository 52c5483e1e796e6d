//! OpenEXR files: linear `f32` RGB with metadata as text attributes, and layers in further channels.
//!
//! Files are written as tiles of 64 x 64 pixels with ZIP compression. Equal input gives
//! equal bytes. Reading uses [`openexr`], which scenes use too.

use std::collections::BTreeMap;
use std::io::Cursor;

use exr::meta::attribute::{AttributeValue, Text};
use exr::prelude::{
    AnyChannel, AnyChannels, Compression, Encoding, FlatSamples, Image as ExrImage,
    ImageAttributes, IntegerBounds, Layer, LayerAttributes, LineOrder, WritableImage,
};

use super::{OutputError, PREFIX, check_shape};
use lumbre_light::film::Image;
use lumbre_light::film::layer::LayerImage;
use lumbre_scene_io::load::openexr;

/// Content of a picture's file beside its pixels and text, under the names that pbrt-v4 writes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Extras<'a> {
    /// Layers of the same size, stored in the channels of
    /// [`LayerRow::exr`](lumbre_light::film::layer::LayerRow::exr); those without are left out.
    pub layers: &'a [LayerImage],
    /// Samples per pixel: the attribute `samplesPerPixel`.
    pub samples: Option<u64>,
    /// Render time in seconds: the attribute `renderTimeSeconds`.
    pub render_s: Option<f64>,
}

/// Encodes an image as EXR with the channels R, G and B as `f32`. Each pair of `meta` becomes a
/// text attribute `lumbre.<key>`. Keys must be unique and not empty.
///
/// # Errors
/// Returns an error if the image has no pixels, a key is invalid, or the encoder fails.
pub fn encode(image: &Image, meta: &[(String, String)]) -> Result<Vec<u8>, OutputError> {
    encode_with(image, &Extras::default(), meta)
}

/// Encodes an image like [`encode`], with `extras` in the same file. The text attribute
/// `lumbre.film.<name>` of a layer has its channels with their meaning: `Albedo.R = red, ...`.
///
/// # Errors
/// Returns the errors of [`encode`], and one for a layer of another size.
pub fn encode_with(
    image: &Image,
    extras: &Extras<'_>,
    meta: &[(String, String)],
) -> Result<Vec<u8>, OutputError> {
    let fail = |reason: String| OutputError::ExrWrite { reason };
    check_shape(image)?;
    let size = (image.width as usize, image.height as usize);
    let mut channels: Vec<_> = RGB
        .iter()
        .zip(0..)
        .map(|(n, c)| channel(n, image, c))
        .collect();
    let mut texts = meta.to_vec();
    for LayerImage { film, image } in extras.layers {
        let row = film.layer.row();
        if row.exr.is_empty() {
            continue;
        }
        if (image.width as usize, image.height as usize) != size {
            return Err(fail(format!(
                "the layer `{}` has another size",
                film.name()
            )));
        }
        channels.extend(
            row.exr
                .iter()
                .zip(0..)
                .map(|(name, c)| channel(name, image, c)),
        );
        let meanings = row.exr.iter().zip(row.channels);
        let meanings: Vec<String> = meanings
            .map(|(name, is)| format!("{name} = {is}"))
            .collect();
        texts.push((format!("film.{}", film.name()), meanings.join(", ")));
    }
    let mut attributes = LayerAttributes::default();
    for (key, value) in &texts {
        if key.is_empty() || key.contains('\0') {
            return Err(fail(format!("`{key}` is not a valid attribute name")));
        }
        let name = Text::from_slice_unchecked(format!("{PREFIX}{key}").as_bytes());
        let text = AttributeValue::Text(Text::from_slice_unchecked(value.as_bytes()));
        if attributes.other.insert(name, text).is_some() {
            return Err(fail(format!("two attributes are named `{key}`")));
        }
    }
    let samples = extras.samples.map(|n| i32::try_from(n).unwrap_or(i32::MAX));
    let numbers = [
        ("samplesPerPixel", samples.map(AttributeValue::I32)),
        (
            "renderTimeSeconds",
            extras.render_s.map(|s| AttributeValue::F32(s as f32)),
        ),
    ];
    for (name, value) in numbers {
        attributes
            .other
            .extend(value.map(|value| (Text::from(name), value)));
    }
    let channels = AnyChannels::sort(channels.into_iter().collect());
    let file = ExrImage::from_layer(Layer::new(size, attributes, ENCODING, channels));
    let mut bytes = Vec::new();
    file.write()
        .non_parallel()
        .to_buffered(Cursor::new(&mut bytes))
        .map_err(|e| fail(e.to_string()))?;
    sort_attributes(&mut bytes)
        .ok_or_else(|| fail("the encoder wrote a header in an unknown format".to_owned()))?;
    Ok(bytes)
}

/// Names of the colour channels.
const RGB: [&str; 3] = ["R", "G", "B"];

/// Compression and order of all files; tiles have 64 x 64 pixels.
const ENCODING: Encoding = Encoding {
    compression: Compression::ZIP16,
    line_order: LineOrder::Increasing,
    ..Encoding::FAST_LOSSLESS
};

/// Returns a channel of a file with the values of channel `c` of an image.
fn channel(name: &str, image: &Image, c: usize) -> AnyChannel<FlatSamples> {
    let samples: Vec<f32> = image.data.iter().map(|pixel| pixel[c]).collect();
    AnyChannel::new(name, FlatSamples::F32(samples))
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
    let mut made = Vec::with_capacity(layers.len());
    for (name, image) in layers {
        check_shape(&image)?;
        if (image.width as usize, image.height as usize) != size {
            return Err(fail(format!(
                "the size of layer `{name}` differs from that of the first layer"
            )));
        }
        let channels = RGB
            .iter()
            .zip(0..)
            .map(|(name, c)| channel(name, &image, c));
        let channels = AnyChannels::sort(channels.collect());
        let attributes = LayerAttributes::named(Text::from_slice_unchecked(name.as_bytes()));
        made.push(Layer::new(size, attributes, ENCODING, channels));
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
    let (image, texts) = openexr::decode(bytes, max_pixels(bytes))
        .map_err(|reason| OutputError::ExrRead { reason })?;
    let without_prefix = |(name, text): (String, String)| match name.strip_prefix(PREFIX) {
        Some(key) => (key.to_owned(), text),
        None => (name, text),
    };
    let meta: BTreeMap<String, String> = texts.into_iter().map(without_prefix).collect();
    Ok((image, meta.into_iter().collect()))
}

/// Decodes a group of channels, such as `Albedo`, or the single channel of this name.
///
/// # Errors
/// Returns the errors of [`decode`], and one if the file has no such channels.
pub fn decode_group(bytes: &[u8], group: &str) -> Result<Image, OutputError> {
    let images = openexr::decode_channels(bytes, max_pixels(bytes), &[group]);
    images
        .map(|mut images| images.remove(0))
        .map_err(|reason| OutputError::ExrRead { reason })
}

/// Returns the greatest number of pixels of a file.
fn max_pixels(bytes: &[u8]) -> usize {
    (bytes.len() * 2048 + (1 << 20)).min(1 << 28)
}

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::path::PathBuf;

    use exr::prelude::{ReadChannels, ReadLayers, SpecificChannels, f16, read};
    use lumbre_light::film::layer::{Layer as Kind, LayerLayout};

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

    /// Layers whose values tell film, pixel and channel apart.
    fn films(layers: &[Kind]) -> Vec<LayerImage> {
        let layout = LayerLayout::new(layers, 1, 1).unwrap();
        let films = layout.films().iter().zip(1..);
        let image = |k: i32| {
            Image::from_fn(37, 41, |x, y| {
                [0.0, 0.25, 0.5].map(|c| (k * 10_000 + (y * 37 + x) as i32) as f32 + c)
            })
        };
        films
            .map(|(film, k)| LayerImage {
                film: *film,
                image: image(k),
            })
            .collect()
    }

    #[test]
    fn layers_are_channels_of_the_picture_under_the_names_of_pbrt() {
        let layers = films(&[
            Kind::Depth,
            Kind::Albedo,
            Kind::Normal,
            Kind::Position,
            Kind::Uv,
            Kind::PrimIndex,
            Kind::Variance,
        ]);
        let extras = Extras {
            layers: &layers,
            samples: Some(64),
            render_s: Some(1.5),
        };
        let bytes = encode_with(&picture(), &extras, &meta()).unwrap();
        let file = read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .all_layers()
            .all_attributes();
        let file = file.from_buffered(Cursor::new(&bytes)).unwrap();
        let names: Vec<String> = file.layer_data[0]
            .channel_data
            .list
            .iter()
            .map(|c| c.name.to_string())
            .collect();
        let expected = "Albedo.B Albedo.G Albedo.R B G Ns.X Ns.Y Ns.Z P.X P.Y P.Z PrimIndex R Variance.B Variance.G Variance.R u v";
        assert_eq!(names.join(" "), expected);
        let attributes = &file.layer_data[0].attributes.other;
        let attribute = |name: &str| attributes[&Text::from(name)].clone();
        assert_eq!(attribute("samplesPerPixel"), AttributeValue::I32(64));
        assert_eq!(attribute("renderTimeSeconds"), AttributeValue::F32(1.5));
        let uv = AttributeValue::Text(Text::from("u = u, v = v"));
        assert_eq!(attribute("lumbre.film.uv"), uv);
        let (image, _) = decode(&bytes).unwrap();
        assert_eq!(image, picture(), "layers do not change the picture");
        for (group, layer) in [("Albedo", 1), ("Ns", 2), ("P", 3), ("Variance", 6)] {
            assert_eq!(
                decode_group(&bytes, group).unwrap(),
                layers[layer].image,
                "{group}"
            );
        }
        let index = decode_group(&bytes, "PrimIndex").unwrap();
        assert_eq!(index.at(3, 2)[0], layers[5].image.at(3, 2)[0]);
        assert!(decode_group(&bytes, "Rays").is_err());
        let plain = encode(&picture(), &meta()).unwrap();
        assert!(decode_group(&plain, "Albedo").is_err());
        let other = [LayerImage {
            image: Image::new(2, 2),
            ..layers[1].clone()
        }];
        let extras = Extras {
            layers: &other,
            ..extras
        };
        assert!(
            encode_with(&picture(), &extras, &[]).is_err(),
            "another size"
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
