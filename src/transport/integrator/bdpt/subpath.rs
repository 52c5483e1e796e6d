//! The two subpaths of a sample.

use glam::Vec3;

use super::weights::{Chain, LightEnd, Link, Side};
use crate::scene::compile::{NONE, Uv};
use crate::transport::MAX_SURVIVAL;
use crate::transport::bsdf::{Bsdf, BsdfSample, Mode, Outgoing};
use crate::transport::flight::{Chance, Flight, Stamp};
use crate::transport::integrator::Context;
use crate::transport::light::{EmissionSample, LightPoint};
use crate::transport::mis::Heuristic;
use crate::transport::ray::Ray;
use crate::transport::sampler::Sampler;
use crate::transport::surface::{Overhang, Surface};
use crate::transport::vertex;

/// A vertex on a surface, generated from the camera or from a light.
#[derive(Clone, Copy, Debug)]
pub struct Vertex {
    /// Position in world space.
    pub position: Vec3,
    /// Unit normal on the front side.
    pub n_geometric: Vec3,
    /// Unit shading normal on the same side.
    pub n_shading: Vec3,
    /// The direction to the vertex before, with what the BSDF knows of it.
    pub out: Outgoing,
    /// Position of the vertex before; meaningless for a light without a place.
    pub previous: Vec3,
    /// Unit normal of the vertex before; zero for a point of the lens or of an overhang.
    pub n_previous: Vec3,
    /// Turns a density per solid angle here into the other side's density of the vertex before; zero where the other
    /// side cannot generate it.
    pub back: f32,
    /// The BSDF.
    pub bsdf: Bsdf,
    /// Whether anything can be connected here: the BSDF has a density, and the surface does not end paths.
    pub connectible: bool,
    /// Where edges towards light leave that the triangle itself would hide.
    pub overhang: Option<Overhang>,
    /// Row of the scene's emitters, or [`NONE`].
    pub emitter: u32,
    /// Texture coordinates before tiling.
    pub uv: Uv,
    /// Radiance emitted towards the vertex before, of a camera subpath.
    pub emitted: Vec3,
    /// What the path carries here, over the density with which it came here.
    pub throughput: Vec3,
    /// What weights need.
    pub chain: Chain,
    /// Whether the event that led to the next vertex was a Dirac.
    pub delta: bool,
    /// Index ratio crossed by that event.
    pub eta: f32,
    /// When the path is here.
    pub stamp: Stamp,
}

/// Where an edge of a subpath comes from.
#[derive(Clone, Copy, Debug)]
pub enum Origin {
    /// The lens.
    Lens,
    /// A light.
    Light(LightPoint),
    /// A surface with this unit normal; zero for the crest of an overhang, where no path can arrive.
    Surface(Vec3),
}

impl Origin {
    /// The unit normal there; zero for a point of the lens or of an overhang.
    #[inline]
    pub fn normal(&self) -> Vec3 {
        match self {
            Origin::Lens => Vec3::ZERO,
            Origin::Light(point) => point.normal,
            Origin::Surface(n) => *n,
        }
    }
}

/// An edge of a subpath on its way to its next vertex.
#[derive(Clone, Copy, Debug)]
pub struct Edge {
    /// What it leaves.
    pub origin: Origin,
    /// Where.
    pub from: Vec3,
    /// Unit direction.
    pub dir: Vec3,
    /// Density per solid angle of the direction; of no use where a light is left.
    pub pdf_w: f64,
    /// What weights need.
    pub link: Link,
}

/// A camera subpath that left the scene.
#[derive(Clone, Copy, Debug)]
pub struct Escape {
    /// Its last edge.
    pub edge: Edge,
    /// What the path carries, over the density with which it came.
    pub throughput: Vec3,
    /// When light along it arrives.
    pub length: f64,
}

