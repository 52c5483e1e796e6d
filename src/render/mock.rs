//! The mock backend: analytic convergence on a fake clock.
use super::{BackendRow, RenderError};

/// The row of this backend.
pub const ROW: BackendRow = BackendRow {
    name: "mock",
    doc: "Analytic convergence on a fake clock, for testing experiments without rendering.",
    probe: || Ok("mock".into()),
    open: |_, _| Err(RenderError::Failed { backend: "mock", reason: "not built yet".into() }),
};
