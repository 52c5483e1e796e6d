//! Vertex connection and merging [Georgiev et al. 2012], with the radius schedule of
//! [Knaus & Zwicker 2011]: bidirectional path tracing and photon mapping as strategies of one
//! estimator.
//!
//! Before the samples of iteration `i`, light subpaths are traced and all their vertices are stored
//! ([`shared`]), as many subpaths as pixels by default. A camera subpath then finds light by the
//! strategies of [`bdpt`](super::bdpt), with the light subpath that has the number of its pixel, and
//! every one of its vertices merges with the vertices of all light subpaths within the radius `r_i`
//! of [`sppm`](super::sppm): the two are taken for one vertex `x_s` of a path.
//!
//! Merging at `x_s` finds a path with the density of connecting `x_(s-1)` with `x_s`, times the
//! density per area with which light subpaths generate `x_s`, times `pi r^2`; and each of the `n`
//! light subpaths may [Georgiev et al. 2012, section 4]. The weights of all strategies sum to one
//! and take constant time ([`weights`](super::bdpt::weights)). Connections find most light; merging
//! finds what no connection can, such as caustics seen in mirrors.
//!
//! - A mask with values between 0 and 1 accepts light and camera subpaths each with its probability;
//!   where two merge, the light subpath is divided by it.
//! - Merging blurs light over the disk, so pictures are biased, less the smaller the radius. The
//!   film averages iterations with ever smaller radii and converges for `0 < alpha < 1`.
//! - With `join = "connect"` no subpath is shared, and samples are those of `bdpt`, unbiased.
//! - With `join = "merge"` only merging at any vertex and light that camera paths hit are combined.
//!   It needs no shadow rays. Light of point and directional lights is lost at points that are
//!   lifted against the shadow terminator, which no light subpath reaches.
//! - If there are fewer light subpaths than pixels, several pixels use the same one; if there are
//!   more, each pixel connects several to the lens, and one to its camera subpath.

pub mod shared;

use std::cell::RefCell;

use self::shared::SharedVertices;
use super::bdpt::directions::BsdfDirections;
use super::bdpt::joins::{Joins, SubpathTechnique};
use super::bdpt::merge::{Merged, Merging};
use super::bdpt::single::{self, ConnectedPath, Reporter, SharedVertex, Subpaths};
use super::bdpt::state::SubpathVertex;
use super::bdpt::state::Vertex;
use super::iteration::Sharing;
use super::settings::Join;
use super::{Context, IntegratorRow, settings};
use crate::transport::contribution::Contribution;
use crate::transport::light::SELECT_FIELD;
use crate::transport::mis;
use crate::transport::sampler::Sampler;
use crate::value::schema::Table;

/// The table entry of this integrator.
pub const ROW: IntegratorRow = IntegratorRow {
    name: "vcm",
    long_name: "vertex connection and merging, consistent but biased",
    revision: 4,
    doc: "Paths from the camera and from the lights are connected in every way, and merged where \
          their vertices are near each other, within a radius that shrinks from sample to sample \
          [Georgiev et al. 2012; Knaus & Zwicker 2011].",
    params: Table {
        name: "VcmParams",
        doc: "Parameters of `vcm`.",
        fields: &[
            settings::JOIN,
            mis::FIELD,
            settings::PHOTONS,
            settings::RADIUS,
            settings::ALPHA,
            SELECT_FIELD,
        ],
    },
    splats: true,
    bias: Some(
        "it blurs light over the radius within which vertices are merged, and pixels that merge \
         with the same vertices have common noise",
    ),
    sharing: Some(Sharing {
        prepare: shared::prepare,
        begin: shared::begin,
        vertex_bytes: shared::VERTEX_BYTES,
        batch: None,
        fixed_bytes: |_| 0,
        constant_from: None,
        recorded: None,
    }),
    sample,
};

/// Subpaths reused from sample to sample, so that nothing is allocated per path.
#[derive(Default)]
pub struct Buffers {
    /// The camera subpath, and the light subpath with the number of the pixel.
    own: Subpaths,
    /// A further light subpath that is connected to the lens.
    further: Subpaths,
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
    if context.settings.join == Join::Connect {
        single::sample(context, BsdfDirections, pixel, sampler, sink);
        return;
    }
    BUFFERS.with_borrow_mut(|buffers| {
        for_each_path(context, pixel, sampler, buffers, &mut |path| {
            sink(path.contribution)
        });
    });
}

