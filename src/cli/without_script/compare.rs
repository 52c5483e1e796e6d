//! `lumbre compare`: compares techniques on one scene, and says which is more efficient.

use std::path::{Path, PathBuf};

use serde_json::json;

use super::experiment_text::{experiment_name, reference_technique, script_text};
use super::verdict::{RunEfficiency, TechniqueResults, Verdict, verdicts};
use crate::cli::args::{CompareArgs, ComparisonArgs, Global, RunArgs};
use crate::cli::exit::{Exit, Failure, print_result, print_status};
use crate::cli::format::{display_path, rounded};
use crate::cli::inspect::report::read_picture;
use crate::cli::night::last_command::latest;
use crate::cli::night::log::Log;
use crate::cli::night::run;
use lumbre_light::transport::integrator::bias_of;
use lumbre_metrics::MetricSpec;
use lumbre_night::experiment::WaveRow;
use lumbre_night::experiment::night::Night;
use lumbre_night::experiment::night::reference::biased_reference;
use lumbre_night::experiment::night::run::{Run, efficiency};
use lumbre_night::store::read::night::read_night;
use lumbre_night::store::{self, Evidence};
use lumbre_report::clock;
use lumbre_report::common_error;
use lumbre_report::lanes::mixed_lanes;
use lumbre_report::metric_display::MetricDisplay;
use lumbre_report::repeats::MetricCurve;

/// Metric by which techniques are compared.
const METRIC: &str = "relmse";

/// Share of the error of a run that the noise of the reference may make up without a warning.
const MAX_FLOOR_SHARE: f64 = 0.5;

/// Runs `lumbre compare`: writes a script, runs it, and prints a verdict.
pub fn main(args: &CompareArgs, global: &Global, log: &Log) -> Result<Exit, Failure> {
    let comparison = &args.comparison;
    let folder = global.out.join("scripts");
    let script: PathBuf = folder.join(format!("{}.lua", experiment_name(comparison)));
    let text = script_text(comparison, &display_path(&script))?;
    std::fs::create_dir_all(&folder)
        .map_err(|e| Failure::usage(format!("cannot create {}: {e}", folder.display())))?;
    store::write_atomically(&script, text.as_bytes()).map_err(Failure::internal)?;
    let request = RunArgs {
        script: Some(script.clone()),
        without_tables: args.json,
        ..RunArgs::default()
    };
    let exit = run::main(&request, global, log)?;
    if exit != Exit::Done {
        return Ok(exit);
    }
    let evidence = Evidence::default();
    let night = read_night(&latest(&global.out)?, &evidence).map_err(Failure::internal)?;
    let results = efficiencies(&night, &comparison.techniques);
    let found = verdicts(&results);
    let caveats = caveats(&night, comparison, &found, &evidence);
    let problems = evidence.problems();
    for problem in &problems {
        print_status(&format!("left out: {problem}"));
    }
    let mut lines: Vec<String> = found.iter().map(sentence).collect();
    lines.extend(caveats.iter().map(|caveat| format!("warning: {caveat}")));
    lines.push(format!("script: {}", display_path(&script)));
    if args.json {
        let reference = reference_technique(comparison);
        crate::cli::json::print(as_json(&results, &found, reference, &caveats))?;
    } else {
        print_result(&format!("\n{}\n", lines.join("\n")))?;
    }
    Ok(Exit::unless_problems(!problems.is_empty()))
}

/// Returns sentences on what weakens the verdicts.
fn caveats(
    night: &Night,
    comparison: &ComparisonArgs,
    found: &[Verdict],
    evidence: &Evidence,
) -> Vec<String> {
    let biased = night.biased_references().into_iter().map(|biased| {
        let sentence = biased_reference(biased);
        format!("{sentence}; --reference names another technique")
    });
    let mut caveats: Vec<String> = biased.collect();
    caveats.extend(floor_caveat(night, reference_technique(comparison)));
    caveats.extend(night.noisy_references());
    let finished = || night.runs.iter().filter(|run| run.is_done());
    let leader = found.iter().find(|v| v.contrast.is_significant());
    let leader = leader.map(|verdict| verdict.better.clone());
    let has_common_error = |leader: &String| {
        let runs = finished().filter(|run| run.integrator == *leader);
        let read = |path: &Path| read_picture(path, evidence).ok();
        common_error::exceeds_noise(night, runs.map(|run| &**run), read)
    };
    let leader: Vec<String> = leader.into_iter().filter(has_common_error).collect();
    caveats.extend(common_error::caveat(&leader));
    let shares = finished().map(|run| (run.integrator.as_str(), run.lost_share));
    caveats.extend(clock::caveats(shares, &night.plan.order));
    let runs = night.runs.iter();
    let runs = runs.map(|run| (run.integrator.as_str(), &**run));
    caveats.extend(mixed_lanes(runs));
    caveats
}

