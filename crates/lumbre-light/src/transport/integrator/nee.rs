//! Path tracing with next event estimation: at every vertex whose BSDF has a density, the
//! path is also connected to a sampled point of a light. Light that the path hits by itself is
//! weighted against it.

use glam::Vec3;

use super::camera_path::{
    self, Arrival, CameraPaths, Path, PathLight, PathSink, ShadowRay, edge_counts,
};
use super::directions::{Directions, SurfaceDirections};
use super::{Context, IntegratorRow, settings};
use crate::math::real::{Double, Mask, Real, Vector};
use crate::math::simd::Lanes;
use crate::transport::bsdf::{Bsdf, Outgoing, TransportMode};
use crate::transport::light::{COMPENSATE, DirectSample, SELECT_FIELD};
use crate::transport::mis;
use crate::transport::path_time::OpticalLength;
use crate::transport::surface::Surface;
use crate::value::schema::Table;

/// The table entry of this integrator.
pub const ROW: IntegratorRow = IntegratorRow {
    name: "nee",
    long_name: "path tracing with next event estimation",
    revision: 4,
    doc: "Paths start at the camera and are connected to a light at every vertex that is not \
          specular; light that they hit by themselves is weighted against it [Veach 1997, 9.2]. \
          With `mis = \"none\"` such light counts only if no connection could find it: seen \
          directly or after a specular event.",
    params: Table {
        name: "NeeParams",
        doc: "Parameters of `nee`.",
        fields: &[
            mis::FIELD,
            SELECT_FIELD,
            COMPENSATE,
            settings::LIGHTS,
            settings::DIRECTIONS,
        ],
    },
    splats: false,
    bias: None,
    sharing: None,
    sample: camera_path::sample::<Nee>,
};

/// Path tracing with next event estimation.
pub struct Nee;

impl CameraPaths for Nee {
    #[inline(always)]
    fn scatter<R: Lanes<N>, const N: usize>(
        context: &Context,
        edge: u32,
        arrival: &Arrival<R, N>,
        path: &mut Path<R>,
        lanes: R::Mask,
        sink: &mut impl PathSink<R>,
    ) -> R::Mask {
        scatter::<R, N, SurfaceDirections<R>, true>(context, edge, arrival, path, lanes, sink)
    }

    #[inline(always)]
    fn escape<R: Lanes<N>, const N: usize>(
        context: &Context,
        edge: u32,
        path: &Path<R>,
        lanes: R::Mask,
        sink: &mut impl PathSink<R>,
    ) {
        escape::<R, N, true>(context, edge, path, lanes, sink);
    }
}

/// Returns the weight of light that paths hit, given the density per solid angle with which light
/// sampling samples it from their last vertices, which is used only if it [is
/// needed](needs_density).
#[inline(always)]
fn hit_weight<R: Real>(context: &Context, path: &Path<R>, pdf_w: R) -> R {
    let weight = match context.settings.mis {
        None if context.settings.all_hits => R::splat(1.0),
        None => R::splat(0.0),
        Some(h) => h.weight(path.state.last_pdf_w, pdf_w),
    };
    R::select(path.is_specular(), R::splat(1.0), weight)
}

/// Returns whether the weight of light that paths hit depends on the density of light sampling.
#[inline(always)]
fn needs_density<R: Real>(context: &Context, path: &Path<R>) -> bool {
    context.settings.mis.is_some() && (!path.is_specular()).any()
}

