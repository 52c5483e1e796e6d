//! Bidirectional path tracing with a light vertex cache [Davidovič et al. 2014] and resampled
//! connections [Nabata et al. 2020].
//!
//! Before the samples of an iteration, light subpaths are traced, and all their vertices that can be
//! connected are in one cache ([`cache`]). For each of `c` connections of a camera vertex, `M`
//! candidates are drawn uniformly from all `C` of them, and one is chosen with the probability
//! `q_j / sum q`, where `q` is the luminance of the weighted contribution without its occlusion. The
//! chosen one stands for `C sum q / (n c M q_j)` of the vertices of one of `n` light subpaths, so the
//! estimate has the same mean as that of [`bdpt`](super::bdpt) [Talbot et al. 2005]. Only the chosen
//! one needs an occlusion ray. The other strategies are those of `bdpt`.
//!
//! Weights use the expected number of candidates of each vertex of a light subpath, `c M / v`, where
//! `v` is the mean number of vertices of a subpath. It is estimated once for each job from other
//! subpaths, so that weights are functions of the path alone, and pictures are unbiased. Weights
//! that used `C` would depend on the paths that they weight. Where nothing is occluded, the variance
//! of resampling is that of the mean of `M` candidates, which is why they all count; Nabata et al.
//! derive weights from an estimate of the variance with occlusion instead.
//!
//! All pixels draw from one cache, so their noise is common in part.

pub mod cache;

use std::cell::RefCell;

use super::bdpt::connect::Connection;
use super::bdpt::directions::BsdfDirections;
use super::bdpt::draw::{LightVertexCache, choose, target};
use super::bdpt::joins::{Joins, SubpathTechnique};
use super::bdpt::single::{ConnectedPath, Drawn, Reporter, Subpaths};
use super::bdpt::state::Vertex;
use super::bdpt::store::CachedVertex;
use super::bdpt::store::VertexId;
use super::iteration::Sharing;
use super::{Context, IntegratorRow, settings};
use crate::math::luminance::luminance_of;
use crate::transport::contribution::Contribution;
use crate::transport::light::SELECT_FIELD;
use crate::transport::mis;
use crate::transport::sampler::Sampler;
use crate::value::schema::Table;

/// The table entry of this integrator.
pub const ROW: IntegratorRow = IntegratorRow {
    name: "lvc",
    long_name: "bidirectional path tracing with a light vertex cache",
    revision: 2,
    doc: "Vertices of camera paths are connected with vertices from a cache of all light subpaths \
          of a sample [Davidovič et al. 2014], which are chosen by resampling [Nabata et al. 2020].",
    params: Table {
        name: "LvcParams",
        doc: "Parameters of `lvc`.",
        fields: &[
            settings::CONNECTIONS,
            settings::CANDIDATES,
            mis::FIELD,
            settings::PHOTONS,
            SELECT_FIELD,
        ],
    },
    splats: true,
    bias: None,
    sharing: Some(Sharing {
        prepare: cache::prepare,
        begin: cache::begin,
        vertex_bytes: cache::VERTEX_BYTES,
        batch: None,
        fixed_bytes: |_| 0,
        constant_from: None,
        recorded: None,
    }),
    sample,
};

/// The buffers of a sample, reused for the next one so that nothing is allocated per path.
#[derive(Default)]
pub struct Buffers {
    /// Camera subpath and light subpath.
    subpaths: Subpaths,
    /// Candidates of one connection.
    candidates: Vec<Candidate>,
}

/// A vertex that a camera vertex may be connected with.
struct Candidate {
    id: VertexId,
    strategy: [u32; 2],
    connection: Connection,
    /// Target density up to a factor: see [`target`].
    target: f64,
}

thread_local! {
    static BUFFERS: RefCell<Buffers> = RefCell::default();
}

