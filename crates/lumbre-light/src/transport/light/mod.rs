//! Light sources, and the choice among them.
//!
//! [`Lights::sample_direct`] samples light that arrives at a point, [`Lights::sample_emission`]
//! starts a path at a light, and the densities of both serve paths that found light by other means.
//! Radiance itself is [`Surface::emitted`](super::surface::Surface::emitted) for surfaces and
//! [`Lights::environment`] for rays that leave the scene.
//!
//! A density includes the probability of choosing the light, except where a name contains `one`:
//! those serve integrators that sample every light in turn ([`Lights::indices`]).
//!
//! | light | [`Lights::sample_direct`] | [`Lights::sample_emission`] |
//! |---|---|---|
//! | triangle | uniform over its area | uniform over its area, cosine about its normal |
//! | sphere | uniform over the subtended cone; none from inside | same as for a triangle |
//! | point | certain | `pdf_a`: probability of the choice; `pdf_w`: uniform over all directions, |
//! | | | 1 / (4 pi), or uniform over the cone of a spot |
//! | direction | certain | uniform over a disk that covers the scene; `pdf_w` is 1 |
//! | environment | its brightness times solid angle | the same, then uniform over a disk |
//!
//! Disks are perpendicular to the direction of emission.
//!
//! Throughput at the start of a light path is `radiance * cos / (pdf_a * pdf_w)` for every kind.
//!
//! # Densities of a path's last edge
//!
//! How the strategies of bidirectional methods find the last edge of a path, from the surface point
//! x to the light [Veach 1997, 8.2 and 10.3]: `w` is the unit direction from x to the light, `c`
//! the probability of choosing it ([`Lights::pdf_choice`]), `p(w)` the density with which the
//! surface samples `w`, R the radius of the bounding sphere of all surfaces
//! ([`Lights::pdf_emission_at`] has the disk's density). In a path that ends at an infinitely
//! distant light, the direction takes the place of the last vertex, and its density stays per solid
//! angle: the disk is only a way of sampling x.
//!
//! - Surface, at y. Hit (s = 0): p(w) cos_y / d^2 per area of y. Sampled from x (s = 1): c times
//!   [`Lights::pdf_direct_one_w`] cos_y / d^2 per area of y. Start of a light path (s >= 2), then x:
//!   c / area per area of y; then cos_y / pi per solid angle.
//! - Environment. Hit: p(w) per solid angle. Sampled: c p_env(w) per solid angle. Start: c p_env(w)
//!   per solid angle; then cos_x / (pi R^2) per area of x.
//! - Direction. Hit: never. Sampled: c, a Dirac. Start: c, a Dirac; then cos_x / (pi R^2) per area
//!   of x.
//! - Point. Hit: never. Sampled: c, a Dirac. Start: c, a Dirac; then 1 / (4 pi), or uniform over
//!   the cone, per solid angle.

pub mod area;
mod bounds;
mod directional;
mod environment;
mod point;
mod select;
mod sphere;

use std::ops::Range;

use glam::Vec3;

use self::bounds::BoundingSphere;
use self::environment::EnvironmentLight;
use super::surface::sphere_uv;
use crate::math::distribution::AliasTable;
use crate::math::real::{Real, Vector};
use crate::math::{Frame, warp};
use crate::scene::CompiledScene;
use crate::scene::compile::Uv;

pub use select::{FIELD as SELECT_FIELD, LightSelection};

/// All light sources of a scene, with indices: emissive primitives first, then points, directions,
/// and the environment.
#[derive(Clone, Debug)]
pub struct Lights {
    /// Distribution over all indices; `None` if nothing emits.
    pub choice: Option<AliasTable>,
    ids: Vec<LightId>,
    /// Index of the first light of a kind: points, directions, environment.
    pub first: [u32; 3],
    /// Environment light with its distribution, if the scene has one.
    pub environment_light: Option<EnvironmentLight>,
    /// Bounding sphere of the scene.
    pub ball: BoundingSphere,
    total_area: f64,
}

/// Returns the relative luminance of linear sRGB [IEC 61966-2-1].
pub fn luminance(color: Vec3) -> f64 {
    color
        .as_dvec3()
        .dot(glam::DVec3::new(0.2126, 0.7152, 0.0722))
}

/// Light that arrives at a point, before the shadow test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectSample {
    /// Unit direction from the point to the light.
    pub wi: Vec3,
    /// Distance to the light; infinite for infinitely distant lights.
    pub distance: f32,
    /// Radiance that arrives along `-wi`; for a Dirac light the irradiance on a surface facing it.
    pub radiance: Vec3,
    /// Density per solid angle at the point; for a Dirac light the probability of choosing it.
    pub pdf_w: f32,
    /// Whether no other technique can find this light (points, directions).
    pub delta: bool,
    /// The point on the light.
    pub point: LightPoint,
}

