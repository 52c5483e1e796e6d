//! Lists of the connections of a tile. Connections are listed in the order in which a sample adds
//! their light, and evaluated by class of surface.
//!
//! Each listed contribution to a sample's own pixel has an index in [`OwnContributions`]. Results
//! are stored at that index, so that sums do not depend on the order of evaluation. Splats are
//! added in fixed point, in any order.

use glam::Vec3;

use super::SplatSink;
use super::vertices::{HitLight, Vertices};
use crate::cpu::wavefront::bdpt::connect::{ConnectKernel, ShadowQueue};
use crate::cpu::wavefront::light::{Details, TileLight};
use crate::cpu::wavefront::wave::{PathRecords, TileContext};
use lumbre_light::math::simd::dispatch;
use lumbre_light::scene::compile::NONE;
use lumbre_light::transport::integrator::Context;
use lumbre_light::transport::integrator::bdpt::state::{CameraEndRecord, LightStartRecord};
use lumbre_light::transport::sampler::Sampler;

/// Number of listed contributions at which connections are evaluated before the whole tile is
/// listed. It bounds memory for deep paths.
const MAX_LISTED: usize = 1 << 13;

/// Pending connection of a camera vertex to a sampled point on a light (`s = 1`).
#[derive(Clone, Copy)]
pub(super) struct LightConnection {
    /// Index into [`OwnContributions`].
    pub index: u32,
    pub path: u32,
    /// Index of the camera vertex.
    pub z: u32,
    /// Position in the sample's random numbers.
    pub taken: u32,
}

/// Pending connection of a light vertex and a camera vertex.
#[derive(Clone, Copy)]
pub(super) struct VertexPair {
    /// Index into [`OwnContributions`].
    pub index: u32,
    /// Index of the light vertex.
    pub y: u32,
    /// Index of the camera vertex.
    pub z: u32,
}

/// Vertex pairs whose BSDFs at the camera vertices have been evaluated.
#[derive(Default)]
pub(super) struct EvaluatedPairs {
    pub pairs: Vec<VertexPair>,
    pub ends: Vec<CameraEndRecord>,
}

/// Pending connection of a light vertex, or of the start of a light subpath, to the lens.
#[derive(Clone, Copy)]
pub(super) struct LensConnection {
    pub path: u32,
    /// Index of the light vertex; unused for a start.
    pub y: u32,
    /// Number of light vertices.
    pub s: u32,
    /// Position in the sample's random numbers.
    pub taken: u32,
}

/// Contributions of samples to their own pixels, in the order in which they are added.
#[derive(Default)]
pub(super) struct OwnContributions {
    /// Path and value of each contribution.
    pub values: Vec<(u32, Vec3)>,
    /// Optical length of each contribution; empty without a time axis.
    pub lengths: Vec<f64>,
    /// Details of each contribution for layers; empty without layers.
    pub details: Vec<Details>,
}

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
    /// Lists by class of the light vertex.
    pub evaluated: Vec<EvaluatedPairs>,
    /// Lists by class of the light vertex.
    pub lens_connections: Vec<Vec<LensConnection>>,
    pub start_connections: Vec<LensConnection>,
    pub queue: ShadowQueue,
}

/// Optional columns of [`OwnContributions`].
#[derive(Clone, Copy)]
struct Columns {
    timed: bool,
    layered: bool,
}

impl OwnContributions {
    /// Appends a contribution of a path; it is black until its connection is evaluated. Returns its
    /// index.
    fn push(&mut self, columns: Columns, path: usize, [s, t]: [u32; 2]) -> u32 {
        self.values.push((path as u32, Vec3::ZERO));
        if columns.timed {
            self.lengths.push(0.0);
        }
        if columns.layered {
            let unweighted = Vec3::ZERO;
            self.details.push(Details { unweighted, s, t });
        }
        self.values.len() as u32 - 1
    }

    /// Sets a contribution.
    #[inline]
    pub fn set(&mut self, index: u32, value: Vec3, unweighted: Vec3, length: f64) {
        let index = index as usize;
        self.values[index].1 = value;
        if let Some(to) = self.lengths.get_mut(index) {
            *to = length;
        }
        if let Some(to) = self.details.get_mut(index) {
            to.unweighted = unweighted;
        }
    }

    /// Appends light that a path hit.
    fn push_hit(&mut self, columns: Columns, path: usize, hit: &HitLight) {
        let index = self.push(columns, path, [0, hit.t]);
        self.set(index, hit.value, hit.unweighted, hit.length);
    }

    /// Adds all contributions to the light of their paths, in order, and removes them.
    fn add_to(&mut self, context: &Context, light: &mut TileLight) {
        for (i, (path, value)) in self.values.drain(..).enumerate() {
            let details = self.details.get(i).copied();
            if value == Vec3::ZERO && details.is_none() {
                continue;
            }
            let timing = context.timing.map(|timing| {
                let position = timing.axis.bin_position(self.lengths[i]);
                (timing, position)
            });
            light.add(timing, path, value, details);
        }
        self.lengths.clear();
        self.details.clear();
    }
}

