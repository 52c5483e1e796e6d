//! Encodes layers as PNG for viewing.

use super::{OutputError, check_shape, png};
use lumbre_light::film::Image;
use lumbre_light::film::layer::{LayerDisplay, LayerImage};
use lumbre_light::math::rng::pcg4d;
use lumbre_metrics::tonemap::Tonemap;

/// Colour map from 0 to the maximum as evenly spaced 8-bit sRGB values: black, violet, red, orange,
/// white. Lightness increases monotonically, so that a greyscale print preserves the order.
const HEAT: [[f32; 3]; 7] = [
    [0.0, 0.0, 0.0],
    [44.0, 17.0, 95.0],
    [121.0, 28.0, 109.0],
    [201.0, 62.0, 71.0],
    [244.0, 131.0, 34.0],
    [251.0, 208.0, 88.0],
    [255.0, 255.0, 236.0],
];

/// Encodes a layer as PNG. Radiance is tone-mapped by `display`. Scalars use a colour map from 0 to
/// their maximum, which is stored as `lumbre.scale` in the metadata. Reflectance uses the sRGB
/// transfer curve. Directions are shown as `0.5 n + 0.5`, numbers of any range from the least to the
/// greatest of their channel, and every index in a colour of its own.
///
/// # Errors
/// Returns the errors of [`png::encode`].
pub fn encode(
    layer: &LayerImage,
    display: Tonemap,
    meta: &[(String, String)],
) -> Result<Vec<u8>, OutputError> {
    check_shape(&layer.image)?;
    let shown = display_values(layer, display);
    let bytes: Vec<u8> = shown
        .data
        .as_flattened()
        .iter()
        .map(|x| (x * 255.0).round() as u8)
        .collect();
    let mut meta = meta.to_vec();
    if layer.film.layer.row().display == LayerDisplay::Heat {
        meta.push((
            "scale".to_owned(),
            format!("0 to {}", maximum(&layer.image)),
        ));
    }
    png::encode_bytes(
        [shown.width, shown.height],
        ::png::ColorType::Rgb,
        &bytes,
        &meta,
    )
}

/// Returns display values in 0..=1, with the transfer curve of the display applied.
pub fn display_values(layer: &LayerImage, display: Tonemap) -> Image {
    let image = &layer.image;
    let each = |f: &dyn Fn([f32; 3]) -> [f32; 3]| {
        Image::from_pixels(
            image.width,
            image.height,
            image.data.iter().map(|p| f(*p)).collect(),
        )
    };
    match layer.film.layer.row().display {
        LayerDisplay::Radiance => display.apply(image),
        LayerDisplay::Reflectance => Tonemap::Srgb { exposure: 0.0 }.apply(image),
        LayerDisplay::Direction => each(&|p| p.map(|x| (0.5 * x + 0.5).clamp(0.0, 1.0))),
        LayerDisplay::Heat => {
            let scale = maximum(image);
            each(&|[x, ..]| heat_colour(if scale > 0.0 { x / scale } else { 0.0 }))
        }
        LayerDisplay::Range => {
            let ranges = [0, 1, 2].map(|c| {
                let values = image.data.iter().map(|p| p[c]);
                let low = values.clone().fold(f32::INFINITY, f32::min);
                (
                    low,
                    (values.fold(low, f32::max) - low).max(f32::MIN_POSITIVE),
                )
            });
            each(&|p| [0, 1, 2].map(|c| ((p[c] - ranges[c].0) / ranges[c].1).clamp(0.0, 1.0)))
        }
        LayerDisplay::Index => each(&|[index, ..]| index_colour(index)),
    }
}

fn maximum(image: &Image) -> f32 {
    image.data.iter().map(|p| p[0]).fold(0.0, f32::max)
}

