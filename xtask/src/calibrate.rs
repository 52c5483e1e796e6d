//! `cargo xtask calibrate`: how often the claims of comparisons are false, measured on nights of
//! which the truth is known.
//!
//! A night is made of pictures: those of several techniques, each with repeats, whose noise is
//! drawn from a known distribution, and two halves of a reference. Errors, noise floors and claims
//! are computed from them by the code that real nights use. All techniques of a night have noise of
//! one kind, scaled, so the ratio of their median errors at equal time is the square of the scale.

use std::fmt;

use lumbre_light::film::Image;
use lumbre_light::math::stats::median;
use lumbre_metrics::MetricSpec;
use lumbre_metrics::floor::Halves;
use lumbre_report::comparison::{Comparison, LEVEL, Score, ScoreScale};
use rayon::prelude::*;

use crate::random::Random;

/// Side of a picture in pixels.
const SIDE: u32 = 32;

/// Radiance of the true picture everywhere.
const TRUTH: f32 = 0.5;

/// Page of the book that has the table, from [`BEGIN`] on.
const PAGE: &str = "docs/reference/verdicts.md";

/// Line of the page after which the table is.
const BEGIN: &str = "<!-- Made by `cargo xtask calibrate --write`. -->\n";

/// Arguments of `calibrate`.
#[derive(clap::Args)]
pub struct Args {
    /// Nights for each line of the table
    #[arg(long, default_value_t = 1000)]
    nights: u32,
    /// Write the table into the page of the book
    #[arg(long)]
    write: bool,
}

/// Prints the table.
///
/// # Errors
/// Returns a message if the page cannot be written.
pub fn run(args: &Args) -> Result<(), String> {
    let mut table = HEADER.to_owned();
    println!("{HEADER}");
    for setup in setups() {
        let row = Rates::measure(&setup, args.nights).row(&setup);
        println!("{row}");
        table += &format!("\n{row}");
    }
    if !args.write {
        return Ok(());
    }
    let page = crate::root().join(PAGE);
    let text = std::fs::read_to_string(&page).map_err(|e| format!("{PAGE}: {e}"))?;
    let (before, rest) = text
        .split_once(BEGIN)
        .ok_or("the page has no place for the table")?;
    let after = rest.find("\n\n## ").map_or("", |end| &rest[end..]);
    let (nights, version) = (args.nights, env!("CARGO_PKG_VERSION"));
    let text = format!(
        "{before}{BEGIN}{table}\n\n({nights} nights for each line, version {version}.){after}"
    );
    std::fs::write(&page, text).map_err(|e| format!("{PAGE}: {e}"))
}

const HEADER: &str = "\
| noise | techniques | repeats | true ratio | noise of the reference | all intervals true | false claims \
| found | refused | width |
|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|";

/// Returns the lines of the table.
fn setups() -> Vec<Setup> {
    let of = |noise: Noise| {
        let setup = Setup {
            noise,
            ..Setup::NULL
        };
        let equal = |arms, repeats, floor| Setup {
            arms,
            repeats,
            floor,
            ..setup
        };
        let differ = |arms, ratio, floor| Setup {
            arms,
            ratio,
            floor,
            ..setup
        };
        let on = |machine| Setup {
            machine,
            ..equal(2, 5, 0.0)
        };
        [
            equal(2, 5, 0.0),
            equal(2, 16, 0.33),
            equal(5, 5, 0.33),
            equal(9, 5, 0.33),
            equal(9, 16, 0.33),
            differ(3, 1.2, 0.0),
            differ(3, 2.0, 0.0),
            differ(3, 4.0, 0.0),
            differ(2, 4.0, 0.01),
            differ(2, 4.0, 0.5),
            differ(2, 4.0, 0.9),
            Setup {
                repeats: 3,
                ..differ(2, 2.0, 0.0)
            },
            Setup {
                machine: Machine::Drifts,
                ..differ(2, 2.0, 0.0)
            },
            on(Machine::Shared),
            on(Machine::SharedInSequence),
        ]
    };
    let all = [
        Noise::Gauss,
        Noise::Fireflies,
        Noise::Pareto25,
        Noise::Pareto15,
    ];
    all.into_iter().flat_map(of).collect()
}

