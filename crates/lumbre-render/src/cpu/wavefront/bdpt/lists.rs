//! Lists of the connections of a tile. Connections are listed in the order in which a sample adds
//! their light, and evaluated by class of surface.
//!
//! Each listed contribution to a sample's own pixel has an index in [`OwnContributions`]. Results
//! are stored at that index, so that sums do not depend on the order of evaluation. Splats are
//! added in fixed point, in any order.

use std::mem::take;

use super::connect::{ConnectKernel, Connecting, ShadowQueue};
use super::draws::Draws;
use super::merges::MergeKernel;
use super::pending::{
    Columns, EvaluatedPairs, LensConnection, LightConnection, OwnContributions, VertexPair,
};
use super::splats::SplatSink;
use super::vertices::Vertices;
use crate::cpu::wavefront::light::TileLight;
use crate::cpu::wavefront::wave::PathRecords;
use lumbre_light::math::simd::{Lanes, SimdKernel, dispatch};
use lumbre_light::transport::integrator::bdpt::directions::SubpathDirections;
use lumbre_light::transport::integrator::bdpt::draw::LightVertexCache;
use lumbre_light::transport::integrator::bdpt::joins::Joins;
use lumbre_light::transport::integrator::bdpt::merge::Merging;
use lumbre_light::transport::integrator::bdpt::state::LightStartRecord;
use lumbre_light::transport::integrator::bdpt::store::{VertexId, VertexStore};
use lumbre_light::transport::sampler::Sampler;

/// Number of listed contributions at which connections are evaluated before the whole tile is
/// listed. It bounds memory for deep paths and for many connections of a vertex.
const MAX_LISTED: usize = 1 << 13;

/// Pending connections of a tile.
#[derive(Default)]
pub(super) struct ConnectionLists {
    pub own: OwnContributions,
    /// Lists by class of the camera vertex.
    pub light_connections: Vec<Vec<LightConnection>>,
    /// The same for lifted camera vertices.
    pub lifted_connections: Vec<Vec<LightConnection>>,
    /// Lists by class of the camera vertex.
    pub pairs: Vec<Vec<VertexPair>>,
    /// Pairs to merge, by class of the camera vertex.
    pub merges: Vec<Vec<VertexPair>>,
    /// Choices among the pairs, if they are drawn.
    pub draws: Draws,
    /// Lists by class of the light vertex.
    pub evaluated: Vec<EvaluatedPairs>,
    /// Lists by class of the light vertex.
    pub lens_connections: Vec<Vec<LensConnection>>,
    pub start_connections: Vec<LensConnection>,
    /// Start of each of these connections.
    pub starts: Vec<LightStartRecord>,
    /// Number of listed connections to the lens.
    splats: usize,
    pub queue: ShadowQueue,
}

impl ConnectionLists {
    /// Prepares the lists for a tile; all must be empty.
    fn reset(&mut self, classes: usize) {
        self.light_connections.resize_with(classes, Vec::new);
        self.lifted_connections.resize_with(classes, Vec::new);
        self.pairs.resize_with(classes, Vec::new);
        self.merges.resize_with(classes, Vec::new);
        self.evaluated.resize_with(classes, EvaluatedPairs::default);
        self.lens_connections.resize_with(classes, Vec::new);
    }

    /// Returns whether the lists should be evaluated before more connections are listed.
    fn are_full(&self) -> bool {
        let own = self.own.values.len().max(self.draws.candidates());
        own.max(self.splats) >= MAX_LISTED
    }

    /// Evaluates all listed connections, empties the lists, and adds the contributions to the
    /// samples' own pixels to `light`.
    fn evaluate(
        &mut self,
        connecting: &Connecting<impl SubpathDirections>,
        light: &mut TileLight,
        splats: &mut SplatSink,
    ) {
        let width = connecting.tile.width;
        if let Some(merging) = &connecting.joins.merging {
            let kernel = MergeKernel {
                connecting,
                merging,
                lists: &mut self.merges,
                own: &mut self.own,
            };
            dispatch(width, kernel);
        }
        let kernel = ConnectKernel {
            lists: self,
            connecting,
            light,
            splats,
        };
        dispatch(width, kernel);
        self.splats = 0;
        self.own.add_to(connecting.tile.context, light);
    }
}

