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

use super::subpath::Vertex;
use crate::transport::bsdf::BsdfValue;
use crate::transport::integrator::Context;
use crate::transport::light::{LightId, LightPoint};
use crate::transport::mis::Heuristic;
use crate::transport::vertex;

/// What one side of a connection knows of the strategies that split the path further towards that side's end. All is
/// divided by the term of the density with which this side generated this vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chain {
    /// Term of the strategy that connects the vertex before with this one, over the term of generating this one too;
    /// without the other side's density of this vertex. Zero where it cannot.
    joint: f64,
    /// The same for all strategies that split earlier; without the other side's density of the vertex before.
    tail: f64,
}

/// A chain whose next vertex is not found yet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// See [`Chain::joint`].
    pub joint: f64,
    /// See [`Chain::tail`].
    pub tail: f64,
}

impl Chain {
    /// Where this side has generated a vertex with density `density` per area; `None` where rounding leaves none.
    #[inline]
    pub fn new(h: Heuristic, link: Link, density: f64) -> Option<Chain> {
        if density <= 0.0 || !density.is_finite() {
            return None;
        }
        let scale = 1.0 / h.term(density);
        Some(Chain { joint: link.joint * scale, tail: link.tail * scale })
    }

    /// Sum of the terms of all strategies with fewer vertices on this side, over the term of the one that connects
    /// here. The other side would generate this vertex with density `here` and the one before with density `before`.
    #[inline]
    pub fn others(&self, h: Heuristic, here: f64, before: f64) -> f64 {
        self.others_at_end(h, here, here, before)
    }

    /// The same where this vertex is the other side's end, for which the density depends on the strategy: `last` for
    /// the one that generates no more than it, `here` for the ones that go on.
    #[inline]
    pub fn others_at_end(&self, h: Heuristic, last: f64, here: f64, before: f64) -> f64 {
        self.joint * h.term(last) + self.tail * h.term(here) * h.term(before)
    }

    /// The chain behind an event here; `before` is the other side's density of the vertex before.
    #[inline]
    pub fn onward(&self, h: Heuristic, delta: bool, before: f64) -> Link {
        let joint = if delta { 0.0 } else { self.joint };
        Link { joint: f64::from(u8::from(!delta)), tail: joint + self.tail * h.term(before) }
    }
}

/// The densities where a path meets its light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightEnd {
    /// Density of `x_0` as the start of a light path: per area; for light from everywhere outside per solid angle; for a
    /// point or a parallel light the probability of choosing it.
    pub start: f64,
    /// The same where light is sampled from `x_1`.
    pub direct: f64,
    /// Density per area with which a light path goes on to `x_1`.
    pub next: f64,
    /// Turns a density per solid angle at `x_1` into one of `x_0`, in the measure of `start`.
    pub back: f32,
}

impl LightEnd {
    /// For a light's point, the unit direction from it to the next vertex, that vertex, and its normal: zero for a point
    /// on the lens, whose density `next` and whose `direct` are then of no use.
    #[inline]
    pub fn new(context: &Context, point: &LightPoint, dir: Vec3, next: Vec3, n_next: Vec3) -> LightEnd {
        let (lights, scene) = (context.lights, context.scene);
        let e = lights.pdf_emission_at(scene, point, dir);
        let [pdf_a, pdf_w] = [e.pdf_a, e.pdf_w].map(f64::from);
        let spread = || f64::from(vertex::area_factor(point.position, next, n_next));
        match point.light {
            LightId::Emitter(i) => {
                let back = vertex::area_factor(next, point.position, point.normal);
                let direct_w = lights.pdf_direct_w(scene, next, i, point.position, point.normal);
                let direct = f64::from(direct_w) * f64::from(back);
                LightEnd { start: pdf_a, direct, next: pdf_w * spread(), back }
            }
            LightId::Point(_) => LightEnd { start: pdf_a, direct: pdf_a, next: pdf_w * spread(), back: 0.0 },
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
#[inline]
pub fn others_of_next_event(h: Heuristic, z: &Vertex, end: &LightEnd, at_z: &BsdfValue) -> f64 {
    // Meeting the light instead of sampling it.
    let met = if end.back > 0.0 { h.term(f64::from(at_z.pdf_w) * f64::from(end.back) / end.direct) } else { 0.0 };
    // Going on from the light instead of stopping at it.
    met + h.term(end.start / end.direct) * z.chain.others(h, end.next, z.density_before(at_z.reverse_pdf_w))
}

/// Beside `s >= 2`, `t >= 2`, for the ends of two subpaths, whose BSDFs towards each other are `at_y` and `at_z`; `wi` is
/// the unit direction of the edge between them and `distance2` its squared length.
#[inline]
pub fn others_of_ends(
    h: Heuristic,
    [y, z]: [&Vertex; 2],
    [at_y, at_z]: [&BsdfValue; 2],
    wi: Vec3,
    distance2: f32,
) -> f64 {
    let to = |v: &Vertex| f64::from(wi.dot(v.n_geometric).abs() / distance2);
    let reaches_y = f64::from(at_z.pdf_w) * to(y);
    let reaches_z = f64::from(at_y.pdf_w) * to(z);
    y.chain.others(h, reaches_y, y.density_before(at_y.reverse_pdf_w))
        + z.chain.others(h, reaches_z, z.density_before(at_z.reverse_pdf_w))
}

/// Beside `s >= 2`, `t = 1`, for the end of a light path seen from a point of the lens, towards which its BSDF is `at_y`.
#[inline]
pub fn others_of_lens(h: Heuristic, y: &Vertex, lens: Vec3, at_y: &BsdfValue, pdf_w: f32) -> f64 {
    let here = f64::from(pdf_w) * f64::from(vertex::area_factor(lens, y.position, y.n_geometric));
    y.chain.others(h, here, y.density_before(at_y.reverse_pdf_w))
}

/// Beside `s = 1`, `t = 1`, for a light's point seen from a point of the lens.
#[inline]
pub fn others_of_seen(h: Heuristic, end: &LightEnd, pdf_w: f32) -> f64 {
    h.term(f64::from(pdf_w) * f64::from(end.back) / end.start)
}
