//! Film whose samples arrive as pictures of several samples each.

use std::io::{self, Write};

use lumbre_light::film::state::{CheckpointMismatch, StateReader, write_sums, write_u64s};
use lumbre_light::film::{Film, Image};

/// Film made of pictures of several samples each. The variance of the samples within a picture is
/// unknown, so the film's variance is estimated from the differences of pictures: with `n_k`
/// samples in picture `m_k` and `K` pictures, one sample has the variance `(sum n_k m_k² - S² / N)
/// / (K - 1)`. The variance of a single picture is unknown.
pub(super) struct BatchFilm {
    /// Film of all samples so far.
    pub(super) film: Film,
    /// Weighted sum of squares of the pictures, `sum n_k m_k²`.
    squares: Vec<[f64; 3]>,
    pictures: u64,
}

impl BatchFilm {
    /// Creates a film without samples.
    pub(super) fn new(width: u32, height: u32) -> BatchFilm {
        let film = Film::new(width, height);
        BatchFilm {
            squares: vec![[0.0; 3]; film.sum.len()],
            film,
            pictures: 0,
        }
    }

    /// Adds a picture of `samples` samples. Values that are not finite count as black; returns
    /// their number.
    pub(super) fn add(&mut self, image: &Image, samples: u64) -> u64 {
        let mut invalid = 0;
        self.pictures += 1;
        self.film.samples += samples;
        let (own, n) = (samples as f64, self.film.samples as f64);
        let degrees_of_freedom = self.pictures.saturating_sub(1).max(1) as f64;
        let batches = self
            .film
            .sum
            .iter_mut()
            .zip(&mut self.film.sum2)
            .zip(&mut self.squares);
        for (((sum, sum2), squares), pixel) in batches.zip(&image.data) {
            for c in 0..3 {
                let mean = f64::from(pixel[c]);
                let mean = if mean.is_finite() { mean } else { 0.0 };
                invalid += u64::from(!pixel[c].is_finite());
                sum[c] += own * mean;
                squares[c] += own * mean * mean;
                let mean_part = sum[c] * sum[c] / n;
                let variance = if self.pictures < 2 {
                    0.0
                } else {
                    (squares[c] - mean_part).max(0.0) / degrees_of_freedom
                };
                sum2[c] = mean_part + variance * (n - 1.0);
            }
        }
        invalid
    }

    /// Writes the state from which [`BatchFilm::restore`] continues with identical bits.
    pub(super) fn save(&self, to: &mut dyn Write) -> io::Result<()> {
        self.film.save(to)?;
        write_u64s(to, [self.pictures])?;
        write_sums(to, &self.squares)
    }

    /// Reads the state of a film of the same size.
    pub(super) fn restore(&mut self, from: &mut StateReader<'_>) -> Result<(), CheckpointMismatch> {
        self.film.restore(from)?;
        self.pictures = from.read_u64()?;
        from.read_sums(&mut self.squares)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_weighted_by_their_samples_and_vary_as_their_means_do() {
        let mut batches = BatchFilm::new(1, 1);
        let picture = |x: f32| Image::from_fn(1, 1, |_, _| [x, f32::NAN, 0.0]);
        assert_eq!(batches.add(&picture(2.0), 4), 1);
        assert_eq!(
            batches.film.variance_of_mean().at(0, 0),
            [0.0; 3],
            "the variance of one picture is unknown"
        );
        batches.add(&picture(5.0), 8);
        assert_eq!(
            (batches.film.samples, batches.film.mean().at(0, 0)[0]),
            (12, 4.0)
        );
        // Means 2 and 5 of 4 and 8 samples: one sample's variance is 4 (2 - 4)² + 8 (5 - 4)² = 24,
        // over 12 samples that is 2.
        assert!((batches.film.variance_of_mean().at(0, 0)[0] - 2.0).abs() < 1e-6);
        assert_eq!(batches.film.mean().at(0, 0)[1], 0.0);
    }

    #[test]
    fn a_restored_film_continues_with_the_same_variance() {
        let picture = |x: f32| Image::from_fn(2, 1, |_, _| [x, 0.5 * x, 0.0]);
        let mut whole = BatchFilm::new(2, 1);
        whole.add(&picture(2.0), 4);
        let mut state = Vec::new();
        whole.save(&mut state).unwrap();
        let mut resumed = BatchFilm::new(2, 1);
        let mut from = StateReader::new(&state);
        resumed.restore(&mut from).unwrap();
        from.finish().unwrap();
        for film in [&mut whole, &mut resumed] {
            film.add(&picture(5.0), 8);
        }
        assert_eq!(whole.film.sum, resumed.film.sum);
        assert_eq!(whole.film.sum2, resumed.film.sum2);
        let mut other = BatchFilm::new(1, 1);
        assert!(other.restore(&mut StateReader::new(&state)).is_err());
    }
}