/// A point of a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightPoint {
    /// Identity of the light.
    pub light: LightId,
    /// Position in world space; for infinitely distant lights, a point outside the scene's bounding
    /// sphere.
    pub position: Vec3,
    /// Unit normal on the emitting side; for lights without a surface, the direction of emission.
    pub normal: Vec3,
    /// Texture coordinates before tiling; zero for lights without a surface.
    pub uv: Uv,
}

/// Identifies one light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightId {
    /// An emissive primitive: index into [`CompiledScene::emitters`].
    Emitter(u32),
    /// A point light: index into [`CompiledScene::points`].
    Point(u32),
    /// A directional light: index into [`CompiledScene::directionals`].
    Directional(u32),
    /// The environment: [`CompiledScene::environment`].
    Environment,
}

/// The start of a path at a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmissionSample {
    /// Start point of the path.
    pub point: LightPoint,
    /// Unit direction of emission.
    pub dir: Vec3,
    /// Emitted radiance in that direction (intensity for a point, irradiance for a direction).
    pub radiance: Vec3,
    /// Density of the position per area, including the choice of the light. For a point the
    /// probability alone; for infinitely distant lights per area perpendicular to the direction.
    pub pdf_a: f32,
    /// Density of the direction per solid angle, given the position; 1 for a directional light.
    pub pdf_w: f32,
    /// Cosine between the normal and the direction; 1 for lights without a surface.
    pub cos: f32,
}

/// The densities with which a light that a path hit would have been sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmissionPdf {
    /// Density of the position: see [`EmissionSample::pdf_a`].
    pub pdf_a: f32,
    /// Density of the direction: see [`EmissionSample::pdf_w`].
    pub pdf_w: f32,
}

impl Lights {
    /// Collects the lights of a scene, chosen by their power.
    pub fn new(scene: &CompiledScene) -> Lights {
        Lights::with_select(scene, LightSelection::default())
    }

    /// Collects the lights of a scene.
    pub fn with_select(scene: &CompiledScene, select: LightSelection) -> Lights {
        let environment_light = scene.environment.as_ref().and_then(EnvironmentLight::new);
        let [emitters, points, directionals] = [
            scene.emitters.len(),
            scene.points.len(),
            scene.directionals.len(),
        ]
        .map(|n| n as u32);
        let ids: Vec<LightId> = (0..emitters)
            .map(LightId::Emitter)
            .chain((0..points).map(LightId::Point))
            .chain((0..directionals).map(LightId::Directional))
            .chain(environment_light.is_some().then_some(LightId::Environment))
            .collect();
        let ball = BoundingSphere::for_scene(scene);
        let weights = select::weights(
            scene,
            select,
            ids.iter().copied(),
            &ball,
            environment_light.as_ref(),
        );
        Lights {
            choice: AliasTable::new(weights),
            ids,
            first: [
                emitters,
                emitters + points,
                emitters + points + directionals,
            ],
            environment_light,
            ball,
            total_area: scene.emitters.iter().map(|e| f64::from(e.area)).sum(),
        }
    }

    /// Returns the number of lights.
    pub fn count(&self) -> usize {
        self.ids.len()
    }

    /// Returns the indices of all lights, for [`Lights::sample_direct_from`].
    pub fn indices(&self) -> Range<u32> {
        0..self.ids.len() as u32
    }

    /// Returns the identity of the light with an index below [`Lights::count`].
    pub fn id(&self, index: u32) -> LightId {
        self.ids[index as usize]
    }

    /// Returns the total area of emissive surfaces in square scene units.
    pub fn total_area(&self) -> f64 {
        self.total_area
    }

    /// Returns the probability of choosing a light; zero for one that the scene does not have.
    #[inline]
    pub fn pdf_choice(&self, light: LightId) -> f32 {
        let index = match light {
            LightId::Emitter(i) => i,
            LightId::Point(i) => self.first[0] + i,
            LightId::Directional(i) => self.first[1] + i,
            LightId::Environment => self.first[2],
        } as usize;
        if index >= self.ids.len() {
            return 0.0;
        }
        self.choice.as_ref().map_or(0.0, |c| c.pmf(index))
    }

