//! Techniques that join subpaths from the camera with subpaths from lights: traces all camera
//! subpaths of a tile, then the light subpaths, unless samples share those of an iteration, then
//! evaluates all connections and mergings. [`Joins`] states which there are.
//!
//! [`walk`] advances the subpaths of a tile by one step at a time and stores their vertices;
//! [`light_paths`] does so for light subpaths that belong to no pixel. [`lists`] lists the
//! connections of every sample in the order in which its contributions are added. [`connect`],
//! [`merges`] and [`draws`] evaluate them by class of surface, one pair of vertices per lane.
//!
//! The number of random numbers that a connection draws does not depend on its result, and the
//! order of a sample's contributions is known when connections are listed. Connections can
//! therefore be evaluated in any order.

mod connect;
mod draws;
mod light_paths;
mod lists;
mod merges;
mod pending;
mod source;
mod splats;
mod stored;
mod vertices;
mod walk;

use self::splats::SplatSink;
use super::light::TileLight;
use super::wave::{Start, TileContext, Wave};
use crate::cpu::films::layers::{LayerNeeds, LayerRowFilm};
use crate::cpu::films::row_film::RowFilm;
use connect::Connecting;
use lists::{ConnectionLists, Lister};
use lumbre_light::transport::bsdf::TransportMode;
use lumbre_light::transport::integrator::bdpt::directions::SubpathDirections;
use lumbre_light::transport::integrator::bdpt::joins::Joins;
use source::LightSubpaths;
use vertices::Vertices;

pub(super) use light_paths::trace as trace_light;

/// Number of samples in a tile.
pub(super) const TILE_SAMPLES: usize = 128;

/// Subpaths and connections of a tile, with buffers that tiles reuse.
#[derive(Default)]
pub(super) struct SubpathTile {
    wave: Wave,
    states: walk::SubpathRecords,
    vertices: Vertices,
    lists: ConnectionLists,
    light: TileLight,
}

/// Renders the samples of a tile and adds them to the films of their row: all splats, then the
/// contributions to their own pixels.
pub(super) fn render_tile(
    tile: &TileContext,
    joins: &Joins<impl SubpathDirections>,
    buffers: &mut SubpathTile,
    film: &mut RowFilm,
    layers: Option<&mut LayerRowFilm>,
) {
    let SubpathTile {
        wave,
        states,
        vertices,
        lists,
        light,
    } = buffers;
    let context = tile.context;
    let count = tile.ids.len();
    light.reset(count, LayerNeeds::of(layers.as_deref()));
    wave.start(tile, Start::Camera);
    vertices.reset(context, count);
    let mut walk = walk::Walk {
        tile,
        wave,
        states,
        light,
        directions: joins.directions,
        counts: joins.counts,
    };
    walk.start_at_camera(&mut vertices.starts);
    let max_edges = context.max_depth;
    walk.trace(TransportMode::Radiance, max_edges, vertices);
    if joins.shared.is_none() && max_edges > 0 {
        walk.start_at_lights(&mut vertices.starts);
        if max_edges > 1 {
            walk.trace(TransportMode::Importance, max_edges - 1, vertices);
        }
    }
    let (paths, vertices) = (&wave.paths, &*vertices);
    let connecting = Connecting {
        tile,
        paths,
        vertices,
        light: LightSubpaths::new(tile, joins, vertices),
        joins,
    };
    let splats = SplatSink {
        tile,
        film,
        layers: layers.as_deref(),
    };
    Lister::new(lists, connecting, light, splats).list_all(paths);
    light.add_to_film(tile, film, layers);
}
