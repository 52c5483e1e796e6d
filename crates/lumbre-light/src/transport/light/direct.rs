//! Light that arrives at points: sampling of lights, and the densities of that.

use super::{LightId, LightPoint, Lights, SelectedLights, area, sphere};
use crate::math::real::{Mask, Outlined, Real, Vector};
use crate::math::simd::Lanes;
use crate::scene::CompiledScene;
use glam::Vec3;

/// Light that arrives at the point of each lane, before the shadow test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectSample<R: Real = f32, const N: usize = 1> {
    /// Unit direction from the point to the light.
    pub wi: R::Vec3,
    /// Distance to the light; infinite for infinitely distant lights.
    pub distance: R,
    /// Radiance that arrives along `-wi`; for a Dirac light the irradiance on a surface facing it.
    pub radiance: R::Vec3,
    /// Density per solid angle at the point; for a Dirac light the probability of choosing it. If it
    /// is 0, there is no light, and the other fields are undefined.
    pub pdf_w: R,
    /// Whether no other technique can find this light (points, directions).
    pub delta: R::Mask,
    /// The point on the light.
    pub point: LightPoint<R, N>,
}

impl<R: Lanes<N>, const N: usize> DirectSample<R, N> {
    /// Returns the lanes in which light arrives.
    #[inline(always)]
    pub fn arrives(&self) -> R::Mask {
        self.pdf_w.gt(R::splat(0.0))
    }

    /// Returns the lanes whose light is infinitely distant.
    #[inline(always)]
    pub fn is_infinite(&self) -> R::Mask {
        !self.distance.is_finite()
    }

    /// Returns `yes` where the mask is set, else `no`, with the lights of `no`.
    #[inline(always)]
    fn select(mask: R::Mask, yes: Self, no: Self) -> Self {
        DirectSample {
            wi: R::Vec3::select(mask, yes.wi, no.wi),
            distance: R::select(mask, yes.distance, no.distance),
            radiance: R::Vec3::select(mask, yes.radiance, no.radiance),
            pdf_w: R::select(mask, yes.pdf_w, no.pdf_w),
            delta: no.delta,
            point: LightPoint::select(mask, yes.point, no.point),
        }
    }
}

