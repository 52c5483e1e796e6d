//! What one strategy makes of the subpaths: the light that it finds, and the terms of all other strategies over its own.

use glam::Vec3;

use super::subpath::Vertex;
use crate::transport::bsdf::Mode;
use crate::transport::integrator::Context;
use crate::transport::light::{DirectSample, LightPoint};
use crate::transport::mis::Heuristic;
use crate::transport::sampler::Sampler;
use crate::transport::vertex;

/// Light found by one strategy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Connection {
    /// Radiance, not yet weighted.
    pub unweighted: Vec3,
    /// Sum of the terms of all other strategies over that of this one: its weight is `1 / (1 + others)`.
    pub others: f64,
}

/// `s = 0`: the camera subpath of `t` vertices has met a light.
#[inline]
pub fn hit(context: &Context, h: Heuristic, z: &Vertex, t: u32) -> Option<Connection> {
    if z.emitted == Vec3::ZERO {
        return None;
    }
    let scene = context.scene;
    let emission = context.lights.pdf_emission(scene, z.emitter, z.wo.dot(z.n_geometric));
    let start = f64::from(emission.pdf_a);
    // Alone with the camera, a light vertex is the start of a light path; else it is sampled from a surface.
    let last = if t == 2 {
        start
    } else {
        let pdf_w = context.lights.pdf_direct_w(scene, z.previous, z.emitter, z.position, z.n_geometric);
        f64::from(pdf_w * vertex::area_factor(z.previous, z.position, z.n_geometric))
    };
    let others = z.chain.others_at_end(h, last, start, f64::from(emission.pdf_w * z.back));
    Some(Connection { unweighted: z.throughput * z.emitted, others })
}

/// `s = 1`: the end of the camera subpath and a point of a light, sampled from there.
#[inline]
pub fn next_event(
    context: &Context,
    h: Heuristic,
    z: &Vertex,
    sampler: &mut Sampler,
) -> Option<(Connection, LightPoint)> {
    let choice = sampler.next_1d();
    let d = context.lights.sample_direct(context.scene, z.position, choice, sampler.next_2d())?;
    let f = z.bsdf.eval(z.wo, d.wi, Mode::Radiance) * z.cos(d.wi);
    let unweighted = z.throughput * f * d.radiance / d.pdf_w;
    if unweighted == Vec3::ZERO || d.pdf_w <= 0.0 {
        return None;
    }
    let lit = if d.distance.is_finite() {
        vertex::visible(context.trace, z.position, z.n_geometric, d.point.position, d.point.normal)
    } else {
        vertex::unobstructed(context.trace, z.position, z.n_geometric, d.wi)
    };
    lit.then(|| (Connection { unweighted, others: others_of_next_event(context, h, z, &d) }, d.point))
}

fn others_of_next_event(context: &Context, h: Heuristic, z: &Vertex, d: &DirectSample) -> f64 {
    let pdf_w = f64::from(d.pdf_w);
    // Meeting the light instead of sampling it.
    let met = if d.delta { 0.0 } else { h.term(f64::from(z.bsdf.pdf_w(z.wo, d.wi)) / pdf_w) };
    // Going on from the light instead of stopping at it.
    let emission = context.lights.pdf_emission_at(context.scene, &d.point, -d.wi);
    let direct = pdf_w * f64::from(vertex::area_factor(z.position, d.point.position, d.point.normal));
    let here = f64::from(emission.pdf_w * vertex::area_factor(d.point.position, z.position, z.n_geometric));
    let others = z.chain.others(h, here, z.density_before(d.wi));
    met + h.term(f64::from(emission.pdf_a) / direct) * others
}

/// `s >= 2`, `t >= 2`: the ends of two subpaths.
#[inline]
pub fn ends(context: &Context, h: Heuristic, y: &Vertex, z: &Vertex) -> Option<Connection> {
    let edge = y.position - z.position;
    let distance2 = edge.length_squared();
    let wi = edge / distance2.sqrt();
    if !wi.is_finite() {
        return None;
    }
    let f = z.bsdf.eval(z.wo, wi, Mode::Radiance) * z.cos(wi);
    if f == Vec3::ZERO {
        return None;
    }
    let g = y.bsdf.eval(y.wo, -wi, Mode::Importance) * y.cos(-wi);
    let unweighted = y.throughput * g * f * z.throughput / distance2;
    if unweighted == Vec3::ZERO || !vertex::visible(context.trace, z.position, z.n_geometric, y.position, y.n_geometric)
    {
        return None;
    }
    let at_y = f64::from(z.bsdf.pdf_w(z.wo, wi) * vertex::area_factor(z.position, y.position, y.n_geometric));
    let at_z = f64::from(y.bsdf.pdf_w(y.wo, -wi) * vertex::area_factor(y.position, z.position, z.n_geometric));
    let others = y.chain.others(h, at_y, y.density_before(-wi)) + z.chain.others(h, at_z, z.density_before(wi));
    Some(Connection { unweighted, others })
}
