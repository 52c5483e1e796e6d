//! Surface vertices in all lanes: surface points, and BSDFs loaded from rows of the material table.
//!
//! The methods of [`Vertices`] are the vectorised counterparts of functions in [`lumbre_light::transport`]
//! and give the same bits per lane.

use glam::Vec3;

use super::light_sampling::LightSample;
use super::material_classes::ClassTraits;
use lumbre_light::math::Frame;
use lumbre_light::math::real::{Mask, Real, Vector};
use lumbre_light::math::simd::{F32x8, Lanes, map_array};
use lumbre_light::scene::CompiledScene;
use lumbre_light::transport::bsdf::clearcoat::Clearcoat;
use lumbre_light::transport::bsdf::diffuse::Diffuse;
use lumbre_light::transport::bsdf::disney::{Disney, DisneyOutgoing, LobeEstimate};
use lumbre_light::transport::bsdf::ggx::Ggx;
use lumbre_light::transport::bsdf::{
    BsdfValue, MixtureSample, TransportMode, adjoint, index_ratio, lambert,
};
use lumbre_light::transport::integrator::Context;
use lumbre_light::transport::path_time::OpticalLength;
use lumbre_light::transport::surface::SurfacePoint;

/// Returns the rows of a Lambert BSDF, which [`load_bsdfs`] reads.
pub(super) fn lambert_rows(albedo: Vec3) -> [F32x8; 3] {
    [
        F32x8([albedo.x, albedo.y, albedo.z, 0.0, 0.0, 0.0, 0.0, 0.0]),
        F32x8::default(),
        F32x8::default(),
    ]
}

/// Column of the inner index of refraction in the first row of [`disney_rows`].
pub(super) const IOR_COLUMN: usize = 6;

/// Returns the rows of a Disney BSDF, which [`load_bsdfs`] reads.
pub(super) fn disney_rows(d: &Disney) -> [F32x8; 3] {
    let (c, sheen, tinted) = (
        d.base_color,
        d.diffuse.sheen,
        d.tinted_f0.unwrap_or_default(),
    );
    let LobeEstimate {
        diffuse,
        reflection,
        rise,
    } = d.estimate;
    [
        F32x8([
            c.x,
            c.y,
            c.z,
            d.opaque,
            d.metallic,
            d.refractive,
            d.ior,
            d.diffuse.roughness,
        ]),
        F32x8([
            d.ggx.alpha[0],
            d.diffuse.subsurface,
            sheen.x,
            sheen.y,
            sheen.z,
            tinted.x,
            tinted.y,
            tinted.z,
        ]),
        F32x8([
            d.coat.strength,
            d.coat.alpha,
            diffuse,
            reflection,
            rise,
            0.0,
            0.0,
            0.0,
        ]),
    ]
}

