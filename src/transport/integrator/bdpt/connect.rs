//! What one strategy makes of the subpaths: the light that it finds, and the terms of all other strategies over its own.

use glam::Vec3;

use super::subpath::{Edge, Escape, Vertex};
use super::weights::{LightEnd, others_of_ends, others_of_hit, others_of_lens, others_of_next_event, others_of_seen};
use crate::scene::compile::{NONE, Uv};
use crate::transport::bsdf::Mode;
use crate::transport::camera::CameraConnection;
use crate::transport::flight;
use crate::transport::integrator::{Context, Settings};
use crate::transport::light::{EmissionSample, LightId, LightPoint};
use crate::transport::mis::Heuristic;
use crate::transport::ray::{Hit, Ray};
use crate::transport::sampler::Sampler;
use crate::transport::surface::Surface;
use crate::transport::vertex;

/// Light found by one strategy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Connection {
    /// Radiance, not yet weighted.
    pub unweighted: Vec3,
    /// Sum of the terms of all other strategies over that of this one: its weight is `1 / (1 + others)`.
    pub others: f64,
    /// The point of the light, where it is not the start of the light subpath.
    pub point: Option<LightPoint>,
    /// Unit direction of the connecting edge, towards the light; zero for `s = 0`.
    pub wi: Vec3,
    /// When it arrives; 0 without a time axis.
    pub length: f64,
}

impl Connection {
    /// Its weight.
    #[inline]
    pub fn weight(&self, settings: &Settings) -> f64 {
        if settings.raw() { 1.0 } else { 1.0 / (1.0 + self.others) }
    }
}

/// `s = 0`: the camera subpath of `t` vertices has met a light.
#[inline]
pub fn hit(context: &Context, h: Heuristic, z: &Vertex, t: u32) -> Option<Connection> {
    if z.emitter == NONE || z.emitted == Vec3::ZERO {
        return None;
    }
    let light = LightId::Emitter(z.emitter);
    let point = LightPoint { light, position: z.position, normal: z.n_geometric, uv: z.uv };
    let end = LightEnd::new(context, &point, z.out.wo, z.previous, z.n_previous);
    let others = others_of_hit(h, &z.chain, &end, t);
    let length = z.stamp.arrived();
    Some(Connection { unweighted: z.throughput * z.emitted, others, point: Some(point), wi: Vec3::ZERO, length })
}

/// The same where the end of an edge is all that matters of the path's last vertex.
pub fn met(
    context: &Context,
    h: Heuristic,
    edge: &Edge,
    ray: &Ray,
    found: &Hit,
    throughput: Vec3,
    t: u32,
) -> Option<Connection> {
    let surface = Surface::at(context.scene, ray, found);
    let (chain, back) = edge.meet(context, h, surface.position, surface.n_geometric)?;
    hit(context, h, &edge.arrive(context, &surface, Mode::Radiance, throughput, chain, back), t)
}

/// `s = 0`: the camera subpath has left the scene, and the light outside is its vertex number `t`.
#[inline]
pub fn escape(context: &Context, h: Heuristic, escape: &Escape, t: u32) -> Option<Connection> {
    let edge = &escape.edge;
    let radiance = context.lights.environment(edge.dir);
    if radiance == Vec3::ZERO {
        return None;
    }
    let light = LightId::Environment;
    let point = LightPoint { light, position: edge.from + edge.dir, normal: -edge.dir, uv: Uv::default() };
    let end = LightEnd::new(context, &point, -edge.dir, edge.from, edge.origin.normal());
    let others = others_of_hit(h, &edge.chain(h, 1.0)?, &end, t);
    let unweighted = escape.throughput * radiance;
    Some(Connection { unweighted, others, point: Some(point), wi: Vec3::ZERO, length: escape.length })
}

/// `s = 1`, `t >= 2`: the end of the camera subpath and a point of a light, sampled from there.
#[inline]
pub fn next_event(context: &Context, h: Heuristic, z: &Vertex, sampler: &mut Sampler) -> Option<Connection> {
    let choice = sampler.next_1d();
    let d = context.lights.sample_direct(context.scene, z.position, choice, sampler.next_2d())?;
    let at_z = z.bsdf.evaluate_from(&z.out, d.wi, Mode::Radiance);
    let unweighted = z.throughput * at_z.f * z.cos(d.wi) * d.radiance / d.pdf_w;
    let refused = z.overhang.is_some_and(|o| o.refuses(&d));
    if refused || unweighted == Vec3::ZERO || d.pdf_w <= 0.0 {
        return None;
    }
    let lit = if d.distance.is_finite() {
        vertex::visible(context.trace, z.position, z.n_geometric, d.point.position, d.point.normal)
    } else {
        vertex::unobstructed(context.trace, z.position, z.n_geometric, d.wi)
    };
    if !lit {
        return None;
    }
    let end = LightEnd::new(context, &d.point, -d.wi, z.position, z.n_geometric);
    // At the rim of a sphere rounding may put the point on the side that is hidden, where no strategy has a density.
    (end.direct > 0.0).then(|| {
        let others = others_of_next_event(h, &z.side(), &end, &at_z);
        let length = flight::of_direct(context, &z.stamp, &z.bsdf, z.out.wo, z.position, (d.wi, d.distance));
        Connection { unweighted, others, point: Some(d.point), wi: d.wi, length }
    })
}

