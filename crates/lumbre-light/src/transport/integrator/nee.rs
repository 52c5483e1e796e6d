//! Backward path tracing with next event estimation: at every vertex whose BSDF has a density, the
//! path is also connected to a sampled point of a light. Light that the path hits by itself is
//! weighted against it.

use glam::Vec3;

use super::{Context, IntegratorRow, Settings, settings};
use crate::scene::compile::NONE;
use crate::transport::MAX_SURVIVAL;
use crate::transport::bsdf::{Bsdf, BsdfSample, Outgoing, TransportMode};
use crate::transport::contribution::Contribution;
use crate::transport::light::{DirectSample, SELECT_FIELD};
use crate::transport::mis;
use crate::transport::path_time;
use crate::transport::path_time::{AuxRng, PathTime};
use crate::transport::ray::{Hit, Ray};
use crate::transport::sampler::Sampler;
use crate::transport::surface::{Surface, TerminatorOffset};
use crate::transport::vertex;
use crate::value::schema::Table;

/// The table entry of this integrator.
pub const ROW: IntegratorRow = IntegratorRow {
    name: "nee",
    long_name: "backward path tracing with next event estimation",
    revision: 3,
    doc: "Paths start at the camera and are connected to a light at every vertex that is not \
          specular; light that they hit by themselves is weighted against it [Veach 1997, 9.2]. \
          With `mis = \"none\"` such light counts only if no connection could find it: seen \
          directly or after a specular event.",
    params: Table {
        name: "NeeParams",
        doc: "Parameters of `nee`.",
        fields: &[mis::FIELD, SELECT_FIELD, settings::LIGHTS],
    },
    splats: false,
    sample,
};

/// The last event of a path that light sampling could have replaced.
#[derive(Clone, Copy, Debug)]
pub struct LastScatter {
    /// Start of the edge after the event.
    pub from: Vec3,
    /// Density per solid angle of the sampled direction.
    pub pdf_w: f32,
}

/// Returns the weight of light that a path hit, given the density per solid angle with which light
/// sampling samples it.
#[inline]
fn hit_weight(
    settings: &Settings,
    last: Option<LastScatter>,
    pdf_w: impl FnOnce(Vec3) -> f32,
) -> f32 {
    match (last, settings.mis) {
        (None, _) => 1.0,
        (Some(_), None) => 0.0,
        (Some(last), Some(h)) => h.weight(last.pdf_w, pdf_w(last.from)),
    }
}

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

/// The state of a path on an edge, if neither time nor a terminator offset matters.
#[derive(Clone, Copy, Debug)]
pub struct PathState {
    /// Ray of the current edge.
    pub ray: Ray,
    /// Throughput: factor on light that the edge hits.
    pub throughput: Vec3,
    /// Product of the squared index ratios, which undoes the scaling of radiance by refraction so
    /// that roulette judges the expected contribution.
    pub eta_scale: f32,
    /// The last event; `None` from the camera, and after a specular event.
    pub last: Option<LastScatter>,
}

impl PathState {
    /// Returns the state of a path that starts with a camera ray.
    #[inline]
    pub fn from_camera(ray: Ray) -> PathState {
        PathState {
            ray,
            throughput: Vec3::ONE,
            eta_scale: 1.0,
            last: None,
        }
    }
}

/// A path being traced; tracks its optical length if `TIMED`.
pub struct PathWalk<'a, const TIMED: bool> {
    /// The state on the current edge.
    pub state: PathState,
    pub(super) terminator: Option<TerminatorOffset>,
    pub(super) aux_rng: AuxRng,
    /// The optical length.
    pub path_time: PathTime<'a, TIMED>,
}

/// One step of a path: handles the hit (or miss) of edge number `depth` and returns whether the
/// path continues.
pub type StepFn<const TIMED: bool> = for<'a> fn(
    &mut PathWalk<'a, TIMED>,
    &Context<'a>,
    [u32; 2],
    &mut Sampler,
    &mut dyn FnMut(Contribution),
    u32,
    Option<Hit>,
) -> bool;

