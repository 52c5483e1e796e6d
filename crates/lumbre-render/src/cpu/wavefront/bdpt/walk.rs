//! Traces the subpaths of a tile, one step of all of them at a time, and stores their vertices.

use std::mem::take;

use glam::Vec3;

use super::Vertices;
use super::connect::{store_light, stored_light};
use crate::cpu::wavefront::light::TileLight;
use crate::cpu::wavefront::wave::{PathRecords, TileContext, Wave};
use lumbre_light::math::real::Mask;
use lumbre_light::math::simd::{Lanes, SimdKernel, active_lanes, dispatch, map_array, padded};
use lumbre_light::scene::compile::NONE;
use lumbre_light::transport::arrival::{Arrival, HitRecord};
use lumbre_light::transport::bsdf::TransportMode;
use lumbre_light::transport::integrator::Context;
use lumbre_light::transport::integrator::bdpt::connect::Connection;
use lumbre_light::transport::integrator::bdpt::state::{
    LightStartRecord, MisRecord, PartialsRecord, ShadingRecord, ShadingState, Subpath, Vertex,
    VertexRecord,
};
use lumbre_light::transport::integrator::bdpt::subpath::{Step, StepSink};
use lumbre_light::transport::integrator::bdpt::weights::StrategyCounts;
use lumbre_light::transport::ray::Ray;

/// State of the subpaths of a tile beside that of their paths.
#[derive(Default)]
pub(super) struct SubpathRecords {
    mis: Vec<MisRecord>,
    partials: Vec<PartialsRecord>,
}

/// Vertices of the subpaths of a tile from the camera or from lights.
#[derive(Default)]
pub(super) struct TileVertices {
    /// The vertices, in the order in which they were found.
    pub records: Vec<VertexRecord>,
    pub partials: Vec<PartialsRecord>,
    /// Empty in scenes where no surface has such properties.
    pub shading: Vec<ShadingRecord>,
    /// Class of each vertex's surface, or [`NONE`] if it cannot be connected.
    pub classes: Vec<u32>,
    /// Index of the vertex at the end of each edge of each path, or [`NONE`].
    at: EdgeTable,
    has_shading: bool,
}

/// An index for each edge of each path of a tile, or [`NONE`].
#[derive(Default)]
struct EdgeTable {
    /// Indices by edge, then by path.
    indices: Vec<u32>,
    paths: usize,
}

/// Light that the camera subpaths of a tile hit.
#[derive(Default)]
pub(super) struct Hits {
    pub found: Vec<HitLight>,
    /// Index of the light that each edge hit, or [`NONE`].
    at: EdgeTable,
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
    emitted: Vec<f32>,
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
    fn set(&mut self, path: usize, index: u32) {
        let edge = self.indices.len() - self.paths;
        self.indices[edge + path] = index;
    }

    /// Returns the indices of a path, by edge.
    fn of_path(&self, path: usize) -> impl Iterator<Item = u32> + '_ {
        self.indices.iter().skip(path).step_by(self.paths).copied()
    }
}

impl TileVertices {
    fn reset(&mut self, paths: usize, has_shading: bool) {
        self.records.clear();
        self.partials.clear();
        self.shading.clear();
        self.classes.clear();
        self.at.reset(paths);
        self.has_shading = has_shading;
    }

    /// Returns the indices of the vertices of a path, in order.
    pub fn of_path(&self, path: usize) -> impl Iterator<Item = u32> + '_ {
        self.at.of_path(path).take_while(|index| *index != NONE)
    }

    /// Stores the vertices that paths reached on surfaces of the class with an index.
    #[inline(always)]
    fn push<R: Lanes<N>, const N: usize>(
        &mut self,
        class: usize,
        paths: [usize; N],
        lanes: R::Mask,
        (vertex, shading): (&Vertex<R>, &ShadingState<R>),
    ) {
        let (records, partials) = vertex.store::<N>();
        let connected = vertex.bsdf.has_density().bits();
        let shading = self
            .has_shading
            .then(|| ShadingRecord::store::<R, N>(*shading));
        for i in active_lanes(lanes.bits()) {
            self.at.set(paths[i], self.records.len() as u32);
            self.records.push(records[i]);
            self.partials.push(partials[i]);
            let class = if connected & 1 << i != 0 {
                class as u32
            } else {
                NONE
            };
            self.classes.push(class);
            if let Some(shading) = &shading {
                self.shading.push(shading[i]);
            }
        }
    }

    /// Loads vertices on surfaces of the class with an index.
    #[inline(always)]
    pub fn load<R: Lanes<N>, const N: usize>(
        &self,
        context: &Context,
        class: usize,
        indices: [u32; N],
    ) -> Vertex<R> {
        Vertex::load::<N>(
            context,
            class,
            map_array(indices, |i| &self.records[i as usize]),
            map_array(indices, |i| &self.partials[i as usize]),
            self.has_shading
                .then(|| map_array(indices, |i| &self.shading[i as usize])),
        )
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
    fn push<R: Lanes<N>, const N: usize>(
        &mut self,
        context: &Context,
        edge: u32,
        paths: [usize; N],
        connection: &Connection<R, N>,
        place: impl Fn(&mut Hits, usize, u32),
    ) {
        let rows = store_light(context, connection);
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
        let has_shading = context.classes.have_shading();
        self.camera.reset(paths, has_shading);
        self.light.reset(paths, has_shading);
        self.hits.reset(paths);
        self.starts.records.clear();
        self.starts.emitted.clear();
    }
}

