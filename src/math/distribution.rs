//! Distributions over items and over the cells of a grid.

/// A distribution over `0..n` proportional to given weights, sampled by inversion.
#[derive(Clone, Debug, PartialEq)]
pub struct Discrete {
    /// Cumulative sums divided by the total; the last is exactly 1.
    cdf: Vec<f32>,
    /// Probability of each item.
    pmf: Vec<f32>,
    total: f64,
}

impl Discrete {
    /// Builds the distribution; `None` if no weight is positive or one is negative or not finite.
    pub fn new(weights: impl IntoIterator<Item = f32>) -> Option<Discrete> {
        let weights: Vec<f64> = weights.into_iter().map(f64::from).collect();
        let total: f64 = weights.iter().sum();
        if weights.iter().any(|w| !w.is_finite() || *w < 0.0) || total <= 0.0 || !total.is_finite() {
            return None;
        }
        let mut sum = 0.0;
        let mut cdf: Vec<f32> = weights
            .iter()
            .map(|w| {
                sum += w;
                (sum / total) as f32
            })
            .collect();
        // The last item with weight must catch every u < 1, also after rounding.
        let last = weights.iter().rposition(|w| *w > 0.0)?;
        cdf[last..].fill(1.0);
        let pmf = weights.iter().map(|w| (w / total) as f32).collect();
        Some(Discrete { cdf, pmf, total })
    }

    /// The item for `u` in `[0, 1)`, and its probability. Items of weight zero are never returned.
    #[inline]
    pub fn sample(&self, u: f32) -> (usize, f32) {
        let i = self.cdf.partition_point(|c| *c <= u).min(self.cdf.len() - 1);
        (i, self.pmf[i])
    }

    /// Probability of item `i`.
    #[inline]
    pub fn pmf(&self, i: usize) -> f32 {
        self.pmf[i]
    }

    /// Sum of the weights.
    pub fn total(&self) -> f64 {
        self.total
    }
}

/// A distribution over `0..n` proportional to given weights, sampled in constant time by an alias table
/// [Walker 1977; Vose 1991].
#[derive(Clone, Debug, PartialEq)]
pub struct Alias {
    /// Of every column: up to where the column's own item is meant, and the item above.
    columns: Vec<(f32, u32)>,
    /// Probability of each item.
    pmf: Vec<f32>,
}

impl Alias {
    /// Builds the table; `None` if no weight is positive, one is negative or not finite, or there are more than 2^32.
    pub fn new(weights: impl IntoIterator<Item = f64>) -> Option<Alias> {
        let weights: Vec<f64> = weights.into_iter().collect();
        let total: f64 = weights.iter().sum();
        let bad = |w: &f64| !w.is_finite() || *w < 0.0;
        if weights.iter().any(bad) || total <= 0.0 || !total.is_finite() || u32::try_from(weights.len()).is_err() {
            return None;
        }
        let n = weights.len() as f64;
        let heaviest = weights.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?.0 as u32;
        let mut rest: Vec<f64> = weights.iter().map(|w| w / total * n).collect();
        let (mut under, mut over): (Vec<u32>, Vec<u32>) = (0..rest.len() as u32).partition(|i| rest[*i as usize] < 1.0);
        // What rounding leaves over stays a full column of its own; an item of weight zero must not have one.
        let mut columns: Vec<(f32, u32)> =
            weights.iter().enumerate().map(|(i, w)| if *w > 0.0 { (1.0, i as u32) } else { (0.0, heaviest) }).collect();
        while let (Some(small), Some(&large)) = (under.pop(), over.last()) {
            let missing = 1.0 - rest[small as usize];
            columns[small as usize] = ((1.0 - missing) as f32, large);
            rest[large as usize] -= missing;
            if rest[large as usize] < 1.0 {
                over.pop();
                under.push(large);
            }
        }
        Some(Alias { columns, pmf: weights.iter().map(|w| (w / total) as f32).collect() })
    }