    /// Returns the radiance that arrives along `-dir` from outside the scene.
    #[inline]
    pub fn environment(&self, dir: Vec3) -> Vec3 {
        self.environment_light
            .as_ref()
            .map_or(Vec3::ZERO, |s| s.radiance(dir))
    }

    /// Returns the distance between `from` and the wave front of an infinitely distant light in the
    /// unit direction `wi` at the moment when the front touches the bounding sphere of all
    /// surfaces; negative for points beyond it. Scalar or vectorised.
    #[inline(always)]
    pub fn front_distance<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(&self, from: V, wi: V) -> R {
        R::splat(self.ball.radius) - (from - V::broadcast(self.ball.center)).dot(wi)
    }

    /// Chooses a light: returns its index and its probability, or `None` if nothing emits.
    #[inline]
    pub fn choose(&self, choice: f32) -> Option<(u32, f32)> {
        let (index, probability) = self.choice.as_ref()?.sample(choice);
        Some((index as u32, probability))
    }

    /// Samples light that arrives at `from`; `None` if the sampled point does not emit towards it.
    #[inline]
    pub fn sample_direct(
        &self,
        scene: &CompiledScene,
        from: Vec3,
        choice: f32,
        u: [f32; 2],
    ) -> Option<DirectSample> {
        let (index, probability) = self.choose(choice)?;
        let one = self.sample_direct_from(scene, index, from, u)?;
        Some(DirectSample {
            pdf_w: one.pdf_w * probability,
            ..one
        })
    }

    /// Samples light that arrives at `from` from the light with this index. The density does not
    /// include the choice; for a Dirac light it is 1.
    #[inline]
    pub fn sample_direct_from(
        &self,
        scene: &CompiledScene,
        index: u32,
        from: Vec3,
        u: [f32; 2],
    ) -> Option<DirectSample> {
        match self.ids[index as usize] {
            LightId::Emitter(i) => match area::sphere(scene, i) {
                None => area::sample_direct(scene, i, from, u),
                Some(ball) => {
                    let s = sphere::sample(ball, from, u)?;
                    let position = ball.center + s.normal * ball.radius;
                    let point = LightPoint {
                        light: LightId::Emitter(i),
                        position,
                        normal: s.normal,
                        uv: Uv::same(sphere_uv(s.normal)),
                    };
                    let radiance = area::emission(scene, i, point.uv);
                    let distance = position.distance(from);
                    Some(DirectSample {
                        wi: s.wi,
                        distance,
                        radiance,
                        pdf_w: s.pdf_w,
                        delta: false,
                        point,
                    })
                }
            },
            LightId::Point(i) => point::sample_direct(&scene.points[i as usize], i, from),
            LightId::Directional(i) => Some(directional::sample_direct(
                &scene.directionals[i as usize],
                i,
                from,
                &self.ball,
            )),
            LightId::Environment => {
                let (wi, pdf_w) = self.environment_light.as_ref()?.sample(u);
                let point = self.ball.outside(LightId::Environment, from, wi);
                let radiance = self.environment(wi);
                let usable = pdf_w > 0.0;
                usable.then_some(DirectSample {
                    wi,
                    distance: f32::INFINITY,
                    radiance,
                    pdf_w,
                    delta: false,
                    point,
                })
            }
        }
    }

    /// Returns the density per solid angle at `from` with which [`Lights::sample_direct`] samples
    /// the point `at` of emitter `i`, whose front side has the unit normal `normal` there; zero
    /// from behind.
    #[inline]
    pub fn pdf_direct_w(
        &self,
        scene: &CompiledScene,
        from: Vec3,
        i: u32,
        at: Vec3,
        normal: Vec3,
    ) -> f32 {
        self.pdf_choice(LightId::Emitter(i)) * self.pdf_direct_one_w(scene, from, i, at, normal)
    }

    /// Returns the same density for [`Lights::sample_direct_from`], without the choice.
    #[inline]
    pub fn pdf_direct_one_w(
        &self,
        scene: &CompiledScene,
        from: Vec3,
        i: u32,
        at: Vec3,
        normal: Vec3,
    ) -> f32 {
        match area::sphere(scene, i) {
            None => area::pdf_direct_w(scene, i, from, at, normal),
            Some(ball) => sphere::pdf_w(ball, from, at, normal),
        }
    }

    /// Returns the density per solid angle with which [`Lights::sample_direct`] samples the
    /// environment in direction `dir`.
    #[inline]
    pub fn pdf_environment_w(&self, dir: Vec3) -> f32 {
        self.pdf_choice(LightId::Environment) * self.pdf_environment_one_w(dir)
    }

