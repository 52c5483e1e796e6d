//! Integrators that gather photons, which are consistent but biased, against radiance known in
//! closed form. Their pictures may differ from it by [`BOUND`] besides noise, which is estimated
//! from [`PARTS`] pictures with different seeds, since their pixels have common noise. They take
//! part in no check that tests for equal expectations.

use std::rc::Rc;
use std::sync::Arc;

use serde_json::json;

use super::analytic::{known_scenes, truth};
use super::picture::{NoisyPicture, Setting, render};
use super::technique::Technique;
use super::{Check, Outcome, SIGNIFICANCE, SeedFamily, Verdict, VerifyRequest};
use lumbre_light::math::stats::sidak;
use lumbre_light::math::t_test::two_sided_p;
use lumbre_light::scene::{CompiledScene, compile};
use lumbre_light::transport::integrator::{IntegratorRow, integrators, settings};
use lumbre_light::value::Value;

/// Largest difference of the ratio of means from one that the bias may cause.
const BOUND: f64 = 0.02;

/// Number of pictures from which the noise is estimated.
const PARTS: u64 = 8;

/// Radius within which photons are gathered, in scene units: at most a fiftieth of the scenes.
const RADIUS: f64 = 0.02;

/// Number of photons of each sample.
const PHOTONS: i64 = 20_000;

/// Samples per pixel of each picture; a quick run uses a quarter of them.
const SAMPLES: u64 = 16;

/// Width and height of the pictures in pixels.
const SIDE: u32 = 16;

/// Lists the checks of integrators that are not unbiased.
///
/// # Errors
/// Never: the scenes of the module `analytic` compile.
pub fn plan(request: &VerifyRequest) -> Result<Vec<Check>, String> {
    let mut checks = Vec::new();
    for case in known_scenes() {
        let (scene, _) = compile(&case.scene).map_err(|e| format!("{}: {e}", case.name))?;
        let scene = Arc::new(scene);
        let truth = Rc::new(truth(&case, SIDE));
        for row in integrators().filter(|row| gathers(row)) {
            let precise = [
                (settings::RADIUS.key, Value::Num(RADIUS)),
                (settings::PHOTONS.key, Value::Int(PHOTONS)),
            ];
            let technique = Technique {
                row,
                params: precise.map(|(key, n)| (key.to_owned(), n)).into(),
            };
            let setting = Setting {
                resolution: [SIDE; 2],
                max_depth: case.max_depth,
                samples: if request.quick { SAMPLES / 4 } else { SAMPLES },
                seed: request.seed(SeedFamily::Consistent, checks.len() * PARTS as usize),
                threads: request.threads,
                ..Setting::PLAIN
            };
            let compared = format!("{technique} with {}, within {BOUND}", case.formula);
            let (scene, truth) = (Arc::clone(&scene), Rc::clone(&truth));
            checks.push(Check::new(case.name, compared, move |tests| {
                Ok(Ratio::measure(&scene, &technique, setting, &truth)?.outcome(tests))
            }));
        }
    }
    Ok(checks)
}

/// Returns whether an integrator gathers photons, which is the source of its bias.
fn gathers(row: &IntegratorRow) -> bool {
    let has = |key: &str| row.params.fields.iter().any(|field| field.key == key);
    row.bias.is_some() && has(settings::RADIUS.key) && has(settings::PHOTONS.key)
}

/// Ratio of the means of rendered and exact pictures.
struct Ratio {
    mean: f64,
    /// Standard error of the mean.
    error: f64,
}

impl Ratio {
    /// Renders all parts and compares each with the truth.
    fn measure(
        scene: &Arc<CompiledScene>,
        technique: &Technique,
        setting: Setting,
        truth: &NoisyPicture,
    ) -> Result<Ratio, String> {
        let part = |part| {
            let seed = setting.seed.wrapping_add(part);
            let picture = render(scene, technique, Setting { seed, ..setting })?;
            Ok(picture.total().0 / truth.total().0)
        };
        let ratios: Vec<f64> = (0..PARTS).map(part).collect::<Result<_, String>>()?;
        let n = PARTS as f64;
        let mean = ratios.iter().sum::<f64>() / n;
        let squares: f64 = ratios.iter().map(|r| (r - mean) * (r - mean)).sum();
        Ok(Ratio {
            mean,
            error: (squares / (n - 1.0) / n).sqrt(),
        })
    }

    /// Returns the verdict, as one of `tests` tests.
    fn outcome(&self, tests: usize) -> Outcome {
        let beyond = ((self.mean - 1.0).abs() - BOUND).max(0.0);
        let p = if beyond == 0.0 {
            1.0
        } else {
            two_sided_p(beyond / self.error, PARTS as f64 - 1.0)
        };
        let level = sidak(SIGNIFICANCE, tests);
        Outcome {
            // A difference far beyond the noise is one, however large the noise is.
            verdict: if p <= level {
                Verdict::Failed
            } else if self.error > BOUND {
                Verdict::Skipped
            } else {
                Verdict::Passed
            },
            statement: format!(
                "ratio {:.4} ± {:.4} of {PARTS} pictures, allowed {BOUND}, p = {p:.1e}, level \
                 {level:.1e}",
                self.mean, self.error
            ),
            figures: json!({
                "ratio": self.mean, "ratio_error": self.error, "bound": BOUND, "p": p,
                "level": level,
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bias_within_the_bound_passes_and_one_beyond_it_fails() {
        let verdict = |mean, error| Ratio { mean, error }.outcome(20).verdict;
        assert_eq!(verdict(0.985, 0.001), Verdict::Passed);
        assert_eq!(verdict(0.97, 0.01), Verdict::Passed);
        assert_eq!(verdict(0.97, 0.0005), Verdict::Failed);
        assert_eq!(verdict(1.1, 0.0), Verdict::Failed);
        assert_eq!(verdict(1.0, 0.03), Verdict::Skipped);
        assert_eq!(verdict(45.0, 0.6), Verdict::Failed);
    }
}
