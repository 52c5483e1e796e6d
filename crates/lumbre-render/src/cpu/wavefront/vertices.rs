//! Surface vertices in all lanes: surface points, and BSDFs loaded from the material table.

use glam::Vec3;

use super::light_sampling::LightSample;
use super::material_classes::ClassTraits;
use lumbre_light::math::real::{Mask, Real, Vector};
use lumbre_light::math::simd::{F32x8, Lanes, map_array};
use lumbre_light::scene::CompiledScene;
use lumbre_light::transport::bsdf::{
    Bsdf, BsdfSample, BsdfValue, Orientation, Outgoing, PackedBsdf, TransportMode,
};
use lumbre_light::transport::integrator::Context;
use lumbre_light::transport::path_time::OpticalLength;
use lumbre_light::transport::surface::SurfacePoint;

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

/// Computes the surface points at which rays hit primitives, all of them spheres or all triangles.
/// The rays are given by origin and direction, the hits by distance and barycentric weights.
#[inline(always)]
pub(super) fn surface_points<R: Lanes<N>, const N: usize>(
    scene: &CompiledScene,
    sphere: bool,
    primitives: [u32; N],
    [origin, dir]: [R::Vec3; 2],
    [t, v, w]: [R; 3],
) -> SurfacePoint<R::Vec3> {
    if sphere {
        let rows = map_array(primitives, |p| {
            let s = &scene.spheres[p as usize - scene.triangles.len()];
            F32x8([
                s.center.x, s.center.y, s.center.z, s.radius, 0.0, 0.0, 0.0, 0.0,
            ])
        });
        let [x, y, z, radius, ..] = R::transpose_load(rows.each_ref());
        return SurfacePoint::on_sphere(R::Vec3::new(x, y, z), radius, origin + dir * t, dir);
    }
    let corners = load_three::<R, N>(map_array(primitives, |p| &scene.triangles[p as usize]));
    let normals = load_three::<R, N>(map_array(primitives, |p| {
        &scene.attributes[p as usize].normals
    }));
    SurfacePoint::on_triangle(corners, normals, [v, w], dir)
}

/// Surface vertices in all lanes, with their BSDFs.
pub(super) struct Vertices<R: Real> {
    pub point: SurfacePoint<R::Vec3>,
    pub bsdf: Bsdf<R>,
    /// Direction to the previous vertex.
    pub out: Outgoing<R>,
    /// Whether the BSDF can be non-zero for that direction.
    pub visible: R::Mask,
}

impl<R: Real> Vertices<R> {
    /// Creates the vertices on surfaces of one class from their materials. `wo` is the unit
    /// direction to the previous vertex. `visible` is unset outside `active`.
    #[inline(always)]
    pub fn new<const N: usize>(
        point: SurfacePoint<R::Vec3>,
        wo: R::Vec3,
        materials: [&PackedBsdf; N],
        traits: &ClassTraits,
        active: R::Mask,
    ) -> Vertices<R>
    where
        R: Lanes<N>,
    {
        let orientation = Orientation {
            n_geometric: point.n_geometric,
            n_shading: point.n_shading,
            tangent: None,
            terminator: R::Mask::splat(false),
        };
        let bsdf = Bsdf::unpack(&orientation, &traits.bsdf, materials, None);
        let out = bsdf.outgoing(wo);
        Vertices {
            point,
            bsdf,
            out,
            visible: active & out.same_side,
        }
    }

    /// Evaluates the BSDF in the lanes of `wanted`: see [`Bsdf::values`].
    #[inline(always)]
    pub fn evaluate<const REVERSE: bool>(
        &self,
        wi: R::Vec3,
        mode: TransportMode,
        wanted: R::Mask,
    ) -> BsdfValue<R::Vec3> {
        self.bsdf
            .values::<REVERSE>(&self.out, wi, mode, wanted & self.visible)
    }

    /// Samples the BSDF in the lanes of `visible`: see [`Bsdf::samples`].
    #[inline(always)]
    pub fn sample<const REVERSE: bool>(
        &self,
        choice: R,
        v: [R; 2],
        mode: TransportMode,
    ) -> (R::Mask, BsdfSample<R>, R) {
        let (sampled, sample, reverse) = self.bsdf.samples::<REVERSE>(&self.out, choice, v, mode);
        (self.visible & sampled, sample, reverse)
    }

    /// Returns the ratio of indices of refraction between `wo` and `wi`.
    #[inline(always)]
    pub fn index_ratio(&self, wi: R::Vec3) -> R {
        self.bsdf.index_ratio(self.out.wo, wi)
    }

    /// Returns the optical length of paths to sampled lights, as
    /// [`direct_length`](lumbre_light::transport::path_time::direct_length) does.
    #[inline(always)]
    pub fn direct_length<const N: usize>(
        &self,
        context: &Context,
        optical: &OpticalLength<R>,
        light: &LightSample<R, N>,
    ) -> R::Double
    where
        R: Lanes<N>,
    {
        let mut distance = light.distance;
        if light.infinite.any() {
            let front_distance = context.lights.front_distance(self.point.position, light.wi);
            distance = R::select(light.infinite, front_distance, distance);
        }
        optical.after_segment(self.index_ratio(light.wi), distance)
    }
}
