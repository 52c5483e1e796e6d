//! Decoded textures and their lookup.

use glam::{Vec2, Vec3, Vec4};
use serde::{Deserialize, Serialize};

use super::texels::LinearTexels;
use crate::math::real::{Mask, Real, Word};
use crate::math::simd::Lanes;
use crate::scene::desc::{Lookup, TextureDesc, TextureFilter, Wrap};

/// Map from surface texture coordinates to those of a texture: a factor, then an offset.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct UvMap {
    /// Factor on the coordinates: number of repeats.
    pub scale: f32,
    /// Offset in repeats, added after the factor.
    pub offset: Vec2,
}

impl UvMap {
    /// Map that changes nothing.
    pub const IDENTITY: UvMap = UvMap {
        scale: 1.0,
        offset: Vec2::ZERO,
    };

    /// Maps surface texture coordinates to those of a texture.
    #[inline]
    pub fn apply(self, uv: Vec2) -> Vec2 {
        uv * self.scale + self.offset
    }
}

/// Texture coordinates of a surface point, both sets; scalar or vectorised.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Uv<R = f32> {
    /// Coordinates of the first set.
    pub first: [R; 2],
    /// Coordinates of the second set; equal to the first if there is none.
    pub second: [R; 2],
}

impl Uv {
    /// Creates coordinates for a surface with a single set.
    pub fn same(uv: Vec2) -> Uv {
        Uv {
            first: uv.to_array(),
            second: uv.to_array(),
        }
    }
}

impl<R: Real> Uv<R> {
    /// Returns coordinates that are all zero.
    #[inline(always)]
    pub fn zero() -> Uv<R> {
        Uv {
            first: [R::splat(0.0); 2],
            second: [R::splat(0.0); 2],
        }
    }

    /// Returns the coordinates of the first set, then those of the second.
    #[inline(always)]
    pub fn to_array(self) -> [R; 4] {
        let Uv {
            first: [a, b],
            second: [c, d],
        } = self;
        [a, b, c, d]
    }

    /// Returns coordinates from the numbers of [`Uv::to_array`].
    #[inline(always)]
    pub fn from_array([a, b, c, d]: [R; 4]) -> Uv<R> {
        Uv {
            first: [a, b],
            second: [c, d],
        }
    }

    /// Returns `yes` where the mask is set, else `no`.
    #[inline(always)]
    pub fn select(mask: R::Mask, yes: Uv<R>, no: Uv<R>) -> Uv<R> {
        let (yes, mut no) = (yes.to_array(), no.to_array());
        for (no, yes) in no.iter_mut().zip(yes) {
            *no = R::select(mask, yes, *no);
        }
        Uv::from_array(no)
    }

    /// Returns the coordinates of each lane.
    #[inline(always)]
    pub fn lanes<const N: usize>(self) -> [Uv; N]
    where
        R: Lanes<N>,
    {
        let [a, b, c, d] = self.to_array();
        let (a, b, c, d) = (a.store(), b.store(), c.store(), d.store());
        let mut lanes = [Uv::default(); N];
        for (i, lane) in lanes.iter_mut().enumerate() {
            *lane = Uv::from_array([a[i], b[i], c[i], d[i]]);
        }
        lanes
    }
}

/// A texture in linear colour, and its mapping.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Texture {
    /// Number of columns.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// Texels, `[y][x]`, origin top-left.
    pub texels: LinearTexels,
    /// Mapping onto surfaces.
    pub lookup: Lookup,
}

impl Texture {
    /// Creates a repeating texture from linear texels.
    pub fn new(width: u32, height: u32, texels: Vec<[f32; 3]>) -> Texture {
        Texture {
            width,
            height,
            texels: LinearTexels::Floats(texels.into()),
            lookup: Lookup::default(),
        }
    }

    /// Decodes a texture for a slot, as [`LinearTexels::of`].
    pub fn decode(desc: &TextureDesc, srgb: bool) -> Texture {
        Texture {
            width: desc.width,
            height: desc.height,
            texels: LinearTexels::of(&desc.texels, srgb),
            lookup: Lookup::default(),
        }
    }

