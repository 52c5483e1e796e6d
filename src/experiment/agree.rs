//! Whether two integrators mean the same picture: a reference beside the picture of a second technique.
//!
//! The two are compared block by block [`ztest`], and of the blocks that are called different at most a stated share may
//! be so by chance ([`discoveries`]); where nothing differs, an alarm has at most that probability. The comparison sees
//! what its noise lets it see, so that agreement is told with the precision at which it was found.

use crate::film::Image;
use crate::math::discovery::discoveries;
use crate::math::stats::normal_two_sided_p;
use crate::metrics::map::{Colours, ErrorMap};
use crate::metrics::ztest::{self, Blocks, Estimate, Judged};

/// Side of a block in pixels, where the picture has enough of them.
const BLOCK: u32 = 16;

/// A sum over pixels is called normal if light was found for it so many times.
const ENOUGH_FINDS: f64 = 50.0;

/// The deviate at which the colours of the map end.
pub const MAP_TOP: f32 = 6.0;

/// What the comparison of a reference with a second technique found.
#[derive(Clone, Debug, PartialEq)]
pub struct Agreement {
    /// Blocks and channels that were compared, and the three channels of the whole picture.
    pub comparisons: usize,
    /// Those that differ, least p-value first; blocks alone.
    pub differing: Vec<Judged>,
    /// Whether the whole pictures differ.
    pub whole_differs: bool,
    /// The share of false ones that was allowed.
    pub rate: f64,
    /// Sum of the reference over that of the second picture.
    pub ratio: f64,
    /// Standard error of the ratio, as if channels shared all of their noise.
    pub ratio_error: f64,
    /// The deviate of every block, of the channel in which it is greatest, painted over its pixels. Blocks of the dark
    /// rest are shown too, though each for itself has too little light to be called different.
    pub map: ErrorMap,
}

impl Agreement {
    /// Whether nothing differs.
    pub fn agrees(&self) -> bool {
        self.differing.is_empty() && !self.whole_differs
    }

    /// The finding in a sentence.
    pub fn describe(&self) -> String {
        let ratio = format!("ratio {:.4} ± {:.4}", self.ratio, self.ratio_error);
        if self.comparisons == 0 {
            return "too little light was found to compare them".to_owned();
        }
        let level = format!("false discovery rate {}", self.rate);
        if self.agrees() {
            return format!("none of {} comparisons differs ({ratio}, {level})", self.comparisons);
        }
        let place = match self.differing.first() {
            Some(Judged { at: Some([x, y]), z, .. }) => format!(", most at column {x}, row {y} (z = {z:.1})"),
            Some(Judged { at: None, z, .. }) => format!(", most in the dark rest (z = {z:.1})"),
            None => String::new(),
        };
        let count = self.differing.len() + usize::from(self.whole_differs);
        format!("{count} of {} comparisons differ{place} ({ratio}, {level})", self.comparisons)
    }
}

/// Compares a reference with the picture of a second technique; both come with the variance of their pixels' means, and
/// have one size. Of the comparisons that differ at most the share `rate` is false on average.
///
/// # Panics
/// When the sizes differ.
pub fn agree(reference: Estimate, second: Estimate, rate: f64) -> Agreement {
    let [width, height] = [reference.mean.width, reference.mean.height];
    // Small pictures get smaller blocks, so that there are some to compare.
    let block = BLOCK.min((width.min(height) / 4).max(1));
    let find = find(reference).max(find(second));
    // Black says nothing, even where there is no noise.
    let enough = (ENOUGH_FINDS * find).max(f64::MIN_POSITIVE);
    let Blocks { judged, dark, whole, ratio } = ztest::blocks(reference, second, block, enough);
    let [(a, ea), (b, eb)] = [reference, second].map(total);
    // Where too little light was found in all, the whole says nothing either.
    let judged_whole = a.max(b) >= enough;
    let whole_p = whole.map(normal_two_sided_p);
    let p: Vec<f64> = judged.iter().map(|j| j.p).chain(whole_p.into_iter().filter(|_| judged_whole)).collect();
    let found = discoveries(&p, rate);
    let mut differing: Vec<Judged> = judged.iter().zip(&found).filter(|(_, d)| **d).map(|(j, _)| *j).collect();
    differing.sort_by(|a, b| a.p.total_cmp(&b.p));
    Agreement {
        comparisons: p.len(),
        whole_differs: found[judged.len()..].contains(&true),
        map: map([width, height], block, judged.iter().chain(&dark)),
        differing,
        rate,
        ratio,
        ratio_error: ratio * (ea / a).hypot(eb / b),
    }
}

/// What a typical find of light adds to a pixel's mean: the variance of a sum of rare finds is their number times the
/// square of their size, and its mean their number times their size.
fn find(estimate: Estimate) -> f64 {
    let [mean, variance] = [estimate.mean, estimate.variance].map(|image| image.mean().iter().sum::<f64>());
    if mean > 0.0 { variance / mean } else { 0.0 }
}