/// Returns the metric of the comparison and its last value in a run.
fn last_error<'a>(night: &'a Night, run: &Run) -> Option<(&'a MetricSpec, f64)> {
    let index = night.plan.metrics.iter().position(|m| m.column == METRIC)?;
    let value = *run.rows.last()?.metrics.get(index)?;
    Some((&night.plan.metrics[index], value))
}

/// Returns the efficiencies of all finished runs by technique at the render time that all of them
/// reached, as the report's tables at equal time.
fn efficiencies(night: &Night, techniques: &[String]) -> Vec<TechniqueResults> {
    let finished = night.runs.iter().filter(|run| run.is_done());
    let reached = finished.filter_map(|run| Some(run.rows.last()?.render_s));
    let time_s = reached.reduce(f64::min);
    let metric = night.plan.metrics.iter().position(|m| m.column == METRIC);
    let of_run = |run: &Run| {
        let (time_s, metric) = time_s.zip(metric)?;
        let spec = &night.plan.metrics[metric];
        let display = MetricDisplay::for_metric(spec);
        let point = |row: &WaveRow| Some((row.render_s, *row.metrics.get(metric)?));
        let curve = MetricCurve::new(display, run.rows.iter().filter_map(point));
        let error = display.metric_value(curve.at(time_s)?);
        let errors = run.net_errors(spec, error);
        Some(RunEfficiency {
            repeat: run.repeat,
            at_noise: errors.map(|error| efficiency(error, time_s).unwrap_or(f64::NAN)),
        })
    };
    techniques
        .iter()
        .map(|name| TechniqueResults {
            name: name.clone(),
            runs: night
                .runs
                .iter()
                .filter(|run| run.integrator == *name && run.is_done())
                .filter_map(|run| of_run(run))
                .collect(),
        })
        .collect()
}

/// Describes a verdict.
fn sentence(verdict: &Verdict) -> String {
    let Verdict {
        better,
        worse,
        contrast,
    } = verdict;
    if contrast.difference.is_nan() {
        return format!(
            "{better} and {worse} cannot be compared: the error of some runs is not above the noise \
             of the reference"
        );
    }
    let interval = contrast
        .ratio_interval()
        .map_or_else(String::new, |[low, high]| {
            format!(" (95 %: {} to {})", rounded(low), rounded(high))
        });
    let (ratio, p) = (rounded(contrast.ratio()), rounded(contrast.p));
    match contrast.difference_of_means {
        _ if contrast.is_significant() => {
            format!("{better} is {ratio} times as efficient as {worse}{interval}, p = {p}")
        }
        Some(means) if !contrast.is_confirmed() => format!(
            "no winner between {better} and {worse}: by the geometric mean over repeats the ratio of \
             their efficiencies is {ratio}{interval}, by the mean of their errors {}: a few runs have \
             most of the error",
            rounded(means.exp())
        ),
        _ => format!(
            "no significant difference between {better} and {worse}: the ratio of their \
             efficiencies is {ratio}{interval}, p = {p}; more repeats or time would decide"
        ),
    }
}

/// Returns a sentence if the noise of the reference makes up much of the measured errors.
fn floor_caveat(night: &Night, reference: &str) -> Option<String> {
    let shares = night
        .runs
        .iter()
        .filter_map(|run| Some(run.floor(METRIC)?.value / last_error(night, run)?.1));
    let greatest = shares.fold(0.0, f64::max);
    (greatest > MAX_FLOOR_SHARE).then(|| {
        format!(
            "up to {} % of the measured error is noise of the reference by {reference}; \
             it is subtracted, but another --reference or a longer --time would be more certain",
            rounded(100.0 * greatest)
        )
    })
}