/// Distribution of the noise of one value of a picture; symmetric, with mean 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Noise {
    /// Normal.
    Gauss,
    /// Normal, with one value in two thousand a thousand times as large in its square.
    Fireflies,
    /// Pareto with the tail index 2.5: the mean of squared errors exists, its variance does not.
    Pareto25,
    /// Pareto with the tail index 1.5: no mean of squared errors exists.
    Pareto15,
}

impl fmt::Display for Noise {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Noise::Gauss => "Gauss",
            Noise::Fireflies => "fireflies",
            Noise::Pareto25 => "Pareto 2.5",
            Noise::Pareto15 => "Pareto 1.5",
        })
    }
}

impl Noise {
    fn draw(self, random: &mut Random) -> f64 {
        let pareto = |random: &mut Random, index: f64| {
            let sign = if unit(random) < 0.5 { -1.0 } else { 1.0 };
            sign * (unit(random).powf(-1.0 / index) - 1.0)
        };
        match self {
            Noise::Gauss => normal(random),
            Noise::Fireflies => {
                let bright = unit(random) < 1.0 / 2000.0;
                normal(random) * if bright { 1000f64.sqrt() } else { 1.0 }
            }
            Noise::Pareto25 => pareto(random, 2.5),
            Noise::Pareto15 => pareto(random, 1.5),
        }
    }

    /// Draws a picture of the truth with noise of this scale, averaged over so many samples.
    fn picture(self, random: &mut Random, scale: f64, samples: u32) -> Image {
        let mut value = || {
            let sum: f64 = (0..samples).map(|_| self.draw(random)).sum();
            TRUTH + (scale * sum / f64::from(samples)) as f32
        };
        let data = (0..SIDE * SIDE)
            .map(|_| [value(), value(), value()])
            .collect();
        Image {
            width: SIDE,
            height: SIDE,
            data,
        }
    }
}

/// Returns a number in (0, 1].
fn unit(random: &mut Random) -> f64 {
    const STEPS: usize = 1 << 53;
    (random.below(STEPS) + 1) as f64 / STEPS as f64
}

/// Returns a standard normal number [Box and Muller 1958].
fn normal(random: &mut Random) -> f64 {
    let radius = (-2.0 * unit(random).ln()).sqrt();
    radius * (std::f64::consts::TAU * unit(random)).cos()
}

/// What is true of the nights of one line.
#[derive(Clone, Copy, Debug)]
struct Setup {
    noise: Noise,
    /// Number of techniques. The second has `ratio` times the error of the first, and so on in
    /// turn.
    arms: usize,
    repeats: u32,
    ratio: f64,
    /// Share of the noise of the reference in the measured error of the best.
    floor: f64,
    /// What else happens on the machine.
    machine: Machine,
}

/// What else happens on the machine of a night.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Machine {
    /// Nothing.
    Quiet,
    /// The logarithm of its speed has the standard deviation 0.5 over repeats. Techniques take
    /// turns within a repeat.
    Drifts,
    /// Another program halves its speed for a quarter of the night. Techniques take turns.
    Shared,
    /// Another program halves its speed for a quarter of the night, and runs follow one another.
    SharedInSequence,
}

impl Machine {
    /// Returns the speed in each run of a night, by technique and repeat.
    fn speeds(self, random: &mut Random, arms: usize, repeats: u32) -> Vec<Vec<f64>> {
        let start = unit(random) * 0.75;
        // Share of the time from `from` to `to` in which the other program runs.
        let shared = |from: f64, to: f64| {
            let both = to.min(start + 0.25) - from.max(start);
            1.0 - 0.5 * both.max(0.0) / (to - from)
        };
        let runs = arms * repeats as usize;
        let drifts: Vec<f64> = (0..repeats).map(|_| (0.5 * normal(random)).exp()).collect();
        let speed = |arm: usize, repeat: usize| match self {
            Machine::Quiet => 1.0,
            Machine::Drifts => drifts[repeat],
            Machine::Shared => {
                let turn = 1.0 / f64::from(repeats);
                shared(repeat as f64 * turn, (repeat + 1) as f64 * turn)
            }
            Machine::SharedInSequence => {
                let (turn, run) = (1.0 / runs as f64, arm * repeats as usize + repeat);
                shared(run as f64 * turn, (run + 1) as f64 * turn)
            }
        };
        let of_arm = |arm| {
            (0..repeats as usize)
                .map(|repeat| speed(arm, repeat))
                .collect()
        };
        (0..arms).map(of_arm).collect()
    }
}

