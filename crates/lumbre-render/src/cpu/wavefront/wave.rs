//! Paths of a tile that advance together: their records, their rays, and the lists of those that
//! hit surfaces of each class.

use std::mem::{swap, take};

use super::light::TileLight;
use crate::Job;
use crate::cpu::films::contributions::SampleId;
use lumbre_light::math::real::{Mask, Word};
use lumbre_light::math::simd::{
    Lanes, SimdKernel, Width, active_lanes, dispatch, map_array, padded,
};
use lumbre_light::transport::arrival::{HitRecord, HitState};
use lumbre_light::transport::integrator::Context;
use lumbre_light::transport::integrator::camera_path::{
    Path, PathRecord, PathState, SamplerRecord, SamplerState, TerminatorRecord, TerminatorState,
    TimeRecord,
};
use lumbre_light::transport::ray::{Hit, Ray};
use lumbre_light::transport::sampler::Sampler;

/// Inputs of the kernels of a tile.
#[derive(Clone, Copy)]
pub(super) struct TileContext<'a> {
    pub width: Width,
    pub context: &'a Context<'a>,
    pub job: &'a Job,
    /// Seed of the samples' random numbers.
    pub seed: u64,
    /// Row of the samples.
    pub y: u32,
    /// Column and index of each sample.
    pub ids: &'a [SampleId],
}

/// Places at which the paths of a tile start.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Start {
    Camera,
    /// Paths that are not placed yet; their numbers belong to no pixel.
    Nowhere,
}

/// Paths of a tile, with buffers that tiles reuse.
#[derive(Default)]
pub(super) struct Wave {
    pub paths: PathRecords,
    /// Paths of the current step.
    pub active: Vec<u32>,
    /// Paths that continue after the current step.
    pub next: Vec<u32>,
    /// Paths whose edge left the scene; empty between steps.
    pub escaped: Vec<u32>,
    /// Paths that hit a surface, by class; empty between steps.
    pub by_class: Vec<Vec<u32>>,
    rays: Vec<(Ray, f32)>,
    traced: Vec<Option<Hit>>,
    /// Whether the next edges are those that leave the camera.
    leaves_camera: bool,
}

/// Records of all paths of a tile.
#[derive(Default)]
pub(super) struct PathRecords {
    states: Vec<PathRecord>,
    samplers: Vec<SamplerRecord>,
    pub hits: Vec<HitRecord>,
    /// Empty where optical lengths are not tracked.
    times: Vec<TimeRecord>,
    /// Empty in scenes without terminator offsets.
    terminators: Vec<TerminatorRecord>,
}

impl Wave {
    /// Starts the paths of a tile, one for each sample. All are active.
    pub fn start(&mut self, tile: &TileContext, start: Start) {
        let count = tile.ids.len();
        let paths = &mut self.paths;
        dispatch(tile.width, StartKernel { tile, start, paths });
        self.leaves_camera = start == Start::Camera;
        self.active.clear();
        self.active.extend(0..count as u32);
        self.by_class
            .resize_with(tile.context.classes.count(), Vec::new);
    }

    /// Traces the edges of the active paths. All are active on the edges that leave the camera.
    pub fn trace(&mut self, tile: &TileContext, light: &mut TileLight) {
        let ray = |path: &u32| {
            let state = self.paths.state(*path);
            let ray = Ray {
                origin: state.origin,
                dir: state.dir,
            };
            (ray, f32::INFINITY)
        };
        self.rays.clear();
        self.rays.extend(self.active.iter().map(ray));
        self.traced.clear();
        let trace = tile.context.trace;
        trace.closest_each(&self.rays, &mut self.traced);
        light.count_rays(&self.active);
        if take(&mut self.leaves_camera) {
            light.find_surfaces(tile, &self.rays, &self.traced);
        }
    }

    /// Stores the hits of the active paths and lists these by class of surface; those that
    /// `ends` is true for end. Paths that hit nothing are listed if there is an environment.
    pub fn sort_hits(&mut self, tile: &TileContext, ends: impl Fn(&Hit) -> bool) {
        let context = tile.context;
        let (scene, classes) = (context.scene, context.classes);
        let rays = self.rays.iter().map(|(ray, _)| ray);
        for ((path, hit), ray) in self.active.iter().zip(&self.traced).zip(rays) {
            let Some(hit) = hit else {
                if scene.environment.is_some() {
                    self.escaped.push(*path);
                }
                continue;
            };
            if ends(hit) {
                continue;
            }
            let i = *path as usize;
            let hit = HitState::new(scene, ray, hit, || self.paths.next_auxiliary(tile, i));
            self.by_class[classes.index_of(scene, &hit)].push(*path);
            [self.paths.hits[i]] = HitRecord::store::<f32, 1>(hit);
        }
    }

    /// Makes the paths that continue the active ones.
    pub fn advance(&mut self) {
        swap(&mut self.active, &mut self.next);
        self.next.clear();
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

    /// Returns the state of a path.
    pub fn state(&self, path: u32) -> PathState<f32> {
        PathRecord::load::<f32, 1>([&self.states[path as usize]])
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

    /// Returns the sampler of a path after the numbers that it has taken.
    pub fn sampler(&self, tile: &TileContext, path: usize) -> Sampler {
        let taken = self.state(path as u32).taken;
        self.samplers(tile, [path], taken)
    }

    /// Loads the samplers of paths at positions in their numbers.
    #[inline(always)]
    pub fn samplers<R: Lanes<N>, const N: usize>(
        &self,
        tile: &TileContext,
        lanes: [usize; N],
        taken: R::Word,
    ) -> Sampler<R> {
        let keys = SamplerRecord::load::<R, N>(map_array(lanes, |i| &self.samplers[i]));
        keys.sampler(tile.job.sampler.sequence, taken)
    }

    /// Loads paths into lanes.
    #[inline(always)]
    pub fn load<R: Lanes<N>, const N: usize>(
        &self,
        tile: &TileContext,
        lanes: [usize; N],
    ) -> Path<R> {
        let state = PathRecord::load::<R, N>(map_array(lanes, |i| &self.states[i]));
        let time = (!self.times.is_empty())
            .then(|| TimeRecord::load::<R, N>(map_array(lanes, |i| &self.times[i])));
        let terminator = (!self.terminators.is_empty())
            .then(|| TerminatorRecord::load::<R, N>(map_array(lanes, |i| &self.terminators[i])));
        Path {
            state,
            sampler: self.samplers(tile, lanes, state.taken),
            time,
            terminator,
        }
    }

    /// Stores the paths of the given lanes.
    #[inline(always)]
    pub fn store<R: Lanes<N>, const N: usize>(
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
    start: Start,
    paths: &'a mut PathRecords,
}

impl SimdKernel for StartKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        let StartKernel { tile, start, paths } = self;
        let TileContext {
            context,
            job,
            seed,
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
            let sampler = Sampler::<R>::start(job.sampler.sequence, seed, pixel, samples);
            let mut path = if start == Start::Camera {
                let pixel = [
                    R::load(&map_array(columns, |x| x as f32)),
                    R::splat(y as f32),
                ];
                Path::<R>::from_camera(context, pixel, sampler)
            } else {
                Path::unplaced(context, sampler)
            };
            path.terminator = has_terminators.then(TerminatorState::none);
            let indices = std::array::from_fn(|i| N * k + i);
            let samplers = SamplerRecord::store::<R, N>(SamplerState::of(&sampler));
            let mask = R::Mask::first(group.len());
            active_lanes(mask.bits()).for_each(|i| paths.samplers[indices[i]] = samplers[i]);
            paths.store(path, indices, mask);
        }
    }
}