/// Returns the colour of an index, a hash of it; -1 is black.
fn index_colour(index: f32) -> [f32; 3] {
    if index < 0.0 {
        return [0.0; 3];
    }
    let [r, g, b, _] = pcg4d([index as u32, 0, 0, 0]);
    [r, g, b].map(|hash| 0.15 + 0.85 * (hash >> 24) as f32 / 255.0)
}

/// Returns the colour for a fraction in 0..=1 of the maximum.
fn heat_colour(share: f32) -> [f32; 3] {
    let at = share.clamp(0.0, 1.0) * (HEAT.len() - 1) as f32;
    let i = (at as usize).min(HEAT.len() - 2);
    let part = at - i as f32;
    [0, 1, 2].map(|c| (HEAT[i][c] + (HEAT[i + 1][c] - HEAT[i][c]) * part) / 255.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_light::film::layer::{Layer, LayerLayout};

    const SRGB: Tonemap = Tonemap::Srgb { exposure: 0.0 };

    fn layer(layer: Layer, data: &[[f32; 3]]) -> LayerImage {
        let film = LayerLayout::new(&[layer], 1, 1).unwrap().films()[0];
        LayerImage {
            film,
            image: Image::from_pixels(data.len() as u32, 1, data.to_vec()),
        }
    }

    fn pixels(layer: &LayerImage) -> Vec<[u8; 3]> {
        let bytes = encode(layer, SRGB, &[]).unwrap();
        let raw = image::load_from_memory(&bytes)
            .unwrap()
            .to_rgb8()
            .into_raw();
        raw.as_chunks::<3>().0.to_vec()
    }

    #[test]
    fn every_kind_has_its_display() {
        assert_eq!(
            pixels(&layer(Layer::Depth, &[[0.0, 0.5, 9.0]])),
            [[0, 188, 255]]
        );
        assert_eq!(
            pixels(&layer(Layer::Albedo, &[[0.0, 0.5, 1.0]])),
            [[0, 188, 255]]
        );
        assert_eq!(
            pixels(&layer(Layer::Normal, &[[0.0, -1.0, 1.0]])),
            [[128, 0, 255]]
        );
        let distances = [
            [0.0, 1.0, 0.0],
            [3.0, 1.0, 0.0],
            [6.0, 1.0, 0.0],
            [1.0, 1.0, 0.0],
        ];
        assert_eq!(
            pixels(&layer(Layer::Distance, &distances)),
            [[0, 0, 0], [201, 62, 71], [255, 255, 236], [44, 17, 95]]
        );
        assert_eq!(
            pixels(&layer(Layer::Bounces, &[[0.0; 3]; 2])),
            [[0; 3]; 2],
            "without light the scale is empty"
        );
        assert_eq!(
            pixels(&layer(
                Layer::Position,
                &[[-2.0, 5.0, 0.0], [2.0, 5.0, 1.0]]
            )),
            [[0; 3], [255, 0, 255]]
        );
        let [none, first, second] = [-1.0, 0.0, 1.0].map(index_colour);
        assert!(none == [0.0; 3] && first != second && first != none);
    }

    #[test]
    fn larger_values_are_lighter() {
        let light =
            |i: i32| lumbre_light::math::luminance::luminance_f32(heat_colour(i as f32 / 600.0));
        let lightness: Vec<f32> = (0..=600).map(light).collect();
        assert!(
            lightness.windows(2).all(|pair| pair[1] > pair[0]),
            "{lightness:?}"
        );
    }

    #[test]
    fn the_scale_of_a_heat_map_is_in_its_file() {
        let bytes = encode(&layer(Layer::Rays, &[[2.5; 3]]), SRGB, &[]).unwrap();
        let mut reader = ::png::Decoder::new(std::io::Cursor::new(&bytes))
            .read_info()
            .unwrap();
        reader.finish().unwrap();
        let text = &reader.info().uncompressed_latin1_text[0];
        assert_eq!(
            (text.keyword.as_str(), text.text.as_str()),
            ("lumbre.scale", "0 to 2.5")
        );
    }
}
