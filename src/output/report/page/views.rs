//! The pictures of the page's viewer: linear radiance as half floats, and FLIP of every pixel as a byte.

use exr::prelude::f16;
use serde_json::{Value as Json, json};

use super::brief;
use crate::film::Image;
use crate::metrics::tonemap::Tonemap;
use crate::output::plot::svg::base64;
use crate::output::report::Pictures;
use crate::output::report::crops::flip;
use crate::output::report::shots::{self, Moment, Shot, Truths};
use crate::output::report::study::Study;

/// The most bytes that the half floats of all pictures take together.
const MOST_BYTES: usize = 48 << 20;

/// One view for each facet with a reference: its references and the final picture of every series.
pub fn all(study: &Study, pictures: &Pictures, notes: &mut Vec<String>) -> Vec<Json> {
    let mut facets = Vec::new();
    for facet in 0..study.facets.len() {
        let Some(truths) = shots::references(study, facet, pictures, notes) else { continue };
        let taken = shots::shots(study, facet, Moment::End, &truths, pictures, notes);
        if !taken.is_empty() {
            facets.push((facet, truths, taken));
        }
    }
    let size = |(_, truths, taken): &(usize, Truths, Vec<Shot>)| {
        truths.all[0].0.data.len() * 6 * (taken.len() + truths.all.len())
    };
    let bytes: usize = facets.iter().map(size).sum();
    let mut shrink = 1u32;
    while bytes / (shrink * shrink) as usize > MOST_BYTES {
        shrink *= 2;
    }
    facets.iter().map(|(facet, truths, taken)| view(study, *facet, truths, taken, shrink)).collect()
}

/// The first reference, every series, and then the references of series that have others. `truth` is the place of what an
/// image is compared with.
fn view(study: &Study, facet: usize, truths: &Truths, taken: &[Shot], shrink: u32) -> Json {
    let (first, words) = &truths.all[0];
    let display = shots::exposure(first);
    let Tonemap::Srgb { exposure } = display else { return Json::Null };
    let flip = flip(study, display);
    let small = smaller(first, shrink);
    let reference = |name: String, words: &str, image: &Image, truth: usize| {
        json!({
            "name": name, "words": words, "samples": Json::Null, "metrics": [], "half": halves(image), "truth": truth,
        })
    };
    let place = |truth: usize| if truth == 0 { 0 } else { taken.len() + truth };
    let mut images = vec![reference("reference".to_owned(), words, &small, 0)];
    for shot in taken {
        let map = flip.as_ref().and_then(|flip| flip.error_map(&shot.image, truths.of(shot)).ok());
        let map = map.map(|map| Image {
            width: map.width,
            height: map.height,
            data: map.values.iter().map(|v| [*v; 3]).collect(),
        });
        let bytes = |map: Image| -> Vec<u8> {
            smaller(&map, shrink).data.iter().map(|p| (p[0] * 255.0).round() as u8).collect()
        };
        let metrics = study.metrics.iter().zip(&shot.metrics);
        let metrics: Vec<Json> =
            metrics.filter_map(|(spec, value)| Some(json!([spec.row.label, brief((*value)?)]))).collect();
        images.push(json!({
            "name": study.series[shot.series].full(), "run": shot.run, "samples": shot.samples,
            "render_s": brief(shot.render_s), "metrics": metrics, "half": halves(&smaller(&shot.image, shrink)),
            "flip": map.map(|map| base64(&bytes(map))), "truth": place(truths.of[shot.series].unwrap_or(0)),
        }));
    }
    for (truth, (image, words)) in truths.all.iter().enumerate().skip(1) {
        let owner = truths.owner(truth).map_or(String::new(), |series| format!(" of {}", study.series[series].full()));
        images.push(reference(format!("reference{owner}"), words, &smaller(image, shrink), place(truth)));
    }
    json!({
        "name": study.facet_label(facet), "width": small.width, "height": small.height, "exposure": exposure,
        "shrunk": shrink, "images": images,
    })
}

/// Means over squares of pixels; what is left over at the edges is cut.
fn smaller(image: &Image, n: u32) -> Image {
    if n == 1 {
        return image.clone();
    }
    Image::from_fn((image.width / n).max(1), (image.height / n).max(1), |x, y| {
        let mut sum = [0.0f64; 3];
        let mut count = 0.0;
        for j in y * n..(y * n + n).min(image.height) {
            for i in x * n..(x * n + n).min(image.width) {
                let pixel = image.at(i, j);
                (0..3).for_each(|c| sum[c] += f64::from(pixel[c]));
                count += 1.0;
            }
        }
        sum.map(|s| (s / count) as f32)
    })
}

/// Pixels as little-endian half floats in base 64. What is too large for them is their largest number.
fn halves(image: &Image) -> String {
    let half = |x: &f32| f16::from_f32(if x.is_nan() { *x } else { x.clamp(-65504.0, 65504.0) }).to_bits();
    let bytes: Vec<u8> = image.data.as_flattened().iter().flat_map(|x| half(x).to_le_bytes()).collect();
    base64(&bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_half_floats_and_keep_what_is_too_bright() {
        let image = Image::from_fn(1, 1, |_, _| [1.0, -2.0, 1e9]);
        // 0x3c00, 0xc000 and 0x7bff, little-endian.
        assert_eq!(halves(&image), base64(&[0x00, 0x3c, 0x00, 0xc0, 0xff, 0x7b]));
    }

    #[test]
    fn smaller_pictures_are_means() {
        let image = Image::from_fn(5, 4, |x, y| [(x + 10 * y) as f32; 3]);
        let half = smaller(&image, 2);
        assert_eq!((half.width, half.height, half.at(1, 1)), (2, 2, [27.5; 3]));
    }
}
