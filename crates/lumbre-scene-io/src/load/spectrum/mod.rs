//! Spectra as linear sRGB, by the matching functions of the CIE 1931 observer.

mod matching;

use std::path::Path;

use glam::{DMat3, DVec3};

use self::matching::{FIRST, MATCHING, STEP};
use super::read_file;
use lumbre_light::scene::SceneError;

/// Greatest size of a file with a spectrum in bytes.
const MAX_FILE_BYTES: u64 = 1 << 20;

/// Number of wavelengths at which a spectrum is read between two of the table.
const SUBDIVISIONS: usize = 5;

/// A spectrum given by pairs of wavelength in nanometres and value.
#[derive(Clone, Debug)]
pub(super) struct Sampled(Vec<[f64; 2]>);

impl Sampled {
    /// Returns the spectrum of pairs in any order, of which there is at least one.
    pub fn new(mut pairs: Vec<[f64; 2]>) -> Sampled {
        pairs.sort_by(|a, b| a[0].total_cmp(&b[0]));
        Sampled(pairs)
    }

    /// Returns the spectrum of a list of wavelengths and values in turn; `None` if they are no pairs.
    pub fn from_numbers(numbers: &[f64]) -> Option<Sampled> {
        match numbers.as_chunks() {
            (pairs, []) if !pairs.is_empty() => Some(Sampled::new(pairs.to_vec())),
            _ => None,
        }
    }

    /// Reads a file; `None` if its text has no pairs.
    ///
    /// # Errors
    /// Fails if the file cannot be read.
    pub fn read(path: &Path) -> Result<Option<Sampled>, SceneError> {
        let bytes = read_file(path, MAX_FILE_BYTES)?;
        Ok(Sampled::from_text(&String::from_utf8_lossy(&bytes)))
    }

    /// Returns the spectrum in the text of a file: numbers between white space, with comments after
    /// `#`; `None` if they are no pairs of finite numbers.
    fn from_text(text: &str) -> Option<Sampled> {
        let words = text.lines().flat_map(|line| {
            line.split('#')
                .next()
                .unwrap_or_default()
                .split_whitespace()
        });
        let numbers: Vec<f64> = words.map(str::parse).collect::<Result<_, _>>().ok()?;
        let finite = numbers.iter().all(|x| x.is_finite());
        Sampled::from_numbers(&numbers).filter(|_| finite)
    }

    /// Returns the value at a wavelength, interpolated linearly; beyond the ends that of the end.
    pub fn at(&self, nm: f64) -> f64 {
        let samples = &self.0;
        let after = samples.partition_point(|s| s[0] <= nm);
        match (after.checked_sub(1).map(|i| samples[i]), samples.get(after)) {
            (Some(a), Some(b)) => a[1] + (b[1] - a[1]) * (nm - a[0]) / (b[0] - a[0]),
            (Some(only), None) => only[1],
            (None, Some(only)) => only[1],
            (None, None) => 0.0,
        }
    }

    /// Returns the value at a wavelength; beyond the ends 0.
    pub fn at_or_zero(&self, nm: f64) -> f64 {
        let ends = self.0.first().zip(self.0.last());
        match ends {
            Some((first, last)) if (first[0]..=last[0]).contains(&nm) => self.at(nm),
            _ => 0.0,
        }
    }
}

/// Integrates a spectrum with the matching functions, `weighted` by D65 or not; also returns the
/// integral of the spectrum of 1.
fn integrals(spectrum: impl Fn(f64) -> f64, weighted: bool) -> [DVec3; 2] {
    let (mut color, mut white) = (DVec3::ZERO, DVec3::ZERO);
    for (i, pair) in MATCHING.windows(2).enumerate() {
        for k in 0..SUBDIVISIONS {
            let between = (k as f64 + 0.5) / SUBDIVISIONS as f64;
            let [x, y, z, d65] =
                std::array::from_fn(|j| pair[0][j] + (pair[1][j] - pair[0][j]) * between);
            let matching = DVec3::new(x, y, z) * if weighted { d65 } else { 1.0 };
            white += matching;
            color += matching * spectrum(FIRST + STEP * (i as f64 + between));
        }
    }
    [color, white]
}

