//! MIS weights of strategies in constant time per connection.
//!
//! A path `x_0 .. x_k` from light to camera is found by the strategy of `s` light vertices with the
//! density `p_s = product of l_i for i < s, times product of e_i for i >= s`: `l_i` is the density
//! per area with which light subpaths generate `x_i`, `e_i` that of camera subpaths. So `p_(i) /
//! p_(i+1) = e_i / l_i`, and the terms of all strategies with fewer light vertices than `s`, over
//! that of `s`, are a polynomial in Horner's form along the light subpath. Only its last two
//! factors depend on the connection; the rest is known when a vertex is generated and stored as
//! [`MisPartials`]: the quantities `d_vcm` and `d_vc` of [Georgiev 2012]. The camera's side is the
//! same with `l` and `e` exchanged.
//!
//! - A strategy can connect only two vertices with a density. A path whose event at a vertex was a
//!   Dirac event has no strategy that connects there.
//! - The density of the outcome of a Dirac event is `|cos| eta^2` of the outgoing side, relative to
//!   the incoming one: both directions are then measured by the extent of the same beam, which
//!   refraction preserves. The probability of choosing the event, such as the reflectance, is left
//!   out: it is the same forwards and backwards for the existing BSDFs, and weights sum to one with
//!   any function of the path here.
//! - Light sampling from a surface (`s = 1`) may have another density than the start of light
//!   paths; where the first two strategies meet, their ratio is part of [`MisPartials::d_vcm`]. For
//!   a light seen directly, the only strategy that does not hit it (`s = 1`, `t = 1`) uses the
//!   start of a light path.
//! - An infinitely distant light has its direction as `x_0`, per solid angle, and its paths pass
//!   through a disk perpendicular to that direction: `x_1` then has the disk's density times the
//!   cosine there. A point light and a directional light have a probability in place of a density,
//!   and no camera path generates them.
//! - The camera's end is handled in the same way: `t = 1` connects the lens point, which every
//!   strategy uses and whose density cancels.
//! - Densities may be any functions of the path as long as all strategies use the same,
//!   [`Camera::pdf_w`] for example.
//!
//! [`Camera::pdf_w`]: crate::transport::camera::Camera::pdf_w

use glam::Vec3;

use crate::math::real::{Double, Mask, Real, Vector};
use crate::math::simd::Lanes;
use crate::transport::bsdf::{BsdfValue, TransportMode};
use crate::transport::integrator::Context;
use crate::transport::light::{EmissionPdf, SelectedLights};
use crate::transport::mis::Heuristic;
use crate::transport::vertex;

/// Expected numbers of samples that each kind of strategy takes for a pixel, relative to that of
/// camera paths. Light that camera paths hit has the number one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrategyCounts {
    /// Number of connections of two vertices on surfaces: `s >= 2`, `t >= 2`; 0 without any.
    pub connecting: f64,
    /// Number of lights sampled from a camera vertex: `s = 1`, `t >= 2`; 0 without any.
    pub direct: f64,
    /// Number of light subpaths connected to the lens: `t = 1`; 0 without any.
    pub lens: f64,
    /// Expected number of light vertices that a camera vertex merges with, for each unit of the
    /// density per area of light subpaths: `n pi r^2` [Georgiev 2012, equation 20]; 0 without
    /// merging.
    pub merging: f64,
}

impl StrategyCounts {
    /// The counts of `bdpt`: one of each, and no merging.
    pub const ONE_EACH: StrategyCounts = StrategyCounts {
        connecting: 1.0,
        direct: 1.0,
        lens: 1.0,
        merging: 0.0,
    };

    /// Returns the count of the strategy of `s` light vertices and `t` camera vertices that are
    /// connected.
    pub fn of(&self, s: u32, t: u32) -> f64 {
        match (s, t) {
            (0, _) => 1.0,
            (_, 1) => self.lens,
            (1, _) => self.direct,
            _ => self.connecting,
        }
    }

    /// Returns the term that replaces the number of connections by that of sampled lights.
    #[inline(always)]
    fn direct_over_connecting<D: Double>(&self, h: Heuristic) -> D {
        let ratio = if self.connecting > 0.0 {
            self.direct / self.connecting
        } else {
            0.0
        };
        h.term(D::splat(ratio))
    }
}

/// Partial sums of the MIS terms of all strategies that split the path nearer to this side's end,
/// relative to the term of the density with which this side generated this vertex: `dVCM` and `dVC`
/// of [Georgiev 2012] with densities per area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MisPartials<D = f64> {
    /// Term of the strategy that connects the previous vertex with this one, over the term of
    /// generating this one; without the other side's density of this vertex. Zero if it cannot
    /// connect there.
    pub d_vcm: D,
    /// Sum of the terms of all strategies that split earlier; without the other side's densities of
    /// this vertex and of the previous one.
    pub d_vc: D,
}

