//! The light subpaths of an iteration, with a grid of their vertices.

use crate::transport::integrator::bdpt::merge::{MergePoint, Merging};
use crate::transport::integrator::bdpt::weights::StrategyCounts;
use crate::transport::integrator::iteration::light_paths::{self, LightPaths};
use crate::transport::integrator::iteration::photon_map::{PhotonMap, UnitPoints, point_bytes};
use crate::transport::integrator::iteration::{Iteration, Resources, Shared};
use crate::transport::integrator::settings::Join;
use crate::transport::integrator::sppm::photons::{PhotonSetup, RADIUS_IN_PIXELS};

/// Upper bound of the bytes of a vertex: as stored, and in the grid.
pub const VERTEX_BYTES: usize = light_paths::VERTEX_BYTES + point_bytes::<MergePoint>();

/// Width of the automatic radius of the first iteration, in pixels, where merging finds only what
/// connections cannot.
const RADIUS_BESIDE_CONNECTIONS: f32 = 1.0;

/// Data that all samples of an iteration read.
pub struct SharedVertices {
    /// The light subpaths.
    pub paths: LightPaths,
    /// The vertices with which camera vertices merge.
    pub map: PhotonMap<MergePoint>,
    /// Numbers of samples of all strategies.
    pub counts: StrategyCounts,
}

impl SharedVertices {
    /// Returns the vertices as those that camera vertices are merged with.
    pub fn merging(&self) -> Merging<'_> {
        Merging {
            paths: &self.paths,
            map: &self.map,
            counts: &self.counts,
        }
    }
}

/// Data that all iterations of a job need; `None` if they share nothing.
type Setup = Option<(PhotonSetup, Join)>;

/// Computes what all iterations of a job need.
pub fn prepare(resources: &Resources) -> Box<Shared> {
    let setup = resources.map(1, |context, _| -> Setup {
        let join = context.settings.join;
        (join != Join::Connect).then(|| {
            let in_pixels = if join == Join::Merge {
                RADIUS_IN_PIXELS
            } else {
                RADIUS_BESIDE_CONNECTIONS
            };
            (PhotonSetup::new(context, in_pixels), join)
        })
    });
    Box::new(setup[0])
}

/// Traces the light subpaths of an iteration and builds the grid.
pub fn begin(iteration: &Iteration) -> Box<Shared> {
    let Some((setup, join)) = *iteration.prepared::<Setup>() else {
        return Box::new(());
    };
    let PhotonSetup { count, pixels, .. } = setup;
    let grid = setup.grid(iteration.index);
    let connects = if join == Join::Merge { 0.0 } else { 1.0 };
    let counts = StrategyCounts {
        connecting: connects,
        direct: connects,
        lens: connects * count as f64 / pixels as f64,
        merging: grid.gathered(count),
    };
    let paths = LightPaths::trace(iteration, count, counts);
    let units = iteration.map(paths.stores().len(), |_, unit| {
        let mut points = UnitPoints::new(grid);
        paths.for_each_scattering(unit, |id, edges, vertex| {
            points.push(vertex.position, MergePoint::new(id, edges, vertex));
        });
        points
    });
    let map = PhotonMap::new(iteration, grid, count, &units);
    Box::new(SharedVertices { paths, map, counts })
}
