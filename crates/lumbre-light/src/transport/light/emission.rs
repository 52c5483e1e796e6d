//! Paths that start at lights: samples, their densities, and the emission of a light's points.

use glam::Vec3;

use super::{LightPoint, Lights, SelectedLights};
use crate::math::real::{Mask, Outlined, Real, Vector};
use crate::math::simd::Lanes;
use crate::math::{Frame, warp};
use crate::scene::CompiledScene;
use crate::scene::compile::Uv;

/// The start of a path at a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmissionSample<R: Real = f32, const N: usize = 1> {
    /// Start point of the path.
    pub point: LightPoint<R, N>,
    /// Unit direction of emission.
    pub dir: R::Vec3,
    /// Emitted radiance in that direction (intensity for a point, irradiance for a direction).
    pub radiance: R::Vec3,
    /// Density of the position per area, including the choice of the light. For a point the
    /// probability alone; for infinitely distant lights per area perpendicular to the direction. If
    /// this or `pdf_w` is 0, the path would carry nothing, and the other fields are undefined.
    pub pdf_a: R,
    /// Density of the direction per solid angle, given the position; 1 for a directional light.
    pub pdf_w: R,
    /// Cosine between the normal and the direction; 1 for lights without a surface.
    pub cos: R,
}

/// The densities with which a light that a path hit would have been sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmissionPdf<R = f32> {
    /// Density of the position: see [`EmissionSample::pdf_a`].
    pub pdf_a: R,
    /// Density of the direction: see [`EmissionSample::pdf_w`].
    pub pdf_w: R,
}

impl<R: Lanes<N>, const N: usize> EmissionSample<R, N> {
    /// Returns the lanes with a path.
    #[inline(always)]
    pub fn starts(&self) -> R::Mask {
        self.pdf_w.gt(R::splat(0.0)) & self.pdf_a.gt(R::splat(0.0))
    }

    /// Returns `yes` where the mask is set, else `no`, with the lights of `no`.
    #[inline(always)]
    fn select(mask: R::Mask, yes: Self, no: Self) -> Self {
        EmissionSample {
            point: LightPoint::select(mask, yes.point, no.point),
            dir: R::Vec3::select(mask, yes.dir, no.dir),
            radiance: R::Vec3::select(mask, yes.radiance, no.radiance),
            pdf_a: R::select(mask, yes.pdf_a, no.pdf_a),
            pdf_w: R::select(mask, yes.pdf_w, no.pdf_w),
            cos: R::select(mask, yes.cos, no.cos),
        }
    }
}