/// Puts the camera subpaths of a tile, whose paths were started, on their first edges.
pub(super) fn start_at_camera(
    tile: &TileContext,
    wave: &mut Wave,
    states: &mut SubpathRecords,
    starts: &mut LightStarts,
) {
    let count = tile.ids.len();
    states.mis.resize(count, MisRecord::default());
    states.partials.resize(count, PartialsRecord::default());
    let kernel = CameraKernel {
        tile,
        paths: &mut wave.paths,
        states,
        starts,
    };
    dispatch(tile.width, kernel);
}

impl SubpathRecords {
    /// Loads the subpaths of paths.
    #[inline(always)]
    fn load<R: Lanes<N>, const N: usize>(
        &self,
        tile: &TileContext,
        paths: &PathRecords,
        lanes: [usize; N],
    ) -> Subpath<R> {
        Subpath::load::<N>(
            paths.load::<R, N>(tile, lanes),
            map_array(lanes, |i| &self.mis[i]),
            map_array(lanes, |i| &self.partials[i]),
        )
    }

    /// Stores the subpaths of the given lanes.
    #[inline(always)]
    fn store<R: Lanes<N>, const N: usize>(
        &mut self,
        paths: &mut PathRecords,
        subpath: &Subpath<R>,
        lanes: [usize; N],
        mask: R::Mask,
    ) {
        paths.store(subpath.path, lanes, mask);
        let (mis, partials) = subpath.store::<N>();
        for i in active_lanes(mask.bits()) {
            self.mis[lanes[i]] = mis[i];
            self.partials[lanes[i]] = partials[i];
        }
    }
}

/// Kernel of [`start_at_camera`].
struct CameraKernel<'a> {
    tile: &'a TileContext<'a>,
    paths: &'a mut PathRecords,
    states: &'a mut SubpathRecords,
    starts: &'a mut LightStarts,
}

impl SimdKernel for CameraKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        let CameraKernel {
            tile,
            paths,
            states,
            starts,
        } = self;
        for (lanes, count) in groups::<N>(tile.ids.len()) {
            let path = paths.load::<R, N>(tile, lanes);
            if let Some(time) = path.time {
                starts.emitted.extend(&time.delays.store()[..count]);
            }
            let subpath = Subpath::from_camera(tile.context, &StrategyCounts::ONE_EACH, path);
            states.store(paths, &subpath, lanes, R::Mask::first(count));
        }
    }
}

/// Returns the groups of `N` consecutive paths, each with the number of those that exist; the other
/// lanes repeat the first.
#[inline(always)]
fn groups<const N: usize>(paths: usize) -> impl Iterator<Item = ([usize; N], usize)> {
    (0..paths).step_by(N).map(move |first| {
        let count = N.min(paths - first);
        let mut lanes = [first; N];
        for (i, lane) in lanes[..count].iter_mut().enumerate() {
            *lane = first + i;
        }
        (lanes, count)
    })
}

/// The subpaths of a tile while they are traced.
pub(super) struct Walk<'a> {
    pub tile: &'a TileContext<'a>,
    pub wave: &'a mut Wave,
    pub states: &'a mut SubpathRecords,
    pub light: &'a mut TileLight,
}

impl Walk<'_> {
    /// Starts the light subpaths, whose samplers continue those of the camera subpaths. Those whose
    /// light carries something become active.
    pub fn start_at_lights(&mut self, starts: &mut LightStarts) {
        self.wave.active.clear();
        dispatch(self.tile.width, LightKernel { walk: self, starts });
    }

    /// Traces the active subpaths until they end or have `max_edges` edges.
    pub fn trace(&mut self, mode: TransportMode, max_edges: u32, vertices: &mut Vertices) {
        let tile = self.tile;
        let context = tile.context;
        let from_camera = mode == TransportMode::Radiance;
        for edge in 1..=max_edges {
            if self.wave.active.is_empty() {
                return;
            }
            if from_camera {
                vertices.camera.at.push_edge();
                vertices.hits.at.push_edge();
            } else {
                vertices.light.at.push_edge();
            }
            self.wave.trace(context, self.light);
            self.wave
                .sort_hits(tile, |hit| from_camera && context.ends_unlit(edge, hit));
            let step = Step {
                mode,
                edge,
                max_edges,
                counts: StrategyCounts::ONE_EACH,
            };
            let mut escaped = take(&mut self.wave.escaped);
            if from_camera && !escaped.is_empty() {
                let kernel = EscapeKernel {
                    walk: self,
                    edge,
                    list: &escaped,
                    hits: &mut vertices.hits,
                };
                dispatch(tile.width, kernel);
            }
            escaped.clear();
            self.wave.escaped = escaped;
            let mut by_class = take(&mut self.wave.by_class);
            for (class, list) in by_class
                .iter_mut()
                .enumerate()
                .filter(|(_, list)| !list.is_empty())
            {
                let kernel = StepKernel {
                    walk: self,
                    step,
                    class,
                    list,
                    vertices,
                };
                dispatch(tile.width, kernel);
                list.clear();
            }
            self.wave.by_class = by_class;
            self.wave.advance();
        }
        self.wave.active.clear();
    }
}

