//! Evaluates the listed connections of a tile, one connection per lane, and traces their shadow
//! rays.

use glam::Vec3;

use super::draws::Draws;
use super::lists::ConnectionLists;
use super::pending::{
    EvaluatedPairs, LensConnection, LightConnection, OwnContributions, VertexPair,
};
use super::source::LightSubpaths;
use super::splats::SplatSink;
use super::stored::{store_light, stored_light};
use super::vertices::Vertices;
use crate::cpu::wavefront::light::{TileLight, store_rays, stored_ray};
use crate::cpu::wavefront::wave::{PathRecords, TileContext};
use lumbre_light::math::real::{Double, Mask};
use lumbre_light::math::simd::{Lanes, SimdKernel, active_lanes, map_array, padded};
use lumbre_light::transport::contribution::Contribution;
use lumbre_light::transport::integrator::Context;
use lumbre_light::transport::integrator::bdpt::connect::{
    Connection, LensPoints, camera_end, connect, connect_s1, connect_s1_t1, connect_t1,
};
use lumbre_light::transport::integrator::bdpt::directions::SubpathDirections;
use lumbre_light::transport::integrator::bdpt::joins::Joins;
use lumbre_light::transport::integrator::bdpt::state::{
    CameraEnd, CameraEndRecord, LightStart, LightStartRecord, Vertex,
};
use lumbre_light::transport::integrator::bdpt::store::{VertexId, VertexStore};
use lumbre_light::transport::integrator::bdpt::weights::MisPartials;
use lumbre_light::transport::integrator::camera_path::needs_ray;
use lumbre_light::transport::ray::Ray;

/// Number of queued contributions at which their shadow rays are traced.
const MAX_QUEUED: usize = 64;

/// Destination of a contribution.
#[derive(Clone, Copy)]
pub(super) enum Target {
    /// The sample's own pixel: index into [`OwnContributions`].
    Own(u32),
    /// Any pixel, by a splat: path, pixel, and number of light vertices.
    Splat(u32, [u32; 2], u32),
}

/// Contribution whose shadow ray has not been traced.
#[derive(Clone, Copy)]
struct Queued {
    value: Vec3,
    unweighted: Vec3,
    target: Target,
}

/// Contributions whose shadow rays have not been traced.
#[derive(Default)]
pub(super) struct ShadowQueue {
    rays: Vec<(Ray, f32)>,
    contributions: Vec<Queued>,
    /// Optical lengths of the contributions; empty without a time axis.
    lengths: Vec<f64>,
    occluded: Vec<bool>,
}

impl ShadowQueue {
    /// Appends the contributions of connections, each one of several: see [`store_light`].
    #[inline(always)]
    fn push<R: Lanes<N>, const N: usize>(
        &mut self,
        context: &Context,
        (c, count): (&Connection<R, N>, f64),
        target: impl Fn(usize) -> Target,
    ) {
        let Some(ray) = &c.ray else { return };
        let light = store_light(context, c, count);
        let rays = store_rays(ray);
        if context.timing.is_some() {
            let lengths = R::store_doubles(c.length);
            let lanes = active_lanes(c.lanes.bits());
            self.lengths.extend(lanes.map(|i| lengths[i]));
        }
        for i in active_lanes(c.lanes.bits()) {
            self.rays.push(stored_ray(&rays[i]));
            let [value, unweighted] = stored_light(&light[i]);
            self.contributions.push(Queued {
                value,
                unweighted,
                target: target(i),
            });
        }
    }

    /// Appends a weighted and unweighted contribution with its optical length.
    pub fn push_one(
        &mut self,
        ray: (Ray, f32),
        [value, unweighted]: [Vec3; 2],
        length: Option<f64>,
        target: Target,
    ) {
        self.rays.push(ray);
        self.lengths.extend(length);
        self.contributions.push(Queued {
            value,
            unweighted,
            target,
        });
    }

