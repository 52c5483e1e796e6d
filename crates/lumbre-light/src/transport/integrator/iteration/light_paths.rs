//! Light subpaths that belong to no pixel: their tracing, and their vertices in memory.

use super::Iteration;
use crate::scene::compile::NONE;
use crate::transport::arrival::{Arrival, HitState};
use crate::transport::bsdf::TransportMode;
use crate::transport::integrator::Context;
use crate::transport::integrator::bdpt::connect::Connection;
use crate::transport::integrator::bdpt::single::SubpathVertex;
use crate::transport::integrator::bdpt::state::{
    LightStart, PartialsRecord, ShadingRecord, ShadingState, Subpath, Vertex, VertexRecord,
    VertexState,
};
use crate::transport::integrator::bdpt::subpath::{Departure, Step, StepSink};
use crate::transport::integrator::bdpt::weights::{MisPartials, StrategyCounts};
use crate::transport::integrator::camera_path::Path;
use crate::transport::ray::Ray;
use crate::transport::sampler::Sampler;

/// Number of light subpaths that a thread traces at a time.
pub const UNIT: u64 = 1024;

/// Bytes of a light subpath besides its vertices.
pub const PATH_BYTES: usize = size_of::<LightStart<f32>>() + size_of::<u32>();

/// Bytes of a stored vertex.
pub const VERTEX_BYTES: usize = size_of::<VertexRecord>()
    + size_of::<PartialsRecord>()
    + size_of::<ShadingRecord>()
    + size_of::<Event>();

/// A vertex at which a light subpath arrived.
pub struct LightVertex<'a> {
    /// Index of the light at which the subpath starts.
    pub light: u32,
    /// Number of edges from the light.
    pub edge: u32,
    /// Index of the surface's class.
    pub class: usize,
    /// Whether the material is one component of a composed material.
    pub composed: bool,
    /// The vertex with its BSDF.
    pub vertex: &'a Vertex,
    /// Properties that only some surfaces have.
    pub shading: &'a ShadingState<f32>,
    /// The event that leads to the next vertex.
    pub departure: Departure<f32>,
}

/// The vertex that a step found.
#[derive(Default)]
struct Found(Option<(Vertex, ShadingState<f32>)>);

impl StepSink<f32, 1> for Found {
    fn add_vertices(&mut self, lanes: bool, vertex: &Vertex, shading: &ShadingState<f32>) {
        self.0 = lanes.then_some((*vertex, *shading));
    }

    fn add_light(&mut self, _: &Connection) {}
}

/// Follows a light subpath of up to `max_depth - 1` edges and visits its vertices on surfaces, in
/// order. `counts` are those of the strategies whose weights its vertices are for. Returns the start
/// of the subpath, whose light is [`NONE`] if there is none.
pub fn follow(
    context: &Context,
    counts: StrategyCounts,
    sampler: Sampler,
    mut visit: impl FnMut(LightVertex),
) -> LightStart<f32> {
    let max_edges = context.max_depth.saturating_sub(1);
    let path = Path::unplaced(context, sampler);
    let (start, mut subpath, mut continues) = Subpath::from_light(context, path, 0.0, true);
    let mut edge = 0;
    while continues && edge < max_edges {
        edge += 1;
        let ray = Ray {
            origin: subpath.path.state.origin,
            dir: subpath.path.state.dir,
        };
        let Some(hit) = context.trace.closest(&ray, f32::INFINITY) else {
            break;
        };
        let hit = HitState::new(context.scene, &ray, &hit, || subpath.path.next_auxiliary());
        let class = context.classes.index_of(context.scene, &hit);
        let arrival = Arrival::<f32, 1>::new(&context.classes[class], ray, &hit);
        let step = Step {
            mode: TransportMode::Importance,
            edge,
            max_edges,
            counts,
        };
        let mut found = Found::default();
        let departure = subpath.scatter(context, step, &arrival, true, &mut found);
        if let Found(Some((vertex, shading))) = &found {
            visit(LightVertex {
                light: start.light,
                edge,
                class,
                composed: hit.component != NONE,
                vertex,
                shading,
                departure,
            });
        }
        continues = departure.continues;
    }
    start
}

/// Position of a vertex in [`LightPaths`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct VertexId {
    unit: u32,
    index: u32,
}

impl VertexId {
    /// Returns the vertex with an index in a unit of work.
    pub fn new(unit: usize, index: u32) -> VertexId {
        let unit = unit as u32;
        VertexId { unit, index }
    }
}

/// Surface and event of a vertex, stored besides its state.
#[derive(Clone, Copy, Debug)]
struct Event {
    /// Index of the surface's class.
    class: u32,
    /// Index ratio crossed by the Dirac event that leads to the next vertex; 0 for other events.
    eta: f32,
    /// Number of edges from the light.
    edge: u16,
    /// Whether a surface may scatter light there from more than isolated directions.
    scatters: bool,
    /// Whether the vertex can be connected: its own BSDF has a density.
    connects: bool,
}

/// Light subpaths of one unit of work.
#[derive(Default)]
struct Unit {
    starts: Vec<LightStart<f32>>,
    /// Index of the first vertex of each subpath, and the number of vertices.
    first: Vec<u32>,
    vertices: Vec<VertexRecord>,
    partials: Vec<PartialsRecord>,
    events: Vec<Event>,
    /// Empty in scenes where no surface has such properties.
    shading: Vec<ShadingRecord>,
}