/// The MIS partials of an edge whose end vertex is not known yet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgePartials<D = f64> {
    /// Numerator of [`MisPartials::d_vcm`].
    pub d_vcm: D,
    /// Numerator of [`MisPartials::d_vc`].
    pub d_vc: D,
}

/// The quantities of a connected vertex that weights depend on; scalar or vectorised.
#[derive(Clone, Copy, Debug)]
pub struct MisEndpoint<R: Real = f32> {
    /// Partial sums for strategies that split nearer to that side's end.
    pub partials: MisPartials<R::Double>,
    /// Factor from a density per solid angle here to the other side's density of the previous
    /// vertex; zero if the other side cannot generate it.
    pub back: R,
}

/// Edges of subpaths whose end vertices are not known yet.
#[derive(Clone, Copy, Debug)]
pub struct MisEdge<R: Real = f32> {
    /// Position and unit normal of the vertex that the edge leaves. The normal is zero for a lens
    /// point and for a lifted point, at which no path can arrive.
    pub from: [R::Vec3; 2],
    /// Density of the direction per solid angle.
    pub pdf_w: R,
    /// Partial sums of MIS terms.
    pub partials: EdgePartials<R::Double>,
    /// Whether the edges are [parallel](crate::transport::camera::Camera::is_parallel) rays of the
    /// camera. `pdf_w` is then per area perpendicular to them.
    pub parallel: bool,
}

impl<R: Real> MisEdge<R> {
    /// Returns edges in unit directions `dir` that leave points of the lens.
    ///
    /// Every strategy with two or more camera vertices generates them with the density of camera
    /// rays, and the one with a single camera vertex does without it, unless the film's pixels are
    /// points: then no other strategy can find the path, and the density, the same for all
    /// strategies that can, does not matter.
    #[inline(always)]
    pub fn from_lens(
        context: &Context,
        counts: &StrategyCounts,
        lens: R::Vec3,
        dir: R::Vec3,
    ) -> MisEdge<R> {
        let pdf_w: R = context.camera.pdf_w(dir);
        let some = pdf_w.gt(R::splat(0.0));
        let zero = R::Double::splat(0.0);
        let count = context
            .settings
            .heuristic()
            .term(R::Double::splat(counts.lens));
        MisEdge {
            from: [lens, R::Vec3::broadcast(Vec3::ZERO)],
            pdf_w: R::select(some, pdf_w, R::splat(1.0)),
            partials: EdgePartials {
                d_vcm: R::Double::select(some, count, zero),
                d_vc: zero,
            },
            parallel: context.camera.is_parallel(),
        }
    }

    /// Returns the MIS quantities of the vertices at which the edges end, given by position and
    /// unit normal. The mask is unset where rounding leaves a point without a density.
    #[inline(always)]
    pub fn endpoint(&self, h: Heuristic, to: [R::Vec3; 2]) -> (R::Mask, MisEndpoint<R>) {
        let [mut spread, back] = vertex::area_factors(self.from, to);
        if self.parallel {
            spread = spread * (to[0] - self.from[0]).length_squared();
        }
        let (some, partials) = self.partials_at(h, spread);
        (some, MisEndpoint { partials, back })
    }

    /// Returns the MIS partials of infinitely distant ends. Of parallel rays they are zero: light
    /// paths have no density in their one direction, so no other strategy finds these ends.
    #[inline(always)]
    pub fn distant_partials(&self, h: Heuristic) -> (R::Mask, MisPartials<R::Double>) {
        if self.parallel {
            let zero = R::Double::splat(0.0);
            let none = MisPartials {
                d_vcm: zero,
                d_vc: zero,
            };
            return (R::Mask::splat(true), none);
        }
        self.partials_at(h, R::splat(1.0))
    }

    /// Returns the MIS partials at the ends of the edges; `spread` converts their density to that
    /// of the end points.
    #[inline(always)]
    fn partials_at(&self, h: Heuristic, spread: R) -> (R::Mask, MisPartials<R::Double>) {
        MisPartials::new(h, self.partials, self.pdf_w.double() * spread.double())
    }
}

