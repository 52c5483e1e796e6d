//! Steps of subpaths: their start at the camera or at a light, and their vertices.

use glam::Vec3;

use super::connect::Connection;
use super::directions::SubpathDirections;
use super::state::{LightStart, MisState, ShadingState, Subpath, Vertex, VertexState};
use super::weights::{EdgePartials, LightEnd, MisEdge, MisEndpoint, StrategyCounts, others_s0};
use crate::math::real::{Double, Mask, Real, Vector, Word};
use crate::math::simd::Lanes;
use crate::scene::compile::{NONE, Uv};
use crate::transport::MAX_SURVIVAL;
use crate::transport::arrival::Arrival;
use crate::transport::bsdf::TransportMode;
use crate::transport::integrator::Context;
use crate::transport::integrator::camera_path::{
    Path, PathState, TerminatorState, TimeState, edge_counts,
};
use crate::transport::light::{LightId, LightPoint};
use crate::transport::path_time::OpticalLength;
use crate::transport::surface::Surface;

/// A step of subpaths.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// Quantity that the subpaths carry: radiance from the camera, importance from a light.
    pub mode: TransportMode,
    /// Number of the edge that led to the surfaces, counted from 1.
    pub edge: u32,
    /// Greatest number of edges.
    pub max_edges: u32,
    /// Numbers of samples of the strategies that the weights combine.
    pub counts: StrategyCounts,
}

/// Receives what a step of subpaths finds.
pub trait StepSink<R: Real, const N: usize> {
    /// Receives the vertices in the given lanes, with properties that only some surfaces have, and
    /// the events that lead to the next edges.
    fn add_vertices(
        &mut self,
        lanes: R::Mask,
        vertices: (&Vertex<R>, &ShadingState<R>),
        departure: &Departure<R>,
    );

    /// Receives light that camera subpaths hit.
    fn add_light(&mut self, light: &Connection<R, N>);
}

/// Events at vertices that lead to the next edges.
#[derive(Clone, Copy)]
pub struct Departure<R: Real> {
    /// Lanes whose subpath continues.
    pub continues: R::Mask,
    /// Whether the event was a Dirac event.
    pub delta: R::Mask,
    /// Index ratio crossed by the event.
    pub eta: R,
}

impl<R: Real> Subpath<R> {
    /// Starts camera subpaths on the first edges of paths.
    #[inline(always)]
    pub fn from_camera(
        context: &Context,
        counts: &StrategyCounts,
        mut path: Path<R>,
    ) -> Subpath<R> {
        let PathState { origin, dir, .. } = path.state;
        let edge = MisEdge::from_lens(context, counts, origin, dir);
        path.state.last_pdf_w = edge.pdf_w;
        Subpath {
            path,
            mis: MisState {
                n_last: R::Vec3::broadcast(Vec3::ZERO),
                rr_throughput: R::Vec3::broadcast(Vec3::ONE),
                light: R::Word::splat(NONE),
            },
            partials: edge.partials,
        }
    }

    /// Starts the light subpaths of samples whose camera subpaths are at an end. Returns the lights'
    /// points, the subpaths on their first edges, and the lanes that may continue. `emitted` is the
    /// time of emission.
    #[inline(always)]
    pub fn from_light<const N: usize>(
        context: &Context,
        mut path: Path<R>,
        emitted: R,
        lanes: R::Mask,
    ) -> (LightStart<R>, Subpath<R>, R::Mask)
    where
        R: Lanes<N>,
    {
        let [choice, u, v] = path.sampler.next_three();
        let direction = path.sampler.next_2d();
        let lights = context.lights.select::<R, N>(choice, lanes);
        let start = lights.sample_emission(context.scene, [u, v], direction);
        let starts = lanes & start.starts();
        let (position, normal, dir) = (start.point.position, start.point.normal, start.dir);
        let throughput = start.radiance * start.cos / (start.pdf_a * start.pdf_w);
        path.state = PathState {
            origin: start.point.end().off_surface(dir),
            dir,
            throughput,
            last: position,
            ..path.state
        };
        path.terminator = path.terminator.map(|_| TerminatorState::none());
        path.time = path.time.map(|time| TimeState {
            from: position,
            path: R::splat(0.0),
            delays: R::splat(0.0),
            index: R::splat(1.0),
            ..time
        });
        let light = R::load_words(&lights.indices);
        let subpath = Subpath {
            path,
            mis: MisState {
                n_last: normal,
                rr_throughput: R::Vec3::broadcast(Vec3::ONE),
                light,
            },
            // Computed on arrival.
            partials: EdgePartials {
                d_vcm: R::Double::splat(0.0),
                d_vc: R::Double::splat(0.0),
            },
        };
        let continues = starts & !throughput.same(R::Vec3::broadcast(Vec3::ZERO));
        let light = R::Word::select(starts, light, R::Word::splat(NONE));
        let start = LightStart::new(&start, light, emitted);
        (start, subpath, continues)
    }