/// The light subpaths of an iteration, with all their vertices on surfaces.
pub struct LightPaths {
    count: u64,
    units: Vec<Unit>,
}

impl LightPaths {
    /// Traces `count` light subpaths on all threads.
    pub fn trace(iteration: &Iteration, count: u64, counts: StrategyCounts) -> LightPaths {
        let units = iteration.map(count.div_ceil(UNIT) as usize, |context, unit| {
            let first = unit as u64 * UNIT;
            let mut paths = Unit::default();
            for path in first..(first + UNIT).min(count) {
                paths.push(context, counts, iteration.path_sampler(path, count));
            }
            paths.finish();
            paths
        });
        LightPaths { count, units }
    }

    /// Returns the number of subpaths.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Returns the number of units of work.
    pub fn units(&self) -> usize {
        self.units.len()
    }

    /// Visits the vertices of a unit at which surfaces may scatter light from more than isolated
    /// directions.
    pub fn for_each_scattering(
        &self,
        unit: usize,
        mut visit: impl FnMut(VertexId, &VertexState<f32>),
    ) {
        let Unit {
            vertices, events, ..
        } = &self.units[unit];
        for (index, (record, event)) in vertices.iter().zip(events).enumerate() {
            if event.scatters {
                visit(
                    VertexId::new(unit, index as u32),
                    &VertexRecord::load([record]),
                );
            }
        }
    }

    /// Returns the indices of the vertices of a unit that can be connected.
    pub fn connected(&self, unit: usize) -> Vec<u32> {
        let events = self.units[unit].events.iter().zip(0..);
        let connected = events.filter(|(event, _)| event.connects);
        connected.map(|(_, index)| index).collect()
    }

    /// Returns a vertex with its number of edges from the light.
    pub fn vertex(&self, context: &Context, id: VertexId) -> (u32, SubpathVertex) {
        let (unit, index) = (&self.units[id.unit as usize], id.index as usize);
        (
            u32::from(unit.events[index].edge),
            unit.load(context, index),
        )
    }

    /// Returns a vertex without its BSDF: the number of edges from the light, the state, and the
    /// partial sums of MIS terms.
    pub fn state(&self, id: VertexId) -> (u32, VertexState<f32>, MisPartials) {
        let (unit, index) = (&self.units[id.unit as usize], id.index as usize);
        let [d_vcm, d_vc] = unit.partials[index];
        let state = VertexRecord::load([&unit.vertices[index]]);
        let edge = u32::from(unit.events[index].edge);
        (edge, state, MisPartials { d_vcm, d_vc })
    }

    /// Returns the subpath to which a vertex belongs.
    pub fn path_of(&self, id: VertexId) -> u64 {
        let first = &self.units[id.unit as usize].first;
        let after = first.partition_point(|first| *first <= id.index);
        u64::from(id.unit) * UNIT + after as u64 - 1
    }

    /// Loads a subpath into `vertices` and returns its start, if it has one.
    pub fn load(
        &self,
        context: &Context,
        path: u64,
        vertices: &mut Vec<SubpathVertex>,
    ) -> Option<LightStart<f32>> {
        let unit = &self.units[(path / UNIT) as usize];
        let at = (path % UNIT) as usize;
        vertices.clear();
        let range = unit.first[at] as usize..unit.first[at + 1] as usize;
        vertices.extend(range.map(|index| unit.load(context, index)));
        Some(unit.starts[at]).filter(|start| start.light != NONE)
    }
}

impl Unit {
    /// Traces a subpath and appends it.
    fn push(&mut self, context: &Context, counts: StrategyCounts, sampler: Sampler) {
        let has_shading = context.classes.have_shading();
        self.first.push(self.vertices.len() as u32);
        let start = follow(context, counts, sampler, |found| {
            let ([record], [partials]) = found.vertex.store::<1>();
            self.vertices.push(record);
            self.partials.push(partials);
            self.events.push(Event {
                class: found.class as u32,
                eta: if found.departure.delta {
                    found.departure.eta
                } else {
                    0.0
                },
                edge: found.edge as u16,
                // Camera paths draw their own component of a composed material.
                scatters: found.composed || found.vertex.bsdf.has_density(),
                connects: found.vertex.bsdf.has_density(),
            });
            if has_shading {
                let [shading] = ShadingRecord::store::<f32, 1>(*found.shading);
                self.shading.push(shading);
            }
        });
        self.starts.push(start);
    }

    /// Completes the unit after its last subpath.
    fn finish(&mut self) {
        self.first.push(self.vertices.len() as u32);
        self.vertices.shrink_to_fit();
        self.partials.shrink_to_fit();
        self.events.shrink_to_fit();
        self.shading.shrink_to_fit();
    }

    /// Loads a vertex with its BSDF.
    fn load(&self, context: &Context, index: usize) -> SubpathVertex {
        let event = &self.events[index];
        SubpathVertex {
            vertex: Vertex::load::<1>(
                context,
                event.class as usize,
                [&self.vertices[index]],
                [&self.partials[index]],
                self.shading.get(index).map(|shading| [shading]),
            ),
            delta: event.eta > 0.0,
            eta: if event.eta > 0.0 { event.eta } else { 1.0 },
        }
    }
}
