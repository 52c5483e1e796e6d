//! Metrics compared with scikit-image and the authors' FLIP, and the properties that every row of
//! the metric table must have.

#![allow(clippy::unwrap_used, reason = "test helpers may panic")]

mod golden;
mod oracle;
mod properties;
