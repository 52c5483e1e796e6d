//! The light subpaths of an iteration, which belong to no pixel, and their vertices in memory.

use std::ops::Range;

use super::light_batch::{LightBatch, LightUnit, PathTable};
use super::{Iteration, Resources};
use crate::scene::compile::NONE;
use crate::transport::integrator::Context;
use crate::transport::integrator::bdpt::single::Subpaths;
use crate::transport::integrator::bdpt::state::{LightStart, SubpathVertex, VertexState};
use crate::transport::integrator::bdpt::store::{CachedVertex, VertexId, VertexStore};
use crate::transport::integrator::bdpt::weights::StrategyCounts;

/// Number of light subpaths that a thread traces at a time.
pub const UNIT: u64 = 1024;

/// Bytes of a stored vertex.
pub const VERTEX_BYTES: usize = VertexStore::VERTEX_BYTES;

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