/// Traces the camera subpath of one sample and visits every path found by connecting and merging it
/// with light subpaths.
pub fn for_each_path(
    context: &Context,
    pixel: [u32; 2],
    sampler: &mut Sampler,
    buffers: &mut Buffers,
    visit: &mut dyn FnMut(ConnectedPath),
) {
    let shared: &SharedVertices = context.shared();
    let Buffers { own, further } = buffers;
    own.trace_camera(context, (BsdfDirections, &shared.counts), pixel, sampler);
    let [width, height] = context.camera.resolution().map(u64::from);
    let (index, pixels) = (
        u64::from(pixel[1]) * width + u64::from(pixel[0]),
        width * height,
    );
    let connects = context.settings.join != Join::Merge;
    if connects {
        load(context, shared, index % shared.paths.count(), own);
    }
    let own = &*own;
    let mut reporter = Reporter {
        context,
        directions: BsdfDirections,
        counts: shared.counts,
        subpaths: own,
        pixel,
        visit,
    };
    reporter.report_escape();
    for edge in 0..own.hits.len() {
        reporter.report_hit(edge);
        if let Some(z) = own.camera.get(edge) {
            let t = edge as u32 + 2;
            if connects {
                let z = with_merging(context, shared, &z.vertex);
                reporter.connect_camera_vertex(&z, t, sampler);
            }
            merge(&mut reporter, &shared.merging(), &z.vertex, t);
        }
    }
    if !connects {
        return;
    }
    if index < shared.paths.count() {
        reporter.connect_lens(sampler);
    }
    further.emitted = own.emitted;
    for path in (index..shared.paths.count())
        .step_by(pixels as usize)
        .skip(1)
    {
        load(context, shared, path, further);
        let mut reporter = Reporter {
            context,
            directions: BsdfDirections,
            counts: shared.counts,
            subpaths: further,
            pixel,
            visit: reporter.visit,
        };
        reporter.connect_lens(sampler);
    }
}

/// Loads a light subpath whose vertices are to be connected.
fn load(context: &Context, shared: &SharedVertices, path: u64, into: &mut Subpaths) {
    shared.paths.load_into(context, path, into);
    for SubpathVertex { vertex, .. } in &mut into.light {
        *vertex = with_merging(context, shared, vertex);
    }
}

/// Returns a vertex with partial sums for its connections.
fn with_merging(context: &Context, shared: &SharedVertices, vertex: &Vertex) -> Vertex {
    let h = context.settings.heuristic();
    Vertex {
        partials: vertex.partials.with_merging(h, &shared.counts),
        ..*vertex
    }
}

/// Merges the camera vertex number `t` with all light vertices near it.
fn merge(reporter: &mut Reporter<BsdfDirections>, merging: &Merging, z: &Vertex, t: u32) {
    if !z.bsdf.has_density() {
        return;
    }
    let samples = f64::from(merging.map.scale()).recip();
    let context = reporter.context;
    merging.for_each_near::<f32, 1>(context, &z.state, t, |id, s| {
        let (y, partials) = merging.light_vertices::<f32, 1>([id]);
        let Some(merged) = Merged::<f32>::new::<1>(context, merging, (&y, partials), z, true)
        else {
            return;
        };
        (reporter.visit)(ConnectedPath {
            contribution: Contribution {
                pixel: reporter.pixel,
                value: merged.unweighted * merged.weight as f32,
                unweighted: merged.unweighted,
                s,
                t,
                length: merged.length,
            },
            weight: merged.weight,
            subpaths: reporter.subpaths,
            point: None,
            wi: merged.wi,
            lens: reporter.subpaths.lens,
            shared: Some(SharedVertex::Merged(id)),
            samples,
        });
    });
}

/// Vertex connection and merging.
pub struct Vcm;

impl SubpathTechnique for Vcm {
    type Directions = BsdfDirections;

    fn joins<'a>(context: &Context<'a>) -> Joins<'a, BsdfDirections> {
        if context.settings.join == Join::Connect {
            return Joins::each(BsdfDirections);
        }
        let shared: &SharedVertices = context.shared();
        Joins {
            directions: BsdfDirections,
            counts: shared.counts,
            shared: Some(&shared.paths),
            merging: Some(shared.merging()),
            drawing: None,
        }
    }
}
