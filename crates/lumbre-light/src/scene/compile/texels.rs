//! Texels in memory: as an image file has them, or as floats.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::scene::desc::Texels;

/// Texels of a texture, `[y][x]`, origin top-left, read as linear red, green and blue; shared between
/// textures that differ only in their mapping.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum LinearTexels {
    /// Red, green, blue and an unused byte, each an index of the table of a curve: a third of the
    /// memory of floats, with the same values.
    Bytes(Arc<[[u8; 4]]>, Curve),
    /// Linear values as they are.
    Floats(Arc<[[f32; 3]]>),
}

/// Curve by which bytes encode linear values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Curve {
    /// Fractions of 255.
    Linear,
    /// The sRGB curve [IEC 61966-2-1].
    Srgb,
}

impl Curve {
    /// Both curves, in order.
    pub const ALL: [Curve; 2] = [Curve::Linear, Curve::Srgb];

    /// Returns the curve of colours in sRGB, or that of data.
    pub fn of(srgb: bool) -> Curve {
        if srgb { Curve::Srgb } else { Curve::Linear }
    }

    /// Returns the linear value of a byte, from 0 to 1.
    #[inline]
    pub fn decode(self, byte: u8) -> f32 {
        self.table()[usize::from(byte)]
    }

    /// Returns the linear value of every byte, from 0 to 1.
    #[inline(always)]
    pub fn table(self) -> &'static [f32; 256] {
        match self {
            Curve::Linear => &FRACTIONS,
            Curve::Srgb => &SRGB,
        }
    }
}

static FRACTIONS: [f32; 256] = {
    let (mut table, mut byte) = ([0.0; 256], 0);
    while byte < 256 {
        table[byte] = byte as f32 / 255.0;
        byte += 1;
    }
    table
};

/// Values of [`srgb_to_linear`]: stored, since powers differ in the last bit between systems.
static SRGB: [f32; 256] = {
    let (mut table, mut byte) = ([0.0; 256], 0);
    while byte < 256 {
        table[byte] = f32::from_bits(SRGB_BITS[byte]);
        byte += 1;
    }
    table
};

impl LinearTexels {
    /// Takes the texels of an image: bytes through the sRGB curve if `srgb`, else as fractions of
    /// 255; floats are linear already. Alpha is dropped.
    pub fn of(texels: &Texels, srgb: bool) -> LinearTexels {
        match texels {
            Texels::Rgba8(bytes) => LinearTexels::Bytes(Arc::clone(bytes), Curve::of(srgb)),
            Texels::RgbaF32(floats) => {
                LinearTexels::Floats(floats.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect())
            }
        }
    }

    /// Returns the number of texels.
    pub fn len(&self) -> usize {
        match self {
            LinearTexels::Bytes(bytes, _) => bytes.len(),
            LinearTexels::Floats(floats) => floats.len(),
        }
    }

    /// Returns whether there are no texels.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns four texels.
    ///
    /// # Panics
    /// Panics if an index is not less than [`LinearTexels::len`].
    #[inline(always)]
    pub fn four(&self, [a, b, c, d]: [u32; 4]) -> [[f32; 3]; 4] {
        // Without closures, which are not inlined into code for wide vectors.
        let [a, b, c, d] = [a as usize, b as usize, c as usize, d as usize];
        match self {
            LinearTexels::Bytes(bytes, curve) => {
                let (t, table) = (&bytes[..], curve.table());
                let (a, b) = (linear(t[a], table), linear(t[b], table));
                [a, b, linear(t[c], table), linear(t[d], table)]
            }
            LinearTexels::Floats(t) => [t[a], t[b], t[c], t[d]],
        }
    }

    /// Returns the texel with this index.
    ///
    /// # Panics
    /// Panics if the index is not less than [`LinearTexels::len`].
    #[inline(always)]
    pub fn at(&self, at: usize) -> [f32; 3] {
        match self {
            LinearTexels::Bytes(bytes, curve) => linear(bytes[at], curve.table()),
            LinearTexels::Floats(floats) => floats[at],
        }
    }

