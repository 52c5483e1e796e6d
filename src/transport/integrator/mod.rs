//! Integrators: ways of finding the light that reaches a pixel, one file and one table row each.

use crate::value::schema::Table;

/// One row of [`INTEGRATORS`].
#[derive(Debug)]
pub struct IntegratorRow {
    /// The short name in scripts, columns and paths.
    pub name: &'static str,
    /// The long name that stands beside it in tables and plots.
    pub long_name: &'static str,
    /// Raised whenever the pictures change; part of every run's identity.
    pub revision: u32,
    /// What it does, in a sentence, with its source.
    pub doc: &'static str,
    /// Its own parameters in a script's `render` table.
    pub params: Table,
}

/// Every integrator there is.
pub const INTEGRATORS: &[IntegratorRow] = &[IntegratorRow {
    name: "bpt",
    long_name: "backward path tracing",
    revision: 1,
    doc: "Paths start at the camera and find light only by hitting it [Kajiya 1986].",
    params: Table { name: "BptParams", doc: "Parameters of `bpt`: none.", fields: &[] },
}];

/// The row with this name.
pub fn integrator(name: &str) -> Option<&'static IntegratorRow> {
    INTEGRATORS.iter().find(|row| row.name == name)
}
