//! Optical lengths of paths, and the choice of parts of composed materials.
//!
//! The time of a path is its optical length: the length of every segment times the index of its
//! medium, plus the delays of the materials. Segments and delays are summed separately.
//!
//! The index follows from the crossings: it is 1 at the start of a subpath and is multiplied by the
//! ratio of indices at every refraction. For camera paths it is the index relative to the medium of
//! the camera. A light path starts with its own index of 1; where both subpaths are connected, the
//! connecting edge has the index of the camera's side, and the segments of the light's side
//! are scaled by the ratio. A light inside glass therefore gives the same length for every
//! strategy.
//!
//! Infinitely distant light has no start. Its wave front starts where it touches the bounding
//! sphere of all surfaces, as light paths do.
//!
//! # Composed materials
//!
//! At every vertex one part is drawn with its weight, and the path uses that part alone: its
//! colour, normal map, roughness and delays. The density of a path with its parts is a product in
//! which the weights of the parts, and the densities of delays, occur once for every vertex,
//! whichever strategy generated it; they also occur in the path's contribution. They cancel in
//! every estimator and in every weight [Veach 1997, 9.2]: only the choice itself has to be made.

use glam::Vec3;

use super::bsdf::Bsdf;
use super::delay;
use super::delay::Profile;
use super::integrator::Context;
use super::ray::{Hit, Ray};
use super::sampler::Sampler;
use super::surface::Surface;
use crate::film::time::{TimeAxis, TimeFilter};
use crate::math::real::{Real, Vector};

/// Settings of a film's time axis that affect light transport.
#[derive(Clone, Debug, PartialEq)]
pub struct Timing {
    /// The time bins.
    pub axis: TimeAxis,
    /// Filter that spreads contributions over the bins.
    pub filter: TimeFilter,
    /// Whether the segment between the camera and the first surface counts.
    pub camera: bool,
    /// Index of refraction of the medium around the camera.
    pub medium: f32,
    /// Time of emission: the profile of the lights' pulse.
    pub emission: Profile,
    /// Metres per scene unit, for times in seconds; 0 if unspecified. Affects labels only.
    pub metres: f64,
}

/// The auxiliary random numbers of one sample, for parts and delays; absent if the scene and the
/// film need none.
#[derive(Clone, Debug)]
pub struct AuxRng(Option<Sampler>);

impl AuxRng {
    /// Starts the numbers of a sample; for `TIMED` see [`PathTime`].
    #[inline]
    pub fn new<const TIMED: bool>(sampler: &Sampler) -> AuxRng {
        AuxRng(TIMED.then(|| sampler.auxiliary()))
    }

    /// Samples the time at which the light of this sample was emitted.
    #[inline]
    pub fn emission(&mut self, context: &Context) -> f32 {
        let AuxRng(Some(numbers)) = self else {
            return 0.0;
        };
        match context.timing {
            Some(timing) if timing.emission != Profile::NONE => {
                timing.emission.sample(numbers.next_1d())
            }
            _ => 0.0,
        }
    }
}

/// The optical length of a path up to a vertex; scalar or vectorised.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OpticalLength<R = f32> {
    /// Optical length of all segments so far.
    pub path: R,
    /// Sum of the delays of all previous vertices.
    pub delays: R,
    /// Delay of this vertex.
    pub delay: R,
    /// Index of the medium of the last segment.
    pub index: R,
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> OpticalLength<R> {
    /// Returns the length at which light arrives at this vertex, or starts there.
    #[inline(always)]
    pub fn arrival(&self) -> R::Double {
        self.path.double() + self.delays.double()
    }

    /// Returns the length after this vertex's delay and a segment of `distance` in a medium whose
    /// index has this [ratio](super::bsdf::index_ratio) to that of the last segment.
    #[inline(always)]
    pub fn after_segment(&self, ratio: R, distance: R) -> R::Double {
        self.arrival() + self.delay.double() + (self.index * ratio * distance).double()
    }

    /// Returns the length of a light subpath up to this vertex, delay included, for a path that
    /// leaves it through a medium whose index has this ratio to that of the last segment and is
    /// `index` relative to the camera.
    #[inline(always)]
    pub fn from_light(&self, ratio: R, index: R) -> R::Double {
        let own = self.index * ratio;
        (self.path * (index / own)).double() + self.delays.double() + self.delay.double()
    }

    /// Adds the segment from `from` to `to`.
    #[inline(always)]
    pub fn add_segment(&mut self, from: V, to: V) {
        self.path = self.path + self.index * (from - to).length();
    }

    /// Adds the vertex's delay and crosses the index ratio `eta`.
    #[inline(always)]
    pub fn scatter(&mut self, eta: R) {
        self.delays = self.delays + std::mem::replace(&mut self.delay, R::splat(0.0));
        self.index = self.index * eta;
    }
}

/// Tracks the optical length of a path while it is traced, and draws the parts of composed
/// materials.
///
/// Integrators are compiled twice: with `TIMED` for films with a time axis and for scenes with
/// composed or delayed materials (see [`Context::timed`]), and without, where tracking is compiled
/// out.
#[derive(Clone, Copy, Debug)]
pub struct PathTime<'a, const TIMED: bool> {
    timing: Option<&'a Timing>,
    optical: OpticalLength,
    from: Vec3,
    /// Whether the current segment does not count.
    uncounted: bool,
}

