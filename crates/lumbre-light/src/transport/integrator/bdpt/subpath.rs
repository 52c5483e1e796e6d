//! The camera and light subpaths of a sample.

use glam::Vec3;

use super::weights::{EdgePartials, LightEnd, MisEndpoint, MisPartials};
use crate::scene::compile::{NONE, Uv};
use crate::transport::MAX_SURVIVAL;
use crate::transport::bsdf::{Bsdf, BsdfSample, Outgoing, TransportMode};
use crate::transport::integrator::Context;
use crate::transport::light::{EmissionSample, LightPoint};
use crate::transport::mis::Heuristic;
use crate::transport::path_time::{AuxRng, OpticalLength, PathTime};
use crate::transport::ray::Ray;
use crate::transport::sampler::Sampler;
use crate::transport::surface::{Surface, TerminatorOffset};
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
    /// Direction to the previous vertex, with everything that the BSDF derives from it.
    pub out: Outgoing,
    /// Position of the previous vertex; meaningless for an infinitely distant light.
    pub previous: Vec3,
    /// Unit normal of the previous vertex; zero for a lens point or a lifted point.
    pub n_previous: Vec3,
    /// Factor from a density per solid angle here to the other side's density of the previous
    /// vertex; zero if the other side cannot generate it.
    pub back: f32,
    /// The BSDF at this vertex.
    pub bsdf: Bsdf,
    /// Whether connections are possible: the BSDF has a density, and the surface does not end
    /// paths.
    pub connectible: bool,
    /// Offset against the shadow terminator for edges towards light.
    pub terminator: Option<TerminatorOffset>,
    /// Index into the scene's emitters, or [`NONE`].
    pub emitter: u32,
    /// Texture coordinates before tiling.
    pub uv: Uv,
    /// Radiance emitted towards the previous vertex; black in a light subpath.
    pub emitted: Vec3,
    /// Throughput of the subpath up to this vertex, over the density of its generation.
    pub throughput: Vec3,
    /// Partial sums of MIS terms.
    pub partials: MisPartials,
    /// Whether the event that led to the next vertex was a Dirac event.
    pub delta: bool,
    /// Index ratio crossed by that event.
    pub eta: f32,
    /// Optical length of the subpath up to this vertex.
    pub optical: OpticalLength,
}

/// The vertex that an edge of a subpath leaves.
#[derive(Clone, Copy, Debug)]
pub enum Origin {
    /// A point of the lens.
    Lens,
    /// A point of a light.
    Light(LightPoint),
    /// A surface with this unit normal; zero for a lifted point, at which no path can arrive.
    Surface(Vec3),
}

impl Origin {
    /// Returns the unit normal; zero for a lens point or a lifted point.
    #[inline]
    pub fn normal(&self) -> Vec3 {
        match self {
            Origin::Lens => Vec3::ZERO,
            Origin::Light(point) => point.normal,
            Origin::Surface(n) => *n,
        }
    }
}

/// An edge of a subpath whose end vertex is not known yet.
#[derive(Clone, Copy, Debug)]
pub struct Edge {
    /// The vertex that the edge leaves.
    pub origin: Origin,
    /// Position of that vertex.
    pub from: Vec3,
    /// Unit direction of the edge.
    pub dir: Vec3,
    /// Density of the direction per solid angle; unused if the edge leaves a light.
    pub pdf_w: f64,
    /// Partial sums of MIS terms.
    pub partials: EdgePartials,
}

/// The end of a camera subpath that left the scene.
#[derive(Clone, Copy, Debug)]
pub struct Escape {
    /// The last edge of the subpath.
    pub edge: Edge,
    /// Throughput of the subpath, over the density of its generation.
    pub throughput: Vec3,
    /// Optical length of light that arrives along it.
    pub length: f64,
}

