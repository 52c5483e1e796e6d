//! Decoding of the 8-bit texels of image maps.

use super::params::Params;
use super::token::truncated;
use super::version::Version;
use lumbre_light::scene::SceneError;
use lumbre_light::scene::compile::srgb_to_linear;

/// Decoding of 8-bit texels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Decoding {
    /// The transfer function of sRGB.
    Srgb,
    /// A power; 1 is linear.
    Power(f32),
}

impl Decoding {
    /// Returns the linear value of a texel in 0..=1.
    pub fn apply(self, x: f32) -> f32 {
        match self {
            Decoding::Srgb => srgb_to_linear(x),
            Decoding::Power(gamma) => x.powf(gamma),
        }
    }
}

/// Returns the decoding of the 8-bit texels of an image map. Version 4 applies `encoding` to PNG
/// files only.
pub(super) fn decoding(
    params: &Params,
    file: &str,
    version: Version,
) -> Result<Decoding, SceneError> {
    if version == Version::V3 {
        let coded = params.flag("gamma", true)?;
        return Ok(if coded {
            Decoding::Srgb
        } else {
            Decoding::Power(1.0)
        });
    }
    let given = params.text("encoding")?.unwrap_or("sRGB");
    let decoding = match given.split_whitespace().collect::<Vec<_>>().as_slice() {
        ["sRGB"] => Decoding::Srgb,
        ["linear"] => Decoding::Power(1.0),
        ["gamma", number] => match number.parse::<f32>() {
            Ok(gamma) if (0.01..=100.0).contains(&gamma) => Decoding::Power(gamma),
            _ => return Err(params.error("`encoding`: expected a gamma from 0.01 to 100")),
        },
        _ => {
            return Err(params.error(format!(
                "`encoding` is `sRGB`, `linear` or `gamma NUMBER`, found `{}`",
                truncated(given)
            )));
        }
    };
    let is_png = file.to_ascii_lowercase().ends_with(".png");
    Ok(if is_png { decoding } else { Decoding::Srgb })
}
