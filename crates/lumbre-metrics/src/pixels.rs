//! Means over the pixels and channels of two images.

use rayon::prelude::*;

use lumbre_light::film::Image;

/// Mean of `f(image, reference)` over all pixels and channels. Rows are summed in parallel and
/// added in order, so the value does not depend on the number of threads. NaN for images without
/// pixels.
pub fn mean(image: &Image, reference: &Image, f: impl Fn(f64, f64) -> f64 + Sync) -> f64 {
    let width = (image.width as usize).max(1);
    let rows: Vec<f64> = image
        .data
        .par_chunks(width)
        .zip(reference.data.par_chunks(width))
        .map(|(a, b)| {
            let channels = a.as_flattened().iter().zip(b.as_flattened());
            channels
                .map(|(x, y)| f(f64::from(*x), f64::from(*y)))
                .sum::<f64>()
        })
        .collect();
    rows.iter().sum::<f64>() / (3 * image.data.len()) as f64
}

/// Mean of `f(image, reference)` over the channels of each pixel, in row order.
pub fn each(image: &Image, reference: &Image, f: impl Fn(f64, f64) -> f64 + Sync) -> Vec<f32> {
    let pixel = |(a, b): (&[f32; 3], &[f32; 3])| {
        ((0..3)
            .map(|c| f(f64::from(a[c]), f64::from(b[c])))
            .sum::<f64>()
            / 3.0) as f32
    };
    image
        .data
        .par_iter()
        .zip(&reference.data)
        .with_min_len(4096)
        .map(pixel)
        .collect()
}
