//! Mapping of a texture onto a surface: wrap modes, texture coordinate set and affine map.

use glam::Affine2;
use serde::{Deserialize, Serialize};

crate::named! {
    /// Continuation of a texture beyond its edges, along one axis.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
    pub enum Wrap {
        /// Repeats the texture.
        #[default]
        Repeat = "repeat",
        /// Repeats the texture, every second copy mirrored.
        Mirror = "mirror",
        /// Extends the texels at the edge.
        Clamp = "clamp",
    }
}

crate::named! {
    /// Interpolation between the texels of a texture.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
    pub enum TextureFilter {
        /// Interpolates linearly between the centres of four texels.
        #[default]
        Bilinear = "bilinear",
        /// Takes the texel that contains the point.
        Nearest = "nearest",
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
