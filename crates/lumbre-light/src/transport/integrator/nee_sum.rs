//! The estimator of S0, Algorithm 4: light that paths hit is added to that of connections, and both
//! count in full. All but directly seen light and light after specular events counts twice.

use super::camera_path;
pub use super::nee::Nee;
use super::{IntegratorRow, settings};
use crate::transport::light::SELECT_FIELD;
use crate::value::schema::Table;

/// The table entry of this integrator.
pub const ROW: IntegratorRow = IntegratorRow {
    name: settings::ALL_HITS,
    long_name: "path tracing with next event estimation and all hits, biased",
    revision: 1,
    doc: "The samples of `nee`, with connections and light that paths hit both counted in full, as \
          Algorithm 4 of S0 prints it (docs/bibliography.md); for studies of that thesis.",
    params: Table {
        name: "NeeSumParams",
        doc: "Parameters of `nee_sum`.",
        fields: &[SELECT_FIELD, settings::LIGHTS, settings::DIRECTIONS],
    },
    splats: false,
    bias: Some("light that a connection and a hit both find counts twice"),
    sharing: None,
    sample: camera_path::sample::<Nee>,
};
