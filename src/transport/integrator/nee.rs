//! Backward path tracing with next event estimation: at every vertex where the BSDF has a density the path is also
//! connected to a sampled point of a light. Light that the path then meets by itself counts with its share.

use glam::Vec3;

use super::{Context, IntegratorRow, Settings, settings};
use crate::scene::compile::NONE;
use crate::transport::MAX_SURVIVAL;
use crate::transport::bsdf::{Bsdf, BsdfSample, Mode, Outgoing};
use crate::transport::contribution::Contribution;
use crate::transport::flight::{self, Chance, Flight};
use crate::transport::light::{DirectSample, SELECT_FIELD};
use crate::transport::mis;
use crate::transport::ray::{Hit, Ray};
use crate::transport::sampler::Sampler;
use crate::transport::surface::{Overhang, Surface};
use crate::transport::vertex;
use crate::value::schema::Table;

/// The row of this integrator.
pub const ROW: IntegratorRow = IntegratorRow {
    name: "nee",
    long_name: "backward path tracing with next event estimation",
    revision: 3,
    doc: "Paths start at the camera and are connected to a light at every vertex that is not specular; light that they \
          meet by themselves is weighted against it [Veach 1997, 9.2]. With `mis = \"none\"` such light counts only \
          where no connection could find it: seen directly or after a specular event.",
    params: Table {
        name: "NeeParams",
        doc: "Parameters of `nee`.",
        fields: &[mis::FIELD, SELECT_FIELD, settings::LIGHTS],
    },
    splats: false,
    sample,
};

/// The event that sent a path on its way, as far as light sampling could have done the same.
#[derive(Clone, Copy, Debug)]
pub struct Last {
    /// Where it went on.
    pub from: Vec3,
    /// Density per solid angle of the direction that it took.
    pub pdf_w: f32,
}

/// The weight of light that a path met by chance, given the density per solid angle with which light sampling finds it.
#[inline]
fn weight_of_hit(settings: &Settings, last: Option<Last>, pdf_w: impl FnOnce(Vec3) -> f32) -> f32 {
    match (last, settings.mis) {
        (None, _) => 1.0,
        (Some(_), None) => 0.0,
        (Some(last), Some(h)) => h.weight(last.pdf_w, pdf_w(last.from)),
    }
}

fn sample(context: &Context, pixel: [u32; 2], sampler: &mut Sampler, sink: &mut dyn FnMut(Contribution)) {
    if context.timed() {
        Walk::<true>::follow(context, pixel, sampler, sink, step);
    } else {
        Walk::<false>::follow(context, pixel, sampler, sink, step);
    }
}

/// What a path brings to its next vertex, where neither time nor an overhang matters.
#[derive(Clone, Copy, Debug)]
pub struct State {
    /// The ray on which it is.
    pub ray: Ray,
    /// What light counts that it meets.
    pub throughput: Vec3,
    /// Undoes the scaling of radiance by refraction, so that roulette judges what the path will bring back.
    pub eta_scale: f32,
    /// What sent it there; `None` from the camera, and after a specular event.
    pub last: Option<Last>,
}

impl State {
    /// Of a path that begins.
    #[inline]
    pub fn of_camera(ray: Ray) -> State {
        State { ray, throughput: Vec3::ONE, eta_scale: 1.0, last: None }
    }
}

/// A path on its way, with a clock where it is `TIMED`.
pub struct Walk<'a, const TIMED: bool> {
    /// What it brings to its next vertex.
    pub state: State,
    pub(super) over: Option<Overhang>,
    pub(super) chance: Chance,
    /// The clock.
    pub flight: Flight<'a, TIMED>,
}

/// One step of a path: what happens where the ray of this edge met something, or nothing; whether the path goes on from there.
pub type StepFn<const TIMED: bool> = for<'a> fn(
    &mut Walk<'a, TIMED>,
    &Context<'a>,
    [u32; 2],
    &mut Sampler,
    &mut dyn FnMut(Contribution),
    u32,
    Option<Hit>,
) -> bool;