    /// The item for `u` in `[0, 1)`, and its probability. Items of weight zero are never returned.
    #[inline]
    pub fn sample(&self, u: f32) -> (usize, f32) {
        let x = f64::from(u) * self.columns.len() as f64;
        let column = (x as usize).min(self.columns.len() - 1);
        let (split, above) = self.columns[column];
        let item = if x - (column as f64) < f64::from(split) { column } else { above as usize };
        (item, self.pmf[item])
    }

    /// Probability of item `i`.
    #[inline]
    pub fn pmf(&self, i: usize) -> f32 {
        self.pmf[i]
    }
}

/// A distribution over the cells of a grid, constant inside a cell: a row from the marginal distribution, a column from
/// the row's conditional one.
///
/// Probabilities are differences of the stored cumulative sums, so that [`Grid::probability`] says exactly what
/// [`Grid::sample`] does, also for cells so light that `f32` cannot tell them from nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    width: usize,
    /// Cumulative probability after every row.
    marginal: Vec<f32>,
    /// Cumulative probability after every cell of a row, row by row.
    conditional: Vec<f32>,
}

/// A point drawn from a [`Grid`].
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
    /// Builds the distribution from `[y][x]` weights; `None` if no weight is positive, one is negative or not finite, or
    /// they do not fill rows of `width`.
    pub fn new(width: usize, weights: &[f64]) -> Option<Grid> {
        if width == 0 || !weights.len().is_multiple_of(width) || weights.iter().any(|w| !w.is_finite() || *w < 0.0) {
            return None;
        }
        let mut conditional = Vec::with_capacity(weights.len());
        let mut rows = Vec::with_capacity(weights.len() / width);
        for row in weights.chunks_exact(width) {
            rows.push(row.iter().sum::<f64>());
            match cumulative(row) {
                Some(sums) => conditional.extend(sums),
                // Never chosen: the marginal distribution has no width there.
                None => conditional.extend(std::iter::repeat_n(1.0, width)),
            }
        }
        Some(Grid { width, marginal: cumulative(&rows)?, conditional })
    }

    /// A cell and a point in it for `u` in `[0, 1)^2`: the first number chooses the column, the second the row.
    #[inline]
    pub fn sample(&self, u: [f32; 2]) -> GridSample {
        let (y, fy, row) = invert(&self.marginal, u[1]);
        let (x, fx, column) = invert(self.row(y), u[0]);
        GridSample { cell: [x, y], inside: [fx, fy], probability: row * column }
    }

    /// Probability of the cell in a column and a row.
    #[inline]
    pub fn probability(&self, x: usize, y: usize) -> f32 {
        width_of(&self.marginal, y) * width_of(self.row(y), x)
    }

    fn row(&self, y: usize) -> &[f32] {
        &self.conditional[y * self.width..][..self.width]
    }
}

/// Cumulative sums over their total; from the last item with weight on exactly 1. `None` without weight.
fn cumulative(weights: &[f64]) -> Option<Vec<f32>> {
    let total: f64 = weights.iter().sum();
    let last = weights.iter().rposition(|w| *w > 0.0)?;
    if !total.is_finite() {
        return None;
    }
    let mut sum = 0.0;
    let mut cdf: Vec<f32> = weights
        .iter()
        .map(|w| {
            sum += w;
            (sum / total).min(1.0) as f32
        })
        .collect();
    cdf[last..].fill(1.0);
    Some(cdf)
}

#[inline]
fn width_of(cdf: &[f32], i: usize) -> f32 {
    cdf[i] - if i == 0 { 0.0 } else { cdf[i - 1] }
}