    /// Handles arrivals at surfaces of one class: passes the vertices and the light that camera
    /// subpaths hit to `sink`, and samples the next edges.
    #[inline(always)]
    pub fn scatter<const N: usize>(
        &mut self,
        context: &Context,
        directions: impl SubpathDirections,
        step: Step,
        arrival: &Arrival<R, N>,
        mut lanes: R::Mask,
        sink: &mut impl StepSink<R, N>,
    ) -> Departure<R>
    where
        R: Lanes<N>,
    {
        let end = Departure {
            continues: R::Mask::default(),
            delta: R::Mask::default(),
            eta: R::splat(1.0),
        };
        let from_camera = step.mode == TransportMode::Radiance;
        let surface = arrival.surface(context.scene);
        let counts = !from_camera || edge_counts(context, step.edge);
        let optical = self.path.arrive(context, counts, arrival, &surface, lanes);
        if let Some(terminator) = &self.path.terminator {
            lanes = lanes & terminator.allows(surface.position);
        }
        let at = [surface.position, surface.n_geometric];
        let (exist, endpoint) = self.endpoint(context, step, at, lanes);
        lanes = lanes & exist;
        if arrival.class.surface.emits {
            let length = match &optical {
                None => R::Double::splat(0.0),
                Some(optical) => optical.arrival(),
            };
            if from_camera
                && context.settings.includes(0, step.edge + 1)
                && let Some(light) =
                    self.hit_light(context, &step, (&surface, &endpoint), length, lanes)
            {
                sink.add_light(&light);
            }
            lanes = lanes & !surface.ends_paths();
        }
        let unconnected = from_camera && step.edge == step.max_edges;
        if unconnected || !lanes.any() {
            return end;
        }
        let (mut vertex, shading) = self.vertex(context, arrival, &surface, optical, &endpoint);
        directions.prepare::<R, N>(context, &mut vertex, step.mode, lanes);
        let departure = if step.edge == step.max_edges {
            end
        } else {
            self.depart(
                context,
                directions,
                step,
                (&vertex, &surface),
                optical,
                lanes,
            )
        };
        sink.add_vertices(lanes, (&vertex, &shading), &departure);
        departure
    }

    /// Builds the vertices at surfaces, at which the subpaths have these optical lengths and MIS
    /// quantities.
    #[inline(always)]
    fn vertex<const N: usize>(
        &self,
        context: &Context,
        arrival: &Arrival<R, N>,
        surface: &Surface<R, N>,
        optical: Option<OpticalLength<R>>,
        endpoint: &MisEndpoint<R>,
    ) -> (Vertex<R>, ShadingState<R>)
    where
        R: Lanes<N>,
    {
        let parameters = arrival.parameters(context.scene, surface);
        let bsdf = arrival.bsdf(context.classes, surface, parameters.as_ref());
        let terminator = surface.terminator;
        let shading = ShadingState::new(parameters.as_ref(), surface.tangent, terminator.as_ref());
        let wo = -self.path.state.dir;
        let zero = R::splat(0.0);
        let OpticalLength {
            path,
            delays,
            delay,
            index,
        } = optical.unwrap_or(OpticalLength {
            path: zero,
            delays: zero,
            delay: zero,
            index: zero,
        });
        let state = VertexState {
            position: surface.position,
            n_geometric: surface.n_geometric,
            extent: surface.extent,
            n_shading: surface.n_shading,
            wo,
            throughput: self.path.state.throughput,
            back: endpoint.back,
            material: R::load_words(&arrival.materials),
            path,
            delays,
            delay,
            index,
            region: R::Word::splat(NONE),
            guided_back_w: zero,
        };
        let vertex = Vertex {
            state,
            partials: endpoint.partials,
            terminator,
            out: bsdf.outgoing(wo),
            bsdf,
        };
        (vertex, shading)
    }