    /// Returns image coordinates from the texture coordinates of a surface with this tiling.
    #[inline]
    pub fn image_uv(&self, uv: Uv, tiling: UvMap) -> Vec2 {
        let uv = if self.lookup.second {
            uv.second
        } else {
            uv.first
        };
        let surface = tiling.apply(Vec2::from_array(uv));
        self.lookup
            .map
            .map_or(surface, |map| map.transform_point2(surface))
    }

    /// Returns the colour at image coordinates: interpolated between the centres of four texels, or
    /// that of the texel that contains them, as the filter states.
    ///
    /// (0, 0) is the bottom left corner and v points up; beyond the edges the wrap modes apply.
    /// Coordinates that are not finite count as 0.
    pub fn filtered(&self, uv: Vec2) -> Vec3 {
        let [width, height, wrap_u, wrap_v] = self.grid();
        let footprint = Footprint::new(uv.to_array(), [width, height], [wrap_u, wrap_v]);
        self.blend(footprint.texels, footprint.weights).truncate()
    }

    /// Returns width, height and the codes of the wrap modes along u and v, as [`Footprint::new`]
    /// takes them.
    #[inline(always)]
    pub fn grid(&self) -> [f32; 4] {
        let [u, v] = self.lookup.wrap;
        [
            self.width as f32,
            self.height as f32,
            wrap_code(u),
            wrap_code(v),
        ]
    }

    /// Interpolates between the four texels of one lane of a [`Footprint`], or returns the nearest,
    /// as the filter says; the last component is 0.
    #[inline(always)]
    pub fn blend(&self, texels: [u32; 4], [fx, fy]: [f32; 2]) -> Vec4 {
        if self.lookup.filter == TextureFilter::Nearest {
            let nearest = texels[2 * usize::from(fy >= 0.5) + usize::from(fx >= 0.5)];
            return padded(self.texels.at(nearest as usize));
        }
        let [a, b, c, d] = self.texels.four(texels);
        let [a, b, c, d] = [padded(a), padded(b), padded(c), padded(d)];
        a.lerp(b, fx).lerp(c.lerp(d, fx), fy)
    }
}

#[inline(always)]
fn padded([r, g, b]: [f32; 3]) -> Vec4 {
    Vec4::new(r, g, b, 0.0)
}

/// Wrap modes as numbers in lanes.
const MIRROR: f32 = 1.0;
const CLAMP: f32 = 2.0;

/// Returns the code of a wrap mode; 0 repeats.
#[inline(always)]
fn wrap_code(wrap: Wrap) -> f32 {
    match wrap {
        Wrap::Repeat => 0.0,
        Wrap::Mirror => MIRROR,
        Wrap::Clamp => CLAMP,
    }
}

/// The four texels around points of images, an image in each lane.
#[derive(Clone, Copy, Debug)]
pub struct Footprint<R: Real> {
    /// Indices of the texels: upper left, upper right, lower left, lower right.
    pub texels: [R::Word; 4],
    /// Weights of the right and of the lower texels.
    pub weights: [R; 2],
}

impl<R: Real> Footprint<R> {
    /// Finds the texels around image coordinates, given sizes below 2^23 and codes of wrap modes:
    /// see [`Texture::grid`].
    #[inline(always)]
    pub fn new([u, v]: [R; 2], [width, height]: [R; 2], [wrap_u, wrap_v]: [R; 2]) -> Footprint<R> {
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        // Row 0 is the top of the image, v = 0 its bottom; for repeated textures these coincide.
        let top = R::select(wrap_v.eq(zero), zero, one);
        let ([left, right], fx) = neighbours(u, width, wrap_u);
        let ([upper, lower], fy) = neighbours(top - v, height, wrap_v);
        let width = width.truncated();
        let (upper, lower) = (upper.mul(width), lower.mul(width));
        Footprint {
            texels: [
                upper.add(left),
                upper.add(right),
                lower.add(left),
                lower.add(right),
            ],
            weights: [fx, fy],
        }
    }
}

