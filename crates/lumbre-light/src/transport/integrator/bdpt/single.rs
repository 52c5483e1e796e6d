//! Renders one sample after the other: the steps and connections with one lane.

use std::cell::RefCell;

use glam::Vec3;

use super::connect::{self, Connection};
use super::directions::SubpathDirections;
use super::state::{LightStart, ShadingState, Subpath, SubpathVertex, Vertex};
use super::store::VertexId;
use super::subpath::{Departure, Step, StepSink};
use super::weights::StrategyCounts;
use crate::scene::compile::NONE;
use crate::transport::arrival::{Arrival, HitState};
use crate::transport::bsdf::TransportMode;
use crate::transport::contribution::Contribution;
use crate::transport::integrator::Context;
use crate::transport::integrator::camera_path::{Path, TerminatorState, unoccluded};
use crate::transport::light::LightPoint;
use crate::transport::ray::Ray;
use crate::transport::sampler::Sampler;

/// Both subpaths of a sample, reused for the next one so that nothing is allocated per path.
#[derive(Default)]
pub struct Subpaths {
    /// Vertices of the light subpath after the light's own: the vertex `y_i` has index `i - 1`.
    pub light: Vec<SubpathVertex>,
    /// The start of the light subpath, if there is one.
    pub start: Option<LightStart<f32>>,
    /// Vertices of the camera subpath after the lens: the vertex `z_i` has index `i - 1`.
    pub camera: Vec<SubpathVertex>,
    /// The point on the lens.
    pub lens: Vec3,
    /// Light that each edge of the camera subpath hit.
    pub hits: Vec<Option<Connection>>,
    /// Light outside the scene, and the number of camera vertices of its path.
    pub escape: Option<(Connection, u32)>,
    /// Time of emission of this sample's light, as an optical length.
    pub emitted: f32,
}

/// Light found by one connection, with the path that it was found along.
#[derive(Clone, Copy)]
pub struct ConnectedPath<'a> {
    /// The contribution to the film.
    pub contribution: Contribution,
    /// The MIS weight in it.
    pub weight: f64,
    /// The subpaths of the sample.
    pub subpaths: &'a Subpaths,
    /// The point of the light, if it is not the start of the light subpath: for `s <= 1` and `t >=
    /// 2`.
    pub point: Option<LightPoint>,
    /// Unit direction of the connecting edge towards the light; for `s = 0`, of the last edge.
    pub wi: Vec3,
    /// The point of the lens.
    pub lens: Vec3,
    /// The shared vertex with which the camera subpath was joined, if it is not one of its own light
    /// subpath.
    pub shared: Option<SharedVertex>,
    /// Number of samples by which the estimate was divided.
    pub samples: f64,
}

/// A vertex of a light subpath that all pixels share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SharedVertex {
    /// Vertex that was connected with the last one of the camera subpath.
    Connected(VertexId),
    /// Vertex that was merged with the last one of the camera subpath.
    Merged(VertexId),
}

/// Vertex of a light subpath that was drawn at random.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drawn {
    /// Position of the vertex.
    pub id: VertexId,
    /// Number of samples by which its estimate is divided.
    pub samples: f64,
}

/// The vertex and the light that a step found.
#[derive(Default)]
struct Found {
    vertex: Option<SubpathVertex>,
    light: Option<Connection>,
}

impl StepSink<f32, 1> for Found {
    fn add_vertices(
        &mut self,
        lanes: bool,
        (vertex, _): (&Vertex, &ShadingState<f32>),
        departure: &Departure<f32>,
    ) {
        self.vertex = lanes.then_some(SubpathVertex {
            vertex: *vertex,
            delta: departure.delta,
            eta: departure.eta,
        });
    }

    fn add_light(&mut self, light: &Connection) {
        self.light = Some(*light);
    }
}

thread_local! {
    /// Subpaths reused from sample to sample, so that nothing is allocated per path.
    static SUBPATHS: RefCell<Subpaths> = RefCell::default();
}

/// Computes one sample of one pixel, whose camera subpath continues in the given directions: see
/// [`SampleFn`](crate::transport::integrator::SampleFn).
pub fn sample(
    context: &Context,
    directions: impl SubpathDirections,
    pixel: [u32; 2],
    sampler: &mut Sampler,
    sink: &mut dyn FnMut(Contribution),
) {
    SUBPATHS.with_borrow_mut(|subpaths| {
        for_each_path(context, directions, pixel, sampler, subpaths, &mut |path| {
            sink(path.contribution)
        });
    });
}

