//! Guided bidirectional path tracing: [`bdpt`](crate::transport::integrator::bdpt) whose camera
//! subpaths continue in the directions of [`guided`](super).
//!
//! The tree is that of `guided`, but training paths are not part of the picture.
//!
//! The density with which a camera subpath continues is the mixture of BSDF and tree wherever a
//! weight depends on it: for the edges of camera subpaths, for connections at camera vertices, and
//! at vertices of light subpaths for the way back to the previous vertex, which a camera subpath
//! that came the other way would go on to. Light subpaths are not guided.

use super::directions::MixedDirections;
use super::{TRAINED, settings};
use crate::math::simd::Lanes;
use crate::transport::bsdf::{BsdfSample, TransportMode};
use crate::transport::integrator::bdpt::directions::SubpathDirections;
use crate::transport::integrator::bdpt::joins::{Joins, SubpathTechnique};
use crate::transport::integrator::bdpt::single;
use crate::transport::integrator::bdpt::state::Vertex;
use crate::transport::integrator::directions::Directions;
use crate::transport::integrator::{Context, IntegratorRow, settings as common};
use crate::transport::light::SELECT_FIELD;
use crate::transport::mis;
use crate::value::schema::Table;

/// The table entry of this integrator.
pub const ROW: IntegratorRow = IntegratorRow {
    name: "guided_bdpt",
    long_name: "guided bidirectional path tracing",
    revision: 2,
    doc: "Paths are those of bdpt, but camera paths continue in directions where training paths \
          found light, by the tree of guided [Müller et al. 2017; Rath et al. 2020].",
    params: Table {
        name: "GuidedBdptParams",
        doc: "Parameters of `guided_bdpt`.",
        fields: &[
            settings::TRAINING_BEFORE,
            settings::TARGET,
            settings::BSDF_FRACTION,
            settings::SPLIT,
            settings::TREE_MEMORY,
            mis::FIELD,
            SELECT_FIELD,
            common::STRATEGIES,
            common::CONTRIBUTION,
        ],
    },
    splats: true,
    bias: None,
    sharing: Some(TRAINED),
    sample: |context, pixel, sampler, sink| {
        single::sample(context, GuidedDirections, pixel, sampler, sink);
    },
};

/// Guided bidirectional path tracing.
pub struct GuidedBdpt;

impl SubpathTechnique for GuidedBdpt {
    type Directions = GuidedDirections;

    fn joins<'a>(_: &Context<'a>) -> Joins<'a, GuidedDirections> {
        Joins::each(GuidedDirections)
    }
}

/// Returns the mixture at vertices that were prepared.
#[inline(always)]
fn mixture<R: Lanes<N>, const N: usize>(
    context: &Context,
    vertex: &Vertex<R>,
) -> MixedDirections<R, N> {
    MixedDirections::in_leaves(context, R::store_words(vertex.state.region))
}

/// The mixture of the directions of the BSDF and of the tree.
#[derive(Clone, Copy, Debug)]
pub struct GuidedDirections;

impl SubpathDirections for GuidedDirections {
    #[inline(always)]
    fn prepare<R: Lanes<N>, const N: usize>(
        self,
        context: &Context,
        vertex: &mut Vertex<R>,
        mode: TransportMode,
        lanes: R::Mask,
    ) {
        let surface = (&vertex.bsdf, &vertex.out, vertex.state.n_shading);
        let smooth = lanes & vertex.bsdf.has_density();
        let mixture = MixedDirections::<R, N>::at(context, vertex.state.position, surface, smooth);
        vertex.state.region = R::load_words(&mixture.leaves);
        if mode == TransportMode::Importance {
            vertex.state.guided_back_w = mixture.tree_pdf_w(context, vertex.out.wo, smooth);
        }
    }

    #[inline(always)]
    fn sample<R: Lanes<N>, const N: usize>(
        self,
        context: &Context,
        vertex: &Vertex<R>,
        [choice, u, v]: [R; 3],
        mode: TransportMode,
        lanes: R::Mask,
    ) -> (R::Mask, BsdfSample<R>, R) {
        let (bsdf, out) = (&vertex.bsdf, &vertex.out);
        match mode {
            TransportMode::Radiance => {
                let mixture = mixture::<R, N>(context, vertex);
                let surface = (bsdf, out, vertex.state.n_shading);
                mixture.sample_reversible::<true>(context, surface, [choice, u, v], lanes)
            }
            TransportMode::Importance => {
                let (some, s, reverse) = bsdf.samples::<true>(out, choice, [u, v], mode);
                (some, s, self.back_pdf_w::<R, N>(context, vertex, reverse))
            }
        }
    }

    #[inline(always)]
    fn pdf_w<R: Lanes<N>, const N: usize>(
        self,
        context: &Context,
        vertex: &Vertex<R>,
        wi: R::Vec3,
        bsdf_pdf_w: R,
        lanes: R::Mask,
    ) -> R {
        let mixture = mixture::<R, N>(context, vertex);
        mixture.pdf_w(context, wi, bsdf_pdf_w, lanes)
    }

    #[inline(always)]
    fn back_pdf_w<R: Lanes<N>, const N: usize>(
        self,
        context: &Context,
        vertex: &Vertex<R>,
        bsdf_pdf_w: R,
    ) -> R {
        let mixture = mixture::<R, N>(context, vertex);
        mixture.mixed(bsdf_pdf_w, vertex.state.guided_back_w)
    }
}