    /// Returns all texels in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = [f32; 3]> + '_ {
        (0..self.len()).map(|at| self.at(at))
    }

    /// Returns linear values to be changed; `None` for bytes, all of whose values are from 0 to 1.
    pub fn floats_mut(&mut self) -> Option<&mut [[f32; 3]]> {
        match self {
            LinearTexels::Bytes(..) => None,
            LinearTexels::Floats(floats) => Some(Arc::make_mut(floats)),
        }
    }

    /// Returns a number that two textures have in common if they share the memory of their texels.
    pub fn address(&self) -> usize {
        match self {
            LinearTexels::Bytes(bytes, _) => bytes.as_ptr().addr(),
            LinearTexels::Floats(floats) => floats.as_ptr().addr(),
        }
    }

    /// Returns whether these are the texels of another texture: in the same memory, and read by the
    /// same curve.
    pub fn is(&self, other: &LinearTexels) -> bool {
        let curve = |texels: &LinearTexels| match texels {
            LinearTexels::Bytes(_, curve) => Some(*curve),
            LinearTexels::Floats(_) => None,
        };
        self.address() == other.address() && curve(self) == curve(other)
    }

    /// Returns the memory of the texels in bytes.
    pub fn memory(&self) -> usize {
        match self {
            LinearTexels::Bytes(bytes, _) => size_of_val::<[[u8; 4]]>(bytes),
            LinearTexels::Floats(floats) => size_of_val::<[[f32; 3]]>(floats),
        }
    }
}

/// Returns the linear values of bytes.
#[inline(always)]
fn linear([r, g, b, _]: [u8; 4], table: &[f32; 256]) -> [f32; 3] {
    [
        table[usize::from(r)],
        table[usize::from(g)],
        table[usize::from(b)],
    ]
}

/// Decodes sRGB [IEC 61966-2-1], from 0..=1 to 0..=1.
pub fn srgb_to_linear(x: f32) -> f32 {
    if x <= 0.04045 {
        x / 12.92
    } else {
        ((x + 0.055) / 1.055).powf(2.4)
    }
}

