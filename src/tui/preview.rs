//! Pictures reduced to what a pane can show, kept as long as nothing that they are made of changes.
//!
//! Making one takes time that the renderer would like to have. So each remembers what it cost, and is not made anew
//! before fifty times that has gone by: whatever the size of the picture, this stays below two per cent of one core.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::view::Picture;
use crate::film::{Image, SharedImage};
use crate::metrics::{MetricError, MetricSpec};

/// Previews that are kept: two that flicker, and one more.
const KEPT: usize = 3;
/// How long a preview is kept at least, in multiples of what it cost.
const REST: u32 = 50;

/// What a preview shows.
#[derive(Clone, Debug, PartialEq)]
pub enum Content {
    /// Linear radiance, still to be exposed and tone-mapped.
    Radiance(Image),
    /// An error in colours: one for each pixel in row order, and the values at both ends of the colours.
    Map {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// `width * height` sRGB colours.
        colours: Vec<[u8; 3]>,
        /// What the first and the last colour stand for.
        scale: [f32; 2],
    },
    /// Why there is none.
    Nothing(String),
}

/// A preview.
#[derive(Debug)]
struct Kept {
    kind: Picture,
    size: [u32; 2],
    source: SharedImage,
    reference: Option<SharedImage>,
    content: Arc<Content>,
    made: Instant,
    cost: Duration,
}

/// The previews that were made last.
#[derive(Debug, Default)]
pub struct Previews {
    kept: Vec<Kept>,
}

impl Previews {
    /// A preview of a picture and its reference, of `size` pixels.
    pub fn get(
        &mut self,
        kind: Picture,
        size: [u32; 2],
        source: &SharedImage,
        reference: Option<&SharedImage>,
        metrics: &[MetricSpec],
    ) -> Arc<Content> {
        let place = self.kept.iter().position(|k| k.kind == kind && k.size == size);
        if let Some(kept) = place.map(|i| &self.kept[i]) {
            let same_reference = match (&kept.reference, reference) {
                (Some(a), Some(b)) => Arc::ptr_eq(a, b),
                (None, None) => true,
                _ => false,
            };
            if same_reference && (Arc::ptr_eq(&kept.source, source) || kept.made.elapsed() < kept.cost * REST) {
                return Arc::clone(&kept.content);
            }
        }
        let start = Instant::now();
        let content = Arc::new(made(kind, size, source, reference.map(Arc::as_ref), metrics));
        let kept = Kept {
            kind,
            size,
            source: Arc::clone(source),
            reference: reference.cloned(),
            content: Arc::clone(&content),
            made: Instant::now(),
            cost: start.elapsed(),
        };
        if let Some(i) = place {
            self.kept.remove(i);
        } else if self.kept.len() >= KEPT {
            self.kept.remove(0);
        }
        self.kept.push(kept);
        content
    }
}

fn made(kind: Picture, size: [u32; 2], image: &Image, reference: Option<&Image>, metrics: &[MetricSpec]) -> Content {
    let against = |metric: &str| match reference {
        None => Content::Nothing("there is no reference to compare with".to_owned()),
        Some(reference) => {
            map(metric, size, image, reference, metrics).unwrap_or_else(|e| Content::Nothing(e.to_string()))
        }
    };
    match kind {
        Picture::Live | Picture::Strategies | Picture::Time => Content::Radiance(box_average(image, size[0], size[1])),
        Picture::Reference => match reference {
            Some(reference) => Content::Radiance(box_average(reference, size[0], size[1])),
            None => Content::Nothing("this cell has no reference".to_owned()),
        },
        Picture::Difference => against("mae"),
        Picture::Flip => against("flip"),
    }
}

/// The errors of all pixels, computed at full size and then averaged, so that noise does not vanish by being reduced.
/// A metric of the plan is taken with its options.
fn map(
    metric: &str,
    size: [u32; 2],
    image: &Image,
    reference: &Image,
    metrics: &[MetricSpec],
) -> Result<Content, MetricError> {
    let own = metrics.iter().find(|m| m.row.name == metric).cloned();
    let spec = match own.map_or_else(|| MetricSpec::new(metric, metric, Default::default()), Ok) {
        Ok(spec) => spec,
        Err(e) => return Ok(Content::Nothing(e.to_string())),
    };
    let mut errors = spec.error_map(image, reference)?;
    let scale = errors.scale(None);
    let pixels = errors.values.iter().map(|v| [*v; 3]).collect();
    let full = Image { width: errors.width, height: errors.height, data: pixels };
    let reduced = box_average(&full, size[0], size[1]);
    [errors.width, errors.height] = size;
    errors.values = reduced.data.iter().map(|v| v[0]).collect();
    Ok(Content::Map { width: size[0], height: size[1], colours: errors.coloured(scale), scale })
}

/// The image at another size, every new pixel the mean of the radiance that it covers. Non-finite pixels count as
/// black.
pub fn box_average(image: &Image, width: u32, height: u32) -> Image {
    let columns: Vec<Vec<(u32, f32)>> = (0..width).map(|x| cover(x, width, image.width)).collect();
    let rows: Vec<Vec<(u32, f32)>> = (0..height).map(|y| cover(y, height, image.height)).collect();
    Image::from_fn(width, height, |x, y| {
        let mut sum = [0.0f32; 3];
        for (row, row_weight) in &rows[y as usize] {
            for (column, weight) in &columns[x as usize] {
                let pixel = image.at(*column, *row);
                for c in 0..3 {
                    sum[c] += row_weight * weight * if pixel[c].is_finite() { pixel[c] } else { 0.0 };
                }
            }
        }
        sum
    })
}

/// The old pixels that new pixel `i` of `new` covers along one side, with their shares, which add up to one.
fn cover(i: u32, new: u32, old: u32) -> Vec<(u32, f32)> {
    let scale = f64::from(old) / f64::from(new);
    let (from, to) = (f64::from(i) * scale, f64::from(i + 1) * scale);
    let last = (to.ceil() as u32).min(old);
    let share = |k: u32| (f64::from(k + 1).min(to) - f64::from(k).max(from)) / scale;
    (from.floor() as u32..last).map(|k| (k, share(k) as f32)).filter(|(_, share)| *share > 0.0).collect()
}