impl<R: Lanes<N>, const N: usize> SelectedLights<'_, R, N> {
    /// Samples light that arrives at `from`, for which the lights were selected.
    #[inline(always)]
    pub fn sample_direct(
        &self,
        scene: &CompiledScene,
        from: R::Vec3,
        u: [R; 2],
    ) -> DirectSample<R, N> {
        let one = self.sample_direct_one(scene, from, u);
        DirectSample {
            pdf_w: one.pdf_w * self.chosen,
            ..one
        }
    }

    /// Samples light that arrives at `from`. The density does not include the choice of the light;
    /// for a Dirac light it is 1.
    #[inline(always)]
    pub fn sample_direct_one(
        &self,
        scene: &CompiledScene,
        from: R::Vec3,
        u: [R; 2],
    ) -> DirectSample<R, N> {
        R::outline(DirectSampling {
            lights: self,
            scene,
            from,
            u,
        })
    }

    /// Computes the result of [`SelectedLights::sample_direct_one`].
    #[inline(always)]
    fn sample_kinds(&self, scene: &CompiledScene, from: R::Vec3, u: [R; 2]) -> DirectSample<R, N> {
        let mut sample = self.sample_triangles(from, u);
        let spheres = self.are_spheres();
        if spheres.any() {
            sample = DirectSample::select(spheres, self.sample_spheres(from, u), sample);
        }
        let points = self.are_points();
        if points.any() {
            sample = DirectSample::select(points, self.sample_points(from, points), sample);
        }
        let infinite = self.are_infinite();
        if infinite.any() {
            let distant = self.sample_infinite(from, u, infinite);
            sample = DirectSample::select(infinite, distant, sample);
        }
        let textured = self.are_textured() & sample.arrives();
        if textured.any() {
            sample.point.uv = self.uv(scene, u, sample.point.normal, textured);
            let radiance = self.emission(scene, &sample.point.uv, textured);
            sample.radiance = R::Vec3::select(textured, radiance, sample.radiance);
        }
        sample
    }

    /// Returns the sample with these fields, without texture coordinates.
    #[inline(always)]
    fn sample_of(
        &self,
        [wi, position, normal, radiance]: [R::Vec3; 4],
        [distance, pdf_w]: [R; 2],
    ) -> DirectSample<R, N> {
        DirectSample {
            wi,
            distance,
            radiance,
            pdf_w,
            delta: self.are_dirac(),
            point: self.point(position, normal),
        }
    }

    /// Samples points uniform over triangles. There is no light from behind.
    #[inline(always)]
    fn sample_triangles(&self, from: R::Vec3, u: [R; 2]) -> DirectSample<R, N> {
        let (at, normal) = self.sample_triangle(u);
        let to = at - from;
        let distance = to.length();
        let pdf_w = area::density(to, distance, normal, self.area());
        let wi = to / distance;
        self.sample_of([wi, at, normal, self.radiance()], [distance, pdf_w])
    }

    /// Samples directions uniform over the cones that spheres subtend. There is no light from
    /// inside.
    #[inline(always)]
    fn sample_spheres(&self, from: R::Vec3, u: [R; 2]) -> DirectSample<R, N> {
        let (center, radius) = self.sphere();
        let s = sphere::sample(center, radius, from, u);
        let at = center + s.normal * radius;
        let numbers = [(at - from).length(), s.pdf_w];
        self.sample_of([s.wi, at, s.normal, self.radiance()], numbers)
    }

    /// Returns the light of point lights. There is none at the light itself and where it does not
    /// emit.
    #[inline(always)]
    fn sample_points(&self, from: R::Vec3, points: R::Mask) -> DirectSample<R, N> {
        let zero = R::splat(0.0);
        let position = self.vector(0);
        let to = position - from;
        let distance = to.length();
        let wi = to / distance;
        let intensity = self.emitted_into(-wi, points);
        let radiance = intensity / (distance * distance);
        let emits = !intensity.same(R::Vec3::broadcast(Vec3::ZERO));
        let usable = distance.gt(zero) & emits & radiance.is_finite();
        let pdf_w = R::select(usable, R::splat(1.0), zero);
        self.sample_of([wi, position, -wi, radiance], [distance, pdf_w])
    }

    /// Samples directions to infinitely distant lights.
    #[inline(always)]
    fn sample_infinite(&self, from: R::Vec3, u: [R; 2], infinite: R::Mask) -> DirectSample<R, N> {
        let ([dir, radiance], pdf_w) = self.sample_dirs(u, infinite);
        let at = self.lights.ball.outside(from, -dir);
        self.sample_of([-dir, at, dir, radiance], [R::splat(f32::INFINITY), pdf_w])
    }

    /// Returns the density per solid angle at `from` with which
    /// [`SelectedLights::sample_direct`] samples the point `at` of emissive primitives, whose front
    /// has the unit normal `normal` there; zero from behind.
    #[inline(always)]
    pub fn pdf_direct_w(&self, from: R::Vec3, at: R::Vec3, normal: R::Vec3) -> R {
        self.probability_for(from) * self.pdf_direct_one_w(from, at, normal)
    }

    /// Returns the same density for [`SelectedLights::sample_direct_one`], without the choice.
    #[inline(always)]
    pub fn pdf_direct_one_w(&self, from: R::Vec3, at: R::Vec3, normal: R::Vec3) -> R {
        let to = at - from;
        let mut pdf_w = area::density(to, to.length(), normal, self.area());
        let spheres = self.are_spheres();
        if spheres.any() {
            let (center, radius) = self.sphere();
            let sphere = sphere::pdf_w([center, at, normal], radius, from);
            pdf_w = R::select(spheres, sphere, pdf_w);
        }
        R::select(self.are_emitters(), pdf_w, R::splat(0.0))
    }
}

