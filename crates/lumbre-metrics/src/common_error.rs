//! The error that several pictures of one technique have in common.
//!
//! Pictures of an unbiased technique with different seeds differ from the truth by noise alone, which
//! the mean over pictures and over neighbouring pixels reduces. An error that all of them have in a
//! whole square of pixels is bias, or light that the technique has not found in any of them: the
//! spread over pictures does not tell of it.

use lumbre_light::film::Image;

/// Side in pixels of the squares over which errors are averaged.
const SIDE: usize = 8;

/// Sums the errors of pictures against one reference.
#[derive(Clone, Debug)]
pub struct CommonError<'a> {
    reference: &'a Image,
    sums: Vec<[f64; 3]>,
    /// Mean over pixels and channels of the sum of squared errors.
    squares: f64,
    pictures: u32,
}

impl<'a> CommonError<'a> {
    /// Creates a sum without pictures.
    pub fn new(reference: &'a Image) -> CommonError<'a> {
        CommonError {
            reference,
            sums: vec![[0.0; 3]; reference.data.len()],
            squares: 0.0,
            pictures: 0,
        }
    }

    /// Adds a picture. One of another size than the reference is left out.
    pub fn add(&mut self, picture: &Image) {
        if (picture.width, picture.height) != (self.reference.width, self.reference.height) {
            return;
        }
        let mut squares = 0.0;
        let pixels = picture.data.iter().zip(&self.reference.data);
        for (sum, (pixel, reference)) in self.sums.iter_mut().zip(pixels) {
            for channel in 0..3 {
                let error = f64::from(pixel[channel]) - f64::from(reference[channel]);
                sum[channel] += error;
                squares += error * error;
            }
        }
        self.squares += squares / (3 * self.sums.len()) as f64;
        self.pictures += 1;
    }

    /// Whether the squared error that all pictures have in common is larger than the squared noise
    /// by which they differ; `false` with fewer than two pictures or if a pixel is not finite.
    ///
    /// The noise is unbiased. The common error is that of squares of 8x8 pixels, in which the noise
    /// of the pictures and of the reference is small, so an error that changes from pixel to pixel
    /// is not seen.
    pub fn exceeds_noise(&self) -> bool {
        let pictures = f64::from(self.pictures);
        let squared = |sums: &[f64; 3]| sums.iter().map(|sum| sum * sum).sum::<f64>();
        let of_mean = self.per_value(self.sums.iter().map(squared).sum());
        let noise = (self.squares / pictures - of_mean) * pictures / (pictures - 1.0);
        self.pictures > 1 && self.common() > noise
    }

    /// Returns the mean over squares of the squared mean error of a square.
    fn common(&self) -> f64 {
        let width = self.reference.width as usize;
        let columns = width.div_ceil(SIDE);
        let rows = (self.reference.height as usize).div_ceil(SIDE);
        let mut squares = vec![([0.0; 3], 0.0); columns * rows];
        for (index, sum) in self.sums.iter().enumerate() {
            let (x, y) = (index % width, index / width);
            let (total, pixels) = &mut squares[y / SIDE * columns + x / SIDE];
            for channel in 0..3 {
                total[channel] += sum[channel];
            }
            *pixels += 1.0;
        }
        let weighted = |(total, pixels): &([f64; 3], f64)| {
            total.iter().map(|sum| sum * sum / pixels).sum::<f64>()
        };
        self.per_value(squares.iter().map(weighted).sum())
    }

    /// Returns the mean over pixels and channels of the squared mean error of all pictures, from the
    /// sum over both of the squared sum of errors.
    fn per_value(&self, sum: f64) -> f64 {
        let pictures = f64::from(self.pictures);
        sum / (3 * self.sums.len()) as f64 / (pictures * pictures)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: u32 = 20;

    /// Returns a picture of a grey wall with noise of its own in each pixel, of variance 1 / 12.
    fn noisy(seed: u32) -> Image {
        Image::from_fn(WIDTH, WIDTH, |x, y| {
            [0, 1, 2].map(|channel| {
                let mut bits = seed * 7919 + ((y * WIDTH + x) * 3 + channel) * 104_729 + 1;
                for _ in 0..3 {
                    bits ^= bits << 13;
                    bits ^= bits >> 17;
                    bits ^= bits << 5;
                }
                1.0 + (f64::from(bits) / f64::from(u32::MAX) - 0.5) as f32
            })
        })
    }

    fn exceeds_noise(pictures: &[Image]) -> bool {
        let reference = Image::from_fn(WIDTH, WIDTH, |_, _| [1.0; 3]);
        let mut common = CommonError::new(&reference);
        pictures.iter().for_each(|picture| common.add(picture));
        common.exceeds_noise()
    }

    #[test]
    fn noise_is_not_common_and_bias_is() {
        let pictures: Vec<Image> = (0..4).map(noisy).collect();
        assert!(!exceeds_noise(&pictures));
        // A bias in a third of the picture whose mean square is 0.5 or 2 times the noise.
        let biased = |share: f32| -> Vec<Image> {
            let bias = (share * 3.0 / 12.0).sqrt();
            let shifted = |picture: &Image| {
                Image::from_fn(WIDTH, WIDTH, |x, y| {
                    picture
                        .at(x, y)
                        .map(|v| if y * 3 < WIDTH { v - bias } else { v })
                })
            };
            pictures.iter().map(shifted).collect()
        };
        assert!(!exceeds_noise(&biased(0.5)) && exceeds_noise(&biased(2.0)));
    }

    #[test]
    fn nothing_is_said_of_one_picture_or_of_broken_ones() {
        let dark = || Image::from_fn(WIDTH, WIDTH, |_, _| [0.0; 3]);
        assert!(exceeds_noise(&[dark(), dark()]));
        assert!(!exceeds_noise(&[dark()]) && !exceeds_noise(&[]));
        let broken = Image::from_fn(WIDTH, WIDTH, |_, _| [f32::NAN; 3]);
        assert!(!exceeds_noise(&[dark(), broken]));
        let small = Image::from_fn(2, 2, |_, _| [0.0; 3]);
        assert!(!exceeds_noise(&[dark(), small]));
    }
}
