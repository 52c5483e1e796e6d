//! Numbers, colours and matrices in the attributes of Mitsuba's XML.

use glam::{DAffine3, DMat3, DVec3, Vec3};

use crate::load::spectrum::{Sampled, planck, to_srgb, under_daylight, xyz};
pub(super) use crate::names::truncated;
use lumbre_light::scene::compile::{Curve, srgb_to_linear};

/// Converts names of Mitsuba 0.5, such as `toWorld`, `intIOR` and `maxDepth`, to the spelling of
/// Mitsuba 3.
pub(super) fn snake_case(name: &str) -> String {
    let mut out = String::with_capacity(name.len() + 4);
    let mut lower_before = false;
    for c in name.chars() {
        if c.is_ascii_uppercase() && lower_before {
            out.push('_');
        }
        lower_before = c.is_ascii_lowercase() || c.is_ascii_digit();
        out.push(c.to_ascii_lowercase());
    }
    out
}

/// Parses a number.
pub(super) fn number(text: &str) -> Result<f64, String> {
    let read: f64 = text
        .trim()
        .parse()
        .map_err(|_| format!("`{}` is not a number", truncated(text)))?;
    if read.is_nan() {
        Err("`nan` is not a number".to_owned())
    } else {
        Ok(read)
    }
}

/// Greatest number of values of one element.
const MAX_NUMBERS: usize = 4096;

/// Parses numbers between commas or white space.
pub(super) fn numbers(text: &str) -> Result<Vec<f64>, String> {
    let words = text.split([',', ' ', '\t', '\n', '\r']);
    let words: Vec<&str> = words
        .filter(|w| !w.is_empty())
        .take(MAX_NUMBERS + 1)
        .collect();
    if words.len() > MAX_NUMBERS {
        return Err(format!("more than {MAX_NUMBERS} numbers"));
    }
    words.into_iter().map(number).collect()
}

/// Parses a vector: three numbers, or one for all components.
pub(super) fn vector(text: &str) -> Result<DVec3, String> {
    match numbers(text)?.as_slice() {
        [x, y, z] => Ok(DVec3::new(*x, *y, *z)),
        [x] => Ok(DVec3::splat(*x)),
        other => Err(format!("expected 3 numbers, found {}", other.len())),
    }
}

/// Parses a colour: one number, three, or `#rrggbb` in sRGB.
pub(super) fn color(text: &str) -> Result<Vec3, String> {
    let text = text.trim();
    if let Some(hex) = text.strip_prefix('#') {
        let bits = u32::from_str_radix(hex, 16)
            .ok()
            .filter(|_| hex.len() == 6 && hex.is_ascii());
        let bits = bits.ok_or_else(|| {
            format!(
                "expected six hexadecimal digits, found `{}`",
                truncated(hex)
            )
        })?;
        let channel = |shift: u32| Curve::Srgb.decode((bits >> shift) as u8);
        return Ok(Vec3::new(channel(16), channel(8), channel(0)));
    }
    finite(vector(text)?.as_vec3())
}

/// Parses a colour in sRGB: one number or three from 0 to 1, or `#rrggbb`.
pub(super) fn srgb_color(text: &str) -> Result<Vec3, String> {
    let color = color(text)?;
    if text.trim().starts_with('#') {
        return Ok(color);
    }
    Ok(color.map(srgb_to_linear))
}

/// Linear sRGB of light of equal energy, whose X, Y and Z are 1, with the digits that Mitsuba uses.
const EQUAL_ENERGY: DVec3 = DVec3::new(1.204_794, 0.948_291, 0.908_916);

/// Value of a `spectrum` element.
#[derive(Clone, Debug)]
pub(super) enum Spectrum {
    /// The same value at all wavelengths.
    Constant(f64),
    /// Values at some wavelengths, 0 beyond them.
    Sampled(Sampled),
    /// Radiance of a black body of a temperature in kelvin, times a factor.
    BlackBody([f64; 2]),
    /// A grey in RGB.
    Grey(f64),
    /// A colour that is no spectrum.
    Color(Vec3),
}

