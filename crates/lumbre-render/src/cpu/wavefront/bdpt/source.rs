//! The light subpaths that the samples of a tile are joined with: those that they traced, or those
//! that all samples of an iteration share.

use std::iter::StepBy;
use std::ops::Range;
use std::slice;

use super::vertices::Vertices;
use crate::cpu::wavefront::wave::TileContext;
use lumbre_light::scene::compile::NONE;
use lumbre_light::transport::integrator::bdpt::joins::Joins;
use lumbre_light::transport::integrator::bdpt::state::{LightStart, LightStartRecord};
use lumbre_light::transport::integrator::bdpt::store::{VertexId, VertexStore};
use lumbre_light::transport::integrator::iteration::light_paths::LightPaths;

/// Light subpaths, each with a number.
#[derive(Clone, Copy)]
pub(super) struct LightSubpaths<'a> {
    tile: &'a TileContext<'a>,
    traced: &'a Vertices,
    shared: Option<&'a LightPaths>,
    /// Vertices of all subpaths.
    pub stores: &'a [VertexStore],
}

impl<'a> LightSubpaths<'a> {
    /// Returns the light subpaths of a tile, whose samples left `traced`.
    pub fn new<D>(
        tile: &'a TileContext<'a>,
        joins: &Joins<'a, D>,
        traced: &'a Vertices,
    ) -> LightSubpaths<'a> {
        LightSubpaths {
            tile,
            traced,
            shared: joins.shared,
            stores: match joins.shared {
                Some(paths) => paths.stores(),
                None => slice::from_ref(&traced.light.store),
            },
        }
    }

    /// Returns the number of pixels, and the index of that of a path.
    fn pixel(&self, path: usize) -> [u64; 2] {
        let [width, height] = self.tile.context.camera.resolution().map(u64::from);
        let column = u64::from(self.tile.ids[path].0);
        [width * height, u64::from(self.tile.y) * width + column]
    }

    /// Returns the number of the subpath with which the camera subpath of a path is connected.
    pub fn of_camera(&self, path: usize) -> u64 {
        match self.shared {
            Some(paths) => self.pixel(path)[1] % paths.count(),
            None => path as u64,
        }
    }

    /// Returns the numbers of the subpaths that the sample of a path connects to the lens.
    pub fn of_lens(&self, path: usize) -> StepBy<Range<u64>> {
        match self.shared {
            Some(paths) => {
                let [pixels, index] = self.pixel(path);
                (index..paths.count().max(index)).step_by(pixels as usize)
            }
            None => (path as u64..path as u64 + 1).step_by(1),
        }
    }

    /// Returns the vertices of a subpath, in order.
    pub fn vertices(&self, number: u64) -> VertexIds<'a> {
        match self.shared {
            Some(paths) => {
                let (unit, indices) = paths.vertices(number);
                VertexIds::Shared { unit, indices }
            }
            None => {
                let (indices, step) = self.traced.light.edges_of(number as usize);
                VertexIds::Traced { indices, step }
            }
        }
    }

    /// Returns the start of a subpath for the sample of a path; `None` if there is none.
    pub fn start(&self, number: u64, path: usize) -> Option<LightStartRecord> {
        let starts = &self.traced.starts;
        let Some(paths) = self.shared else {
            let record = starts.records.get(number as usize)?;
            let exists = LightStartRecord::load::<f32, 1>([record]).light != NONE;
            return exists.then_some(*record);
        };
        let start = LightStart {
            emitted: starts.emitted::<f32, 1>([path]),
            ..paths.start(number)
        };
        let [record] = LightStartRecord::store::<f32, 1>(start);
        (start.light != NONE).then_some(record)
    }
}

/// Vertices of a light subpath, in order.
pub(super) enum VertexIds<'a> {
    /// Consecutive vertices of a store.
    Shared { unit: usize, indices: Range<u32> },
    /// Indices of the vertices in the tile's store, one in each `step`, up to [`NONE`].
    Traced { indices: &'a [u32], step: usize },
}

impl Iterator for VertexIds<'_> {
    type Item = VertexId;

    #[inline]
    fn next(&mut self) -> Option<VertexId> {
        match self {
            VertexIds::Shared { unit, indices } => {
                indices.next().map(|index| VertexId::new(*unit, index))
            }
            VertexIds::Traced { indices, step } => {
                let index = *indices.first()?;
                *indices = indices.get(*step..).unwrap_or_default();
                (index != NONE).then(|| VertexId::new(0, index))
            }
        }
    }
}