impl fmt::Display for Machine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Machine::Quiet => "",
            Machine::Drifts => ", speed drifts",
            Machine::Shared => ", other work",
            Machine::SharedInSequence => ", other work, `sequential`",
        })
    }
}

impl Setup {
    const NULL: Setup = Setup {
        noise: Noise::Gauss,
        arms: 2,
        repeats: 5,
        ratio: 1.0,
        floor: 0.0,
        machine: Machine::Quiet,
    };

    /// Returns the true ratio of a technique's error to that of the first.
    fn truth(&self, arm: usize) -> f64 {
        if arm % 2 == 1 { self.ratio } else { 1.0 }
    }

    /// Compares the techniques of one night. `error` is the median error of the first against the
    /// truth, `noise` that of the mean of a reference's samples.
    fn night(&self, random: &mut Random, [error, noise]: [f64; 2]) -> Comparison {
        let metric = metric();
        let samples = REFERENCE_SAMPLES / 2;
        let scale = (self.floor / (1.0 - self.floor) * error / noise).sqrt();
        let halves = [0; 2].map(|_| self.noise.picture(random, scale, samples));
        let mut reference = halves[0].clone();
        for (pixel, other) in reference.data.iter_mut().zip(&halves[1].data) {
            *pixel = [0, 1, 2].map(|c| 0.5 * (pixel[c] + other[c]));
        }
        let halves = Halves {
            means: [&halves[0], &halves[1]],
            samples: [u64::from(samples); 2],
        };
        let floor = metric.floor(&reference, halves).ok().flatten();
        let floor = floor.filter(|_| self.floor > 0.0);
        let speeds = self.machine.speeds(random, self.arms, self.repeats);
        let mut arms = vec![Vec::new(); self.arms];
        for repeat in 0..self.repeats {
            for (arm, scores) in arms.iter_mut().enumerate() {
                let scale = (self.truth(arm) / speeds[arm][repeat as usize]).sqrt();
                let picture = self.noise.picture(random, scale, 1);
                let error = metric.eval(&picture, &reference).unwrap_or(f64::NAN);
                let at_noise = metric.net_at_noise(error, floor).map(f64::ln);
                scores.push(Score { repeat, at_noise });
            }
        }
        Comparison::new(&arms, ScoreScale::Logarithm).expect("several techniques have results")
    }
}

/// Samples of a reference in units of one sample of a technique's picture.
const REFERENCE_SAMPLES: u32 = 16;

fn metric() -> MetricSpec {
    MetricSpec::new("mse", "mse", Default::default()).expect("the metric exists")
}

/// Returns the median errors against the truth of pictures of one sample and of a reference, whose
/// noise has the scale 1.
fn median_errors(noise: Noise) -> [f64; 2] {
    let (metric, truth) = (metric(), Image::from_fn(SIDE, SIDE, |_, _| [TRUTH; 3]));
    [1, REFERENCE_SAMPLES].map(|samples| {
        let error = |seed: u32| {
            let picture = noise.picture(&mut Random::new([seed, samples, 0]), 1.0, samples);
            metric.eval(&picture, &truth).unwrap_or(f64::NAN)
        };
        median((0..400).into_par_iter().map(error).collect::<Vec<f64>>())
    })
}

/// What was claimed of the nights of one line.
#[derive(Clone, Copy, Debug, Default)]
struct Rates {
    /// Share of the nights that are not refused in which all intervals contain the truth.
    coverage: f64,
    /// Share of all nights with a p-value below 5 % for a pair of equals, or for the wrong order, or
    /// with a winner that is none.
    false_claims: f64,
    /// Share of all nights in which the best is significantly better than each technique that is truly worse.
    found: f64,
    /// Share of the nights in which some pair has no interval.
    refused: f64,
    /// Median of the upper end of an interval over its lower end.
    width: f64,
}