impl<D: Double> MisPartials<D> {
    /// Divides the partials of an edge by the term of the density per area of its end vertex; the
    /// mask is unset where rounding leaves no density.
    #[inline(always)]
    pub fn new(
        h: Heuristic,
        partials: EdgePartials<D>,
        density: D,
    ) -> (<D::Real as Real>::Mask, MisPartials<D>) {
        let some = density.gt(D::splat(0.0)) & D::splat(f64::INFINITY).gt(density);
        let scale = D::splat(1.0) / h.term(density);
        (
            some,
            MisPartials {
                d_vcm: partials.d_vcm * scale,
                d_vc: partials.d_vc * scale,
            },
        )
    }

    /// Returns the sum of the terms of all strategies with fewer vertices on this side, over the
    /// term of the one that connects here. The other side generates this vertex with density `here`
    /// and the previous one with density `before`.
    #[inline(always)]
    pub fn others(&self, h: Heuristic, here: D, before: D) -> D {
        self.others_at_end(h, here, here, before)
    }

    /// Returns the same sum where this vertex is the other side's end, whose density depends on the
    /// strategy: `last` for the strategy that ends there, `here` for those that continue.
    #[inline(always)]
    pub fn others_at_end(&self, h: Heuristic, last: D, here: D, before: D) -> D {
        self.d_vcm * h.term(last) + self.d_vc * h.term(here) * h.term(before)
    }

    /// Returns the partials for a connection of this vertex, where paths can be merged as well.
    #[inline(always)]
    pub fn with_merging(&self, h: Heuristic, counts: &StrategyCounts) -> MisPartials<D> {
        MisPartials {
            d_vcm: self.d_vcm + h.term(D::splat(counts.merging)),
            d_vc: self.d_vc,
        }
    }

