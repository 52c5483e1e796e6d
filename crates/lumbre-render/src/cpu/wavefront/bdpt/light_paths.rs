//! Traces light subpaths that belong to no pixel.

use super::vertices::Vertices;
use super::walk::{SubpathRecords, Walk};
use crate::Job;
use crate::cpu::films::contributions::SampleId;
use crate::cpu::films::layers::LayerNeeds;
use crate::cpu::wavefront::light::TileLight;
use crate::cpu::wavefront::wave::{Start, TileContext, Wave};
use lumbre_light::math::simd::Width;
use lumbre_light::transport::bsdf::TransportMode;
use lumbre_light::transport::integrator::Context;
use lumbre_light::transport::integrator::bdpt::directions::BsdfDirections;
use lumbre_light::transport::integrator::bdpt::state::LightStartRecord;
use lumbre_light::transport::integrator::iteration::light_batch::{
    LightBatch, LightUnit, max_edges,
};

/// Number of subpaths in a tile.
const TILE_SUBPATHS: usize = 256;

/// Subpaths of a tile, with buffers that tiles reuse.
#[derive(Default)]
struct LightTile {
    wave: Wave,
    states: SubpathRecords,
    vertices: Vertices,
    light: TileLight,
}

/// Traces the subpaths of a batch, with the job's generator of random numbers.
pub(in crate::cpu::wavefront) fn trace(
    width: Width,
    context: &Context,
    job: &Job,
    batch: &LightBatch,
) -> LightUnit {
    let [column, row] = batch.pixel;
    let ids: Vec<SampleId> = batch.samples().map(|sample| (column, sample)).collect();
    let mut unit = LightUnit::new(context);
    let mut buffers = LightTile::default();
    for ids in ids.chunks(TILE_SUBPATHS) {
        let tile = TileContext {
            width,
            context,
            job,
            seed: batch.seed,
            y: row,
            ids,
        };
        trace_tile(&tile, batch, &mut buffers, &mut unit);
    }
    unit
}

/// Traces the subpaths of a tile and appends them to `unit`.
fn trace_tile(
    tile: &TileContext,
    batch: &LightBatch,
    buffers: &mut LightTile,
    unit: &mut LightUnit,
) {
    let LightTile {
        wave,
        states,
        vertices,
        light,
    } = buffers;
    let count = tile.ids.len();
    light.reset(count, LayerNeeds::default());
    vertices.reset(tile.context, count);
    wave.start(tile, Start::Nowhere);
    let mut walk = Walk {
        tile,
        wave,
        states,
        light,
        directions: BsdfDirections,
        counts: batch.counts,
    };
    walk.start_at_lights(&mut vertices.starts);
    let max_edges = max_edges(tile.context);
    walk.trace(TransportMode::Importance, max_edges, vertices);
    let Vertices { light, starts, .. } = &*vertices;
    for (path, start) in starts.records.iter().enumerate() {
        let start = LightStartRecord::load::<f32, 1>([start]);
        unit.push_path(start, &light.store, light.of_path(path));
    }
}