/// Both subpaths of a sample, reused for the next one so that nothing is allocated per path.
#[derive(Debug, Default)]
pub struct Subpaths {
    /// Vertices of the light subpath after the light's own: the vertex `y_i` has index `i - 1`.
    pub light: Vec<Vertex>,
    /// The start of the light subpath, if there is one.
    pub start: Option<EmissionSample>,
    /// Vertices of the camera subpath after the lens: the vertex `z_i` has index `i - 1`.
    pub camera: Vec<Vertex>,
    /// The edge after them, if it hit nothing.
    pub escape: Option<Escape>,
    /// The point on the lens.
    pub lens: Vec3,
    /// Time of emission of this sample's light, as an optical length.
    pub emitted: f32,
}

/// Russian roulette of one subpath. Weights do not involve it: see [`crate::transport::mis`].
struct RussianRoulette {
    start: Option<u32>,
    /// Product of the BSDF weights, by which the survival probability is chosen.
    rr_throughput: Vec3,
}

impl RussianRoulette {
    /// Returns the survival probability after edge number `edge`, or `None` if the path ends.
    #[inline]
    fn survival(&mut self, edge: u32, weight: Vec3, sampler: &mut Sampler) -> Option<f32> {
        self.rr_throughput *= weight;
        if self.start.is_none_or(|start| edge < start) {
            return Some(1.0);
        }
        let survival = self.rr_throughput.max_element().min(MAX_SURVIVAL);
        if sampler.next_1d() >= survival {
            return None;
        }
        self.rr_throughput /= survival;
        Some(survival)
    }
}

impl Subpaths {
    /// Traces both subpaths of a sample, with up to `context.max_depth` edges each; for `TIMED` see
    /// [`PathTime`].
    pub fn trace<const TIMED: bool>(
        &mut self,
        context: &Context,
        h: Heuristic,
        pixel: [u32; 2],
        sampler: &mut Sampler,
    ) {
        let mut aux_rng = self.trace_camera::<TIMED>(context, h, pixel, sampler);
        self.trace_light::<TIMED>(context, h, sampler, &mut aux_rng);
    }

    /// Traces the camera subpath; returns the auxiliary numbers, which the light subpath continues.
    fn trace_camera<const TIMED: bool>(
        &mut self,
        context: &Context,
        h: Heuristic,
        pixel: [u32; 2],
        sampler: &mut Sampler,
    ) -> AuxRng {
        self.camera.clear();
        let ray = context.camera.sample_ray(pixel, sampler);
        self.lens = ray.origin;
        let edge = Edge::from_lens(context, ray.origin, ray.dir);
        let departure = Departure {
            ray,
            edge,
            throughput: Vec3::ONE,
        };
        let mut aux_rng = AuxRng::new::<TIMED>(sampler);
        self.emitted = aux_rng.emission(context);
        let path_time = PathTime::<TIMED>::from_camera(context, &ray, self.emitted);
        let mut state = WalkState {
            path_time,
            sampler,
            aux_rng: &mut aux_rng,
        };
        self.escape = walk(
            context,
            h,
            TransportMode::Radiance,
            departure,
            context.max_depth,
            &mut state,
            &mut self.camera,
        );
        aux_rng
    }

    /// Traces the light subpath.
    fn trace_light<const TIMED: bool>(
        &mut self,
        context: &Context,
        h: Heuristic,
        sampler: &mut Sampler,
        aux_rng: &mut AuxRng,
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
        let ray = vertex::spawn_ray(e.point.position, e.point.normal, e.dir);
        let departure = Departure {
            ray,
            edge,
            throughput,
        };
        let path_time = PathTime::<TIMED>::from_light(context, e.point.position);
        let mut state = WalkState {
            path_time,
            sampler,
            aux_rng,
        };
        walk(
            context,
            h,
            TransportMode::Importance,
            departure,
            max_edges - 1,
            &mut state,
            &mut self.light,
        );
    }
}

/// An edge with its ray and throughput.
struct Departure {
    ray: Ray,
    edge: Edge,
    throughput: Vec3,
}

/// The state that a subpath carries along: its optical length and its random numbers.
struct WalkState<'a, const TIMED: bool> {
    path_time: PathTime<'a, TIMED>,
    sampler: &'a mut Sampler,
    aux_rng: &'a mut AuxRng,
}