/// Bits of the linear values of bytes in sRGB.
const SRGB_BITS: [u32; 256] = [
    0x00000000, 0x399f22b4, 0x3a1f22b4, 0x3a6eb40e, 0x3a9f22b4, 0x3ac6eb61, 0x3aeeb40e, 0x3b0b3e5d,
    0x3b1f22b4, 0x3b33070b, 0x3b46eb61, 0x3b5b518d, 0x3b70f18d, 0x3b83e1c6, 0x3b8fe616, 0x3b9c87fd,
    0x3ba9c9b7, 0x3bb7ad6f, 0x3bc63549, 0x3bd56361, 0x3be539c1, 0x3bf5ba70, 0x3c0373b5, 0x3c0c6152,
    0x3c15a703, 0x3c1f45be, 0x3c293e6b, 0x3c3391f7, 0x3c3e4149, 0x3c494d43, 0x3c54b6c7, 0x3c607eb1,
    0x3c6ca5df, 0x3c792d22, 0x3c830aa8, 0x3c89af9f, 0x3c9085db, 0x3c978dc5, 0x3c9ec7c2, 0x3ca63433,
    0x3cadd37d, 0x3cb5a601, 0x3cbdac20, 0x3cc5e639, 0x3cce54ab, 0x3cd6f7d5, 0x3cdfd010, 0x3ce8ddb9,
    0x3cf2212c, 0x3cfb9ac1, 0x3d02a569, 0x3d0798dc, 0x3d0ca7e6, 0x3d11d2af, 0x3d171963, 0x3d1c7c2e,
    0x3d21fb3c, 0x3d2796b2, 0x3d2d4ebb, 0x3d332380, 0x3d39152b, 0x3d3f23e3, 0x3d454fd1, 0x3d4b991c,
    0x3d51ffef, 0x3d58846a, 0x3d5f26b7, 0x3d65e6fe, 0x3d6cc564, 0x3d73c20f, 0x3d7add29, 0x3d810b67,
    0x3d84b795, 0x3d887330, 0x3d8c3e4a, 0x3d9018f6, 0x3d940345, 0x3d97fd4a, 0x3d9c0716, 0x3da020bb,
    0x3da44a4b, 0x3da883d7, 0x3daccd70, 0x3db12728, 0x3db59112, 0x3dba0b3b, 0x3dbe95b5, 0x3dc33092,
    0x3dc7dbe2, 0x3dcc97b6, 0x3dd1641f, 0x3dd6412c, 0x3ddb2eef, 0x3de02d77, 0x3de53cd5, 0x3dea5d19,
    0x3def8e52, 0x3df4d091, 0x3dfa23e8, 0x3dff8861, 0x3e027f07, 0x3e054280, 0x3e080ea3, 0x3e0ae378,
    0x3e0dc105, 0x3e10a754, 0x3e13966b, 0x3e168e52, 0x3e198f10, 0x3e1c98ad, 0x3e1fab30, 0x3e22c6a3,
    0x3e25eb09, 0x3e29186c, 0x3e2c4ed0, 0x3e2f8e41, 0x3e32d6c4, 0x3e362861, 0x3e39831e, 0x3e3ce703,
    0x3e405416, 0x3e43ca5f, 0x3e4749e4, 0x3e4ad2ae, 0x3e4e64c2, 0x3e520027, 0x3e55a4e6, 0x3e595303,
    0x3e5d0a8b, 0x3e60cb7c, 0x3e6495e0, 0x3e6869bf, 0x3e6c4720, 0x3e702e0c, 0x3e741e84, 0x3e781890,
    0x3e7c1c38, 0x3e8014c2, 0x3e82203c, 0x3e84308d, 0x3e8645ba, 0x3e885fc5, 0x3e8a7eb2, 0x3e8ca283,
    0x3e8ecb3d, 0x3e90f8e1, 0x3e932b74, 0x3e9562f8, 0x3e979f71, 0x3e99e0e2, 0x3e9c274e, 0x3e9e72b7,
    0x3ea0c322, 0x3ea31892, 0x3ea57308, 0x3ea7d289, 0x3eaa3718, 0x3eaca0b7, 0x3eaf0f69, 0x3eb18333,
    0x3eb3fc18, 0x3eb67a18, 0x3eb8fd37, 0x3ebb8579, 0x3ebe12e1, 0x3ec0a571, 0x3ec33d2d, 0x3ec5da17,
    0x3ec87c33, 0x3ecb2383, 0x3ecdd00b, 0x3ed081cd, 0x3ed338cc, 0x3ed5f50b, 0x3ed8b68d, 0x3edb7d54,
    0x3ede4965, 0x3ee11ac1, 0x3ee3f16b, 0x3ee6cd67, 0x3ee9aeb6, 0x3eec955d, 0x3eef815d, 0x3ef272ba,
    0x3ef56976, 0x3ef86594, 0x3efb6717, 0x3efe6e02, 0x3f00bd2d, 0x3f02460e, 0x3f03d1a7, 0x3f055ff9,
    0x3f06f106, 0x3f0884cf, 0x3f0a1b56, 0x3f0bb49b, 0x3f0d50a0, 0x3f0eef67, 0x3f1090f1, 0x3f12353e,
    0x3f13dc51, 0x3f15862b, 0x3f1732cd, 0x3f18e239, 0x3f1a946f, 0x3f1c4971, 0x3f1e0141, 0x3f1fbbdf,
    0x3f21794e, 0x3f23398e, 0x3f24fca0, 0x3f26c286, 0x3f288b41, 0x3f2a56d3, 0x3f2c253d, 0x3f2df680,
    0x3f2fca9e, 0x3f31a197, 0x3f337b6c, 0x3f355820, 0x3f3737b3, 0x3f391a26, 0x3f3aff7c, 0x3f3ce7b5,
    0x3f3ed2d2, 0x3f40c0d4, 0x3f42b1be, 0x3f44a590, 0x3f469c4b, 0x3f4895f1, 0x3f4a9282, 0x3f4c9201,
    0x3f4e946e, 0x3f5099cb, 0x3f52a218, 0x3f54ad57, 0x3f56bb8a, 0x3f58ccb0, 0x3f5ae0cd, 0x3f5cf7e0,
    0x3f5f11ec, 0x3f612eee, 0x3f634eef, 0x3f6571e9, 0x3f6797e3, 0x3f69c0d6, 0x3f6beccd, 0x3f6e1bbf,
    0x3f704db8, 0x3f7282af, 0x3f74baae, 0x3f76f5ae, 0x3f7933b9, 0x3f7b74c6, 0x3f7db8e0, 0x3f800000,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_of_srgb_has_the_values_of_the_curve() {
        for (byte, stored) in Curve::Srgb.table().iter().enumerate() {
            let computed = srgb_to_linear(byte as f32 / 255.0);
            let distance = stored.to_bits().abs_diff(computed.to_bits());
            assert!(distance <= 1, "{byte}: {stored} instead of {computed}");
        }
    }

    #[test]
    fn bytes_are_indices_of_their_curve() {
        let image = Texels::Rgba8(vec![[0, 51, 255, 7], [188, 10, 1, 0]].into());
        let (colour, data) = (
            LinearTexels::of(&image, true),
            LinearTexels::of(&image, false),
        );
        assert_eq!((colour.at(0)[0], colour.at(0)[2]), (0.0, 1.0));
        assert_eq!(data.at(0), [0.0, 0.2, 1.0]);
        assert!((colour.at(1)[0] - 0.502_886_5).abs() < 1e-5);
        assert_eq!(colour.four([0, 1, 1, 0])[2], colour.at(1));
        assert_eq!(data.iter().len(), data.len());
        assert_eq!((colour.memory(), colour.address()), (8, data.address()));
        assert!(colour.is(&colour.clone()) && !colour.is(&data));
    }
}
