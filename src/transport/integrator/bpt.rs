//! Backward path tracing: a path starts at the camera, is continued by sampling the BSDF, and finds light only by
//! hitting an emitter [Kajiya 1986]. Slow where lights are small, simple enough to be the judge of everything else.

use glam::Vec3;

use super::{Context, IntegratorRow};
use crate::scene::compile::NONE;
use crate::transport::MAX_SURVIVAL;
use crate::transport::bsdf::{Bsdf, Mode};
use crate::transport::contribution::Contribution;
use crate::transport::flight::{Chance, Flight};
use crate::transport::sampler::Sampler;
use crate::transport::surface::Overhang;
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
        path::<true>(context, pixel, sampler, sink);
    } else {
        path::<false>(context, pixel, sampler, sink);
    }
}

fn path<const TIMED: bool>(
    context: &Context,
    pixel: [u32; 2],
    sampler: &mut Sampler,
    sink: &mut dyn FnMut(Contribution),
) {
    let scene = context.scene;
    let mut ray = context.camera.sample_ray(pixel, sampler);
    let mut chance = Chance::new::<TIMED>(sampler);
    let mut flight = Flight::<TIMED>::of_camera(context, &ray, chance.emission(context));
    let mut throughput = Vec3::ONE;
    // Undoes the scaling of radiance by refraction, so that roulette judges what the path will bring back.
    let mut eta_scale = 1.0f32;
    let mut over: Option<Overhang> = None;
    for depth in 1..=context.max_depth {
        let mut found = |radiance: Vec3, length: f64| {
            if radiance != Vec3::ZERO {
                let value = throughput * radiance;
                sink(Contribution { pixel, value, unweighted: value, s: 0, t: depth + 1, length });
            }
        };
        let Some(hit) = context.trace.closest(&ray, f32::INFINITY) else {
            found(context.lights.environment(ray.dir), flight.escaped(context, ray.dir));
            break;
        };
        // The last edge finds light or nothing.
        if depth == context.max_depth && scene.emitter_of(hit.primitive, hit.instance) == NONE {
            break;
        }
        let surface = flight.arrive(context, &ray, &hit, &mut chance);
        if over.is_some_and(|o| !o.reaches(surface.position)) {
            break;
        }
        let wo = -ray.dir;
        found(surface.emitted(&scene.textures, wo), flight.stamp().arrived());
        if depth == context.max_depth || (surface.emitter != NONE && !surface.material.emitter_reflects) {
            break;
        }
        let bsdf = Bsdf::new(&surface, &scene.textures);
        let choice = sampler.next_1d();
        let Some(s) = bsdf.sample(wo, choice, sampler.next_2d(), Mode::Radiance) else { break };
        throughput *= s.weight;
        eta_scale *= s.eta * s.eta;
        if context.rr_start.is_some_and(|start| depth >= start) {
            let survival = (throughput.max_element() * eta_scale).min(MAX_SURVIVAL);
            if sampler.next_1d() >= survival {
                break;
            }
            throughput /= survival;
        }
        if throughput == Vec3::ZERO {
            break;
        }
        flight.leave(surface.position, s.eta);
        ray = surface.spawn(s.wi);
        over = surface.overhang_into(s.wi);
    }
}