/// The sum over all pixels and channels, and its standard error as if channels shared all of their noise.
fn total(estimate: Estimate) -> (f64, f64) {
    let pixels = estimate.mean.data.len() as f64;
    let sum = |image: &Image| image.mean().map(|mean| mean * pixels);
    (sum(estimate.mean).iter().sum(), sum(estimate.variance).map(f64::sqrt).iter().sum())
}

fn map<'a>([width, height]: [u32; 2], block: u32, all: impl Iterator<Item = &'a Judged>) -> ErrorMap {
    let columns = width.div_ceil(block);
    let mut blocks = vec![0.0f64; (columns * height.div_ceil(block)) as usize];
    for j in all {
        if let Some([x, y]) = j.at {
            let slot = &mut blocks[(y / block * columns + x / block) as usize];
            if j.z.abs() > slot.abs() {
                *slot = j.z;
            }
        }
    }
    let at = |i: usize| {
        let (x, y) = (i as u32 % width, i as u32 / width);
        blocks[(y / block * columns + x / block) as usize] as f32
    };
    let values = (0..width as usize * height as usize).map(at).collect();
    ErrorMap { width, height, values, colours: Colours::CoolWarm, top: Some(MAP_TOP) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::{normal, pcg4d, unit};

    const SIZE: [u32; 2] = [70, 50];

    /// Slopes of light under normal noise, and the variance of that.
    fn estimate(seed: u32, sigma: f32, change: impl Fn(u32, u32) -> f32) -> (Image, Image) {
        let image = Image::from_fn(SIZE[0], SIZE[1], |x, y| {
            [0, 1, 2].map(|c| {
                let w = pcg4d([x, y, c, seed]);
                (0.2 + x as f32 / 70.0) * change(x, y) + sigma * normal([unit(w[0]), unit(w[1])])
            })
        });
        (image, Image::from_fn(SIZE[0], SIZE[1], |_, _| [sigma * sigma; 3]))
    }

    fn against(a: &(Image, Image), b: &(Image, Image)) -> Agreement {
        let [a, b] = [a, b].map(|(mean, variance)| Estimate { mean, variance });
        agree(a, b, 0.01)
    }

    #[test]
    fn noise_alone_raises_no_more_alarms_than_stated() {
        let alarm = |seed: &u32| {
            let pair = [0, 1].map(|i| estimate(2 * seed + i, 0.05, |_, _| 1.0));
            !against(&pair[0], &pair[1]).agrees()
        };
        // 100 pairs at 1 %: 1 is expected, and more than 6 have a probability below 1e-4.
        let alarms = (0..100).filter(alarm).count();
        assert!(alarms <= 6, "{alarms} of 100");
    }

    #[test]
    fn a_corner_that_differs_is_found_shown_and_said() {
        let first = estimate(1, 0.05, |_, _| 1.0);
        let second = estimate(2, 0.05, |x, y| if x >= 60 && y < 12 { 1.05 } else { 1.0 });
        let found = against(&first, &second);
        assert!(!found.agrees());
        assert!(found.differing.iter().all(|j| j.at == Some([60, 0])), "{:?}", found.differing);
        assert!(found.describe().contains("most at column 60, row 0 (z = -"), "{}", found.describe());
        let (x, y, z) = found.map.worst().unwrap();
        assert!((60..70).contains(&x) && y < 12 && z < -4.0, "{x} {y} {z}");
        assert!(found.map.values[0].abs() < 5.0);
    }

    #[test]
    fn a_small_difference_everywhere_is_found_by_the_sums() {
        let found = against(&estimate(3, 0.05, |_, _| 1.0), &estimate(4, 0.05, |_, _| 1.01));
        assert!(found.whole_differs, "{}", found.describe());
        assert!((found.ratio - 0.99).abs() < 0.006 && found.ratio_error < 0.002);
        let same = against(&estimate(3, 0.05, |_, _| 1.0), &estimate(4, 0.05, |_, _| 1.0));
        assert!(same.agrees() && same.describe().starts_with("none of "), "{}", same.describe());
    }

    #[test]
    fn black_pictures_cannot_be_compared_and_light_in_the_dark_is_shown() {
        let black = (Image::new(70, 50), Image::new(70, 50));
        let found = against(&black, &black);
        assert!(found.agrees() && found.comparisons == 0);
        assert!(found.describe().contains("too little light"));
        let lit = estimate(5, 0.05, |_, _| 1.0);
        let found = against(&lit, &black);
        assert!(!found.agrees() && found.describe().contains("dark rest"), "{}", found.describe());
        assert!(found.map.values.iter().all(|z| *z > 10.0));
    }
}