/// Traces both subpaths of one sample and visits every path found by connecting them.
pub fn for_each_path(
    context: &Context,
    directions: impl SubpathDirections,
    pixel: [u32; 2],
    sampler: &mut Sampler,
    subpaths: &mut Subpaths,
    visit: &mut dyn FnMut(ConnectedPath),
) {
    let counts = StrategyCounts::ONE_EACH;
    subpaths.trace(context, (directions, &counts), pixel, sampler);
    let subpaths = &*subpaths;
    let mut reporter = Reporter {
        context,
        directions,
        counts,
        subpaths,
        pixel,
        visit,
    };
    reporter.report_escape();
    for edge in 0..subpaths.hits.len() {
        reporter.report_hit(edge);
        if let Some(z) = subpaths.camera.get(edge) {
            reporter.connect_camera_vertex(&z.vertex, edge as u32 + 2, sampler);
        }
    }
    reporter.connect_lens(sampler);
}

/// Traces the shadow rays of connections, and passes contributions to a visitor.
pub struct Reporter<'a, 'v, D> {
    /// Everything that stays the same from sample to sample.
    pub context: &'a Context<'a>,
    /// Directions in which camera subpaths continue.
    pub directions: D,
    /// Numbers of samples of the strategies that the weights combine.
    pub counts: StrategyCounts,
    /// The subpaths that are connected.
    pub subpaths: &'a Subpaths,
    /// The sample's own pixel.
    pub pixel: [u32; 2],
    /// Receives the paths.
    pub visit: &'v mut dyn FnMut(ConnectedPath),
}

impl<D: SubpathDirections> Reporter<'_, '_, D> {
    /// Reports the light that the camera subpath found outside the scene.
    pub fn report_escape(&mut self) {
        if let Some((connection, t)) = &self.subpaths.escape {
            self.report(connection, [0, *t]);
        }
    }

    /// Reports the light that an edge of the camera subpath hit, counted from 0.
    pub fn report_hit(&mut self, edge: usize) {
        if let Some(Some(connection)) = self.subpaths.hits.get(edge) {
            self.report(connection, [0, edge as u32 + 2]);
        }
    }

    /// Connects the camera vertex number `t` to a sampled light and to every vertex of the light
    /// subpath.
    pub fn connect_camera_vertex(&mut self, z: &Vertex, t: u32, sampler: &mut Sampler) {
        let subpaths = self.subpaths;
        if !z.bsdf.has_density() {
            return;
        }
        self.connect_light(z, t, sampler);
        for (y, s) in subpaths.light.iter().zip(2..) {
            if let Some(c) = self.connection(&y.vertex, z, [s, t]) {
                self.report(&c, [s, t]);
            }
        }
    }

    /// Connects the camera vertex number `t` to a sampled light.
    pub fn connect_light(&mut self, z: &Vertex, t: u32, sampler: &mut Sampler) {
        let Reporter {
            context,
            directions,
            ..
        } = *self;
        if context.settings.includes(1, t) {
            let mut lifted = *z;
            let lifts = lifted.lift();
            for z in std::iter::once(z).chain(lifts.then_some(&lifted)) {
                if let Some(c) = connect::connect_s1(context, directions, z, sampler, true) {
                    self.report(&c, [1, t]);
                }
            }
        }
    }

    /// Returns the connection of the camera vertex number `t` with vertex number `s` of a light
    /// subpath; `None` if it finds no light or gives a path that is too long.
    pub fn connection(&self, y: &Vertex, z: &Vertex, [s, t]: [u32; 2]) -> Option<Connection> {
        let (context, directions) = (self.context, self.directions);
        if s + t - 1 > context.max_depth
            || !y.bsdf.has_density()
            || !context.settings.includes(s, t)
        {
            return None;
        }
        let (lit, end) =
            connect::camera_end::<f32, 1>(context, directions, z, y.state.position, true);
        let from = z.state.towards_light(&z.terminator, y.state.position);
        if lit {
            connect::connect(context, directions, y, (&from, z.partials), &end, true)
        } else {
            None
        }
    }

    /// Connects the light subpath to the lens: its start and all its vertices.
    pub fn connect_lens(&mut self, sampler: &mut Sampler) {
        let Reporter {
            context,
            directions,
            subpaths,
            ..
        } = *self;
        if context.settings.includes(1, 1)
            && let Some(start) = &subpaths.start
            && let Some((c, lens)) = connect::connect_s1_t1(context, start, sampler, true)
        {
            self.report_at(&c, [1, 1], lens.pixels[0], lens.at.lens, None);
        }
        for (y, s) in subpaths.light.iter().zip(2..) {
            let y = &y.vertex;
            if y.bsdf.has_density()
                && context.settings.includes(s, 1)
                && let Some((c, lens)) =
                    connect::connect_t1(context, directions, (y, subpaths.emitted), sampler, true)
            {
                self.report_at(&c, [s, 1], lens.pixels[0], lens.at.lens, None);
            }
        }
    }

    /// Reports a connection that contributes to the sample's own pixel.
    fn report(&mut self, c: &Connection, strategy: [u32; 2]) {
        self.report_at(c, strategy, self.pixel, self.subpaths.lens, None);
    }

    /// Reports a connection with a drawn vertex.
    pub fn report_drawn(&mut self, c: &Connection, strategy: [u32; 2], drawn: Drawn) {
        self.report_at(c, strategy, self.pixel, self.subpaths.lens, Some(drawn));
    }

