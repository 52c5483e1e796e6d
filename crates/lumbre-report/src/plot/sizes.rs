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
const MOST_COLUMNS: usize = 3;

/// Returns the number of panels in a row, so that rows are as equally long as possible.
pub fn columns(panels: usize) -> usize {
    panels.div_ceil(panels.div_ceil(MOST_COLUMNS).max(1)).max(1)
}

#[cfg(test)]
mod tests {
    #[test]
    fn four_panels_are_two_rows_of_two() {
        let columns = [0, 1, 2, 3, 4, 5, 6].map(super::columns);
        assert_eq!(columns, [1, 1, 2, 3, 2, 3, 3]);
    }
}