/// Computes one sample of one pixel: see [`SampleFn`](crate::transport::integrator::SampleFn).
fn sample(
    context: &Context,
    pixel: [u32; 2],
    sampler: &mut Sampler,
    sink: &mut dyn FnMut(Contribution),
) {
    BUFFERS.with_borrow_mut(|buffers| {
        for_each_path(context, pixel, sampler, buffers, &mut |path| {
            sink(path.contribution)
        });
    });
}

/// Traces the camera subpath of one sample and visits every path found by connecting it with
/// vertices of the cache, and those by connecting light subpaths to the lens.
pub fn for_each_path(
    context: &Context,
    pixel: [u32; 2],
    sampler: &mut Sampler,
    buffers: &mut Buffers,
    visit: &mut dyn FnMut(ConnectedPath),
) {
    let Buffers {
        subpaths,
        candidates,
    } = buffers;
    let cache: &LightVertexCache = context.shared();
    subpaths.trace_camera(context, (BsdfDirections, &cache.counts), pixel, sampler);
    let mut reporter = Reporter {
        context,
        directions: BsdfDirections,
        counts: cache.counts,
        subpaths,
        pixel,
        visit,
    };
    reporter.report_escape();
    for edge in 0..reporter.subpaths.hits.len() {
        reporter.report_hit(edge);
        if let Some(z) = reporter.subpaths.camera.get(edge)
            && z.vertex.bsdf.has_density()
        {
            let t = edge as u32 + 2;
            reporter.connect_light(&z.vertex, t, sampler);
            for _ in 0..context.settings.connections {
                let u = sampler.next_three();
                connect_cache(&mut reporter, cache, (&z.vertex, t), u, candidates);
            }
        }
    }
    let [width, height] = context.camera.resolution().map(u64::from);
    let index = u64::from(pixel[1]) * width + u64::from(pixel[0]);
    let paths = (index..cache.paths.count()).step_by((width * height) as usize);
    let visit = reporter.visit;
    for path in paths {
        cache.paths.load_into(context, path, subpaths);
        Reporter {
            context,
            directions: BsdfDirections,
            counts: cache.counts,
            subpaths,
            pixel,
            visit,
        }
        .connect_lens(sampler);
    }
}

/// Connects the camera vertex number `t` with one of several drawn vertices.
fn connect_cache(
    reporter: &mut Reporter<BsdfDirections>,
    cache: &LightVertexCache,
    (z, t): (&Vertex, u32),
    [choice, u, v]: [f32; 3],
    candidates: &mut Vec<Candidate>,
) {
    candidates.clear();
    let context = reporter.context;
    let count = context.settings.candidates;
    for CachedVertex { id, edges } in cache.draw([u, v], count) {
        let y = cache.paths.vertex(context, id);
        let strategy = [edges + 1, t];
        let Some(connection) = reporter.connection(&y.vertex, z, strategy) else {
            continue;
        };
        let weight = reporter.weight(&connection, strategy);
        candidates.push(Candidate {
            id,
            strategy,
            connection,
            target: target(luminance_of(connection.unweighted), weight),
        });
    }
    let targets = candidates.iter().map(|candidate| candidate.target);
    if let Some((chosen, probability)) = choose(targets, choice) {
        let chosen = &candidates[chosen];
        let drawn = Drawn {
            id: chosen.id,
            samples: cache.samples_of(count, probability),
        };
        reporter.report_drawn(&chosen.connection, chosen.strategy, drawn);
    }
}

/// Bidirectional path tracing with a light vertex cache.
pub struct Lvc;

impl SubpathTechnique for Lvc {
    type Directions = BsdfDirections;

    fn joins<'a>(context: &Context<'a>) -> Joins<'a, BsdfDirections> {
        let cache: &LightVertexCache = context.shared();
        Joins {
            directions: BsdfDirections,
            counts: cache.counts,
            shared: Some(&cache.paths),
            merging: None,
            drawing: Some(cache),
        }
    }
}
