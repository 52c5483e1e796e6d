//! Vertices of the subpaths of a tile, and the light that camera subpaths hit.

use glam::Vec3;

use super::stored::{store_light, stored_light};
use lumbre_light::math::real::Mask;
use lumbre_light::math::simd::{Lanes, active_lanes, map_array};
use lumbre_light::scene::compile::NONE;
use lumbre_light::transport::bsdf::TransportMode;
use lumbre_light::transport::integrator::Context;
use lumbre_light::transport::integrator::bdpt::connect::Connection;
use lumbre_light::transport::integrator::bdpt::state::{LightStartRecord, ShadingState, Vertex};
use lumbre_light::transport::integrator::bdpt::store::{ArrivedAt, VertexStore};
use lumbre_light::transport::integrator::bdpt::subpath::Departure;

/// Everything that the subpaths of a tile leave for connections.
#[derive(Default)]
pub(super) struct Vertices {
    pub camera: TileVertices,
    pub light: TileVertices,
    pub starts: LightStarts,
    pub hits: Hits,
}

/// Vertices of the subpaths of a tile from the camera or from lights.
#[derive(Default)]
pub(super) struct TileVertices {
    /// The vertices, in the order in which they were found.
    pub store: VertexStore,
    /// Index of the vertex at the end of each edge of each path, or [`NONE`].
    at: EdgeTable,
}

/// An index for each edge of each path of a tile, or [`NONE`].
#[derive(Default)]
pub(super) struct EdgeTable {
    /// Indices by edge, then by path.
    indices: Vec<u32>,
    paths: usize,
}

/// Light that the camera subpaths of a tile hit.
#[derive(Default)]
pub(super) struct Hits {
    pub found: Vec<HitLight>,
    /// Index of the light that each edge hit, or [`NONE`].
    pub at: EdgeTable,
    /// Index of the light outside the scene that each path found, or [`NONE`].
    pub escaped: Vec<u32>,
}

/// Light found with `s = 0`.
#[derive(Clone, Copy)]
pub(super) struct HitLight {
    /// Radiance, multiplied by its MIS weight.
    pub value: Vec3,
    pub unweighted: Vec3,
    /// Optical length; 0 without a time axis.
    pub length: f64,
    /// Number of camera vertices, with the lens and the light.
    pub t: u32,
}

/// Starts of the light subpaths of a tile.
#[derive(Default)]
pub(super) struct LightStarts {
    /// Start of each light subpath; empty if paths have no edges.
    pub records: Vec<LightStartRecord>,
    /// Time of emission of each sample's light; empty where optical lengths are not tracked.
    pub emitted: Vec<f32>,
}

impl EdgeTable {
    fn reset(&mut self, paths: usize) {
        self.indices.clear();
        self.paths = paths;
    }

    /// Appends an edge of all paths.
    fn push_edge(&mut self) {
        let count = self.indices.len() + self.paths;
        self.indices.resize(count, NONE);
    }

    /// Sets the index of the last edge of a path.
    pub fn set(&mut self, path: usize, index: u32) {
        let edge = self.indices.len() - self.paths;
        self.indices[edge + path] = index;
    }

    /// Returns the indices of a path, by edge.
    fn of_path(&self, path: usize) -> impl Iterator<Item = u32> + '_ {
        self.indices.iter().skip(path).step_by(self.paths).copied()
    }
}

impl TileVertices {
    fn reset(&mut self, context: &Context, paths: usize) {
        self.store.reset(context);
        self.at.reset(paths);
    }

    /// Returns the indices of the vertices of a path, in order.
    pub fn of_path(&self, path: usize) -> impl Iterator<Item = u32> + '_ {
        self.at.of_path(path).take_while(|index| *index != NONE)
    }

    /// Returns the indices of the vertices by edge of this path and all that follow it, and the
    /// number of indices of an edge.
    pub fn edges_of(&self, path: usize) -> (&[u32], usize) {
        let EdgeTable { indices, paths } = &self.at;
        (indices.get(path..).unwrap_or_default(), *paths)
    }

    /// Stores the vertices at which paths arrived.
    #[inline(always)]
    pub fn push<R: Lanes<N>, const N: usize>(
        &mut self,
        paths: [usize; N],
        at: &ArrivedAt<N>,
        lanes: R::Mask,
        vertices: (&Vertex<R>, &ShadingState<R>),
        departure: &Departure<R>,
    ) {
        for (i, index) in active_lanes(lanes.bits()).zip(self.store.count()..) {
            self.at.set(paths[i], index as u32);
        }
        self.store.push::<R, N>(at, lanes, vertices, departure);
    }
}

impl Hits {
    fn reset(&mut self, paths: usize) {
        self.found.clear();
        self.at.reset(paths);
        self.escaped.clear();
        self.escaped.resize(paths, NONE);
    }

    /// Returns the index of the light that each edge of a path hit, or [`NONE`].
    pub fn of_path(&self, path: usize) -> impl Iterator<Item = u32> + '_ {
        self.at.of_path(path)
    }

    /// Stores light that paths found at the end of edge number `edge`, and passes path and index
    /// of each to `place`.
    #[inline(always)]
    pub fn push<R: Lanes<N>, const N: usize>(
        &mut self,
        context: &Context,
        edge: u32,
        paths: [usize; N],
        connection: &Connection<R, N>,
        place: impl Fn(&mut Hits, usize, u32),
    ) {
        let rows = store_light(context, connection, 1.0);
        let lengths = R::store_doubles(connection.length);
        for i in active_lanes(connection.found.bits()) {
            let [value, unweighted] = stored_light(&rows[i]);
            place(self, paths[i], self.found.len() as u32);
            self.found.push(HitLight {
                value,
                unweighted,
                length: lengths[i],
                t: edge + 1,
            });
        }
    }
}

impl LightStarts {
    /// Returns the times of emission of the samples in all lanes.
    #[inline(always)]
    pub fn emitted<R: Lanes<N>, const N: usize>(&self, paths: [usize; N]) -> R {
        if self.emitted.is_empty() {
            R::splat(0.0)
        } else {
            R::load(&map_array(paths, |path| self.emitted[path]))
        }
    }
}

impl Vertices {
    /// Removes all vertices, for a tile of that many paths.
    pub fn reset(&mut self, context: &Context, paths: usize) {
        self.camera.reset(context, paths);
        self.light.reset(context, paths);
        self.hits.reset(paths);
        self.starts.records.clear();
        self.starts.emitted.clear();
    }

    /// Appends an edge of all subpaths of a mode.
    pub fn push_edge(&mut self, mode: TransportMode) {
        match mode {
            TransportMode::Radiance => {
                self.camera.at.push_edge();
                self.hits.at.push_edge();
            }
            TransportMode::Importance => self.light.at.push_edge(),
        }
    }
}
