//! Normal maps, bump maps, and the direction of anisotropy.

use glam::{Vec2, Vec3};

use super::{Primitives, Spheres, Surface, SurfaceTraits, Triangles, load_vectors};
use crate::math::real::{Real, Vector};
use crate::math::simd::{F32x8, Lanes, map_array};
use crate::scene::CompiledScene;
use crate::scene::compile::{Formulas, Material, Uv};
use crate::transport::ray::RayHits;

/// A mapped normal that points behind the geometric surface is tilted until its cosine with the
/// geometric normal has this value.
const GRAZING_COSINE: f32 = 1e-3;

/// The axes of normal maps: directions of increasing u and v, and the normal.
struct MapAxes<V> {
    u: V,
    v: V,
    n: V,
}

impl<R: Lanes<N>, const N: usize> Surface<'_, R, N> {
    /// Applies the normal map and determines the direction of anisotropy.
    #[inline(always)]
    pub(super) fn orient(
        &mut self,
        scene: &CompiledScene,
        traits: &SurfaceTraits,
        hits: &RayHits<R, N>,
        primitives: &Primitives<R>,
    ) {
        let axes = match primitives {
            Primitives::Triangles(triangles) => triangle_axes(scene, triangles, hits),
            Primitives::Spheres(_) => sphere_axes(self.n_shading),
        };
        let zero = R::Vec3::broadcast(Vec3::ZERO);
        if traits.normal_map {
            let texel = decoded(self.texels(&scene.textures, |m| m.normal_texture));
            let strength = R::load(&map_array(self.materials, |m| m.normal_strength));
            let n = axes.u * (texel.x() * strength)
                + axes.v * (texel.y() * strength)
                + axes.n * texel.z();
            let mapped = self.in_front(n.normalize_or(self.n_shading));
            self.n_shading = R::Vec3::select(axes.u.same(zero), self.n_shading, mapped);
        }
        self.tangent = if traits.direction_map {
            let texel = decoded(self.texels(&scene.textures, |m| m.anisotropic_texture));
            axes.u * texel.x() + axes.v * texel.y()
        } else {
            let own = load_vectors::<R, N>(map_array(self.materials, |m| m.anisotropic_direction));
            R::Vec3::select(own.same(zero), axes.u, own)
        };
    }

    /// Tilts the normal by the slopes of the bump map, as if every point were displaced along the
    /// smooth normal by the map's height [Blinn 1978], for small heights: n - grad h, with the
    /// gradient along the surface [Mikkelsen 2010].
    ///
    /// Heights are linear along the world-space edges of the triangle, so the gradient needs no
    /// tangents, and stretched, sheared or mirrored texture coordinates are handled correctly. If
    /// there is a normal map as well, the slopes of both add.
    #[inline(always)]
    pub(super) fn emboss(
        &mut self,
        scene: &CompiledScene,
        hits: &RayHits<R, N>,
        primitives: &Primitives<R>,
        smooth: R::Vec3,
    ) {
        let zero = R::splat(0.0);
        let uv: [Uv; N] = self.uv.lanes();
        let mut rises = [[0.0; N]; 2];
        for i in 0..N {
            let rise = bump_rises(scene, self.materials[i], hits.primitives[i], uv[i]);
            [rises[0][i], rises[1][i]] = rise;
        }
        let rises = [R::load(&rises[0]), R::load(&rises[1])];
        let edges = match primitives {
            Primitives::Triangles(Triangles { corners, .. }) => {
                let [a, b, c] = *corners;
                [b - a, c - a]
            }
            Primitives::Spheres(Spheres { radius, .. }) => {
                let along = *radius * R::splat(std::f32::consts::PI);
                let east = R::Vec3::new(smooth.z(), zero, -smooth.x());
                let unit = east.normalize_or(R::Vec3::broadcast(Vec3::ZERO));
                let north = smooth.cross(unit);
                [east * (R::splat(2.0) * along), north * along]
            }
        };
        let gradient = (edges[1] * rises[0] - edges[0] * rises[1]).cross(smooth)
            / smooth.dot(edges[0].cross(edges[1]));
        let n = self.n_shading - gradient * self.n_shading.dot(smooth).max(zero);
        self.n_shading = self.in_front(n.normalize_or(self.n_shading));
    }

    /// Returns a unit normal tilted to the front of the triangle.
    #[inline(always)]
    fn in_front(&self, n: R::Vec3) -> R::Vec3 {
        let front = self.n_geometric;
        let behind = n.dot(front) - R::splat(GRAZING_COSINE);
        let tilted = (n - front * behind).normalize_or(front);
        R::Vec3::select(behind.lt(R::splat(0.0)), tilted, n)
    }
}

