//! The photons of an iteration, in a hashed grid of cubes whose side is the diameter of the disk
//! over which they are gathered. A query visits the eight cubes that the sphere can touch.
//!
//! The order of the photons is that in which they were traced, by shard and bucket: it does not
//! depend on threads.

use std::f32::consts::PI;

use glam::Vec3;

use crate::math::real::Real;
use crate::math::rng::pcg4d;
use crate::record;
use crate::transport::integrator::iteration::Iteration;
use crate::transport::path_time::OpticalLength;

/// Number of parts of the grid, which threads build independently.
pub const SHARDS: usize = 64;

/// Least cosine between the normals of a photon's surface and of a gathering one, on either side.
/// Photons on other surfaces, such as the next wall of a corner, are left out.
const MIN_COSINE: f32 = 0.5;

record! {
    /// Photons that arrived at surfaces.
    pub struct Photon => PhotonRecord {
        /// Unit direction to the previous vertex of the light subpath.
        wi: Vec3,
        /// Emitted radiance times all cosines and BSDF values over all densities: the flux, times
        /// the number of photons.
        flux: Vec3,
        /// Unit normal of the surface's front side.
        normal: Vec3,
        /// Number of edges from the light.
        edges: Word,
        /// 1 if camera paths could not hit the light, and all events on the way were Dirac events;
        /// else 0.
        unhittable: Real,
        /// Length of all segments: see [`OpticalLength::path`].
        path: Real,
        /// Delays of the previous vertices: see [`OpticalLength::delays`].
        delays: Real,
        /// Index of the last medium: see [`OpticalLength::index`].
        index: Real,
    }
}

impl<R: Real> Photon<R> {
    /// Returns the optical length up to the surface. Its delay is that of the camera path's vertex.
    #[inline(always)]
    pub fn optical(&self) -> OpticalLength<R> {
        OpticalLength {
            path: self.path,
            delays: self.delays,
            delay: R::splat(0.0),
            index: self.index,
        }
    }
}

/// The grid of an iteration with its radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Radius of the disk over which photons are gathered, in scene units.
    pub radius: f32,
}

/// A photon on its way into the map.
#[derive(Clone, Copy, Debug)]
pub struct PlacedPhoton {
    /// Position in world space.
    pub position: Vec3,
    /// Hash of its cube.
    hash: u32,
    /// The photon with its direction and flux.
    pub photon: PhotonRecord,
}

/// Photons of one unit of work by shard, in the order in which they were traced.
pub type UnitPhotons = Vec<Vec<PlacedPhoton>>;

/// The photons of an iteration.
#[derive(Debug)]
pub struct PhotonMap {
    grid: Grid,
    /// One over the number of photons and the area of the disk.
    scale: f32,
    shards: Vec<Shard>,
}

/// Photons of some cubes, sorted by bucket.
#[derive(Debug)]
struct Shard {
    /// Index of the first photon of each bucket, and the number of photons. The number of buckets
    /// is a power of two.
    starts: Vec<u32>,
    positions: Vec<Vec3>,
    photons: Vec<PhotonRecord>,
}

impl Grid {
    /// Returns the cube that contains a point.
    fn cube(&self, p: Vec3) -> [i32; 3] {
        (p / (2.0 * self.radius))
            .floor()
            .to_array()
            .map(|x| x as i32)
    }

    /// Returns the shard of a cube and its hash within the shard.
    fn place(cube: [i32; 3]) -> (usize, u32) {
        let [x, y, z] = cube.map(i32::cast_unsigned);
        let [shard, hash, ..] = pcg4d([x, y, z, 0]);
        (shard as usize % SHARDS, hash)
    }

    /// Adds a photon to those of its unit.
    pub fn push(&self, unit: &mut UnitPhotons, position: Vec3, photon: PhotonRecord) {
        let (shard, hash) = Grid::place(self.cube(position));
        unit[shard].push(PlacedPhoton {
            position,
            hash,
            photon,
        });
    }
}

impl PhotonMap {
    /// Builds the map from the photons of all units, in the order of the units. `count` is the
    /// number of photons that started at lights.
    pub fn new(iteration: &Iteration, grid: Grid, count: u64, units: &[UnitPhotons]) -> PhotonMap {
        let shards = iteration.map(SHARDS, |_, shard| {
            Shard::new(units.iter().flat_map(|unit| &unit[shard]))
        });
        PhotonMap {
            grid,
            scale: 1.0 / (count as f32 * PI * grid.radius * grid.radius),
            shards,
        }
    }

    /// Returns the factor from a photon's [`flux`](Photon::flux) to irradiance: one over the number
    /// of photons and the area over which they are gathered.
    pub fn scale(&self) -> f32 {
        self.scale
    }

    /// Appends the photons with at most `max_edges` edges near a point of a surface with the unit
    /// normal `n`, each with its number of edges.
    pub fn collect<'a>(
        &'a self,
        p: Vec3,
        n: Vec3,
        max_edges: u32,
        near: &mut Vec<(u32, &'a PhotonRecord)>,
    ) {
        let radius = self.grid.radius;
        let first = self.grid.cube(p - radius);
        let last = self.grid.cube(p + radius);
        for x in first[0]..=last[0] {
            for y in first[1]..=last[1] {
                for z in first[2]..=last[2] {
                    let cube = [x, y, z];
                    let (shard, hash) = Grid::place(cube);
                    self.shards[shard].for_each(hash, |position, record| {
                        let within = (position - p).length_squared() < radius * radius;
                        // Cubes may share a bucket.
                        if !within || self.grid.cube(position) != cube {
                            return;
                        }
                        let photon = PhotonRecord::load::<f32, 1>([record]);
                        if photon.edges <= max_edges && photon.normal.dot(n).abs() > MIN_COSINE {
                            near.push((photon.edges, record));
                        }
                    });
                }
            }
        }
    }
}

impl Shard {
    /// Sorts photons by bucket; those of a bucket keep their order.
    fn new<'a>(placed: impl Iterator<Item = &'a PlacedPhoton> + Clone) -> Shard {
        let count = placed.clone().count();
        let buckets = count.next_power_of_two();
        let mut starts = vec![0; buckets + 1];
        for photon in placed.clone() {
            starts[Shard::bucket(photon.hash, buckets) + 1] += 1;
        }
        for bucket in 0..buckets {
            starts[bucket + 1] += starts[bucket];
        }
        let mut next = starts.clone();
        let mut positions = vec![Vec3::ZERO; count];
        let mut photons = vec![PhotonRecord::default(); count];
        for photon in placed {
            let index = &mut next[Shard::bucket(photon.hash, buckets)];
            positions[*index as usize] = photon.position;
            photons[*index as usize] = photon.photon;
            *index += 1;
        }
        Shard {
            starts,
            positions,
            photons,
        }
    }

    /// Returns the bucket of a hash.
    fn bucket(hash: u32, buckets: usize) -> usize {
        hash as usize & (buckets - 1)
    }

    /// Visits the photons in the bucket of a hash.
    fn for_each<'a>(&'a self, hash: u32, mut visit: impl FnMut(Vec3, &'a PhotonRecord)) {
        let bucket = Shard::bucket(hash, self.starts.len() - 1);
        for i in self.starts[bucket] as usize..self.starts[bucket + 1] as usize {
            visit(self.positions[i], &self.photons[i]);
        }
    }
}