    /// Returns the partials of the next edge, after an event at this vertex that was a Dirac event
    /// where `delta`; `before` is the other side's density of the previous vertex.
    ///
    /// These are equations 34 to 36 of [Georgiev 2012]. His third sum dVM is `d_vc` over the term of
    /// [`StrategyCounts::merging`], at every vertex.
    #[inline(always)]
    pub fn next_edge(
        &self,
        h: Heuristic,
        counts: &StrategyCounts,
        delta: <D::Real as Real>::Mask,
        before: D,
    ) -> EdgePartials<D> {
        let zero = D::splat(0.0);
        let here = self.with_merging(h, counts).d_vcm;
        let d_vcm = D::select(delta, zero, here);
        EdgePartials {
            d_vcm: D::select(delta, zero, h.term(D::splat(counts.connecting))),
            d_vc: d_vcm + self.d_vc * h.term(before),
        }
    }
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> MisEndpoint<R> {
    /// Returns the other side's density of the previous vertex, where its BSDF samples that
    /// direction with density `reverse_pdf_w`.
    #[inline(always)]
    pub fn density_before(&self, reverse_pdf_w: R) -> R::Double {
        let some = self.back.gt(R::splat(0.0));
        R::Double::select(
            some,
            reverse_pdf_w.double() * self.back.double(),
            R::Double::splat(0.0),
        )
    }

    /// Returns the sum of the terms of other strategies that split on this side, where the other
    /// side generates this vertex with density `here`.
    #[inline(always)]
    fn others(&self, h: Heuristic, here: R::Double, at: &BsdfValue<V>) -> R::Double {
        self.partials
            .others(h, here, self.density_before(at.reverse_pdf_w))
    }

    /// Returns the sum of the terms of other strategies that split on this side, where the vertex is
    /// merged and the other side's density of the direction to the previous one is `pdf_w`.
    #[inline(always)]
    fn others_merged(&self, h: Heuristic, pdf_w: R) -> R::Double {
        self.partials.d_vcm + self.partials.d_vc * h.term(self.density_before(pdf_w))
    }

    /// Returns the density and the partials of the edge from `wo` into `wi` at points with the
    /// geometric normal `n`. The direction was sampled with density `pdf_w`, and `reverse_pdf_w`
    /// for the way back; or, where `delta`, by a Dirac event that crossed the index ratio `eta`,
    /// whose density is `|cos| eta^2` of the outgoing side relative to the incoming one.
    #[inline(always)]
    pub fn next_edge(
        &self,
        (h, counts): (Heuristic, &StrategyCounts),
        mode: TransportMode,
        [wo, wi, n]: [V; 3],
        [pdf_w, reverse_pdf_w]: [R; 2],
        (delta, eta): (R::Mask, R),
    ) -> (R, EdgePartials<R::Double>) {
        let (mut density, mut before) = (pdf_w, self.density_before(reverse_pdf_w));
        if delta.any() {
            let (out, back) = (wi.dot(n).abs(), wo.dot(n).abs());
            let (out, back) = match mode {
                TransportMode::Radiance => (out, back / (eta * eta)),
                TransportMode::Importance => (out * eta * eta, back),
            };
            density = R::select(delta, out, density);
            before = R::Double::select(delta, back.double() * self.back.double(), before);
        }
        (density, self.partials.next_edge(h, counts, delta, before))
    }
}

/// The densities at the light's end of a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightEnd<R: Real = f32> {
    /// Density of `x_0` as the start of a light path: per area; for the environment per solid
    /// angle; for a point light or a directional light the probability of choosing it.
    pub start: R::Double,
    /// Density of `x_0` if light is sampled from `x_1`, in the same measure.
    pub direct: R::Double,
    /// Density per area with which a light path continues to `x_1`.
    pub next: R::Double,
    /// Factor from a density per solid angle at `x_1` to one of `x_0`, in the measure of `start`.
    pub back: R,
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> LightEnd<R> {
    /// Computes the densities for points of emissive surfaces and the next vertices, each with its
    /// normal, from the density of the start per area, of the direction to the next vertex, and of
    /// the direction from there to the light as sampled by light sampling.
    #[inline(always)]
    pub fn on_surface(
        [at, n]: [V; 2],
        [next, n_next]: [V; 2],
        [start_a, dir_w, direct_w]: [R; 3],
    ) -> LightEnd<R> {
        let back = vertex::area_factor(next, at, n);
        let spread = vertex::area_factor(at, next, n_next);
        LightEnd {
            start: start_a.double(),
            direct: direct_w.double() * back.double(),
            next: dir_w.double() * spread.double(),
            back,
        }
    }

    /// Returns the MIS quantities of the first vertices of light paths after the light. The mask is
    /// unset where rounding leaves a point without a density.
    #[inline(always)]
    pub fn endpoint(&self, h: Heuristic, counts: &StrategyCounts) -> (R::Mask, MisEndpoint<R>) {
        let count = h.term(R::Double::splat(counts.direct));
        let edge = EdgePartials {
            d_vcm: h.term(self.direct / self.start) * count,
            d_vc: R::Double::splat(1.0) / h.term(self.start),
        };
        let (some, partials) = MisPartials::new(h, edge, self.next);
        let back = self.back;
        (some, MisEndpoint { partials, back })
    }
}

impl<R: Real> LightEnd<R> {
    /// Computes the densities for points of the selected lights and for the next vertices, each
    /// with its normal, and the unit directions `dir` from the light to the next vertex. The normal
    /// `n_next` is zero for a lens point; `next` and `direct` are then unused.
    #[inline(always)]
    pub fn new<const N: usize>(
        lights: &SelectedLights<R, N>,
        [at, n]: [R::Vec3; 2],
        dir: R::Vec3,
        [next, n_next]: [R::Vec3; 2],
    ) -> LightEnd<R>
    where
        R: Lanes<N>,
    {
        let EmissionPdf { pdf_a, pdf_w } = lights.pdf_emission(n, dir);
        let chosen = lights.probability_for(next);
        let direct_w = chosen * lights.pdf_direct_one_w(next, at, n);
        let mut end = LightEnd::on_surface([at, n], [next, n_next], [pdf_a, pdf_w, direct_w]);
        let zero = R::splat(0.0);
        let points = lights.are_points();
        if points.any() {
            let spread = vertex::area_factor(at, next, n_next).double();
            let point = LightEnd {
                start: pdf_a.double(),
                direct: chosen.double(),
                next: pdf_w.double() * spread,
                back: zero,
            };
            end = LightEnd::select(points, point, end);
        }
        let infinite = lights.are_infinite();
        if infinite.any() {
            let choice = lights.probability.double();
            let start = choice * pdf_w.double();
            let some = choice.gt(R::Double::splat(0.0));
            let disk = R::Double::select(some, pdf_a.double() / choice, R::Double::splat(0.0));
            let distant = LightEnd {
                start,
                direct: chosen.double() * pdf_w.double(),
                next: disk * dir.dot(n_next).abs().double(),
                back: R::select(lights.are_environments(), R::splat(1.0), zero),
            };
            end = LightEnd::select(infinite, distant, end);
        }
        end
    }

