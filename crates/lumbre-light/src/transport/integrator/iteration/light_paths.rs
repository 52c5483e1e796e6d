//! Light subpaths that belong to no pixel: their tracing, and their vertices in memory.

use std::ops::Range;

use super::{Iteration, Resources};
use crate::scene::compile::NONE;
use crate::transport::arrival::{Arrival, HitState};
use crate::transport::bsdf::TransportMode;
use crate::transport::integrator::Context;
use crate::transport::integrator::bdpt::connect::Connection;
use crate::transport::integrator::bdpt::directions::BsdfDirections;
use crate::transport::integrator::bdpt::single::Subpaths;
use crate::transport::integrator::bdpt::state::{
    LightStart, ShadingState, Subpath, SubpathVertex, Vertex, VertexState,
};
use crate::transport::integrator::bdpt::store::{ArrivedAt, CachedVertex, VertexId, VertexStore};
use crate::transport::integrator::bdpt::subpath::{Departure, Step, StepSink};
use crate::transport::integrator::bdpt::weights::StrategyCounts;
use crate::transport::integrator::camera_path::Path;
use crate::transport::ray::Ray;
use crate::transport::sampler::{Sampler, SamplerRow};

/// Number of light subpaths that a thread traces at a time.
pub const UNIT: u64 = 1024;

/// Bytes of a light subpath besides its vertices.
pub const PATH_BYTES: usize = size_of::<LightStart<f32>>() + size_of::<u32>();

/// Bytes of a stored vertex.
pub const VERTEX_BYTES: usize = VertexStore::VERTEX_BYTES;

/// Light subpaths to be traced, whose random numbers are consecutive samples of one sequence.
#[derive(Clone, Copy, Debug)]
pub struct LightBatch {
    /// Generator of random numbers.
    pub sampler: &'static SamplerRow,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Column and row that key the random numbers; no pixel of the picture.
    pub pixel: [u32; 2],
    /// Index of the first sample.
    pub first: u64,
    /// Number of subpaths.
    pub count: u64,
    /// Numbers of samples of the strategies whose weights the vertices are for.
    pub counts: StrategyCounts,
}

impl LightBatch {
    /// Returns the indices of the samples.
    pub fn samples(&self) -> impl Iterator<Item = u64> {
        let first = self.first;
        (0..self.count).map(move |i| first.wrapping_add(i))
    }

    /// Traces the subpaths one after the other.
    pub fn trace_single(&self, context: &Context) -> LightUnit {
        let mut unit = LightUnit::new(context);
        for sample in self.samples() {
            let sampler = self.sampler.start(self.seed, self.pixel, sample);
            let start = follow(context, self.counts, sampler, &mut unit.store);
            unit.end_path(start);
        }
        unit
    }
}

/// Starts of light subpaths, and the places of their vertices in a store.
struct PathTable {
    /// Starts of the subpaths; their light is [`NONE`] if there is none.
    starts: Vec<LightStart<f32>>,
    /// Index of the first vertex of each subpath, and the number of vertices.
    first: Vec<u32>,
}

/// Light subpaths of one unit of work, with all their vertices on surfaces.
pub struct LightUnit {
    table: PathTable,
    store: VertexStore,
}

impl LightUnit {
    /// Creates a unit without subpaths.
    pub fn new(context: &Context) -> LightUnit {
        LightUnit {
            table: PathTable {
                starts: Vec::new(),
                first: vec![0],
            },
            store: VertexStore::new(context),
        }
    }

    /// Appends a subpath whose vertices are in another store.
    pub fn push_path(
        &mut self,
        start: LightStart<f32>,
        from: &VertexStore,
        vertices: impl Iterator<Item = u32>,
    ) {
        vertices.for_each(|index| self.store.push_from(from, index as usize));
        self.end_path(start);
    }

    /// Completes a subpath whose vertices were appended.
    fn end_path(&mut self, start: LightStart<f32>) {
        self.table.first.push(self.store.count() as u32);
        self.table.starts.push(start);
    }

    /// Returns the vertices of all subpaths.
    pub fn store(&self) -> &VertexStore {
        &self.store
    }

    /// Returns the starts of all subpaths, each with the indices of its vertices.
    pub fn paths(&self) -> impl Iterator<Item = (&LightStart<f32>, Range<usize>)> {
        let indices = self.table.first.windows(2);
        let ranges = indices.map(|pair| pair[0] as usize..pair[1] as usize);
        self.table.starts.iter().zip(ranges)
    }
}

/// Appends the vertices that the steps of one subpath find.
struct StoreSink<'a> {
    at: ArrivedAt<1>,
    store: &'a mut VertexStore,
}

impl StepSink<f32, 1> for StoreSink<'_> {
    fn add_vertices(
        &mut self,
        lanes: bool,
        vertices: (&Vertex, &ShadingState<f32>),
        departure: &Departure<f32>,
    ) {
        self.store
            .push::<f32, 1>(&self.at, lanes, vertices, departure);
    }

    fn add_light(&mut self, _: &Connection) {}
}

/// Returns the greatest number of edges of a light subpath.
pub fn max_edges(context: &Context) -> u32 {
    context.max_depth.saturating_sub(1)
}

/// Follows a light subpath and appends its vertices on surfaces to `store`, in order. `counts` are
/// those of the strategies whose weights its vertices are for. Returns the start of the subpath,
/// whose light is [`NONE`] if there is none.
fn follow(
    context: &Context,
    counts: StrategyCounts,
    sampler: Sampler,
    store: &mut VertexStore,
) -> LightStart<f32> {
    let max_edges = max_edges(context);
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
        let at = ArrivedAt {
            class,
            edge,
            components: arrival.components,
            acceptance: arrival.acceptance(context.classes, context.scene),
        };
        let mut sink = StoreSink { at, store };
        let departure = subpath.scatter(context, BsdfDirections, step, &arrival, true, &mut sink);
        continues = departure.continues;
    }
    start
}

