//! The connections of bidirectional path tracing: the light that each strategy finds, and the MIS
//! terms of all other strategies relative to its own.

use glam::Vec3;

use super::subpath::{Edge, Escape, Vertex};
use super::weights::{LightEnd, others_interior, others_s0, others_s1, others_s1_t1, others_t1};
use crate::scene::compile::{NONE, Uv};
use crate::transport::bsdf::TransportMode;
use crate::transport::camera::CameraConnection;
use crate::transport::integrator::{Context, Settings};
use crate::transport::light::{LightId, LightPoint};
use crate::transport::mis::Heuristic;
use crate::transport::path_time::{self, Timing};
use crate::transport::ray::{Hit, Ray};
use crate::transport::sampler::Sampler;
use crate::transport::surface::Surface;
use crate::transport::vertex;

/// Light found by one strategy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Connection {
    /// Radiance, not yet weighted.
    pub unweighted: Vec3,
    /// Sum of the MIS terms of all other strategies over that of this one: the weight is `1 / (1 +
    /// others)`.
    pub others: f64,
    /// The point of the light, if it is not the start of the light subpath.
    pub point: Option<LightPoint>,
    /// Unit direction of the connecting edge towards the light; zero for `s = 0`.
    pub wi: Vec3,
    /// Optical length of the path; 0 without a time axis.
    pub length: f64,
}

impl Connection {
    /// Returns the MIS weight, or 1 if strategies are not weighted.
    #[inline]
    pub fn weight(&self, settings: &Settings) -> f64 {
        if settings.unweighted() {
            1.0
        } else {
            1.0 / (1.0 + self.others)
        }
    }
}

/// Connects with `s = 0`: the camera subpath of `t` vertices has hit a light.
#[inline]
pub fn connect_s0(context: &Context, h: Heuristic, z: &Vertex, t: u32) -> Option<Connection> {
    if z.emitter == NONE || z.emitted == Vec3::ZERO {
        return None;
    }
    let lights = [LightId::Emitter(z.emitter)];
    let point = LightPoint {
        lights,
        position: z.position,
        normal: z.n_geometric,
        uv: z.uv,
    };
    let end = LightEnd::at_point(context, &point, z.out.wo, z.previous, z.n_previous);
    let others = others_s0(h, &z.partials, &end, t);
    let length = z.optical.arrival();
    Some(Connection {
        unweighted: z.throughput * z.emitted,
        others,
        point: Some(point),
        wi: Vec3::ZERO,
        length,
    })
}

/// Connects with `s = 0` at a hit of a camera subpath's edge, without its vertex.
pub fn connect_s0_at_hit(
    context: &Context,
    h: Heuristic,
    edge: &Edge,
    ray: &Ray,
    found: &Hit,
    throughput: Vec3,
    t: u32,
) -> Option<Connection> {
    let surface = Surface::at(context.scene, ray, found);
    let (partials, back) =
        edge.partials_at_surface(context, h, surface.position, surface.n_geometric)?;
    connect_s0(
        context,
        h,
        &edge.vertex_at(
            context,
            &surface,
            TransportMode::Radiance,
            throughput,
            partials,
            back,
        ),
        t,
    )
}

/// Connects with `s = 0` outside the scene: the camera subpath left the scene, and the environment
/// is its vertex number `t`.
#[inline]
pub fn connect_s0_escaped(
    context: &Context,
    h: Heuristic,
    escape: &Escape,
    t: u32,
) -> Option<Connection> {
    let edge = &escape.edge;
    let radiance = context.lights.environment(edge.dir);
    if radiance == Vec3::ZERO {
        return None;
    }
    let lights = [LightId::Environment];
    let point = LightPoint {
        lights,
        position: edge.from + edge.dir,
        normal: -edge.dir,
        uv: Uv::default(),
    };
    let end = LightEnd::at_point(context, &point, -edge.dir, edge.from, edge.origin.normal());
    let others = others_s0(h, &edge.partials_at(h, 1.0)?, &end, t);
    let unweighted = escape.throughput * radiance;
    Some(Connection {
        unweighted,
        others,
        point: Some(point),
        wi: Vec3::ZERO,
        length: escape.length,
    })
}