    /// Returns `yes` where the mask is set, else `no`.
    #[inline(always)]
    fn select(mask: R::Mask, yes: LightEnd<R>, no: LightEnd<R>) -> LightEnd<R> {
        LightEnd {
            start: R::Double::select(mask, yes.start, no.start),
            direct: R::Double::select(mask, yes.direct, no.direct),
            next: R::Double::select(mask, yes.next, no.next),
            back: R::select(mask, yes.back, no.back),
        }
    }
}

/// Returns the sum of the MIS terms of all other strategies over that of this one, as all functions
/// below, for `s = 0` and a camera path of `t` vertices that hit its light. `partials` are the
/// camera's at the light.
#[inline(always)]
pub fn others_s0<R: Real>(
    (h, counts): (Heuristic, &StrategyCounts),
    partials: &MisPartials<R::Double>,
    end: &LightEnd<R>,
    t: u32,
) -> R::Double {
    // If the camera sees the light directly, its point is the start of a light path; otherwise it
    // is sampled from a surface.
    if t == 2 {
        return partials.others_at_end(h, end.start, end.start, end.next);
    }
    let partials = MisPartials {
        d_vcm: partials.d_vcm * counts.direct_over_connecting(h),
        ..*partials
    };
    partials.others_at_end(h, end.direct, end.start, end.next)
}

/// Returns the sum for `s = 1`, `t >= 2`: light sampled from the end of the camera path, whose BSDF
/// towards it is `at_z`.
#[inline(always)]
pub fn others_s1<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(
    h: Heuristic,
    z: &MisEndpoint<R>,
    end: &LightEnd<R>,
    at_z: &BsdfValue<V>,
) -> R::Double {
    // Strategy s = 0: hitting the light instead of sampling it.
    let hit = h.term(at_z.pdf_w.double() * end.back.double() / end.direct);
    let hit = R::Double::select(end.back.gt(R::splat(0.0)), hit, R::Double::splat(0.0));
    // Strategies s >= 2: continuing from the light instead of ending at it.
    hit + h.term(end.start / end.direct) * z.others(h, end.next, at_z)
}

/// Returns the sum for `s >= 2`, `t >= 2`: the ends of two subpaths, whose BSDFs towards each other
/// are `at_y` and `at_z`; the factors convert densities per solid angle to those per area at y and
/// at z.
#[inline(always)]
pub fn others_interior<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(
    h: Heuristic,
    [y, z]: [&MisEndpoint<R>; 2],
    [at_y, at_z]: [&BsdfValue<V>; 2],
    [to_y, to_z]: [R; 2],
) -> R::Double {
    let density_y = at_z.pdf_w.double() * to_y.double();
    let density_z = at_y.pdf_w.double() * to_z.double();
    y.others(h, density_y, at_y) + z.others(h, density_z, at_z)
}

/// Returns the sum for merging the end `y` of a light path with the end `z` of a camera path, whose
/// BSDF towards the previous vertex of the light path is `at_z`; relative to the term of merging
/// them [Georgiev 2012, equations 38 and 39].
#[inline(always)]
pub fn others_merging<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(
    h: Heuristic,
    counts: &StrategyCounts,
    [y, z]: [&MisEndpoint<R>; 2],
    at_z: &BsdfValue<V>,
) -> R::Double {
    let merging = h.term(R::Double::splat(counts.merging));
    let (y, z) = (
        y.others_merged(h, at_z.pdf_w),
        z.others_merged(h, at_z.reverse_pdf_w),
    );
    (y + z) / merging
}

/// Returns the sum for `s >= 2`, `t = 1`: the end of a light path connected to a lens point,
/// towards which its BSDF is `at_y`. `pdf_w` is the density of the camera ray, and `spread`
/// converts it to one per area.
#[inline(always)]
pub fn others_t1<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(
    h: Heuristic,
    y: &MisEndpoint<R>,
    at_y: &BsdfValue<V>,
    [pdf_w, spread]: [R; 2],
) -> R::Double {
    y.others(h, pdf_w.double() * spread.double(), at_y)
}

/// Returns the sum for `s = 1`, `t = 1`: a light's point connected to a lens point.
#[inline(always)]
pub fn others_s1_t1<R: Real>(h: Heuristic, end: &LightEnd<R>, pdf_w: R) -> R::Double {
    h.term(pdf_w.double() * end.back.double() / end.start)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_sampled_light_replaces_several_connections() {
        let counts = StrategyCounts {
            connecting: 4.0,
            direct: 1.0,
            ..StrategyCounts::ONE_EACH
        };
        for (h, expected) in [(Heuristic::Balance, 0.25), (Heuristic::Power, 0.0625)] {
            // The term of light sampling over that of a connection, as their numbers of samples.
            let terms = [counts.of(1, 3), counts.of(2, 3)].map(|n| h.term(n));
            assert_eq!(terms[0] / terms[1], expected);
            assert_eq!(counts.direct_over_connecting::<f64>(h), expected);
        }
    }
}