impl Spectrum {
    /// Returns the colour that the RGB variants of Mitsuba 3 use: that of light of equal energy for
    /// emitters, and under D65 for everything else. Emission outside of sRGB is cut.
    pub fn color(&self, emits: bool) -> Result<Vec3, String> {
        let color = match self {
            Spectrum::Constant(x) if emits => EQUAL_ENERGY * *x,
            Spectrum::Constant(x) | Spectrum::Grey(x) => DVec3::splat(*x),
            Spectrum::Sampled(samples) if emits => to_srgb() * xyz(|nm| samples.at_or_zero(nm)),
            Spectrum::Sampled(samples) => under_daylight(|nm| samples.at_or_zero(nm)),
            Spectrum::BlackBody([kelvin, scale]) => {
                to_srgb() * xyz(|nm| planck(nm, *kelvin)) * *scale
            }
            Spectrum::Color(color) => return Ok(*color),
        };
        finite(color.as_vec3().max(Vec3::ZERO))
    }
}

/// Parses a spectrum: a number, pairs `wavelength:value`, or a colour as in old files.
pub(super) fn spectrum(text: &str) -> Result<Spectrum, String> {
    if text.contains(':') {
        let words = text.split([',', ' ', '\t', '\n', '\r']);
        let pairs = words.filter(|p| !p.is_empty()).map(|pair| {
            let (nm, value) = pair
                .split_once(':')
                .ok_or("expected pairs of wavelength and value")?;
            Ok([number(nm)?, number(value)?])
        });
        let pairs: Vec<[f64; 2]> = pairs.collect::<Result<_, String>>()?;
        return Ok(Spectrum::Sampled(Sampled::new(pairs)));
    }
    match text.trim().parse() {
        Ok(x) => Ok(Spectrum::Constant(x)),
        Err(_) => Ok(Spectrum::Color(color(text)?)),
    }
}

/// Checks that a colour is finite.
fn finite(c: Vec3) -> Result<Vec3, String> {
    if c.is_finite() {
        Ok(c)
    } else {
        Err("a colour must be finite".to_owned())
    }
}

/// Parses a matrix: sixteen numbers in rows, or the nine of the linear part.
pub(super) fn matrix(text: &str) -> Result<DAffine3, String> {
    let m = numbers(text)?;
    let row = |i: usize, n: usize| DVec3::new(m[i * n], m[i * n + 1], m[i * n + 2]);
    match m.len() {
        9 => Ok(DAffine3::from_mat3(
            DMat3::from_cols(row(0, 3), row(1, 3), row(2, 3)).transpose(),
        )),
        16 if m[12..15].iter().all(|x| *x == 0.0) && m[15] != 0.0 => {
            let linear = DMat3::from_cols(row(0, 4), row(1, 4), row(2, 4)).transpose();
            Ok(DAffine3::from_mat3_translation(
                linear * m[15].recip(),
                DVec3::new(m[3], m[7], m[11]) / m[15],
            ))
        }
        16 => Err(
            "the last row of the matrix must be 0 0 0 1; perspective transforms are not supported"
                .to_owned(),
        ),
        n => Err(format!("expected 16 numbers, found {n}")),
    }
}

/// Returns the map to the world from a camera space that looks along +z with +y up and +x to the
/// left.
pub(super) fn look_at(origin: DVec3, target: DVec3, up: DVec3) -> Result<DAffine3, String> {
    let forward = (target - origin)
        .try_normalize()
        .ok_or("origin and target are the same point")?;
    let left = up
        .cross(forward)
        .try_normalize()
        .ok_or("up is parallel to the view direction")?;
    Ok(DAffine3::from_mat3_translation(
        DMat3::from_cols(left, forward.cross(left), forward),
        origin,
    ))
}
