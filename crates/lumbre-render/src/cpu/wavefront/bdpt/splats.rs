//! Light that samples of a tile add to other pixels.

use crate::cpu::films::contributions::SampleId;
use crate::cpu::films::layers::LayerRowFilm;
use crate::cpu::films::row_film::RowFilm;
use crate::cpu::wavefront::wave::TileContext;
use lumbre_light::transport::contribution::Contribution;

/// Receives the splats of a tile.
pub(super) struct SplatSink<'a, 'f> {
    pub(super) tile: &'a TileContext<'a>,
    pub(super) film: &'a mut RowFilm<'f>,
    pub(super) layers: Option<&'a LayerRowFilm<'a>>,
}

impl SplatSink<'_, '_> {
    /// Adds a splat of a path.
    pub(super) fn add(&mut self, path: u32, contribution: &Contribution) {
        let id: SampleId = self.tile.ids[path as usize];
        self.film.splat_from_sample(id, contribution, self.layers);
    }
}