/// `s >= 2`, `t >= 2`: the ends of two subpaths.
#[inline]
pub fn ends(context: &Context, h: Heuristic, y: &Vertex, z: &Vertex) -> Option<Connection> {
    let raised = z.overhang.filter(|o| o.reaches(y.position)).and_then(|_| z.raised());
    let z = raised.as_ref().unwrap_or(z);
    let edge = y.position - z.position;
    let distance2 = edge.length_squared();
    let wi = edge / distance2.sqrt();
    if !wi.is_finite() {
        return None;
    }
    let at_z = z.bsdf.evaluate_from(&z.out, wi, Mode::Radiance);
    if at_z.f == Vec3::ZERO {
        return None;
    }
    let at_y = y.bsdf.evaluate_from(&y.out, -wi, Mode::Importance);
    let unweighted = y.throughput * at_y.f * y.cos(-wi) * at_z.f * z.cos(wi) * z.throughput / distance2;
    if unweighted == Vec3::ZERO || !vertex::visible(context.trace, z.position, z.n_geometric, y.position, y.n_geometric)
    {
        return None;
    }
    let length = if context.timing.is_some() {
        let ratio = z.bsdf.index_ratio(z.out.wo, wi);
        let near = z.stamp.onward(ratio, distance2.sqrt());
        near + y.stamp.of_light(y.bsdf.index_ratio(y.out.wo, -wi), z.stamp.index * ratio)
    } else {
        0.0
    };
    let to = |v: &Vertex| wi.dot(v.n_geometric).abs() / distance2;
    let others = others_of_ends(h, [&y.side(), &z.side()], [&at_y, &at_z], [to(y), to(z)]);
    Some(Connection { unweighted, others, point: None, wi, length })
}

/// `s >= 2`, `t = 1`: the end of the light subpath, seen by the camera.
#[inline]
pub fn lens(
    context: &Context,
    h: Heuristic,
    y: &Vertex,
    emitted: f32,
    sampler: &mut Sampler,
) -> Option<(Connection, CameraConnection)> {
    let c = context.camera.connect(y.position, sampler.next_2d(), sampler.next_2d())?;
    let at_y = y.bsdf.evaluate_from(&y.out, -c.dir, Mode::Importance);
    let unweighted = y.throughput * at_y.f * y.cos(-c.dir) * c.importance;
    if unweighted == Vec3::ZERO || !vertex::visible(context.trace, y.position, y.n_geometric, c.lens, Vec3::ZERO) {
        return None;
    }
    let spread = vertex::area_factor(c.lens, y.position, y.n_geometric);
    let others = others_of_lens(h, &y.side(), &at_y, [c.pdf_w, spread]);
    let length = context.timing.map_or(0.0, |timing| {
        let last = if timing.camera { timing.medium * c.distance } else { 0.0 };
        f64::from(emitted) + f64::from(last) + y.stamp.of_light(y.bsdf.index_ratio(y.out.wo, -c.dir), timing.medium)
    });
    Some((Connection { unweighted, others, point: None, wi: c.dir, length }, c))
}

/// `s = 1`, `t = 1`: the start of the light subpath, seen by the camera. Points and parallel light are not: nothing that
/// starts at the camera could find them, and a picture does not show them.
#[inline]
pub fn seen(
    context: &Context,
    h: Heuristic,
    start: &EmissionSample,
    emitted: f32,
    sampler: &mut Sampler,
) -> Option<(Connection, CameraConnection)> {
    let point = start.point;
    let (lens_u, filter_u) = (sampler.next_2d(), sampler.next_2d());
    let (c, cos) = match point.light {
        LightId::Emitter(_) => {
            let c = context.camera.connect(point.position, lens_u, filter_u)?;
            (c, point.normal.dot(-c.dir))
        }
        LightId::Environment => (context.camera.connect_direction(-start.dir, lens_u, filter_u)?, 1.0),
        LightId::Point(_) | LightId::Directional(_) => return None,
    };
    let end = LightEnd::new(context, &point, -c.dir, c.lens, Vec3::ZERO);
    let radiance = context.lights.emitted(context.scene, &point, -c.dir);
    let unweighted = radiance * cos * (f64::from(c.importance) / end.start) as f32;
    if cos <= 0.0 || unweighted == Vec3::ZERO {
        return None;
    }
    let visible = if c.distance.is_finite() {
        vertex::visible(context.trace, point.position, point.normal, c.lens, Vec3::ZERO)
    } else {
        vertex::unobstructed(context.trace, c.lens, Vec3::ZERO, c.dir)
    };
    let others = others_of_seen(h, &end, c.pdf_w);
    let length = context.timing.map_or(0.0, |timing| {
        let far = if c.distance.is_finite() { c.distance } else { context.lights.lead(c.lens, c.dir) };
        f64::from(emitted) + f64::from(if timing.camera { timing.medium * far } else { 0.0 })
    });
    visible.then_some((Connection { unweighted, others, point: None, wi: c.dir, length }, c))
}
