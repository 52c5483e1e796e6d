//! Parts of steps that techniques share: optical lengths, light that edges hit, and the next edge.

use glam::Vec3;

use super::state::{Path, SPECULAR, TerminatorState};
use super::{Arrival, PathLight, PathSink};
use crate::math::real::{Double, Mask, Real, Vector};
use crate::math::simd::{Lanes, active_lanes};
use crate::transport::MAX_SURVIVAL;
use crate::transport::bsdf::BsdfSample;
use crate::transport::delay;
use crate::transport::integrator::Context;
use crate::transport::path_time::OpticalLength;
use crate::transport::ray::Ray;
use crate::transport::sampler::Sampler;
use crate::transport::surface::Surface;

/// Returns whether edge number `edge` of a camera path is part of its optical length. Edge 1 starts
/// at the camera, and counts only if the timing settings include it.
#[inline(always)]
pub fn edge_counts(context: &Context, edge: u32) -> bool {
    edge > 1 || context.timing.is_some_and(|timing| timing.camera)
}

impl<R: Real> Path<R> {
    /// Returns the optical lengths of paths that arrive at surfaces, with the delays of the surfaces
    /// in the given lanes; `None` without a time axis. `counts` is whether the edge is part of the
    /// optical length.
    #[inline(always)]
    pub fn arrive<const N: usize>(
        &mut self,
        context: &Context,
        counts: bool,
        arrival: &Arrival<R, N>,
        surface: &Surface<R, N>,
        lanes: R::Mask,
    ) -> Option<OpticalLength<R>>
    where
        R: Lanes<N>,
    {
        let mut time = self.time.filter(|_| context.timing.is_some())?;
        let mut optical = time.optical();
        if counts {
            optical.add_segment(time.from, surface.position);
        }
        if !context.scene.delays.is_empty() {
            let [a, b, c, d] = self.auxiliary(&time).key();
            let keys = [
                R::store_words(a),
                R::store_words(b),
                R::store_words(c),
                R::store_words(d),
            ];
            let taken = &mut time.auxiliary_taken;
            optical.delay = sample_delays::<R, N>(context, arrival, surface, lanes, keys, taken);
            self.time = Some(time);
        }
        Some(optical)
    }

    /// Returns the optical lengths of paths that left the scene by edge number `edge`; zero without
    /// a time axis.
    #[inline(always)]
    pub fn escape_length(&self, context: &Context, edge: u32) -> R::Double {
        let Some(time) = self.time.filter(|_| context.timing.is_some()) else {
            return R::Double::splat(0.0);
        };
        let arrival = time.optical().arrival();
        if edge_counts(context, edge) {
            let front = context.lights.front_distance(time.from, self.state.dir);
            arrival + (time.index * front).double()
        } else {
            arrival
        }
    }

    /// Adds light that the paths hit by chance at the end of edge number `edge`.
    #[inline(always)]
    pub fn add_hit_light(
        &self,
        edge: u32,
        radiance: R::Vec3,
        weight: R,
        length: R::Double,
        lanes: R::Mask,
        sink: &mut impl PathSink<R>,
    ) {
        let light = PathLight {
            unweighted: self.state.throughput * radiance,
            weight,
            s: 0,
            t: edge + 1,
            length,
        };
        sink.add(lanes, &light);
    }

    /// Continues paths from surfaces, at the end of edge number `edge`, in sampled directions.
    /// Returns the lanes of `lanes` that neither Russian roulette nor a zero weight ends.
    #[inline(always)]
    pub fn continue_from<const N: usize>(
        &mut self,
        context: &Context,
        edge: u32,
        surface: &Surface<R, N>,
        optical: Option<OpticalLength<R>>,
        s: &BsdfSample<R>,
        mut lanes: R::Mask,
    ) -> R::Mask
    where
        R: Lanes<N>,
    {
        let state = &mut self.state;
        state.throughput = state.throughput * s.weight;
        state.eta_scale = state.eta_scale * (s.eta * s.eta);
        if context.rr_start.is_some_and(|start| edge >= start) {
            let t = state.throughput;
            let survival =
                (t.x().max(t.y()).max(t.z()) * state.eta_scale).min(R::splat(MAX_SURVIVAL));
            lanes = lanes & self.sampler.next_1d().lt(survival);
            state.throughput = t / survival;
        }
        lanes = lanes & !state.throughput.same(R::Vec3::broadcast(Vec3::ZERO));
        state.last_pdf_w = R::select(s.delta, R::splat(SPECULAR), s.pdf_w);
        self.leave(surface, optical, s.wi, s.eta);
        lanes
    }

    /// Puts paths on the edges that leave surfaces in the unit directions `wi` and cross the index
    /// ratios `eta`.
    #[inline(always)]
    pub fn leave<const N: usize>(
        &mut self,
        surface: &Surface<R, N>,
        optical: Option<OpticalLength<R>>,
        wi: R::Vec3,
        eta: R,
    ) where
        R: Lanes<N>,
    {
        let Ray { origin, dir } = surface.spawn(wi);
        let state = &mut self.state;
        (state.origin, state.dir) = (origin, dir);
        state.last = surface.position;
        if self.terminator.is_some() {
            self.leave_by_terminator(surface);
        }
        if let (Some(mut optical), Some(time)) = (optical, &mut self.time) {
            optical.scatter(eta);
            time.path = optical.path;
            time.delays = optical.delays;
            time.index = optical.index;
            time.from = surface.position;
        }
    }

    /// Records the terminator offsets with which edges leave surfaces.
    #[inline(always)]
    fn leave_by_terminator<const N: usize>(&mut self, surface: &Surface<R, N>)
    where
        R: Lanes<N>,
    {
        let mut left = TerminatorState::none();
        if let Some(offset) = surface.terminator_into(self.state.dir) {
            let applies = offset.exists;
            self.state.last = R::Vec3::select(applies, offset.lifted_point, self.state.last);
            left.base = R::Vec3::select(applies, offset.base, left.base);
            left.up = R::Vec3::select(applies, offset.up, left.up);
        }
        self.terminator = Some(left);
    }
}

/// Samples the delays of the surfaces that paths hit, in the given lanes. `keys` are those of the
/// auxiliary numbers, of which `taken` were taken before.
#[inline(always)]
fn sample_delays<R: Lanes<N>, const N: usize>(
    context: &Context,
    arrival: &Arrival<R, N>,
    surface: &Surface<R, N>,
    lanes: R::Mask,
    keys: [[u32; N]; 4],
    taken: &mut R::Word,
) -> R {
    let delays = &context.scene.delays;
    let mut counts = R::store_words(*taken);
    let uv = surface.uv.lanes();
    let mut sampled = [0.0; N];
    for i in active_lanes(lanes.bits()) {
        if let Some(component) = delays.components.get(arrival.components[i] as usize) {
            let mut numbers = Sampler::independent(keys.map(|words| words[i]), counts[i]);
            let profiles = delays.profiles(component).iter();
            let textures = &context.scene.textures;
            sampled[i] = delay::sample_all(profiles, textures, uv[i], &mut numbers);
            counts[i] = numbers.taken();
        }
    }
    *taken = R::load_words(&counts);
    R::load(&sampled)
}
