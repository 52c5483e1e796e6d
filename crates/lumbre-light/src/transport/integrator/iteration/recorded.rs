//! Camera paths that are traced while an iteration begins, and recorded: the vertices that they
//! leave, and all light that they find. They are the samples of the iteration themselves, if the
//! technique gives them to the renderer.

use std::ops::Range;

use glam::Vec3;

use crate::transport::contribution::Contribution;
use crate::transport::integrator::Context;
use crate::transport::integrator::camera_path::{self, CameraPaths, PathState};
use crate::transport::sampler::{Sampler, SamplerRow};

/// Greatest number of paths of a batch.
pub const BATCH_PATHS: u32 = 256;

/// One camera path of each of several neighbouring pixels of a row.
#[derive(Clone, Debug)]
pub struct CameraBatch {
    /// Name of the integrator whose paths they are: one that follows paths from the camera.
    pub technique: &'static str,
    /// Generator of random numbers.
    pub sampler: &'static SamplerRow,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Index of the paths among those of their pixels, which keys the random numbers.
    pub sample: u64,
    /// Row of the pixels.
    pub row: u32,
    /// Columns of the pixels, at most [`BATCH_PATHS`].
    pub columns: Range<u32>,
}

/// Vertex that a path left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeftVertex {
    /// Number of the path in its batch.
    pub path: u32,
    /// Number of the edge that led to the vertex, counted from 1.
    pub edge: u32,
    /// Position in world space.
    pub position: Vec3,
    /// Unit direction of the next edge.
    pub dir: Vec3,
    /// Density per solid angle with which that direction was sampled;
    /// [`SPECULAR`](camera_path::SPECULAR) for a Dirac event.
    pub pdf_w: f32,
}

/// Records of the paths of a batch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordedPaths {
    /// Vertices that the paths left, path by path.
    vertices: Vec<LeftVertex>,
    /// Light that the paths found, path by path, in the order in which a sample adds it.
    light: Vec<Contribution>,
    /// The end of the light of each path in `light`, and the number of rays of the path.
    ends: Vec<(u32, u32)>,
}

impl CameraBatch {
    /// Returns the pixel of a path.
    pub fn pixel(&self, path: u32) -> [u32; 2] {
        [self.columns.start + path, self.row]
    }

    /// Returns the random numbers of a path.
    pub fn start(&self, path: u32) -> Sampler {
        self.sampler.start(self.seed, self.pixel(path), self.sample)
    }

    /// Follows the paths one after the other.
    pub fn follow<T: CameraPaths>(&self, context: &Context) -> RecordedPaths {
        let mut records = RecordedPaths::default();
        let RecordedPaths {
            vertices,
            light,
            ends,
        } = &mut records;
        for path in 0..self.columns.len() as u32 {
            let rays = camera_path::follow::<T>(
                context,
                self.pixel(path),
                self.start(path),
                &mut |found| light.push(found),
                |edge, state| vertices.push(LeftVertex::new(path, edge, state)),
            );
            ends.push((light.len() as u32, rays));
        }
        records
    }
}

impl LeftVertex {
    /// Returns the vertex at the end of edge number `edge` of a path with a state on its next edge.
    pub fn new(path: u32, edge: u32, state: &PathState<f32>) -> LeftVertex {
        LeftVertex {
            path,
            edge,
            position: state.last,
            dir: state.dir,
            pdf_w: state.last_pdf_w,
        }
    }
}

impl RecordedPaths {
    /// Returns records from vertices in any order of paths, those of a path in the order of its
    /// edges.
    pub fn with_vertices(mut vertices: Vec<LeftVertex>) -> RecordedPaths {
        vertices.sort_by_key(|vertex| vertex.path);
        RecordedPaths {
            vertices,
            ..RecordedPaths::default()
        }
    }

    /// Appends the light and the number of rays of the next path.
    pub fn push_path(&mut self, light: impl Iterator<Item = Contribution>, rays: u32) {
        self.light.extend(light);
        self.ends.push((self.light.len() as u32, rays));
    }

    /// Returns the number of paths.
    pub fn count(&self) -> u32 {
        self.ends.len() as u32
    }

    /// Returns the light of a path, in the order in which a sample adds it.
    pub fn light(&self, path: u32) -> &[Contribution] {
        let path = path as usize;
        let start = path.checked_sub(1).map_or(0, |before| self.ends[before].0);
        &self.light[start as usize..self.ends[path].0 as usize]
    }

    /// Returns the number of rays of a path.
    pub fn rays(&self, path: u32) -> u32 {
        self.ends[path as usize].1
    }

    /// Returns the vertices that all paths left, path by path.
    pub fn vertices(&self) -> &[LeftVertex] {
        &self.vertices
    }

    /// Returns the light without the vertices: all of it, or if not `each` the sum of every path.
    pub fn into_light(self, each: bool) -> RecordedPaths {
        let mut kept = RecordedPaths::default();
        if each {
            (kept.light, kept.ends) = (self.light, self.ends);
            return kept;
        }
        for path in 0..self.count() {
            let light = self.light(path);
            let sum = light.first().map(|first| Contribution {
                value: light.iter().fold(Vec3::ZERO, |sum, c| sum + c.value),
                ..*first
            });
            kept.push_path(sum.into_iter(), self.rays(path));
        }
        kept
    }
}

/// One sample of every pixel that was rendered while an iteration began.
pub struct RecordedSamples {
    /// Seed of its random numbers.
    pub seed: u64,
    /// Columns of the picture.
    width: u32,
    /// Batches of all rows, from left to right.
    batches: Vec<RecordedPaths>,
}

impl RecordedSamples {
    /// Bytes of a sample whose light was added up.
    pub const BYTES: usize = size_of::<Contribution>() + size_of::<(u32, u32)>();

    /// Returns samples that are in the batches of a picture: see [`batch_columns`].
    pub fn new(seed: u64, width: u32, batches: Vec<RecordedPaths>) -> RecordedSamples {
        RecordedSamples {
            seed,
            width,
            batches,
        }
    }

    /// Returns the light of a pixel's sample, in the order in which a film adds it, and its number
    /// of rays. Without layers or time axis the light is added up.
    pub fn sample(&self, [x, y]: [u32; 2]) -> (&[Contribution], u32) {
        let of_row = self.width.div_ceil(BATCH_PATHS);
        let batch = &self.batches[(y * of_row + x / BATCH_PATHS) as usize];
        let path = x % BATCH_PATHS;
        (batch.light(path), batch.rays(path))
    }
}

/// Returns row and columns of a batch of a picture with a width in pixels: rows from top to bottom,
/// each from left to right.
pub fn batch_columns(width: u32, batch: u32) -> (u32, Range<u32>) {
    let of_row = width.div_ceil(BATCH_PATHS);
    let start = batch % of_row * BATCH_PATHS;
    (batch / of_row, start..width.min(start + BATCH_PATHS))
}