/// Traces a subpath until it ends. Returns its last edge if that left the scene.
fn walk<const TIMED: bool>(
    context: &Context,
    h: Heuristic,
    mode: TransportMode,
    mut departure: Departure,
    max_edges: u32,
    state: &mut WalkState<TIMED>,
    path: &mut Vec<Vertex>,
) -> Option<Escape> {
    let mut roulette = RussianRoulette {
        start: context.rr_start,
        rr_throughput: Vec3::ONE,
    };
    let mut terminator: Option<TerminatorOffset> = None;
    for count in 1..=max_edges {
        let Departure {
            ray,
            edge,
            throughput,
        } = departure;
        let Some(hit) = context.trace.closest(&ray, f32::INFINITY) else {
            return Some(Escape {
                edge,
                throughput,
                length: state.path_time.escape_length(context, edge.dir),
            });
        };
        // The last edge of a camera subpath can only find light.
        let only_light = mode == TransportMode::Radiance && count == max_edges;
        if only_light && context.scene.emitter_of(hit.primitive, hit.instance) == NONE {
            return None;
        }
        let surface = state.path_time.arrive(context, &ray, &hit, state.aux_rng);
        if terminator.is_some_and(|o| !o.has_below(surface.position)) {
            return None;
        }
        let (partials, back) =
            edge.partials_at_surface(context, h, surface.position, surface.n_geometric)?;
        path.push(edge.vertex_at(context, &surface, mode, throughput, partials, back));
        let v = path.last_mut()?;
        v.optical = state.path_time.optical();
        let ends = surface.ends_paths();
        if ends || count == max_edges {
            v.connectible &= !ends;
            return None;
        }
        departure = v.depart(h, mode, &surface, count, &mut roulette, state.sampler)?;
        state.path_time.scatter(v.position, v.eta);
        terminator = surface.terminator_into(departure.ray.dir);
    }
    None
}

impl Edge {
    /// Returns an edge that leaves a point of the lens.
    ///
    /// Every strategy with two or more camera vertices generates it with the density of camera
    /// rays, and the one with a single camera vertex does without it, unless the film's pixels are
    /// points: then no other strategy can find the path, and the density, the same for all
    /// strategies that can, does not matter.
    #[inline]
    pub fn from_lens(context: &Context, from: Vec3, dir: Vec3) -> Edge {
        let pdf_w = f64::from(context.camera.pdf_w(dir));
        let (pdf_w, d_vcm) = if pdf_w > 0.0 {
            (pdf_w, 1.0)
        } else {
            (1.0, 0.0)
        };
        Edge {
            origin: Origin::Lens,
            from,
            dir,
            pdf_w,
            partials: EdgePartials { d_vcm, d_vc: 0.0 },
        }
    }

    /// Returns an edge that leaves a point of a light. Its partial sums are computed on arrival.
    #[inline]
    pub fn from_light(point: LightPoint, dir: Vec3) -> Edge {
        let partials = EdgePartials {
            d_vcm: 0.0,
            d_vc: 0.0,
        };
        Edge {
            origin: Origin::Light(point),
            from: point.position,
            dir,
            pdf_w: 0.0,
            partials,
        }
    }

    /// Returns the MIS partials of the surface point that this edge hits, and [`Vertex::back`]
    /// there; `None` if rounding leaves the point without a density.
    #[inline]
    pub fn partials_at_surface(
        &self,
        context: &Context,
        h: Heuristic,
        position: Vec3,
        n: Vec3,
    ) -> Option<(MisPartials, f32)> {
        if let Origin::Light(point) = self.origin {
            let end = LightEnd::at_point(context, &point, self.dir, position, n);
            let (some, partials) = MisPartials::new(h, end.edge_partials(h), end.next);
            return some.then_some((partials, end.back));
        }
        let [spread, back] = vertex::area_factors([self.from, self.origin.normal()], [position, n]);
        Some((self.partials_at(h, f64::from(spread))?, back))
    }

    /// Returns the MIS partials at the end of this edge; `spread` converts its density to that of
    /// the end point.
    #[inline]
    pub fn partials_at(&self, h: Heuristic, spread: f64) -> Option<MisPartials> {
        let (some, partials) = MisPartials::new(h, self.partials, self.pdf_w * spread);
        some.then_some(partials)
    }

