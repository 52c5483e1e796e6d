//! Textures as the integrators read them.

use glam::{Vec2, Vec3};

use crate::scene::desc::{Texels, TextureDesc};

/// From texture coordinates to places in a texture: a factor, then an offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UvMap {
    /// The factor: how often a texture repeats.
    pub scale: f32,
    /// The offset in repeats.
    pub offset: Vec2,
}

impl UvMap {
    /// The map that changes nothing.
    pub const IDENTITY: UvMap = UvMap { scale: 1.0, offset: Vec2::ZERO };

    /// The place in a texture of texture coordinates.
    #[inline]
    pub fn apply(self, uv: Vec2) -> Vec2 {
        uv * self.scale + self.offset
    }
}

/// A texture in linear colour.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Linear texels, `[y][x][rgb]`, origin top-left.
    pub texels: Vec<[f32; 3]>,
}

impl Texture {
    /// Decodes a texture for a role: eight-bit texels through the sRGB curve if `srgb`, else as fractions of 255;
    /// floats are linear already. Alpha is dropped.
    pub fn decode(desc: &TextureDesc, srgb: bool) -> Texture {
        let texels = match &desc.texels {
            Texels::Rgba8(texels) => {
                let curve: Vec<f32> = (0..=255u8)
                    .map(|b| f32::from(b) / 255.0)
                    .map(|x| if srgb { srgb_to_linear(x) } else { x })
                    .collect();
                texels.iter().map(|[r, g, b, _]| [*r, *g, *b].map(|c| curve[usize::from(c)])).collect()
            }
            Texels::RgbaF32(texels) => texels.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect(),
        };
        Texture { width: desc.width, height: desc.height, texels }
    }

    /// The colour at texture coordinates, interpolated between the centres of four texels.
    ///
    /// The picture repeats; (0, 0) is its bottom left corner and v grows upwards. Coordinates that are not finite
    /// count as 0.
    pub fn bilinear(&self, uv: Vec2) -> Vec3 {
        let (x0, x1, fx) = neighbours(uv.x, self.width);
        // Row 0 is the top of the picture, v = 0 its bottom.
        let (y0, y1, fy) = neighbours(-uv.y, self.height);
        let at = |x: u32, y: u32| Vec3::from_array(self.texels[y as usize * self.width as usize + x as usize]);
        at(x0, y0).lerp(at(x1, y0), fx).lerp(at(x0, y1).lerp(at(x1, y1), fx), fy)
    }
}

/// The two texels around a coordinate that repeats with period 1, and the weight of the second.
fn neighbours(coordinate: f32, size: u32) -> (u32, u32, f32) {
    let wrapped = coordinate - coordinate.floor();
    let x = if wrapped.is_finite() { wrapped } else { 0.0 } * size as f32 - 0.5;
    let low = x.floor();
    let first = (low as i64).rem_euclid(i64::from(size)) as u32;
    (first, (first + 1) % size, x - low)
}

/// The decoding curve of sRGB [IEC 61966-2-1], from 0..=1 to 0..=1.
pub(in crate::scene) fn srgb_to_linear(x: f32) -> f32 {
    if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::desc::texture_hash;
    use std::path::PathBuf;

    fn desc(width: u32, height: u32, texels: Texels) -> TextureDesc {
        let content_hash = texture_hash(width, height, &texels);
        TextureDesc { file: PathBuf::new(), width, height, texels, content_hash }
    }

    fn grey(values: &[u8], width: u32) -> TextureDesc {
        let texels = values.iter().map(|v| [*v, *v, *v, 255]).collect();
        desc(width, values.len() as u32 / width, Texels::Rgba8(texels))
    }

    #[test]
    fn roles_decide_the_curve() {
        let d = grey(&[0, 10, 188, 255], 4);
        let colour = Texture::decode(&d, true);
        let data = Texture::decode(&d, false);
        assert_eq!((colour.texels[0][0], colour.texels[3][0]), (0.0, 1.0));
        assert!((colour.texels[1][0] - 10.0 / 255.0 / 12.92).abs() < 1e-7);
        assert!((colour.texels[2][0] - 0.502_886_5).abs() < 1e-5, "{}", colour.texels[2][0]);
        assert_eq!(data.texels[2][0], 188.0 / 255.0);
        let floats = desc(1, 1, Texels::RgbaF32(vec![[2.0, 0.5, 0.25, 0.0]]));
        assert_eq!(Texture::decode(&floats, true).texels[0], [2.0, 0.5, 0.25]);
    }

    #[test]
    fn the_first_row_is_the_top_and_v_grows_upwards() {
        let t = Texture::decode(&grey(&[0, 51, 102, 255], 2), false);
        let near = |uv: [f32; 2], v: f32| {
            let found = t.bilinear(Vec2::from_array(uv)).x;
            assert!((found - v).abs() < 1e-6, "{uv:?}: {found} instead of {v}");
        };
        near([0.25, 0.75], 0.0);
        near([0.75, 0.75], 0.2);
        near([0.25, 0.25], 0.4);
        near([0.75, 0.25], 1.0);
        near([0.5, 0.5], 0.4);
        near([0.5, 0.75], 0.1);
    }

    #[test]
    fn it_repeats_and_survives_any_coordinate() {
        let t = Texture::decode(&grey(&[0, 51, 102, 255], 2), false);
        for uv in [Vec2::new(0.3, 0.8), Vec2::new(0.0, 0.0), Vec2::new(0.99, 0.01)] {
            for shift in [Vec2::new(1.0, 0.0), Vec2::new(-3.0, 7.0)] {
                assert!((t.bilinear(uv) - t.bilinear(uv + shift)).abs().max_element() < 1e-5);
            }
        }
        for x in [f32::NAN, f32::INFINITY, -1e30, 1e30, f32::MIN_POSITIVE, -f32::MIN_POSITIVE, 1.0] {
            let c = t.bilinear(Vec2::new(x, -x));
            assert!(c.is_finite() && c.max_element() <= 1.0, "{x}");
        }
    }
}