impl<'a, const TIMED: bool> Walk<'a, TIMED> {
    #[inline]
    fn of_camera(context: &Context<'a>, ray: Ray, sampler: &Sampler) -> Walk<'a, TIMED> {
        let mut chance = Chance::new::<TIMED>(sampler);
        let flight = Flight::<TIMED>::of_camera(context, &ray, chance.emission(context));
        Walk { state: State::of_camera(ray), over: None, chance, flight }
    }

    /// A path between two steps, in a scene without overhangs, delays and composed materials.
    #[inline]
    pub fn resumed(state: State, flight: Flight<'a, TIMED>, sampler: &Sampler) -> Walk<'a, TIMED> {
        Walk { state, over: None, chance: Chance::new::<TIMED>(sampler), flight }
    }

    /// Follows a path from the camera for as long as its steps, each a [`StepFn`], say that it goes on.
    #[inline(always)]
    pub(super) fn follow(
        context: &Context<'a>,
        pixel: [u32; 2],
        sampler: &mut Sampler,
        sink: &mut dyn FnMut(Contribution),
        step: impl Fn(
            &mut Walk<'a, TIMED>,
            &Context<'a>,
            [u32; 2],
            &mut Sampler,
            &mut dyn FnMut(Contribution),
            u32,
            Option<Hit>,
        ) -> bool,
    ) {
        let ray = context.camera.sample_ray(pixel, sampler);
        let mut walk = Walk::of_camera(context, ray, sampler);
        for depth in 1..=context.max_depth {
            let hit = context.trace.closest(&walk.state.ray, f32::INFINITY);
            if !step(&mut walk, context, pixel, sampler, sink, depth, hit) {
                break;
            }
        }
    }

    /// Goes on from a surface, at the end of edge `depth`, in a sampled direction, as far as Russian roulette lets it; whether it
    /// does.
    #[inline(always)]
    pub(super) fn leave(
        &mut self,
        context: &Context<'a>,
        sampler: &mut Sampler,
        depth: u32,
        surface: &Surface,
        s: &BsdfSample,
    ) -> bool {
        let state = &mut self.state;
        state.throughput *= s.weight;
        state.eta_scale *= s.eta * s.eta;
        if context.rr_start.is_some_and(|start| depth >= start) {
            let survival = (state.throughput.max_element() * state.eta_scale).min(MAX_SURVIVAL);
            if sampler.next_1d() >= survival {
                return false;
            }
            state.throughput /= survival;
        }
        if state.throughput == Vec3::ZERO {
            return false;
        }
        self.flight.leave(surface.position, s.eta);
        self.state.ray = surface.spawn(s.wi);
        self.over = surface.overhang_into(s.wi);
        true
    }
}

/// A [`StepFn`].
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
    let Context { scene, lights, settings, .. } = *context;
    let Walk { state, over, chance, flight } = walk;
    let State { ray, throughput, last, .. } = *state;
    let mut found = |radiance: Vec3, weight: f32, length: f64| {
        if radiance != Vec3::ZERO {
            let unweighted = throughput * radiance;
            sink(Contribution { pixel, value: unweighted * weight, unweighted, s: 0, t: depth + 1, length });
        }
    };
    let Some(hit) = hit else {
        let radiance = lights.environment(ray.dir);
        if radiance != Vec3::ZERO {
            let pdf_w = |_| {
                if settings.all_lights {
                    lights.pdf_environment_one_w(ray.dir)
                } else {
                    lights.pdf_environment_w(ray.dir)
                }
            };
            found(radiance, weight_of_hit(settings, last, pdf_w), flight.escaped(context, ray.dir));
        }
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
    let emitted = surface.emitted(&scene.textures, wo);
    if emitted != Vec3::ZERO {
        let pdf_w = |from| {
            let (i, at, n) = (surface.emitter, surface.position, surface.n_geometric);
            if settings.all_lights {
                lights.pdf_direct_one_w(scene, from, i, at, n)
            } else {
                lights.pdf_direct_w(scene, from, i, at, n)
            }
        };
        found(emitted, weight_of_hit(settings, last, pdf_w), flight.stamp().arrived());
    }
    if depth == context.max_depth || (surface.emitter != NONE && !surface.material.emitter_reflects) {
        return false;
    }
    let bsdf = Bsdf::new(&surface, &scene.textures);
    let out = bsdf.outgoing(wo);
    if bsdf.has_density() {
        let mut join = |surface: &Surface, direct: Option<DirectSample>| {
            if let Some(direct) = direct
                && let Some((radiance, weight)) = connect(context, surface, &bsdf, &out, &direct)
            {
                let unweighted = throughput * radiance;
                let to = (direct.wi, direct.distance);
                let length = flight::of_direct(context, &flight.stamp(), &bsdf, wo, surface.position, to);
                sink(Contribution { pixel, value: unweighted * weight, unweighted, s: 1, t: depth + 1, length });
            }
        };
        for surface in std::iter::once(surface).chain(surface.raised()) {
            let from = surface.position;
            if settings.all_lights {
                for light in lights.each() {
                    join(&surface, lights.sample_direct_from(scene, light, from, sampler.next_2d()));
                }
            } else {
                let choice = sampler.next_1d();
                join(&surface, lights.sample_direct(scene, from, choice, sampler.next_2d()));
            }
        }
    }
    let choice = sampler.next_1d();
    let Some(s) = bsdf.sample_from(&out, choice, sampler.next_2d(), Mode::Radiance) else { return false };
    if !walk.leave(context, sampler, depth, &surface, &s) {
        return false;
    }
    let from = walk.over.map_or(surface.position, |o| o.crest);
    walk.state.last = (!s.delta).then_some(Last { from, pdf_w: s.pdf_w });
    true
}

/// Radiance that leaves along `out` for light that arrives from a sampled point, and its weight; `None` in shadow.
fn connect(
    context: &Context,
    surface: &Surface,
    bsdf: &Bsdf,
    out: &Outgoing,
    direct: &DirectSample,
) -> Option<(Vec3, f32)> {
    let (f, pdf_w) = bsdf.evaluate_forward(out, direct.wi, Mode::Radiance);
    let radiance = f * direct.wi.dot(surface.n_shading).abs() * direct.radiance / direct.pdf_w;
    let refused = surface.overhang.is_some_and(|o| o.refuses(direct));
    if refused || radiance == Vec3::ZERO || direct.pdf_w <= 0.0 {
        return None;
    }
    let lit = if direct.distance.is_finite() {
        let light = direct.point;
        vertex::visible(context.trace, surface.position, surface.n_geometric, light.position, light.normal)
    } else {
        vertex::unobstructed(context.trace, surface.position, surface.n_geometric, direct.wi)
    };
    lit.then(|| {
        let weight = match context.settings.mis {
            Some(h) if !direct.delta => h.weight(direct.pdf_w, pdf_w),
            _ => 1.0,
        };
        (radiance, weight)
    })
}