/// Both subpaths of a sample, kept for the next one so that nothing is allocated per path.
#[derive(Debug, Default)]
pub struct Subpaths {
    /// Vertices of the light subpath behind the light's own: the vertex `y_i` is at `i - 1`.
    pub light: Vec<Vertex>,
    /// Where the light subpath starts, if there is one.
    pub start: Option<EmissionSample>,
    /// Vertices of the camera subpath behind the lens: the vertex `z_i` is at `i - 1`.
    pub camera: Vec<Vertex>,
    /// The edge behind them, if it met nothing.
    pub escape: Option<Escape>,
    /// The point on the lens.
    pub lens: Vec3,
    /// When the light of this sample was emitted.
    pub emitted: f32,
}

/// The roulette of one subpath. The weights know nothing of it: see [`crate::transport::mis`].
struct Roulette {
    start: Option<u32>,
    /// What the path will bring back, as far as BSDFs tell.
    promise: Vec3,
}

impl Roulette {
    /// By what to divide what goes on behind edge `edge`, if it does.
    #[inline]
    fn play(&mut self, edge: u32, weight: Vec3, sampler: &mut Sampler) -> Option<f32> {
        self.promise *= weight;
        if self.start.is_none_or(|start| edge < start) {
            return Some(1.0);
        }
        let survival = self.promise.max_element().min(MAX_SURVIVAL);
        if sampler.next_1d() >= survival {
            return None;
        }
        self.promise /= survival;
        Some(survival)
    }
}

impl Subpaths {
    /// Both subpaths of a sample, of up to `context.max_depth` edges each; for `TIMED` see [`Flight`].
    pub fn trace<const TIMED: bool>(
        &mut self,
        context: &Context,
        h: Heuristic,
        pixel: [u32; 2],
        sampler: &mut Sampler,
    ) {
        let mut chance = self.trace_camera::<TIMED>(context, h, pixel, sampler);
        self.trace_light::<TIMED>(context, h, sampler, &mut chance);
    }

    /// The subpath from the camera; what is left of the numbers of parts and delays goes to the light's.
    fn trace_camera<const TIMED: bool>(
        &mut self,
        context: &Context,
        h: Heuristic,
        pixel: [u32; 2],
        sampler: &mut Sampler,
    ) -> Chance {
        self.camera.clear();
        let ray = context.camera.sample_ray(pixel, sampler);
        self.lens = ray.origin;
        let edge = Edge::from_lens(context, ray.origin, ray.dir);
        let departure = Departure { ray, edge, throughput: Vec3::ONE };
        let mut chance = Chance::new::<TIMED>(sampler);
        self.emitted = chance.emission(context);
        let flight = Flight::<TIMED>::of_camera(context, &ray, self.emitted);
        let mut going = Going { flight, sampler, chance: &mut chance };
        self.escape = walk(context, h, Mode::Radiance, departure, context.max_depth, &mut going, &mut self.camera);
        chance
    }

    /// The subpath from a light.
    fn trace_light<const TIMED: bool>(
        &mut self,
        context: &Context,
        h: Heuristic,
        sampler: &mut Sampler,
        chance: &mut Chance,
    ) {
        let max_edges = context.max_depth;
        self.light.clear();
        self.start = None;
        if max_edges == 0 {
            return;
        }
        let (choice, u, v) = (sampler.next_1d(), sampler.next_2d(), sampler.next_2d());
        self.start = context.lights.sample_emission(context.scene, choice, u, v);
        let Some(e) = self.start else { return };
        let throughput = e.radiance * e.cos / (e.pdf_a * e.pdf_w);
        if throughput == Vec3::ZERO || max_edges == 1 {
            return;
        }
        let edge = Edge::from_light(e.point, e.dir);
        let ray = vertex::leave(e.point.position, e.point.normal, e.dir);
        let departure = Departure { ray, edge, throughput };
        let flight = Flight::<TIMED>::of_light(context, e.point.position);
        let mut going = Going { flight, sampler, chance };
        walk(context, h, Mode::Importance, departure, max_edges - 1, &mut going, &mut self.light);
    }
}

