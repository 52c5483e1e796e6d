//! Metrics against scikit-image, and the laws that every row of the table obeys.

#[path = "metrics/golden.rs"]
mod golden;
#[path = "metrics/laws.rs"]
mod laws;
