//! Division of triangles into geometries of an acceleration structure.

use std::ops::Range;

/// Maximum number of geometries that the triangles outside instances are divided into. A scene has
/// one for each run of triangles with or without masks, thus at most two for each mesh with sorted
/// materials; where masks change more often, all triangles are one geometry.
pub const MAX_GEOMETRIES: usize = 4096;

/// Consecutive triangles that are all opaque, or may all have masks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TriangleRun {
    /// Indices of the triangles.
    pub rows: Range<u32>,
    /// Whether none has a mask, so that a hit needs no any-hit shader.
    pub opaque: bool,
}

/// Divides triangles into at most `max` runs; `masked` states of each whether it has a mask.
pub fn triangle_runs(masked: &[bool], max: usize) -> Vec<TriangleRun> {
    let (mut runs, mut start) = (Vec::new(), 0);
    for run in masked.chunk_by(|a, b| a == b) {
        let rows = start..start + run.len() as u32;
        start = rows.end;
        let opaque = !run[0];
        runs.push(TriangleRun { rows, opaque });
    }
    if runs.len() > max {
        let (rows, opaque) = (0..start, false);
        return vec![TriangleRun { rows, opaque }];
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opaque_and_masked_triangles_are_different_geometries() {
        let run = |rows: Range<u32>, opaque: bool| TriangleRun { rows, opaque };
        assert_eq!(triangle_runs(&[], 8), []);
        assert_eq!(triangle_runs(&[false; 2], 8), [run(0..2, true)]);
        let mixed = [false, false, true, false, true, true];
        let expected = [
            run(0..2, true),
            run(2..3, false),
            run(3..4, true),
            run(4..6, false),
        ];
        assert_eq!(triangle_runs(&mixed, 4), expected);
        assert_eq!(triangle_runs(&mixed, 3), [run(0..6, false)]);
    }
}