/// Handles paths that left the scene: see [`CameraPaths::escape`]. With `LIGHTS` the light is
/// weighted against light sampling.
#[inline(always)]
pub(super) fn escape<R: Lanes<N>, const N: usize, const LIGHTS: bool>(
    context: &Context,
    edge: u32,
    path: &Path<R>,
    lanes: R::Mask,
    sink: &mut impl PathSink<R>,
) {
    let (lights, dir) = (context.lights, path.state.dir);
    let radiance = lights.environment::<R::Vec3, N>(dir);
    let lit = lanes & !radiance.same(R::Vec3::broadcast(Vec3::ZERO));
    if !lit.any() {
        return;
    }
    // No closure here: it would not be compiled for the instructions of the vectors.
    let mut weight = R::splat(1.0);
    if LIGHTS {
        let mut pdf_w = R::splat(0.0);
        if needs_density(context, path) {
            pdf_w = if context.settings.all_lights {
                lights.pdf_environment_one_w::<R::Vec3, N>(dir)
            } else {
                lights.pdf_environment_w::<R::Vec3, N>(dir)
            };
        }
        weight = hit_weight(context, path, pdf_w);
    }
    let length = path.escape_length(context, edge);
    path.add_hit_light(edge, radiance, weight, length, lit, sink);
}

/// Handles hits: see [`CameraPaths::scatter`]. With `LIGHTS` vertices are connected to sampled
/// lights; without, paths find light only by hitting it. Paths continue in directions of `D`.
#[inline(always)]
pub(super) fn scatter<R: Lanes<N>, const N: usize, D: Directions<R, N>, const LIGHTS: bool>(
    context: &Context,
    edge: u32,
    arrival: &Arrival<R, N>,
    path: &mut Path<R>,
    mut lanes: R::Mask,
    sink: &mut impl PathSink<R>,
) -> R::Mask {
    let none = R::Mask::default();
    let surface = arrival.surface(context.scene);
    if let Some(terminator) = &path.terminator {
        lanes = lanes & terminator.allows(surface.position);
    }
    let counts = edge_counts(context, edge);
    let optical = path.arrive(context, counts, arrival, &surface, lanes);
    let wo = -path.state.dir;
    if arrival.class.surface.emits {
        let length = match &optical {
            None => R::Double::splat(0.0),
            Some(optical) => optical.arrival(),
        };
        add_emission::<R, N, LIGHTS>(context, edge, path, &surface, length, lanes, sink);
    }
    lanes = lanes & !surface.ends_paths();
    if edge == context.max_depth || !lanes.any() {
        return none;
    }
    let parameters = arrival.parameters(context.scene, &surface);
    let bsdf = arrival.bsdf(context.classes, &surface, parameters.as_ref());
    let out = bsdf.outgoing(wo);
    let n = surface.n_shading;
    let vertex = (&bsdf, &out, n);
    let directions = D::at(
        context,
        surface.position,
        vertex,
        lanes & bsdf.has_density(),
    );
    if LIGHTS {
        let connected = lanes & bsdf.has_density();
        if connected.any() {
            let connections = Vertex {
                edge,
                bsdf: &bsdf,
                out: &out,
                directions: &directions,
                optical: optical.as_ref(),
            };
            connections.connect_to_lights(context, surface, path, connected, sink);
        }
    }
    let numbers = path.sampler.next_three();
    let (sampled, s) = directions.sample(context, vertex, numbers, lanes);
    path.continue_from(context, edge, &surface, optical, &s, lanes & sampled)
}

/// Adds the emission of the surfaces that edges hit. With `LIGHTS` it is weighted against light
/// sampling.
#[inline(always)]
pub(super) fn add_emission<R: Lanes<N>, const N: usize, const LIGHTS: bool>(
    context: &Context,
    edge: u32,
    path: &Path<R>,
    surface: &Surface<R, N>,
    length: R::Double,
    lanes: R::Mask,
    sink: &mut impl PathSink<R>,
) {
    let radiance = surface.emitted(&context.scene.textures, -path.state.dir);
    let lit = lanes & !radiance.same(R::Vec3::broadcast(Vec3::ZERO));
    if !lit.any() {
        return;
    }
    let mut weight = R::splat(1.0);
    if LIGHTS {
        let mut pdf_w = R::splat(0.0);
        if needs_density(context, path) {
            let emitters = R::store_words(surface.emitter);
            let lights = context.lights.with_indices(emitters, lit);
            let (from, at, n) = (path.state.last, surface.position, surface.n_geometric);
            pdf_w = if context.settings.all_lights {
                lights.pdf_direct_one_w(from, at, n)
            } else {
                lights.pdf_direct_w(from, at, n)
            };
        }
        weight = hit_weight(context, path, pdf_w);
    }
    path.add_hit_light(edge, radiance, weight, length, lit, sink);
}