/// Lists the contributions of the samples of a tile, and evaluates them whenever the lists are full.
pub(super) struct Lister<'a, 's, 'f, D> {
    lists: &'a mut ConnectionLists,
    connecting: Connecting<'a, D>,
    light: &'a mut TileLight,
    splats: SplatSink<'s, 'f>,
    columns: Columns,
    /// Buffer for light vertices near a camera vertex.
    near: Vec<(VertexId, u32)>,
}

/// A camera vertex whose contributions are listed.
#[derive(Clone, Copy)]
struct CameraVertex {
    path: usize,
    /// Index of the vertex.
    z: u32,
    /// Index of its surface's class.
    class: usize,
    /// Number of camera vertices.
    t: u32,
}

/// Kernel that finds the light vertices that merge with a camera vertex.
struct NearKernel<'a, D> {
    connecting: &'a Connecting<'a, D>,
    merging: &'a Merging<'a>,
    at: CameraVertex,
    /// Receives the vertices with their numbers of edges from the light.
    near: &'a mut Vec<(VertexId, u32)>,
}

impl<D: SubpathDirections> SimdKernel for NearKernel<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        let Connecting { tile, vertices, .. } = self.connecting;
        let CameraVertex { z, t, .. } = self.at;
        let (state, _) = vertices.camera.store.state(z as usize);
        let (context, near) = (tile.context, self.near);
        self.merging
            .for_each_near::<R, N>(context, &state, t, |y, s| near.push((y, s)));
    }
}

