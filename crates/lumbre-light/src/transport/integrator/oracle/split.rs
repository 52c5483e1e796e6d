//! The fast weights of all strategies of one path: splits the path at every edge and rebuilds both
//! subpaths as if they had been traced.

use glam::Vec3;

use super::{ByStrategy, Path, Rule, ScatterVertex};
use crate::transport::bsdf::{Bsdf, BsdfValue, TransportMode};
use crate::transport::integrator::Context;
use crate::transport::integrator::bdpt::weights::{
    LightEnd, MisEdge, MisEndpoint, others_interior, others_merging, others_s0, others_s1,
    others_s1_t1, others_t1,
};
use crate::transport::vertex;

/// A surface vertex of a subpath.
struct Vertex {
    position: Vec3,
    n_geometric: Vec3,
    bsdf: Bsdf,
    /// Unit direction to the previous vertex.
    wo: Vec3,
    endpoint: MisEndpoint,
    /// Whether the event that led to the next vertex was a Dirac event, and the index ratio that it
    /// crossed.
    event: (bool, f32),
}

impl Vertex {
    /// Returns the vertex at a surface at the end of an edge; `crossed` converts the path's index
    /// ratio to the subpath's.
    fn new(
        at: &ScatterVertex,
        wo: Vec3,
        endpoint: MisEndpoint,
        crossed: impl Fn(f32) -> f32,
    ) -> Vertex {
        Vertex {
            position: at.position,
            n_geometric: at.n_geometric,
            bsdf: at.bsdf,
            wo,
            endpoint,
            event: (at.dirac.is_some(), at.dirac.map_or(1.0, crossed)),
        }
    }

    /// Returns the edge that leaves the vertex in direction `wi`.
    fn next_edge(&self, rule: &Rule, mode: TransportMode, wi: Vec3) -> MisEdge {
        let mut densities = [self.bsdf.pdf_w(self.wo, wi), self.bsdf.pdf_w(wi, self.wo)];
        match mode {
            TransportMode::Radiance => densities[0] = self.camera_pdf_w(rule, [self.wo, wi]),
            TransportMode::Importance => densities[1] = self.camera_pdf_w(rule, [wi, self.wo]),
        }
        let directions = [self.wo, wi, self.n_geometric];
        let (pdf_w, partials) = self.endpoint.next_edge(
            (rule.heuristic, &rule.counts),
            mode,
            directions,
            densities,
            self.event,
        );
        MisEdge {
            from: [self.position, self.n_geometric],
            pdf_w,
            partials,
            parallel: false,
        }
    }

    /// Returns the density with which a camera subpath continues from `wo` in `wi`.
    fn camera_pdf_w(&self, rule: &Rule, directions: [Vec3; 2]) -> f32 {
        rule.camera_pdf_w(self.position, &self.bsdf, directions) as f32
    }

    /// Returns value and densities of a vertex of a camera subpath towards light in direction `wi`.
    fn towards_light(&self, rule: &Rule, wi: Vec3) -> BsdfValue<Vec3> {
        BsdfValue {
            pdf_w: self.camera_pdf_w(rule, [self.wo, wi]),
            ..self.bsdf.evaluate(self.wo, wi, TransportMode::Radiance)
        }
    }

    /// Returns value and densities of a vertex of a light subpath towards the camera in direction
    /// `wi`.
    fn towards_camera(&self, rule: &Rule, wi: Vec3) -> BsdfValue<Vec3> {
        BsdfValue {
            reverse_pdf_w: self.camera_pdf_w(rule, [wi, self.wo]),
            ..self.bsdf.evaluate(self.wo, wi, TransportMode::Importance)
        }
    }

    /// Returns the quantities of the vertex for a connection.
    fn connected(&self, rule: &Rule) -> MisEndpoint {
        let MisEndpoint { partials, back } = self.endpoint;
        MisEndpoint {
            partials: partials.with_merging(rule.heuristic, &rule.counts),
            back,
        }
    }
}

/// Returns the result of a computation in one lane if its mask is set.
fn existing<T>((exists, result): (bool, T)) -> Option<T> {
    exists.then_some(result)
}

/// Returns the weights of all strategies as `bdpt` and `vcm` compute them when they find the path
/// that way.
pub fn fast_weights(context: &Context, rule: &Rule, path: &Path) -> ByStrategy {
    let k = path.depth();
    let weight = |others: Option<f64>| others.map_or(0.0, |others| 1.0 / (1.0 + others));
    let connection = |s: usize| {
        let count = rule.counts.of(s as u32, (k + 1 - s) as u32);
        // Strategies that take no samples have no weight.
        let others = others(context, rule, path, s).filter(|_| count > 0.0);
        weight(others.map(|others| others / rule.heuristic.term(count)))
    };
    ByStrategy {
        connections: (0..=k).map(connection).collect(),
        merges: (0..k)
            .map(|i| weight(others_merged(context, rule, path, i)))
            .collect(),
    }
}

/// Returns the sum of the terms of all other strategies over that of merging at `x_i`; `None` if
/// that cannot find the path.
fn others_merged(context: &Context, rule: &Rule, path: &Path, i: usize) -> Option<f64> {
    if i == 0 || path.is_dirac(i) || rule.counts.merging == 0.0 {
        return None;
    }
    let y = light_side(context, rule, path, i + 1)?;
    let z = camera_side(context, rule, path, i)?.0?;
    let wi = -path.dirs[i - 1];
    let at_z = z.towards_light(rule, wi);
    let ends = [&y.endpoint, &z.endpoint];
    Some(others_merging(rule.heuristic, &rule.counts, ends, &at_z))
}

