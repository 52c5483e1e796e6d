//! The surface at a hit: position, normals, texture coordinates, material; for the hits in all lanes
//! of a vector or, as the case of one lane, for a single hit.

mod lookup;
mod maps;
mod mask;
mod parameters;
mod terminator;
#[cfg(test)]
mod tests;
mod traits;

use glam::{Vec2, Vec3};

use super::ray::{Hit, Ray, RayHits};
use super::vertex::{EdgeEnd, greatest_coordinate, least_extent};
use crate::math::real::{Mask, Outlined, Real, Vector, Word};
use crate::math::simd::{F32x8, Lanes, map_array, map_vectors};
use crate::scene::CompiledScene;
use crate::scene::compile::{Material, NONE, Texture, Uv};

pub use lookup::{lookup, lookup_in_lanes, lookup_scalar};
pub use mask::{acceptance, coverage, has_fractional_mask, is_back, is_masked_out, uv_at};
pub use parameters::ShadingParameters;
pub use terminator::TerminatorOffset;
pub use traits::{PrimitiveKind, SurfaceTraits, TexturedParameters};

/// A point of a surface in each lane, with everything that shading needs.
#[derive(Clone, Copy, Debug)]
pub struct Surface<'a, R: Real = f32, const N: usize = 1> {
    /// Position in world space, computed from the primitive rather than along the ray.
    pub position: R::Vec3,
    /// Unit normal of the primitive's front side, whichever side was hit.
    pub n_geometric: R::Vec3,
    /// Greatest absolute coordinate of the primitive: see [`EdgeEnd::extent`].
    pub extent: R,
    /// Unit shading normal on the same side.
    pub n_shading: R::Vec3,
    /// World-space direction in which anisotropic highlights are stretched. Not normalised and not
    /// orthogonal to the normal; zero if the material has no direction or needs none.
    pub tangent: R::Vec3,
    /// Texture coordinates before tiling; zero if nothing reads them.
    pub uv: Uv<R>,
    /// Product of the vertex colours and of the surface's tint, a factor on the base colour; white
    /// without any.
    pub tint: R::Vec3,
    /// The materials at these points.
    pub materials: [&'a Material; N],
    /// Indices into the scene's emitters, or [`NONE`].
    pub emitter: R::Word,
    /// Offset against the shadow terminator; `None` if no lane has one.
    pub terminator: Option<TerminatorOffset<R>>,
}

/// Position and normals of a ray's intersection with a primitive; scalar or vectorised.
#[derive(Clone, Copy, Debug)]
struct SurfacePoint<V> {
    /// Position in world space.
    position: V,
    /// Unit normal of the primitive on its front side.
    n_geometric: V,
    /// Unit shading normal on the same side, before any map.
    n_shading: V,
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> SurfacePoint<V> {
    /// Computes a point of a triangle with these weights of its second and third corner. The normal
    /// of a triangle without area faces the ray.
    #[inline(always)]
    fn on_triangle(
        [a, b, c]: [V; 3],
        [na, nb, nc]: [V; 3],
        [v, w]: [R; 2],
        dir: V,
    ) -> SurfacePoint<V> {
        let u = R::splat(1.0) - v - w;
        let n_geometric = (b - a).cross(c - a).normalize_or(-dir);
        let n_shading = (na * u + nb * v + nc * w).normalize_or(n_geometric);
        SurfacePoint {
            position: a * u + b * v + c * w,
            n_geometric,
            n_shading,
        }
    }

    /// Computes the point of a sphere nearest to `at`.
    #[inline(always)]
    fn on_sphere(center: V, radius: R, at: V, dir: V) -> SurfacePoint<V> {
        let n = (at - center).normalize_or(-dir);
        SurfacePoint {
            position: center + n * radius,
            n_geometric: n,
            n_shading: n,
        }
    }
}

/// The triangles that the rays of all lanes hit, in world space.
#[derive(Clone, Copy)]
struct Triangles<R: Real> {
    corners: [R::Vec3; 3],
    /// Unit shading normals at the corners.
    normals: [R::Vec3; 3],
}

/// The spheres that the rays of all lanes hit.
#[derive(Clone, Copy)]
struct Spheres<R: Real> {
    center: R::Vec3,
    radius: R,
}

/// The primitives that the rays of all lanes hit.
#[derive(Clone, Copy)]
enum Primitives<R: Real> {
    Triangles(Triangles<R>),
    Spheres(Spheres<R>),
}

impl<R: Real> Primitives<R> {
    /// Loads the primitives of hits, all of the kind that `traits` state.
    #[inline(always)]
    fn load<const N: usize>(
        scene: &CompiledScene,
        traits: &SurfaceTraits,
        hits: &RayHits<R, N>,
    ) -> Primitives<R>
    where
        R: Lanes<N>,
    {
        let RayHits {
            primitives,
            instances,
            ..
        } = *hits;
        if traits.sphere {
            let first = scene.triangles.len();
            let rows = map_array(primitives, |p| {
                let s = &scene.spheres[p as usize - first];
                F32x8([
                    s.center.x, s.center.y, s.center.z, s.radius, 0.0, 0.0, 0.0, 0.0,
                ])
            });
            let [x, y, z, radius, ..] = R::transpose_load(rows.each_ref());
            return Primitives::Spheres(Spheres {
                center: R::Vec3::new(x, y, z),
                radius,
            });
        }
        if traits.instanced {
            let mut triangles = [([Vec3::ZERO; 3], [Vec3::ZERO; 3]); N];
            for (i, triangle) in triangles.iter_mut().enumerate() {
                *triangle = scene.triangle(primitives[i], instances[i]);
            }
            let triangles = triangles.each_ref();
            return Primitives::Triangles(Triangles {
                corners: load_three::<R, N>(map_array(triangles, |t| &t.0)),
                normals: load_three::<R, N>(map_array(triangles, |t| &t.1)),
            });
        }
        Primitives::Triangles(Triangles {
            corners: load_three::<R, N>(map_array(primitives, |p| &scene.triangles[p as usize])),
            normals: load_normals::<R, N>(scene, primitives),
        })
    }

