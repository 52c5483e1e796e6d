//! Training of the SD-tree.
//!
//! Iteration `k` traces `2^k` paths of every pixel, as samples are, guided by the tree of the
//! iteration before. Their vertices train a tree that was refined for the vertices of that
//! iteration, whose own samples are then forgotten [Müller et al. 2017]. The last iteration takes
//! all paths that are left.
//!
//! The tree depends on the scene, the job and its seed alone: paths have random numbers of their
//! own, and the vertices of a leaf are added in the order of the paths by one thread.

use std::ops::Range;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use glam::Vec3;

use super::Guided;
use super::direction_tree::point_of;
use super::sd_tree::{LeafSums, Limits, SdTree};
use super::settings::{Guiding, Target};
use crate::transport::integrator::Context;
use crate::transport::integrator::camera_path::{
    self, Path, PathLight, PathSink, ShadowRay, unoccluded,
};
use crate::transport::integrator::iteration::{Iteration, Resources, Shared};

/// Number of paths of a unit of work.
const UNIT: u64 = 512;

/// Greatest number of paths whose vertices are in memory at a time.
pub const BATCH: u64 = 128 * UNIT;

/// Number of leaves of a unit of work.
const LEAVES: usize = 64;

/// Upper bound of the bytes of a recorded vertex: in a list that grows, and while it is sorted.
pub const VERTEX_BYTES: usize = 3 * size_of::<Record>();

/// A vertex of a training path whose next edge the tree could have sampled.
#[derive(Clone, Copy)]
struct Record {
    /// Leaf of the tree that is trained.
    leaf: u32,
    /// Direction of the next edge on the unit square.
    point: [f32; 2],
    /// Value of the direction: see [`Target::value`].
    value: f32,
}

/// Data that all iterations of a job need.
struct Setup {
    task: Task,
    /// The tree, once it is trained.
    tree: OnceLock<Arc<SdTree>>,
}

/// Properties of the job that training depends on.
#[derive(Clone, Copy)]
struct Task {
    guiding: Guiding,
    bounds: [Vec3; 2],
    resolution: [u32; 2],
}

/// Prepares a job: nothing is trained yet, so that training counts as render time.
pub fn prepare(resources: &Resources) -> Box<Shared> {
    let tasks = resources.map(1, |context, _| Task {
        guiding: context.settings.guiding,
        bounds: context.scene.bounds_and_radius().0,
        resolution: context.camera.resolution(),
    });
    Box::new(Setup {
        task: tasks[0],
        tree: OnceLock::new(),
    })
}

/// Returns the tree, which the first iteration that is rendered trains.
pub fn begin(iteration: &Iteration) -> Box<Shared> {
    let setup: &Setup = iteration.prepared();
    let tree = setup
        .tree
        .get_or_init(|| train(&iteration.resources, &setup.task));
    Box::new(Arc::clone(tree))
}

/// Returns the numbers of paths of a pixel in each training iteration.
pub fn schedule(training: u64) -> Vec<u64> {
    let (mut left, mut iterations) = (training, Vec::new());
    while left > 0 {
        let passes = 1 << iterations.len();
        let passes = if left < 3 * passes { left } else { passes };
        iterations.push(passes);
        left -= passes;
    }
    iterations
}

/// Trains the tree of a job.
fn train(resources: &Resources, task: &Task) -> Arc<SdTree> {
    let mut tree = Arc::new(SdTree::new(task.bounds));
    let mut sums = tree.sums();
    let mut first = 0;
    for (k, passes) in schedule(task.guiding.training).into_iter().enumerate() {
        let limits = Limits {
            vertices: task.guiding.split * 2.0_f64.powf(0.5 * (k as f64 - 1.0)),
            bytes: task.guiding.tree_bytes(),
        };
        let mut next = tree.refined(&sums, &limits);
        sums = record(resources, task, &tree, &next, first..first + passes);
        next.set_densities(&sums, task.guiding.target.mass_of());
        tree = Arc::new(next);
        first += passes;
    }
    tree
}