    /// Returns the vertex at the surface that this edge hits, given the results of
    /// [`Edge::partials_at_surface`].
    #[inline]
    pub fn vertex_at(
        &self,
        context: &Context,
        surface: &Surface,
        mode: TransportMode,
        throughput: Vec3,
        partials: MisPartials,
        back: f32,
    ) -> Vertex {
        let wo = -self.dir;
        let bsdf = Bsdf::new(surface, &context.scene.textures);
        let emitted = if mode == TransportMode::Radiance {
            surface.emitted(&context.scene.textures, wo)
        } else {
            Vec3::ZERO
        };
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
            terminator: surface.terminator,
            emitter: surface.emitter,
            uv: surface.uv,
            emitted,
            throughput,
            partials,
            delta: false,
            eta: 1.0,
            optical: OpticalLength::default(),
        }
    }
}

impl Vertex {
    /// Returns the cosine by which a BSDF value towards `wi` is multiplied.
    #[inline]
    pub fn cos(&self, wi: Vec3) -> f32 {
        wi.dot(self.n_shading).abs()
    }

    /// Returns this vertex as the start of edges from its lifted point: see [`Surface::lifted`].
    #[inline]
    pub fn lifted(&self) -> Option<Vertex> {
        let terminator = TerminatorOffset {
            lifted: true,
            ..self.terminator?
        };
        Some(Vertex {
            position: terminator.lifted_point,
            n_geometric: Vec3::ZERO,
            terminator: Some(terminator),
            ..*self
        })
    }

    /// Returns the quantities of this vertex that weights depend on.
    #[inline]
    pub fn mis_endpoint(&self) -> MisEndpoint {
        MisEndpoint {
            partials: self.partials,
            back: self.back,
        }
    }

    /// Returns the edge in direction `wi`, which was sampled with density `pdf_w` (and
    /// `reverse_pdf_w` for the way back) or, if `self.delta`, by a Dirac event: see
    /// [`MisEndpoint::next_edge`].
    #[inline]
    pub fn next_edge(
        &self,
        h: Heuristic,
        mode: TransportMode,
        wi: Vec3,
        pdf_w: f32,
        reverse_pdf_w: f32,
    ) -> Edge {
        let event = (self.delta, self.eta);
        let (pdf_w, partials) = self.mis_endpoint().next_edge(
            h,
            mode,
            [self.out.wo, wi, self.n_geometric],
            [pdf_w, reverse_pdf_w],
            event,
        );
        let (n, from) = match self.terminator {
            Some(terminator) if terminator.applies_to(wi) => (Vec3::ZERO, terminator.lifted_point),
            _ => (self.n_geometric, self.position),
        };
        Edge {
            origin: Origin::Surface(n),
            from,
            dir: wi,
            pdf_w,
            partials,
        }
    }

    /// Samples the next edge of the path.
    #[inline]
    fn depart(
        &mut self,
        h: Heuristic,
        mode: TransportMode,
        surface: &Surface,
        edge: u32,
        roulette: &mut RussianRoulette,
        sampler: &mut Sampler,
    ) -> Option<Departure> {
        let choice = sampler.next_1d();
        let (
            BsdfSample {
                wi,
                weight,
                pdf_w,
                delta,
                eta,
            },
            reverse,
        ) = self
            .bsdf
            .sample_with_reverse(&self.out, choice, sampler.next_2d(), mode)?;
        (self.delta, self.eta) = (delta, eta);
        // Undo the scaling of radiance by refraction, so that roulette judges the expected
        // contribution.
        let eta2 = if mode == TransportMode::Radiance {
            eta * eta
        } else {
            1.0
        };
        let survival = roulette.survival(edge, weight * eta2, sampler)?;
        let throughput = self.throughput * weight / survival;
        if throughput == Vec3::ZERO {
            return None;
        }
        Some(Departure {
            ray: surface.spawn(wi),
            edge: self.next_edge(h, mode, wi, pdf_w, reverse),
            throughput,
        })
    }
}
