//! Spectra, turned into linear sRGB.
//!
//! - Version 4: a reflectance or an index is weighted by D65, so that a constant spectrum is that
//!   grey; the spectrum of a light, unless it is RGB, keeps its chromaticity and has a luminance
//!   of 1.
//! - Version 3: all spectra are integrated with the colour matching functions alone, as its RGB mode
//!   does, so that a constant spectrum is a light of equal energy, which is reddish in sRGB.

mod table;

use std::path::{Path, PathBuf};

use glam::{DMat3, DVec3, Vec3};

use self::table::{GLASSES, ILLUMINANTS, METALS};
use super::params::{Param, Values};
use super::token::truncated;
use super::version::Version;
use crate::load::beside;
use crate::load::metals;
use crate::load::primaries::Primaries;
use crate::load::spectrum::{KELVIN, Sampled, planck, to_srgb, under_daylight, xyz};
use lumbre_light::scene::SceneError;

/// Wavelength of the helium d line in nanometres, at which an index is that of a glass.
const HELIUM_D: f64 = 587.6;

/// Use of a spectrum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Use {
    /// A reflectance or transmittance, in 0..=1.
    Reflectance,
    /// A radiance, intensity or irradiance.
    Light,
    /// An index of refraction or an absorption.
    Index,
}

/// Colour space of RGB parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum ColorSpace {
    #[default]
    Srgb,
    DciP3,
    Rec2020,
}

impl ColorSpace {
    /// Returns the colour space with this name in pbrt.
    pub fn from_name(name: &str) -> Option<ColorSpace> {
        match name {
            "srgb" => Some(ColorSpace::Srgb),
            "dci-p3" => Some(ColorSpace::DciP3),
            "rec2020" => Some(ColorSpace::Rec2020),
            _ => None,
        }
    }

    /// Returns the map to linear sRGB.
    fn to_srgb(self) -> DMat3 {
        let primaries = match self {
            ColorSpace::Srgb => return DMat3::IDENTITY,
            ColorSpace::DciP3 => Primaries::DCI_P3,
            ColorSpace::Rec2020 => Primaries::REC2020,
        };
        primaries.to_srgb().unwrap_or(DMat3::IDENTITY)
    }
}

/// Settings that determine the colour of a spectrum.
#[derive(Clone, Debug)]
pub(super) struct Spectra {
    /// Version of the file.
    pub version: Version,
    /// Colour space of RGB parameters.
    pub color_space: ColorSpace,
    /// Folder that names of files are relative to.
    pub folder: PathBuf,
}

impl Spectra {
    /// Returns the colour of a parameter, at least 0.
    pub fn color(&self, p: &Param, purpose: Use) -> Result<Vec3, SceneError> {
        let color = match (p.ty.as_str(), &p.values) {
            ("rgb" | "color", Values::Numbers(x)) => match x.as_slice() {
                [r, g, b] => self.color_space.to_srgb() * DVec3::new(*r, *g, *b),
                other => return Err(p.error(format!("expected 3 numbers, found {}", other.len()))),
            },
            ("xyz", Values::Numbers(x)) => match x.as_slice() {
                [x, y, z] => to_srgb() * DVec3::new(*x, *y, *z),
                other => return Err(p.error(format!("expected 3 numbers, found {}", other.len()))),
            },
            ("blackbody", Values::Numbers(x)) => self.blackbody(p, x, purpose)?,
            ("spectrum", Values::Numbers(x)) => self.sampled(samples(p, x)?, purpose),
            ("spectrum", Values::Texts(x)) => self.named(p, x, purpose)?,
            (_, Values::Numbers(x)) if x.len() == 1 => DVec3::splat(x[0]),
            (ty, _) => {
                return Err(p.error(format!("expected a colour, found a `{}`", truncated(ty))));
            }
        };
        let color = color.max(DVec3::ZERO).as_vec3();
        if color.is_finite() && color.max_element() <= 1e9 {
            Ok(color)
        } else {
            Err(p.error(format!("expected a colour of at most 1e9, found {color}")))
        }
    }

