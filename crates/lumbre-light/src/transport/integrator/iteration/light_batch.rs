//! Light subpaths of one unit of work: their tracing, and their vertices in memory.

use std::ops::Range;

use crate::transport::arrival::{Arrival, HitState};
use crate::transport::bsdf::TransportMode;
use crate::transport::integrator::Context;
use crate::transport::integrator::bdpt::connect::Connection;
use crate::transport::integrator::bdpt::directions::BsdfDirections;
use crate::transport::integrator::bdpt::state::{LightStart, ShadingState, Subpath, Vertex};
use crate::transport::integrator::bdpt::store::{ArrivedAt, VertexStore};
use crate::transport::integrator::bdpt::subpath::{Departure, Step, StepSink};
use crate::transport::integrator::bdpt::weights::StrategyCounts;
use crate::transport::integrator::camera_path::Path;
use crate::transport::ray::Ray;
use crate::transport::sampler::{Sampler, SamplerRow};

/// Bytes of a light subpath besides its vertices.
pub const PATH_BYTES: usize = size_of::<LightStart<f32>>() + size_of::<u32>();

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
pub(super) struct PathTable {
    /// Starts of the subpaths; their light is [`NONE`](crate::scene::compile::NONE) if there is none.
    pub(super) starts: Vec<LightStart<f32>>,
    /// Index of the first vertex of each subpath, and the number of vertices.
    pub(super) first: Vec<u32>,
}

/// Light subpaths of one unit of work, with all their vertices on surfaces.
pub struct LightUnit {
    pub(super) table: PathTable,
    pub(super) store: VertexStore,
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