/// Connects with `s = 1`, `t >= 2`: the end of the camera subpath and a light point sampled from
/// there.
#[inline]
pub fn connect_s1(
    context: &Context,
    h: Heuristic,
    z: &Vertex,
    sampler: &mut Sampler,
) -> Option<Connection> {
    let choice = sampler.next_1d();
    let d = context
        .lights
        .sample_direct(context.scene, z.position, choice, sampler.next_2d())?;
    let at_z = z.bsdf.evaluate_from(&z.out, d.wi, TransportMode::Radiance);
    let unweighted = z.throughput * at_z.f * z.cos(d.wi) * d.radiance / d.pdf_w;
    let refused = z.terminator.is_some_and(|o| o.excludes(&d));
    if refused || unweighted == Vec3::ZERO || d.pdf_w <= 0.0 {
        return None;
    }
    let lit = if d.distance.is_finite() {
        vertex::visible(
            context.trace,
            z.position,
            z.n_geometric,
            d.point.position,
            d.point.normal,
        )
    } else {
        vertex::unobstructed(context.trace, z.position, z.n_geometric, d.wi)
    };
    if !lit {
        return None;
    }
    let end = LightEnd::at_point(context, &d.point, -d.wi, z.position, z.n_geometric);
    // Rounding may place a point at the rim of a sphere on its hidden side, where no strategy has a
    // density.
    (end.direct > 0.0).then(|| {
        let others = others_s1(h, &z.mis_endpoint(), &end, &at_z);
        let length = path_time::direct_length(
            context,
            &z.optical,
            &z.bsdf,
            z.out.wo,
            z.position,
            (d.wi, d.distance),
        );
        Connection {
            unweighted,
            others,
            point: Some(d.point),
            wi: d.wi,
            length,
        }
    })
}

/// Connects with `s >= 2`, `t >= 2`: the ends of two subpaths.
#[inline]
pub fn connect(context: &Context, h: Heuristic, y: &Vertex, z: &Vertex) -> Option<Connection> {
    let lifted = z
        .terminator
        .filter(|o| o.has_below(y.position))
        .and_then(|_| z.lifted());
    let z = lifted.as_ref().unwrap_or(z);
    let edge = y.position - z.position;
    let distance2 = edge.length_squared();
    let wi = edge / distance2.sqrt();
    if !wi.is_finite() {
        return None;
    }
    let at_z = z.bsdf.evaluate_from(&z.out, wi, TransportMode::Radiance);
    if at_z.f == Vec3::ZERO {
        return None;
    }
    let at_y = y.bsdf.evaluate_from(&y.out, -wi, TransportMode::Importance);
    let unweighted =
        y.throughput * at_y.f * y.cos(-wi) * at_z.f * z.cos(wi) * z.throughput / distance2;
    if unweighted == Vec3::ZERO
        || !vertex::visible(
            context.trace,
            z.position,
            z.n_geometric,
            y.position,
            y.n_geometric,
        )
    {
        return None;
    }
    let length = if context.timing.is_some() {
        let ratio = z.bsdf.index_ratio(z.out.wo, wi);
        let near = z.optical.after_segment(ratio, distance2.sqrt());
        near + y
            .optical
            .from_light(y.bsdf.index_ratio(y.out.wo, -wi), z.optical.index * ratio)
    } else {
        0.0
    };
    let to = |v: &Vertex| wi.dot(v.n_geometric).abs() / distance2;
    let others = others_interior(
        h,
        [&y.mis_endpoint(), &z.mis_endpoint()],
        [&at_y, &at_z],
        [to(y), to(z)],
    );
    Some(Connection {
        unweighted,
        others,
        point: None,
        wi,
        length,
    })
}

