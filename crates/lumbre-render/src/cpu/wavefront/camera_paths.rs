//! Follows the camera paths of a tile, one step of all paths at a time: traces their edges, sorts
//! the hits by class of surface, runs the technique's step on vectors of one class, and traces the
//! shadow rays.

use std::marker::PhantomData;
use std::mem::take;

use super::light::{LaneSink, TileLight};
use super::wave::{PathRecords, Start, TileContext, Wave};
use crate::cpu::films::layers::{LayerNeeds, LayerRowFilm};
use crate::cpu::films::row_film::RowFilm;
use lumbre_light::math::real::Mask;
use lumbre_light::math::simd::{Lanes, SimdKernel, active_lanes, dispatch, map_array, padded};
use lumbre_light::transport::arrival::{Arrival, HitRecord};
use lumbre_light::transport::integrator::camera_path::{CameraPaths, Path, PathState};
use lumbre_light::transport::integrator::iteration::recorded::{LeftVertex, RecordedPaths};
use lumbre_light::transport::ray::Ray;

/// Number of samples in a tile. Their records fill half of a 48 KiB L1 data cache.
pub(super) const TILE_SAMPLES: usize = 256;

/// State of all paths of a tile, with buffers that tiles reuse.
#[derive(Default)]
pub(super) struct PathTile {
    wave: Wave,
    light: TileLight,
}

/// Renders the samples of a tile and adds them to the films of their row.
pub(super) fn render_tile<T: CameraPaths>(
    tile: &TileContext,
    buffers: &mut PathTile,
    film: &mut RowFilm,
    layers: Option<&mut LayerRowFilm>,
) {
    let needs = LayerNeeds::of(layers.as_deref());
    trace_tile::<T>(tile, buffers, needs, |_, _| ());
    buffers.light.add_to_film(tile, film, layers);
}

/// Traces the paths of a tile and records them.
pub(super) fn record_tile<T: CameraPaths>(tile: &TileContext) -> RecordedPaths {
    let (mut buffers, mut vertices) = (PathTile::default(), Vec::new());
    trace_tile::<T>(tile, &mut buffers, LayerNeeds::LIGHT, |edge, wave| {
        for path in &wave.next {
            let state = wave.paths.state(*path);
            vertices.push(LeftVertex::new(*path, edge, &state));
        }
    });
    let mut records = RecordedPaths::with_vertices(vertices);
    buffers.light.record(tile, &mut records);
    records
}

/// Traces the paths of a tile and keeps what layers need. `leaves` is called
/// after each step with the number of its edges and the wave, whose next paths are on the edges that
/// leave the vertices.
fn trace_tile<T: CameraPaths>(
    tile: &TileContext,
    buffers: &mut PathTile,
    needs: LayerNeeds,
    mut leaves: impl FnMut(u32, &Wave),
) {
    let TileContext { width, context, .. } = *tile;
    let count = tile.ids.len();
    buffers.light.reset(count, needs);
    buffers.wave.start(tile, Start::Camera);
    for edge in 1..=context.max_depth {
        if buffers.wave.active.is_empty() {
            return;
        }
        let PathTile { wave, light } = buffers;
        wave.trace(tile, light);
        wave.sort_hits(tile, |hit| context.ends_unlit(edge, hit));
        let mut escaped = take(&mut wave.escaped);
        let step = Step { tile, edge };
        if !escaped.is_empty() {
            let paths = &wave.paths;
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
        wave.escaped = escaped;
        let mut by_class = take(&mut wave.by_class);
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
        buffers.wave.by_class = by_class;
        buffers.light.trace_pending(context);
        leaves(edge, &buffers.wave);
        buffers.wave.advance();
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
        let PathTile { wave, light } = self.buffers;
        let records = &mut wave.paths;
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
            wave.next
                .extend(active_lanes(continues.bits()).map(|i| paths[i] as u32));
        }
    }
}