impl<'a, const TIMED: bool> PathWalk<'a, TIMED> {
    /// Starts a path with a camera ray.
    #[inline]
    fn from_camera(context: &Context<'a>, ray: Ray, sampler: &Sampler) -> PathWalk<'a, TIMED> {
        let mut aux_rng = AuxRng::new::<TIMED>(sampler);
        let path_time = PathTime::<TIMED>::from_camera(context, &ray, aux_rng.emission(context));
        PathWalk {
            state: PathState::from_camera(ray),
            terminator: None,
            aux_rng,
            path_time,
        }
    }

    /// Resumes a path between two steps, in a scene without terminator offsets, delays and composed
    /// materials.
    #[inline]
    pub fn resume(
        state: PathState,
        path_time: PathTime<'a, TIMED>,
        sampler: &Sampler,
    ) -> PathWalk<'a, TIMED> {
        PathWalk {
            state,
            terminator: None,
            aux_rng: AuxRng::new::<TIMED>(sampler),
            path_time,
        }
    }

    /// Traces a path from the camera for as long as its steps, each a [`StepFn`], return true.
    #[inline(always)]
    pub(super) fn follow(
        context: &Context<'a>,
        pixel: [u32; 2],
        sampler: &mut Sampler,
        sink: &mut dyn FnMut(Contribution),
        step: impl Fn(
            &mut PathWalk<'a, TIMED>,
            &Context<'a>,
            [u32; 2],
            &mut Sampler,
            &mut dyn FnMut(Contribution),
            u32,
            Option<Hit>,
        ) -> bool,
    ) {
        let ray = context.camera.sample_ray(pixel, sampler);
        let mut walk = PathWalk::from_camera(context, ray, sampler);
        for depth in 1..=context.max_depth {
            let hit = context.trace.closest(&walk.state.ray, f32::INFINITY);
            if !step(&mut walk, context, pixel, sampler, sink, depth, hit) {
                break;
            }
        }
    }

    /// Continues from a surface, at the end of edge `depth`, in a sampled direction; returns false
    /// if Russian roulette or a zero weight ends the path.
    #[inline(always)]
    pub(super) fn scatter(
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
        self.path_time.scatter(surface.position, s.eta);
        self.state.ray = surface.spawn(s.wi);
        self.terminator = surface.terminator_into(s.wi);
        true
    }

    /// Contributes light that the path hit at the end of edge `depth`, with its MIS weight.
    #[inline(always)]
    pub(super) fn contribute_hit(
        &self,
        pixel: [u32; 2],
        depth: u32,
        radiance: Vec3,
        weight: f32,
        length: f64,
        sink: &mut dyn FnMut(Contribution),
    ) {
        if radiance != Vec3::ZERO {
            let unweighted = self.state.throughput * radiance;
            sink(Contribution {
                pixel,
                value: unweighted * weight,
                unweighted,
                s: 0,
                t: depth + 1,
                length,
            });
        }
    }

    /// Contributes light from outside the scene, which the ray of edge `depth` reached.
    #[inline(always)]
    fn contribute_environment(
        &self,
        context: &Context<'a>,
        pixel: [u32; 2],
        depth: u32,
        sink: &mut dyn FnMut(Contribution),
    ) {
        let (lights, dir) = (context.lights, self.state.ray.dir);
        let radiance = lights.environment(dir);
        if radiance != Vec3::ZERO {
            let pdf_w = |_| {
                if context.settings.all_lights {
                    lights.pdf_environment_one_w(dir)
                } else {
                    lights.pdf_environment_w(dir)
                }
            };
            let weight = hit_weight(context.settings, self.state.last, pdf_w);
            let length = self.path_time.escape_length(context, dir);
            self.contribute_hit(pixel, depth, radiance, weight, length, sink);
        }
    }

    /// Contributes the emission of the surface at the end of edge `depth`.
    #[inline(always)]
    fn contribute_emission(
        &self,
        context: &Context<'a>,
        surface: &Surface,
        pixel: [u32; 2],
        depth: u32,
        sink: &mut dyn FnMut(Contribution),
    ) {
        let (scene, lights) = (context.scene, context.lights);
        let emitted = surface.emitted(&scene.textures, -self.state.ray.dir);
        if emitted != Vec3::ZERO {
            let pdf_w = |from| {
                let (i, at, n) = (surface.emitter, surface.position, surface.n_geometric);
                if context.settings.all_lights {
                    lights.pdf_direct_one_w(scene, from, i, at, n)
                } else {
                    lights.pdf_direct_w(scene, from, i, at, n)
                }
            };
            let weight = hit_weight(context.settings, self.state.last, pdf_w);
            let length = self.path_time.optical().arrival();
            self.contribute_hit(pixel, depth, emitted, weight, length, sink);
        }
    }

