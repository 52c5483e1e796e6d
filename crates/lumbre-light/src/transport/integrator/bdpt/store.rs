//! Vertices of subpaths in memory.

use std::slice;

use super::state::{
    PartialsRecord, ShadingRecord, ShadingState, SubpathVertex, Vertex, VertexRecord, VertexState,
    load_partials,
};
use super::subpath::Departure;
use super::weights::MisPartials;
use crate::math::real::Mask;
use crate::math::simd::{Lanes, active_lanes, map_array};
use crate::scene::compile::NONE;
use crate::transport::integrator::Context;

/// Surface and event of a stored vertex.
#[derive(Clone, Copy, Debug)]
pub struct VertexEvent {
    /// Index of the surface's class.
    pub class: u32,
    /// Index ratio crossed by the Dirac event that leads to the next vertex; 0 for other events.
    eta: f32,
    /// Probability with which the mask of the surface accepted the hit: see
    /// [`Arrival::acceptance`](crate::transport::arrival::Arrival::acceptance).
    acceptance: f32,
    /// Number of edges from the start of the subpath.
    edge: u16,
    /// Whether a surface may scatter light there from more than isolated directions.
    scatters: bool,
    /// Whether the vertex can be connected: its own BSDF has a density.
    pub connects: bool,
}

impl VertexEvent {
    /// Returns the number of edges from the start of the subpath.
    pub fn edges(&self) -> u32 {
        u32::from(self.edge)
    }

    /// Returns whether a surface may scatter light there from more than isolated directions.
    pub fn scatters(&self) -> bool {
        self.scatters
    }

    /// Returns the probability with which the mask of the surface accepted the hit. What another
    /// path that was accepted itself gathers there is divided by it.
    pub fn acceptance(&self) -> f32 {
        self.acceptance
    }

    /// Returns whether the event that leads to the next vertex is a Dirac event.
    pub fn is_delta(&self) -> bool {
        self.eta > 0.0
    }
}

/// Position of a vertex in several stores.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct VertexId {
    unit: u32,
    index: u32,
}

impl VertexId {
    /// Returns the vertex with an index in the store of a unit of work.
    pub fn new(unit: usize, index: u32) -> VertexId {
        let unit = unit as u32;
        VertexId { unit, index }
    }

    /// Returns the index of the store.
    pub fn unit(self) -> usize {
        self.unit as usize
    }

    /// Returns the index in the store.
    pub fn index(self) -> usize {
        self.index as usize
    }
}

/// Surfaces at which the subpaths in the lanes of a vector arrived.
#[derive(Clone, Copy)]
pub struct ArrivedAt<const N: usize> {
    /// Index of the surfaces' class.
    pub class: usize,
    /// Number of edges from the start of the subpaths.
    pub edge: u32,
    /// Indices of the components of composed materials, or [`NONE`].
    pub components: [u32; N],
    /// Probabilities with which the masks of the surfaces accepted the hits.
    pub acceptance: [f32; N],
}

/// Vertices of subpaths, in the order in which they were added.
#[derive(Default)]
pub struct VertexStore {
    records: Vec<VertexRecord>,
    partials: Vec<PartialsRecord>,
    events: Vec<VertexEvent>,
    /// Empty in scenes where no surface has such properties.
    shading: Vec<ShadingRecord>,
    has_shading: bool,
}

impl VertexStore {
    /// Bytes of a vertex.
    pub const VERTEX_BYTES: usize = size_of::<VertexRecord>()
        + size_of::<PartialsRecord>()
        + size_of::<ShadingRecord>()
        + size_of::<VertexEvent>();

    /// Creates a store without vertices for the scene of a context.
    pub fn new(context: &Context) -> VertexStore {
        VertexStore {
            has_shading: context.classes.have_shading(),
            ..VertexStore::default()
        }
    }

    /// Removes all vertices, for the scene of a context.
    pub fn reset(&mut self, context: &Context) {
        self.records.clear();
        self.partials.clear();
        self.events.clear();
        self.shading.clear();
        self.has_shading = context.classes.have_shading();
    }

    /// Frees memory for vertices that were not added.
    pub fn shrink(&mut self) {
        self.records.shrink_to_fit();
        self.partials.shrink_to_fit();
        self.events.shrink_to_fit();
        self.shading.shrink_to_fit();
    }

    /// Returns the number of vertices.
    pub fn count(&self) -> usize {
        self.records.len()
    }

    /// Returns the surfaces and events of all vertices.
    pub fn events(&self) -> &[VertexEvent] {
        &self.events
    }

    /// Appends the vertices in the given lanes.
    #[inline(always)]
    pub fn push<R: Lanes<N>, const N: usize>(
        &mut self,
        at: &ArrivedAt<N>,
        lanes: R::Mask,
        (vertices, shading): (&Vertex<R>, &ShadingState<R>),
        departure: &Departure<R>,
    ) {
        let (records, partials) = vertices.store::<N>();
        let connects = vertices.bsdf.has_density().bits();
        let etas = R::select(departure.delta, departure.eta, R::splat(0.0)).store();
        let shading = self
            .has_shading
            .then(|| ShadingRecord::store::<R, N>(*shading));
        for i in active_lanes(lanes.bits()) {
            let connects = connects & 1 << i != 0;
            self.records.push(records[i]);
            self.partials.push(partials[i]);
            self.events.push(VertexEvent {
                class: at.class as u32,
                eta: etas[i],
                acceptance: at.acceptance[i],
                edge: at.edge as u16,
                // Camera paths draw their own component of a composed material.
                scatters: connects || at.components[i] != NONE,
                connects,
            });
            if let Some(shading) = &shading {
                self.shading.push(shading[i]);
            }
        }
    }