/// The item whose interval holds `u`, where in the interval, and how wide it is.
#[inline]
fn invert(cdf: &[f32], u: f32) -> (usize, f32, f32) {
    let i = cdf.partition_point(|c| *c <= u).min(cdf.len() - 1);
    let low = if i == 0 { 0.0 } else { cdf[i - 1] };
    let width = cdf[i] - low;
    (i, ((u - low) / width).clamp(0.0, 1.0 - f32::EPSILON), width)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{rng, stats};

    #[test]
    fn frequencies_follow_the_weights() {
        let weights = [0.0, 1.0, 5.0, 0.0, 0.25, 3.0, 0.0];
        let d = Discrete::new(weights).unwrap();
        let n = 100_000u32;
        let mut observed = [0.0; 7];
        for i in 0..n {
            let (item, p) = d.sample(rng::unit(rng::pcg4d([i, 0, 0, 9])[0]));
            assert_eq!(p, d.pmf(item));
            observed[item] += 1.0;
        }
        assert_eq!((observed[0], observed[3], observed[6]), (0.0, 0.0, 0.0));
        let expected: Vec<f64> = weights.iter().map(|w| f64::from(*w) / 9.25 * f64::from(n)).collect();
        assert!(stats::chi_square_p(&observed, &expected, 0) > 0.001);
    }

    #[test]
    fn extremes_and_nonsense() {
        let d = Discrete::new([0.0, 2.0, 0.0]).unwrap();
        assert_eq!(d.sample(0.0).0, 1);
        assert_eq!(d.sample(0.999_999_94).0, 1);
        assert!(Discrete::new([0.0, 0.0]).is_none());
        assert!(Discrete::new([1.0, -1.0]).is_none());
        assert!(Discrete::new([f32::NAN]).is_none());
        assert!(Discrete::new([]).is_none());
    }

    #[test]
    fn an_alias_table_follows_its_weights_and_never_draws_zeros() {
        // From one item to ten thousand, with zeros, ties and weights that differ by 10^6; four tests.
        let cases: [Vec<f64>; 4] = [
            vec![3.0],
            vec![0.0, 1.0, 5.0, 0.0, 0.25, 3.0, 0.0],
            vec![1e-3, 1e3, 1.0, 1.0],
            (0..10_000).map(|i| f64::from(i % 7) + if i == 77 { 5e3 } else { 0.0 }).collect(),
        ];
        for weights in cases {
            let a = Alias::new(weights.iter().copied()).unwrap();
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
        assert!(Alias::new([0.0, 0.0]).is_none() && Alias::new([1.0, -1.0]).is_none());
        assert!(Alias::new([f64::NAN]).is_none() && Alias::new([]).is_none());
    }

    #[test]
    fn a_grid_follows_its_weights_inside_cells_too() {
        // 5 x 4 cells with a black row and a black corner; every cell cut into 3 x 3.
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
        let expected: Vec<f64> =
            weights.iter().flat_map(|w| std::iter::repeat_n(w / total * f64::from(n) / 9.0, 9)).collect();
        let p = stats::chi_square_p(&observed, &expected, 0);
        assert!(p > 0.001, "p = {p}");
        for (i, w) in weights.iter().enumerate() {
            assert!((f64::from(grid.probability(i % 5, i / 5)) - w / total).abs() < 1e-6);
        }
    }

    #[test]
    fn grids_without_weight_or_with_nonsense_are_none_and_extremes_stay_inside() {
        assert!(Grid::new(2, &[0.0; 4]).is_none() && Grid::new(0, &[]).is_none() && Grid::new(3, &[1.0; 4]).is_none());
        assert!(Grid::new(1, &[-1.0]).is_none() && Grid::new(1, &[f64::INFINITY]).is_none());
        let g = Grid::new(3, &[0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0]).unwrap();
        for u in [[0.0, 0.0], [0.999_999_94; 2]] {
            let s = g.sample(u);
            assert_eq!((s.cell, s.probability), ([1, 1], 1.0));
            assert!(s.inside.iter().all(|f| (0.0..1.0).contains(f)));
        }
    }
}