/// Connects with `s >= 2`, `t = 1`: the end of the light subpath to the camera.
#[inline]
pub fn connect_t1(
    context: &Context,
    h: Heuristic,
    y: &Vertex,
    emitted: f32,
    sampler: &mut Sampler,
) -> Option<(Connection, CameraConnection)> {
    let c = context
        .camera
        .connect(y.position, sampler.next_2d(), sampler.next_2d())?;
    let at_y = y
        .bsdf
        .evaluate_from(&y.out, -c.dir, TransportMode::Importance);
    let unweighted = y.throughput * at_y.f * y.cos(-c.dir) * c.importance;
    if unweighted == Vec3::ZERO
        || !vertex::visible(context.trace, y.position, y.n_geometric, c.lens, Vec3::ZERO)
    {
        return None;
    }
    let spread = vertex::area_factor(c.lens, y.position, y.n_geometric);
    let others = others_t1(h, &y.mis_endpoint(), &at_y, [c.pdf_w, spread]);
    let length = context.timing.map_or(0.0, |timing| {
        camera_length(timing, emitted, c.distance)
            + y.optical
                .from_light(y.bsdf.index_ratio(y.out.wo, -c.dir), timing.medium)
    });
    Some((
        Connection {
            unweighted,
            others,
            point: None,
            wi: c.dir,
            length,
        },
        c,
    ))
}

/// Connects with `s = 1`, `t = 1`: the start of the light subpath, which continues in direction
/// `dir`, to the camera. Point lights and
/// directional lights are not connected: nothing that starts at the camera could find them, and a
/// picture does not show them.
#[inline]
pub fn connect_s1_t1(
    context: &Context,
    h: Heuristic,
    point: &LightPoint,
    dir: Vec3,
    emitted: f32,
    sampler: &mut Sampler,
) -> Option<(Connection, CameraConnection)> {
    let (lens_u, filter_u) = (sampler.next_2d(), sampler.next_2d());
    let (c, cos) = match point.light() {
        LightId::Emitter(_) => {
            let c = context.camera.connect(point.position, lens_u, filter_u)?;
            (c, point.normal.dot(-c.dir))
        }
        LightId::Environment => (
            context.camera.connect_direction(-dir, lens_u, filter_u)?,
            1.0,
        ),
        LightId::Point(_) | LightId::Directional(_) => return None,
    };
    let end = LightEnd::at_point(context, point, -c.dir, c.lens, Vec3::ZERO);
    let radiance = context.lights.emitted(context.scene, point, -c.dir);
    let unweighted = radiance * cos * (f64::from(c.importance) / end.start) as f32;
    if cos <= 0.0 || unweighted == Vec3::ZERO {
        return None;
    }
    let visible = if c.distance.is_finite() {
        vertex::visible(
            context.trace,
            point.position,
            point.normal,
            c.lens,
            Vec3::ZERO,
        )
    } else {
        vertex::unobstructed(context.trace, c.lens, Vec3::ZERO, c.dir)
    };
    let others = others_s1_t1(h, &end, c.pdf_w);
    let length = context.timing.map_or(0.0, |timing| {
        let far = if c.distance.is_finite() {
            c.distance
        } else {
            context.lights.front_distance(c.lens, c.dir)
        };
        camera_length(timing, emitted, far)
    });
    visible.then_some((
        Connection {
            unweighted,
            others,
            point: None,
            wi: c.dir,
            length,
        },
        c,
    ))
}

/// Returns the optical length of light emitted at `emitted` after the segment of `distance` to the
/// camera.
#[inline]
fn camera_length(timing: &Timing, emitted: f32, distance: f32) -> f64 {
    let segment = if timing.camera {
        timing.medium * distance
    } else {
        0.0
    };
    f64::from(emitted) + f64::from(segment)
}
