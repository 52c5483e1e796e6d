//! `lumbre reproduce`: renders the runs behind a result file again and compares the pictures.
//!
//! [`run_ids`] finds the runs that a file names, and [`stored_run`] renders a run from the
//! configuration in its folder. For each run the answer is one of three: identical bits, a
//! difference that noise explains, or a difference that it does not.

mod run_ids;
pub(super) mod stored_run;

use std::path::{Path, PathBuf};

use serde_json::{Value as Json, json};

use super::args::{Global, ReproduceArgs};
use super::exit::{Exit, Failure, print_result, print_status};
use super::verify::picture::{NoisyPicture, judge};
use crate::cli::format::{counted, display_path};
use crate::cli::{json, selector};
use lumbre_light::film::{Film, Image};
use lumbre_light::math::stats::normal_two_sided_p;
use lumbre_metrics::MetricSpec;
use lumbre_night::store;
use lumbre_report::png;
use stored_run::{Rendered, StoredRun};

/// Result of reproducing one run.
enum Answer {
    /// Every bit of the picture is the same.
    Identical,
    /// The difference is explained by noise; with the p-value and a statement of the test.
    Noise { p: f64, statement: String },
    /// The difference is not explained by noise.
    Differs {
        /// Statement of the test.
        statement: String,
        /// First pixel of the block that differs most.
        at: Option<[u32; 2]>,
        /// File of the error map.
        map: Option<PathBuf>,
    },
    /// The run cannot be rendered again, or the pictures cannot be compared; with the reason.
    Impossible(String),
}

/// Run that a file names.
struct NamedRun {
    id: String,
    /// Samples per pixel of the picture in the file, if it is not the last one.
    samples: Option<u64>,
    /// Folder of the run, or why it was not found.
    folder: Result<PathBuf, String>,
}

/// Returns the runs that files name, each once.
fn named_runs(files: &[PathBuf], global: &Global) -> Result<Vec<NamedRun>, Failure> {
    let mut named: Vec<NamedRun> = Vec::new();
    for given in files {
        let file = if given.exists() {
            given.clone()
        } else {
            selector::run(&given.to_string_lossy(), &global.out)?.folder
        };
        let ids = run_ids::read(&file).map_err(Failure::usage)?;
        for id in ids.runs {
            let is_same = |other: &NamedRun| other.id == id && other.samples == ids.samples;
            if !named.iter().any(is_same) {
                let folder = stored_run::find_folder(&id, &file, &global.out);
                let samples = ids.samples;
                named.push(NamedRun {
                    id,
                    samples,
                    folder,
                });
            }
        }
    }
    Ok(named)
}

/// Runs `lumbre reproduce` for all runs that the files name.
pub fn main(args: &ReproduceArgs, global: &Global) -> Result<Exit, Failure> {
    let runs = named_runs(&args.files, global)?;
    if let [
        NamedRun {
            folder: Err(reason),
            ..
        },
    ] = runs.as_slice()
    {
        return Err(Failure::usage(reason));
    }
    let tests = runs.len();
    let mut answers = Vec::new();
    let (mut differ, mut failed) = (0, 0);
    for NamedRun {
        id,
        samples,
        folder,
    } in &runs
    {
        let folder = folder.clone();
        let stored = folder.and_then(|folder| stored_run::read(id, &folder, *samples));
        let answer = match stored {
            Ok(stored) => {
                if !global.quiet {
                    print_status(&format!(
                        "rendering {} again: {} samples per pixel",
                        stored.name, stored.samples
                    ));
                }
                if let Some(warning) = stored_run::library_warning(&stored) {
                    print_status(&warning);
                }
                reproduce(&stored, args, global, tests)
            }
            Err(reason) => Answer::Impossible(reason),
        };
        differ += usize::from(matches!(answer, Answer::Differs { .. }));
        failed += usize::from(matches!(answer, Answer::Impossible(_)));
        if args.json {
            answers.push(answer.json(id));
        } else {
            print_result(&format!("{}\n", answer.line(id)))?;
        }
    }
    if args.json {
        let files: Vec<String> = args.files.iter().map(|file| display_path(file)).collect();
        let json = json!({ "file": files[0], "files": files, "runs": answers });
        json::print(json)?;
    } else if tests > 1 && !global.quiet {
        print_status(&format!(
            "{}: {differ} differ, {failed} cannot be compared",
            counted(tests, "run")
        ));
    }
    Ok(match (differ, failed) {
        (0, 0) => Exit::Done,
        (0, _) => Exit::CellsFailed,
        _ => Exit::NotVerified,
    })
}