impl ConnectionLists {
    /// Prepares the lists for a tile; all must be empty.
    pub fn reset(&mut self, classes: usize) {
        self.light_connections.resize_with(classes, Vec::new);
        self.lifted_connections.resize_with(classes, Vec::new);
        self.pairs.resize_with(classes, Vec::new);
        self.evaluated.resize_with(classes, EvaluatedPairs::default);
        self.lens_connections.resize_with(classes, Vec::new);
    }

    /// Lists all contributions of a sample.
    pub fn list_path(
        &mut self,
        tile: &TileContext,
        path: usize,
        paths: &PathRecords,
        vertices: &Vertices,
        layered: bool,
    ) {
        let columns = Columns {
            timed: tile.context.timing.is_some(),
            layered,
        };
        let mut sampler = paths.sampler(tile, path);
        self.list_camera_path(tile.context, columns, path, vertices, &mut sampler);
        self.list_lens_connections(tile.context, path, vertices, &mut sampler);
    }

    /// Lists all contributions of a sample to its own pixel.
    fn list_camera_path(
        &mut self,
        context: &Context,
        columns: Columns,
        path: usize,
        vertices: &Vertices,
        sampler: &mut Sampler,
    ) {
        let (settings, max) = (context.settings, context.max_depth);
        let Vertices {
            camera,
            light,
            hits,
            ..
        } = vertices;
        if let Some(hit) = hits.found.get(hits.escaped[path] as usize) {
            self.own.push_hit(columns, path, hit);
        }
        let mut indices = camera.of_path(path);
        for (hit, t) in hits.of_path(path).zip(2..) {
            if let Some(hit) = hits.found.get(hit as usize) {
                self.own.push_hit(columns, path, hit);
            }
            let Some(z) = indices.next() else {
                return;
            };
            let event = &camera.store.events()[z as usize];
            if !event.connects {
                continue;
            }
            let class = event.class as usize;
            if settings.includes(1, t) {
                let lifts =
                    context.classes[class].surface.terminator && camera.store.lifts(z as usize);
                let lists = [&mut self.light_connections, &mut self.lifted_connections];
                for list in lists.into_iter().take(1 + usize::from(lifts)) {
                    list[class].push(LightConnection {
                        index: self.own.push(columns, path, [1, t]),
                        path: path as u32,
                        z,
                        taken: sampler.taken(),
                    });
                    // The numbers of the connection, which are not computed here.
                    let _ = sampler.next_three();
                }
            }
            for (y, s) in light
                .of_path(path)
                .zip(2..)
                .take_while(|(_, s)| s + t - 1 <= max)
            {
                if settings.includes(s, t) && light.store.events()[y as usize].connects {
                    let index = self.own.push(columns, path, [s, t]);
                    self.pairs[class].push(VertexPair { index, y, z });
                }
            }
        }
    }

    /// Lists the connections of a light subpath to the lens.
    fn list_lens_connections(
        &mut self,
        context: &Context,
        path: usize,
        vertices: &Vertices,
        sampler: &mut Sampler,
    ) {
        let mut connection = |y: u32, s: u32| {
            let taken = sampler.taken();
            // The numbers of the connection, which are not computed here.
            let _ = [sampler.next_2d(), sampler.next_2d()];
            let path = path as u32;
            LensConnection { path, y, s, taken }
        };
        let settings = context.settings;
        if settings.includes(1, 1)
            && let Some(start) = vertices.starts.records.get(path)
            && LightStartRecord::load::<f32, 1>([start]).light != NONE
        {
            self.start_connections.push(connection(NONE, 1));
        }
        let light = &vertices.light;
        for (y, s) in light.of_path(path).zip(2..) {
            let event = &light.store.events()[y as usize];
            if event.connects && settings.includes(s, 1) {
                self.lens_connections[event.class as usize].push(connection(y, s));
            }
        }
    }

    /// Returns whether the lists should be evaluated before more connections are listed.
    pub fn are_full(&self) -> bool {
        self.own.values.len() >= MAX_LISTED
    }

    /// Evaluates all listed connections, empties the lists, and adds the contributions to the
    /// samples' own pixels to `light`.
    pub fn evaluate(
        &mut self,
        tile: &TileContext,
        (paths, vertices): (&PathRecords, &Vertices),
        light: &mut TileLight,
        splats: &mut SplatSink,
    ) {
        let kernel = ConnectKernel {
            lists: self,
            tile,
            paths,
            vertices,
            light,
            splats,
        };
        dispatch(tile.width, kernel);
        self.own.add_to(tile.context, light);
    }
}
