//! Numbers, colours and matrices in the attributes of Mitsuba's XML.

use glam::{DAffine3, DMat3, DVec3, Vec3};

use crate::scene::compile::srgb_to_linear;

/// Returns the beginning of a text, for messages.
pub(super) fn truncated(text: &str) -> String {
    let mut out: String = text.chars().take(32).collect();
    if out.len() < text.len() {
        out.push_str("...");
    }
    out
}

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

/// Parses numbers between commas or white space.
fn numbers(text: &str) -> Result<Vec<f64>, String> {
    text.split([',', ' ', '\t', '\n', '\r'])
        .filter(|w| !w.is_empty())
        .take(64)
        .map(number)
        .collect()
}

/// Parses a vector: three numbers, or one for all components.
pub(super) fn vector(text: &str) -> Result<Vec3, String> {
    match numbers(text)?.as_slice() {
        [x, y, z] => Ok(DVec3::new(*x, *y, *z).as_vec3()),
        [x] => Ok(Vec3::splat(*x as f32)),
        other => Err(format!("expected 3 numbers, found {}", other.len())),
    }
}

/// Parses a colour: one number, three, `#rrggbb` in sRGB, or a spectrum, whose mean is used. Also
/// returns a note, if there is one.
pub(super) fn color(text: &str) -> Result<(Vec3, Option<&'static str>), String> {
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
        let channel = |shift: u32| srgb_to_linear(((bits >> shift) & 255) as f32 / 255.0);
        return Ok((Vec3::new(channel(16), channel(8), channel(0)), None));
    }
    if text.contains(':') {
        let mut samples = Vec::new();
        for pair in text.split([',', ' ']).filter(|p| !p.is_empty()).take(4096) {
            let (wavelength, value) = pair
                .split_once(':')
                .ok_or("expected pairs of wavelength and value")?;
            number(wavelength)?;
            samples.push(number(value)?);
        }
        let mean = samples.iter().sum::<f64>() / samples.len().max(1) as f64;
        let note = "spectra are not supported; the mean value is used as a grey";
        return finite(Vec3::splat(mean as f32)).map(|c| (c, Some(note)));
    }
    finite(vector(text)?).map(|c| (c, None))
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
pub(super) fn look_at(origin: Vec3, target: Vec3, up: Vec3) -> Result<DAffine3, String> {
    let (origin, target, up) = (origin.as_dvec3(), target.as_dvec3(), up.as_dvec3());
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