    /// Returns an index of refraction, and whether it was that of one wavelength of a spectrum.
    pub fn index(&self, p: &Param) -> Result<(f64, bool), SceneError> {
        if let Values::Texts(names) = &p.values
            && let [name] = names.as_slice()
        {
            if let Some((_, index)) = GLASSES.iter().find(|row| row.0 == name) {
                return Ok((*index, true));
            }
            let samples = self.file(p, name)?;
            return Ok((samples.at(HELIUM_D), true));
        }
        match p.numbers()? {
            [x] => Ok((*x, false)),
            other if p.ty == "spectrum" => Ok((samples(p, other)?.at(HELIUM_D), true)),
            other => Ok((other.iter().sum::<f64>() / other.len().max(1) as f64, true)),
        }
    }

    /// Returns the colour of a black body. Version 3 scales its spectrum to a maximum of the second
    /// number.
    fn blackbody(&self, p: &Param, x: &[f64], purpose: Use) -> Result<DVec3, SceneError> {
        let (kelvin, scale) = match x {
            [kelvin] => (*kelvin, 1.0),
            [kelvin, scale] => (*kelvin, *scale),
            other => {
                return Err(p.error(format!(
                    "expected a temperature, found {} numbers",
                    other.len()
                )));
            }
        };
        if !KELVIN.contains(&kelvin) {
            return Err(p.error(format!(
                "expected a temperature from 100 to 1e6 kelvin, found {kelvin}"
            )));
        }
        // Relative to its maximum by Wien's law.
        let peak = planck(2.897_772_1e6 / kelvin, kelvin);
        Ok(self.integrated(|nm| planck(nm, kelvin) / peak, purpose) * scale)
    }

    /// Returns the colour of a spectrum by name, or from a file.
    fn named(&self, p: &Param, names: &[String], purpose: Use) -> Result<DVec3, SceneError> {
        let [name] = names else {
            return Err(p.error(format!("expected one name, found {}", names.len())));
        };
        let metal = |kind: &str| name.strip_prefix("metal-")?.strip_suffix(kind);
        let row = |short: &str| METALS.iter().find(|row| row.0 == short);
        if let Some((_, eta, _)) = metal("-eta").and_then(row) {
            return Ok(DVec3::from(eta.map(f64::from)));
        }
        if let Some((_, _, k)) = metal("-k").and_then(row) {
            return Ok(DVec3::from(k.map(f64::from)));
        }
        if let Some((_, index)) = GLASSES.iter().find(|row| row.0 == name) {
            return Ok(DVec3::splat(*index));
        }
        if let Some((_, [x, y])) = ILLUMINANTS.iter().find(|row| row.0 == name) {
            let xyz = DVec3::new(x / y, 1.0, (1.0 - x - y) / y);
            return Ok(to_srgb() * xyz);
        }
        if let Some(known) = self.metal_file(name) {
            return Ok(known);
        }
        Ok(self.sampled(self.file(p, name)?, purpose))
    }

    /// Returns the index of a metal for the name of a file of pbrt that is missing, such as
    /// `spds/Cu.eta.spd`.
    fn metal_file(&self, name: &str) -> Option<DVec3> {
        if self.folder.join(name).exists() {
            return None;
        }
        let stem = Path::new(name).file_name()?.to_str()?;
        let (metal, rest) = stem.split_once('.')?;
        let (eta, k) = metals::metal(metal)?;
        match rest {
            "eta.spd" => Some(eta.as_dvec3()),
            "k.spd" => Some(k.as_dvec3()),
            _ => None,
        }
    }

    /// Reads a file of pairs of wavelength and value.
    fn file(&self, p: &Param, name: &str) -> Result<Sampled, SceneError> {
        let path = beside(&self.folder, name);
        let read = Sampled::read(&path).map_err(|e| {
            p.error(format!(
                "`{}` is no name of a spectrum that is supported, and no file: {e}",
                truncated(name)
            ))
        })?;
        read.ok_or_else(|| {
            p.error(format!(
                "{}: expected pairs of wavelength and value",
                path.display()
            ))
        })
    }

    /// Returns the colour of a sampled spectrum. Version 4 extends it by zero, version 3 by its
    /// ends.
    fn sampled(&self, samples: Sampled, purpose: Use) -> DVec3 {
        if self.version == Version::V4 && purpose != Use::Index {
            self.integrated(|nm| samples.at_or_zero(nm), purpose)
        } else {
            self.integrated(|nm| samples.at(nm), purpose)
        }
    }

    /// Returns the colour of a spectrum.
    fn integrated(&self, spectrum: impl Fn(f64) -> f64, purpose: Use) -> DVec3 {
        match (self.version, purpose) {
            (Version::V3, _) => to_srgb() * xyz(spectrum),
            (Version::V4, Use::Reflectance | Use::Index) => under_daylight(spectrum),
            (Version::V4, Use::Light) => {
                let xyz = xyz(spectrum);
                if xyz.y > 0.0 {
                    to_srgb() * xyz / xyz.y
                } else {
                    DVec3::ZERO
                }
            }
        }
    }
}