impl<R: Lanes<N>, const N: usize> SelectedLights<'_, R, N> {
    /// Samples the start of paths: positions with `u`, directions with `v`, in the measures of the
    /// table in the [module](super).
    #[inline(always)]
    pub fn sample_emission(
        &self,
        scene: &CompiledScene,
        u: [R; 2],
        v: [R; 2],
    ) -> EmissionSample<R, N> {
        R::outline(EmissionSampling {
            lights: self,
            scene,
            u,
            v,
        })
    }

    /// Computes the result of [`SelectedLights::sample_emission`].
    #[inline(always)]
    fn start(&self, scene: &CompiledScene, u: [R; 2], v: [R; 2]) -> EmissionSample<R, N> {
        let mut sample = self.start_on_surfaces(scene, u, v);
        let [points, infinite] = [self.are_points(), self.are_infinite()];
        let others = points | infinite;
        if others.any() {
            let start = self.start_without_surface(u, v, [others, infinite]);
            sample = EmissionSample::select(others, start, sample);
        }
        EmissionSample {
            pdf_a: sample.pdf_a * self.probability,
            ..sample
        }
    }

    /// Samples points uniform over areas, and directions by the cosine with their normals. The
    /// density of lanes without an area is 0.
    #[inline(always)]
    fn start_on_surfaces(
        &self,
        scene: &CompiledScene,
        u: [R; 2],
        v: [R; 2],
    ) -> EmissionSample<R, N> {
        let emitters = self.are_emitters();
        let (position, normal) = self.sample_area(u);
        let local: R::Vec3 = warp::cosine_hemisphere(v);
        let textured = self.are_textured();
        let uv = if textured.any() {
            self.uv(scene, u, normal, textured)
        } else {
            Uv::zero()
        };
        EmissionSample {
            point: LightPoint {
                uv,
                ..self.point(position, normal)
            },
            dir: Frame::from_normal(normal).to_world(local),
            radiance: self.emission(scene, &uv, textured),
            pdf_a: R::select(emitters, R::splat(1.0) / self.area(), R::splat(0.0)),
            pdf_w: warp::cosine_hemisphere_pdf_w(local.z()),
            cos: local.z(),
        }
    }

    /// Samples directions of points, and rays of infinitely distant lights through points uniform
    /// over the disk that covers the scene.
    #[inline(always)]
    fn start_without_surface(
        &self,
        u: [R; 2],
        v: [R; 2],
        [others, infinite]: [R::Mask; 2],
    ) -> EmissionSample<R, N> {
        let one = R::splat(1.0);
        let ([dir, radiance], pdf_w) = self.sample_dirs(v, others);
        let (mut position, mut pdf_a) = (self.vector(0), one);
        if infinite.any() {
            let ball = &self.lights.ball;
            position = R::Vec3::select(infinite, ball.on_disk(dir, u), position);
            pdf_a = R::select(infinite, R::splat(ball.pdf_a()), pdf_a);
        }
        EmissionSample {
            point: self.point(position, dir),
            dir,
            radiance,
            pdf_a,
            pdf_w,
            cos: one,
        }
    }

    /// Returns the densities with which [`SelectedLights::sample_emission`] starts a path at points
    /// with the normal `normal` in the unit directions `dir`. For a directional light, `pdf_w` is 1
    /// in its own direction and 0 in others.
    #[inline(always)]
    pub fn pdf_emission(&self, normal: R::Vec3, dir: R::Vec3) -> EmissionPdf<R> {
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        let emitters = self.are_emitters();
        let cosine = warp::cosine_hemisphere_pdf_w(normal.dot(dir));
        let mut pdf_w = R::select(emitters, cosine, zero);
        let mut pdf_a = R::select(emitters, self.probability * (one / self.area()), zero);
        let [points, infinite] = [self.are_points(), self.are_infinite()];
        let others = points | infinite;
        if others.any() {
            let disk = self.probability * R::splat(self.lights.ball.pdf_a());
            pdf_a = R::select(points, self.probability, pdf_a);
            pdf_a = R::select(infinite, disk, pdf_a);
            pdf_w = R::select(others, self.pdf_dirs(dir, others), pdf_w);
        }
        EmissionPdf { pdf_a, pdf_w }
    }

    /// Returns the emission of points of these lights in the unit directions `dir`: radiance, the
    /// intensity of a point light, the irradiance of a directional light; black behind a surface.
    #[inline(always)]
    pub fn emitted(
        &self,
        scene: &CompiledScene,
        point: &LightPoint<R, N>,
        dir: R::Vec3,
    ) -> R::Vec3 {
        let black = R::Vec3::broadcast(Vec3::ZERO);
        let front = self.are_emitters() & point.normal.dot(dir).gt(R::splat(0.0));
        let textured = self.are_textured() & front;
        let surface = self.emission(scene, &point.uv, textured);
        let mut emitted = R::Vec3::select(front, surface, black);
        let others = self.are_points() | self.are_infinite();
        if others.any() {
            emitted = R::Vec3::select(others, self.emitted_into(dir, others), emitted);
        }
        emitted
    }
}

/// Outlined computation of [`SelectedLights::sample_emission`].
struct EmissionSampling<'a, R: Real, const N: usize> {
    lights: &'a SelectedLights<'a, R, N>,
    scene: &'a CompiledScene,
    u: [R; 2],
    v: [R; 2],
}

impl<R: Lanes<N>, const N: usize> Outlined for EmissionSampling<'_, R, N> {
    type Output = EmissionSample<R, N>;

    #[inline(always)]
    fn run(self) -> EmissionSample<R, N> {
        self.lights.start(self.scene, self.u, self.v)
    }
}

impl Lights {
    /// Samples the start of a path at a light, in the measures of the table above; `None` if the
    /// path would carry nothing.
    #[inline(always)]
    pub fn sample_emission(
        &self,
        scene: &CompiledScene,
        choice: f32,
        u: [f32; 2],
        v: [f32; 2],
    ) -> Option<EmissionSample> {
        let sample = self.select(choice, true).sample_emission(scene, u, v);
        sample.starts().then_some(sample)
    }

    /// Returns the densities with which [`Lights::sample_emission`] starts a path at a point of any
    /// light in the unit direction `dir`: see [`SelectedLights::pdf_emission`].
    #[inline(always)]
    pub fn pdf_emission_at(&self, point: &LightPoint, dir: Vec3) -> EmissionPdf {
        self.at(point).pdf_emission(point.normal, dir)
    }

    /// Returns the emission of a light point in the unit direction `dir`: see
    /// [`SelectedLights::emitted`].
    #[inline(always)]
    pub fn emitted(&self, scene: &CompiledScene, point: &LightPoint, dir: Vec3) -> Vec3 {
        self.at(point).emitted(scene, point, dir)
    }

    /// Returns the light that a point belongs to.
    #[inline(always)]
    pub fn at(&self, point: &LightPoint) -> SelectedLights<'_, f32, 1> {
        self.with_indices([self.index(point.light())], true)
    }
}
