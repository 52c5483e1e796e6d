//! Metrics against scikit-image, and the laws that every row of the table obeys.

#![allow(clippy::unwrap_used, reason = "helpers of tests may fail like tests")]

#[path = "metrics/golden.rs"]
mod golden;
#[path = "metrics/laws.rs"]
mod laws;
#[path = "metrics/oracle.rs"]
mod oracle;
