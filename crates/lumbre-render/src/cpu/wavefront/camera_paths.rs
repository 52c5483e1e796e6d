//! Follows the camera paths of a tile, one step of all paths at a time: traces their edges, sorts
//! the hits by class of surface, runs the technique's step on vectors of one class, and traces the
//! shadow rays.

use std::marker::PhantomData;
use std::mem::{swap, take};

use super::light::{LaneSink, TileLight};
use crate::Job;
use crate::cpu::films::contributions::SampleId;
use crate::cpu::films::layers::LayerRowFilm;
use crate::cpu::films::row_film::RowFilm;
use lumbre_light::math::real::{Mask, Word};
use lumbre_light::math::simd::{
    Lanes, SimdKernel, Width, active_lanes, dispatch, map_array, padded,
};
use lumbre_light::transport::arrival::{Arrival, HitRecord, HitState};
use lumbre_light::transport::integrator::Context;
use lumbre_light::transport::integrator::camera_path::{
    CameraPaths, Path, PathRecord, PathState, SamplerRecord, SamplerState, TerminatorRecord,
    TerminatorState, TimeRecord,
};
use lumbre_light::transport::ray::{Hit, Ray};
use lumbre_light::transport::sampler::Sampler;

/// Number of samples in a tile. Their records fill half of a 48 KiB L1 data cache.
pub(super) const TILE_SAMPLES: usize = 256;

/// State of all paths of a tile, with buffers that tiles reuse.
#[derive(Default)]
pub(super) struct PathTile {
    paths: PathRecords,
    light: TileLight,
    /// Paths of the current step.
    active: Vec<u32>,
    /// Paths that continue after the current step.
    next: Vec<u32>,
    /// Paths whose edge left the scene.
    escaped: Vec<u32>,
    /// Paths that hit a surface, by class; empty between steps.
    by_class: Vec<Vec<u32>>,
    rays: Vec<(Ray, f32)>,
    traced: Vec<Option<Hit>>,
}

/// Records of all paths of a tile.
#[derive(Default)]
struct PathRecords {
    states: Vec<PathRecord>,
    samplers: Vec<SamplerRecord>,
    hits: Vec<HitRecord>,
    /// Empty where optical lengths are not tracked.
    times: Vec<TimeRecord>,
    /// Empty in scenes without terminator offsets.
    terminators: Vec<TerminatorRecord>,
}

/// Inputs of the kernels of a tile.
#[derive(Clone, Copy)]
pub(super) struct TileContext<'a> {
    pub width: Width,
    pub context: &'a Context<'a>,
    pub job: &'a Job,
    /// Row of the samples.
    pub y: u32,
    /// Column and index of each sample.
    pub ids: &'a [SampleId],
}

/// Renders the samples of a tile and adds them to the films of their row.
pub(super) fn render_tile<T: CameraPaths>(
    tile: &TileContext,
    buffers: &mut PathTile,
    film: &mut RowFilm,
    layers: Option<&mut LayerRowFilm>,
) {
    let TileContext { width, context, .. } = *tile;
    let count = tile.ids.len();
    buffers.light.reset(count, layers.is_some());
    dispatch(
        width,
        StartKernel {
            tile,
            paths: &mut buffers.paths,
        },
    );
    buffers.active.clear();
    buffers.active.extend(0..count as u32);
    buffers
        .by_class
        .resize_with(context.classes.count(), Vec::new);
    for edge in 1..=context.max_depth {
        buffers.trace(context);
        buffers.sort_hits(tile, edge);
        let mut escaped = take(&mut buffers.escaped);
        let step = Step { tile, edge };
        if !escaped.is_empty() {
            let (paths, light) = (&buffers.paths, &mut buffers.light);
            dispatch(
                width,
                EscapeKernel::<T> {
                    step,
                    list: &escaped,
                    paths,
                    light,
                    technique: PhantomData,
                },
            );
            escaped.clear();
        }
        buffers.escaped = escaped;
        let mut by_class = take(&mut buffers.by_class);
        for (class, list) in by_class
            .iter_mut()
            .enumerate()
            .filter(|(_, list)| !list.is_empty())
        {
            dispatch(
                width,
                StepKernel::<T> {
                    step,
                    class,
                    list,
                    buffers,
                    technique: PhantomData,
                },
            );
            list.clear();
        }
        buffers.by_class = by_class;
        buffers.light.trace_pending(context);
        swap(&mut buffers.active, &mut buffers.next);
        buffers.next.clear();
    }
    let job = tile.job;
    let sampler = |(x, sample): SampleId| job.sampler.start(job.seed, [x, tile.y], sample);
    buffers
        .light
        .add_to_film(context, (tile.ids, tile.y), film, layers, sampler);
}

