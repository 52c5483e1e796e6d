//! Weights of strategies in constant time per connection.
//!
//! A path `x_0 .. x_k` from light to camera is found by the strategy of `s` light vertices with the density
//! `p_s = product of l_i for i < s, times product of e_i for i >= s`: `l_i` is the density per area with which light
//! subpaths generate `x_i`, `e_i` that of camera subpaths. So `p_(i) / p_(i+1) = e_i / l_i`, and the terms of all
//! strategies with fewer light vertices than `s`, over that of `s`, are a polynomial in Horner's form along the light
//! subpath. Only its two last factors depend on the connection; the rest is known when a vertex is made. A [`Chain`]
//! holds it. The camera's side is the same with `l` and `e` exchanged [Georgiev 2012].
//!
//! - A strategy can connect only two vertices with a density. A path whose event at a vertex was a Dirac has no
//!   strategy that connects there.
//! - The density of what a Dirac event generates is `|cos| eta^2` of the outgoing side, relative to the incoming one:
//!   both directions are then measured by the extent of the same beam, which refraction keeps. Where an event has a
//!   probability, reflectance say, it is left out: forwards and backwards it is the same for the BSDFs that there are,
//!   and weights sum to one whatever stands here, as long as it is a function of the path.
//! - Light sampling from a surface (`s = 1`) may have another density than the start of light paths; where the first
//!   two strategies meet, their ratio stands in [`Chain::joint`]. Seen directly, a light's point is the start of a light
//!   path for the only strategy that does not hit it, `s = 1` and `t = 1`.
//! - A light without a place has its direction as `x_0`, per solid angle, and its paths come through a disk across that
//!   direction: `x_1` then has the disk's density times the cosine there. A point and a parallel light have a
//!   probability in place of a density, and no camera path generates them.
//! - The camera's end is a chain like the other: `t = 1` connects the point on the lens, which no strategy does without
//!   and whose density cancels.
//! - Densities may be any functions of the path as long as all strategies use the same, [`Camera::pdf_w`] for one.
//!
//! [`Camera::pdf_w`]: crate::transport::camera::Camera::pdf_w

use glam::Vec3;

use crate::math::real::{Double, Mask, Real, Vector};
use crate::transport::bsdf::{BsdfValue, Mode};
use crate::transport::integrator::Context;
use crate::transport::light::{LightId, LightPoint};
use crate::transport::mis::Heuristic;
use crate::transport::vertex;

/// What one side of a connection knows of the strategies that split the path further towards that side's end. All is
/// divided by the term of the density with which this side generated this vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chain<D = f64> {
    /// Term of the strategy that connects the vertex before with this one, over the term of generating this one too;
    /// without the other side's density of this vertex. Zero where it cannot.
    pub(crate) joint: D,
    /// The same for all strategies that split earlier; without the other side's density of the vertex before.
    pub(crate) tail: D,
}

/// A chain whose next vertex is not found yet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link<D = f64> {
    /// See [`Chain::joint`].
    pub joint: D,
    /// See [`Chain::tail`].
    pub tail: D,
}

/// A vertex of one side of a connection, as weights see it; in lanes several.
#[derive(Clone, Copy, Debug)]
pub struct Side<R: Real = f32> {
    /// What is known of the strategies that split further towards that side's end.
    pub chain: Chain<R::Double>,
    /// Turns a density per solid angle here into the other side's density of the vertex before; zero where the other
    /// side cannot generate it.
    pub back: R,
}

impl<D: Double> Chain<D> {
    /// Where this side has generated a vertex with density `density` per area; not where rounding leaves none.
    #[inline(always)]
    pub fn new(h: Heuristic, link: Link<D>, density: D) -> (<D::Real as Real>::Mask, Chain<D>) {
        let some = density.gt(D::of(0.0)) & D::of(f64::INFINITY).gt(density);
        let scale = D::of(1.0) / h.term(density);
        (some, Chain { joint: link.joint * scale, tail: link.tail * scale })
    }

    /// Sum of the terms of all strategies with fewer vertices on this side, over the term of the one that connects
    /// here. The other side would generate this vertex with density `here` and the one before with density `before`.
    #[inline(always)]
    pub fn others(&self, h: Heuristic, here: D, before: D) -> D {
        self.others_at_end(h, here, here, before)
    }