    /// Returns the points at which the rays hit the primitives.
    #[inline(always)]
    fn points<const N: usize>(&self, hits: &RayHits<R, N>) -> SurfacePoint<R::Vec3> {
        match self {
            Primitives::Triangles(Triangles { corners, normals }) => {
                SurfacePoint::on_triangle(*corners, *normals, hits.uv, hits.dir)
            }
            Primitives::Spheres(Spheres { center, radius }) => {
                let at = hits.origin + hits.dir * hits.t;
                SurfacePoint::on_sphere(*center, *radius, at, hits.dir)
            }
        }
    }

    /// Returns the greatest absolute coordinates of the primitives, which bound the rounding errors
    /// of [`points`](Primitives::points). With instances they include how far these were moved.
    #[inline(always)]
    fn extent<const N: usize>(
        &self,
        scene: &CompiledScene,
        traits: &SurfaceTraits,
        hits: &RayHits<R, N>,
    ) -> R
    where
        R: Lanes<N>,
    {
        let own = match self {
            Primitives::Triangles(Triangles { corners, .. }) => {
                let extent = greatest_coordinate(corners);
                if traits.instanced {
                    let moved = map_array(hits.instances, |i| scene.instance_extent(i));
                    extent.max(R::load(&moved))
                } else {
                    extent
                }
            }
            Primitives::Spheres(Spheres { center, radius }) => {
                greatest_coordinate(&[*center]) + *radius
            }
        };
        own.max(R::splat(least_extent(scene)))
    }
}

/// Loads the shading normals at the corners of a triangle per lane.
#[inline(always)]
fn load_normals<R: Lanes<N>, const N: usize>(
    scene: &CompiledScene,
    primitives: [u32; N],
) -> [R::Vec3; 3] {
    if let Some(flat) = scene.normals.flat() {
        let rows = map_array(primitives, |p| {
            let n = flat[p as usize];
            F32x8([n.x, n.y, n.z, 0.0, 0.0, 0.0, 0.0, 0.0])
        });
        let [x, y, z, ..] = R::transpose_load(rows.each_ref());
        return [R::Vec3::new(x, y, z); 3];
    }
    let smooth = scene.normals.smooth();
    load_three::<R, N>(map_array(primitives, |p| &smooth[p as usize]))
}

/// Loads three vectors per lane.
#[inline(always)]
fn load_three<R: Lanes<N>, const N: usize>(vectors: [&[Vec3; 3]; N]) -> [R::Vec3; 3] {
    let rows = map_array(vectors, |[a, b, c]| {
        F32x8([a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y])
    });
    let last = R::load(&map_array(vectors, |[_, _, c]| c.z));
    let [ax, ay, az, bx, by, bz, cx, cy] = R::transpose_load(rows.each_ref());
    [
        R::Vec3::new(ax, ay, az),
        R::Vec3::new(bx, by, bz),
        R::Vec3::new(cx, cy, last),
    ]
}

/// Returns the texture coordinates at weights of the second and third corner, one set.
#[inline(always)]
fn load_uvs<R: Lanes<N>, const N: usize>(uvs: [&[Vec2; 3]; N], [v, w]: [R; 2]) -> [R; 2] {
    let rows = map_array(uvs, |[a, b, c]| {
        F32x8([a.x, a.y, b.x, b.y, c.x, c.y, 0.0, 0.0])
    });
    let [ax, ay, bx, by, cx, cy, ..] = R::transpose_load(rows.each_ref());
    let u = R::splat(1.0) - v - w;
    [ax * u + bx * v + cx * w, ay * u + by * v + cy * w]
}

impl<'a> Surface<'a> {
    /// Builds the surface at a hit of `ray`. A composed material is used as a whole, as for the
    /// layers of the first surface; paths build
    /// an [`Arrival`](super::arrival::Arrival) at one of its parts.
    #[inline]
    pub fn at(scene: &'a CompiledScene, ray: &Ray, hit: &Hit) -> Surface<'a> {
        let material = scene.material_of(hit.primitive, hit.instance);
        let traits = SurfaceTraits {
            // Delays and light points read texture coordinates as well.
            uv: true,
            second_uv: !scene.second_uvs.is_empty(),
            ..SurfaceTraits::new(scene, hit.primitive, hit.instance, material)
        };
        Surface::at_hits(scene, &traits, &RayHits::new(ray, hit), [material])
    }
}

impl<'a, R: Lanes<N>, const N: usize> Surface<'a, R, N> {
    /// Builds the surfaces at hits of rays with the given material rows. All of them have `traits`.
    #[inline(always)]
    pub fn at_hits(
        scene: &'a CompiledScene,
        traits: &SurfaceTraits,
        hits: &RayHits<R, N>,
        materials: [u32; N],
    ) -> Surface<'a, R, N> {
        R::outline(SurfaceBuilding {
            scene,
            traits,
            hits,
            materials,
        })
    }

