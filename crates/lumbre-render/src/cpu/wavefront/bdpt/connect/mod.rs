//! Connections of the subpaths of a tile. They are listed in the order in which the scalar `bdpt`
//! adds them, and evaluated by class of surface, one connection per lane.
//!
//! Each listed contribution to a sample's own pixel has an index in [`OwnContributions`]. Results
//! are stored at that index, so that sums do not depend on the order of evaluation. Splats are
//! added in fixed point, in any order.

mod interior;
mod lens;
mod light;
pub(super) mod load;

use glam::Vec3;

use self::interior::{connect_interior, evaluate_camera_ends};
use self::lens::connect_t1;
use self::light::connect_s1;
use super::{SampleSums, TileContext, TileSubpaths, VertexRecord};
use crate::cpu::wavefront::bdpt::shadow_rays::shadow_ray;
use lumbre_light::math::real::{Double, Vector};
use lumbre_light::math::simd::{F32x8, Lanes, SimdKernel, dispatch};
use lumbre_light::transport::ray::Ray;

/// Function that adds a splat: path, pixel, value, and optical length.
pub(super) type Splat<'a> = dyn FnMut(u32, [u32; 2], Vec3, f64) + 'a;

/// Number of queued contributions at which their shadow rays are traced.
const MAX_QUEUED: usize = 64;

/// Number of listed contributions at which connections are evaluated before the whole tile is
/// listed. It bounds memory for deep paths.
const MAX_LISTED: usize = 1 << 13;

/// Destination of a contribution.
#[derive(Clone, Copy)]
pub(super) enum Target {
    /// The sample's own pixel: index into [`OwnContributions`].
    Own(u32),
    /// Any pixel, by a splat: path and pixel.
    Splat(u32, [u32; 2]),
}

/// Contributions whose shadow rays have not been traced.
#[derive(Default)]
pub(super) struct ShadowQueue {
    rays: Vec<(Ray, f32)>,
    /// Value and destination of each contribution.
    contributions: Vec<(Vec3, Target)>,
    /// Optical lengths of the contributions; used only with a time axis.
    pub lengths: Vec<f64>,
    occluded: Vec<bool>,
}

impl ShadowQueue {
    /// Appends a contribution: a row of `shade::shadow_rays`, a row that starts with its value, and
    /// its destination.
    #[inline]
    pub fn push(&mut self, ray: &F32x8, value: &F32x8, target: Target) {
        self.rays.push(shadow_ray(ray));
        let [r, g, b, ..] = value.0;
        self.contributions.push((Vec3::new(r, g, b), target));
    }
}

/// Pending connection of camera vertex `z` to a sampled point on a light (`s = 1`).
#[derive(Clone, Copy)]
struct LightConnection {
    /// Index into [`OwnContributions`].
    index: u32,
    path: u32,
    z: u32,
    /// Number of random numbers drawn before.
    taken: u32,
}

/// Pending connection of light vertex `y` and camera vertex `z`.
#[derive(Clone, Copy)]
struct VertexPair {
    /// Index into [`OwnContributions`].
    index: u32,
    y: u32,
    z: u32,
}

/// Vertex pair whose BSDF at the camera vertex has been evaluated.
#[derive(Clone, Copy)]
struct EvaluatedPair {
    pair: VertexPair,
    /// Value of the BSDF at the camera vertex, its density and its reverse density.
    at_z: [f32; 5],
}

/// Pending connection of light vertex `y` to the lens (`t = 1`).
#[derive(Clone, Copy)]
struct LensConnection {
    path: u32,
    y: u32,
    /// Number of random numbers drawn before.
    taken: u32,
}

/// Contributions of samples to their own pixels, in the order in which they are added.
#[derive(Default)]
pub(super) struct OwnContributions {
    /// Path and value of each contribution.
    values: Vec<(u32, Vec3)>,
    /// Optical length of each contribution; used only with a time axis.
    lengths: Vec<f64>,
}

/// Pending connections of a tile.
#[derive(Default)]
pub(super) struct ConnectionLists {
    own: OwnContributions,
    /// Lists by class of the camera vertex.
    light_connections: Vec<Vec<LightConnection>>,
    pairs: Vec<Vec<VertexPair>>,
    /// Lists by class of the light vertex.
    evaluated: Vec<Vec<EvaluatedPair>>,
    lens_connections: Vec<Vec<LensConnection>>,
    pub(super) queue: ShadowQueue,
}

