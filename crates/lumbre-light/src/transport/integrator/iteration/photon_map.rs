//! A hashed grid of points on surfaces, at which light subpaths arrived: photons, or vertices that
//! camera paths merge with. The sides of its cubes are the diameter of the disk over which points
//! are gathered. A query visits the eight cubes that the sphere can touch.
//!
//! The order of the points is that in which they were traced, by shard and bucket: it does not
//! depend on threads.

use std::f64::consts::PI;

use glam::Vec3;

use super::Iteration;
use crate::math::real::{Mask, Real, Vector};
use crate::math::rng::pcg4d;
use crate::math::simd::{Lanes, active_lanes};

/// Number of parts of the grid, which threads build independently.
pub const SHARDS: usize = 64;

/// Least cosine between the normals of a point's surface and of a gathering one, on either side.
/// Points on other surfaces, such as the next wall of a corner, are left out.
const MIN_COSINE: f32 = 0.5;

/// Greatest distance of a point from the plane of a gathering surface, in radii. Points on the far
/// wall of a thin shell, whose normals are alike, are left out.
const MAX_HEIGHT: f32 = 0.25;

/// The grid of an iteration with its radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Radius of the disk over which points are gathered, in scene units.
    pub radius: f32,
}

/// A point on its way into the map.
#[derive(Clone, Copy, Debug)]
pub struct PlacedPoint<T> {
    /// Position in world space.
    position: Vec3,
    /// Hash of its cube.
    hash: u32,
    /// Properties of the point besides its position.
    data: T,
}

/// Points of one unit of work by shard, in the order in which they were traced.
#[derive(Clone, Debug)]
pub struct UnitPoints<T> {
    grid: Grid,
    shards: Vec<Vec<PlacedPoint<T>>>,
}

/// The points of an iteration, each with data of type `T`.
#[derive(Debug)]
pub struct PhotonMap<T> {
    grid: Grid,
    /// One over the number of light subpaths and the area of the disk.
    scale: f32,
    shards: Vec<Shard<T>>,
}

/// Points of some cubes, sorted by bucket.
#[derive(Debug)]
struct Shard<T> {
    /// Index of the first point of each bucket, and the number of points. The number of buckets is
    /// a power of two.
    starts: Vec<u32>,
    /// Coordinates of the points by axis, and as many zeros as a vector may have lanes.
    positions: [Vec<f32>; 3],
    data: Vec<T>,
}

/// Greatest number of lanes of a vector.
const MAX_LANES: usize = 16;

/// Returns an upper bound of the bytes of a point while the map is built: in its unit of work, whose
/// lists have up to twice the capacity that they need, in the map, and in two lists of buckets, of
/// which there are up to two for each point.
pub const fn point_bytes<T>() -> usize {
    2 * size_of::<PlacedPoint<T>>() + size_of::<Vec3>() + size_of::<T>() + 4 * size_of::<u32>()
}

/// Returns whether a point with this unit normal is on a surface that may gather at a point with
/// the unit normal `n`.
pub fn same_surface(normal: Vec3, n: Vec3) -> bool {
    normal.dot(n).abs() > MIN_COSINE
}

/// Returns the cosine of `wi` with the shading normal over that with the geometric normal, on which
/// light subpaths arrive [Veach 1997, 5.3].
#[inline(always)]
pub fn cosine_ratio<V: Vector>(n_shading: V, n_geometric: V, wi: V) -> V::Scalar {
    let (zero, one) = (V::Scalar::splat(0.0), V::Scalar::splat(1.0));
    let flat = n_shading.same(n_geometric);
    if !(!flat).any() {
        return one;
    }
    let ratio = wi.dot(n_shading).abs() / wi.dot(n_geometric).abs();
    V::Scalar::select(flat, one, V::Scalar::select(ratio.is_finite(), ratio, zero))
}

impl Grid {
    /// Returns the cube that contains a point.
    #[inline(always)]
    fn cube(&self, p: Vec3) -> [i32; 3] {
        let scaled = p / (2.0 * self.radius);
        scaled.to_array().map(|x| Real::floor(x) as i32)
    }

    /// Returns the shard of a cube and its hash within the shard.
    fn place(cube: [i32; 3]) -> (usize, u32) {
        let [x, y, z] = cube.map(i32::cast_unsigned);
        let [shard, hash, ..] = pcg4d([x, y, z, 0]);
        (shard as usize % SHARDS, hash)
    }

    /// Returns the expected number of points of `count` light subpaths that are gathered, for each
    /// unit of their density per area: `count pi radius^2`.
    pub fn gathered(&self, count: u64) -> f64 {
        let radius = f64::from(self.radius);
        count as f64 * PI * radius * radius
    }
}

impl<T> UnitPoints<T> {
    /// Creates a unit without points.
    pub fn new(grid: Grid) -> UnitPoints<T> {
        let shards = (0..SHARDS).map(|_| Vec::new()).collect();
        UnitPoints { grid, shards }
    }

