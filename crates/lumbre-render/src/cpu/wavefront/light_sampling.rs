//! Light sampling for the surface points in all lanes, bit-identical to `Lights::sample_direct`.
//!
//! Triangles with uniform emission are sampled in vectors. All other lights are sampled lane by
//! lane with the scalar code, and the results are merged.

use glam::Vec3;

use lumbre_light::math::real::{Double, Mask, Real, Vector};
use lumbre_light::math::simd::{F32x8, Lanes, active_lanes, map_array};
use lumbre_light::math::warp;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::Uv;
use lumbre_light::transport::integrator::Context;
use lumbre_light::transport::integrator::bdpt::weights::LightEnd;
use lumbre_light::transport::light::{LightPoint, area};

/// Lights with vectorised sampling: triangles with uniform emission.
#[derive(Default)]
pub(super) struct LightTable {
    /// Corners, area, radiance and the number 1 of every emitter; zeros for emitters without
    /// vectorised sampling. The index is that of the light: emitters are the first lights.
    rows: Vec<[F32x8; 2]>,
}

/// Rows of a light without vectorised sampling.
const NO_LIGHT: [F32x8; 2] = [F32x8([0.0; 8]); 2];

/// Selected light of each lane.
pub(super) struct SelectedLight<R, const N: usize> {
    /// Rows of [`LightTable`]; zeros for other lights.
    pub rows: [[R; 8]; 2],
    /// Indices of the lights.
    pub light: [u32; N],
    /// Probability with which the light was selected.
    pub probability: R,
    /// Bit mask of the lanes whose light is sampled by the scalar code.
    pub scalar_lanes: u32,
}

/// Light sample of each lane, without visibility.
pub(super) struct LightSample<R: Real, const N: usize> {
    /// Unit direction to the light.
    pub wi: R::Vec3,
    /// Radiance, or irradiance of a Dirac light.
    pub radiance: R::Vec3,
    /// Density per solid angle, including the selection of the light. If it is zero, there is no
    /// sample and the other fields are undefined.
    pub density: R,
    /// Whether the light is a Dirac distribution, which BSDF sampling cannot hit.
    pub delta: R::Mask,
    /// Distance to the light, in scene units; undefined for infinitely distant lights.
    pub distance: R,
    /// Position on the light.
    pub at: R::Vec3,
    /// Unit normal at that position.
    pub normal: R::Vec3,
    /// Whether the light is infinitely distant.
    pub infinite: R::Mask,
    /// Index of the light.
    light: [u32; N],
    /// Probability with which the light was selected.
    probability: R,
    /// Area of the light; zero if it is sampled on the scalar path.
    area: R,
    /// Bit mask of the lanes whose light is sampled by the scalar code.
    scalar_lanes: u32,
}

impl LightTable {
    /// Builds the table of the lights of a scene.
    pub fn new(scene: &CompiledScene) -> LightTable {
        let row = |i: u32| {
            let Some(([a, b, c], radiance)) = area::constant_triangle(scene, i) else {
                return NO_LIGHT;
            };
            let area = scene.emitters[i as usize].area;
            [
                F32x8([a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y]),
                F32x8([c.z, area, radiance.x, radiance.y, radiance.z, 1.0, 0.0, 0.0]),
            ]
        };
        LightTable {
            rows: (0..scene.emitters.len() as u32).map(row).collect(),
        }
    }

    /// Selects a light for each lane in `wanted` from a random number.
    #[inline(always)]
    pub fn select<R: Lanes<N>, const N: usize>(
        &self,
        context: &Context,
        choice: R,
        wanted: R::Mask,
    ) -> SelectedLight<R, N> {
        let choices = choice.store();
        let (mut rows, mut probabilities) = ([&NO_LIGHT; N], [0.0; N]);
        let (mut light, mut scalar_lanes) = ([0; N], 0);
        for i in active_lanes(wanted.bits()) {
            if let Some((index, probability)) = context.lights.choose(choices[i]) {
                probabilities[i] = probability;
                light[i] = index;
                match self
                    .rows
                    .get(index as usize)
                    .filter(|row| row[1].0[5] > 0.0)
                {
                    Some(row) => rows[i] = row,
                    None => scalar_lanes |= 1 << i,
                }
            }
        }
        let rows = [
            R::transpose_load(map_array(rows, |r| &r[0])),
            R::transpose_load(map_array(rows, |r| &r[1])),
        ];
        SelectedLight {
            rows,
            light,
            probability: R::load(&probabilities),
            scalar_lanes,
        }
    }

