//! State of camera paths between two steps, in lanes and as records in memory.

use glam::Vec3;

use crate::math::real::{Real, Vector, Word};
use crate::math::simd::Lanes;
use crate::record;
use crate::transport::delay::Profile;
use crate::transport::integrator::Context;
use crate::transport::path_time::OpticalLength;
use crate::transport::sampler::{Sampler, Sequence};

/// Density that stands for an event that light sampling cannot replace: a Dirac lobe, or the camera.
pub const SPECULAR: f32 = -1.0;

record! {
    /// State of a path on an edge.
    pub struct PathState => PathRecord {
        /// Start of the edge's ray in world space.
        origin: Vec3,
        /// Unit direction of the edge.
        dir: Vec3,
        /// Factor on light that the edge hits.
        throughput: Vec3,
        /// Product of the squared index ratios, which undoes the scaling of radiance by refraction
        /// so that roulette judges the expected contribution.
        eta_scale: Real,
        /// Start of the edge for densities of light sampling: the last vertex.
        last: Vec3,
        /// Density per solid angle of the direction at the last vertex; for techniques of camera
        /// paths [`SPECULAR`] after a Dirac event and at the camera.
        last_pdf_w: Real,
        /// Position in the sampler's numbers: see [`Sampler::taken`].
        taken: Word,
    }
}

record! {
    /// Key and index of a path's sampler: see [`Sampler::key`] and [`Sampler::index`].
    pub struct SamplerState => SamplerRecord {
        /// First word of the key.
        a: Word,
        /// Second word of the key.
        b: Word,
        /// Third word of the key.
        c: Word,
        /// Fourth word of the key.
        d: Word,
        /// Index of the sample in its sequence.
        index: Word,
    }
}

record! {
    /// Optical length of a path up to the start of its edge, and its auxiliary numbers. Used only
    /// where [`Context::timed`] is.
    pub struct TimeState => TimeRecord {
        /// Start of the edge.
        from: Vec3,
        /// Optical length of all segments so far.
        path: Real,
        /// Sum of the delays so far, that of the emission included.
        delays: Real,
        /// Index of the medium of the edge.
        index: Real,
        /// Position in the auxiliary numbers.
        auxiliary_taken: Word,
    }
}

record! {
    /// Offset against the shadow terminator with which the edge left its surface.
    pub struct TerminatorState => TerminatorRecord {
        /// The point of the triangle.
        base: Vec3,
        /// Unit normal of the triangle on the side of the lifted point; zero without an offset.
        up: Vec3,
    }
}

/// A path in each lane.
#[derive(Clone, Copy)]
pub struct Path<R: Real> {
    /// State on the current edge.
    pub state: PathState<R>,
    /// The numbers of the path's sample.
    pub sampler: Sampler<R>,
    /// Optical length; `None` where it is not tracked: see [`Context::timed`].
    pub time: Option<TimeState<R>>,
    /// Offset with which the edge left; `None` in scenes without such offsets.
    pub terminator: Option<TerminatorState<R>>,
}

impl<R: Real> SamplerState<R> {
    /// Returns key and index of a sampler.
    #[inline(always)]
    pub fn of(sampler: &Sampler<R>) -> SamplerState<R> {
        let [a, b, c, d] = sampler.key();
        let index = sampler.index();
        SamplerState { a, b, c, d, index }
    }

    /// Returns the sampler at a position in its numbers.
    #[inline(always)]
    pub fn sampler(self, sequence: Sequence, taken: R::Word) -> Sampler<R> {
        let SamplerState { a, b, c, d, index } = self;
        Sampler::resume(sequence, [a, b, c, d], index, taken)
    }
}

impl<R: Real> TimeState<R> {
    /// Returns the optical length up to the start of the edge.
    #[inline(always)]
    pub fn optical(&self) -> OpticalLength<R> {
        OpticalLength {
            path: self.path,
            delays: self.delays,
            delay: R::splat(0.0),
            index: self.index,
        }
    }
}

impl<R: Real> TerminatorState<R> {
    /// Returns the state of an edge without offset.
    #[inline(always)]
    pub fn none() -> TerminatorState<R> {
        let zero = R::Vec3::broadcast(Vec3::ZERO);
        TerminatorState {
            base: zero,
            up: zero,
        }
    }