    /// Returns the MIS weight of a connection.
    pub fn weight(&self, c: &Connection, [s, t]: [u32; 2]) -> f64 {
        c.weight(self.context.settings, self.counts.of(s, t))
    }

    /// Reports a connection that contributes to `pixel` through the lens point `lens`.
    fn report_at(
        &mut self,
        c: &Connection,
        [s, t]: [u32; 2],
        pixel: [u32; 2],
        lens: Vec3,
        drawn: Option<Drawn>,
    ) {
        let lit = c
            .ray
            .as_ref()
            .is_none_or(|ray| unoccluded(self.context, ray));
        if !lit || !c.found {
            return;
        }
        let weight = self.weight(c, [s, t]);
        // Each of several samples has its share of the estimate.
        let samples = drawn.map_or(self.counts.of(s, t), |drawn| drawn.samples);
        let unweighted = c.share(samples);
        let contribution = Contribution {
            pixel,
            value: unweighted * weight as f32,
            unweighted,
            s,
            t,
            length: c.length,
        };
        (self.visit)(ConnectedPath {
            contribution,
            weight,
            subpaths: self.subpaths,
            point: c.point,
            wi: c.wi,
            lens,
            shared: drawn.map(|drawn| SharedVertex::Connected(drawn.id)),
            samples,
        });
    }
}

impl Subpaths {
    /// Traces both subpaths of a sample, with up to [`Context::max_depth`] edges each.
    fn trace(
        &mut self,
        context: &Context,
        (directions, counts): (impl SubpathDirections, &StrategyCounts),
        pixel: [u32; 2],
        sampler: &mut Sampler,
    ) {
        let mut subpath = self.trace_camera(context, (directions, counts), pixel, sampler);
        if context.max_depth > 0 {
            let (start, light, continues) =
                Subpath::from_light(context, subpath.path, self.emitted, true);
            subpath = light;
            self.start = (start.light != NONE).then_some(start);
            if continues {
                let max_edges = context.max_depth - 1;
                let mode = TransportMode::Importance;
                self.walk(context, (directions, counts), mode, max_edges, &mut subpath);
            }
        }
        *sampler = subpath.path.sampler;
    }

    /// Traces the camera subpath of a sample, with up to [`Context::max_depth`] edges, and removes
    /// the light subpath. Returns its last edge.
    pub fn trace_camera(
        &mut self,
        context: &Context,
        (directions, counts): (impl SubpathDirections, &StrategyCounts),
        pixel: [u32; 2],
        sampler: &mut Sampler,
    ) -> Subpath<f32> {
        let path = Path::<f32>::from_camera(context, pixel.map(|n| n as f32), *sampler);
        let mut subpath = Subpath::from_camera(context, counts, path);
        subpath.path.terminator = context
            .classes
            .have_terminators()
            .then(TerminatorState::none);
        self.lens = path.state.origin;
        self.emitted = path.time.map_or(0.0, |time| time.delays);
        self.hits.clear();
        self.escape = None;
        self.start = None;
        self.light.clear();
        let mode = TransportMode::Radiance;
        let max_edges = context.max_depth;
        self.walk(context, (directions, counts), mode, max_edges, &mut subpath);
        *sampler = subpath.path.sampler;
        subpath
    }

    /// Traces a subpath until it ends.
    fn walk(
        &mut self,
        context: &Context,
        (directions, counts): (impl SubpathDirections, &StrategyCounts),
        mode: TransportMode,
        max_edges: u32,
        subpath: &mut Subpath<f32>,
    ) {
        let from_camera = mode == TransportMode::Radiance;
        let mut vertices = std::mem::take(if from_camera {
            &mut self.camera
        } else {
            &mut self.light
        });
        vertices.clear();
        for edge in 1..=max_edges {
            let ray = Ray {
                origin: subpath.path.state.origin,
                dir: subpath.path.state.dir,
            };
            let Some(hit) = context.trace.closest(&ray, f32::INFINITY) else {
                if from_camera {
                    let escape = subpath.escape(context, counts, edge, true);
                    self.escape = escape.map(|connection| (connection, edge + 1));
                }
                break;
            };
            if from_camera && context.ends_unlit(edge, &hit) {
                break;
            }
            let hit = HitState::new(context.scene, &ray, &hit, || subpath.path.next_auxiliary());
            let class = &context.classes[context.classes.index_of(context.scene, &hit)];
            let arrival = Arrival::<f32, 1>::new(class, ray, &hit);
            let step = Step {
                mode,
                edge,
                max_edges,
                counts: *counts,
            };
            let mut found = Found::default();
            let departure = subpath.scatter(context, directions, step, &arrival, true, &mut found);
            if from_camera {
                self.hits.push(found.light);
            }
            vertices.extend(found.vertex);
            if !departure.continues {
                break;
            }
        }
        *(if from_camera {
            &mut self.camera
        } else {
            &mut self.light
        }) = vertices;
    }
}
