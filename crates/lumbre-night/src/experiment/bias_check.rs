//! The bias check: a statistical comparison of a reference with the same picture by a second
//! technique.
//!
//! The pictures are compared block by block ([`ztest`]). The false discovery rate of the blocks
//! reported as different is limited ([`discoveries`]); if the pictures agree, this rate is also the
//! greatest probability of a false alarm. The noise of both pictures limits what can be detected,
//! so the result includes the precision of the comparison.

use lumbre_light::film::Image;
use lumbre_light::film::ztest::{self, Blocks, Estimate, Judged};
use lumbre_light::math::false_discovery_rate::discoveries;
use lumbre_light::math::stats::normal_two_sided_p;
use lumbre_light::math::t_test::two_sided_t;
use lumbre_metrics::map::{Colours, ErrorMap};

/// Side of a block in pixels; small pictures use smaller blocks.
const BLOCK: u32 = 16;

/// Number of light contributions from which a sum over pixels is taken to be normally distributed.
const MIN_CONTRIBUTIONS: f64 = 50.0;

/// Standard normal deviate at which the colour scale of the map ends.
pub const MAP_TOP: f32 = 6.0;

/// Result of comparing a reference with the picture of a second technique.
#[derive(Clone, Debug, PartialEq)]
pub struct BiasCheckResult {
    /// Number of comparisons: blocks times channels, and the three channels of the whole picture.
    pub comparisons: usize,
    /// Blocks that differ, least p-value first.
    pub differing: Vec<Judged>,
    /// Whether the sums over the whole pictures differ.
    pub whole_differs: bool,
    /// Whether these sums were compared: not where a few pixels have most of the noise.
    pub is_whole_judged: bool,
    /// False discovery rate of the comparison.
    pub rate: f64,
    /// Sum of the reference over that of the second picture.
    pub ratio: f64,
    /// Standard error of the ratio, assuming fully correlated noise of the channels.
    pub ratio_error: f64,
    /// Greatest deviate over the channels of each block, at each of its pixels. Dark blocks are
    /// shown too, although each alone has too little light to be tested.
    pub map: ErrorMap,
}

impl BiasCheckResult {
    /// Whether no comparison found a difference.
    pub fn agrees(&self) -> bool {
        self.differing.is_empty() && !self.whole_differs
    }

    /// Returns the least relative bias of the total light that a comparison of this precision finds
    /// with a probability of 80 %, if the whole pictures are compared.
    pub fn least_bias(&self) -> f64 {
        // 0.84 is the deviate that 80 % of normal numbers are below.
        let level = self.rate / self.comparisons.max(1) as f64;
        (normal_quantile(level) + 0.84) * self.ratio_error / self.ratio
    }

    /// Describes the result in one sentence. The interval of the ratio is a 95 % confidence
    /// interval.
    pub fn describe(&self) -> String {
        let half = normal_quantile(0.05) * self.ratio_error;
        let ratio = format!("ratio {:.4} ± {half:.4}", self.ratio);
        if self.comparisons == 0 {
            return "too little light was found to compare the pictures".to_owned();
        }
        let level = format!("false discovery rate {}", self.rate);
        if self.agrees() {
            let missed = if self.is_whole_judged {
                let least = 100.0 * self.least_bias();
                format!("a bias of the total light below {least:.2} % may be missed")
            } else {
                "few pixels have most of the noise, so a small bias of the total light may be missed"
                    .to_owned()
            };
            return format!(
                "none of {} comparisons differs ({ratio}, {missed}, {level})",
                self.comparisons
            );
        }
        let place = match self.differing.first() {
            Some(Judged {
                at: Some([x, y]),
                z,
                ..
            }) => format!(", most at column {x}, row {y} (z = {z:.1})"),
            Some(Judged { at: None, z, .. }) => {
                format!(", most in the dark blocks together (z = {z:.1})")
            }
            None => String::new(),
        };
        let count = self.differing.len() + usize::from(self.whole_differs);
        format!(
            "{count} of {} comparisons differ{place} ({ratio}, {level})",
            self.comparisons
        )
    }
}

/// Compares a reference with the picture of a second technique. Both must have the same size and
/// come with the variance of their pixels' means. `rate` is the false discovery rate in (0, 1).
///
/// # Panics
/// If the sizes differ.
pub fn check_bias(reference: Estimate, second: Estimate, rate: f64) -> BiasCheckResult {
    let [width, height] = [reference.mean.width, reference.mean.height];
    // Small pictures use smaller blocks, so that there are at least a few.
    let block = BLOCK.min((width.min(height) / 4).max(1));
    let contribution = typical_contribution(reference).max(typical_contribution(second));
    // A black block cannot be tested, even without noise.
    let enough = (MIN_CONTRIBUTIONS * contribution).max(f64::MIN_POSITIVE);
    let Blocks {
        judged,
        dark,
        whole,
        ratio,
    } = ztest::blocks(reference, second, block, enough);
    let [(a, ea), (b, eb)] = [reference, second].map(total);
    // The whole picture is tested only if it has enough light.
    let judged_whole = a.max(b) >= enough;
    let whole_p = whole.into_iter().flatten().map(normal_two_sided_p);
    let p: Vec<f64> = judged
        .iter()
        .map(|j| j.p)
        .chain(whole_p.filter(|_| judged_whole))
        .collect();
    let found = discoveries(&p, rate);
    let mut differing: Vec<Judged> = judged
        .iter()
        .zip(&found)
        .filter(|(_, d)| **d)
        .map(|(j, _)| *j)
        .collect();
    differing.sort_by(|a, b| a.p.total_cmp(&b.p));
    BiasCheckResult {
        comparisons: p.len(),
        whole_differs: found[judged.len()..].contains(&true),
        is_whole_judged: found.len() > judged.len(),
        map: map([width, height], block, judged.iter().chain(&dark)),
        differing,
        rate,
        ratio,
        ratio_error: ratio * (ea / a).hypot(eb / b),
    }
}