    /// Adds a point.
    pub fn push(&mut self, position: Vec3, data: T) {
        let (shard, hash) = Grid::place(self.grid.cube(position));
        self.shards[shard].push(PlacedPoint {
            position,
            hash,
            data,
        });
    }
}

impl<T: Copy + Default + Send + Sync> PhotonMap<T> {
    /// Builds the map from the points of all units, in the order of the units. `count` is the number
    /// of light subpaths that started at lights.
    pub fn new(
        iteration: &Iteration,
        grid: Grid,
        count: u64,
        units: &[UnitPoints<T>],
    ) -> PhotonMap<T> {
        let shards = iteration.map(SHARDS, |_, shard| {
            Shard::new(units.iter().flat_map(|unit| &unit.shards[shard]))
        });
        PhotonMap {
            grid,
            scale: (1.0 / grid.gathered(count)) as f32,
            shards,
        }
    }

    /// Returns the factor from the throughput of a light subpath to irradiance: one over the number
    /// of subpaths and the area over which points are gathered.
    pub fn scale(&self) -> f32 {
        self.scale
    }

    /// Visits the points within the radius of a point of a surface with the unit normal `n`, and near
    /// its plane. Vectors test the distances of several points at a time.
    #[inline(always)]
    pub fn for_each_near<'a, R: Lanes<N>, const N: usize>(
        &'a self,
        [p, n]: [Vec3; 2],
        mut visit: impl FnMut(&'a T),
    ) {
        let radius = self.grid.radius;
        let first = self.grid.cube(p - radius);
        let last = self.grid.cube(p + radius);
        for x in first[0]..=last[0] {
            for y in first[1]..=last[1] {
                for z in first[2]..=last[2] {
                    let cube = [x, y, z];
                    let (shard, hash) = Grid::place(cube);
                    let shard = &self.shards[shard];
                    shard.for_each_near::<R, N>(hash, ([p, n], radius), |position, data| {
                        // Cubes may share a bucket.
                        if self.grid.cube(position) == cube {
                            visit(data);
                        }
                    });
                }
            }
        }
    }
}

impl<T: Copy + Default> Shard<T> {
    /// Sorts points by bucket; those of a bucket keep their order.
    fn new<'a>(placed: impl Iterator<Item = &'a PlacedPoint<T>> + Clone) -> Shard<T>
    where
        T: 'a,
    {
        let count = placed.clone().count();
        let buckets = count.next_power_of_two();
        let mut starts = vec![0; buckets + 1];
        for point in placed.clone() {
            starts[Shard::<T>::bucket(point.hash, buckets) + 1] += 1;
        }
        for bucket in 0..buckets {
            starts[bucket + 1] += starts[bucket];
        }
        let mut next = starts.clone();
        let mut positions = [(); 3].map(|()| vec![0.0; count + MAX_LANES]);
        let mut data = vec![T::default(); count];
        for point in placed {
            let index = &mut next[Shard::<T>::bucket(point.hash, buckets)];
            for (to, x) in positions.iter_mut().zip(point.position.to_array()) {
                to[*index as usize] = x;
            }
            data[*index as usize] = point.data;
            *index += 1;
        }
        Shard {
            starts,
            positions,
            data,
        }
    }

    /// Returns the bucket of a hash.
    fn bucket(hash: u32, buckets: usize) -> usize {
        hash as usize & (buckets - 1)
    }

    /// Visits the points in the bucket of a hash within a radius of a point of a surface.
    #[inline(always)]
    fn for_each_near<'a, R: Lanes<N>, const N: usize>(
        &'a self,
        hash: u32,
        ([p, n], radius): ([Vec3; 2], f32),
        mut visit: impl FnMut(Vec3, &'a T),
    ) {
        let bucket = Shard::<T>::bucket(hash, self.starts.len() - 1);
        let (first, end) = (
            self.starts[bucket] as usize,
            self.starts[bucket + 1] as usize,
        );
        let at = R::Vec3::broadcast(p);
        let n = R::Vec3::broadcast(n);
        let limit = R::splat(radius * radius);
        let height = R::splat(MAX_HEIGHT * radius);
        let [x, y, z] = &self.positions;
        for first in (first..end).step_by(N) {
            let rows = (
                x[first..].first_chunk::<N>(),
                y[first..].first_chunk::<N>(),
                z[first..].first_chunk::<N>(),
            );
            let (Some(xs), Some(ys), Some(zs)) = rows else {
                return;
            };
            let positions = R::Vec3::new(R::load(xs), R::load(ys), R::load(zs));
            let offset = positions - at;
            let near = offset.length_squared().lt(limit) & offset.dot(n).abs().lt(height);
            for i in active_lanes(near.bits()).take_while(|i| first + i < end) {
                visit(Vec3::new(xs[i], ys[i], zs[i]), &self.data[first + i]);
            }
        }
    }
}
