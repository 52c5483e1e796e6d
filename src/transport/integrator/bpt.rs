//! Backward path tracing: a path starts at the camera, is continued by sampling the BSDF, and finds light only by
//! hitting an emitter [Kajiya 1986]. Slow where lights are small, simple enough to be the judge of everything else.

use glam::Vec3;

use super::nee::{State, Walk};
use super::{Context, IntegratorRow};
use crate::scene::compile::NONE;
use crate::transport::bsdf::{Bsdf, Mode};
use crate::transport::contribution::Contribution;
use crate::transport::ray::Hit;
use crate::transport::sampler::Sampler;
use crate::value::schema::Table;

/// The row of this integrator.
pub const ROW: IntegratorRow = IntegratorRow {
    name: "bpt",
    long_name: "backward path tracing",
    revision: 3,
    doc: "Paths start at the camera and find light only by hitting it [Kajiya 1986].",
    params: Table { name: "BptParams", doc: "Parameters of `bpt`: none.", fields: &[] },
    splats: false,
    sample,
};

fn sample(context: &Context, pixel: [u32; 2], sampler: &mut Sampler, sink: &mut dyn FnMut(Contribution)) {
    if context.timed() {
        Walk::<true>::follow(context, pixel, sampler, sink, step);
    } else {
        Walk::<false>::follow(context, pixel, sampler, sink, step);
    }
}

/// A [`StepFn`](super::nee::StepFn).
#[inline(always)]
pub fn step<'a, const TIMED: bool>(
    walk: &mut Walk<'a, TIMED>,
    context: &Context<'a>,
    pixel: [u32; 2],
    sampler: &mut Sampler,
    sink: &mut dyn FnMut(Contribution),
    depth: u32,
    hit: Option<Hit>,
) -> bool {
    let scene = context.scene;
    let Walk { state, over, chance, flight } = walk;
    let State { ray, throughput, .. } = *state;
    let mut found = |radiance: Vec3, length: f64| {
        if radiance != Vec3::ZERO {
            let value = throughput * radiance;
            sink(Contribution { pixel, value, unweighted: value, s: 0, t: depth + 1, length });
        }
    };
    let Some(hit) = hit else {
        found(context.lights.environment(ray.dir), flight.escaped(context, ray.dir));
        return false;
    };
    // The last edge finds light or nothing.
    if depth == context.max_depth && scene.emitter_of(hit.primitive, hit.instance) == NONE {
        return false;
    }
    let surface = flight.arrive(context, &ray, &hit, chance);
    if over.is_some_and(|o| !o.reaches(surface.position)) {
        return false;
    }
    let wo = -ray.dir;
    found(surface.emitted(&scene.textures, wo), flight.stamp().arrived());
    if depth == context.max_depth || (surface.emitter != NONE && !surface.material.emitter_reflects) {
        return false;
    }
    let bsdf = Bsdf::new(&surface, &scene.textures);
    let choice = sampler.next_1d();
    let Some(s) = bsdf.sample(wo, choice, sampler.next_2d(), Mode::Radiance) else { return false };
    walk.leave(context, sampler, depth, &surface, &s)
}
