//! How a texture is laid on a surface.

use glam::Affine2;

/// What a picture shows beyond its edges, along one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Wrap {
    /// The picture again.
    #[default]
    Repeat,
    /// The picture again, every second one turned over.
    Mirror,
    /// The texels at its edge.
    Clamp,
}

impl Wrap {
    /// Every way, in the order of [`Wrap::WORDS`].
    pub const ALL: [Wrap; 3] = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp];

    /// The words for the ways in scripts.
    pub const WORDS: &'static [&'static str] = &["repeat", "mirror", "clamp"];

    /// Its word.
    pub fn word(self) -> &'static str {
        Wrap::WORDS[self as usize]
    }
}

/// A texture is laid so that all its coordinates are one point or one line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the first texture of the material is laid so that no other one can be laid beside it")]
pub struct NoInverse;

/// How one texture of a material lies on the surface, where not as all others do.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lookup {
    /// What is beyond its edges along u and along v.
    pub wrap: [Wrap; 2],
    /// Whether it takes the mesh's second set of texture coordinates.
    pub second: bool,
    /// From texture coordinates, after the material's `tiling` and `uv_offset`, to places in the picture, both with the
    /// bottom left corner as (0, 0) and v growing upwards.
    pub map: Option<Affine2>,
}

impl Lookup {
    /// Whether it says nothing that a texture does not do anyway.
    pub fn is_plain(&self) -> bool {
        *self == Lookup::default()
    }

    /// The map that makes `own` of coordinates that `first` has moved: nothing where both are the same.
    ///
    /// # Errors
    /// Where `first` cannot be undone.
    pub fn beside(first: Affine2, own: Affine2) -> Result<Option<Affine2>, NoInverse> {
        if own == first {
            return Ok(None);
        }
        let map = own * first.inverse();
        if map.is_finite() { Ok(Some(map)) } else { Err(NoInverse) }
    }

    /// Numbers by which one is told from another: `-0.0` counts as `0.0`.
    pub fn key(&self) -> [u32; 9] {
        let [u, v] = self.wrap.map(|wrap| wrap as u32);
        let map = self.map.map_or([0; 6], |map| map.to_cols_array().map(|x| (x + 0.0).to_bits()));
        let [a, b, c, d, x, y] = map;
        [u, v, u32::from(self.second) | u32::from(self.map.is_some()) << 1, a, b, c, d, x, y]
    }
}