impl<'a, 's, 'f, D: SubpathDirections> Lister<'a, 's, 'f, D> {
    /// Prepares lists, all of them empty, for a tile.
    pub fn new(
        lists: &'a mut ConnectionLists,
        connecting: Connecting<'a, D>,
        light: &'a mut TileLight,
        splats: SplatSink<'s, 'f>,
    ) -> Lister<'a, 's, 'f, D> {
        let context = connecting.tile.context;
        lists.reset(context.classes.count());
        Lister {
            columns: Columns {
                timed: context.timing.is_some(),
                layered: light.needs().contributions,
            },
            lists,
            connecting,
            light,
            splats,
            near: Vec::new(),
        }
    }

    /// Lists all contributions of all samples and evaluates them.
    pub fn list_all(&mut self, paths: &PathRecords) {
        let tile = self.connecting.tile;
        for path in 0..tile.ids.len() {
            let mut sampler = paths.sampler(tile, path);
            self.list_camera_path(path, &mut sampler);
            self.list_lens_connections(path, &mut sampler);
        }
        self.evaluate();
    }

    fn evaluate(&mut self) {
        self.lists
            .evaluate(&self.connecting, self.light, &mut self.splats);
    }

    /// Appends a contribution of a path; it is black until it is evaluated. Returns its index.
    fn push(&mut self, path: usize, strategy: [u32; 2]) -> u32 {
        if self.lists.are_full() {
            self.evaluate();
        }
        self.lists.own.push(self.columns, path, strategy)
    }

    /// Lists all contributions of a sample to its own pixel.
    fn list_camera_path(&mut self, path: usize, sampler: &mut Sampler) {
        let columns = self.columns;
        let Vertices { camera, hits, .. } = self.connecting.vertices;
        if let Some(hit) = hits.found.get(hits.escaped[path] as usize) {
            self.lists.own.push_hit(columns, path, hit);
        }
        let mut indices = camera.of_path(path);
        for (hit, t) in hits.of_path(path).zip(2..) {
            if let Some(hit) = hits.found.get(hit as usize) {
                self.lists.own.push_hit(columns, path, hit);
            }
            let Some(z) = indices.next() else {
                return;
            };
            let event = &camera.store.events()[z as usize];
            if event.connects {
                let class = event.class as usize;
                self.list_camera_vertex(CameraVertex { path, z, class, t }, sampler);
            }
        }
    }

    /// Lists the contributions of a camera vertex.
    fn list_camera_vertex(&mut self, at: CameraVertex, sampler: &mut Sampler) {
        let Joins {
            counts,
            merging,
            drawing,
            ..
        } = *self.connecting.joins;
        if counts.direct > 0.0 {
            self.list_lights(at, sampler);
        }
        match drawing {
            Some(cache) => self.list_draws(at, cache, sampler),
            None if counts.connecting > 0.0 => self.list_pairs(at),
            None => (),
        }
        if let Some(merging) = &merging {
            self.list_merges(at, merging);
        }
    }

    /// Lists the connections of a camera vertex to sampled lights.
    fn list_lights(&mut self, at: CameraVertex, sampler: &mut Sampler) {
        let CameraVertex { path, z, class, t } = at;
        let context = self.connecting.tile.context;
        if !context.settings.includes(1, t) {
            return;
        }
        let store = &self.connecting.vertices.camera.store;
        let lifts = context.classes[class].surface.terminator && store.lifts(z as usize);
        for lifted in [false, true].into_iter().take(1 + usize::from(lifts)) {
            let connection = LightConnection {
                index: self.push(path, [1, t]),
                path: path as u32,
                z,
                taken: sampler.taken(),
            };
            // The numbers of the connection, which are not computed here.
            let _ = sampler.next_three();
            let lists = &mut *self.lists;
            if lifted {
                lists.lifted_connections[class].push(connection);
            } else {
                lists.light_connections[class].push(connection);
            }
        }
    }

    /// Lists the connections of a camera vertex with the vertices of a light subpath.
    fn list_pairs(&mut self, at: CameraVertex) {
        let CameraVertex { path, z, class, t } = at;
        let Connecting { tile, light, .. } = self.connecting;
        let (settings, max) = (tile.context.settings, tile.context.max_depth);
        let vertices = light.vertices(light.of_camera(path)).zip(2..);
        for (y, s) in vertices.take_while(|(_, s)| s + t - 1 <= max) {
            if settings.includes(s, t) && VertexStore::event(light.stores, y).connects {
                let index = self.push(path, [s, t]);
                self.lists.pairs[class].push(VertexPair { index, y, z });
            }
        }
    }

    /// Lists the connections of a camera vertex with drawn vertices.
    fn list_draws(&mut self, at: CameraVertex, cache: &LightVertexCache, sampler: &mut Sampler) {
        let CameraVertex { path, z, class, t } = at;
        let context = self.connecting.tile.context;
        for _ in 0..context.settings.connections {
            let [choice, u, v] = sampler.next_three();
            // The chosen vertex decides how many light vertices there are.
            let contribution = self.push(path, [1, t]);
            let lists = &mut *self.lists;
            for vertex in cache.draw([u, v], context.settings.candidates) {
                let (y, s) = (vertex.id, vertex.edges + 1);
                if s + t - 1 <= context.max_depth {
                    let index = lists.draws.push_candidate(s);
                    lists.pairs[class].push(VertexPair { index, y, z });
                }
            }
            lists.draws.push_draw(contribution, choice);
        }
    }

    /// Lists the mergings of a camera vertex.
    fn list_merges(&mut self, at: CameraVertex, merging: &Merging) {
        let CameraVertex { path, z, class, t } = at;
        let width = self.connecting.tile.width;
        let mut near = take(&mut self.near);
        dispatch(
            width,
            NearKernel {
                connecting: &self.connecting,
                merging,
                at,
                near: &mut near,
            },
        );
        for (y, s) in near.drain(..) {
            let index = self.push(path, [s, t]);
            self.lists.merges[class].push(VertexPair { index, y, z });
        }
        self.near = near;
    }

    /// Lists the connections of light subpaths to the lens.
    fn list_lens_connections(&mut self, path: usize, sampler: &mut Sampler) {
        let Connecting {
            tile, light, joins, ..
        } = self.connecting;
        if joins.counts.lens <= 0.0 {
            return;
        }
        let mut connection = |y: VertexId, s: u32| {
            let taken = sampler.taken();
            // The numbers of the connection, which are not computed here.
            let _ = [sampler.next_2d(), sampler.next_2d()];
            let path = path as u32;
            LensConnection { path, y, s, taken }
        };
        let settings = tile.context.settings;
        for number in light.of_lens(path) {
            if self.lists.are_full() {
                self.evaluate();
            }
            let lists = &mut *self.lists;
            if settings.includes(1, 1)
                && let Some(start) = light.start(number, path)
            {
                let unused = VertexId::default();
                lists.start_connections.push(connection(unused, 1));
                lists.starts.push(start);
                lists.splats += 1;
            }
            for (y, s) in light.vertices(number).zip(2..) {
                let event = VertexStore::event(light.stores, y);
                if event.connects && settings.includes(s, 1) {
                    lists.lens_connections[event.class as usize].push(connection(y, s));
                    lists.splats += 1;
                }
            }
        }
    }
}