impl ConnectionLists {
    /// Prepares the lists for a tile; all must be empty.
    pub fn reset(&mut self, classes: usize) {
        self.light_connections.resize_with(classes, Vec::new);
        self.pairs.resize_with(classes, Vec::new);
        self.evaluated.resize_with(classes, Vec::new);
        self.lens_connections.resize_with(classes, Vec::new);
    }

    /// Appends a contribution of a path to its own pixel and returns its index.
    fn list_contribution<const TIMED: bool>(
        &mut self,
        path: usize,
        value: Vec3,
        length: f64,
    ) -> u32 {
        self.own.values.push((path as u32, value));
        if TIMED {
            self.own.lengths.push(length);
        }
        self.own.values.len() as u32 - 1
    }

    /// Lists all contributions of a sample to its own pixel. `escaped` and `length` are those of
    /// the environment. Returns the number of random numbers that the sample has drawn after them.
    pub fn list_camera_path<const TIMED: bool>(
        &mut self,
        tile: &TileContext<TIMED>,
        path: usize,
        [light, camera]: [&TileSubpaths; 2],
        (escaped, length): (Vec3, f64),
    ) -> u32 {
        let TileContext { table, context, .. } = *tile;
        let (settings, max) = (context.settings, context.max_depth);
        let mut taken = light.states[path].taken();
        if escaped != Vec3::ZERO {
            self.list_contribution::<TIMED>(path, escaped, length);
        }
        for (z, t) in camera.path(path).zip(2..) {
            let vertex = &camera.vertices[z as usize];
            if vertex.emission != Vec3::ZERO {
                self.list_contribution::<TIMED>(
                    path,
                    vertex.emission,
                    if TIMED {
                        vertex.optical().arrival()
                    } else {
                        0.0
                    },
                );
            }
            let Some(class) = vertex
                .class
                .map(usize::from)
                .filter(|class| table.traits(*class).connected)
            else {
                continue;
            };
            if settings.includes(1, t) {
                let index = self.list_contribution::<TIMED>(path, Vec3::ZERO, 0.0);
                self.light_connections[class].push(LightConnection {
                    index,
                    path: path as u32,
                    z,
                    taken,
                });
                taken += 3;
            }
            for (y, s) in light
                .path(path)
                .zip(2..)
                .take_while(|(_, s)| s + t - 1 <= max)
            {
                if settings.includes(s, t)
                    && tile
                        .connectible_class(&light.vertices[y as usize])
                        .is_some()
                {
                    let index = self.list_contribution::<TIMED>(path, Vec3::ZERO, 0.0);
                    self.pairs[class].push(VertexPair { index, y, z });
                }
            }
        }
        taken
    }

    /// Lists the connections of a light subpath to the lens, except that of its first vertex.
    /// `taken` random numbers were drawn before.
    pub fn list_lens_connections<const TIMED: bool>(
        &mut self,
        tile: &TileContext<TIMED>,
        path: usize,
        light: &TileSubpaths,
        mut taken: u32,
    ) {
        for (y, s) in light.path(path).zip(2..) {
            if tile.context.settings.includes(s, 1)
                && let Some(class) = tile.connectible_class(&light.vertices[y as usize])
            {
                self.lens_connections[class].push(LensConnection {
                    path: path as u32,
                    y,
                    taken,
                });
                taken += 4;
            }
        }
    }

    /// Returns whether the lists should be evaluated before more connections are listed.
    pub fn are_full(&self) -> bool {
        self.own.values.len() >= MAX_LISTED
    }

    /// Evaluates all listed connections, empties the lists, and adds the contributions to the
    /// samples' own pixels to `sums`.
    pub fn evaluate<const TIMED: bool>(
        &mut self,
        tile: &TileContext<TIMED>,
        [light, camera]: [&TileSubpaths; 2],
        sums: &mut SampleSums,
        splat: &mut Splat,
    ) {
        dispatch(
            tile.table.width,
            ConnectKernel {
                lists: self,
                tile,
                light,
                camera,
                splat,
            },
        );
        for (i, (path, value)) in self.own.values.drain(..).enumerate() {
            sums.values[path as usize] += value;
            if TIMED
                && value != Vec3::ZERO
                && let Some(timing) = tile.context.timing
            {
                sums.timed.push(
                    timing,
                    path,
                    value,
                    timing.axis.bin_position(self.own.lengths[i]),
                );
            }
        }
        self.own.lengths.clear();
    }
}

