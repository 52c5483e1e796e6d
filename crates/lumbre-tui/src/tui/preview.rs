//! Pictures reduced to the size of a pane, cached until their inputs change.
//!
//! Reducing a picture costs time that the renderer could use. A cached preview is therefore
//! rebuilt only after a multiple of its cost has passed, so that the three previews of a wide
//! screen together take at most two per cent of one core, whatever the size of the picture.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::modes::PictureMode;
use lumbre_light::film::{Image, SharedImage};
use lumbre_metrics::{MetricError, MetricSpec};

/// Number of cached previews: the three of a wide screen, of which one may flicker, and one more.
const CAPACITY: usize = 5;
/// Shortest lifetime of a preview, in multiples of its cost.
const LIFETIME_FACTOR: u32 = 150;

/// Content of a preview.
#[derive(Clone, Debug, PartialEq)]
pub enum PreviewContent {
    /// Linear radiance, before exposure and tone map.
    Radiance(Image),
    /// False-colour map of an error.
    Map {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// `width * height` sRGB colours in row order.
        colours: Vec<[u8; 3]>,
        /// Errors that the first and the last colour represent.
        scale: [f32; 2],
    },
    /// Reason why there is no preview.
    Unavailable(String),
}

/// A cached preview and the inputs from which it was built.
#[derive(Debug)]
struct CachedPreview {
    kind: PictureMode,
    size: [u32; 2],
    source: SharedImage,
    reference: Option<SharedImage>,
    content: Arc<PreviewContent>,
    made: Instant,
    cost: Duration,
}

/// Cache of the previews built last.
#[derive(Debug, Default)]
pub struct PreviewCache {
    entries: Vec<CachedPreview>,
}

impl PreviewCache {
    /// Returns the preview of a picture and its reference in `size` pixels.
    pub fn get(
        &mut self,
        kind: PictureMode,
        size: [u32; 2],
        source: &SharedImage,
        reference: Option<&SharedImage>,
        metrics: &[MetricSpec],
    ) -> Arc<PreviewContent> {
        let index = self
            .entries
            .iter()
            .position(|k| k.kind == kind && k.size == size);
        if let Some(entry) = index.map(|i| &self.entries[i]) {
            let same_reference = match (&entry.reference, reference) {
                (Some(a), Some(b)) => Arc::ptr_eq(a, b),
                (None, None) => true,
                _ => false,
            };
            if same_reference
                && (Arc::ptr_eq(&entry.source, source)
                    || entry.made.elapsed() < entry.cost * LIFETIME_FACTOR)
            {
                return Arc::clone(&entry.content);
            }
        }
        let start = Instant::now();
        let content = Arc::new(build(
            kind,
            size,
            source,
            reference.map(Arc::as_ref),
            metrics,
        ));
        let entry = CachedPreview {
            kind,
            size,
            source: Arc::clone(source),
            reference: reference.cloned(),
            content: Arc::clone(&content),
            made: Instant::now(),
            cost: start.elapsed(),
        };
        if let Some(i) = index {
            self.entries.remove(i);
        } else if self.entries.len() >= CAPACITY {
            self.entries.remove(0);
        }
        self.entries.push(entry);
        content
    }
}

fn build(
    kind: PictureMode,
    size: [u32; 2],
    image: &Image,
    reference: Option<&Image>,
    metrics: &[MetricSpec],
) -> PreviewContent {
    let against = |metric: &str| match reference {
        None => {
            PreviewContent::Unavailable("this cell has no reference to compare with".to_owned())
        }
        Some(reference) => error_map(metric, size, image, reference, metrics)
            .unwrap_or_else(|e| PreviewContent::Unavailable(e.to_string())),
    };
    match kind {
        PictureMode::Live | PictureMode::Strategies | PictureMode::Time => {
            PreviewContent::Radiance(box_average(image, size[0], size[1]))
        }
        PictureMode::Reference => match reference {
            Some(reference) => PreviewContent::Radiance(box_average(reference, size[0], size[1])),
            None => PreviewContent::Unavailable("this cell has no reference".to_owned()),
        },
        PictureMode::Difference => against("mae"),
        PictureMode::Flip => against("flip"),
    }
}

/// Builds an error map. Errors are computed at full size and then averaged, so that reducing the
/// picture does not remove noise. A metric of the plan is evaluated with the plan's options.
fn error_map(
    metric: &str,
    size: [u32; 2],
    image: &Image,
    reference: &Image,
    metrics: &[MetricSpec],
) -> Result<PreviewContent, MetricError> {
    let own = metrics.iter().find(|m| m.row.name == metric).cloned();
    let spec = match own.map_or_else(|| MetricSpec::new(metric, metric, Default::default()), Ok) {
        Ok(spec) => spec,
        Err(e) => return Ok(PreviewContent::Unavailable(e.to_string())),
    };
    let mut errors = spec.error_map(image, reference)?;
    let scale = errors.scale(None);
    let pixels = errors.values.iter().map(|v| [*v; 3]).collect();
    let full = Image::from_pixels(errors.width, errors.height, pixels);
    let reduced = box_average(&full, size[0], size[1]);
    [errors.width, errors.height] = size;
    errors.values = reduced.data.iter().map(|v| v[0]).collect();
    Ok(PreviewContent::Map {
        width: size[0],
        height: size[1],
        colours: errors.coloured(scale),
        scale,
    })
}

/// Resizes an image: every new pixel is the mean radiance of the area it covers. Pixels that are
/// not finite count as black.
pub fn box_average(image: &Image, width: u32, height: u32) -> Image {
    let columns: Vec<Vec<(u32, f32)>> = (0..width)
        .map(|x| coverage(x, width, image.width))
        .collect();
    let rows: Vec<Vec<(u32, f32)>> = (0..height)
        .map(|y| coverage(y, height, image.height))
        .collect();
    Image::from_fn(width, height, |x, y| {
        let mut sum = [0.0f32; 3];
        for (row, row_weight) in &rows[y as usize] {
            for (column, weight) in &columns[x as usize] {
                let pixel = image.at(*column, *row);
                for c in 0..3 {
                    sum[c] +=
                        row_weight * weight * if pixel[c].is_finite() { pixel[c] } else { 0.0 };
                }
            }
        }
        sum
    })
}

/// Old pixels that new pixel `i` covers along one side, with weights that sum to one.
fn coverage(i: u32, new: u32, old: u32) -> Vec<(u32, f32)> {
    let scale = f64::from(old) / f64::from(new);
    let (from, to) = (f64::from(i) * scale, f64::from(i + 1) * scale);
    let last = (to.ceil() as u32).min(old);
    let share = |k: u32| (f64::from(k + 1).min(to) - f64::from(k).max(from)) / scale;
    (from.floor() as u32..last)
        .map(|k| (k, share(k) as f32))
        .filter(|(_, share)| *share > 0.0)
        .collect()
}
