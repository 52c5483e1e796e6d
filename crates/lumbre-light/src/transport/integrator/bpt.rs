//! Backward path tracing: a path starts at the camera, continues by BSDF sampling, and finds light
//! only by hitting an emitter [Kajiya 1986]. Slow if lights are small, but simple enough to serve
//! as the reference for all other integrators.

use super::nee::PathWalk;
use super::{Context, IntegratorRow};
use crate::scene::compile::NONE;
use crate::transport::bsdf::{Bsdf, TransportMode};
use crate::transport::contribution::Contribution;
use crate::transport::ray::Hit;
use crate::transport::sampler::Sampler;
use crate::value::schema::Table;

/// The table entry of this integrator.
pub const ROW: IntegratorRow = IntegratorRow {
    name: "bpt",
    long_name: "backward path tracing",
    revision: 3,
    doc: "Paths start at the camera and find light only by hitting it [Kajiya 1986].",
    params: Table {
        name: "BptParams",
        doc: "Parameters of `bpt`: none.",
        fields: &[],
    },
    splats: false,
    sample,
};

fn sample(
    context: &Context,
    pixel: [u32; 2],
    sampler: &mut Sampler,
    sink: &mut dyn FnMut(Contribution),
) {
    if context.timed() {
        PathWalk::<true>::follow(context, pixel, sampler, sink, step);
    } else {
        PathWalk::<false>::follow(context, pixel, sampler, sink, step);
    }
}

/// One step of a path: see [`StepFn`](super::nee::StepFn).
#[inline(always)]
pub fn step<'a, const TIMED: bool>(
    walk: &mut PathWalk<'a, TIMED>,
    context: &Context<'a>,
    pixel: [u32; 2],
    sampler: &mut Sampler,
    sink: &mut dyn FnMut(Contribution),
    depth: u32,
    hit: Option<Hit>,
) -> bool {
    let scene = context.scene;
    let ray = walk.state.ray;
    let Some(hit) = hit else {
        let radiance = context.lights.environment(ray.dir);
        let length = walk.path_time.escape_length(context, ray.dir);
        walk.contribute_hit(pixel, depth, radiance, 1.0, length, sink);
        return false;
    };
    // The last edge can only find light.
    if depth == context.max_depth && scene.emitter_of(hit.primitive, hit.instance) == NONE {
        return false;
    }
    let surface = walk
        .path_time
        .arrive(context, &ray, &hit, &mut walk.aux_rng);
    if walk
        .terminator
        .is_some_and(|o| !o.has_below(surface.position))
    {
        return false;
    }
    let wo = -ray.dir;
    let emitted = surface.emitted(&scene.textures, wo);
    let length = walk.path_time.optical().arrival();
    walk.contribute_hit(pixel, depth, emitted, 1.0, length, sink);
    if depth == context.max_depth || surface.ends_paths() {
        return false;
    }
    let bsdf = Bsdf::new(&surface, &scene.textures);
    let choice = sampler.next_1d();
    let Some(s) = bsdf.sample(wo, choice, sampler.next_2d(), TransportMode::Radiance) else {
        return false;
    };
    walk.scatter(context, sampler, depth, &surface, &s)
}
