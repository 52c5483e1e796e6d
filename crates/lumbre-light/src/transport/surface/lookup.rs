//! Texture lookups, scalar and in lanes.

use glam::{Vec2, Vec3};

use crate::math::real::{Outlined, Real, Vector};
use crate::math::simd::{F32x8, Lanes};
use crate::scene::compile::{Footprint, NONE, Texture, Uv, UvMap};

/// Returns a texture's colour at texture coordinates, or white without a texture.
#[inline]
pub fn lookup(textures: &[Texture], texture: u32, uv: Uv, tiling: UvMap) -> Vec3 {
    lookup_in_lanes(textures, [texture], &uv, [tiling])
}

/// Returns a texture's red channel at texture coordinates, or `scalar` without a texture.
#[inline]
pub fn lookup_scalar(
    textures: &[Texture],
    texture: u32,
    uv: Uv,
    tiling: UvMap,
    scalar: f32,
) -> f32 {
    if texture == NONE {
        scalar
    } else {
        lookup(textures, texture, uv, tiling).x
    }
}

/// Returns the colours of textures at texture coordinates, one texture per lane; white in lanes
/// whose texture is [`NONE`].
#[inline(always)]
pub fn lookup_in_lanes<R: Lanes<N>, const N: usize>(
    textures: &[Texture],
    ids: [u32; N],
    uv: &Uv<R>,
    tilings: [UvMap; N],
) -> R::Vec3 {
    R::outline(Lookup {
        textures,
        ids,
        uv,
        tilings,
    })
}

/// Outlined computation of [`lookup_in_lanes`].
struct Lookup<'a, R: Real, const N: usize> {
    textures: &'a [Texture],
    ids: [u32; N],
    uv: &'a Uv<R>,
    tilings: [UvMap; N],
}

impl<R: Lanes<N>, const N: usize> Outlined for Lookup<'_, R, N> {
    type Output = R::Vec3;

    #[inline(always)]
    fn run(self) -> R::Vec3 {
        let mut fields = [F32x8::default(); N];
        let mut mapped = false;
        for (i, fields) in fields.iter_mut().enumerate() {
            if let Some(texture) = self.textures.get(self.ids[i] as usize) {
                let UvMap { scale, offset } = self.tilings[i];
                let [width, height, wrap_u, wrap_v] = texture.grid();
                let second = f32::from(u8::from(texture.lookup.second));
                *fields = F32x8([
                    scale, offset.x, offset.y, second, width, height, wrap_u, wrap_v,
                ]);
                mapped |= texture.lookup.map.is_some();
            }
        }
        let [scale, x, y, second, width, height, wrap_u, wrap_v] =
            R::transpose_load(fields.each_ref());
        let second = second.gt(R::splat(0.0));
        let Uv {
            first: [u, v],
            second: [other_u, other_v],
        } = *self.uv;
        let mut uv = [
            R::select(second, other_u, u) * scale + x,
            R::select(second, other_v, v) * scale + y,
        ];
        if mapped {
            uv = self.map(uv);
        }
        let footprint = Footprint::new(uv, [width, height], [wrap_u, wrap_v]);
        self.blend(&footprint)
    }
}

impl<R: Lanes<N>, const N: usize> Lookup<'_, R, N> {
    /// Applies the maps that textures have of their own.
    #[inline(always)]
    fn map(&self, [u, v]: [R; 2]) -> [R; 2] {
        let (mut u, mut v) = (u.store(), v.store());
        for (i, id) in self.ids.iter().enumerate() {
            let texture = self.textures.get(*id as usize);
            if let Some(map) = texture.and_then(|texture| texture.lookup.map) {
                [u[i], v[i]] = map.transform_point2(Vec2::new(u[i], v[i])).to_array();
            }
        }
        [R::load(&u), R::load(&v)]
    }

    /// Interpolates the colours; white in lanes without a texture.
    #[inline(always)]
    fn blend(&self, footprint: &Footprint<R>) -> R::Vec3 {
        let Footprint {
            texels: [a, b, c, d],
            weights: [fx, fy],
        } = *footprint;
        let (a, b) = (R::store_words(a), R::store_words(b));
        let (c, d) = (R::store_words(c), R::store_words(d));
        let (fx, fy) = (fx.store(), fy.store());
        let mut colors = [F32x8([1.0; 8]); N];
        for (i, row) in colors.iter_mut().enumerate() {
            if let Some(texture) = self.textures.get(self.ids[i] as usize) {
                let color = texture.blend([a[i], b[i], c[i], d[i]], [fx[i], fy[i]]);
                row.0[..4].copy_from_slice(&color.to_array());
            }
        }
        let [r, g, b, ..] = R::transpose_load(colors.each_ref());
        R::Vec3::new(r, g, b)
    }
}

