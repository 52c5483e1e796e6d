//! Metrics compared with scikit-image, and the laws of every table row.

#![allow(clippy::unwrap_used, reason = "helpers of tests may fail like tests")]

#[path = "metrics/golden.rs"]
mod golden;
#[path = "metrics/laws.rs"]
mod laws;
#[path = "metrics/oracle.rs"]
mod oracle;
