//! The fast weights of all strategies of one path: splits the path at every edge and rebuilds both
//! subpaths as if they had been traced.

use glam::Vec3;

use super::Path;
use crate::scene::compile::{NONE, Uv};
use crate::transport::bsdf::TransportMode;
use crate::transport::integrator::Context;
use crate::transport::integrator::bdpt::subpath::{Edge, Vertex};
use crate::transport::integrator::bdpt::weights::{
    LightEnd, others_interior, others_s0, others_s1, others_s1_t1, others_t1,
};
use crate::transport::light::LightId;
use crate::transport::mis::Heuristic;
use crate::transport::path_time::OpticalLength;
use crate::transport::vertex;

/// Returns the weights of the strategies `s = 0 ..= k` as `bdpt` computes them when it finds the
/// path that way.
pub fn fast_weights(context: &Context, h: Heuristic, path: &Path) -> Vec<f64> {
    (0..=path.depth())
        .map(|s| others(context, h, path, s).map_or(0.0, |others| 1.0 / (1.0 + others)))
        .collect()
}

/// Returns the sum of the terms of all other strategies over that of `s`; `None` if `s` cannot find
/// the path.
fn others(context: &Context, h: Heuristic, path: &Path, s: usize) -> Option<f64> {
    let k = path.depth();
    if s >= 1 && (path.is_dirac(s - 1) || path.is_dirac(s)) {
        return None;
    }
    let seen_pdf_w = context.camera.pdf_w(-path.dirs[k - 1]);
    if s == k && seen_pdf_w <= 0.0 || path.light_is_dirac() && (s == 0 || k == 1) {
        return None;
    }
    let end = |next: Vec3, n: Vec3| LightEnd::at_point(context, &path.light, path.dirs[0], next, n);
    let (camera, edge) = camera_side(context, h, path, s.max(1))?;
    let light = light_side(context, h, path, s);
    Some(match (s, light, camera) {
        (0, _, _) => {
            let partials = match path.light.light() {
                LightId::Environment => edge.partials_at(h, 1.0)?,
                _ => {
                    edge.partials_at_surface(context, h, path.light.position, path.light.normal)?
                        .0
                }
            };
            others_s0(
                h,
                &partials,
                &end(edge.from, edge.origin.normal()),
                k as u32 + 1,
            )
        }
        (1, _, None) => others_s1_t1(h, &end(path.lens, Vec3::ZERO), seen_pdf_w),
        (1, _, Some(z)) => {
            let at_z = z
                .bsdf
                .evaluate(z.out.wo, -path.dirs[0], TransportMode::Radiance);
            others_s1(h, &z.mis_endpoint(), &end(z.position, z.n_geometric), &at_z)
        }
        (_, Some(y), Some(z)) => others_between(h, &y, &z, path.dirs[s - 1]),
        (_, Some(y), None) => {
            let at_y = y
                .bsdf
                .evaluate(y.out.wo, path.dirs[k - 1], TransportMode::Importance);
            let spread = vertex::area_factor(path.lens, y.position, y.n_geometric);
            others_t1(h, &y.mis_endpoint(), &at_y, [seen_pdf_w, spread])
        }
        (_, None, _) => return None,
    })
}

/// Returns the sum for the strategy that connects two surface vertices; `dir` is the traced
/// direction from `y` to `z`.
fn others_between(h: Heuristic, y: &Vertex, z: &Vertex, dir: Vec3) -> f64 {
    let at_y = y.bsdf.evaluate(y.out.wo, dir, TransportMode::Importance);
    let at_z = z.bsdf.evaluate(z.out.wo, -dir, TransportMode::Radiance);
    // Use the direction between the points, as all strategies do; the traced direction starts off
    // the surface.
    let edge = y.position - z.position;
    let distance2 = edge.length_squared();
    let wi = edge / distance2.sqrt();
    let to = |v: &Vertex| wi.dot(v.n_geometric).abs() / distance2;
    others_interior(
        h,
        [&y.mis_endpoint(), &z.mis_endpoint()],
        [&at_y, &at_z],
        [to(y), to(z)],
    )
}

/// Returns the last vertex of the light subpath `x_0 .. x_(s-1)`, if it is a surface.
fn light_side(context: &Context, h: Heuristic, path: &Path, s: usize) -> Option<Vertex> {
    let mut edge = Edge::from_light(path.light, path.dirs[0]);
    let mut last = None;
    for i in 1..s {
        let v = vertex(context, h, path, i, &edge, -path.dirs[i - 1], |eta| {
            1.0 / eta
        })?;
        edge = v.next_edge(
            h,
            TransportMode::Importance,
            path.dirs[i],
            v.bsdf.pdf_w(v.out.wo, path.dirs[i]),
            v.bsdf.pdf_w(path.dirs[i], v.out.wo),
        );
        last = Some(v);
    }
    last
}

/// Returns the last vertex of the camera subpath `x_k .. x_last`, if it is a surface, and the edge
/// after it; `None` if rounding leaves a vertex without a density.
fn camera_side(
    context: &Context,
    h: Heuristic,
    path: &Path,
    last: usize,
) -> Option<(Option<Vertex>, Edge)> {
    let k = path.depth();
    let mut edge = Edge::from_lens(context, path.lens, -path.dirs[k - 1]);
    let mut end = None;
    for i in (last..k).rev() {
        let v = vertex(context, h, path, i, &edge, path.dirs[i], |eta| eta)?;
        let wi = -path.dirs[i - 1];
        edge = v.next_edge(
            h,
            TransportMode::Radiance,
            wi,
            v.bsdf.pdf_w(v.out.wo, wi),
            v.bsdf.pdf_w(wi, v.out.wo),
        );
        end = Some(v);
    }
    Some((end, edge))
}

/// Builds the vertex `x_i` at the end of an edge; `crossed` converts the path's index ratio to the
/// subpath's.
fn vertex(
    context: &Context,
    h: Heuristic,
    path: &Path,
    i: usize,
    edge: &Edge,
    wo: Vec3,
    crossed: impl Fn(f32) -> f32,
) -> Option<Vertex> {
    let at = &path.surfaces[i - 1];
    let (partials, back) = edge.partials_at_surface(context, h, at.position, at.n_geometric)?;
    Some(Vertex {
        position: at.position,
        n_geometric: at.n_geometric,
        n_shading: at.n_shading,
        out: at.bsdf.outgoing(wo),
        previous: edge.from,
        n_previous: edge.origin.normal(),
        back,
        bsdf: at.bsdf,
        connectible: at.dirac.is_none(),
        terminator: None,
        emitter: NONE,
        uv: Uv::default(),
        emitted: Vec3::ZERO,
        throughput: Vec3::ONE,
        partials,
        delta: at.dirac.is_some(),
        eta: at.dirac.map_or(1.0, crossed),
        optical: OpticalLength::default(),
    })
}