/// Returns the standard normal deviate whose two-sided p-value this is.
fn normal_quantile(p: f64) -> f64 {
    two_sided_t(p, 1e9)
}

/// Typical contribution of one sample with light to a pixel's mean. A sum of n rare contributions
/// of size c has mean n c and variance n c², so their quotient is c.
fn typical_contribution(estimate: Estimate) -> f64 {
    let [mean, variance] =
        [estimate.mean, estimate.variance].map(|image| image.mean().iter().sum::<f64>());
    if mean > 0.0 { variance / mean } else { 0.0 }
}

/// Sum over all pixels and channels, and its standard error assuming fully correlated channels.
fn total(estimate: Estimate) -> (f64, f64) {
    let pixels = estimate.mean.data.len() as f64;
    let sum = |image: &Image| image.mean().map(|mean| mean * pixels);
    (
        sum(estimate.mean).iter().sum(),
        sum(estimate.variance).map(f64::sqrt).iter().sum(),
    )
}

/// Map of the greatest deviate of each block.
fn map<'a>(
    [width, height]: [u32; 2],
    block: u32,
    all: impl Iterator<Item = &'a Judged>,
) -> ErrorMap {
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
    ErrorMap {
        width,
        height,
        values,
        colours: Colours::CoolWarm,
        top: Some(MAP_TOP),
    }
}

#[cfg(test)]
mod tests {
    use crate::experiment::bias_check::*;
    use lumbre_light::math::rng::{normal, pcg4d, unit};

    const SIZE: [u32; 2] = [70, 50];

    /// A horizontal gradient with normal noise, and the variance of that noise.
    fn estimate(seed: u32, sigma: f32, change: impl Fn(u32, u32) -> f32) -> (Image, Image) {
        let image = Image::from_fn(SIZE[0], SIZE[1], |x, y| {
            [0, 1, 2].map(|c| {
                let w = pcg4d([x, y, c, seed]);
                (0.2 + x as f32 / 70.0) * change(x, y) + sigma * normal([unit(w[0]), unit(w[1])])
            })
        });
        (
            image,
            Image::from_fn(SIZE[0], SIZE[1], |_, _| [sigma * sigma; 3]),
        )
    }

    fn against(a: &(Image, Image), b: &(Image, Image)) -> BiasCheckResult {
        let [a, b] = [a, b].map(|(mean, variance)| Estimate { mean, variance });
        check_bias(a, b, 0.01)
    }

    #[test]
    fn noise_alone_raises_no_more_alarms_than_the_rate() {
        let alarm = |seed: &u32| {
            let pair = [0, 1].map(|i| estimate(2 * seed + i, 0.05, |_, _| 1.0));
            !against(&pair[0], &pair[1]).agrees()
        };
        // 100 pairs at 1 %: 1 is expected, and more than 6 have a probability below 1e-4.
        let alarms = (0..100).filter(alarm).count();
        assert!(alarms <= 6, "{alarms} of 100");
    }

    #[test]
    fn a_corner_that_differs_is_found_mapped_and_described() {
        let first = estimate(1, 0.05, |_, _| 1.0);
        let second = estimate(2, 0.05, |x, y| if x >= 60 && y < 12 { 1.05 } else { 1.0 });
        let found = against(&first, &second);
        assert!(!found.agrees());
        assert!(
            found.differing.iter().all(|j| j.at == Some([60, 0])),
            "{:?}",
            found.differing
        );
        assert!(
            found.describe().contains("most at column 60, row 0 (z = -"),
            "{}",
            found.describe()
        );
        let (x, y, z) = found.map.worst().unwrap();
        assert!((60..70).contains(&x) && y < 12 && z < -4.0, "{x} {y} {z}");
        assert!(found.map.values[0].abs() < 5.0);
    }

    #[test]
    fn a_small_difference_everywhere_is_found_by_the_sums() {
        let found = against(
            &estimate(3, 0.05, |_, _| 1.0),
            &estimate(4, 0.05, |_, _| 1.01),
        );
        assert!(found.whole_differs, "{}", found.describe());
        assert!((found.ratio - 0.99).abs() < 0.006 && found.ratio_error < 0.002);
        let sums_alone = BiasCheckResult {
            differing: Vec::new(),
            ..found
        };
        assert!(!sums_alone.agrees());
        assert!(sums_alone.describe().starts_with("1 of "));
        let same = against(
            &estimate(3, 0.05, |_, _| 1.0),
            &estimate(4, 0.05, |_, _| 1.0),
        );
        assert!(
            same.agrees() && same.describe().starts_with("none of "),
            "{}",
            same.describe()
        );
    }

    #[test]
    fn black_pictures_cannot_be_compared_and_light_against_black_is_found() {
        let black = (Image::new(70, 50), Image::new(70, 50));
        let found = against(&black, &black);
        assert!(found.agrees() && found.comparisons == 0);
        assert!(found.describe().contains("too little light"));
        let lit = estimate(5, 0.05, |_, _| 1.0);
        let found = against(&lit, &black);
        assert!(
            !found.agrees() && found.describe().contains("dark blocks together"),
            "{}",
            found.describe()
        );
        assert!(found.map.values.iter().all(|z| *z > 10.0));
    }
}
