//! Mapping of a texture onto a surface: wrap modes, texture coordinate set and affine map.

use glam::Affine2;
use serde::{Deserialize, Serialize};

/// Continuation of a texture beyond its edges, along one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Wrap {
    /// Repeats the texture.
    #[default]
    Repeat,
    /// Repeats the texture, every second copy mirrored.
    Mirror,
    /// Extends the texels at the edge.
    Clamp,
}

impl Wrap {
    /// Every mode, in the order of [`Wrap::NAMES`].
    pub const ALL: [Wrap; 3] = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp];

    /// Names of the modes in scripts.
    pub const NAMES: &'static [&'static str] = &["repeat", "mirror", "clamp"];

    /// Returns the name of the mode.
    pub fn name(self) -> &'static str {
        Wrap::NAMES[self as usize]
    }
}

/// Interpolation between the texels of a texture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum TextureFilter {
    /// Interpolates linearly between the centres of four texels.
    #[default]
    Bilinear,
    /// Takes the texel that contains the point.
    Nearest,
}

impl TextureFilter {
    /// Every filter, in the order of [`TextureFilter::NAMES`].
    pub const ALL: [TextureFilter; 2] = [TextureFilter::Bilinear, TextureFilter::Nearest];

    /// Names of the filters in scripts.
    pub const NAMES: &'static [&'static str] = &["bilinear", "nearest"];

    /// Returns the name of the filter.
    pub fn name(self) -> &'static str {
        TextureFilter::NAMES[self as usize]
    }
}

/// Error: a texture maps all coordinates to one point or one line, so that no other map can be
/// expressed relative to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the map of the material's first texture is not invertible, so other textures of the material \
     cannot be mapped differently"
)]
pub struct NoInverse;

/// Mapping of one texture of a material that differs from the material's other textures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Lookup {
    /// Wrap modes along u and v.
    pub wrap: [Wrap; 2],
    /// Interpolation between texels.
    pub filter: TextureFilter,
    /// Whether the texture uses the mesh's second set of texture coordinates.
    pub second: bool,
    /// Map from texture coordinates, after the material's `tiling` and `uv_offset`, to image
    /// coordinates; both have (0, 0) at the bottom left and v pointing up.
    pub map: Option<Affine2>,
}

impl Lookup {
    /// Returns whether this is the default mapping.
    pub fn is_plain(&self) -> bool {
        *self == Lookup::default()
    }

    /// Returns the map that, applied after `first`, is equal to `own`; `None` if the two are equal.
    ///
    /// # Errors
    /// Fails if `first` is not invertible.
    pub fn relative_to(first: Affine2, own: Affine2) -> Result<Option<Affine2>, NoInverse> {
        if own == first {
            return Ok(None);
        }
        let map = own * first.inverse();
        if map.is_finite() {
            Ok(Some(map))
        } else {
            Err(NoInverse)
        }
    }

    /// Returns numbers that are equal exactly for equal mappings; `-0.0` counts as `0.0`.
    pub fn key(&self) -> [u32; 9] {
        let [u, v] = self.wrap.map(|wrap| wrap as u32);
        let map = self.map.map_or([0; 6], |map| {
            map.to_cols_array().map(|x| (x + 0.0).to_bits())
        });
        let [a, b, c, d, x, y] = map;
        [
            u,
            v,
            u32::from(self.second) | u32::from(self.map.is_some()) << 1 | (self.filter as u32) << 2,
            a,
            b,
            c,
            d,
            x,
            y,
        ]
    }
}
