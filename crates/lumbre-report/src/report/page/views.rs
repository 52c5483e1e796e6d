//! Data of the page's picture viewer: linear radiance as half floats, and FLIP of every pixel as a
//! byte.

use exr::prelude::f16;
use serde_json::{Value as Json, json};

use crate::plot::grid::reduced;
use crate::plot::svg::base64;
use crate::report::Pictures;
use crate::report::crops::flip_metric;
use crate::report::snapshots;
use crate::report::snapshots::{FacetReferences, Moment, Reference, Snapshot};
use crate::report::study::Study;
use crate::{OutputError, format, png};
use lumbre_light::film::Image;
use lumbre_metrics::MetricSpec;

/// Maximum size of the half floats of all pictures together, in bytes.
const MOST_BYTES: usize = 48 << 20;

/// Maximum width of thumbnails in pixels.
const THUMBNAIL: u32 = 128;

/// Pictures of one facet on the page.
pub struct View {
    /// Index of the facet.
    pub facet: usize,
    /// Data of the viewer.
    pub data: Json,
    /// The reference in small, as a PNG file.
    pub thumbnail: Vec<u8>,
}

/// Builds one view for each facet with a reference: its references and the final picture of every
/// series. All pictures are reduced by the same power of two if they would exceed [`MOST_BYTES`].
///
/// # Errors
/// Returns an error if a thumbnail cannot be encoded.
pub fn all(
    study: &Study,
    pictures: &Pictures,
    notes: &mut Vec<String>,
) -> Result<Vec<View>, OutputError> {
    let mut views = Vec::new();
    for facet in 0..study.facets.len() {
        let Some(references) = snapshots::references(study, facet, pictures, notes) else {
            continue;
        };
        let snapshots =
            snapshots::nearest_snapshots(study, facet, Moment::End, &references, pictures, notes);
        if !snapshots.is_empty() {
            views.push(FacetView {
                study,
                facet,
                references,
                snapshots,
            });
        }
    }
    let bytes: usize = views.iter().map(FacetView::half_float_bytes).sum();
    let mut shrink = 1u32;
    while bytes / (shrink * shrink) as usize > MOST_BYTES {
        shrink *= 2;
    }
    let finished = |view: &FacetView| {
        Ok(View {
            facet: view.facet,
            data: view.data(shrink),
            thumbnail: view.thumbnail()?,
        })
    };
    views.iter().map(finished).collect()
}

/// Pictures of one facet.
struct FacetView<'a> {
    study: &'a Study<'a>,
    facet: usize,
    references: FacetReferences,
    snapshots: Vec<Snapshot>,
}

impl FacetView<'_> {
    /// Returns the size of all pictures without reduction.
    fn half_float_bytes(&self) -> usize {
        let pixels = self.references.all[0].image.data.len();
        pixels * 6 * (self.snapshots.len() + self.references.all.len())
    }

    /// Returns the first reference, reduced to at most [`THUMBNAIL`] pixels of width, as PNG.
    fn thumbnail(&self) -> Result<Vec<u8>, OutputError> {
        let image = &self.references.all[0].image;
        let small = reduced(image, image.width.div_ceil(THUMBNAIL).max(1));
        png::encode(&small, self.study.display_of(image), &[])
    }

    /// Returns the data of the view: the first reference, every series, then the other references.
    /// The key `truth` of an image is the index of the reference that it is compared with.
    fn data(&self, shrink: u32) -> Json {
        let display = self.study.display_of(&self.references.all[0].image);
        let flip = flip_metric(self.study, display);
        let mut images = vec![self.reference_data(0, shrink)];
        for snapshot in &self.snapshots {
            images.push(self.snapshot_data(snapshot, flip.as_ref(), shrink));
        }
        for index in 1..self.references.all.len() {
            images.push(self.reference_data(index, shrink));
        }
        let first = reduced(&self.references.all[0].image, shrink);
        json!({
            "name": self.study.facet_label(self.facet), "width": first.width,
            "height": first.height, "display": display.to_value(), "shrunk": shrink, "images": images,
        })
    }

    /// Returns the index of a reference among the images of the view.
    fn image_index(&self, reference: usize) -> usize {
        if reference == 0 {
            0
        } else {
            self.snapshots.len() + reference
        }
    }

    fn reference_data(&self, index: usize, shrink: u32) -> Json {
        let Reference {
            image, description, ..
        } = &self.references.all[index];
        let name = self.references.name(self.study, index);
        json!({
            "name": name, "words": description, "samples": Json::Null, "metrics": [],
            "half": half_floats(&reduced(image, shrink)), "truth": self.image_index(index),
        })
    }

    fn snapshot_data(&self, snapshot: &Snapshot, flip: Option<&MetricSpec>, shrink: u32) -> Json {
        let reference = self.references.for_snapshot(snapshot);
        let map = flip.and_then(|flip| flip.error_map(&snapshot.image, reference).ok());
        let flip_bytes = map.map(|map| {
            let map = Image::from_pixels(
                map.width,
                map.height,
                map.values.iter().map(|v| [*v; 3]).collect(),
            );
            let byte = |p: &[f32; 3]| (p[0] * 255.0).round() as u8;
            let bytes: Vec<u8> = reduced(&map, shrink).data.iter().map(byte).collect();
            base64(&bytes)
        });
        let metrics = self.study.metrics.iter().zip(&snapshot.metrics);
        let metrics: Vec<Json> = metrics
            .filter_map(|(spec, value)| Some(json!([spec.row.label, brief((*value)?)])))
            .collect();
        let reference = self.references.by_series[snapshot.series].unwrap_or(0);
        json!({
            "name": self.study.series[snapshot.series].full_label(), "run": snapshot.run,
            "samples": snapshot.samples, "render_s": brief(snapshot.render_s), "metrics": metrics,
            "half": half_floats(&reduced(&snapshot.image, shrink)), "flip": flip_bytes,
            "truth": self.image_index(reference),
        })
    }
}

/// Encodes pixels as little-endian half floats in base 64. Values are clamped to the range of half
/// floats; NaN is preserved.
fn half_floats(image: &Image) -> String {
    let half = |x: &f32| {
        f16::from_f32(if x.is_nan() {
            *x
        } else {
            x.clamp(-65504.0, 65504.0)
        })
        .to_bits()
    };
    let bytes: Vec<u8> = image
        .data
        .as_flattened()
        .iter()
        .flat_map(|x| half(x).to_le_bytes())
        .collect();
    base64(&bytes)
}

/// Formats a number below a picture with three significant digits.
fn brief(x: f64) -> String {
    format::significant(x, 3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_half_floats_clamped_to_their_range() {
        let image = Image::from_fn(1, 1, |_, _| [1.0, -2.0, 1e9]);
        // 0x3c00, 0xc000 and 0x7bff, little-endian.
        assert_eq!(
            half_floats(&image),
            base64(&[0x00, 0x3c, 0x00, 0xc0, 0xff, 0x7b])
        );
    }
}
