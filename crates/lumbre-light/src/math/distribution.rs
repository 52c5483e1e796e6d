//! Discrete distributions over items and over the cells of a grid.
//!
//! A sample number has only 2^24 values, called steps. Invariant: every item of positive weight has
//! a whole number of steps, at least one, and the reported probabilities are exactly those of
//! sampling.

/// Number of steps: [`unit`](crate::math::rng::unit) returns multiples of 2^-24.
const STEPS: u32 = 1 << 24;

/// Assigns an interval of steps to every item and returns the end of each; an interval starts where
/// the previous one ends. Lengths are in proportion to the weights, but at least 1 for items of
/// positive weight, and 0 for others. Returns `None` if no weight is positive, one is negative or
/// not finite, or more are positive than there are steps.
///
/// Probabilities in whole steps are exact. A probability computed from the weight would differ by
/// up to a step from the frequency with which `u` selects the item, which matters among ten
/// thousand items.
fn interval_ends(weights: &[f64]) -> Option<Vec<u32>> {
    let total: f64 = weights.iter().sum();
    let last = weights.iter().rposition(|w| *w > 0.0)?;
    let positive = weights.iter().filter(|w| **w > 0.0).count();
    if weights.iter().any(|w| !w.is_finite() || *w < 0.0)
        || !total.is_finite()
        || positive > STEPS as usize
    {
        return None;
    }
    // Each item gets one step. The rest are shared in proportion to the steps beyond the first that
    // each item should have.
    let further = |w: &f64| (w / total * f64::from(STEPS) - 1.0).max(0.0);
    let scale = f64::from(STEPS - positive as u32)
        / weights
            .iter()
            .map(further)
            .sum::<f64>()
            .max(f64::MIN_POSITIVE);
    let (mut sum, mut items) = (0.0, 0);
    let end = |w: &f64| {
        sum += further(w);
        items += u32::from(*w > 0.0);
        ((sum * scale) as u32 + items).min(STEPS)
    };
    let mut ends: Vec<u32> = weights.iter().map(end).collect();
    ends[last..].fill(STEPS);
    Some(ends)
}

/// Returns the step of a number in `[0, 1)`.
#[inline]
fn step_of(u: f32) -> u32 {
    ((u * STEPS as f32) as u32).min(STEPS - 1)
}

/// A distribution over `0..n` proportional to given weights, sampled in constant time by an alias
/// table [Walker 1977; Vose 1991].
///
/// [`AliasTable::pmf`] returns the exact probabilities of [`AliasTable::sample`], also for ten
/// thousand items, or for an item with a millionth of the other weights.
#[derive(Clone, Debug, PartialEq)]
pub struct AliasTable {
    /// For every column, the number of steps that select its own item, and the alias: the item that
    /// its other steps select. The number of columns is a power of two, so that all have the same
    /// number of steps. Columns without an item have no own steps.
    pub columns: Vec<(u32, u32)>,
    /// Binary logarithm of the number of steps of a column.
    pub shift: u32,
    /// Probability of each item.
    pub pmf: Vec<f32>,
}

impl AliasTable {
    /// Maximum number of items: each needs at least one sample number.
    pub const MAX_ITEMS: usize = STEPS as usize;