impl PathTile {
    /// Traces the edges of the active paths.
    fn trace(&mut self, context: &Context) {
        let ray = |path: &u32| {
            let state = PathRecord::load::<f32, 1>([&self.paths.states[*path as usize]]);
            let ray = Ray {
                origin: state.origin,
                dir: state.dir,
            };
            (ray, f32::INFINITY)
        };
        self.rays.clear();
        self.rays.extend(self.active.iter().map(ray));
        self.traced.clear();
        context.trace.closest_each(&self.rays, &mut self.traced);
        self.light.count_rays(&self.active);
    }

    /// Stores the hits of the active paths and lists these by class of surface. Paths that can add
    /// nothing more end.
    fn sort_hits(&mut self, tile: &TileContext, edge: u32) {
        let context = tile.context;
        let (scene, classes) = (context.scene, context.classes);
        for (path, hit) in self.active.iter().zip(&self.traced) {
            let Some(hit) = hit else {
                if scene.environment.is_some() {
                    self.escaped.push(*path);
                }
                continue;
            };
            if context.ends_unlit(edge, hit) {
                continue;
            }
            let i = *path as usize;
            let hit = HitState::new(scene, hit, || self.paths.next_auxiliary(tile, i));
            self.by_class[classes.index_of(scene, &hit)].push(*path);
            [self.paths.hits[i]] = HitRecord::store::<f32, 1>(hit);
        }
    }
}

impl PathRecords {
    fn resize(&mut self, count: usize, timed: bool, has_terminators: bool) {
        self.states.resize(count, PathRecord::default());
        self.samplers.resize(count, SamplerRecord::default());
        self.hits.resize(count, HitRecord::default());
        let times = if timed { count } else { 0 };
        self.times.resize(times, TimeRecord::default());
        let terminators = if has_terminators { count } else { 0 };
        self.terminators
            .resize(terminators, TerminatorRecord::default());
    }

    /// Returns the next auxiliary number of a path.
    fn next_auxiliary(&mut self, tile: &TileContext, path: usize) -> f32 {
        let mut one = self.load::<f32, 1>(tile, [path]);
        let number = one.next_auxiliary();
        if let Some(time) = one.time {
            [self.times[path]] = TimeRecord::store::<f32, 1>(time);
        }
        number
    }

    /// Loads paths into lanes.
    #[inline(always)]
    fn load<R: Lanes<N>, const N: usize>(&self, tile: &TileContext, lanes: [usize; N]) -> Path<R> {
        let state = PathRecord::load::<R, N>(map_array(lanes, |i| &self.states[i]));
        let sampler = SamplerRecord::load::<R, N>(map_array(lanes, |i| &self.samplers[i]));
        let time = (!self.times.is_empty())
            .then(|| TimeRecord::load::<R, N>(map_array(lanes, |i| &self.times[i])));
        let terminator = (!self.terminators.is_empty())
            .then(|| TerminatorRecord::load::<R, N>(map_array(lanes, |i| &self.terminators[i])));
        Path {
            state,
            sampler: sampler.sampler(tile.job.sampler.sequence, state.taken),
            time,
            terminator,
        }
    }

    /// Stores the paths of the given lanes.
    #[inline(always)]
    fn store<R: Lanes<N>, const N: usize>(
        &mut self,
        path: Path<R>,
        lanes: [usize; N],
        mask: R::Mask,
    ) {
        let Path {
            mut state,
            sampler,
            time,
            terminator,
        } = path;
        state.taken = sampler.taken();
        let states = PathRecord::store::<R, N>(state);
        active_lanes(mask.bits()).for_each(|i| self.states[lanes[i]] = states[i]);
        if let Some(time) = time {
            let times = TimeRecord::store::<R, N>(time);
            active_lanes(mask.bits()).for_each(|i| self.times[lanes[i]] = times[i]);
        }
        if let Some(terminator) = terminator {
            let terminators = TerminatorRecord::store::<R, N>(terminator);
            active_lanes(mask.bits()).for_each(|i| self.terminators[lanes[i]] = terminators[i]);
        }
    }
}