/// Renders a run again and compares the picture with the stored one. `tests` is the number of runs
/// that are compared, for the correction of multiple tests.
fn reproduce(stored: &StoredRun, args: &ReproduceArgs, global: &Global, tests: usize) -> Answer {
    let Rendered { film, denoised } = match stored_run::render(stored, global) {
        Ok(rendered) => rendered,
        Err(reason) => return Answer::Impossible(reason),
    };
    let comparison = Comparison {
        run: &stored.run,
        maps: args.maps.as_deref().unwrap_or(Path::new(".")),
        tests,
    };
    let Some(denoised) = denoised else {
        return comparison.answer(&film, &stored.image);
    };
    if has_same_bits(&denoised, &stored.image) {
        return Answer::Identical;
    }
    // The noise of a denoised picture is not known, so the pictures before it are judged.
    let Some(raw) = &stored.raw else {
        return Answer::Impossible(
            "the denoised pictures differ, and the picture before denoising is not stored"
                .to_owned(),
        );
    };
    match comparison.answer(&film, raw) {
        Answer::Identical => Answer::Differs {
            statement: "the samples are identical, but the denoiser gives another picture"
                .to_owned(),
            at: None,
            map: comparison.write_map(&denoised, &stored.image),
        },
        answer => answer,
    }
}

fn has_same_bits(a: &Image, b: &Image) -> bool {
    let bits = |image: &Image| -> Vec<u32> {
        let values = image.data.as_flattened().iter();
        values.map(|x| x.to_bits()).collect()
    };
    [a.width, a.height] == [b.width, b.height] && bits(a) == bits(b)
}

/// Comparison of a run that was rendered again with its stored picture.
struct Comparison<'a> {
    /// Id of the run.
    run: &'a str,
    /// Folder of error maps.
    maps: &'a Path,
    /// Number of runs that are compared, for the correction of multiple tests.
    tests: usize,
}

impl Comparison<'_> {
    /// Compares the mean of a film with a stored picture of equally many samples.
    fn answer(&self, film: &Film, stored: &Image) -> Answer {
        let image = film.mean();
        if [image.width, image.height] != [stored.width, stored.height] {
            return Answer::Impossible(format!(
                "the stored picture has {}x{} pixels, but the new one has {}x{}",
                stored.width, stored.height, image.width, image.height
            ));
        }
        if has_same_bits(&image, stored) {
            return Answer::Identical;
        }
        // The stored picture has equally many samples of the same kind, so both have the same noise.
        let new = NoisyPicture::from_film(film);
        let old = NoisyPicture {
            mean: stored.clone(),
            ..new.clone()
        };
        let side = image.width.min(image.height).div_ceil(16).max(1);
        let judged = judge(&new, &old, side, self.tests);
        let statement = judged.statement();
        if judged.too_dark() || film.samples < 2 {
            return Answer::Impossible(
                "the pictures differ, but too few samples found light to distinguish noise from a \
             change"
                    .to_owned(),
            );
        }
        if judged.agrees {
            // Bonferroni correction: the smallest p-value times the number of tests, one for each block
            // and one for each of the three channels of the whole picture.
            let least = judged
                .result
                .worst_p
                .min(normal_two_sided_p(judged.result.z));
            let p = (least * (judged.result.comparisons + 3) as f64).min(1.0);
            return Answer::Noise { p, statement };
        }
        Answer::Differs {
            statement,
            at: judged.result.worst_at,
            map: self.write_map(&image, stored),
        }
    }

    /// Writes a map of the relative squared error. Returns its path, or `None` if it cannot be computed
    /// or written.
    fn write_map(&self, new: &Image, old: &Image) -> Option<PathBuf> {
        let (run, folder) = (self.run, self.maps);
        let metric = MetricSpec::new("relmse", "relmse", Default::default()).ok()?;
        let map = metric.error_map(new, old).ok()?;
        let meta = [
            ("run".to_owned(), run.to_owned()),
            ("metric".to_owned(), "relmse".to_owned()),
        ];
        let bytes = png::encode_map(&map, map.scale(None), &meta).ok()?;
        let path = folder.join(format!("differs-{}.png", run.get(..8).unwrap_or(run)));
        std::fs::create_dir_all(folder).ok()?;
        store::write_atomically(&path, &bytes)
            .map_err(|e| print_status(&format!("warning: {e}")))
            .ok()?;
        Some(path)
    }
}

impl Answer {
    /// Formats the answer as one line that starts with the first digits of the run's id.
    fn line(&self, id: &str) -> String {
        let id = id.get(..8).unwrap_or(id);
        match self {
            Answer::Identical => format!("{id}  identical"),
            Answer::Noise { p, statement } => {
                format!("{id}  equal within noise, p = {p:.2} ({statement})")
            }
            Answer::Differs { statement, at, map } => {
                let place = at.map(|[x, y]| format!(" at {x},{y}")).unwrap_or_default();
                let map = map
                    .as_ref()
                    .map(|m| format!(", map: {}", display_path(m)))
                    .unwrap_or_default();
                format!("{id}  differs here{place}{map} ({statement})")
            }
            Answer::Impossible(reason) => format!("{id}  cannot be compared: {reason}"),
        }
    }

    /// Returns the answer as JSON.
    fn json(&self, id: &str) -> Json {
        match self {
            Answer::Identical => json!({ "run": id, "answer": "identical" }),
            Answer::Noise { p, statement } => {
                json!({ "run": id, "answer": "equal within noise", "p": p, "statement": statement })
            }
            Answer::Differs { statement, at, map } => json!({
                "run": id, "answer": "differs here", "at": at, "statement": statement,
                "map": map.as_ref().map(|m| m.display().to_string()),
            }),
            Answer::Impossible(reason) => {
                json!({ "run": id, "answer": "impossible", "reason": reason })
            }
        }
    }
}