/// Loads the BSDFs of the materials in all lanes.
#[inline(always)]
fn load_bsdfs<R: Lanes<N>, const N: usize>(
    rows: [&[F32x8; 3]; N],
    traits: &ClassTraits,
) -> Disney<R::Vec3> {
    let a = R::transpose_load(map_array(rows, |r| &r[0]));
    let b = R::transpose_load(map_array(rows, |r| &r[1]));
    let c = R::transpose_load(map_array(rows, |r| &r[2]));
    let base_color = R::Vec3::new(a[0], a[1], a[2]);
    Disney {
        base_color,
        opaque: a[3],
        metallic: a[4],
        refractive: a[5],
        ior: a[IOR_COLUMN],
        tinted_f0: traits.tinted.then(|| R::Vec3::new(b[5], b[6], b[7])),
        diffuse: Diffuse {
            base_color,
            roughness: a[7],
            subsurface: b[1],
            sheen: R::Vec3::new(b[2], b[3], b[4]),
        },
        ggx: Ggx { alpha: [b[0]; 2] },
        smooth: traits.smooth,
        coat: Clearcoat {
            strength: c[0],
            alpha: c[1],
        },
        estimate: LobeEstimate {
            diffuse: c[2],
            reflection: c[3],
            rise: c[4],
        },
    }
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

/// Surface vertices in all lanes, with the values of their BSDFs that depend only on the outgoing
/// direction.
pub(super) struct Vertices<R: Real> {
    pub point: SurfacePoint<R::Vec3>,
    pub frame: Frame<R::Vec3>,
    /// Whether the shading normal equals the geometric normal.
    flat: R::Mask,
    /// BSDF parameters; Lambert surfaces use only the base colour.
    bsdf: Disney<R::Vec3>,
    outgoing: DisneyOutgoing<R::Vec3>,
    /// Whether the surfaces are of the model `lambert`; otherwise `disney`.
    lambert: bool,
    /// Unit direction to the previous vertex.
    pub wo: R::Vec3,
    /// Cosine between `wo` and the shading normal.
    pub cos_o: R,
    /// Whether the BSDF can be non-zero for `wo`.
    pub visible: R::Mask,
}

impl<R: Real> Vertices<R> {
    /// Creates the vertices on surfaces of one class from the rows of their materials. `visible` is
    /// unset outside `active`.
    #[inline(always)]
    pub fn new<const N: usize>(
        point: SurfacePoint<R::Vec3>,
        wo: R::Vec3,
        rows: [&[F32x8; 3]; N],
        traits: &ClassTraits,
        active: R::Mask,
    ) -> Vertices<R>
    where
        R: Lanes<N>,
    {
        let bsdf = load_bsdfs::<R, N>(rows, traits);
        let frame = Frame::from_normal(point.n_shading);
        let local = frame.to_local(wo);
        let lambert = traits.lambert;
        let outgoing = if lambert {
            DisneyOutgoing::none()
        } else {
            bsdf.outgoing(local)
        };
        let flat = point.n_shading.same(point.n_geometric);
        let vertices = Vertices {
            point,
            frame,
            flat,
            bsdf,
            outgoing,
            lambert,
            wo,
            cos_o: local.z(),
            visible: active,
        };
        Vertices {
            visible: active & vertices.same_side(wo, local.z()),
            ..vertices
        }
    }

    /// Returns whether geometric and shading normal agree on the side of `w`; the vectorised
    /// counterpart of `Bsdf::same_side`.
    #[inline(always)]
    pub fn same_side(&self, w: R::Vec3, cos: R) -> R::Mask {
        let zero = R::splat(0.0);
        self.flat & !cos.eq(zero) | !self.flat & (w.dot(self.point.n_geometric) * cos).gt(zero)
    }

    /// Returns the correction factor for shading normals in light subpaths, for light that arrives
    /// from `wo` and leaves towards `wi`.
    #[inline(always)]
    pub fn adjoint(&self, wi: R::Vec3, cos_i: R) -> R {
        let factor = adjoint(self.point.n_geometric, [self.wo, wi], [self.cos_o, cos_i]);
        R::select(self.flat, R::splat(1.0), factor)
    }

    /// Evaluates the BSDF in the lanes of `wanted`, as `Bsdf::evaluate_from` does with `REVERSE`,
    /// and as `Bsdf::evaluate_forward` does without it.
    #[inline(always)]
    pub fn evaluate<const REVERSE: bool>(
        &self,
        wi: R::Vec3,
        mode: TransportMode,
        wanted: R::Mask,
    ) -> BsdfValue<R::Vec3> {
        let zero = R::splat(0.0);
        let black = R::Vec3::broadcast(Vec3::ZERO);
        let n = self.point.n_shading;
        let cos_i = wi.dot(n);
        let same = (self.cos_o * cos_i).gt(zero);
        let (mut f, [mut pdf_w, mut reverse]) = if self.lambert {
            let (o, i) = (self.frame.to_local(self.wo), self.frame.to_local(wi));
            let back = if REVERSE { lambert::pdf_w(i, o) } else { zero };
            (
                lambert::eval(self.bsdf.base_color, o, i),
                [lambert::pdf_w(o, i), back],
            )
        } else {
            self.bsdf
                .evaluate_isotropic::<REVERSE>(&self.outgoing, self.wo, wi, n, cos_i)
        };
        let transmitted = wanted & !same;
        if transmitted.any() && self.bsdf.refractive.gt(zero).any() {
            let (other, [other_w, back]) =
                self.bsdf
                    .evaluate::<REVERSE>(&self.outgoing, self.frame.to_local(wi), mode);
            (f, pdf_w) = (
                R::Vec3::select(same, f, other),
                R::select(same, pdf_w, other_w),
            );
            reverse = R::select(same, reverse, back);
        } else {
            (f, pdf_w) = (
                R::Vec3::select(same, f, black),
                R::select(same, pdf_w, zero),
            );
            reverse = R::select(same, reverse, zero);
        }
        if mode == TransportMode::Importance {
            f = f * self.adjoint(wi, cos_i);
        }
        let valid = wanted & self.visible & self.same_side(wi, cos_i);
        BsdfValue {
            f: R::Vec3::select(valid, f, black),
            pdf_w: R::select(valid, pdf_w, zero),
            reverse_pdf_w: R::select(valid, reverse, zero),
        }
    }
}

impl<R: Real> Vertices<R> {
    /// Samples the BSDFs, as `Disney::sample` and `Ideal::sample` do. Returns the lanes with a
    /// sample, the sample, and its reverse density. The caller must still check the side of the
    /// geometric normal.
    #[inline(always)]
    pub fn sample<const REVERSE: bool>(
        &self,
        choice: R,
        v: [R; 2],
        mode: TransportMode,
    ) -> (R::Mask, MixtureSample<R::Vec3>, R) {
        if !self.lambert {
            return self.bsdf.sample::<REVERSE>(&self.outgoing, choice, v, mode);
        }
        let o = self.frame.to_local(self.wo);
        let (sampled, sample) = lambert::sample(self.bsdf.base_color, o, v);
        let reverse = if REVERSE {
            lambert::pdf_w(sample.wi, o)
        } else {
            R::splat(0.0)
        };
        (
            sampled,
            MixtureSample {
                sample,
                pdf_w: lambert::pdf_w(o, sample.wi),
                delta: R::Mask::splat(false),
            },
            reverse,
        )
    }

    /// Returns the ratio of indices of refraction between `wo` and `wi`, as `Bsdf::index_ratio`
    /// does.
    #[inline(always)]
    pub fn index_ratio(&self, wi: R::Vec3) -> R {
        if !self.bsdf.refractive.gt(R::splat(0.0)).any() {
            return R::splat(1.0);
        }
        index_ratio([self.cos_o, wi.dot(self.point.n_shading)], self.bsdf.ior)
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
