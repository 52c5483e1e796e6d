//! `lumbre bench --compare`: tables of the results of many machines.

use std::fmt::Write as _;
use std::path::PathBuf;

use super::result::{BenchmarkCell, BenchmarkResult, Fingerprint};
use super::suite::{SuiteMetric, metrics};
use crate::cli::args::{BenchArgs, Global};
use crate::cli::exit::{Exit, Failure, print_result, print_status};
use crate::cli::format::{counted, display_path, duration};
use lumbre_night::store;
use lumbre_report::benchmark::{DeviceValues, Measured, Quantity, Ranking, relative, table};
use lumbre_report::metric_display::MetricDisplay;
use lumbre_report::quantity::{Bound, RunValue, threshold_sign};
use lumbre_report::table::Table;

/// Prints tables of the results of several machines, and writes them if a folder is given.
pub fn main(args: &BenchArgs, global: &Global) -> Result<Exit, Failure> {
    let results: Vec<BenchmarkResult> = args
        .compare
        .iter()
        .map(|file| BenchmarkResult::read(file))
        .collect::<Result<_, _>>()
        .map_err(Failure::usage)?;
    check_comparable(&results).map_err(Failure::usage)?;
    print_result(&page(&results).map_err(Failure::internal)?)?;
    if let Some(folder) = &args.to {
        let files = write(&results, folder)?;
        if !global.quiet {
            let count = counted(files.len(), "file");
            print_status(&format!("wrote {count} to {}", display_path(folder)));
        }
    }
    Ok(Exit::Done)
}

/// Returns an error if results cannot stand in one table.
fn check_comparable(results: &[BenchmarkResult]) -> Result<(), String> {
    let first = &results[0];
    let settings = |result: &BenchmarkResult| {
        let [width, height] = result.settings.resolution;
        let run = duration(result.settings.run_s);
        format!("{width}x{height} pixels and runs of {run}")
    };
    match results.iter().find(|r| r.settings != first.settings) {
        None => Ok(()),
        Some(other) => Err(format!(
            "{} was measured with {}, and {} with {}: they cannot be compared; measure both with \
             the same options",
            first.name,
            settings(first),
            other.name,
            settings(other)
        )),
    }
}

/// Returns the values of a quantity on every backend of every machine.
fn devices(
    results: &[BenchmarkResult],
    values: &dyn Fn(&BenchmarkResult, &BenchmarkCell) -> Measured,
) -> Vec<DeviceValues> {
    let mut devices = Vec::new();
    for result in results {
        for backend in backends(result) {
            let cells = result.cells.iter().filter(|cell| cell.backend == *backend);
            devices.push(DeviceValues {
                label: label(results, result, backend),
                values: cells
                    .map(|cell| {
                        let key = (cell.scene.clone(), cell.technique.clone());
                        (key, values(result, cell))
                    })
                    .collect(),
            });
        }
    }
    devices
}

/// Returns the backends of a result in the order of its measurements.
fn backends(result: &BenchmarkResult) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for cell in &result.cells {
        if !names.contains(&cell.backend.as_str()) {
            names.push(&cell.backend);
        }
    }
    names
}

/// Returns the label of a backend of a machine: `NAME, BACKEND`, with the date if machines have the
/// same name.
fn label(results: &[BenchmarkResult], result: &BenchmarkResult, backend: &str) -> String {
    let same = results
        .iter()
        .filter(|other| other.name == result.name)
        .count();
    if same > 1 {
        format!("{} ({}), {backend}", result.name, result.date)
    } else {
        format!("{}, {backend}", result.name)
    }
}

/// Returns the tables of some results.
fn benchmark_tables(results: &[BenchmarkResult]) -> Result<Vec<Table>, String> {
    let names = |name: fn(&BenchmarkCell) -> &String| {
        let mut found: Vec<String> = Vec::new();
        for cell in results.iter().flat_map(|result| &result.cells) {
            if !found.contains(name(cell)) {
                found.push(name(cell).clone());
            }
        }
        found
    };
    let (scenes, techniques) = (names(|cell| &cell.scene), names(|cell| &cell.technique));
    let rates = devices(results, &|_, cell| Measured {
        runs: cell
            .frames_per_s
            .iter()
            .copied()
            .map(RunValue::exact)
            .collect(),
        at_floor: false,
    });
    let rate = |name: &str, title: &str| Quantity {
        name: format!("benchmark-{name}"),
        title: title.to_owned(),
        caption: "Samples of every pixel per second (FPS). Mean of runs.".to_owned(),
        unit: "1/s",
        ranking: Ranking::HigherRate,
    };
    let mut tables = vec![table(
        &rate("fps", "Sampling rate"),
        &rates,
        &scenes,
        &techniques,
    )];
    let quotient = rate("relative", "Relative sampling rate");
    tables.extend(relative(&quotient, &rates, &scenes, &techniques));
    for metric in &metrics()? {
        for at_s in &results[0].settings.equal_times_s {
            let values = devices(results, &|result, cell| errors(metric, *at_s, result, cell));
            let quantity = error_quantity(metric, *at_s);
            tables.push(table(&quantity, &values, &scenes, &techniques));
        }
        let values = devices(results, &|result, cell| times(metric, result, cell));
        tables.push(table(&time_quantity(metric), &values, &scenes, &techniques));
    }
    Ok(tables)
}

