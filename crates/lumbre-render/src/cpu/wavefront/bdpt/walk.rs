//! Traces the subpaths of a tile, one step of all of them at a time, and stores their vertices.

use std::mem::take;

use super::vertices::{Hits, LightStarts, Vertices};
use crate::cpu::wavefront::light::TileLight;
use crate::cpu::wavefront::wave::{PathRecords, TileContext, Wave};
use lumbre_light::math::real::Mask;
use lumbre_light::math::simd::{Lanes, SimdKernel, active_lanes, dispatch, map_array, padded};
use lumbre_light::transport::arrival::{Arrival, HitRecord};
use lumbre_light::transport::bsdf::TransportMode;
use lumbre_light::transport::integrator::Context;
use lumbre_light::transport::integrator::bdpt::connect::Connection;
use lumbre_light::transport::integrator::bdpt::directions::SubpathDirections;
use lumbre_light::transport::integrator::bdpt::state::{
    LightStartRecord, MisRecord, PartialsRecord, ShadingState, Subpath, Vertex,
};
use lumbre_light::transport::integrator::bdpt::store::ArrivedAt;
use lumbre_light::transport::integrator::bdpt::subpath::{Departure, Step, StepSink};
use lumbre_light::transport::integrator::bdpt::weights::StrategyCounts;
use lumbre_light::transport::ray::Ray;

/// State of the subpaths of a tile beside that of their paths.
#[derive(Default)]
pub(super) struct SubpathRecords {
    mis: Vec<MisRecord>,
    partials: Vec<PartialsRecord>,
}

impl SubpathRecords {
    fn resize(&mut self, count: usize) {
        self.mis.resize(count, MisRecord::default());
        self.partials.resize(count, PartialsRecord::default());
    }

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

/// Kernel of [`Walk::start_at_camera`].
struct CameraKernel<'a, 'w, D> {
    walk: &'a mut Walk<'w, D>,
    starts: &'a mut LightStarts,
}

impl<D: SubpathDirections> SimdKernel for CameraKernel<'_, '_, D> {
    type Output = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        let CameraKernel { walk, starts } = self;
        let Walk {
            tile,
            wave,
            states,
            counts,
            ..
        } = walk;
        for (lanes, count) in groups::<N>(tile.ids.len()) {
            let path = wave.paths.load::<R, N>(tile, lanes);
            if let Some(time) = path.time {
                starts.emitted.extend(&time.delays.store()[..count]);
            }
            let subpath = Subpath::from_camera(tile.context, counts, path);
            states.store(&mut wave.paths, &subpath, lanes, R::Mask::first(count));
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
pub(super) struct Walk<'a, D> {
    pub tile: &'a TileContext<'a>,
    pub wave: &'a mut Wave,
    pub states: &'a mut SubpathRecords,
    pub light: &'a mut TileLight,
    /// Directions in which camera subpaths continue.
    pub directions: D,
    /// Numbers of samples of the strategies that the weights combine.
    pub counts: StrategyCounts,
}

impl<D: SubpathDirections> Walk<'_, D> {
    /// Puts the camera subpaths, whose paths were started, on their first edges.
    pub fn start_at_camera(&mut self, starts: &mut LightStarts) {
        self.states.resize(self.tile.ids.len());
        dispatch(self.tile.width, CameraKernel { walk: self, starts });
    }

    /// Starts the light subpaths, whose samplers continue those of the paths. Those whose light
    /// carries something become active.
    pub fn start_at_lights(&mut self, starts: &mut LightStarts) {
        self.states.resize(self.tile.ids.len());
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
            vertices.push_edge(mode);
            self.wave.trace(tile, self.light);
            self.wave
                .sort_hits(tile, |hit| from_camera && context.ends_unlit(edge, hit));
            let step = Step {
                mode,
                edge,
                max_edges,
                counts: self.counts,
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
struct LightKernel<'a, 'w, D> {
    walk: &'a mut Walk<'w, D>,
    starts: &'a mut LightStarts,
}

impl<D: SubpathDirections> SimdKernel for LightKernel<'_, '_, D> {
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
struct EscapeKernel<'a, 'w, D> {
    walk: &'a mut Walk<'w, D>,
    edge: u32,
    list: &'a [u32],
    hits: &'a mut Hits,
}

impl<D: SubpathDirections> SimdKernel for EscapeKernel<'_, '_, D> {
    type Output = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        let Walk {
            tile,
            wave,
            states,
            counts,
            ..
        } = self.walk;
        let context = tile.context;
        for group in self.list.chunks(N) {
            let paths = map_array(padded(group), |path| path as usize);
            let subpath = states.load::<R, N>(tile, &wave.paths, paths);
            let lanes = R::Mask::first(group.len());
            if let Some(found) = subpath.escape::<N>(context, counts, self.edge, lanes) {
                self.hits
                    .push(context, self.edge, paths, &found, |hits, path, index| {
                        hits.escaped[path] = index;
                    });
            }
        }
    }
}

/// Kernel that handles subpaths that hit surfaces of one class.
struct StepKernel<'a, 'w, D> {
    walk: &'a mut Walk<'w, D>,
    step: Step,
    class: usize,
    list: &'a [u32],
    vertices: &'a mut Vertices,
}

impl<D: SubpathDirections> SimdKernel for StepKernel<'_, '_, D> {
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
            tile,
            wave,
            states,
            directions,
            ..
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
                mode: step.mode,
                at: ArrivedAt {
                    class,
                    edge: step.edge,
                    components: arrival.components,
                    acceptance: arrival.acceptance(context.classes, context.scene),
                },
                paths,
                vertices,
            };
            let departure = subpath.scatter(context, *directions, step, &arrival, lanes, &mut sink);
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
    mode: TransportMode,
    at: ArrivedAt<N>,
    /// Index of each lane's path in the tile.
    paths: [usize; N],
    vertices: &'a mut Vertices,
}

impl<R: Lanes<N>, const N: usize> StepSink<R, N> for LaneSink<'_, N> {
    #[inline(always)]
    fn add_vertices(
        &mut self,
        lanes: R::Mask,
        vertices: (&Vertex<R>, &ShadingState<R>),
        departure: &Departure<R>,
    ) {
        let to = match self.mode {
            TransportMode::Radiance => &mut self.vertices.camera,
            TransportMode::Importance => &mut self.vertices.light,
        };
        to.push(self.paths, &self.at, lanes, vertices, departure);
    }

    #[inline(always)]
    fn add_light(&mut self, light: &Connection<R, N>) {
        let (hits, edge) = (&mut self.vertices.hits, self.at.edge);
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