#[cfg(test)]
mod tests {
    use glam::Affine2;

    use super::*;
    use crate::math::rng::{pcg4d, unit};
    use crate::math::simd::{SimdKernel, Width, dispatch};
    use crate::scene::desc::{Texels, TextureDesc, Wrap};

    /// Returns textures of several sizes, wrap modes and mappings.
    fn textures() -> Vec<Texture> {
        let texels = |n: u32| -> Vec<[f32; 3]> {
            let texel = |i| pcg4d([i, n, 1, 2]).map(unit);
            (0..n).map(texel).map(|[r, g, b, _]| [r, g, b]).collect()
        };
        let mut textures = Vec::new();
        for wrap_u in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for wrap_v in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
                for [width, height] in [[1, 1], [2, 5], [7, 3]] {
                    let mut texture = Texture::new(width, height, texels(width * height));
                    texture.lookup.wrap = [wrap_u, wrap_v];
                    texture.lookup.second = height == 5;
                    texture.lookup.map = (width == 7).then(|| {
                        Affine2::from_angle(0.3) * Affine2::from_scale(Vec2::new(1.5, 0.7))
                    });
                    textures.push(texture);
                    let byte = |i: u32| pcg4d([i, width, height, 3]).map(|word| word as u8);
                    let bytes: Vec<[u8; 4]> = (0..width * height).map(byte).collect();
                    let image = TextureDesc::new("", width, height, Texels::Rgba8(bytes.into()));
                    textures.push(Texture::decode(&image, height == 5));
                }
            }
        }
        textures
    }

    /// Compares lookups in lanes with one by one, each lane with another texture.
    #[derive(Clone, Copy)]
    struct Comparison<'a>(&'a [Texture]);

    impl SimdKernel for Comparison<'_> {
        type Output = ();

        #[inline(always)]
        fn run<R: Lanes<N>, const N: usize>(self) {
            let count = self.0.len() as u32;
            for round in 0..400u32 {
                let numbers = |i: usize| pcg4d([i as u32, round, 3, 4]).map(unit);
                let ids = std::array::from_fn(|i| match (i as u32 + round) % (count + 1) {
                    k if k == count => NONE,
                    k => k,
                });
                let coordinate = |i: usize, k: usize| match (round as usize + i + k) % 97 {
                    0 => f32::INFINITY,
                    1 => f32::NAN,
                    2 => -1e-9,
                    3 => 1.0,
                    _ => 8.0 * numbers(i)[k] - 4.0,
                };
                let column = |k: usize| std::array::from_fn(|i| coordinate(i, k));
                let [a, b, c, d] = [column(0), column(1), column(2), column(3)];
                let tilings = std::array::from_fn(|i| UvMap {
                    scale: 1.0 + i as f32,
                    offset: Vec2::new(0.25, -0.5),
                });
                let uv = Uv::from_array([R::load(&a), R::load(&b), R::load(&c), R::load(&d)]);
                let found: R::Vec3 = lookup_in_lanes(self.0, ids, &uv, tilings);
                let found = [found.x().store(), found.y().store(), found.z().store()];
                for (i, id) in ids.iter().enumerate() {
                    let own = Uv::from_array([a[i], b[i], c[i], d[i]]);
                    let expected = match self.0.get(*id as usize) {
                        None => Vec3::ONE,
                        Some(texture) => texture.filtered(texture.image_uv(own, tilings[i])),
                    };
                    let found = Vec3::new(found[0][i], found[1][i], found[2][i]);
                    assert_eq!(found, expected, "{N} lanes, texture {id}");
                }
            }
        }
    }

    #[test]
    fn lookups_in_lanes_are_those_of_each_texture() {
        let textures = textures();
        for width in Width::all() {
            dispatch(width, Comparison(&textures));
        }
    }
}