/// Describes the errors of a metric at equal render time.
fn error_quantity(metric: &SuiteMetric, at_s: f64) -> Quantity {
    let (name, label) = (metric.spec.row.name, metric.label);
    let noise = if metric.spec.net(1.0, 0.5).is_some() {
        "The error of the reference is subtracted."
    } else {
        "The error of the reference is in the numbers, since it cannot be subtracted."
    };
    Quantity {
        name: format!("benchmark-{name}-at-{at_s}s"),
        title: format!("Error after {}: {label}", duration(at_s)),
        caption: format!(
            "{label} after {} of render time. {noise} Mean of runs.",
            duration(at_s)
        ),
        unit: "1",
        ranking: Ranking::LowerError(MetricDisplay::for_metric(&metric.spec)),
    }
}

/// Describes the times until a metric stays at its threshold.
fn time_quantity(metric: &SuiteMetric) -> Quantity {
    let (name, label, threshold) = (metric.spec.row.name, metric.label, metric.threshold);
    let goal = format!(
        "{label} {} {threshold}",
        threshold_sign(metric.spec.row.better)
    );
    Quantity {
        name: format!("benchmark-time-to-{name}"),
        title: format!("Time to {goal}"),
        caption: format!("Render time in seconds until {goal} for good. Mean of runs."),
        unit: "s",
        ranking: Ranking::ShorterTime,
    }
}

/// Returns the errors of the runs of a cell at a render time, without the noise of the reference
/// where it can be subtracted. A cell of which a run had no picture yet has none.
fn errors(
    metric: &SuiteMetric,
    at_s: f64,
    result: &BenchmarkResult,
    cell: &BenchmarkCell,
) -> Measured {
    let spec = &metric.spec;
    let floor = floor(metric, result, cell);
    let found = cell.errors.iter();
    let found = found.filter(|error| error.metric == spec.column && error.at_s == at_s);
    let values: Option<Vec<f64>> = found.flat_map(|error| &error.values).copied().collect();
    let values = values.unwrap_or_default();
    Measured {
        runs: values
            .iter()
            .map(|value| RunValue::exact(metric.net(*value, floor)))
            .collect(),
        at_floor: floor.is_some_and(|floor| values.iter().any(|v| spec.is_at_floor(*v, floor))),
    }
}

/// Returns the times of the runs of a cell until a metric stays at its threshold.
fn times(metric: &SuiteMetric, result: &BenchmarkResult, cell: &BenchmarkCell) -> Measured {
    let spec = &metric.spec;
    let bound = |name: &String| {
        let known = [Bound::Lower, Bound::Upper].into_iter();
        known
            .clone()
            .find(|bound| bound.name() == name)
            .unwrap_or_default()
    };
    let found = cell
        .times
        .iter()
        .filter(|times| times.metric == spec.column);
    let runs = found.flat_map(|times| times.seconds.iter().zip(&times.bounds));
    let is_at_floor = |floor: f64| {
        // The measured value at the threshold, from which the noise is subtracted.
        let both = [metric.threshold, floor];
        spec.is_at_floor(spec.sum_of_noise(both).unwrap_or(metric.threshold), floor)
    };
    Measured {
        runs: runs
            .map(|(seconds, name)| RunValue::bounded(*seconds, bound(name)))
            .collect(),
        at_floor: floor(metric, result, cell).is_some_and(is_at_floor),
    }
}

/// Returns the value of the true image against the reference of a cell.
fn floor(metric: &SuiteMetric, result: &BenchmarkResult, cell: &BenchmarkCell) -> Option<f64> {
    let reference = result.reference(&cell.scene)?;
    reference.floors.get(&metric.spec.column).copied()
}

