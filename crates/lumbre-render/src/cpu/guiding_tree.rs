//! The tree that guides the paths of a job, for people to look at: its regions of space where the
//! camera sees them, and its density of directions in one of them.

use std::sync::Arc;

use super::prepared::PreparedJob;
use super::prepared_scene::PreparedScene;
use crate::{Job, RenderError};
use lumbre_light::scene::CompiledScene;
use lumbre_light::transport::integrator::guided::direction_tree::direction_of;
use lumbre_light::transport::integrator::guided::directions::Guide;
use lumbre_light::transport::integrator::guided::sd_tree::SdTree;

/// Columns of a map of directions: azimuths about the z axis, from 0 to 360 degrees.
pub const COLUMNS: usize = 128;

/// Rows of a map of directions: cosines of the angle to the z axis, from 1 to -1. All cells of the
/// map have the same solid angle.
pub const ROWS: usize = 64;

/// Points along each side of a cell of the map at which the density is evaluated.
const POINTS: usize = 4;

/// A trained tree, and where the camera of its job sees its regions.
pub struct GuidingTree {
    tree: Arc<SdTree>,
    /// Number of rays that training traced.
    pub rays: u64,
    /// Width and height of the picture, in pixels.
    pub resolution: [u32; 2],
    /// Number of the region at the first surface in the middle of each pixel, row by row; `None`
    /// where there is none.
    pub regions: Vec<Option<u32>>,
}

/// Size of a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TreeSize {
    /// Number of regions of space.
    pub regions: usize,
    /// Number of those that training paths brought light to.
    pub guiding: usize,
    /// Number of squares of directions in all regions, each with four cells.
    pub squares: usize,
}

impl GuidingTree {
    /// Trains the tree of a job to the end. Returns `None` if the technique has no
    /// such tree.
    ///
    /// # Errors
    /// Returns an error if threads cannot be started or the scene's hierarchy cannot be used.
    pub fn train(
        scene: &Arc<CompiledScene>,
        job: &Job,
    ) -> Result<Option<GuidingTree>, RenderError> {
        let prepared = PreparedScene::new(Arc::clone(scene), &job.settings.accel, job.threads)?;
        let begin = || PreparedJob::new(&prepared, job.clone()).begin(u64::MAX, &|| false);
        let begun = prepared.threads.pool.install(begin);
        let Some((shared, rays)) = begun else {
            return Ok(None);
        };
        let Some(Guide { tree, .. }) = shared.downcast_ref::<Guide>() else {
            return Ok(None);
        };
        let [width, height] = job.resolution;
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| [x, y]));
        let regions = pixels
            .map(|pixel| {
                let (ray, hit) = prepared.center_hit(job.camera(scene), job.resolution, pixel);
                hit.map(|hit| tree.leaf_at(ray.origin + ray.dir * hit.t))
            })
            .collect();
        Ok(Some(GuidingTree {
            tree: Arc::clone(tree),
            rays,
            resolution: job.resolution,
            regions,
        }))
    }

    /// Returns the size of the tree.
    pub fn size(&self) -> TreeSize {
        let regions = self.tree.leaves();
        TreeSize {
            regions,
            guiding: (0..regions)
                .filter(|region| self.guides(*region as u32))
                .count(),
            squares: self.tree.nodes(),
        }
    }

    /// Returns whether paths are guided in a region.
    pub fn guides(&self, region: u32) -> bool {
        self.tree.directions(region).is_some()
    }

    /// Returns the region in the middle of a pixel of the picture; `None` if the camera sees no
    /// surface there.
    pub fn region_at(&self, [x, y]: [u32; 2]) -> Option<u32> {
        self.regions[(y * self.resolution[0] + x) as usize]
    }

    /// Returns the density of directions in a region per steradian, the mean of each cell of a map
    /// of [`ROWS`] and [`COLUMNS`], `[row][column]`; `None` if paths are not guided there.
    pub fn density(&self, region: u32) -> Option<Vec<f64>> {
        let directions = self.tree.directions(region)?;
        let fraction = |cell: usize, point: usize, cells: usize| {
            (cell as f32 + (point as f32 + 0.5) / POINTS as f32) / cells as f32
        };
        let cell = |row: usize, column: usize| {
            let mut sum = 0.0;
            for point in 0..POINTS * POINTS {
                let down = fraction(row, point / POINTS, ROWS);
                let around = fraction(column, point % POINTS, COLUMNS);
                sum += f64::from(directions.pdf_w(direction_of([1.0 - down, around])));
            }
            sum / (POINTS * POINTS) as f64
        };
        let cells = (0..ROWS).flat_map(|row| (0..COLUMNS).map(move |column| (row, column)));
        Some(cells.map(|(row, column)| cell(row, column)).collect())
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};
    use lumbre_light::transport::integrator::guided::direction_tree::point_of;
    use lumbre_light::transport::integrator::guided::sd_tree::Limits;

    use super::*;

    /// Returns a tree of one region, trained by light from a direction. Its cells are a sixteenth of
    /// the square wide.
    fn trained(dir: Vec3) -> GuidingTree {
        let limits = Limits {
            vertices: f64::MAX,
            bytes: u64::MAX,
        };
        let one = SdTree::new([Vec3::ZERO, Vec3::ONE]);
        let mut tree = one.refined(&one.sums(), &limits);
        let mut sums = tree.sums();
        tree.add(0, &mut sums[0], point_of(dir), 1.0);
        tree.set_densities(&sums, |sum, _| sum);
        GuidingTree {
            tree: Arc::new(tree),
            rays: 0,
            resolution: [1; 2],
            regions: vec![Some(0)],
        }
    }

    #[test]
    fn rows_of_the_density_are_cosines_from_1_to_minus_1_and_columns_azimuths() {
        for (cos, azimuth) in [(0.8f64, 1.0f64), (-0.8, 4.0), (0.3, 5.5)] {
            let direction = |cos: f64, azimuth: f64| {
                let sin = (1.0 - cos * cos).sqrt();
                DVec3::new(sin * azimuth.cos(), sin * azimuth.sin(), cos)
            };
            let dir = direction(cos, azimuth);
            let density = trained(dir.as_vec3()).density(0).unwrap();
            let of_cell = |at: usize| {
                let row = ((at / COLUMNS) as f64 + 0.5) / ROWS as f64;
                let column = ((at % COLUMNS) as f64 + 0.5) / COLUMNS as f64;
                direction(1.0 - 2.0 * row, std::f64::consts::TAU * column)
            };
            let cells = density.iter().enumerate();
            let sum: DVec3 = cells.map(|(at, density)| of_cell(at) * *density).sum();
            let mean = sum.normalize_or(DVec3::ZERO);
            assert!(mean.dot(dir) > 0.98, "{mean} is the mean, expected {dir}");
        }
    }
}