    /// Computes the result of [`Surface::at_hits`].
    #[inline(always)]
    fn build(
        scene: &'a CompiledScene,
        traits: &SurfaceTraits,
        hits: &RayHits<R, N>,
        materials: [u32; N],
    ) -> Surface<'a, R, N> {
        let primitives = Primitives::load(scene, traits, hits);
        let SurfacePoint {
            position,
            n_geometric,
            n_shading,
        } = primitives.points(hits);
        let mut surface = Surface {
            position,
            n_geometric,
            extent: primitives.extent(scene, traits, hits),
            n_shading,
            tangent: R::Vec3::broadcast(Vec3::ZERO),
            uv: uv_at_hits(scene, traits, hits, n_shading),
            tint: tint_at_hits(scene, traits, hits),
            materials: map_array(materials, |m| &scene.materials[m as usize]),
            emitter: R::Word::splat(NONE),
            terminator: None,
        };
        if traits.emits {
            let mut emitters = [NONE; N];
            for (i, emitter) in emitters.iter_mut().enumerate() {
                *emitter = scene.emitter_of(hits.primitives[i], hits.instances[i]);
            }
            surface.emitter = R::load_words(&emitters);
        }
        if let (true, Primitives::Triangles(triangles)) = (traits.terminator, &primitives) {
            surface.terminator = surface.find_terminator_offset(triangles, hits);
        }
        if traits.tangents {
            surface.orient(scene, traits, hits, &primitives);
        }
        if traits.bump_map {
            surface.emboss(scene, hits, &primitives, n_shading);
        }
        surface
    }

    /// Returns the radiance emitted towards `wo`: the material's emission on the front side, black
    /// behind.
    #[inline(always)]
    pub fn emitted(&self, textures: &[Texture], wo: R::Vec3) -> R::Vec3 {
        let black = R::Vec3::broadcast(Vec3::ZERO);
        let behind = self.n_geometric.dot(wo).le(R::splat(0.0));
        let emits = !self.emitter.eq(R::Word::splat(NONE)) & !behind;
        if !emits.any() {
            return black;
        }
        let emission = load_vectors::<R, N>(map_array(self.materials, |m| m.emission));
        let texels = self.texels(textures, |m| m.emission_texture);
        R::Vec3::select(emits, emission * texels, black)
    }