/// Vertices at the end of edge number `edge`, which are connected to lights.
struct Vertex<'a, R: Real, D> {
    edge: u32,
    bsdf: &'a Bsdf<R>,
    out: &'a Outgoing<R>,
    directions: &'a D,
    optical: Option<&'a OpticalLength<R>>,
}

impl<R: Real, D> Vertex<'_, R, D> {
    /// Connects vertices to sampled lights: to one each, or to each light in turn; first from the
    /// surface, then from the lifted point of surfaces that have one.
    #[inline(always)]
    fn connect_to_lights<const N: usize>(
        &self,
        context: &Context,
        mut surface: Surface<R, N>,
        path: &mut Path<R>,
        mut lanes: R::Mask,
        sink: &mut impl PathSink<R>,
    ) where
        R: Lanes<N>,
        D: Directions<R, N>,
    {
        let all_lights = context.settings.all_lights;
        let count = if all_lights {
            context.lights.count() as u32
        } else {
            1
        };
        // One loop, since every call is compiled into the kernel once more.
        let mut light = 0;
        while lanes.any() && light < count {
            let before = path.sampler;
            let (lights, u) = if all_lights {
                let u = path.sampler.next_2d();
                (context.lights.with_indices([light; N], lanes), u)
            } else {
                let [choice, u, v] = path.sampler.next_three();
                let from = surface.position;
                (context.lights.select_for(from, choice, lanes), [u, v])
            };
            path.sampler.keep(lanes, &before);
            let mut direct = lights.sample_direct_one(context.scene, surface.position, u);
            if !all_lights {
                direct.pdf_w = direct.pdf_w * lights.chosen;
            }
            self.connect(
                context,
                &surface,
                path.state.throughput,
                &direct,
                lanes,
                sink,
            );
            light += 1;
            if light == count
                && let Some(lifted) = surface.lifted_once()
            {
                lanes = lanes & lifted.lifted_lanes();
                (surface, light) = (lifted, 0);
            }
        }
    }

    /// Connects vertices to points of lights.
    #[inline(always)]
    fn connect<const N: usize>(
        &self,
        context: &Context,
        surface: &Surface<R, N>,
        throughput: R::Vec3,
        direct: &DirectSample<R, N>,
        lanes: R::Mask,
        sink: &mut impl PathSink<R>,
    ) where
        R: Lanes<N>,
        D: Directions<R, N>,
    {
        let mut lanes = lanes & direct.arrives() & self.out.same_side;
        if let Some(offset) = &surface.terminator {
            lanes = lanes & !offset.excludes(direct);
        }
        if !lanes.any() {
            return;
        }
        let wi = direct.wi;
        let value = self
            .bsdf
            .values::<false>(self.out, wi, TransportMode::Radiance, lanes);
        let cos = wi.dot(surface.n_shading).abs();
        let radiance = value.f * cos * direct.radiance / direct.pdf_w;
        let lit = lanes & !radiance.same(R::Vec3::broadcast(Vec3::ZERO));
        if !lit.any() {
            return;
        }
        let one = R::splat(1.0);
        let weight = match context.settings.mis {
            Some(h) => {
                let pdf_w = self.directions.pdf_w(context, wi, value.pdf_w, lit);
                R::select(direct.delta, one, h.weight(direct.pdf_w, pdf_w))
            }
            None => one,
        };
        let infinite = direct.is_infinite();
        let ray = ShadowRay::between(surface.end(), direct.point.end(), wi, infinite);
        let length = match self.optical {
            None => R::Double::splat(0.0),
            Some(optical) => {
                let ratio = self.bsdf.index_ratio(self.out.wo, wi);
                optical.direct_arrival(context, surface.position, direct, ratio)
            }
        };
        let light = PathLight {
            unweighted: throughput * radiance,
            weight,
            s: 1,
            t: self.edge + 1,
            length,
        };
        sink.add_unless_occluded(lit, &ray, &light);
    }
}