/// Traces the given paths of every pixel, guided by `tree`, and returns their sums in `next`.
fn record(
    resources: &Resources,
    task: &Task,
    tree: &Arc<SdTree>,
    next: &SdTree,
    passes: Range<u64>,
) -> Vec<LeafSums> {
    let sums: Vec<Mutex<LeafSums>> = next.sums().into_iter().map(Mutex::new).collect();
    let [width, height] = task.resolution.map(u64::from);
    let pixels = width * height;
    let paths = passes.start * pixels..passes.end * pixels;
    for start in paths.clone().step_by(BATCH as usize) {
        let batch = start..(start + BATCH).min(paths.end);
        let units = (batch.end - batch.start).div_ceil(UNIT) as usize;
        let records = resources.map(units, |context, unit| {
            let first = batch.start + unit as u64 * UNIT;
            let shared: &Shared = tree;
            let context = Context {
                shared: Some(shared),
                ..*context
            };
            let mut walk = Walk::new(&context, next, task.guiding.target);
            for path in first..(first + UNIT).min(batch.end) {
                let (pass, pixel) = (path / pixels, path % pixels);
                let pixel = [pixel % width, pixel / width].map(|n| n as u32);
                walk.trace(resources, pixel, pass);
            }
            walk.records.sort_by_key(|record| record.leaf);
            walk.records
        });
        resources.map(next.leaves().div_ceil(LEAVES), |_, unit| {
            let first = unit * LEAVES;
            for leaf in first..(first + LEAVES).min(next.leaves()) {
                let mut sums = sums[leaf].lock().unwrap_or_else(PoisonError::into_inner);
                let leaf = leaf as u32;
                for records in &records {
                    let begin = records.partition_point(|record| record.leaf < leaf);
                    let own = records[begin..].iter();
                    for record in own.take_while(|record| record.leaf == leaf) {
                        next.add(leaf, &mut sums, record.point, record.value);
                    }
                }
            }
        });
    }
    let unlocked = sums.into_iter().map(Mutex::into_inner);
    unlocked
        .map(|sums| sums.unwrap_or_else(PoisonError::into_inner))
        .collect()
}

/// A vertex whose next edge was sampled with a density.
struct WalkVertex {
    /// Number of the edge that led to it.
    edge: u32,
    position: Vec3,
    /// Unit direction of the next edge.
    dir: Vec3,
    /// Density per solid angle with which that direction was sampled.
    pdf_w: f32,
}

/// Follows training paths and records their vertices.
struct Walk<'a> {
    context: &'a Context<'a>,
    /// The tree that is trained.
    next: &'a SdTree,
    target: Target,
    /// Light of the current path that was found by edge number `i`, or by a shadow ray from its
    /// end.
    light: Vec<Vec3>,
    /// Vertices of the current path.
    vertices: Vec<WalkVertex>,
    /// Vertices of all paths so far.
    records: Vec<Record>,
}

impl<'a> Walk<'a> {
    fn new(context: &'a Context, next: &'a SdTree, target: Target) -> Walk<'a> {
        Walk {
            context,
            next,
            target,
            light: Vec::new(),
            vertices: Vec::new(),
            records: Vec::new(),
        }
    }

    /// Follows a path of a pixel and records its vertices.
    fn trace(&mut self, resources: &Resources, pixel: [u32; 2], pass: u64) {
        self.light.clear();
        self.vertices.clear();
        let sampler = resources.training_sampler(pixel, pass);
        camera_path::follow::<Guided, _>(self.context, pixel, sampler, self, Walk::leave);
        let mut numbers = sampler.auxiliary();
        // Light that was found by an edge or later.
        for edge in (1..self.light.len()).rev() {
            let later = self.light[edge];
            self.light[edge - 1] += later;
        }
        for vertex in &self.vertices {
            // The vertex's own shadow ray belongs to the edge that led to it.
            let after = self.light.get(vertex.edge as usize + 1);
            let value = self
                .target
                .value(after.copied().unwrap_or_default(), vertex.pdf_w);
            let near = [numbers.next_1d(), numbers.next_1d(), numbers.next_1d()];
            self.records.push(Record {
                leaf: self.next.leaf_near(vertex.position, near),
                point: point_of(vertex.dir),
                value: if value.is_finite() { value } else { 0.0 },
            });
        }
    }

    /// Keeps the vertex that a path leaves, unless a Dirac lobe sampled its next edge.
    fn leave(&mut self, edge: u32, path: &Path<f32>) {
        if !path.is_specular() {
            self.vertices.push(WalkVertex {
                edge,
                position: path.state.last,
                dir: path.state.dir,
                pdf_w: path.state.last_pdf_w,
            });
        }
    }
}

impl PathSink<f32> for Walk<'_> {
    #[inline(always)]
    fn add(&mut self, lanes: bool, light: &PathLight<f32>) {
        if lanes {
            let edge = light.t as usize - 1;
            if self.light.len() <= edge {
                self.light.resize(edge + 1, Vec3::ZERO);
            }
            self.light[edge] += light.value();
        }
    }

    #[inline(always)]
    fn add_unless_occluded(&mut self, lanes: bool, ray: &ShadowRay<f32>, light: &PathLight<f32>) {
        if lanes && unoccluded(self.context, ray) {
            self.add(true, light);
        }
    }
}
