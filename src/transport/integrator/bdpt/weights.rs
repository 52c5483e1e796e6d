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
//!   two strategies meet, their ratio stands in [`Chain::joint`].
//! - A light without a place has its direction as `x_0`, per solid angle, and starts paths on a disk: see
//!   [`Vertex`](super::subpath::Vertex).

use crate::transport::mis::Heuristic;

/// What one side of a connection knows of the strategies that split the path further towards that side's end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chain {
    /// Density per area with which this side generated this vertex.
    pub density: f64,
    /// Term of the strategy that connects the vertex before with this one, over the term of generating this one too;
    /// without the densities of this vertex. Zero where it cannot.
    pub joint: f64,
    /// The same for all strategies that split earlier; without the other side's density of the vertex before.
    pub tail: f64,
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
        (self.joint * h.term(last) + self.tail * h.term(here) * h.term(before)) / h.term(self.density)
    }

    /// The chain behind an event here; `before` is the other side's density of the vertex before.
    #[inline]
    pub fn onward(&self, h: Heuristic, delta: bool, before: f64) -> Link {
        let joint = if delta { 0.0 } else { self.joint };
        Link { joint: f64::from(u8::from(!delta)), tail: (joint + self.tail * h.term(before)) / h.term(self.density) }
    }
}