    /// Returns the MIS quantities of the points at which the edges end, given by position and
    /// unit normal. The mask is unset where rounding leaves a point without a density.
    #[inline(always)]
    fn endpoint<const N: usize>(
        &self,
        context: &Context,
        step: Step,
        at: [R::Vec3; 2],
        lanes: R::Mask,
    ) -> (R::Mask, MisEndpoint<R>)
    where
        R: Lanes<N>,
    {
        let from_camera = step.mode == TransportMode::Radiance;
        let parallel = from_camera && step.edge == 1 && context.camera.is_parallel();
        let (h, edge) = (context.settings.heuristic(), self.edge(parallel));
        if from_camera || step.edge > 1 {
            return edge.endpoint(h, at);
        }
        let indices = R::store_words(self.mis.light);
        let lights = context.lights.with_indices::<R, N>(indices, lanes);
        LightEnd::new(&lights, edge.from, self.path.state.dir, at).endpoint(h, &step.counts)
    }

    /// Samples the next edges in the given lanes of vertices.
    #[inline(always)]
    fn depart<const N: usize>(
        &mut self,
        context: &Context,
        directions: impl SubpathDirections,
        Step {
            mode, edge, counts, ..
        }: Step,
        (vertex, surface): (&Vertex<R>, &Surface<R, N>),
        optical: Option<OpticalLength<R>>,
        lanes: R::Mask,
    ) -> Departure<R>
    where
        R: Lanes<N>,
    {
        let path = &mut self.path;
        let before = path.sampler;
        let numbers = path.sampler.next_three();
        path.sampler.keep(lanes, &before);
        let (sampled, s, reverse) =
            directions.sample::<R, N>(context, vertex, numbers, mode, lanes);
        let lanes = lanes & sampled & vertex.out.same_side;
        // Undo the scaling of radiance by refraction, so that roulette judges the expected
        // contribution.
        let rr_weight = match mode {
            TransportMode::Radiance => s.weight * (s.eta * s.eta),
            TransportMode::Importance => s.weight,
        };
        let lanes = self.roulette(context, edge, [s.weight, rr_weight], lanes);
        let n = surface.n_geometric;
        let (pdf_w, partials) = vertex.endpoint().next_edge(
            (context.settings.heuristic(), &counts),
            mode,
            [vertex.state.wo, s.wi, n],
            [s.pdf_w, reverse],
            (s.delta, s.eta),
        );
        self.partials = partials;
        self.path.state.last_pdf_w = pdf_w;
        self.mis.n_last = match surface.terminator_into(s.wi) {
            Some(offset) => R::Vec3::select(offset.exists, R::Vec3::broadcast(Vec3::ZERO), n),
            None => n,
        };
        self.path.leave(surface, optical, s.wi, s.eta);
        Departure {
            continues: lanes,
            delta: s.delta,
            eta: s.eta,
        }
    }

