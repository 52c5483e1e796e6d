//! Texture lookups, scalar and in lanes.

use glam::Vec3;

use crate::math::real::{Outlined, Real, Vector};
use crate::math::simd::Lanes;
use crate::scene::compile::{NONE, Texture, Uv, UvMap};

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
        let uv: [Uv; N] = self.uv.lanes();
        let mut colors = [[1.0; N]; 3];
        for i in 0..N {
            if let Some(texture) = self.textures.get(self.ids[i] as usize) {
                let at = texture.image_uv(uv[i], self.tilings[i]);
                [colors[0][i], colors[1][i], colors[2][i]] = texture.filtered(at).to_array();
            }
        }
        let [r, g, b] = &colors;
        R::Vec3::new(R::load(r), R::load(g), R::load(b))
    }
}