/// Returns the tables and what is known of the machines and their pictures, as Markdown.
///
/// # Errors
/// Returns a message if the program lacks a metric.
pub fn page(results: &[BenchmarkResult]) -> Result<String, String> {
    let mut text = String::new();
    for result in results {
        let machine = &result.machine;
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "- {}: {}, {} cores, {} threads, {}; {}, {}{}",
            result.name,
            machine.cpu,
            machine.cores,
            machine.threads,
            machine.os,
            result.program,
            result.date,
            if result.finished { "" } else { ", unfinished" },
        );
        for (backend, device) in &result.backends {
            let _ = writeln!(text, "  - {backend}: {device}");
        }
    }
    let settings = &results[0].settings;
    let [width, height] = settings.resolution;
    let _ = writeln!(
        text,
        "\n{width}x{height} pixels, {} path edges, {} runs of {} each.\n",
        settings.max_depth,
        settings.repeats,
        duration(settings.run_s)
    );
    for table in benchmark_tables(results)? {
        text += &table.to_markdown();
        text.push('\n');
    }
    Ok(text + &references(results) + &pictures(results))
}

/// Describes which references are equal to those of the first result, bit for bit: errors are
/// comparable then. Empty for a single result.
fn references(results: &[BenchmarkResult]) -> String {
    let [first, others @ ..] = results else {
        return String::new();
    };
    let line = |other: &BenchmarkResult| {
        let pairs = other.references.iter().filter_map(|reference| {
            let twin = first.reference(&reference.scene)?;
            Some((&twin.picture, &reference.picture))
        });
        agreement(&other.name, "references", &first.name, pairs)
    };
    others.iter().map(line).collect()
}

/// Describes which pictures are equal to those of the first result with the same backend, bit for
/// bit. Empty for a single result.
fn pictures(results: &[BenchmarkResult]) -> String {
    let mut text = String::new();
    for (i, result) in results.iter().enumerate() {
        for backend in backends(result) {
            let Some(first) = results[..i].iter().find(|r| backends(r).contains(&backend)) else {
                continue;
            };
            let cells = result.cells.iter().filter(|cell| cell.backend == backend);
            let pairs = cells.filter_map(|cell| {
                let twin = first.cell(backend, &cell.scene, &cell.technique)?;
                Some((&twin.picture, &cell.picture))
            });
            let [own, base] = [result, first].map(|r| label(results, r, backend));
            text += &agreement(&own, "pictures", &base, pairs);
        }
    }
    text
}

/// Counts the pairs of pictures with the same bits, and compares their mean radiances.
fn agreement<'a>(
    name: &str,
    subject: &str,
    base: &str,
    pairs: impl Iterator<Item = (&'a Fingerprint, &'a Fingerprint)>,
) -> String {
    let (mut same, mut both, mut farthest) = (0, 0, 0.0f64);
    for (a, b) in pairs {
        both += 1;
        same += u32::from(a.checksum == b.checksum);
        farthest = farthest.max(relative_difference(a, b));
    }
    format!(
        "{name}: {same} of {both} {subject} have the bits of {base}; mean radiances differ by at \
         most {:.2} %.\n",
        100.0 * farthest
    )
}

/// Returns the relative difference of the mean radiances of two pictures.
fn relative_difference(a: &Fingerprint, b: &Fingerprint) -> f64 {
    let [a, b] = [a, b].map(|picture| picture.mean.iter().sum::<f64>());
    if a == b {
        0.0
    } else {
        (a - b).abs() / a.abs().max(b.abs())
    }
}