    /// Traces the shadow rays, stores or splats the contributions that nothing blocks, and empties
    /// the queue.
    fn resolve(
        &mut self,
        context: &Context,
        own: &mut OwnContributions,
        light: &mut TileLight,
        splats: &mut SplatSink,
    ) {
        let ShadowQueue {
            rays,
            contributions,
            lengths,
            occluded,
        } = self;
        count_rays(rays, contributions, own, light);
        occluded.clear();
        if rays.iter().all(|(_, distance)| needs_ray(*distance)) {
            context.trace.occluded_each(rays, occluded);
        } else {
            let trace = context.trace;
            let blocked = rays
                .iter()
                .map(|(ray, distance)| needs_ray(*distance) && trace.occluded(ray, *distance));
            occluded.extend(blocked);
        }
        rays.clear();
        for (i, (queued, occluded)) in contributions.drain(..).zip(&*occluded).enumerate() {
            if *occluded {
                continue;
            }
            let length = lengths.get(i).copied().unwrap_or(0.0);
            let Queued {
                value, unweighted, ..
            } = queued;
            match queued.target {
                Target::Own(index) => own.set(index, value, unweighted, length),
                Target::Splat(path, pixel, s) => {
                    let contribution = Contribution {
                        pixel,
                        value,
                        unweighted,
                        s,
                        t: 1,
                        length,
                    };
                    splats.add(path, &contribution);
                }
            }
        }
        lengths.clear();
    }
}

/// Counts the rays of queued contributions, if a layer needs it.
fn count_rays(
    rays: &[(Ray, f32)],
    contributions: &[Queued],
    own: &OwnContributions,
    light: &mut TileLight,
) {
    if !light.needs().rays {
        return;
    }
    for ((_, distance), queued) in rays.iter().zip(contributions) {
        let path = match queued.target {
            Target::Own(index) => own.values[index as usize].0,
            Target::Splat(path, ..) => path,
        };
        if needs_ray(*distance) {
            light.count_rays(&[path]);
        }
    }
}

/// Kernel of [`ConnectionLists::evaluate`].
pub(super) struct ConnectKernel<'a, 's, 'f, D> {
    pub lists: &'a mut ConnectionLists,
    pub connecting: &'a Connecting<'a, D>,
    pub light: &'a mut TileLight,
    pub splats: &'a mut SplatSink<'s, 'f>,
}

impl<D: SubpathDirections> SimdKernel for ConnectKernel<'_, '_, '_, D> {
    type Output = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        let ConnectKernel {
            lists,
            connecting,
            light,
            splats,
        } = self;
        let ConnectionLists {
            own,
            light_connections,
            lifted_connections,
            pairs,
            draws,
            evaluated,
            lens_connections,
            start_connections,
            starts,
            queue,
            ..
        } = lists;
        let (context, joins) = (connecting.tile.context, connecting.joins);
        let mut resolve = |queue: &mut ShadowQueue, own: &mut OwnContributions, least: usize| {
            if queue.contributions.len() >= least {
                queue.resolve(context, own, light, splats);
            }
        };
        for (group, starts) in start_connections.chunks(N).zip(starts.chunks(N)) {
            connecting.connect_starts::<R, N>(group, starts, queue);
            resolve(queue, own, MAX_QUEUED);
        }
        start_connections.clear();
        starts.clear();
        for class in 0..pairs.len() {
            let lists = [
                &mut light_connections[class],
                &mut lifted_connections[class],
            ];
            for (list, lifted) in lists.into_iter().zip([false, true]) {
                for group in list.chunks(N) {
                    connecting.connect_lights::<R, N>(class, group, lifted, queue);
                    resolve(queue, own, MAX_QUEUED);
                }
                list.clear();
            }
            for group in pairs[class].chunks(N) {
                connecting.evaluate_cameras::<R, N>(class, group, evaluated);
            }
            pairs[class].clear();
            for group in lens_connections[class].chunks(N) {
                connecting.connect_lens::<R, N>(class, group, queue);
                resolve(queue, own, MAX_QUEUED);
            }
            lens_connections[class].clear();
        }
        for (class, EvaluatedPairs { pairs, ends }) in evaluated.iter_mut().enumerate() {
            for (group, ends) in pairs.chunks(N).zip(ends.chunks(N)) {
                connecting.connect_subpaths::<R, N>(class, group, ends, (queue, draws));
                resolve(queue, own, MAX_QUEUED);
            }
            pairs.clear();
            ends.clear();
        }
        if let Some(cache) = joins.drawing {
            draws.choose(context, cache, own, queue, |queue, own| {
                resolve(queue, own, MAX_QUEUED);
            });
        }
        resolve(queue, own, 0);
    }
}