    /// Builds the table. Returns `None` if no weight is positive, one is negative or not finite, or
    /// there are more than [`AliasTable::MAX_ITEMS`].
    pub fn new(weights: impl IntoIterator<Item = f64>) -> Option<AliasTable> {
        let weights: Vec<f64> = weights.into_iter().collect();
        if weights.len() > AliasTable::MAX_ITEMS {
            return None;
        }
        let ends = interval_ends(&weights)?;
        let starts = std::iter::once(0).chain(ends.iter().copied());
        let mut remaining: Vec<u32> = ends
            .iter()
            .zip(starts)
            .map(|(end, start)| end - start)
            .collect();
        let pmf = remaining.iter().map(|n| *n as f32 / STEPS as f32).collect();
        remaining.resize(weights.len().next_power_of_two(), 0);
        let capacity = STEPS / remaining.len() as u32;
        let mut columns: Vec<(u32, u32)> =
            (0..remaining.len() as u32).map(|i| (capacity, i)).collect();
        let (mut underfull, mut overfull): (Vec<u32>, Vec<u32>) =
            (0..remaining.len() as u32).partition(|i| remaining[*i as usize] < capacity);
        // Steps are whole numbers, so no remainder is left: the last column is full.
        while let (Some(small), Some(&large)) = (underfull.pop(), overfull.last()) {
            let own = remaining[small as usize];
            columns[small as usize] = (own, large);
            remaining[large as usize] -= capacity - own;
            if remaining[large as usize] < capacity {
                overfull.pop();
                underfull.push(large);
            }
        }
        Some(AliasTable {
            columns,
            shift: capacity.trailing_zeros(),
            pmf,
        })
    }

    /// Returns the item for `u` in `[0, 1)` and its probability. Items of weight zero are never
    /// returned.
    #[inline]
    pub fn sample(&self, u: f32) -> (usize, f32) {
        let step = step_of(u);
        let column = (step >> self.shift) as usize;
        let (own, alias) = self.columns[column];
        let item = if step & ((1 << self.shift) - 1) < own {
            column
        } else {
            alias as usize
        };
        (item, self.pmf[item])
    }

    /// Returns the probability of item `i`.
    #[inline]
    pub fn pmf(&self, i: usize) -> f32 {
        self.pmf[i]
    }
}

/// A distribution over the cells of a grid, constant inside a cell. A row is sampled from the
/// marginal distribution, then a column from the row's conditional one.
///
/// Every row of positive weight has at least one step, and so has every cell of positive weight
/// within its row. [`Grid::probability`] is therefore exactly that of [`Grid::sample`].
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Number of columns.
    pub width: usize,
    /// Cumulative probability at the end of every row.
    pub marginal: Vec<f32>,
    /// Cumulative probability at the end of every cell within its row, `[row][column]`.
    pub conditional: Vec<f32>,
}

/// A sample of a [`Grid`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridSample {
    /// Column and row.
    pub cell: [usize; 2],
    /// Position inside the cell, in `[0, 1)` along columns and rows.
    pub inside: [f32; 2],
    /// Probability of the cell.
    pub probability: f32,
}

impl Grid {
    /// Builds the distribution from `[y][x]` weights. Returns `None` if no weight is positive, one
    /// is negative or not finite, the weights do not fill rows of `width`, or a side is longer than
    /// 2^23.
    pub fn new(width: usize, weights: &[f64]) -> Option<Grid> {
        if width == 0
            || !weights.len().is_multiple_of(width)
            || weights.iter().any(|w| !w.is_finite() || *w < 0.0)
        {
            return None;
        }
        let mut conditional = Vec::with_capacity(weights.len());
        let mut rows = Vec::with_capacity(weights.len() / width);
        for row in weights.chunks_exact(width) {
            rows.push(row.iter().sum::<f64>());
            match cumulative(row) {
                Some(sums) => conditional.extend(sums),
                // The row has no marginal probability, so it is never sampled.
                None => conditional.extend(std::iter::repeat_n(1.0, width)),
            }
        }
        Some(Grid {
            width,
            marginal: cumulative(&rows)?,
            conditional,
        })
    }

    /// Samples a cell and a point in it for `u` in `[0, 1)^2`: `u[0]` selects the column, `u[1]`
    /// the row.
    #[inline]
    pub fn sample(&self, u: [f32; 2]) -> GridSample {
        let (y, fy, row) = invert_cdf(&self.marginal, u[1]);
        let (x, fx, column) = invert_cdf(self.row(y), u[0]);
        GridSample {
            cell: [x, y],
            inside: [fx, fy],
            probability: row * column,
        }
    }

