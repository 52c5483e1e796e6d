//! Training of the SD-tree.
//!
//! Training iteration `k` traces `2^k` paths of every pixel, guided by the tree of the iteration
//! before. Their vertices train a tree that was refined for the vertices of that iteration, whose
//! own samples are then forgotten [Müller et al. 2017]. The last iteration takes all paths that are
//! left.
//!
//! One path of every pixel is a pass. The passes are the first samples of a picture of
//! [`guided`](super): they are unbiased, since the tree that guides a pass is a function of earlier
//! training iterations, whose random numbers are independent of its own. Paths of
//! [`guided_bdpt`](super::bidirectional) are others, so its passes only train the tree.
//!
//! The tree depends on the scene, the job and its seed alone: the vertices of a leaf are added in
//! the order of the paths by one thread.

use std::sync::{Arc, Mutex, PoisonError};

use glam::Vec3;

use super::direction_tree::point_of;
use super::directions::{Guide, Guided, NAME};
use super::sd_tree::{LeafSums, Limits, SdTree};
use super::settings::{Guiding, PATHS_BEFORE, SAMPLES_THAT_TRAIN, Target};
use crate::transport::contribution::Contribution;
use crate::transport::integrator::Context;
use crate::transport::integrator::camera_path::SPECULAR;
use crate::transport::integrator::iteration::recorded::{
    BATCH_PATHS, CameraBatch, LeftVertex, RecordedPaths, RecordedSamples, batch_columns,
};
use crate::transport::integrator::iteration::{Iteration, Resources, Shared};
use crate::transport::integrator::settings::Settings;

/// Number of batches whose vertices are in memory at a time.
const BATCHES: u32 = 256;

/// Greatest number of paths whose vertices are in memory at a time.
pub const BATCH: u64 = BATCHES as u64 * BATCH_PATHS as u64;

/// Number of leaves of a unit of work.
const LEAVES: usize = 64;

/// Upper bound of the bytes of a vertex: as a path left it with its light, and recorded, each in
/// lists that grow and while it is sorted.
pub const VERTEX_BYTES: usize =
    2 * size_of::<LeftVertex>() + 4 * size_of::<Contribution>() + 3 * size_of::<Record>();

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
    progress: Mutex<Progress>,
}

/// Properties of the job that training depends on.
#[derive(Clone, Copy)]
struct Task {
    /// Number of passes of the training.
    passes: u64,
    guiding: Guiding,
    bounds: [Vec3; 2],
    resolution: [u32; 2],
}

/// State of the training after a number of passes.
struct Progress {
    /// Number of passes so far.
    passes: u64,
    /// Numbers of passes of the training iterations.
    schedule: Vec<u64>,
    /// Index of the current training iteration.
    iteration: usize,
    /// Number of passes of the current training iteration that are left.
    left: u64,
    /// The tree that guides the paths.
    tree: Arc<SdTree>,
    /// The tree that they train, and its sums so far.
    next: SdTree,
    sums: Vec<Mutex<LeafSums>>,
}

/// Returns the number of samples of a picture of `guided` from which the tree learns.
pub fn samples_that_train(settings: &Settings) -> u64 {
    settings.guiding.training.unwrap_or(SAMPLES_THAT_TRAIN)
}

/// Prepares a picture of `guided`.
pub fn prepare(resources: &Resources) -> Box<Shared> {
    prepare_passes(resources, samples_that_train)
}

/// Prepares a picture of `guided_bdpt`.
pub fn prepare_apart(resources: &Resources) -> Box<Shared> {
    prepare_passes(resources, |settings| {
        settings.guiding.training.unwrap_or(PATHS_BEFORE)
    })
}