/// Decodes texels to vectors with components from -1 to 1.
#[inline(always)]
fn decoded<V: Vector>(texel: V) -> V {
    texel * V::Scalar::splat(2.0) - V::splat(V::Scalar::splat(1.0))
}

/// Returns the axes at points of triangles. MikkTSpace decodes with interpolated vectors that are
/// not normalised.
#[inline(always)]
fn triangle_axes<R: Lanes<N>, const N: usize>(
    scene: &CompiledScene,
    triangles: &Triangles<R>,
    hits: &RayHits<R, N>,
) -> MapAxes<R::Vec3> {
    let (mut firsts, mut lasts) = ([F32x8::default(); N], [F32x8::default(); N]);
    for (i, (first, last)) in firsts.iter_mut().zip(&mut lasts).enumerate() {
        let [a, b, c] = scene.tangents_at(hits.primitives[i], hits.instances[i]);
        first.0 = [a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w];
        last.0 = [c.x, c.y, c.z, c.w, 0.0, 0.0, 0.0, 0.0];
    }
    let first = R::transpose_load(firsts.each_ref());
    let last = R::transpose_load(lasts.each_ref());
    let t = [
        R::Vec3::new(first[0], first[1], first[2]),
        R::Vec3::new(first[4], first[5], first[6]),
        R::Vec3::new(last[0], last[1], last[2]),
    ];
    let n = triangles.normals;
    let across = [
        n[0].cross(t[0]) * first[3],
        n[1].cross(t[1]) * first[7],
        n[2].cross(t[2]) * last[3],
    ];
    let [v, w] = hits.uv;
    let u = R::splat(1.0) - v - w;
    MapAxes {
        u: t[0] * u + t[1] * v + t[2] * w,
        v: across[0] * u + across[1] * v + across[2] * w,
        n: n[0] * u + n[1] * v + n[2] * w,
    }
}

/// Returns the axes at points of spheres with the normal `n`: towards the east and the north.
#[inline(always)]
fn sphere_axes<V: Vector>(n: V) -> MapAxes<V> {
    let zero = V::Scalar::splat(0.0);
    let east = V::new(n.z(), zero, -n.x()).normalize_or(V::broadcast(Vec3::ZERO));
    MapAxes {
        u: east,
        v: n.cross(east),
        n,
    }
}

/// Returns by how much the height of a material's bump map rises along the two edges of a triangle
/// that start at its first corner, or on a sphere along the whole range of u and of v.
///
/// Slopes are differences over one texel about the point: they are continuous, whereas the
/// derivatives of the interpolated map are discontinuous at the middles of texels. The formulas of
/// Mitsuba are these derivatives: differences over the texel between two middles.
#[inline]
fn bump_rises(scene: &CompiledScene, m: &Material, primitive: u32, uv: Uv) -> [f32; 2] {
    let map = &scene.textures[m.bump_texture as usize];
    let place = map.image_uv(uv, m.tiling);
    let texel = Vec2::new(1.0 / map.width as f32, 1.0 / map.height as f32);
    let between = if m.formulas == Formulas::Mitsuba {
        ((place / texel - 0.5).floor() + 1.0) * texel
    } else {
        place
    };
    let rise = |place: Vec2, step: Vec2| {
        map.filtered(place + step * 0.5).x - map.filtered(place - step * 0.5).x
    };
    let along_u = rise(Vec2::new(between.x, place.y), Vec2::new(texel.x, 0.0));
    let along_v = rise(Vec2::new(place.x, between.y), Vec2::new(0.0, texel.y));
    let slopes = Vec2::new(along_u, along_v) / texel;
    // Slopes along the map's own coordinates, then along those of the surface.
    let slopes = map
        .lookup
        .map
        .map_or(slopes, |map| map.matrix2.transpose() * slopes);
    let slopes = slopes * (m.tiling.scale * m.bump_height);
    let i = primitive as usize;
    if i >= scene.triangles.len() {
        return slopes.to_array();
    }
    let second = scene.second_uvs.get(i).filter(|_| map.lookup.second);
    let [a, b, c] = second
        .copied()
        .unwrap_or_else(|| scene.corner_uvs(primitive));
    [slopes.dot(b - a), slopes.dot(c - a)]
}
