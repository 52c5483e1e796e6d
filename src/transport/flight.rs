//! How long light has been on its way, and what a composed material is made of for one path.
//!
//! The time of a path is its optical length: every segment times the index of the medium that it runs through, and the
//! delays of the materials that gave the light back. It is counted in two sums, one of segments and one of delays.
//!
//! The index is known by crossings: it is 1 where a subpath starts, and is multiplied by the ratio of indices at every
//! refraction. For paths from the camera that is the index relative to the medium of the camera. A path from a light starts
//! with an index of its own, 1 as well; where both meet, the edge between them has one index, which the camera's side
//! knows, and the light's segments are scaled by the ratio. So a lamp inside glass counts the same for every strategy.
//!
//! Light without a place has no start. Its wave front counts as started where it touches the ball around all surfaces, as
//! light paths do.
//!
//! # Composed materials
//!
//! At every vertex one part is drawn with its weight, and the path sees that part alone: its colour, normal map, roughness
//! and delays. The density of a path with its parts is a product in which the weights of the parts, and the densities
//! of delays, stand once for every vertex, whichever strategy generated it; they stand in what the path carries
//! too. They cancel in every estimator and in every weight [Veach 1997, 9.2]: nothing but the choice itself has to be done.

use glam::Vec3;

use super::bsdf::Bsdf;
use super::delay::{self, Profile};
use super::integrator::Context;
use super::ray::{Hit, Ray};
use super::sampler::{Independent, Sampler};
use super::surface::Surface;
use crate::film::time::{TimeAxis, TimeFilter};
use crate::math::real::{Real, Vector};

/// What a film with a time axis asks of transport.
#[derive(Clone, Debug, PartialEq)]
pub struct Timing {
    /// The bins.
    pub axis: TimeAxis,
    /// How contributions are spread over them.
    pub filter: TimeFilter,
    /// Whether the segment between the camera and what it sees first counts.
    pub camera: bool,
    /// Index of the medium around the camera.
    pub medium: f32,
    /// When lights emit: the profile of their pulse.
    pub emission: Profile,
    /// Metres in a scene unit, for times in seconds; 0 where nobody said. It changes nothing but labels.
    pub metres: f64,
}

/// The random numbers of parts and delays of one sample; none where a scene and a film need none.
#[derive(Clone, Debug)]
pub struct Chance(Option<Independent>);

impl Chance {
    /// Those of a sample; for `TIMED` see [`Flight`].
    #[inline]
    pub fn new<const TIMED: bool>(sampler: &Sampler) -> Chance {
        Chance(TIMED.then(|| sampler.aside()))
    }

    /// When the light of this sample was emitted.
    #[inline]
    pub fn emission(&mut self, context: &Context) -> f32 {
        let Chance(Some(chance)) = self else { return 0.0 };
        match context.timing {
            Some(timing) if timing.emission != Profile::NONE => timing.emission.sample(chance.next_1d()),
            _ => 0.0,
        }
    }
}

/// When a path is at a vertex; for any number of paths.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stamp<R = f32> {
    /// Optical length of all segments so far.
    pub path: R,
    /// Delays of all vertices so far but this one.
    pub late: R,
    /// The delay of this vertex.
    pub delay: R,
    /// Index of the medium through which the path came.
    pub index: R,
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> Stamp<R> {
    /// When light arrives that comes to this vertex, or starts there.
    #[inline(always)]
    pub fn arrived(&self) -> R::Double {
        self.path.double() + self.late.double()
    }

    /// When light leaves that this vertex gives back, and goes on over `distance` through a medium whose index has this
    /// [ratio](super::bsdf::index_ratio) to that through which the path came.
    #[inline(always)]
    pub fn onward(&self, ratio: R, distance: R) -> R::Double {
        self.arrived() + self.delay.double() + (self.index * ratio * distance).double()
    }

    /// What of this vertex of a light path counts in a path that leaves it through a medium of this ratio, whose index is
    /// `index` as the camera's side knows it.
    #[inline(always)]
    pub fn of_light(&self, ratio: R, index: R) -> R::Double {
        let own = self.index * ratio;
        (self.path * (index / own)).double() + self.late.double() + self.delay.double()
    }

    /// Counts the edge from `from` to `to`.
    #[inline(always)]
    pub fn travel(&mut self, from: V, to: V) {
        self.path = self.path + self.index * (from - to).length();
    }

    /// Goes on after an event that crossed the index ratio `eta`.
    #[inline(always)]
    pub fn leave(&mut self, eta: R) {
        self.late = self.late + std::mem::replace(&mut self.delay, R::of(0.0));
        self.index = self.index * eta;
    }
}