fn as_json(
    results: &[TechniqueResults],
    found: &[Verdict],
    reference: &str,
    caveats: &[String],
) -> serde_json::Value {
    let techniques: Vec<_> = results
        .iter()
        .map(|r| {
            let efficiencies: Vec<f64> = r.runs.iter().map(|run| run.at_noise[0]).collect();
            json!({ "technique": r.name, "efficiencies": efficiencies })
        })
        .collect();
    let verdicts: Vec<_> = found
        .iter()
        .map(|v| {
            json!({
                "better": v.better, "worse": v.worse, "ratio": v.contrast.ratio(), "interval": v.contrast.ratio_interval(),
                "ratio_of_means": v.contrast.difference_of_means.map(f64::exp),
                "p": v.contrast.p, "significant": v.contrast.is_significant(),
            })
        })
        .collect();
    json!({
        "metric": METRIC, "techniques": techniques, "verdicts": verdicts,
        "reference": { "technique": reference, "bias": bias_of(reference) }, "caveats": caveats,
    })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::sync::Arc;

    use super::*;
    use lumbre_metrics::floor::Floor;
    use lumbre_night::experiment::night::NightPlan;
    use lumbre_night::experiment::night::run::{RunPlan, RunState};
    use lumbre_night::experiment::{EndCause, Outcome};

    /// Returns a finished run from the render times and errors of its waves, which took ten times
    /// as long on the wall clock. `floor` is the noise of its reference.
    fn run(technique: &str, waves: &[(f64, f64)], floor: Option<f64>) -> Run {
        let row = |(render_s, error): &(f64, f64)| WaveRow {
            render_s: *render_s,
            wall_s: 10.0 * render_s,
            metrics: vec![0.5, *error],
            ..WaveRow::default()
        };
        let plan = RunPlan {
            seed: 1,
            integrator: technique.to_owned(),
            scene: "box".to_owned(),
            ..RunPlan::default()
        };
        Run {
            planned: Arc::new(plan),
            state: RunState::Ended(Outcome::Done(EndCause::other("1 s"))),
            rows: Arc::new(waves.iter().map(row).collect()),
            floors: floor
                .map(|floor| (METRIC.to_owned(), Floor::exact(floor)))
                .into_iter()
                .collect(),
            ..Run::default()
        }
    }

    #[test]
    fn an_efficiency_is_the_inverse_of_net_error_times_render_time() {
        let unfinished = Run {
            state: RunState::Ended(Outcome::Interrupted),
            ..run("nee", &[(0.25, 0.9)], None)
        };
        let metric = |name: &str| MetricSpec::new(name, name, BTreeMap::new()).unwrap();
        let plan = NightPlan {
            name: "compared".to_owned(),
            seed: 1,
            metrics: vec![metric("ssim"), metric(METRIC)],
            order: "interleave".to_owned(),
            ..NightPlan::default()
        };
        let runs = [
            run("bpt", &[(1.0, 0.04), (2.0, 0.02)], None),
            run("bpt", &[(1.0, 0.04), (2.0, 0.02)], Some(0.004)),
            // The noise of the reference is all of its error.
            run("bpt", &[(2.0, 0.02)], Some(0.02)),
            // Its error after 2 s, when the first run ended, is 0.005.
            run("nee", &[(1.0, 0.01), (4.0, 0.0025)], None),
            unfinished,
        ];
        let night = Night {
            plan: Arc::new(plan),
            runs: runs.map(Arc::new).to_vec(),
            ..Night::default()
        };
        let names = ["nee", "bpt"].map(str::to_owned);
        let found = efficiencies(&night, &names);
        let expected = [
            ("nee", vec![1.0 / (0.005 * 2.0)]),
            (
                "bpt",
                vec![1.0 / (0.02 * 2.0), 1.0 / (0.016 * 2.0), f64::NAN],
            ),
        ];
        assert_eq!(found.len(), 2);
        for (found, (name, efficiencies)) in found.iter().zip(expected) {
            assert_eq!(found.name, name);
            assert_eq!(found.runs.len(), efficiencies.len(), "{found:?}");
            for (run, b) in found.runs.iter().zip(&efficiencies) {
                let a = run.at_noise[0];
                assert!(
                    (a / b - 1.0).abs() < 1e-12 || a.is_nan() && b.is_nan(),
                    "{found:?}, not {efficiencies:?}"
                );
            }
        }
    }
}