    /// Returns whether a path that hits this surface ends there: a light that does not reflect.
    #[inline(always)]
    pub fn ends_paths(&self) -> R::Mask {
        let reflects = map_array(self.materials, |m| f32::from(u8::from(m.emitter_reflects)));
        let emits = !self.emitter.eq(R::Word::splat(NONE));
        emits & R::load(&reflects).eq(R::splat(0.0))
    }

    /// Returns the point as an end of edges.
    #[inline(always)]
    pub fn end(&self) -> EdgeEnd<R> {
        EdgeEnd {
            position: self.position,
            normal: self.n_geometric,
            extent: self.extent,
        }
    }

    /// Returns a ray in direction `dir`, started off the surface on the side of `dir`, or from the
    /// lifted point.
    #[inline(always)]
    pub fn spawn(&self, dir: R::Vec3) -> Ray<R::Vec3> {
        let mut origin = self.end().off_surface(dir);
        if let Some(terminator) = self.terminator_into(dir) {
            origin = R::Vec3::select(terminator.exists, terminator.lifted_point, origin);
        }
        Ray { origin, dir }
    }
}

/// Outlined computation of [`Surface::at_hits`].
struct SurfaceBuilding<'a, 'h, R: Real, const N: usize> {
    scene: &'a CompiledScene,
    traits: &'h SurfaceTraits,
    hits: &'h RayHits<R, N>,
    materials: [u32; N],
}

impl<'a, R: Lanes<N>, const N: usize> Outlined for SurfaceBuilding<'a, '_, R, N> {
    type Output = Surface<'a, R, N>;

    #[inline(always)]
    fn run(self) -> Surface<'a, R, N> {
        Surface::build(self.scene, self.traits, self.hits, self.materials)
    }
}

/// Loads one vector per lane.
#[inline(always)]
fn load_vectors<R: Lanes<N>, const N: usize>(vectors: [Vec3; N]) -> R::Vec3 {
    R::Vec3::new(
        R::load(&map_array(vectors, |v| v.x)),
        R::load(&map_array(vectors, |v| v.y)),
        R::load(&map_array(vectors, |v| v.z)),
    )
}

/// Returns the texture coordinates at hits; zero if nothing reads them. `n` is the normal of spheres.
#[inline(always)]
fn uv_at_hits<R: Lanes<N>, const N: usize>(
    scene: &CompiledScene,
    traits: &SurfaceTraits,
    hits: &RayHits<R, N>,
    n: R::Vec3,
) -> Uv<R> {
    if !traits.uv {
        return Uv::zero();
    }
    if traits.sphere {
        let all = R::Mask::splat(true);
        let first = map_vectors::<R, N, 2>(n, all, |_, n| sphere_uv(n).to_array());
        return Uv {
            first,
            second: first,
        };
    }
    if scene.uvs.is_empty() {
        return Uv::zero();
    }
    let uvs = map_array(hits.primitives, |p| &scene.uvs[p as usize]);
    let first = load_uvs(uvs, hits.uv);
    let mut second = first;
    if traits.second_uv {
        let uvs = map_array(hits.primitives, |p| &scene.second_uvs[p as usize]);
        second = load_uvs(uvs, hits.uv);
    }
    Uv { first, second }
}

/// Returns the vertex colours at hits; white without any.
#[inline(always)]
fn tint_at_hits<R: Lanes<N>, const N: usize>(
    scene: &CompiledScene,
    traits: &SurfaceTraits,
    hits: &RayHits<R, N>,
) -> R::Vec3 {
    if !traits.colors {
        return R::Vec3::broadcast(Vec3::ONE);
    }
    let colors = map_array(hits.primitives, |p| &scene.colors[p as usize]);
    let [a, b, c] = load_three::<R, N>(colors);
    let [v, w] = hits.uv;
    a * (R::splat(1.0) - v - w) + b * v + c * w
}

/// Returns texture coordinates on a sphere: longitude about y in u, from the south pole to the
/// north pole in v.
#[inline]
pub fn sphere_uv(n: Vec3) -> Vec2 {
    let longitude = n.x.atan2(n.z) / std::f32::consts::TAU + 0.5;
    let latitude = n.y.clamp(-1.0, 1.0).acos() / std::f32::consts::PI;
    Vec2::new(longitude, 1.0 - latitude)
}