/// The light subpaths of an iteration, with all their vertices on surfaces.
pub struct LightPaths {
    count: u64,
    /// Starts of the subpaths, by unit of work.
    tables: Vec<PathTable>,
    /// Vertices by unit of work.
    stores: Vec<VertexStore>,
}

impl LightPaths {
    /// Traces `count` light subpaths on all threads.
    pub fn trace(iteration: &Iteration, count: u64, counts: StrategyCounts) -> LightPaths {
        let units = iteration.map(count.div_ceil(UNIT) as usize, |context, unit| {
            let first = unit as u64 * UNIT;
            let paths = first..(first + UNIT).min(count);
            let mut unit = iteration.trace_light(context, paths, count, counts);
            unit.store.shrink();
            unit
        });
        let (tables, stores) = units
            .into_iter()
            .map(|LightUnit { table, store }| (table, store))
            .unzip();
        LightPaths {
            count,
            tables,
            stores,
        }
    }

    /// Returns no subpaths.
    #[cfg(test)]
    pub fn none() -> LightPaths {
        LightPaths {
            count: 0,
            tables: Vec::new(),
            stores: Vec::new(),
        }
    }

    /// Returns the number of subpaths.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Returns the vertices of all units of work.
    pub fn stores(&self) -> &[VertexStore] {
        &self.stores
    }

    /// Visits the vertices of a unit at which surfaces may scatter light from more than isolated
    /// directions, each with its number of edges from the light.
    pub fn for_each_scattering(
        &self,
        unit: usize,
        mut visit: impl FnMut(VertexId, u32, &VertexState<f32>),
    ) {
        let store = &self.stores[unit];
        for (index, event) in store.events().iter().enumerate() {
            if event.scatters() {
                let id = VertexId::new(unit, index as u32);
                visit(id, event.edges(), &store.state(index).0);
            }
        }
    }

    /// Returns the vertices of a unit that can be connected.
    pub fn connected(&self, unit: usize) -> Vec<CachedVertex> {
        let events = self.stores[unit].events().iter().zip(0..);
        let connected = events.filter(|(event, _)| event.connects);
        connected
            .map(|(event, index)| CachedVertex {
                id: VertexId::new(unit, index),
                edges: event.edges(),
            })
            .collect()
    }

    /// Replaces the light subpath of a sample by a shared one.
    pub fn load_into(&self, context: &Context, path: u64, subpaths: &mut Subpaths) {
        subpaths.start = self.load(context, path, &mut subpaths.light);
        if let Some(start) = &mut subpaths.start {
            start.emitted = subpaths.emitted;
        }
    }

    /// Returns a vertex with its BSDF.
    pub fn vertex(&self, context: &Context, id: VertexId) -> SubpathVertex {
        self.stores[id.unit()].vertex(context, id.index())
    }

    /// Returns the subpath to which a vertex belongs.
    pub fn path_of(&self, id: VertexId) -> u64 {
        let first = &self.tables[id.unit()].first;
        let after = first.partition_point(|first| *first as usize <= id.index());
        id.unit() as u64 * UNIT + after as u64 - 1
    }

    /// Returns the start of a subpath, whose light is [`NONE`] if there is none.
    pub fn start(&self, path: u64) -> LightStart<f32> {
        self.tables[(path / UNIT) as usize].starts[(path % UNIT) as usize]
    }

    /// Returns the index of the store of a subpath's vertices, and their indices in it.
    pub fn vertices(&self, path: u64) -> (usize, Range<u32>) {
        let (unit, at) = ((path / UNIT) as usize, (path % UNIT) as usize);
        let first = &self.tables[unit].first;
        (unit, first[at]..first[at + 1])
    }

    /// Loads a subpath into `vertices` and returns its start, if it has one.
    pub fn load(
        &self,
        context: &Context,
        path: u64,
        vertices: &mut Vec<SubpathVertex>,
    ) -> Option<LightStart<f32>> {
        vertices.clear();
        let (unit, indices) = self.vertices(path);
        vertices.extend(indices.map(|index| self.vertex(context, VertexId::new(unit, index))));
        Some(self.start(path)).filter(|start| start.light != NONE)
    }
}

impl Resources<'_> {
    /// Traces light subpaths from which the job is prepared; the first has the number `first`.
    /// `context` is that of a unit of work.
    pub fn trace_light(
        &self,
        context: &Context,
        first: u64,
        count: u64,
        counts: StrategyCounts,
    ) -> LightUnit {
        let batch = LightBatch {
            sampler: self.sampler,
            seed: self.seed,
            pixel: super::PREPARED,
            first,
            count,
            counts,
        };
        self.workers.trace_light(context, &batch)
    }
}

impl Iteration<'_> {
    /// Traces light subpaths with the given numbers below `count`, which is their number in the
    /// iteration. `context` is that of a unit of work. Their random numbers are those of
    /// [`Iteration::path_sampler`].
    pub fn trace_light(
        &self,
        context: &Context,
        paths: Range<u64>,
        count: u64,
        counts: StrategyCounts,
    ) -> LightUnit {
        let Resources {
            seed,
            sampler,
            workers,
            ..
        } = self.resources;
        let batch = LightBatch {
            sampler,
            seed,
            pixel: super::NO_PIXEL,
            first: self.sample(paths.start, count),
            count: paths.end - paths.start,
            counts,
        };
        workers.trace_light(context, &batch)
    }
}