/// An edge with what is needed to follow it.
struct Departure {
    ray: Ray,
    edge: Edge,
    throughput: Vec3,
}

/// What a subpath takes along: its clock and its random numbers.
struct Going<'a, const TIMED: bool> {
    flight: Flight<'a, TIMED>,
    sampler: &'a mut Sampler,
    chance: &'a mut Chance,
}

/// Follows a path until it ends. Returns the edge that left the scene, if one did.
fn walk<const TIMED: bool>(
    context: &Context,
    h: Heuristic,
    mode: Mode,
    mut departure: Departure,
    max_edges: u32,
    going: &mut Going<TIMED>,
    path: &mut Vec<Vertex>,
) -> Option<Escape> {
    let mut roulette = Roulette { start: context.rr_start, promise: Vec3::ONE };
    let mut over: Option<Overhang> = None;
    for count in 1..=max_edges {
        let Departure { ray, edge, throughput } = departure;
        let Some(hit) = context.trace.closest(&ray, f32::INFINITY) else {
            return Some(Escape { edge, throughput, length: going.flight.escaped(context, edge.dir) });
        };
        // From the camera, the last edge finds light or nothing.
        let only_light = mode == Mode::Radiance && count == max_edges;
        if only_light && context.scene.emitter_of(hit.primitive, hit.instance) == NONE {
            return None;
        }
        let surface = going.flight.arrive(context, &ray, &hit, going.chance);
        if over.is_some_and(|o| !o.reaches(surface.position)) {
            return None;
        }
        let (chain, back) = edge.meet(context, h, surface.position, surface.n_geometric)?;
        path.push(edge.arrive(context, &surface, mode, throughput, chain, back));
        let v = path.last_mut()?;
        v.stamp = going.flight.stamp();
        let ends = v.emitter != NONE && !surface.material.emitter_reflects;
        if ends || count == max_edges {
            v.connectible &= !ends;
            return None;
        }
        departure = v.depart(h, mode, &surface, count, &mut roulette, going.sampler)?;
        going.flight.leave(v.position, v.eta);
        over = surface.overhang_into(departure.ray.dir);
    }
    None
}

impl Edge {
    /// An edge from a point of the lens.
    ///
    /// Every strategy with two or more camera vertices generates it with the density of camera rays, and the one with a
    /// single camera vertex can do without, unless the film's pixels are points: then no other strategy can find what
    /// lies there, and the density, the same for all that can, does not matter.
    #[inline]
    pub fn from_lens(context: &Context, from: Vec3, dir: Vec3) -> Edge {
        let pdf_w = f64::from(context.camera.pdf_w(dir));
        let (pdf_w, joint) = if pdf_w > 0.0 { (pdf_w, 1.0) } else { (1.0, 0.0) };
        Edge { origin: Origin::Lens, from, dir, pdf_w, link: Link { joint, tail: 0.0 } }
    }

    /// An edge from a point of a light. What weights need is known when it arrives.
    #[inline]
    pub fn from_light(point: LightPoint, dir: Vec3) -> Edge {
        let link = Link { joint: 0.0, tail: 0.0 };
        Edge { origin: Origin::Light(point), from: point.position, dir, pdf_w: 0.0, link }
    }

    /// What weights need of the point of a surface that this edge meets, and [`Vertex::back`] there; `None` where rounding
    /// leaves the point without a density.
    #[inline]
    pub fn meet(&self, context: &Context, h: Heuristic, position: Vec3, n: Vec3) -> Option<(Chain, f32)> {
        if let Origin::Light(point) = self.origin {
            let end = LightEnd::new(context, &point, self.dir, position, n);
            let (some, chain) = Chain::new(h, end.link(h), end.next);
            return some.then_some((chain, end.back));
        }
        let [spread, back] = vertex::area_factors([self.from, self.origin.normal()], [position, n]);
        Some((self.chain(h, f64::from(spread))?, back))
    }