/// Returns eta and k of copper, the metal of conductors without an index.
pub(super) fn copper() -> (Vec3, Vec3) {
    METALS
        .iter()
        .find(|row| row.0 == "Cu")
        .map_or((Vec3::ZERO, Vec3::ONE), |row| (row.1.into(), row.2.into()))
}

/// Returns the spectrum of pairs of wavelength in nanometres and value.
fn samples(p: &Param, numbers: &[f64]) -> Result<Sampled, SceneError> {
    Sampled::from_numbers(numbers).ok_or_else(|| {
        p.error(format!(
            "expected pairs of wavelength and value, found {} numbers",
            numbers.len()
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::pbrt::params::Params;
    use crate::load::pbrt::token::Lexer;

    fn color(text: &str, version: Version, purpose: Use) -> Result<Vec3, String> {
        let mut lexer = Lexer::new(Path::new("a.pbrt").into(), text.into());
        let place = lexer.place();
        let params = Params::read(&mut lexer, "Material".to_owned(), place).unwrap();
        let spectra = Spectra {
            version,
            color_space: ColorSpace::Srgb,
            folder: PathBuf::new(),
        };
        let read = spectra.color(params.get("x").unwrap(), purpose);
        read.map_err(|e| e.to_string())
    }

    #[test]
    fn a_constant_reflectance_is_grey_in_version_4() {
        let flat = "\"spectrum x\" [ 300 0.25 900 0.25 ]";
        let grey = color(flat, Version::V4, Use::Reflectance).unwrap();
        assert!((grey - 0.25).abs().max_element() < 1e-6, "{grey}");
        // The white of equal energy in sRGB, from its chromaticity 1/3, 1/3.
        let red = color(flat, Version::V3, Use::Reflectance).unwrap() * 4.0;
        let expected = Vec3::new(1.2048, 0.9483, 0.9089);
        assert!((red - expected).abs().max_element() < 2e-3, "{red}");
    }

    #[test]
    fn lights_of_version_4_have_a_luminance_of_one() {
        for text in [
            "\"spectrum x\" [ 300 7 900 7 ]",
            "\"spectrum x\" \"stdillum-A\"",
            "\"blackbody x\" 3000",
        ] {
            let c = color(text, Version::V4, Use::Light).unwrap();
            let y = c.dot(Vec3::new(0.2126, 0.7152, 0.0722));
            assert!((y - 1.0).abs() < 1e-3, "{text}: {c}, luminance {y}");
        }
        // Planck's law with the functions at every nanometre.
        let c = color("\"blackbody x\" 3000", Version::V4, Use::Light).unwrap();
        let expected = Vec3::new(1.7706, 0.8443, 0.2721);
        assert!((c - expected).abs().max_element() < 1e-3, "{c}");
        let c = color("\"blackbody x\" 6500", Version::V4, Use::Light).unwrap();
        assert!((c - Vec3::new(1.0432, 0.9836, 1.0352)).abs().max_element() < 2e-3);
    }

    #[test]
    fn names_files_and_types_are_checked() {
        let v4 = |text: &str| color(text, Version::V4, Use::Index);
        assert_eq!(
            v4("\"spectrum x\" \"glass-BK7\"").unwrap(),
            Vec3::splat(1.5168)
        );
        assert!((v4("\"spectrum x\" \"metal-Cu-eta\"").unwrap().x - 0.1045).abs() < 1e-6);
        let fallback = v4("\"spectrum x\" \"spds/Au.k.spd\"").unwrap();
        assert_eq!(fallback, Vec3::new(3.98316, 2.38572, 1.60322));
        assert!(
            v4("\"spectrum x\" \"none\"")
                .unwrap_err()
                .contains("no name of a spectrum")
        );
        assert!(v4("\"rgb x\" [1 2]").unwrap_err().contains("3 numbers"));
        assert!(v4("\"spectrum x\" [1 2 3]").unwrap_err().contains("pairs"));
        assert!(v4("\"blackbody x\" 1").unwrap_err().contains("kelvin"));
        assert_eq!(v4("\"float x\" 3").unwrap(), Vec3::splat(3.0));
    }
}