    /// Returns the same density for [`Lights::sample_direct_from`], without the choice.
    #[inline]
    pub fn pdf_environment_one_w(&self, dir: Vec3) -> f32 {
        self.environment_light
            .as_ref()
            .map_or(0.0, |s| s.pdf_w(dir))
    }

    /// Samples the start of a path at a light, in the measures of the table above; `None` if the
    /// path would carry nothing.
    #[inline]
    pub fn sample_emission(
        &self,
        scene: &CompiledScene,
        choice: f32,
        u: [f32; 2],
        v: [f32; 2],
    ) -> Option<EmissionSample> {
        let (index, probability) = self.choice.as_ref()?.sample(choice);
        let one = match self.ids[index] {
            LightId::Emitter(i) => {
                let point = area::sample(scene, i, u);
                let local = warp::cosine_hemisphere(v);
                EmissionSample {
                    point,
                    dir: Frame::from_normal(point.normal).to_world(local),
                    radiance: area::emission(scene, i, point.uv),
                    pdf_a: area::pdf_a(scene, i),
                    pdf_w: warp::cosine_hemisphere_pdf_w(local.z),
                    cos: local.z,
                }
            }
            LightId::Point(i) => point::sample_emission(&scene.points[i as usize], i, v),
            LightId::Directional(i) => {
                directional::sample_emission(&scene.directionals[i as usize], i, &self.ball, u)
            }
            LightId::Environment => {
                let (from, pdf_w) = self.environment_light.as_ref()?.sample(v);
                EmissionSample {
                    point: self.ball.on_disk(LightId::Environment, -from, u),
                    dir: -from,
                    radiance: self.environment(from),
                    pdf_a: self.ball.pdf_a(),
                    pdf_w,
                    cos: 1.0,
                }
            }
        };
        let usable = one.pdf_w > 0.0 && one.pdf_a > 0.0;
        usable.then_some(EmissionSample {
            pdf_a: one.pdf_a * probability,
            ..one
        })
    }

    /// Returns the densities with which [`Lights::sample_emission`] starts a path at a point of
    /// emitter `i` in a direction whose cosine with the front normal is `cos`.
    #[inline]
    pub fn pdf_emission(&self, scene: &CompiledScene, i: u32, cos: f32) -> EmissionPdf {
        let pdf_a = self.pdf_choice(LightId::Emitter(i)) * area::pdf_a(scene, i);
        EmissionPdf {
            pdf_a,
            pdf_w: warp::cosine_hemisphere_pdf_w(cos),
        }
    }

    /// Returns the densities with which [`Lights::sample_emission`] starts a path at a point of any
    /// light in the unit direction `dir`. For a directional light, `pdf_w` is 1 in its own
    /// direction and 0 in others.
    pub fn pdf_emission_at(
        &self,
        scene: &CompiledScene,
        point: &LightPoint,
        dir: Vec3,
    ) -> EmissionPdf {
        let choice = self.pdf_choice(point.light);
        match point.light {
            LightId::Emitter(i) => self.pdf_emission(scene, i, point.normal.dot(dir)),
            LightId::Point(i) => EmissionPdf {
                pdf_a: choice,
                pdf_w: point::pdf_w(&scene.points[i as usize].cone, dir),
            },
            LightId::Directional(i) => {
                let own = directional::shines_into(&scene.directionals[i as usize], dir);
                EmissionPdf {
                    pdf_a: choice * self.ball.pdf_a(),
                    pdf_w: if own { 1.0 } else { 0.0 },
                }
            }
            LightId::Environment => EmissionPdf {
                pdf_a: choice * self.ball.pdf_a(),
                pdf_w: self.pdf_environment_one_w(-dir),
            },
        }
    }

    /// Returns the emission of a light point in the unit direction `dir`: radiance, the intensity
    /// of a point light, the irradiance of a directional light; black behind a surface.
    pub fn emitted(&self, scene: &CompiledScene, point: &LightPoint, dir: Vec3) -> Vec3 {
        match point.light {
            LightId::Emitter(i) if point.normal.dot(dir) > 0.0 => {
                area::emission(scene, i, point.uv)
            }
            LightId::Emitter(_) => Vec3::ZERO,
            LightId::Point(i) => {
                let light = &scene.points[i as usize];
                light.intensity * point::falloff(&light.cone, dir)
            }
            LightId::Directional(i) => {
                let light = &scene.directionals[i as usize];
                if directional::shines_into(light, dir) {
                    light.irradiance
                } else {
                    Vec3::ZERO
                }
            }
            LightId::Environment => self.environment(-dir),
        }
    }
}