/// Prepares a job: nothing is trained yet, so that training counts as render time.
fn prepare_passes(resources: &Resources, passes: fn(&Settings) -> u64) -> Box<Shared> {
    let tasks = resources.map(1, |context, _| Task {
        passes: passes(context.settings),
        guiding: context.settings.guiding,
        bounds: context.scene.bounds_and_radius().0,
        resolution: context.camera.resolution(),
    });
    Box::new(Setup {
        task: tasks[0],
        progress: Mutex::new(Progress::new(&tasks[0])),
    })
}

/// Returns the tree of an iteration, with its samples if it is a pass of the training. Traces all
/// passes up to it that were not traced yet.
pub fn begin(iteration: &Iteration) -> Box<Shared> {
    Box::new(guide(iteration, iteration.index))
}

/// Returns the tree after all training.
pub fn begin_trained(iteration: &Iteration) -> Box<Shared> {
    Box::new(guide(iteration, u64::MAX))
}

/// Returns the tree of the samples with an index.
fn guide(iteration: &Iteration, index: u64) -> Guide {
    let Setup { task, progress } = iteration.prepared();
    let mut progress = progress.lock().unwrap_or_else(PoisonError::into_inner);
    if index < progress.passes.min(task.passes) {
        *progress = Progress::new(task);
    }
    let last = index.min(task.passes - 1);
    while progress.passes < last {
        progress.advance(&iteration.resources, task, false);
    }
    if progress.passes == last {
        let tree = Arc::clone(&progress.tree);
        let recorded = progress.advance(&iteration.resources, task, index == last);
        if recorded.is_some() {
            return Guide { tree, recorded };
        }
    }
    Guide {
        tree: Arc::clone(&progress.tree),
        recorded: None,
    }
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

impl Progress {
    /// Returns the state before the first pass.
    fn new(task: &Task) -> Progress {
        let tree = SdTree::new(task.bounds);
        let mut progress = Progress {
            passes: 0,
            schedule: schedule(task.passes),
            iteration: 0,
            left: 0,
            sums: Vec::new(),
            next: tree.clone(),
            tree: Arc::new(tree),
        };
        let none = progress.tree.sums();
        progress.begin_iteration(task, &none);
        progress
    }

    /// Begins a training iteration, if any is left: refines the tree for the vertices of the one
    /// before, whose sums are given.
    fn begin_iteration(&mut self, task: &Task, sums: &[LeafSums]) {
        let k = self.iteration;
        let Some(passes) = self.schedule.get(k) else {
            return;
        };
        self.left = *passes;
        let limits = Limits {
            vertices: task.guiding.split * 2.0_f64.powf(0.5 * (k as f64 - 1.0)),
            bytes: task.guiding.tree_bytes(),
        };
        self.next = self.tree.refined(sums, &limits);
        self.sums = self.next.sums().into_iter().map(Mutex::new).collect();
    }

    /// Traces a pass, and ends the training iteration if it was its last. Returns its light if
    /// `keep`.
    fn advance(
        &mut self,
        resources: &Resources,
        task: &Task,
        keep: bool,
    ) -> Option<RecordedSamples> {
        let recorded = self.record(resources, task, keep);
        self.passes += 1;
        self.left -= 1;
        if self.left == 0 {
            let sums = unlocked(std::mem::take(&mut self.sums));
            self.next
                .set_densities(&sums, task.guiding.target.mass_of());
            self.tree = Arc::new(self.next.clone());
            self.iteration += 1;
            self.begin_iteration(task, &sums);
        }
        recorded
    }

    /// Traces a path of every pixel and adds its vertices to the sums. Returns the light of the
    /// paths if `keep`.
    fn record(&self, resources: &Resources, task: &Task, keep: bool) -> Option<RecordedSamples> {
        let seed = resources.training_seed(self.iteration as u32);
        let [width, height] = task.resolution;
        let guide = Guide {
            tree: Arc::clone(&self.tree),
            recorded: None,
        };
        let batches = width.div_ceil(BATCH_PATHS) * height;
        let mut kept = Vec::new();
        for first in (0..batches).step_by(BATCHES as usize) {
            let count = BATCHES.min(batches - first);
            let traced = resources.map(count as usize, |context, i| {
                let (row, columns) = batch_columns(width, first + i as u32);
                let batch = CameraBatch {
                    technique: NAME,
                    sampler: resources.sampler,
                    seed,
                    sample: self.passes,
                    row,
                    columns,
                };
                let shared: &Shared = &guide;
                let context = Context {
                    shared: Some(shared),
                    ..*context
                };
                let paths = resources.workers.trace_camera(&context, &batch);
                let paths = paths.unwrap_or_else(|| batch.follow::<Guided>(&context));
                let records = records(&self.next, task.guiding.target, &batch, &paths);
                (records, keep.then(|| paths.into_light(resources.each)))
            });
            let (records, paths): (Vec<_>, Vec<_>) = traced.into_iter().unzip();
            self.add(resources, &records);
            kept.extend(paths.into_iter().flatten());
        }
        keep.then(|| RecordedSamples::new(seed, width, kept))
    }

    /// Adds records that are sorted by leaf, in order, to the sums.
    fn add(&self, resources: &Resources, records: &[Vec<Record>]) {
        let leaves = self.next.leaves();
        resources.map(leaves.div_ceil(LEAVES), |_, unit| {
            let first = unit * LEAVES;
            for leaf in first..(first + LEAVES).min(leaves) {
                let mut sums = self.sums[leaf]
                    .lock()
                    .unwrap_or_else(PoisonError::into_inner);
                let leaf = leaf as u32;
                for records in records {
                    let begin = records.partition_point(|record| record.leaf < leaf);
                    let own = records[begin..].iter();
                    for record in own.take_while(|record| record.leaf == leaf) {
                        self.next.add(leaf, &mut sums, record.point, record.value);
                    }
                }
            }
        });
    }
}

/// Returns sums that no thread holds any more.
fn unlocked(sums: Vec<Mutex<LeafSums>>) -> Vec<LeafSums> {
    let unlock = |sums: Mutex<LeafSums>| sums.into_inner().unwrap_or_else(PoisonError::into_inner);
    sums.into_iter().map(unlock).collect()
}

/// Returns records of the vertices of a batch for the training of a tree, sorted by leaf, unless a
/// Dirac lobe sampled their next edge.
fn records(
    next: &SdTree,
    target: Target,
    batch: &CameraBatch,
    paths: &RecordedPaths,
) -> Vec<Record> {
    let mut records = Vec::with_capacity(paths.vertices().len());
    let mut found = Vec::new();
    for vertices in paths.vertices().chunk_by(|a, b| a.path == b.path) {
        let path = vertices[0].path;
        found_after(paths.light(path), &mut found);
        let mut numbers = batch.start(path).auxiliary();
        for vertex in vertices.iter().filter(|vertex| vertex.pdf_w != SPECULAR) {
            // The vertex's own shadow ray belongs to the edge that led to it.
            let after = found.get(vertex.edge as usize + 1);
            let value = target.value(after.copied().unwrap_or_default(), vertex.pdf_w);
            let near = [numbers.next_1d(), numbers.next_1d(), numbers.next_1d()];
            records.push(Record {
                leaf: next.leaf_near(vertex.position, near),
                point: point_of(vertex.dir),
                value: if value.is_finite() { value } else { 0.0 },
            });
        }
    }
    records.sort_by_key(|record| record.leaf);
    records
}

/// Computes for each number of edges the light of a path that was found by an edge with that number
/// or a later one, or by a shadow ray from its end.
fn found_after(light: &[Contribution], found: &mut Vec<Vec3>) {
    found.clear();
    for contribution in light {
        let edge = contribution.t as usize - 1;
        if found.len() <= edge {
            found.resize(edge + 1, Vec3::ZERO);
        }
        found[edge] += contribution.value;
    }
    for edge in (1..found.len()).rev() {
        let later = found[edge];
        found[edge - 1] += later;
    }
}