    /// Returns the lanes whose edge may end at `point`: those without an offset, and those whose
    /// point lies below the triangle's plane.
    #[inline(always)]
    pub fn allows(&self, point: R::Vec3) -> R::Mask {
        // Without an offset the product is zero.
        (point - self.base).dot(self.up).le(R::splat(0.0))
    }
}

impl<R: Real> Path<R> {
    /// Starts paths with camera rays through pixels, given by column and row.
    #[inline(always)]
    pub fn from_camera<const N: usize>(
        context: &Context,
        pixel: [R; 2],
        mut sampler: Sampler<R>,
    ) -> Path<R>
    where
        R: Lanes<N>,
    {
        let filter_u = sampler.next_2d();
        let lens_u = if context.camera.has_lens() {
            sampler.next_2d()
        } else {
            [R::splat(0.0); 2]
        };
        let [origin, dir]: [R::Vec3; 2] = context.camera.ray(pixel, filter_u, lens_u);
        let mut path = Path {
            state: PathState {
                origin,
                dir,
                throughput: R::Vec3::splat(R::splat(1.0)),
                eta_scale: R::splat(1.0),
                last: origin,
                last_pdf_w: R::splat(SPECULAR),
                taken: sampler.taken(),
            },
            sampler,
            time: None,
            terminator: None,
        };
        if context.timed() {
            path.time = Some(path.emission_time(context));
        }
        path
    }

    /// Returns the optical length at the camera, with the time at which the light was emitted.
    #[inline(always)]
    fn emission_time(&self, context: &Context) -> TimeState<R> {
        let zero = R::splat(0.0);
        let mut time = TimeState {
            from: self.state.origin,
            path: zero,
            delays: zero,
            index: R::splat(context.medium()),
            auxiliary_taken: R::Word::splat(0),
        };
        if let Some(timing) = context.timing
            && timing.emission != Profile::NONE
        {
            let mut numbers = self.auxiliary(&time);
            let u = numbers.next_1d();
            time.delays = u.map_lanes(|u| timing.emission.sample(u));
            time.auxiliary_taken = numbers.taken();
        }
        time
    }

    /// Returns paths with the numbers of samplers that are nowhere yet:
    /// [`Subpath::from_light`](crate::transport::integrator::bdpt::state::Subpath::from_light) places
    /// them at lights.
    #[inline(always)]
    pub fn unplaced(context: &Context, sampler: Sampler<R>) -> Path<R> {
        let zero = R::Vec3::broadcast(Vec3::ZERO);
        Path {
            state: PathState {
                origin: zero,
                dir: zero,
                throughput: R::Vec3::broadcast(Vec3::ONE),
                eta_scale: R::splat(1.0),
                last: zero,
                last_pdf_w: R::splat(SPECULAR),
                taken: sampler.taken(),
            },
            sampler,
            time: context.timed().then_some(TimeState {
                from: zero,
                path: R::splat(0.0),
                delays: R::splat(0.0),
                index: R::splat(1.0),
                auxiliary_taken: R::Word::splat(0),
            }),
            terminator: context
                .classes
                .have_terminators()
                .then(TerminatorState::none),
        }
    }

    /// Returns the auxiliary numbers of the paths, for components of materials and delays.
    #[inline(always)]
    pub fn auxiliary(&self, time: &TimeState<R>) -> Sampler<R> {
        self.sampler.auxiliary_after(time.auxiliary_taken)
    }

    /// Returns the lanes whose last event was a Dirac lobe or the camera.
    #[inline(always)]
    pub fn is_specular(&self) -> R::Mask {
        self.state.last_pdf_w.eq(R::splat(SPECULAR))
    }
}

impl Path<f32> {
    /// Returns the next auxiliary number; 0 where optical lengths are not tracked.
    #[inline]
    pub fn next_auxiliary(&mut self) -> f32 {
        let Some(mut time) = self.time else {
            return 0.0;
        };
        let mut numbers = self.auxiliary(&time);
        let number = numbers.next_1d();
        time.auxiliary_taken = numbers.taken();
        self.time = Some(time);
        number
    }
}
