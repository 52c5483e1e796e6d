//! Sizes of figures in reports.

/// Width of a figure over both columns of a page, in points [ACM two-column format].
pub const FULL: f64 = 506.0;
/// Width of a figure in one column of a page, in points.
pub const COLUMN: f64 = 241.0;
/// Magnification of figures on screens relative to paper.
pub const SCREEN: f64 = 1.6;

/// Maximum number of panels of a figure.
pub const MOST_PANELS: usize = 6;
/// Maximum number of panels in a row.
pub const MOST_COLUMNS: usize = 3;
