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
        for i in 0..N {
            if let Some(texture) = self.textures.get(self.ids[i] as usize) {
                let UvMap { scale, offset } = self.tilings[i];
                let [width, height, wrap_u, wrap_v] = texture.grid();
                let second = f32::from(u8::from(texture.lookup.second));
                fields[i] = F32x8([
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
        for i in 0..N {
            let texture = self.textures.get(self.ids[i] as usize);
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
        for i in 0..N {
            if let Some(texture) = self.textures.get(self.ids[i] as usize) {
                let color = texture.blend([a[i], b[i], c[i], d[i]], [fx[i], fy[i]]);
                colors[i].0[..4].copy_from_slice(&color.to_array());
            }
        }
        let [r, g, b, ..] = R::transpose_load(colors.each_ref());
        R::Vec3::new(r, g, b)
    }
}