/// Kernel of [`Walk::start_at_lights`].
struct LightKernel<'a, 'w> {
    walk: &'a mut Walk<'w>,
    starts: &'a mut LightStarts,
}

impl SimdKernel for LightKernel<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        let Walk {
            tile, wave, states, ..
        } = self.walk;
        let starts = self.starts;
        for (lanes, count) in groups::<N>(tile.ids.len()) {
            let mask = R::Mask::first(count);
            let path = wave.paths.load::<R, N>(tile, lanes);
            let emitted = starts.emitted::<R, N>(lanes);
            let (start, subpath, continues) =
                Subpath::from_light(tile.context, path, emitted, mask);
            states.store(&mut wave.paths, &subpath, lanes, mask);
            let records = LightStartRecord::store::<R, N>(start);
            starts.records.extend(&records[..count]);
            wave.active
                .extend(active_lanes(continues.bits()).map(|i| lanes[i] as u32));
        }
    }
}

/// Kernel that handles camera subpaths that left the scene.
struct EscapeKernel<'a, 'w> {
    walk: &'a mut Walk<'w>,
    edge: u32,
    list: &'a [u32],
    hits: &'a mut Hits,
}

impl SimdKernel for EscapeKernel<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        let Walk {
            tile, wave, states, ..
        } = self.walk;
        let context = tile.context;
        for group in self.list.chunks(N) {
            let paths = map_array(padded(group), |path| path as usize);
            let subpath = states.load::<R, N>(tile, &wave.paths, paths);
            let lanes = R::Mask::first(group.len());
            if let Some(found) =
                subpath.escape::<N>(context, &StrategyCounts::ONE_EACH, self.edge, lanes)
            {
                self.hits
                    .push(context, self.edge, paths, &found, |hits, path, index| {
                        hits.escaped[path] = index;
                    });
            }
        }
    }
}

/// Kernel that handles subpaths that hit surfaces of one class.
struct StepKernel<'a, 'w> {
    walk: &'a mut Walk<'w>,
    step: Step,
    class: usize,
    list: &'a [u32],
    vertices: &'a mut Vertices,
}

impl SimdKernel for StepKernel<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        let StepKernel {
            walk,
            step,
            class,
            list,
            vertices,
        } = self;
        let Walk {
            tile, wave, states, ..
        } = walk;
        let context = tile.context;
        for group in list.chunks(N) {
            let paths = map_array(padded(group), |path| path as usize);
            let mut subpath = states.load::<R, N>(tile, &wave.paths, paths);
            let hits = HitRecord::load::<R, N>(map_array(paths, |i| &wave.paths.hits[i]));
            let ray = Ray {
                origin: subpath.path.state.origin,
                dir: subpath.path.state.dir,
            };
            let arrival = Arrival::new(&context.classes[class], ray, &hits);
            let lanes = R::Mask::first(group.len());
            let mut sink = LaneSink {
                context,
                step,
                class,
                paths,
                vertices,
            };
            let departure = subpath.scatter(context, step, &arrival, lanes, &mut sink);
            // The samplers of all paths go on.
            states.store(&mut wave.paths, &subpath, paths, lanes);
            let continues = active_lanes(departure.continues.bits());
            wave.next.extend(continues.map(|i| paths[i] as u32));
        }
    }
}

/// Sink of a step of the subpaths that are in the lanes of a vector.
struct LaneSink<'a, const N: usize> {
    context: &'a Context<'a>,
    step: Step,
    class: usize,
    /// Index of each lane's path in the tile.
    paths: [usize; N],
    vertices: &'a mut Vertices,
}

impl<R: Lanes<N>, const N: usize> StepSink<R, N> for LaneSink<'_, N> {
    #[inline(always)]
    fn add_vertices(&mut self, lanes: R::Mask, vertex: &Vertex<R>, shading: &ShadingState<R>) {
        let to = match self.step.mode {
            TransportMode::Radiance => &mut self.vertices.camera,
            TransportMode::Importance => &mut self.vertices.light,
        };
        to.push(self.class, self.paths, lanes, (vertex, shading));
    }

    #[inline(always)]
    fn add_light(&mut self, light: &Connection<R, N>) {
        let (hits, edge) = (&mut self.vertices.hits, self.step.edge);
        hits.push(
            self.context,
            edge,
            self.paths,
            light,
            |hits, path, index| {
                hits.at.set(path, index);
            },
        );
    }
}