    /// The same where this vertex is the other side's end, for which the density depends on the strategy: `last` for
    /// the one that generates no more than it, `here` for the ones that go on.
    #[inline(always)]
    pub fn others_at_end(&self, h: Heuristic, last: D, here: D, before: D) -> D {
        self.joint * h.term(last) + self.tail * h.term(here) * h.term(before)
    }

    /// The chain behind an event here, where `delta` behind a Dirac one; `before` is the other side's density of the vertex
    /// before.
    #[inline(always)]
    pub fn onward(&self, h: Heuristic, delta: <D::Real as Real>::Mask, before: D) -> Link<D> {
        let (zero, one) = (D::of(0.0), D::of(1.0));
        let joint = D::select(delta, zero, self.joint);
        Link { joint: D::select(delta, zero, one), tail: joint + self.tail * h.term(before) }
    }
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> Side<R> {
    /// The other side's density of the vertex before, where its BSDF goes there with density `reverse_pdf_w`.
    #[inline(always)]
    pub fn density_before(&self, reverse_pdf_w: R) -> R::Double {
        let some = self.back.gt(R::of(0.0));
        R::Double::select(some, reverse_pdf_w.double() * self.back.double(), R::Double::of(0.0))
    }

    /// What other strategies that split on this side weigh, where the other side would generate this vertex with density
    /// `here`.
    #[inline(always)]
    fn others(&self, h: Heuristic, here: R::Double, at: &BsdfValue<V>) -> R::Double {
        self.chain.others(h, here, self.density_before(at.reverse_pdf_w))
    }

    /// The density and the chain of the edge on which the path goes on from `wo` into `wi`, at a point with the geometric
    /// normal `n`. It was found with density `pdf_w`, that of the way back is `reverse_pdf_w`; or where `delta` by a Dirac
    /// event that crossed the index ratio `eta`. The density of what such an event generates is `|cos| eta^2` of the
    /// outgoing side relative to the incoming one.
    #[inline(always)]
    pub fn onward(
        &self,
        h: Heuristic,
        mode: Mode,
        [wo, wi, n]: [V; 3],
        [pdf_w, reverse_pdf_w]: [R; 2],
        (delta, eta): (R::Mask, R),
    ) -> (R::Double, Link<R::Double>) {
        let (mut density, mut before) = (pdf_w.double(), self.density_before(reverse_pdf_w));
        if delta.any() {
            let (out, back) = (wi.dot(n).abs(), wo.dot(n).abs());
            let (out, back) = match mode {
                Mode::Radiance => (out, back / (eta * eta)),
                Mode::Importance => (out * eta * eta, back),
            };
            density = R::Double::select(delta, out.double(), density);
            before = R::Double::select(delta, back.double() * self.back.double(), before);
        }
        (density, self.chain.onward(h, delta, before))
    }
}

/// The densities where a path meets its light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightEnd<R: Real = f32> {
    /// Density of `x_0` as the start of a light path: per area; for light from everywhere outside per solid angle; for a
    /// point or a parallel light the probability of choosing it.
    pub start: R::Double,
    /// The same where light is sampled from `x_1`.
    pub direct: R::Double,
    /// Density per area with which a light path goes on to `x_1`.
    pub next: R::Double,
    /// Turns a density per solid angle at `x_1` into one of `x_0`, in the measure of `start`.
    pub back: R,
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> LightEnd<R> {
    /// For points of surfaces that shine, with their normals, and the next vertices with theirs. The densities are those of
    /// the start, per area; of the direction to the next vertex; and of the direction from there to the light, as light is
    /// sampled.
    #[inline(always)]
    pub fn on_surface([at, n]: [V; 2], [next, n_next]: [V; 2], [start_a, dir_w, direct_w]: [R; 3]) -> LightEnd<R> {
        let back = vertex::area_factor(next, at, n);
        let spread = vertex::area_factor(at, next, n_next);
        LightEnd {
            start: start_a.double(),
            direct: direct_w.double() * back.double(),
            next: dir_w.double() * spread.double(),
            back,
        }
    }

    /// What weights need behind the first edge of a light path, before its density.
    #[inline(always)]
    pub fn link(&self, h: Heuristic) -> Link<R::Double> {
        let one = R::Double::of(1.0);
        Link { joint: h.term(self.direct / self.start), tail: one / h.term(self.start) }
    }
}

impl LightEnd {
    /// For a light's point, the unit direction from it to the next vertex, that vertex, and its normal: zero for a point
    /// on the lens, whose density `next` and whose `direct` are then of no use.
    #[inline]
    pub fn new(context: &Context, point: &LightPoint, dir: Vec3, next: Vec3, n_next: Vec3) -> LightEnd {
        let (lights, scene) = (context.lights, context.scene);
        let e = lights.pdf_emission_at(scene, point, dir);
        let [pdf_a, pdf_w] = [e.pdf_a, e.pdf_w].map(f64::from);
        match point.light {
            LightId::Emitter(i) => {
                let direct_w = lights.pdf_direct_w(scene, next, i, point.position, point.normal);
                LightEnd::on_surface([point.position, point.normal], [next, n_next], [e.pdf_a, e.pdf_w, direct_w])
            }
            LightId::Point(_) => {
                let spread = f64::from(vertex::area_factor(point.position, next, n_next));
                LightEnd { start: pdf_a, direct: pdf_a, next: pdf_w * spread, back: 0.0 }
            }
            LightId::Directional(_) | LightId::Environment => {
                let choice = f64::from(lights.pdf_choice(point.light));
                let start = choice * pdf_w;
                let across = if choice > 0.0 { pdf_a / choice } else { 0.0 };
                let back = if point.light == LightId::Environment { 1.0 } else { 0.0 };
                LightEnd { start, direct: start, next: across * f64::from(dir.dot(n_next).abs()), back }
            }
        }
    }
}

/// What all other strategies weigh beside `s = 0`, for a camera path of `t` vertices that met its light: the sum of their
/// terms over the term of this one, as in all functions below. `chain` is the camera's at the light.
#[inline]
pub fn others_of_hit(h: Heuristic, chain: &Chain, end: &LightEnd, t: u32) -> f64 {
    // Alone with the camera, a light's point is the start of a light path; else it is sampled from a surface.
    let last = if t == 2 { end.start } else { end.direct };
    chain.others_at_end(h, last, end.start, end.next)
}

/// Beside `s = 1`, `t >= 2`, for light sampled from the end of the camera path, whose BSDF towards it is `at_z`.
#[inline(always)]
pub fn others_of_next_event<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(
    h: Heuristic,
    z: &Side<R>,
    end: &LightEnd<R>,
    at_z: &BsdfValue<V>,
) -> R::Double {
    // Meeting the light instead of sampling it.
    let met = h.term(at_z.pdf_w.double() * end.back.double() / end.direct);
    let met = R::Double::select(end.back.gt(R::of(0.0)), met, R::Double::of(0.0));
    // Going on from the light instead of stopping at it.
    met + h.term(end.start / end.direct) * z.others(h, end.next, at_z)
}

/// Beside `s >= 2`, `t >= 2`, for the ends of two subpaths, whose BSDFs towards each other are `at_y` and `at_z`; the
/// factors turn densities per solid angle into those per area at y and at z.
#[inline(always)]
pub fn others_of_ends<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(
    h: Heuristic,
    [y, z]: [&Side<R>; 2],
    [at_y, at_z]: [&BsdfValue<V>; 2],
    [to_y, to_z]: [R; 2],
) -> R::Double {
    let reaches_y = at_z.pdf_w.double() * to_y.double();
    let reaches_z = at_y.pdf_w.double() * to_z.double();
    y.others(h, reaches_y, at_y) + z.others(h, reaches_z, at_z)
}

/// Beside `s >= 2`, `t = 1`, for the end of a light path seen from a point of the lens, towards which its BSDF is `at_y`:
/// `pdf_w` is the density of the camera ray there, and `spread` turns it into one per area.
#[inline(always)]
pub fn others_of_lens<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(
    h: Heuristic,
    y: &Side<R>,
    at_y: &BsdfValue<V>,
    [pdf_w, spread]: [R; 2],
) -> R::Double {
    y.others(h, pdf_w.double() * spread.double(), at_y)
}

/// Beside `s = 1`, `t = 1`, for a light's point seen from a point of the lens.
#[inline(always)]
pub fn others_of_seen<R: Real>(h: Heuristic, end: &LightEnd<R>, pdf_w: R) -> R::Double {
    h.term(pdf_w.double() * end.back.double() / end.start)
}