/// Kernel of [`ConnectionLists::evaluate`].
struct ConnectKernel<'a, 'b, const TIMED: bool> {
    lists: &'a mut ConnectionLists,
    tile: &'a TileContext<'a, TIMED>,
    light: &'a TileSubpaths,
    camera: &'a TileSubpaths,
    splat: &'a mut Splat<'b>,
}

impl<const TIMED: bool> SimdKernel for ConnectKernel<'_, '_, TIMED> {
    type Output = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        let ConnectKernel {
            lists,
            tile,
            light,
            camera,
            splat,
        } = self;
        let ConnectionLists {
            own,
            light_connections,
            pairs,
            evaluated,
            lens_connections,
            queue,
        } = lists;
        for class in 0..light_connections.len() {
            for group in light_connections[class].chunks(N) {
                connect_s1::<R, N, TIMED>(tile, class, group, camera, queue);
                if queue.contributions.len() >= MAX_QUEUED {
                    tile.resolve(queue, own, splat);
                }
            }
            light_connections[class].clear();
            for group in pairs[class].chunks(N) {
                evaluate_camera_ends::<R, N, TIMED>(tile, class, group, [light, camera], evaluated);
            }
            pairs[class].clear();
            for group in lens_connections[class].chunks(N) {
                connect_t1::<R, N, TIMED>(tile, class, group, light, queue);
                if queue.contributions.len() >= MAX_QUEUED {
                    tile.resolve(queue, own, splat);
                }
            }
            lens_connections[class].clear();
        }
        for (class, list) in evaluated.iter_mut().enumerate() {
            for group in list.chunks(N) {
                connect_interior::<R, N, TIMED>(tile, class, group, [light, camera], queue);
                if queue.contributions.len() >= MAX_QUEUED {
                    tile.resolve(queue, own, splat);
                }
            }
            list.clear();
        }
        tile.resolve(queue, own, splat);
    }
}

impl<const TIMED: bool> TileContext<'_, TIMED> {
    /// Returns the class of a vertex, or `None` if it cannot be connected.
    fn connectible_class(&self, vertex: &VertexRecord) -> Option<usize> {
        vertex
            .class
            .map(usize::from)
            .filter(|class| self.table.traits(*class).connected)
    }

    /// Traces the queued shadow rays, stores or splats the unoccluded contributions, and empties
    /// the queue.
    pub(super) fn resolve(
        &self,
        queue: &mut ShadowQueue,
        own: &mut OwnContributions,
        splat: &mut Splat,
    ) {
        let ShadowQueue {
            rays,
            contributions,
            lengths,
            occluded,
        } = queue;
        occluded.clear();
        // Coincident points are mutually visible and need no shadow ray.
        if rays.iter().any(|(_, distance)| *distance <= 0.0) {
            occluded.extend(
                rays.iter().map(|(ray, d)| {
                    (*d > 0.0 || d.is_nan()) && self.context.trace.occluded(ray, *d)
                }),
            );
        } else {
            self.context.trace.occluded_each(rays, occluded);
        }
        rays.clear();
        for (i, ((value, target), _)) in contributions
            .drain(..)
            .zip(&*occluded)
            .enumerate()
            .filter(|(_, (_, occluded))| !**occluded)
        {
            let length = if TIMED { lengths[i] } else { 0.0 };
            match target {
                Target::Own(index) => {
                    own.values[index as usize].1 = value;
                    if TIMED {
                        own.lengths[index as usize] = length;
                    }
                }
                Target::Splat(path, pixel) => splat(path, pixel, value, length),
            }
        }
        lengths.clear();
    }

    /// Returns rows that start with the contributions, multiplied by the MIS weight 1 / (1 +
    /// `others`), or by 1 if the job renders unweighted. They are zero outside `usable`.
    #[inline(always)]
    pub(super) fn mis_weighted<R: Lanes<N>, const N: usize>(
        &self,
        unweighted: R::Vec3,
        others: R::Double,
        usable: R::Mask,
    ) -> [F32x8; N] {
        let zero = R::splat(0.0);
        let one = R::Double::splat(1.0);
        let weight = if self.context.settings.unweighted() {
            R::splat(1.0)
        } else {
            (one / (one + others)).single()
        };
        let value = R::Vec3::select(usable, unweighted * weight, R::Vec3::broadcast(Vec3::ZERO));
        R::transpose_store([
            value.x(),
            value.y(),
            value.z(),
            zero,
            zero,
            zero,
            zero,
            zero,
        ])
    }
}