    /// Appends a vertex of another store for the same scene.
    pub fn push_from(&mut self, other: &VertexStore, index: usize) {
        self.records.push(other.records[index]);
        self.partials.push(other.partials[index]);
        self.events.push(other.events[index]);
        self.shading.extend(other.shading.get(index));
    }

    /// Returns a vertex without its BSDF.
    pub fn state(&self, index: usize) -> (VertexState<f32>, MisPartials) {
        let [d_vcm, d_vc] = self.partials[index];
        let state = VertexRecord::load([&self.records[index]]);
        (state, MisPartials { d_vcm, d_vc })
    }

    /// Returns a vertex with its BSDF.
    pub fn vertex(&self, context: &Context, index: usize) -> SubpathVertex {
        let event = &self.events[index];
        SubpathVertex {
            vertex: self.load::<f32, 1>(context, event.class as usize, [index as u32]),
            delta: event.is_delta(),
            eta: if event.is_delta() { event.eta } else { 1.0 },
        }
    }

    /// Returns whether a vertex has an offset against the shadow terminator, in a scene with such
    /// offsets.
    pub fn lifts(&self, index: usize) -> bool {
        ShadingRecord::load::<f32, 1>([&self.shading[index]]).lifts > 0.0
    }

    /// Returns the surface and event of a vertex.
    #[inline]
    pub fn event(stores: &[VertexStore], id: VertexId) -> &VertexEvent {
        &stores[id.unit()].events[id.index()]
    }

    /// Loads vertices without their BSDFs.
    #[inline(always)]
    pub fn states<R: Lanes<N>, const N: usize>(
        stores: &[VertexStore],
        ids: [VertexId; N],
    ) -> VertexState<R> {
        VertexRecord::load(rows(stores, ids, |store| &store.records))
    }

    /// Loads light vertices that merge with camera vertices, without their BSDFs. Their throughput
    /// is that of light on covered points: both subpaths were accepted by the mask of the one
    /// surface, which counts once.
    #[inline(always)]
    pub fn merging_states<R: Lanes<N>, const N: usize>(
        stores: &[VertexStore],
        ids: [VertexId; N],
    ) -> VertexState<R> {
        let state = VertexStore::states::<R, N>(stores, ids);
        let acceptance = map_array(ids, |id| VertexStore::event(stores, id).acceptance);
        let covered = R::splat(1.0) / R::load(&acceptance);
        VertexState {
            throughput: state.throughput * covered,
            ..state
        }
    }

    /// Loads the partial sums of vertices.
    #[inline(always)]
    pub fn partials<R: Lanes<N>, const N: usize>(
        stores: &[VertexStore],
        ids: [VertexId; N],
    ) -> MisPartials<R::Double> {
        let records = rows(stores, ids, |store| &store.partials);
        let [d_vcm, d_vc] = load_partials::<R, N>(records);
        MisPartials { d_vcm, d_vc }
    }

    /// Loads camera vertices as starts of edges towards light at `point`: see
    /// [`VertexState::load_towards`].
    #[inline(always)]
    pub fn towards<R: Lanes<N>, const N: usize>(
        &self,
        context: &Context,
        indices: [u32; N],
        point: R::Vec3,
    ) -> (VertexState<R>, MisPartials<R::Double>) {
        VertexState::load_towards::<N>(
            map_array(indices, |i| &self.records[i as usize]),
            map_array(indices, |i| &self.partials[i as usize]),
            context
                .classes
                .have_terminators()
                .then(|| map_array(indices, |i| &self.shading[i as usize])),
            point,
        )
    }

    /// Loads vertices on surfaces of the class with an index.
    #[inline(always)]
    pub fn load<R: Lanes<N>, const N: usize>(
        &self,
        context: &Context,
        class: usize,
        indices: [u32; N],
    ) -> Vertex<R> {
        let ids = map_array(indices, |index| VertexId::new(0, index));
        VertexStore::load_from(slice::from_ref(self), context, class, ids)
    }

    /// Loads vertices of several stores on surfaces of the class with an index.
    #[inline(always)]
    pub fn load_from<R: Lanes<N>, const N: usize>(
        stores: &[VertexStore],
        context: &Context,
        class: usize,
        ids: [VertexId; N],
    ) -> Vertex<R> {
        let shading = context
            .classes
            .have_shading()
            .then(|| rows(stores, ids, |store| &store.shading));
        Vertex::load::<N>(
            context,
            class,
            rows(stores, ids, |store| &store.records),
            rows(stores, ids, |store| &store.partials),
            shading,
        )
    }
}

/// Returns the rows of a column of several stores.
#[inline(always)]
fn rows<'a, T, const N: usize>(
    stores: &'a [VertexStore],
    ids: [VertexId; N],
    column: impl Fn(&'a VertexStore) -> &'a [T],
) -> [&'a T; N] {
    // Tiles that trace their own subpaths have one store.
    if let [store] = stores {
        let column = column(store);
        map_array(ids, |id| &column[id.index()])
    } else {
        map_array(ids, |id| &column(&stores[id.unit()])[id.index()])
    }
}

/// A vertex of a light subpath that can be connected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CachedVertex {
    /// Place of the vertex in memory.
    pub id: VertexId,
    /// Number of edges from the light.
    pub edges: u32,
}