/// Returns the two texels around a coordinate in which the image has length 1, and the weight of
/// the second.
#[inline(always)]
fn neighbours<R: Real>(coordinate: R, size: R, wrap: R) -> ([R::Word; 2], R) {
    let (zero, one, half) = (R::splat(0.0), R::splat(1.0), R::splat(0.5));
    let (mirror, clamp) = (wrap.eq(R::splat(MIRROR)), wrap.eq(R::splat(CLAMP)));
    let others = mirror | clamp;
    let mut wrapped = coordinate - coordinate.floor();
    if others.any() {
        // Forward, then backward.
        let folded = coordinate - R::splat(2.0) * (coordinate * half).floor();
        let clamped = R::select(coordinate.is_finite(), coordinate.clamp(0.0, 1.0), zero);
        wrapped = R::select(mirror, folded, R::select(clamp, clamped, wrapped));
    }
    let x = R::select(wrapped.is_finite(), wrapped, zero) * size - half;
    let low = x.floor();
    let (next, last) = (low + one, size - one);
    let mut texels = [
        R::select(low.lt(zero), last, low),
        R::select(next.gt(last), zero, next),
    ];
    if others.any() {
        texels = [
            R::select(others, inside(low, size, mirror), texels[0]),
            R::select(others, inside(next, size, mirror), texels[1]),
        ];
    }
    ([texels[0].truncated(), texels[1].truncated()], x - low)
}

