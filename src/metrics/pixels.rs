//! Means over all pixels and channels of two images.

use rayon::prelude::*;

use crate::film::Image;

/// The mean of `f(image, reference)` over all pixels and channels. Rows are summed in parallel and added in order,
/// so the value is the same on any number of threads. NaN for images without pixels.
pub fn mean(image: &Image, reference: &Image, f: impl Fn(f64, f64) -> f64 + Sync) -> f64 {
    let width = (image.width as usize).max(1);
    let rows: Vec<f64> = image
        .data
        .par_chunks(width)
        .zip(reference.data.par_chunks(width))
        .map(|(a, b)| {
            let channels = a.as_flattened().iter().zip(b.as_flattened());
            channels.map(|(x, y)| f(f64::from(*x), f64::from(*y))).sum::<f64>()
        })
        .collect();
    rows.iter().sum::<f64>() / (3 * image.data.len()) as f64
}
