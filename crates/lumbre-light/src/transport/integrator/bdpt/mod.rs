//! Bidirectional path tracing [Veach 1997, ch. 10]: connects a subpath from the camera and one from
//! a light in every way.
//!
//! With `mis = "none"` all strategies that can find a path share it equally, by their number; this
//! preserves the mean and shows how much the densities help. If only one strategy is kept as well,
//! `mis = "none"` gives it the weight one: the estimate of that strategy alone, which is all of the
//! light of its depth if it can find every path, and part of it otherwise.
//!
//! All steps are generic over the width of vectors: [`Subpath`](state::Subpath) traces the subpaths
//! vertex by vertex, and [`connect`] evaluates connections. [`single`] combines them for one sample;
//! the wavefront renderer of the CPU does for many, as [`joins`] states. [`merge`] and [`draw`] are
//! the parts that only other techniques use.

pub mod connect;
pub mod directions;
pub mod draw;
pub mod joins;
pub mod merge;
pub mod single;
pub mod state;
pub mod store;
pub mod subpath;
pub mod weights;

use self::directions::BsdfDirections;
use self::joins::{Joins, SubpathTechnique};
use super::{Context, IntegratorRow, settings};
use crate::transport::light::SELECT_FIELD;
use crate::transport::mis;
use crate::value::schema::Table;

/// The table entry of this integrator.
pub const ROW: IntegratorRow = IntegratorRow {
    name: "bdpt",
    long_name: "bidirectional path tracing",
    revision: 6,
    doc: "Paths from the camera and from the lights are connected in every way, with weights that \
          favour the strategy that finds a path best [Veach 1997, ch. 10].",
    params: Table {
        name: "BdptParams",
        doc: "Parameters of `bdpt`.",
        fields: &[
            mis::FIELD,
            SELECT_FIELD,
            settings::STRATEGIES,
            settings::CONTRIBUTION,
        ],
    },
    splats: true,
    bias: None,
    sharing: None,
    sample: |context, pixel, sampler, sink| {
        single::sample(context, BsdfDirections, pixel, sampler, sink);
    },
};

/// Bidirectional path tracing.
pub struct Bdpt;

impl SubpathTechnique for Bdpt {
    type Directions = BsdfDirections;

    fn joins<'a>(_: &Context<'a>) -> Joins<'a, BsdfDirections> {
        Joins::each(BsdfDirections)
    }
}