/// Returns the texel at a position of an image that is mirrored, in the lanes of `mirror`, or
/// extended.
#[inline(always)]
fn inside<R: Real>(position: R, size: R, mirror: R::Mask) -> R {
    let last = size - R::splat(1.0);
    let beyond = mirror & position.gt(last);
    let reflected = R::select(beyond, size + last - position, position);
    reflected.min(last).max(R::splat(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::desc::{Texels, texture_hash};
    use std::path::PathBuf;

    fn desc(width: u32, height: u32, texels: Texels) -> TextureDesc {
        let content_hash = texture_hash(width, height, &texels);
        TextureDesc {
            file: PathBuf::new(),
            width,
            height,
            texels,
            content_hash,
        }
    }

    fn grey(values: &[u8], width: u32) -> TextureDesc {
        let texels: Vec<[u8; 4]> = values.iter().map(|v| [*v, *v, *v, 255]).collect();
        desc(
            width,
            values.len() as u32 / width,
            Texels::Rgba8(texels.into()),
        )
    }

    #[test]
    fn slots_decide_the_curve() {
        let d = grey(&[0, 10, 188, 255], 4);
        let colour = Texture::decode(&d, true);
        let data = Texture::decode(&d, false);
        assert_eq!((colour.texels.at(0)[0], colour.texels.at(3)[0]), (0.0, 1.0));
        assert!((colour.texels.at(1)[0] - 10.0 / 255.0 / 12.92).abs() < 1e-7);
        assert!(
            (colour.texels.at(2)[0] - 0.502_886_5).abs() < 1e-5,
            "{}",
            colour.texels.at(2)[0]
        );
        assert_eq!(data.texels.at(2)[0], 188.0 / 255.0);
        let floats = desc(1, 1, Texels::RgbaF32(vec![[2.0, 0.5, 0.25, 0.0]]));
        assert_eq!(
            Texture::decode(&floats, true).texels.at(0),
            [2.0, 0.5, 0.25]
        );
    }

    #[test]
    fn the_first_row_is_the_top_and_v_points_up() {
        let t = Texture::decode(&grey(&[0, 51, 102, 255], 2), false);
        let near = |uv: [f32; 2], v: f32| {
            let found = t.filtered(Vec2::from_array(uv)).x;
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
    fn textures_wrap_beyond_their_edges() {
        let plain = Texture::decode(&grey(&[0, 51, 102, 255, 30, 60], 3), false);
        // An image of five by five copies, each built texel by texel; the test compares its centre.
        let expected_image = |wrap: [Wrap; 2]| {
            let fold = |i: u32, size: u32, wrap: Wrap| match wrap {
                Wrap::Repeat => i % size,
                Wrap::Mirror if i / size % 2 == 1 => size - 1 - i % size,
                Wrap::Mirror => i % size,
                Wrap::Clamp => {
                    (i as i64 - 2 * i64::from(size)).clamp(0, i64::from(size) - 1) as u32
                }
            };
            let at = |i: u32| {
                let (x, y) = (fold(i % 15, 3, wrap[0]), fold(i / 15, 2, wrap[1]));
                plain.texels.at((y * 3 + x) as usize)
            };
            Texture::new(15, 10, (0..150).map(at).collect::<Vec<_>>())
        };
        for wrap in Wrap::ALL
            .into_iter()
            .flat_map(|u| Wrap::ALL.map(|v| [u, v]))
        {
            let wrapped = Texture {
                lookup: Lookup {
                    wrap,
                    ..Lookup::default()
                },
                ..plain.clone()
            };
            let wrapped_image = expected_image(wrap);
            for i in 0..441 {
                let uv = Vec2::new((i % 21) as f32, (i / 21) as f32) * 0.17 - Vec2::splat(1.4);
                let (found, expected) = (
                    wrapped.filtered(uv),
                    wrapped_image.filtered((uv + 2.0) / 5.0),
                );
                assert!(
                    (found - expected).abs().max_element() < 1e-5,
                    "{wrap:?} {uv}: {found} instead of {expected}"
                );
            }
            for x in [
                f32::NAN,
                f32::INFINITY,
                -1e30,
                1e30,
                -f32::MIN_POSITIVE,
                1.0,
                2.0,
            ] {
                let c = wrapped.filtered(Vec2::new(x, -x));
                assert!(c.is_finite() && c.max_element() <= 1.0, "{x}");
            }
        }
    }

    #[test]
    fn the_nearest_filter_returns_the_texel_that_contains_the_point() {
        let plain = Texture::decode(&grey(&[0, 51, 102, 255, 30, 60], 3), false);
        for wrap in Wrap::ALL {
            let nearest = Texture {
                lookup: Lookup {
                    wrap: [wrap; 2],
                    filter: TextureFilter::Nearest,
                    ..Lookup::default()
                },
                ..plain.clone()
            };
            for i in 0..961 {
                let uv = Vec2::new((i % 31) as f32, (i / 31) as f32) * 0.131 - Vec2::splat(1.7);
                // Column and row from the left and the top, each folded into the image.
                let texel = |x: f64, size: i64| {
                    let i = (x * size as f64).floor() as i64;
                    match wrap {
                        Wrap::Repeat => i.rem_euclid(size),
                        Wrap::Mirror if i.div_euclid(size) % 2 != 0 => {
                            size - 1 - i.rem_euclid(size)
                        }
                        Wrap::Mirror => i.rem_euclid(size),
                        Wrap::Clamp => i.clamp(0, size - 1),
                    }
                };
                let column = texel(f64::from(uv.x), 3);
                let row = texel(1.0 - f64::from(uv.y), 2);
                let expected = plain.texels.at((row * 3 + column) as usize);
                assert_eq!(nearest.filtered(uv).to_array(), expected, "{wrap:?} {uv}");
            }
        }
    }

    #[test]
    fn textures_repeat_and_accept_any_coordinate() {
        let t = Texture::decode(&grey(&[0, 51, 102, 255], 2), false);
        for uv in [
            Vec2::new(0.3, 0.8),
            Vec2::new(0.0, 0.0),
            Vec2::new(0.99, 0.01),
        ] {
            for shift in [Vec2::new(1.0, 0.0), Vec2::new(-3.0, 7.0)] {
                assert!(
                    (t.filtered(uv) - t.filtered(uv + shift))
                        .abs()
                        .max_element()
                        < 1e-5
                );
            }
        }
        for x in [
            f32::NAN,
            f32::INFINITY,
            -1e30,
            1e30,
            f32::MIN_POSITIVE,
            -f32::MIN_POSITIVE,
            1.0,
        ] {
            let c = t.filtered(Vec2::new(x, -x));
            assert!(c.is_finite() && c.max_element() <= 1.0, "{x}");
        }
    }
}