    /// Returns the probability of the cell in a column and a row.
    #[inline]
    pub fn probability(&self, x: usize, y: usize) -> f32 {
        interval_width(&self.marginal, y) * interval_width(self.row(y), x)
    }

    fn row(&self, y: usize) -> &[f32] {
        &self.conditional[y * self.width..][..self.width]
    }
}

/// Returns cumulative probabilities in whole steps; `None` in the cases of [`interval_ends`].
fn cumulative(weights: &[f64]) -> Option<Vec<f32>> {
    Some(
        interval_ends(weights)?
            .into_iter()
            .map(|end| end as f32 / STEPS as f32)
            .collect(),
    )
}

/// Returns the probability of item `i`.
#[inline]
fn interval_width(cdf: &[f32], i: usize) -> f32 {
    cdf[i] - if i == 0 { 0.0 } else { cdf[i - 1] }
}

/// Returns the item whose interval contains `u`, the position in the interval, and its width.
#[inline]
fn invert_cdf(cdf: &[f32], u: f32) -> (usize, f32, f32) {
    let i = cdf.partition_point(|c| *c <= u).min(cdf.len() - 1);
    let low = if i == 0 { 0.0 } else { cdf[i - 1] };
    let width = cdf[i] - low;
    // Uses the middle of the step of `u`, so that items of few steps are not sampled only at one
    // edge.
    (
        i,
        ((u - low + 0.5 / STEPS as f32) / width).clamp(0.0, 1.0 - f32::EPSILON),
        width,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{rng, stats};

    #[test]
    fn an_alias_table_follows_its_weights_and_never_samples_zero_weights() {
        // From one item to ten thousand, with zeros, ties and weights that differ by 10^6; four
        // tests.
        let cases: [Vec<f64>; 4] = [
            vec![3.0],
            vec![0.0, 1.0, 5.0, 0.0, 0.25, 3.0, 0.0],
            vec![1e-3, 1e3, 1.0, 1.0],
            (0..10_000)
                .map(|i| f64::from(i % 7) + if i == 77 { 5e3 } else { 0.0 })
                .collect(),
        ];
        for weights in cases {
            let a = AliasTable::new(weights.iter().copied()).unwrap();
            let total: f64 = weights.iter().sum();
            let n = 400_000u32;
            let mut observed = vec![0.0; weights.len()];
            for i in 0..n {
                let (item, p) = a.sample(rng::unit(rng::pcg4d([i, 0, 4, 9])[0]));
                assert_eq!(p, a.pmf(item));
                observed[item] += 1.0;
            }
            let expected: Vec<f64> = weights.iter().map(|w| w / total * f64::from(n)).collect();
            let p = stats::chi_square_p(&observed, &expected, 0);
            assert!(p > 0.001 / 4.0, "{} weights: p = {p}", weights.len());
        }
        assert!(AliasTable::new([0.0, 0.0]).is_none() && AliasTable::new([1.0, -1.0]).is_none());
        assert!(AliasTable::new([f64::NAN]).is_none() && AliasTable::new([]).is_none());
    }

    #[test]
    fn alias_table_probabilities_are_exact_and_positive_for_positive_weights() {
        let tiny = |i: usize| {
            if i.is_multiple_of(3) {
                1e-30
            } else {
                1.0 + (i % 11) as f64
            }
        };
        let weights: Vec<f64> = (0..999)
            .map(|i| if i == 500 { 0.0 } else { tiny(i) })
            .collect();
        let total: f64 = weights.iter().sum();
        let a = AliasTable::new(weights.iter().copied()).unwrap();
        let mut counts = vec![0u32; weights.len()];
        for k in 0..STEPS {
            counts[a.sample(k as f32 / STEPS as f32).0] += 1;
        }
        for (i, (count, w)) in counts.iter().zip(&weights).enumerate() {
            assert_eq!(
                f64::from(*count) / f64::from(STEPS),
                f64::from(a.pmf(i)),
                "item {i}"
            );
            assert_eq!(*count > 0, *w > 0.0, "item {i}");
            assert!(
                (f64::from(a.pmf(i)) - w / total).abs() * f64::from(STEPS) < 2.0,
                "item {i}"
            );
        }
    }

    #[test]
    fn an_alias_table_is_sampled_in_constant_time() {
        // The item is one of the two in the column that `u` selects, hence constant time.
        let n = 10_000u32;
        let a = AliasTable::new((0..n).map(|i| 1.0 + f64::from(i))).unwrap();
        assert_eq!((a.columns.len(), a.pmf.len()), (16_384, n as usize));
        for i in 0..100_000u32 {
            let u = rng::unit(rng::pcg4d([i, 1, 4, 9])[0]);
            let column = (u * 16_384.0) as usize;
            let item = a.sample(u).0;
            assert!(
                item == column || item == a.columns[column].1 as usize,
                "{item} from column {column}"
            );
        }
    }

    #[test]
    fn an_alias_table_has_at_most_one_item_per_step() {
        let a = AliasTable::new(std::iter::repeat_n(1.0, AliasTable::MAX_ITEMS)).unwrap();
        assert!(
            [0, 1, 77, STEPS - 1]
                .iter()
                .all(|k| a.sample(*k as f32 / STEPS as f32).0 == *k as usize)
        );
        assert!(AliasTable::new(std::iter::repeat_n(1.0, AliasTable::MAX_ITEMS + 1)).is_none());
    }

    #[test]
    fn a_grid_follows_its_weights_and_is_uniform_inside_cells() {
        // 5 x 4 cells with a black row and a black corner; every cell is cut into 3 x 3.
        let weights: Vec<f64> = (0..20)
            .map(|i| match (i % 5, i / 5) {
                (_, 1) | (0, 0) => 0.0,
                (3, 2) => 40.0,
                (x, y) => f64::from(x + y),
            })
            .collect();
        let total: f64 = weights.iter().sum();
        let grid = Grid::new(5, &weights).unwrap();
        let n = 400_000u32;
        let mut observed = vec![0.0; 180];
        for i in 0..n {
            let w = rng::pcg4d([i, 3, 4, 9]).map(rng::unit);
            let s = grid.sample([w[0], w[1]]);
            assert_eq!(s.probability, grid.probability(s.cell[0], s.cell[1]));
            let [fx, fy] = s.inside.map(|f| (f * 3.0) as usize);
            observed[(s.cell[1] * 5 + s.cell[0]) * 9 + fy * 3 + fx] += 1.0;
        }
        let expected: Vec<f64> = weights
            .iter()
            .flat_map(|w| std::iter::repeat_n(w / total * f64::from(n) / 9.0, 9))
            .collect();
        let p = stats::chi_square_p(&observed, &expected, 0);
        assert!(p > 0.001, "p = {p}");
        for (i, w) in weights.iter().enumerate() {
            assert!((f64::from(grid.probability(i % 5, i / 5)) - w / total).abs() < 1e-6);
        }
    }

    #[test]
    fn invalid_grids_are_none_and_extreme_samples_stay_inside() {
        assert!(
            Grid::new(2, &[0.0; 4]).is_none()
                && Grid::new(0, &[]).is_none()
                && Grid::new(3, &[1.0; 4]).is_none()
        );
        assert!(Grid::new(1, &[-1.0]).is_none() && Grid::new(1, &[f64::INFINITY]).is_none());
        let g = Grid::new(3, &[0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0]).unwrap();
        for u in [[0.0, 0.0], [0.999_999_94; 2]] {
            let s = g.sample(u);
            assert_eq!((s.cell, s.probability), ([1, 1], 1.0));
            assert!(s.inside.iter().all(|f| (0.0..1.0).contains(f)));
        }
    }
}