    /// Samples a light and a point on it for each lane in `wanted`; the vectorised counterpart of
    /// `Lights::sample_direct`.
    #[inline(always)]
    pub fn sample<R: Lanes<N>, const N: usize>(
        &self,
        context: &Context,
        from: R::Vec3,
        [choice, u, v]: [R; 3],
        wanted: R::Mask,
    ) -> LightSample<R, N> {
        let SelectedLight {
            rows: [a, b],
            light,
            probability,
            scalar_lanes,
        } = self.select(context, choice, wanted);
        let corners = [
            R::Vec3::new(a[0], a[1], a[2]),
            R::Vec3::new(a[3], a[4], a[5]),
            R::Vec3::new(a[6], a[7], b[0]),
        ];
        let (at, normal) = area::on_triangle(corners, warp::uniform_triangle([u, v]));
        let (wi, distance, density) = area::direction_from(from, at, normal, b[1]);
        let radiance = R::Vec3::new(b[2], b[3], b[4]);
        let (delta, infinite) = (R::Mask::splat(false), R::Mask::splat(false));
        let area = b[1];
        let mut sample = LightSample {
            wi,
            radiance,
            density,
            delta,
            distance,
            at,
            normal,
            infinite,
            light,
            probability,
            area,
            scalar_lanes,
        };
        if scalar_lanes != 0 {
            let from = [from.x().store(), from.y().store(), from.z().store()];
            let [light_rows, point_rows] =
                sample_scalar_lights(context, scalar_lanes, light, from, [u.store(), v.store()]);
            sample = sample.merge_scalar(
                b[5].gt(R::splat(0.0)),
                R::transpose_load(light_rows.each_ref()),
                R::transpose_load(point_rows.each_ref()),
            );
        }
        LightSample {
            density: sample.density * probability,
            ..sample
        }
    }
}

impl<R: Lanes<N>, const N: usize> LightSample<R, N> {
    /// Returns `self` in the lanes of `vectorised`, and the result of [`sample_scalar_lights`] in
    /// all others.
    #[inline(always)]
    fn merge_scalar(self, vectorised: R::Mask, light: [R; 8], point: [R; 8]) -> LightSample<R, N> {
        let zero = R::splat(0.0);
        let [x, y, z, r, g, b, density, delta] = light;
        let [px, py, pz, nx, ny, nz, infinite, distance] = point;
        LightSample {
            wi: R::Vec3::select(vectorised, self.wi, R::Vec3::new(x, y, z)),
            radiance: R::Vec3::select(vectorised, self.radiance, R::Vec3::new(r, g, b)),
            density: R::select(vectorised, self.density, density),
            delta: !vectorised & delta.gt(zero),
            distance: R::select(vectorised, self.distance, distance),
            at: R::Vec3::select(vectorised, self.at, R::Vec3::new(px, py, pz)),
            normal: R::Vec3::select(vectorised, self.normal, R::Vec3::new(nx, ny, nz)),
            infinite: !vectorised & infinite.gt(zero),
            ..self
        }
    }

    /// Returns the MIS terms of the sampled lights for `bdpt`. `from` is the position and normal of
    /// the shaded points.
    #[inline(always)]
    pub fn mis_terms(&self, context: &Context, from: [R::Vec3; 2]) -> LightEnd<R> {
        let (light, dir) = ([self.at, self.normal], -self.wi);
        let triangles = triangle_mis_terms(light, from, dir, [self.probability, self.area]);
        if self.scalar_lanes == 0 {
            return triangles;
        }
        let zero = R::splat(0.0);
        let mut points = [None; N];
        let point_rows = R::transpose_store([
            light[0].x(),
            light[0].y(),
            light[0].z(),
            light[1].x(),
            light[1].y(),
            light[1].z(),
            zero,
            zero,
        ]);
        for i in active_lanes(self.scalar_lanes) {
            let [x, y, z, a, b, c, ..] = point_rows[i].0;
            let (position, normal) = (Vec3::new(x, y, z), Vec3::new(a, b, c));
            points[i] = Some(LightPoint {
                light: context.lights.id(self.light[i]),
                position,
                normal,
                uv: Uv::default(),
            });
        }
        with_scalar_mis_terms(context, triangles, self.area.gt(zero), &points, from, dir)
    }
}