/// Kernel that starts the paths of a tile.
struct StartKernel<'a> {
    tile: &'a TileContext<'a>,
    paths: &'a mut PathRecords,
}

impl SimdKernel for StartKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        let StartKernel { tile, paths } = self;
        let TileContext {
            context,
            job,
            y,
            ids,
            ..
        } = *tile;
        let has_terminators = context.classes.have_terminators();
        paths.resize(ids.len(), context.timed(), has_terminators);
        let word = R::Word::splat;
        for (k, group) in ids.chunks(N).enumerate() {
            let lanes: [SampleId; N] = padded(group);
            let columns = map_array(lanes, |(x, _)| x);
            let samples = [
                R::load_words(&map_array(lanes, |(_, sample)| sample as u32)),
                R::load_words(&map_array(lanes, |(_, sample)| (sample >> 32) as u32)),
            ];
            let pixel = [R::load_words(&columns), word(y)];
            let sampler = Sampler::<R>::start(job.sampler.sequence, job.seed, pixel, samples);
            let pixel = [
                R::load(&map_array(columns, |x| x as f32)),
                R::splat(y as f32),
            ];
            let mut path = Path::<R>::from_camera(context, pixel, sampler);
            path.terminator = has_terminators.then(TerminatorState::none);
            let indices = std::array::from_fn(|i| N * k + i);
            let samplers = SamplerRecord::store::<R, N>(SamplerState::of(&sampler));
            let mask = R::Mask::first(group.len());
            active_lanes(mask.bits()).for_each(|i| paths.samplers[indices[i]] = samplers[i]);
            paths.store(path, indices, mask);
        }
    }
}

/// One step of the paths of a tile: their edge number `edge`.
#[derive(Clone, Copy)]
struct Step<'a> {
    tile: &'a TileContext<'a>,
    edge: u32,
}

/// Kernel that handles paths that left the scene.
struct EscapeKernel<'a, T> {
    step: Step<'a>,
    list: &'a [u32],
    paths: &'a PathRecords,
    light: &'a mut TileLight,
    technique: PhantomData<T>,
}

impl<T: CameraPaths> SimdKernel for EscapeKernel<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        let Step { tile, edge } = self.step;
        for group in self.list.chunks(N) {
            let paths = map_array(padded(group), |path| path as usize);
            let path = self.paths.load::<R, N>(tile, paths);
            let mut sink = LaneSink {
                context: tile.context,
                paths,
                light: self.light,
            };
            T::escape(
                tile.context,
                edge,
                &path,
                R::Mask::first(group.len()),
                &mut sink,
            );
        }
    }
}

/// Kernel that handles paths that hit surfaces of one class.
struct StepKernel<'a, T> {
    step: Step<'a>,
    class: usize,
    list: &'a [u32],
    buffers: &'a mut PathTile,
    technique: PhantomData<T>,
}

impl<T: CameraPaths> SimdKernel for StepKernel<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        let Step { tile, edge } = self.step;
        let PathTile {
            paths: records,
            light,
            next,
            ..
        } = self.buffers;
        for group in self.list.chunks(N) {
            let paths = map_array(padded(group), |path| path as usize);
            let mut path = records.load::<R, N>(tile, paths);
            let hits = HitRecord::load::<R, N>(map_array(paths, |i| &records.hits[i]));
            let Path {
                state: PathState { origin, dir, .. },
                ..
            } = path;
            let class = &tile.context.classes[self.class];
            let arrival = Arrival::new(class, Ray { origin, dir }, &hits);
            let mut sink = LaneSink {
                context: tile.context,
                paths,
                light,
            };
            let lanes = R::Mask::first(group.len());
            let continues = T::scatter(tile.context, edge, &arrival, &mut path, lanes, &mut sink);
            records.store(path, paths, continues);
            next.extend(active_lanes(continues.bits()).map(|i| paths[i] as u32));
        }
    }
}