/// Writes the tables as Markdown, CSV and LaTeX to a folder; returns the files.
fn write(results: &[BenchmarkResult], folder: &PathBuf) -> Result<Vec<PathBuf>, Failure> {
    std::fs::create_dir_all(folder)
        .map_err(|e| Failure::usage(format!("cannot create {}: {e}", display_path(folder))))?;
    let mut files = Vec::new();
    for table in benchmark_tables(results).map_err(Failure::internal)? {
        let texts = [
            ("md", table.to_markdown()),
            ("csv", table.to_long_csv()),
            ("tex", table.to_latex()),
        ];
        for (extension, text) in texts {
            let file = folder.join(format!("{}.{extension}", table.name));
            store::write_atomically(&file, text.as_bytes()).map_err(Failure::usage)?;
            files.push(file);
        }
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::cli::benchmark::result::{
        BenchmarkReference, ErrorAt, Machine, SUITE_VERSION, SuiteSettings, TimeTo,
    };

    fn picture(checksum: String, mean: f64) -> Fingerprint {
        Fingerprint {
            samples: 2,
            mean: [mean, 0.5, 0.5],
            checksum,
        }
    }

    /// A result with two backends, whose rates are multiples of `speed`. Its errors after 1 s are
    /// the inverse, and half of its runs are too short for the threshold.
    fn result(name: &str, speed: f64, bits: &str) -> BenchmarkResult {
        let cell = |backend: &str, scene: &str, technique: &str, rate: f64| BenchmarkCell {
            backend: backend.to_owned(),
            scene: scene.to_owned(),
            technique: technique.to_owned(),
            frames_per_s: [0.99, 1.0, 1.01].map(|x| x * rate * speed).to_vec(),
            mpaths_per_s: vec![rate; 3],
            mrays_per_s: rate,
            errors: vec![ErrorAt {
                metric: "relative_rmse".to_owned(),
                at_s: 1.0,
                values: vec![Some(0.5 / speed); 3],
            }],
            times: vec![TimeTo {
                metric: "relative_rmse".to_owned(),
                threshold: 0.25,
                seconds: vec![1.0; 3],
                bounds: ["", "lower", "lower"].map(str::to_owned).to_vec(),
            }],
            open_s: 0.1,
            build_s: 0.01,
            picture: picture(format!("{bits}{scene}{technique}"), 0.5 * speed),
        };
        BenchmarkResult {
            benchmark: SUITE_VERSION,
            program: "lumbre".to_owned(),
            name: name.to_owned(),
            machine: Machine {
                os: "linux".to_owned(),
                cpu: "a processor".to_owned(),
                cores: 2,
                threads: 2,
                features: vec![],
            },
            settings: SuiteSettings {
                resolution: [640, 360],
                max_depth: 5,
                repeats: 3,
                run_s: 1.0,
                equal_times_s: vec![1.0],
                reference_share: 1.0,
            },
            date: "2026-04-27T21:30:00Z".to_owned(),
            duration_s: 60.0,
            finished: true,
            backends: BTreeMap::from([("cpu".to_owned(), "two threads".to_owned())]),
            references: vec![BenchmarkReference {
                scene: "box".to_owned(),
                technique: "bdpt".to_owned(),
                render_s: 40.0,
                picture: picture("reference".to_owned(), 0.5),
                floors: BTreeMap::from([("relative_rmse".to_owned(), 0.3)]),
            }],
            cells: vec![
                cell("cpu", "box", "bpt", 100.0),
                cell("cpu", "box", "vcm", 10.0),
                cell("vulkan", "box", "bpt", 400.0),
            ],
        }
    }

    /// Returns the numbers in the row of the scene of a table of a page.
    fn row<'a>(page: &'a str, table: &str) -> Vec<&'a str> {
        let text = page.split(table).nth(1).unwrap();
        let line = text.lines().find(|line| line.starts_with("| box")).unwrap();
        let cells = line.trim_matches(['|', ' ']).split('|').skip(1);
        cells.map(str::trim).collect()
    }

    #[test]
    fn tables_have_a_group_for_each_backend_of_each_machine_and_ratios_to_the_first() {
        let page = page(&[result("fast", 1.0, "x"), result("slow", 0.5, "x")]).unwrap();
        let heads = ["fast, cpu: bpt", "fast, vulkan: bpt", "slow, cpu: vcm"];
        assert!(heads.iter().all(|head| page.contains(head)), "{page}");
        assert!(!page.contains("vulkan: vcm"), "{page}");
        assert!(page.contains("Relative to fast, cpu."), "{page}");
        let ratios = row(&page, "**Relative sampling rate.");
        assert_eq!(ratios, ["400 %", "50 %", "50 %", "200 %"]);
        assert!(
            page.contains("2 of 2 pictures have the bits of fast, cpu"),
            "{page}"
        );
        assert!(
            page.contains("slow: 1 of 1 references have the bits of fast;"),
            "{page}"
        );
    }

    #[test]
    fn the_noise_of_the_reference_is_subtracted_and_censored_times_are_marked() {
        let results = [result("fast", 1.25, "x"), result("slow", 1.0, "x")];
        let page = page(&results).unwrap();
        let errors = row(&page, "**Error after 1 s: relative RMSE.");
        // The square of 0.4 is less than twice that of 0.3.
        assert!(errors[0].starts_with("0.2646†"), "{errors:?}");
        assert!(errors[3].starts_with("0.4"), "{errors:?}");
        assert!(!errors[3].contains('†'), "{errors:?}");
        // The threshold 0.25 is below the noise.
        let times = row(&page, "**Time to relative RMSE");
        assert!(times[0].starts_with("> 1†"), "{times:?}");
        assert!(page.contains("not reached within t seconds"), "{page}");
    }

    #[test]
    fn differing_pictures_and_settings_are_reported() {
        let (a, b) = (result("a", 1.0, "x"), result("a", 1.1, "y"));
        let page = page(&[a.clone(), b.clone()]).unwrap();
        assert!(
            page.contains("0 of 2 pictures have the bits of a (2026"),
            "{page}"
        );
        assert!(page.contains("at most 3.23 %"), "{page}");
        assert!(check_comparable(&[a.clone(), b]).is_ok());
        let mut small = a.clone();
        small.settings.resolution = [64, 36];
        let error = check_comparable(&[a, small]).unwrap_err();
        assert!(error.contains("cannot be compared"), "{error}");
    }
}