impl<'a, const TIMED: bool> PathTime<'a, TIMED> {
    /// Starts a camera path whose light was emitted at `emitted`.
    #[inline]
    pub fn from_camera(context: &Context<'a>, ray: &Ray, emitted: f32) -> PathTime<'a, TIMED> {
        let timing = context.timing;
        let optical = OpticalLength {
            index: context.medium(),
            delays: emitted,
            ..OpticalLength::default()
        };
        PathTime {
            timing,
            optical,
            from: ray.origin,
            uncounted: timing.is_some_and(|t| !t.camera),
        }
    }

    /// Starts a light path at a point of a light.
    #[inline]
    pub fn from_light(context: &Context<'a>, from: Vec3) -> PathTime<'a, TIMED> {
        let optical = OpticalLength {
            index: 1.0,
            ..OpticalLength::default()
        };
        PathTime {
            timing: context.timing,
            optical,
            from,
            uncounted: false,
        }
    }

    /// Resumes a path that left `from` with this optical length; `uncounted` is whether its current
    /// segment does not count.
    #[inline]
    pub fn resume(
        context: &Context<'a>,
        optical: OpticalLength,
        from: Vec3,
        uncounted: bool,
    ) -> PathTime<'a, TIMED> {
        PathTime {
            timing: context.timing,
            optical,
            from,
            uncounted,
        }
    }

    /// Returns the surface that a ray of this path hit; for a composed material, one part of it.
    #[inline]
    pub fn arrive<'s>(
        &mut self,
        context: &Context<'s>,
        ray: &Ray,
        hit: &Hit,
        aux_rng: &mut AuxRng,
    ) -> Surface<'s> {
        match aux_rng {
            AuxRng(Some(aux_rng)) if TIMED => self.arrive_timed(context, ray, hit, aux_rng),
            _ => Surface::at(context.scene, ray, hit),
        }
    }

    fn arrive_timed<'s>(
        &mut self,
        context: &Context<'s>,
        ray: &Ray,
        hit: &Hit,
        aux_rng: &mut Sampler,
    ) -> Surface<'s> {
        let scene = context.scene;
        let row = scene.material_of(hit.primitive, hit.instance);
        let part = match scene.delays.components(row) {
            [] => None,
            [part] => Some(part),
            parts => {
                let u = aux_rng.next_1d();
                Some(
                    &parts[parts
                        .partition_point(|p| p.cumulative_weight <= u)
                        .min(parts.len() - 1)],
                )
            }
        };
        let surface = Surface::with_material(scene, ray, hit, part.map_or(row, |p| p.material));
        if self.timing.is_some() {
            self.add_segment(surface.position);
            self.optical.delay = part.map_or(0.0, |part| {
                delay::sample_all(
                    scene.delays.profiles(part).iter(),
                    &scene.textures,
                    surface.uv,
                    aux_rng,
                )
            });
        }
        surface
    }

    /// Adds the current segment, which ends at `to`.
    #[inline]
    pub fn add_segment(&mut self, to: Vec3) {
        if !std::mem::take(&mut self.uncounted) {
            self.optical.add_segment(self.from, to);
        }
    }

    /// Returns the optical length up to the current vertex.
    #[inline]
    pub fn optical(&self) -> OpticalLength {
        if TIMED {
            self.optical
        } else {
            OpticalLength::default()
        }
    }

    /// Returns the start of the current segment.
    #[inline]
    pub fn from(&self) -> Vec3 {
        self.from
    }

    /// Continues the path from `from` after an event that crossed the index ratio `eta`.
    #[inline]
    pub fn scatter(&mut self, from: Vec3, eta: f32) {
        if TIMED && self.timing.is_some() {
            self.optical.scatter(eta);
            self.from = from;
        }
    }

    /// Returns the length of a path that left the scene in direction `dir`.
    #[inline]
    pub fn escape_length(&self, context: &Context, dir: Vec3) -> f64 {
        match self.timing.filter(|_| TIMED) {
            Some(_) if !self.uncounted => {
                self.optical.arrival()
                    + f64::from(self.optical.index * context.lights.front_distance(self.from, dir))
            }
            _ => self.optical().arrival(),
        }
    }
}

/// Returns the length of a path whose vertex is lit by light sampling from direction `wi` at
/// `distance`; an infinite distance stands for the wave front where it touches the bounding sphere
/// of all surfaces. Zero without a time axis.
#[inline]
pub fn direct_length(
    context: &Context,
    optical: &OpticalLength,
    bsdf: &Bsdf,
    wo: Vec3,
    from: Vec3,
    to: (Vec3, f32),
) -> f64 {
    if context.timing.is_none() {
        return 0.0;
    }
    let (wi, distance) = to;
    let distance = if distance.is_finite() {
        distance
    } else {
        context.lights.front_distance(from, wi)
    };
    optical.after_segment(bsdf.index_ratio(wo, wi), distance)
}
