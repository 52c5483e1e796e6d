//! Practical path guiding [Müller et al. 2017]: [`nee`] whose paths continue in
//! directions from which light was found before.
//!
//! The first samples fill an [SD-tree](sd_tree): at every point of the scene a density of directions
//! ([`training`]). A vertex samples its next edge by the BSDF or by the tree, and the density is that
//! of the mixture,
//!
//! `p(wi) = a p_bsdf(wi) + (1 - a) p_tree(wi)`,
//!
//! also in the weights of light sampling. Dirac lobes are sampled by the BSDF alone, and so are
//! surfaces that have no other lobes and regions that no training path brought light to.
//!
//! - The tree's density is proportional to what paths contribute to the picture on average by going
//!   on in a direction. With `target = "variance"` it is the root of their mean square, which has
//!   the least variance of the picture, given light sampling [Rath et al. 2020]. Light that the
//!   vertex finds by its own shadow ray is not part of it.
//! - The tree learns from a number of samples that doubles, then from as many as are left of
//!   `training`, and stays the same afterwards. All samples are part of the picture, with equal
//!   weights. Each is unbiased, since the tree that guides it does not depend on it.
//! - [`bidirectional`] guides the camera subpaths of `bdpt` by the same tree.

pub mod bidirectional;
pub mod direction_tree;
pub mod directions;
pub mod sd_tree;
pub mod settings;
#[cfg(test)]
mod tests;
pub mod training;

pub use self::directions::Guided;
use self::directions::{Guide, NAME};
use super::iteration::Sharing;
use super::{IntegratorRow, camera_path, settings as common};
use crate::transport::light::{COMPENSATE, SELECT_FIELD};
use crate::transport::mis;
use crate::value::schema::Table;

/// The table entry of this integrator.
pub const ROW: IntegratorRow = IntegratorRow {
    name: NAME,
    long_name: "guided path tracing with next event estimation",
    revision: 3,
    doc: "Paths are those of nee, but continue in directions where earlier samples found light, by a \
          tree over space and directions [Müller et al. 2017; Rath et al. 2020].",
    params: Table {
        name: "GuidedParams",
        doc: "Parameters of `guided`.",
        fields: &[
            settings::TRAINING,
            settings::TARGET,
            settings::BSDF_FRACTION,
            settings::SPLIT,
            settings::TREE_MEMORY,
            mis::FIELD,
            SELECT_FIELD,
            COMPENSATE,
            common::LIGHTS,
        ],
    },
    splats: false,
    bias: None,
    sharing: Some(Sharing {
        prepare: training::prepare,
        begin: training::begin,
        constant_from: Some(training::samples_that_train),
        recorded: Some(Guide::recorded),
        ..TRAINED
    }),
    sample: camera_path::sample::<Guided>,
};

/// The functions that train the tree before the first sample.
const TRAINED: Sharing = Sharing {
    prepare: training::prepare_apart,
    begin: training::begin_trained,
    vertex_bytes: training::VERTEX_BYTES,
    batch: Some(training::BATCH),
    fixed_bytes: |settings| settings.guiding.tree_bytes(),
    constant_from: Some(|_| 0),
    recorded: None,
};