impl Rates {
    fn measure(setup: &Setup, nights: u32) -> Rates {
        let errors = median_errors(setup.noise);
        let night = |seed: u32| {
            let mut random = Random::new([seed, 0, 1]);
            setup.night(&mut random, errors)
        };
        let nights: Vec<Comparison> = (0..nights).into_par_iter().map(night).collect();
        let share = |count: usize, of: usize| count as f64 / of.max(1) as f64;
        let is_refused = |night: &&Comparison| {
            night
                .contrasts
                .iter()
                .flatten()
                .any(|c| c.interval.is_none())
        };
        let judged: Vec<&Comparison> = nights.iter().filter(|n| !is_refused(n)).collect();
        let pairs = |night: &Comparison| -> Vec<_> {
            let best = setup.truth(night.best);
            let contrasts = night.contrasts.iter().enumerate();
            contrasts
                .filter_map(|(arm, contrast)| Some(((setup.truth(arm) / best).ln(), (*contrast)?)))
                .collect()
        };
        let is_true = |night: &&&Comparison| {
            let mut pairs = pairs(night).into_iter();
            pairs.all(|(truth, contrast)| {
                contrast
                    .interval
                    .is_some_and(|[low, high]| (low..=high).contains(&truth))
            })
        };
        let is_false = |night: &&Comparison| {
            let mut pairs = pairs(night).into_iter();
            pairs.any(|(truth, contrast)| contrast.p < LEVEL && truth <= 0.0)
        };
        let is_found = |night: &&Comparison| {
            let mut worse = pairs(night).into_iter().filter(|(truth, _)| *truth != 0.0);
            setup.truth(night.best) == 1.0 && worse.all(|(_, c)| c.is_significant())
        };
        let widths = nights
            .iter()
            .flat_map(|night| night.contrasts.iter().flatten());
        let widths = widths.filter_map(|c| c.interval.map(|[low, high]| (high - low).exp()));
        Rates {
            coverage: share(judged.iter().filter(is_true).count(), judged.len()),
            false_claims: share(nights.iter().filter(is_false).count(), nights.len()),
            found: share(nights.iter().filter(is_found).count(), nights.len()),
            refused: share(nights.len() - judged.len(), nights.len()),
            width: median(widths),
        }
    }

    /// Formats the rates as a row of the table.
    fn row(&self, setup: &Setup) -> String {
        let percent = |share: f64| format!("{:.1} %", 100.0 * share);
        let found = if setup.ratio == 1.0 {
            "–".to_owned()
        } else {
            percent(self.found)
        };
        format!(
            "| {}{} | {} | {} | {} | {:.0} % | {} | {} | {found} | {} | {:.2} |",
            setup.noise,
            setup.machine,
            setup.arms,
            setup.repeats,
            setup.ratio,
            100.0 * setup.floor,
            percent(self.coverage),
            percent(self.false_claims),
            percent(self.refused),
            self.width,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With 200 nights a rate of 95 % is measured as less than 90 % once in 500 times, and a rate of
    /// 5 % as more than 10 % as rarely.
    #[test]
    fn claims_are_false_in_at_most_one_night_in_twenty() {
        for noise in [Noise::Gauss, Noise::Fireflies, Noise::Pareto25] {
            for (arms, repeats, ratio, floor) in
                [(2, 5, 1.0, 0.0), (9, 5, 1.0, 0.33), (5, 16, 2.0, 0.33)]
            {
                let setup = Setup {
                    noise,
                    arms,
                    repeats,
                    ratio,
                    floor,
                    machine: Machine::Quiet,
                };
                let rates = Rates::measure(&setup, 200);
                assert!(rates.coverage >= 0.90, "{setup:?}: {rates:?}");
                assert!(rates.false_claims <= 0.10, "{setup:?}: {rates:?}");
                assert!(rates.refused <= 0.10, "{setup:?}: {rates:?}");
            }
        }
    }

    #[test]
    fn pairs_take_out_the_drift_of_the_machine() {
        let quiet = Rates::measure(
            &Setup {
                ratio: 2.0,
                ..Setup::NULL
            },
            100,
        );
        let drifting = Rates::measure(
            &Setup {
                ratio: 2.0,
                machine: Machine::Drifts,
                ..Setup::NULL
            },
            100,
        );
        assert!(
            quiet.found == 1.0 && drifting.found == 1.0,
            "{quiet:?} {drifting:?}"
        );
        let ratio = drifting.width.ln() / quiet.width.ln();
        assert!((0.8..1.25).contains(&ratio), "{ratio}");
    }
}