/// Returns the MIS terms of points on triangles with uniform emission. `light` and `next` are
/// position and normal of the point and of the next vertex, `dir` is the direction to that vertex,
/// `probability` and `area` are those of the light.
#[inline(always)]
pub(super) fn triangle_mis_terms<R: Real>(
    light: [R::Vec3; 2],
    next: [R::Vec3; 2],
    dir: R::Vec3,
    [probability, area]: [R; 2],
) -> LightEnd<R> {
    let start_a = probability * (R::splat(1.0) / area);
    let dir_w = warp::cosine_hemisphere_pdf_w(light[1].dot(dir));
    let direct_w = probability * area::direct_w(next[0], light[0], light[1], area);
    LightEnd::on_surface(light, next, [start_a, dir_w, direct_w])
}

/// Returns `triangles` in the lanes of `vectorised`, and the MIS terms of `points` in all others.
/// `next` and `n` are position and normal of the next vertex, `dir` is the direction to it.
#[inline(always)]
pub(super) fn with_scalar_mis_terms<R: Lanes<N>, const N: usize>(
    context: &Context,
    triangles: LightEnd<R>,
    vectorised: R::Mask,
    points: &[Option<LightPoint>; N],
    [next, n]: [R::Vec3; 2],
    dir: R::Vec3,
) -> LightEnd<R> {
    let zero = R::splat(0.0);
    let next_rows = R::transpose_store([
        next.x(),
        next.y(),
        next.z(),
        n.x(),
        n.y(),
        n.z(),
        zero,
        zero,
    ]);
    let dir_rows = R::transpose_store([dir.x(), dir.y(), dir.z(), zero, zero, zero, zero, zero]);
    let [start, direct, next, back] = scalar_mis_terms(context, points, &next_rows, &dir_rows);
    LightEnd {
        start: R::Double::select(vectorised, triangles.start, R::load_doubles(&start)),
        direct: R::Double::select(vectorised, triangles.direct, R::load_doubles(&direct)),
        next: R::Double::select(vectorised, triangles.next, R::load_doubles(&next)),
        back: R::select(vectorised, triangles.back, R::load_doubles(&back).single()),
    }
}

/// Computes [`LightEnd::new`] of each point. Returns one array per field: `start`, `direct`, `next`
/// and `back`.
fn scalar_mis_terms<const N: usize>(
    context: &Context,
    points: &[Option<LightPoint>; N],
    next_rows: &[F32x8; N],
    dir_rows: &[F32x8; N],
) -> [[f64; N]; 4] {
    let mut terms = [[0.0; N]; 4];
    for (i, point) in points
        .iter()
        .enumerate()
        .filter_map(|(i, p)| Some((i, p.as_ref()?)))
    {
        let [x, y, z, a, b, c, ..] = next_rows[i].0;
        let [u, v, w, ..] = dir_rows[i].0;
        let end = LightEnd::new(
            context,
            point,
            Vec3::new(u, v, w),
            Vec3::new(x, y, z),
            Vec3::new(a, b, c),
        );
        let LightEnd {
            start,
            direct,
            next,
            back,
        } = end;
        for (row, number) in terms.iter_mut().zip([start, direct, next, f64::from(back)]) {
            row[i] = number;
        }
    }
    terms
}

/// Samples the lights of the given lanes with the scalar code. Returns two rows per lane. Row 0:
/// direction, radiance, density without the selection, and 1 for a Dirac light. Row 1: position on
/// the light, normal, 1 if it is infinitely distant, and distance.
fn sample_scalar_lights<const N: usize>(
    context: &Context,
    lanes: u32,
    lights: [u32; N],
    from: [[f32; N]; 3],
    u: [[f32; N]; 2],
) -> [[F32x8; N]; 2] {
    let mut sampled = [[F32x8::default(); N]; 2];
    for i in active_lanes(lanes) {
        let from = Vec3::new(from[0][i], from[1][i], from[2][i]);
        if let Some(s) =
            context
                .lights
                .sample_direct_from(context.scene, lights[i], from, [u[0][i], u[1][i]])
        {
            let (w, c, p, n) = (s.wi, s.radiance, s.point.position, s.point.normal);
            let [delta, infinite] =
                [s.delta, !s.distance.is_finite()].map(|yes| f32::from(u8::from(yes)));
            sampled[0][i] = F32x8([w.x, w.y, w.z, c.x, c.y, c.z, s.pdf_w, delta]);
            sampled[1][i] = F32x8([p.x, p.y, p.z, n.x, n.y, n.z, infinite, s.distance]);
        }
    }
    sampled
}