    /// Contributes sampled light at a surface: from its base and, if it has a terminator offset,
    /// from its lifted point; from one light or from each in turn.
    #[inline(always)]
    fn sample_lights(
        &self,
        context: &Context<'a>,
        (surface, bsdf, out): (&Surface<'a>, &Bsdf, &Outgoing),
        pixel: [u32; 2],
        depth: u32,
        sampler: &mut Sampler,
        sink: &mut dyn FnMut(Contribution),
    ) {
        let (scene, lights) = (context.scene, context.lights);
        let mut connect = |surface: &Surface, direct: Option<DirectSample>| {
            if let Some(direct) = direct
                && let Some((radiance, weight)) =
                    connect_light(context, surface, bsdf, out, &direct)
            {
                let unweighted = self.state.throughput * radiance;
                let length = path_time::direct_length(
                    context,
                    &self.path_time.optical(),
                    bsdf,
                    out.wo,
                    surface.position,
                    (direct.wi, direct.distance),
                );
                sink(Contribution {
                    pixel,
                    value: unweighted * weight,
                    unweighted,
                    s: 1,
                    t: depth + 1,
                    length,
                });
            }
        };
        for surface in std::iter::once(*surface).chain(surface.lifted()) {
            let from = surface.position;
            if context.settings.all_lights {
                for light in lights.indices() {
                    let u = sampler.next_2d();
                    connect(&surface, lights.sample_direct_from(scene, light, from, u));
                }
            } else {
                let (choice, u) = (sampler.next_1d(), sampler.next_2d());
                connect(&surface, lights.sample_direct(scene, from, choice, u));
            }
        }
    }
}

/// One step of a path: see [`StepFn`].
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
        walk.contribute_environment(context, pixel, depth, sink);
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
    walk.contribute_emission(context, &surface, pixel, depth, sink);
    if depth == context.max_depth || surface.ends_paths() {
        return false;
    }
    let bsdf = Bsdf::new(&surface, &scene.textures);
    let out = bsdf.outgoing(-ray.dir);
    if bsdf.has_density() {
        let at = (&surface, &bsdf, &out);
        walk.sample_lights(context, at, pixel, depth, sampler, sink);
    }
    let choice = sampler.next_1d();
    let Some(s) = bsdf.sample_from(&out, choice, sampler.next_2d(), TransportMode::Radiance) else {
        return false;
    };
    if !walk.scatter(context, sampler, depth, &surface, &s) {
        return false;
    }
    let from = walk.terminator.map_or(surface.position, |o| o.lifted_point);
    walk.state.last = (!s.delta).then_some(LastScatter {
        from,
        pdf_w: s.pdf_w,
    });
    true
}

/// Returns the radiance that leaves along `out` for light that arrives from a sampled point, and
/// its weight; `None` in shadow.
fn connect_light(
    context: &Context,
    surface: &Surface,
    bsdf: &Bsdf,
    out: &Outgoing,
    direct: &DirectSample,
) -> Option<(Vec3, f32)> {
    let (f, pdf_w) = bsdf.evaluate_forward(out, direct.wi, TransportMode::Radiance);
    let radiance = f * direct.wi.dot(surface.n_shading).abs() * direct.radiance / direct.pdf_w;
    let refused = surface.terminator.is_some_and(|o| o.excludes(direct));
    if refused || radiance == Vec3::ZERO || direct.pdf_w <= 0.0 {
        return None;
    }
    let lit = if direct.distance.is_finite() {
        let light = direct.point;
        vertex::visible(
            context.trace,
            surface.position,
            surface.n_geometric,
            light.position,
            light.normal,
        )
    } else {
        vertex::unobstructed(
            context.trace,
            surface.position,
            surface.n_geometric,
            direct.wi,
        )
    };
    lit.then(|| {
        let weight = match context.settings.mis {
            Some(h) if !direct.delta => h.weight(direct.pdf_w, pdf_w),
            _ => 1.0,
        };
        (radiance, weight)
    })
}
