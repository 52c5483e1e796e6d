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
    /// Their vertices.
    pub stores: &'a [VertexStore],
}

impl<'a> LightSubpaths<'a> {
    /// Returns the light subpaths of a tile, whose samples left `traced`.
    pub fn new(
        tile: &'a TileContext<'a>,
        joins: &Joins<'a>,
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
    pub fn vertices(&self, number: u64) -> impl Iterator<Item = VertexId> + use<'a> {
        let shared = self.shared.map(|paths| paths.vertices(number));
        let traced = self.shared.is_none().then(|| {
            let indices = self.traced.light.of_path(number as usize);
            indices.map(|index| VertexId::new(0, index))
        });
        shared
            .into_iter()
            .flatten()
            .chain(traced.into_iter().flatten())
    }

    /// Returns the start of a subpath for the sample of a path; `None` if there is none.
    pub fn start(&self, number: u64, path: usize) -> Option<LightStartRecord> {
        let mut start: LightStart<f32> = match self.shared {
            Some(paths) => paths.start(number),
            None => LightStartRecord::load([self.traced.starts.records.get(number as usize)?]),
        };
        if start.light == NONE {
            return None;
        }
        start.emitted = self.traced.starts.emitted::<f32, 1>([path]);
        let [record] = LightStartRecord::store::<f32, 1>(start);
        Some(record)
    }
}