/// Outlined computation of [`SelectedLights::sample_direct_one`].
struct DirectSampling<'a, R: Real, const N: usize> {
    lights: &'a SelectedLights<'a, R, N>,
    scene: &'a CompiledScene,
    from: R::Vec3,
    u: [R; 2],
}

impl<R: Lanes<N>, const N: usize> Outlined for DirectSampling<'_, R, N> {
    type Output = DirectSample<R, N>;

    #[inline(always)]
    fn run(self) -> DirectSample<R, N> {
        self.lights.sample_kinds(self.scene, self.from, self.u)
    }
}

impl Lights {
    /// Samples light that arrives at `from`; `None` if the sampled point does not emit towards it.
    #[inline(always)]
    pub fn sample_direct(
        &self,
        scene: &CompiledScene,
        from: Vec3,
        choice: f32,
        u: [f32; 2],
    ) -> Option<DirectSample> {
        let lights = self.select_for(from, choice, true);
        let sample = lights.sample_direct(scene, from, u);
        sample.arrives().then_some(sample)
    }

    /// Samples light that arrives at `from` from the light with this index. The density does not
    /// include the choice; for a Dirac light it is 1.
    #[inline(always)]
    pub fn sample_direct_from(
        &self,
        scene: &CompiledScene,
        index: u32,
        from: Vec3,
        u: [f32; 2],
    ) -> Option<DirectSample> {
        let lights = self.with_indices([index], true);
        let sample = lights.sample_direct_one(scene, from, u);
        sample.arrives().then_some(sample)
    }

    /// Returns the density per solid angle at `from` with which [`Lights::sample_direct`] samples
    /// the point `at` of emitter `i`, whose front side has the unit normal `normal` there; zero
    /// from behind.
    #[inline(always)]
    pub fn pdf_direct_w(&self, from: Vec3, i: u32, at: Vec3, normal: Vec3) -> f32 {
        self.with_indices([i], true).pdf_direct_w(from, at, normal)
    }

    /// Returns the same density for [`Lights::sample_direct_from`], without the choice.
    #[inline(always)]
    pub fn pdf_direct_one_w(&self, from: Vec3, i: u32, at: Vec3, normal: Vec3) -> f32 {
        self.with_indices([i], true)
            .pdf_direct_one_w(from, at, normal)
    }

    /// Returns the radiance that arrives along `-dir` from outside the scene.
    #[inline(always)]
    pub fn environment<V: Vector<Scalar: Lanes<N>>, const N: usize>(&self, dir: V) -> V {
        match &self.environment_light {
            None => V::broadcast(Vec3::ZERO),
            Some(light) => light.radiance::<V::Scalar, N>(dir, Mask::splat(true)),
        }
    }

    /// Returns the density per solid angle with which [`Lights::sample_direct`] samples the
    /// environment in direction `dir`.
    #[inline(always)]
    pub fn pdf_environment_w<V: Vector<Scalar: Lanes<N>>, const N: usize>(
        &self,
        dir: V,
    ) -> V::Scalar {
        let index = self.index(LightId::Environment);
        let probability = match &self.tree {
            None => self.pdf_index(index),
            Some(tree) => tree.distant_probability(index),
        };
        V::Scalar::splat(probability) * self.pdf_environment_one_w(dir)
    }

    /// Returns the same density for [`Lights::sample_direct_from`], without the choice.
    #[inline(always)]
    pub fn pdf_environment_one_w<V: Vector<Scalar: Lanes<N>>, const N: usize>(
        &self,
        dir: V,
    ) -> V::Scalar {
        match &self.environment_light {
            None => V::Scalar::splat(0.0),
            Some(light) => light.pdf_w::<V::Scalar, N>(dir, Mask::splat(true)),
        }
    }
}