    /// Multiplies the throughputs by the BSDF weights, and ends subpaths by Russian roulette after
    /// edge number `edge`. Its survival probabilities follow from the product of the weights
    /// `rr_weight`; MIS weights do not involve it: see [`crate::transport::mis`]. Returns the lanes
    /// of `lanes` that survive with a throughput other than zero.
    #[inline(always)]
    fn roulette(
        &mut self,
        context: &Context,
        edge: u32,
        [weight, rr_weight]: [R::Vec3; 2],
        mut lanes: R::Mask,
    ) -> R::Mask {
        let path = &mut self.path;
        let mut rr_throughput = self.mis.rr_throughput * rr_weight;
        let mut throughput = path.state.throughput * weight;
        if context.rr_start.is_some_and(|start| edge >= start) {
            let t = rr_throughput;
            let survival = t.x().max(t.y()).max(t.z()).min(R::splat(MAX_SURVIVAL));
            let before = path.sampler;
            let survives = path.sampler.next_1d().lt(survival);
            path.sampler.keep(lanes, &before);
            lanes = lanes & survives;
            rr_throughput = rr_throughput / survival;
            throughput = throughput / survival;
        }
        self.mis.rr_throughput = rr_throughput;
        path.state.throughput = throughput;
        lanes & !throughput.same(R::Vec3::broadcast(Vec3::ZERO))
    }

    /// Finds light with `s = 0`: emissive surfaces that camera subpaths hit.
    #[inline(always)]
    fn hit_light<const N: usize>(
        &self,
        context: &Context,
        step: &Step,
        (surface, endpoint): (&Surface<R, N>, &MisEndpoint<R>),
        length: R::Double,
        lanes: R::Mask,
    ) -> Option<Connection<R, N>>
    where
        R: Lanes<N>,
    {
        let dir = self.path.state.dir;
        let radiance = surface.emitted(&context.scene.textures, -dir);
        let lanes = lanes & !radiance.same(R::Vec3::broadcast(Vec3::ZERO));
        if !lanes.any() {
            return None;
        }
        let indices = R::store_words(surface.emitter);
        let lights = context.lights.with_indices::<R, N>(indices, lanes);
        let at = [surface.position, surface.n_geometric];
        let from = [self.path.state.last, self.mis.n_last];
        let end = LightEnd::new(&lights, at, -dir, from);
        let h = context.settings.heuristic();
        Some(Connection {
            lanes,
            ray: None,
            unweighted: self.path.state.throughput * radiance,
            others: others_s0((h, &step.counts), &endpoint.partials, &end, step.edge + 1),
            found: lanes,
            length,
            wi: dir,
            point: Some(LightPoint {
                lights: lights.ids(),
                position: surface.position,
                normal: surface.n_geometric,
                extent: surface.extent,
                uv: surface.uv,
            }),
        })
    }

    /// Finds light with `s = 0` outside the scene, which edge number `edge` of camera subpaths left:
    /// the environment is their last vertex. `None` if no lane finds any.
    #[inline(always)]
    pub fn escape<const N: usize>(
        &self,
        context: &Context,
        counts: &StrategyCounts,
        edge: u32,
        lanes: R::Mask,
    ) -> Option<Connection<R, N>>
    where
        R: Lanes<N>,
    {
        if !context.settings.includes(0, edge + 1) {
            return None;
        }
        let last = self.edge(edge == 1 && context.camera.is_parallel());
        let (dir, from) = (self.path.state.dir, last.from);
        let radiance = context.lights.environment::<R::Vec3, N>(dir);
        let h = context.settings.heuristic();
        let (exist, partials) = last.distant_partials(h);
        let lanes = lanes & exist & !radiance.same(R::Vec3::broadcast(Vec3::ZERO));
        if !lanes.any() {
            return None;
        }
        let index = context.lights.index(LightId::Environment);
        let lights = context.lights.with_indices::<R, N>([index; N], lanes);
        let position = from[0] + dir;
        let end = LightEnd::new(&lights, [position, -dir], -dir, from);
        Some(Connection {
            lanes,
            ray: None,
            unweighted: self.path.state.throughput * radiance,
            others: others_s0((h, counts), &partials, &end, edge + 1),
            found: lanes,
            length: self.path.escape_length(context, edge),
            wi: dir,
            point: Some(LightPoint {
                lights: lights.ids(),
                position,
                normal: -dir,
                extent: R::splat(0.0),
                uv: Uv::zero(),
            }),
        })
    }
}