/// Temperatures of black bodies in kelvin.
pub(super) const KELVIN: std::ops::RangeInclusive<f64> = 100.0..=1e6;

/// Returns the radiance of a black body at a wavelength in nanometres by Planck's law, in
/// W m^-2 sr^-1 nm^-1.
pub(super) fn planck(nm: f64, kelvin: f64) -> f64 {
    1.191_042_972e20 * nm.powi(-5) / (1.438_776_877e7 / (nm * kelvin)).exp_m1()
}

/// Returns the linear sRGB of a reflectance, transmittance or index under D65: a constant spectrum
/// is that grey.
pub(super) fn under_daylight(spectrum: impl Fn(f64) -> f64) -> DVec3 {
    let [color, white] = integrals(spectrum, true);
    (to_srgb() * color) / (to_srgb() * white)
}

/// Returns X, Y and Z of a spectrum. That of 1 has a luminance of 1, and the colour of light of equal
/// energy, which is reddish in sRGB.
pub(super) fn xyz(spectrum: impl Fn(f64) -> f64) -> DVec3 {
    let [color, white] = integrals(spectrum, false);
    color / white.y
}

/// Returns the map from XYZ to linear sRGB [IEC 61966-2-1].
pub(super) fn to_srgb() -> DMat3 {
    DMat3::from_cols_array_2d(&[
        [3.240_454_2, -0.969_266, 0.055_643_4],
        [-1.537_138_5, 1.876_010_8, -0.204_025_9],
        [-0.498_531_4, 0.041_556, 1.057_225_2],
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spectra_have_the_colours_of_mitsuba() {
        // Mitsuba 3.9.1, `scalar_rgb`: reflectances, whose sum there is 0.1 % low (999 steps times a
        // thousandth of the range), then radiances.
        let ramp = Sampled::new(vec![[400.0, 0.1], [500.0, 0.3], [600.0, 0.7], [700.0, 0.2]]);
        let peak = Sampled::new(
            [400.0, 450.0, 550.0, 650.0, 700.0]
                .map(|nm| [nm, if nm == 550.0 { 1.0 } else { 0.0 }])
                .to_vec(),
        );
        let lamp = Sampled::new(vec![
            [400.0, 0.0],
            [500.0, 8.0],
            [600.0, 15.6],
            [700.0, 18.4],
        ]);
        for (spectrum, expected) in [
            (&ramp, [0.682_387_1, 0.478_298_5, 0.168_870_6]),
            (&peak, [0.295_293_3, 0.845_629_7, 0.025_209_8]),
        ] {
            let found = under_daylight(|nm| spectrum.at_or_zero(nm));
            let error = (found * 0.999 / DVec3::from(expected) - 1.0).abs();
            assert!(error.max_element() < 1e-3, "{found}");
        }
        for (spectrum, expected) in [
            (&ramp, [0.790_375_3, 0.460_087_98, 0.146_134_88]),
            (&lamp, [20.710_836, 10.854_634, 2.771_152]),
        ] {
            let found = to_srgb() * xyz(|nm| spectrum.at_or_zero(nm));
            let error = (found / DVec3::from(expected) - 1.0).abs().max_element();
            assert!(error < 1e-4, "{found}");
        }
    }

    #[test]
    fn the_text_of_a_file_has_pairs() {
        let read = Sampled::from_text("# nm value\n400 0.5 500 # half\n 1.5\n").unwrap();
        assert_eq!([390.0, 450.0, 510.0].map(|nm| read.at(nm)), [0.5, 1.0, 1.5]);
        assert_eq!(
            [390.0, 450.0, 510.0].map(|nm| read.at_or_zero(nm)),
            [0.0, 1.0, 0.0]
        );
        for text in ["", "400", "400 x", "400 nan"] {
            assert!(Sampled::from_text(text).is_none(), "{text}");
        }
    }
}
