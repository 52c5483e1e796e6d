//! `lumbre bench --compare`: tables of the results of many machines.

use std::fmt::Write as _;
use std::path::PathBuf;

use super::result::{BenchmarkCell, BenchmarkResult};
use crate::cli::args::{BenchArgs, Global};
use crate::cli::exit::{Exit, Failure, print_result, print_status};
use crate::cli::format::{counted, display_path};
use lumbre_night::store;
use lumbre_report::benchmark::{RateGroup, RateTable, tables};

/// Prints tables of the results of several machines, and writes them if a folder is given.
pub fn main(args: &BenchArgs, global: &Global) -> Result<Exit, Failure> {
    let results: Vec<BenchmarkResult> = args
        .compare
        .iter()
        .map(|file| BenchmarkResult::read(file))
        .collect::<Result<_, _>>()
        .map_err(Failure::usage)?;
    check_comparable(&results).map_err(Failure::usage)?;
    print_result(&page(&results))?;
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
    for other in &results[1..] {
        if (other.resolution, other.max_depth) != (first.resolution, first.max_depth) {
            return Err(format!(
                "{} was measured at {:?} and depth {}, and {} at {:?} and depth {}: their rates \
                 cannot be compared",
                first.name,
                first.resolution,
                first.max_depth,
                other.name,
                other.resolution,
                other.max_depth
            ));
        }
    }
    Ok(())
}

/// Returns the groups of columns: every backend of every machine.
fn groups(results: &[BenchmarkResult]) -> Vec<RateGroup> {
    let mut groups = Vec::new();
    for result in results {
        for backend in backends(result) {
            let cells = result.cells.iter().filter(|cell| cell.backend == *backend);
            groups.push(RateGroup {
                label: label(results, result, backend),
                rates: cells
                    .map(|cell| {
                        let key = (cell.scene.clone(), cell.technique.clone());
                        (key, cell.frames_per_s.clone())
                    })
                    .collect(),
            });
        }
    }
    groups
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
fn rate_tables(results: &[BenchmarkResult]) -> Vec<RateTable> {
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
    tables(&groups(results), &scenes, &techniques)
}

/// Returns the tables and what is known of the machines and their pictures, as Markdown.
pub fn page(results: &[BenchmarkResult]) -> String {
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
            if result.quick { ", quick" } else { "" },
        );
        for (backend, device) in &result.backends {
            let _ = writeln!(text, "  - {backend}: {device}");
        }
    }
    text.push('\n');
    for table in rate_tables(results) {
        text += &table.markdown;
        text.push('\n');
    }
    text + &pictures(results)
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
            let (mut same, mut both, mut farthest) = (0, 0, 0.0f64);
            for cell in result.cells.iter().filter(|cell| cell.backend == backend) {
                let twin = first.cells.iter().find(|other| {
                    (&other.backend, &other.scene, &other.technique)
                        == (&cell.backend, &cell.scene, &cell.technique)
                });
                let Some(twin) = twin else { continue };
                both += 1;
                same += u32::from(twin.checksum == cell.checksum);
                farthest = farthest.max(relative_difference(twin, cell));
            }
            let _ = writeln!(
                text,
                "{}: {same} of {both} pictures have the bits of {}; mean radiances differ by at \
                 most {:.2} %.",
                label(results, result, backend),
                label(results, first, backend),
                100.0 * farthest
            );
        }
    }
    text
}

/// Returns the relative difference of the mean radiances of two pictures.
fn relative_difference(a: &BenchmarkCell, b: &BenchmarkCell) -> f64 {
    let [a, b] = [a, b].map(|cell| cell.picture_mean.iter().sum::<f64>());
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
    for table in rate_tables(results) {
        let texts = [
            ("md", &table.markdown),
            ("csv", &table.csv),
            ("tex", &table.latex),
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
    use crate::cli::benchmark::result::{Machine, SUITE_VERSION};

    /// A result with two backends, whose rates are multiples of `speed`.
    fn result(name: &str, speed: f64, bits: &str) -> BenchmarkResult {
        let cell = |backend: &str, scene: &str, technique: &str, rate: f64| BenchmarkCell {
            backend: backend.to_owned(),
            scene: scene.to_owned(),
            technique: technique.to_owned(),
            frames_per_s: [0.99, 1.0, 1.01].map(|x| x * rate * speed).to_vec(),
            mpaths_per_s: vec![rate; 3],
            mrays_per_s: rate,
            open_s: 0.1,
            build_s: 0.01,
            picture_samples: 2,
            picture_mean: [0.5 * speed, 0.5, 0.5],
            checksum: format!("{bits}{scene}{technique}"),
        };
        BenchmarkResult {
            benchmark: SUITE_VERSION,
            program: "lumbre".to_owned(),
            quick: false,
            name: name.to_owned(),
            machine: Machine {
                os: "linux".to_owned(),
                cpu: "a processor".to_owned(),
                cores: 2,
                threads: 2,
                features: vec![],
            },
            date: "2026-04-27T21:30:00Z".to_owned(),
            duration_s: 60.0,
            resolution: [640, 360],
            max_depth: 5,
            backends: BTreeMap::from([("cpu".to_owned(), "two threads".to_owned())]),
            cells: vec![
                cell("cpu", "box", "bpt", 100.0),
                cell("cpu", "box", "vcm", 10.0),
                cell("vulkan", "box", "bpt", 400.0),
            ],
        }
    }

    #[test]
    fn tables_have_a_group_for_each_backend_of_each_machine_and_ratios_to_the_first() {
        let page = page(&[result("fast", 1.0, "x"), result("slow", 0.5, "x")]);
        let heads = ["fast, cpu: bpt", "fast, vulkan: bpt", "slow, cpu: vcm"];
        assert!(heads.iter().all(|head| page.contains(head)), "{page}");
        assert!(!page.contains("vulkan: vcm"), "{page}");
        assert!(page.contains("relative to that of fast, cpu"), "{page}");
        let ratios: Vec<&str> = page.split("**Relative").nth(1).unwrap().lines().collect();
        let row = ratios
            .iter()
            .find(|line| line.starts_with("| box"))
            .unwrap();
        let numbers: Vec<&str> = row
            .split('|')
            .map(str::trim)
            .filter(|s| s.contains('%'))
            .collect();
        assert_eq!(numbers, ["400 %", "50 %", "50 %", "200 %"]);
        assert!(
            page.contains("2 of 2 pictures have the bits of fast, cpu"),
            "{page}"
        );
    }

    #[test]
    fn differing_pictures_and_settings_are_reported() {
        let (a, b) = (result("a", 1.0, "x"), result("a", 1.1, "y"));
        let page = page(&[a.clone(), b.clone()]);
        assert!(
            page.contains("0 of 2 pictures have the bits of a (2026"),
            "{page}"
        );
        assert!(page.contains("at most 3.23 %"), "{page}");
        assert!(check_comparable(&[a.clone(), b]).is_ok());
        let small = BenchmarkResult {
            resolution: [64, 36],
            ..a.clone()
        };
        let error = check_comparable(&[a, small]).unwrap_err();
        assert!(error.contains("cannot be compared"), "{error}");
    }
}