/// Vertices and random numbers that connections are evaluated from.
#[derive(Clone, Copy)]
pub(super) struct Connecting<'a, D> {
    pub tile: &'a TileContext<'a>,
    pub paths: &'a PathRecords,
    /// Vertices of the tile's own subpaths.
    pub vertices: &'a Vertices,
    pub light: LightSubpaths<'a>,
    pub joins: &'a Joins<'a, D>,
}

impl<D: SubpathDirections> Connecting<'_, D> {
    /// Connects camera vertices on surfaces of one class to sampled lights (`s = 1`).
    #[inline(always)]
    fn connect_lights<R: Lanes<N>, const N: usize>(
        &self,
        class: usize,
        group: &[LightConnection],
        lifted: bool,
        queue: &mut ShadowQueue,
    ) {
        let connections: [LightConnection; N] = padded(group);
        let lanes = R::Mask::first(group.len());
        let context = self.tile.context;
        let taken = R::load_words(&map_array(connections, |c| c.taken));
        let paths = map_array(connections, |c| c.path as usize);
        let mut sampler = self.paths.samplers::<R, N>(self.tile, paths, taken);
        let camera = &self.vertices.camera;
        let z = map_array(connections, |c| c.z);
        let mut z = camera.store.load::<R, N>(context, class, z);
        z.partials = self.with_merging(z.partials);
        if lifted {
            z.lift();
        }
        let directions = self.joins.directions;
        if let Some(c) = connect_s1::<R, N>(context, directions, &z, &mut sampler, lanes) {
            let count = self.joins.counts.direct;
            queue.push(context, (&c, count), |i| Target::Own(connections[i].index));
        }
    }

    /// Evaluates camera vertices on surfaces of one class towards light vertices, and appends the
    /// pairs between which light may pass to `evaluated`, by the class of the light vertex.
    #[inline(always)]
    fn evaluate_cameras<R: Lanes<N>, const N: usize>(
        &self,
        class: usize,
        group: &[VertexPair],
        evaluated: &mut [EvaluatedPairs],
    ) {
        let pairs: [VertexPair; N] = padded(group);
        let (camera, stores) = (&self.vertices.camera, self.light.stores);
        let context = self.tile.context;
        let z = map_array(pairs, |pair| pair.z);
        let z = camera.store.load::<R, N>(context, class, z);
        let y = map_array(pairs, |pair| pair.y);
        let y = VertexStore::states::<R, N>(stores, y);
        let lanes = R::Mask::first(group.len());
        let (lit, end) = camera_end::<R, N>(context, self.joins.directions, &z, y.position, lanes);
        let ends = CameraEndRecord::store::<R, N>(end);
        for i in active_lanes(lit.bits()) {
            let event = VertexStore::event(stores, pairs[i].y);
            let list = &mut evaluated[event.class as usize];
            list.pairs.push(pairs[i]);
            list.ends.push(ends[i]);
        }
    }

    /// Connects light vertices on surfaces of one class to camera vertices.
    #[inline(always)]
    fn connect_subpaths<R: Lanes<N>, const N: usize>(
        &self,
        class: usize,
        group: &[VertexPair],
        ends: &[CameraEndRecord],
        (queue, draws): (&mut ShadowQueue, &mut Draws),
    ) {
        let pairs: [VertexPair; N] = padded(group);
        let ends: [CameraEndRecord; N] = padded(ends);
        let context = self.tile.context;
        let camera = &self.vertices.camera;
        let y = self.load_light::<R, N>(class, map_array(pairs, |pair| pair.y));
        let z = map_array(pairs, |pair| pair.z);
        let (z, partials) = camera.store.towards::<R, N>(context, z, y.state.position);
        let partials = self.with_merging(partials);
        let end: CameraEnd<R> = CameraEndRecord::load::<R, N>(ends.each_ref());
        let directions = self.joins.directions;
        let lanes = R::Mask::first(group.len());
        if let Some(c) = connect::<R, N>(context, directions, &y, (&z, partials), &end, lanes) {
            let count = self.joins.counts.connecting;
            if self.joins.drawing.is_some() {
                draws.set(context, (&c, count), &pairs);
            } else {
                queue.push(context, (&c, count), |i| Target::Own(pairs[i].index));
            }
        }
    }

    /// Loads light vertices on surfaces of one class, for connections.
    #[inline(always)]
    fn load_light<R: Lanes<N>, const N: usize>(
        &self,
        class: usize,
        ids: [VertexId; N],
    ) -> Vertex<R> {
        let (context, stores) = (self.tile.context, self.light.stores);
        let mut y = VertexStore::load_from::<R, N>(stores, context, class, ids);
        y.partials = self.with_merging(y.partials);
        y
    }

    /// Returns the partial sums of vertices for their connections.
    #[inline(always)]
    fn with_merging<F: Double>(&self, partials: MisPartials<F>) -> MisPartials<F> {
        if self.joins.merging.is_none() {
            return partials;
        }
        let h = self.tile.context.settings.heuristic();
        partials.with_merging(h, &self.joins.counts)
    }

    /// Connects light vertices on surfaces of one class to the lens.
    #[inline(always)]
    fn connect_lens<R: Lanes<N>, const N: usize>(
        &self,
        class: usize,
        group: &[LensConnection],
        queue: &mut ShadowQueue,
    ) {
        let connections: [LensConnection; N] = padded(group);
        let context = self.tile.context;
        let y = self.load_light::<R, N>(class, map_array(connections, |c| c.y));
        let taken = R::load_words(&map_array(connections, |c| c.taken));
        let paths = map_array(connections, |c| c.path as usize);
        let mut sampler = self.paths.samplers::<R, N>(self.tile, paths, taken);
        let emitted = self.vertices.starts.emitted::<R, N>(paths);
        let lanes = R::Mask::first(group.len());
        let directions = self.joins.directions;
        let found = connect_t1::<R, N>(context, directions, (&y, emitted), &mut sampler, lanes);
        self.push_splats(&connections, found, queue);
    }

    /// Connects the starts of light subpaths to the lens.
    #[inline(always)]
    fn connect_starts<R: Lanes<N>, const N: usize>(
        &self,
        group: &[LensConnection],
        starts: &[LightStartRecord],
        queue: &mut ShadowQueue,
    ) {
        let connections: [LensConnection; N] = padded(group);
        let starts: [LightStartRecord; N] = padded(starts);
        let context = self.tile.context;
        let taken = R::load_words(&map_array(connections, |c| c.taken));
        let paths = map_array(connections, |c| c.path as usize);
        let mut sampler = self.paths.samplers::<R, N>(self.tile, paths, taken);
        let start: LightStart<R> = LightStartRecord::load::<R, N>(starts.each_ref());
        let lanes = R::Mask::first(group.len());
        let found = connect_s1_t1::<R, N>(context, &start, &mut sampler, lanes);
        self.push_splats(&connections, found, queue);
    }

    /// Appends the contributions of connections to the lens.
    #[inline(always)]
    fn push_splats<R: Lanes<N>, const N: usize>(
        &self,
        connections: &[LensConnection; N],
        found: Option<(Connection<R, N>, LensPoints<R, N>)>,
        queue: &mut ShadowQueue,
    ) {
        if let Some((c, lens)) = found {
            let count = self.joins.counts.lens;
            queue.push(self.tile.context, (&c, count), |i| {
                let LensConnection { path, s, .. } = connections[i];
                Target::Splat(path, lens.pixels[i], s)
            });
        }
    }
}