/// Returns the sum of the terms of all other strategies over that of `s`; `None` if `s` cannot find
/// the path.
fn others(context: &Context, rule: &Rule, path: &Path, s: usize) -> Option<f64> {
    let h = rule.heuristic;
    let k = path.depth();
    if s >= 1 && (path.is_dirac(s - 1) || path.is_dirac(s)) {
        return None;
    }
    let distance = path.lens_distance() as f32;
    let seen_pdf_w = context.camera.pdf_w_at(-path.dirs[k - 1], distance);
    let unseen = seen_pdf_w <= 0.0 || path.direction_is_certain(context);
    if s == k && unseen || path.light_is_dirac() && (s == 0 || k == 1) {
        return None;
    }
    let end = |next: [Vec3; 2]| light_end(context, path, next);
    let (camera, edge) = camera_side(context, rule, path, s.max(1))?;
    let light = light_side(context, rule, path, s);
    Some(match (s, light, camera) {
        (0, _, _) => {
            let partials = if path.outside() {
                existing(edge.distant_partials(h))?
            } else {
                let at = [path.light.position, path.light.normal];
                existing(edge.endpoint(h, at))?.partials
            };
            others_s0((h, &rule.counts), &partials, &end(edge.from), k as u32 + 1)
        }
        (1, _, None) => others_s1_t1(h, &end([path.lens, Vec3::ZERO]), seen_pdf_w),
        (1, _, Some(z)) => {
            let at_z = z.towards_light(rule, -path.dirs[0]);
            let end = end([z.position, z.n_geometric]);
            others_s1(h, &z.connected(rule), &end, &at_z)
        }
        (_, Some(y), Some(z)) => others_between(rule, &y, &z, path.dirs[s - 1]),
        (_, Some(y), None) => {
            let to = path.dirs[k - 1];
            let at_y = y.towards_camera(rule, to);
            let spread = vertex::area_factor(path.lens, y.position, y.n_geometric);
            others_t1(h, &y.connected(rule), &at_y, [seen_pdf_w, spread])
        }
        (_, None, _) => return None,
    })
}

/// Returns the densities at the light's end of a path whose next vertex is given by position and
/// normal.
fn light_end(context: &Context, path: &Path, next: [Vec3; 2]) -> LightEnd {
    let lights = context.lights.at(&path.light);
    let at = [path.light.position, path.light.normal];
    LightEnd::new(&lights, at, path.dirs[0], next)
}

/// Returns the sum for the strategy that connects two surface vertices; `dir` is the traced
/// direction from `y` to `z`.
fn others_between(rule: &Rule, y: &Vertex, z: &Vertex, dir: Vec3) -> f64 {
    let at_y = y.towards_camera(rule, dir);
    let at_z = z.towards_light(rule, -dir);
    // Use the direction between the points, as all strategies do; the traced direction starts off
    // the surface.
    let edge = y.position - z.position;
    let distance2 = edge.length_squared();
    let wi = edge / distance2.sqrt();
    let to = |v: &Vertex| wi.dot(v.n_geometric).abs() / distance2;
    others_interior(
        rule.heuristic,
        [&y.connected(rule), &z.connected(rule)],
        [&at_y, &at_z],
        [to(y), to(z)],
    )
}

/// Returns the last vertex of the light subpath `x_0 .. x_(s-1)`, if it is a surface.
fn light_side(context: &Context, rule: &Rule, path: &Path, s: usize) -> Option<Vertex> {
    let mut last: Option<Vertex> = None;
    for i in 1..s {
        let at = &path.surfaces[i - 1];
        let to = [at.position, at.n_geometric];
        let mode = TransportMode::Importance;
        let endpoint = existing(match &last {
            None => light_end(context, path, to).endpoint(rule.heuristic, &rule.counts),
            Some(v) => {
                let edge = v.next_edge(rule, mode, path.dirs[i - 1]);
                edge.endpoint(rule.heuristic, to)
            }
        })?;
        last = Some(Vertex::new(at, -path.dirs[i - 1], endpoint, |eta| {
            1.0 / eta
        }));
    }
    last
}

/// Returns the last vertex of the camera subpath `x_k .. x_last`, if it is a surface, and the edge
/// after it; `None` if rounding leaves a vertex without a density.
fn camera_side(
    context: &Context,
    rule: &Rule,
    path: &Path,
    last: usize,
) -> Option<(Option<Vertex>, MisEdge)> {
    let k = path.depth();
    let mut edge = MisEdge::from_lens(context, &rule.counts, path.lens, -path.dirs[k - 1]);
    let mut end = None;
    for i in (last..k).rev() {
        let at = &path.surfaces[i - 1];
        let endpoint = existing(edge.endpoint(rule.heuristic, [at.position, at.n_geometric]))?;
        let v = Vertex::new(at, path.dirs[i], endpoint, |eta| eta);
        edge = v.next_edge(rule, TransportMode::Radiance, -path.dirs[i - 1]);
        end = Some(v);
    }
    Some((end, edge))
}