    /// What weights need where this edge arrives; `spread` turns its density into one of that place.
    #[inline]
    pub fn chain(&self, h: Heuristic, spread: f64) -> Option<Chain> {
        let (some, chain) = Chain::new(h, self.link, self.pdf_w * spread);
        some.then_some(chain)
    }

    /// The vertex where the edge meets a surface, with what [`Edge::meet`] says of it.
    #[inline]
    pub fn arrive(
        &self,
        context: &Context,
        surface: &Surface,
        mode: Mode,
        throughput: Vec3,
        chain: Chain,
        back: f32,
    ) -> Vertex {
        let wo = -self.dir;
        let bsdf = Bsdf::new(surface, &context.scene.textures);
        let emitted = if mode == Mode::Radiance { surface.emitted(&context.scene.textures, wo) } else { Vec3::ZERO };
        Vertex {
            position: surface.position,
            n_geometric: surface.n_geometric,
            n_shading: surface.n_shading,
            out: bsdf.outgoing(wo),
            previous: self.from,
            n_previous: self.origin.normal(),
            back,
            connectible: bsdf.has_density(),
            bsdf,
            overhang: surface.overhang,
            emitter: surface.emitter,
            uv: surface.uv,
            emitted,
            throughput,
            chain,
            delta: false,
            eta: 1.0,
            stamp: Stamp::default(),
        }
    }
}

impl Vertex {
    /// The cosine by which a BSDF value towards `wi` is multiplied.
    #[inline]
    pub fn cos(&self, wi: Vec3) -> f32 {
        wi.dot(self.n_shading).abs()
    }

    /// This vertex as edges meet it that leave from the crest of its overhang: see [`Surface::raised`].
    #[inline]
    pub fn raised(&self) -> Option<Vertex> {
        let over = self.overhang?;
        let overhang = Some(Overhang { raised: true, ..over });
        Some(Vertex { position: over.crest, n_geometric: Vec3::ZERO, overhang, ..*self })
    }

    /// This vertex as weights see it.
    #[inline]
    pub fn side(&self) -> Side {
        Side { chain: self.chain, back: self.back }
    }

    /// The edge on which the path goes on into `wi`, which was found with density `pdf_w` (the way back has `reverse_pdf_w`)
    /// or, if `self.delta`, by a Dirac event: see [`Side::onward`].
    #[inline]
    pub fn onward(&self, h: Heuristic, mode: Mode, wi: Vec3, pdf_w: f32, reverse_pdf_w: f32) -> Edge {
        let event = (self.delta, self.eta);
        let (pdf_w, link) =
            self.side().onward(h, mode, [self.out.wo, wi, self.n_geometric], [pdf_w, reverse_pdf_w], event);
        let (n, from) = match self.overhang {
            Some(over) if over.carries(wi) => (Vec3::ZERO, over.crest),
            _ => (self.n_geometric, self.position),
        };
        Edge { origin: Origin::Surface(n), from, dir: wi, pdf_w, link }
    }

    /// Samples where the path goes on.
    #[inline]
    fn depart(
        &mut self,
        h: Heuristic,
        mode: Mode,
        surface: &Surface,
        edge: u32,
        roulette: &mut Roulette,
        sampler: &mut Sampler,
    ) -> Option<Departure> {
        let choice = sampler.next_1d();
        let (BsdfSample { wi, weight, pdf_w, delta, eta }, reverse) =
            self.bsdf.sample_with_reverse(&self.out, choice, sampler.next_2d(), mode)?;
        (self.delta, self.eta) = (delta, eta);
        // Undoes the scaling of radiance by refraction, so that roulette judges what the path will bring back.
        let eta2 = if mode == Mode::Radiance { eta * eta } else { 1.0 };
        let survival = roulette.play(edge, weight * eta2, sampler)?;
        let throughput = self.throughput * weight / survival;
        if throughput == Vec3::ZERO {
            return None;
        }
        Some(Departure { ray: surface.spawn(wi), edge: self.onward(h, mode, wi, pdf_w, reverse), throughput })
    }
}