/// The clock of a path while it is traced, which also draws the parts of composed materials.
///
/// Integrators are compiled twice, with `TIMED` for films with a time axis and scenes with composed or delayed materials,
/// as [`Context::timed`] says, and without: then there is no clock, and it costs nothing.
#[derive(Clone, Copy, Debug)]
pub struct Flight<'a, const TIMED: bool> {
    timing: Option<&'a Timing>,
    stamp: Stamp,
    from: Vec3,
    /// Whether the edge on its way does not count.
    free: bool,
}

impl<'a, const TIMED: bool> Flight<'a, TIMED> {
    /// A path from the camera, whose light was emitted at `emitted`.
    #[inline]
    pub fn of_camera(context: &Context<'a>, ray: &Ray, emitted: f32) -> Flight<'a, TIMED> {
        let timing = context.timing;
        let stamp = Stamp { index: context.medium(), late: emitted, ..Stamp::default() };
        Flight { timing, stamp, from: ray.origin, free: timing.is_some_and(|t| !t.camera) }
    }

    /// A path from a point of a light.
    #[inline]
    pub fn of_light(context: &Context<'a>, from: Vec3) -> Flight<'a, TIMED> {
        let stamp = Stamp { index: 1.0, ..Stamp::default() };
        Flight { timing: context.timing, stamp, from, free: false }
    }

    /// A path that went on from `from`, where its clock said this; `free` is whether the edge on its way does not count.
    #[inline]
    pub fn resumed(context: &Context<'a>, stamp: Stamp, from: Vec3, free: bool) -> Flight<'a, TIMED> {
        Flight { timing: context.timing, stamp, from, free }
    }

    /// The surface that a ray of this path has met, as one part of its material if that is composed.
    #[inline]
    pub fn arrive<'s>(&mut self, context: &Context<'s>, ray: &Ray, hit: &Hit, chance: &mut Chance) -> Surface<'s> {
        match chance {
            Chance(Some(chance)) if TIMED => self.arrive_timed(context, ray, hit, chance),
            _ => Surface::at(context.scene, ray, hit),
        }
    }

    fn arrive_timed<'s>(
        &mut self,
        context: &Context<'s>,
        ray: &Ray,
        hit: &Hit,
        chance: &mut Independent,
    ) -> Surface<'s> {
        let scene = context.scene;
        let row = scene.material_of(hit.primitive, hit.instance);
        let part = match scene.delays.parts(row) {
            [] => None,
            [part] => Some(part),
            parts => {
                let u = chance.next_1d();
                Some(&parts[parts.partition_point(|p| p.upto <= u).min(parts.len() - 1)])
            }
        };
        let surface = Surface::of_material(scene, ray, hit, part.map_or(row, |p| p.material));
        if self.timing.is_some() {
            self.travel(surface.position);
            self.stamp.delay = part.map_or(0.0, |part| {
                delay::sample_all(scene.delays.profiles(part).iter(), &scene.textures, surface.uv, chance)
            });
        }
        surface
    }

    /// The edge on its way ends there.
    #[inline]
    pub fn travel(&mut self, to: Vec3) {
        if !std::mem::take(&mut self.free) {
            self.stamp.travel(self.from, to);
        }
    }

    /// When the path is where it is.
    #[inline]
    pub fn stamp(&self) -> Stamp {
        if TIMED { self.stamp } else { Stamp::default() }
    }

    /// Where the path went on.
    #[inline]
    pub fn from(&self) -> Vec3 {
        self.from
    }

    /// The path goes on from `from` after an event that crossed the index ratio `eta`.
    #[inline]
    pub fn leave(&mut self, from: Vec3, eta: f32) {
        if TIMED && self.timing.is_some() {
            self.stamp.leave(eta);
            self.from = from;
        }
    }

    /// When light comes from outside the scene along the edge that is on its way, whose direction is `dir`.
    #[inline]
    pub fn escaped(&self, context: &Context, dir: Vec3) -> f64 {
        match self.timing.filter(|_| TIMED) {
            Some(_) if !self.free => {
                self.stamp.arrived() + f64::from(self.stamp.index * context.lights.lead(self.from, dir))
            }
            _ => self.stamp().arrived(),
        }
    }
}

/// When light arrives that a vertex gives back from a point of a light at `distance` towards `wi`; an infinite distance is
/// that to the wave front where it touches the ball around all surfaces. Zero without a time axis.
#[inline]
pub fn of_direct(context: &Context, stamp: &Stamp, bsdf: &Bsdf, wo: Vec3, from: Vec3, to: (Vec3, f32)) -> f64 {
    if context.timing.is_none() {
        return 0.0;
    }
    let (wi, distance) = to;
    let distance = if distance.is_finite() { distance } else { context.lights.lead(from, wi) };
    stamp.onward(bsdf.index_ratio(wo, wi), distance)
}
