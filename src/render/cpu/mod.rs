//! The CPU backend.
use super::{BackendRow, RenderError};

/// The row of this backend.
pub const ROW: BackendRow = BackendRow {
    name: "cpu",
    doc: "All cores of this machine; needs nothing else, and is the oracle of the others.",
    probe: || Ok("cpu".into()),
    open: |_, _| Err(RenderError::Failed { backend: "cpu", reason: "not built yet".into() }),
};
