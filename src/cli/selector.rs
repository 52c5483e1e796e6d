//! Selection of nights and runs on the command line, the same for every verb.
//!
//! A night is selected by its folder, by a folder of results whose latest night is meant, by
//! `latest`, or by words of which each is part of the name of its folder. A run is selected by its
//! folder, by the first digits of its id, by `latest`, or by words of which each is part of its
//! path, the name of its night, or its id.

use std::path::{Path, PathBuf};

use crate::cli::exit::Failure;
use crate::cli::format::display_path;
use lumbre_night::paths::name;
use lumbre_night::store::{RunRecord, StoreError, latest_experiment, list_experiments, read_run};

/// Maximum number of candidates that a message lists.
const MOST_LISTED: usize = 8;

/// Word that selects the latest night, or the run that started or ended last.
const LATEST: &str = "latest";

/// Explanation of the options that select a night.
const NIGHT_HINT: &str = "`lumbre ls` lists nights; give a folder, `latest`, or words of its name";

/// Returns the folder of a night below `out`. Without a selection it is the latest one.
///
/// # Errors
/// Returns an error if no night or more than one is meant.
pub fn night(what: Option<&Path>, out: &Path) -> Result<PathBuf, Failure> {
    let given = what.unwrap_or(out);
    if is_night(given) {
        return Ok(given.to_owned());
    }
    let is_latest = given == Path::new(LATEST);
    if given.is_dir() || is_latest || what.is_none() {
        let results = if given.is_dir() { given } else { out };
        return newest(results).ok_or_else(|| {
            let results = display_path(results);
            Failure::usage(format!("there is no night in {results} ({NIGHT_HINT})"))
        });
    }
    let words = words(&given.to_string_lossy());
    let matching: Vec<PathBuf> = nights(out)
        .into_iter()
        .filter(|folder| has_all(&words, &name(folder)))
        .collect();
    let given = display_path(given);
    match matching.as_slice() {
        [one] => Ok(one.clone()),
        [] => Err(Failure::usage(format!(
            "there is no night `{given}` in {} ({NIGHT_HINT})",
            display_path(out)
        ))),
        several => Err(ambiguous(
            &given,
            "nights",
            several.iter().map(|folder| name(folder)),
        )),
    }
}

/// Reads a run of a night below `out`.
///
/// # Errors
/// Returns an error if no run or more than one is meant, or a file of it cannot be read.
pub fn run(what: &str, out: &Path) -> Result<RunRecord, Failure> {
    let error = match read_run(out, what) {
        Ok(record) => return Ok(record),
        Err(error) => error,
    };
    if !matches!(error, StoreError::NoSuchRun { .. }) || Path::new(what).is_dir() {
        return Err(Failure::usage(error));
    }
    let words = words(what);
    let latest = latest_experiment(out).map(|folder| name(&folder));
    // Of each run: its folder, its description, and whether it is of the latest night.
    let mut matching: Vec<(PathBuf, String, bool)> = Vec::new();
    for night in list_experiments(out).nights {
        let own = name(&night.folder);
        let is_latest = latest.as_deref() == Some(own.as_str());
        for run in &night.runs {
            let description = format!("{own} {} {}", run.path, run.id);
            if has_all(&words, &description) && run.folder.is_dir() {
                let id = run.id.get(..8).unwrap_or(&run.id);
                let shown = format!("{id} {} of {own}", run.path);
                matching.push((run.folder.clone(), shown, is_latest));
            }
        }
    }
    prefer_latest(&mut matching);
    match matching.as_slice() {
        [] => Err(Failure::usage(error)),
        [(folder, ..)] => read_run(out, &folder.to_string_lossy()).map_err(Failure::usage),
        several => Err(ambiguous(
            what,
            "runs",
            several.iter().map(|(_, shown, _)| shown.clone()),
        )),
    }
}

/// Returns the error for a selection that several nights or runs match.
fn ambiguous(what: &str, nouns: &str, all: impl ExactSizeIterator<Item = String>) -> Failure {
    let count = all.len();
    let mut text = format!("`{what}` matches {count} {nouns}; add words or give a folder:");
    for shown in all.take(MOST_LISTED) {
        text += &format!("\n  {shown}");
    }
    if count > MOST_LISTED {
        text += &format!("\n  and {} more", count - MOST_LISTED);
    }
    Failure::usage(text)
}

/// Splits a selection into lower-case words.
fn words(text: &str) -> Vec<String> {
    let lower = text.to_lowercase();
    lower.split_whitespace().map(str::to_owned).collect()
}

/// Returns whether a text contains all words, of which there is at least one. Parts of a path are
/// compared as a whole where a word is an assignment, so that `depth=1` is not `depth=10`.
fn has_all(words: &[String], text: &str) -> bool {
    let text = text.to_lowercase();
    let parts: Vec<&str> = text.split(['/', ' ']).collect();
    let has = |word: &String| match word.contains('=') {
        true => parts.contains(&word.as_str()),
        false => text.contains(word.as_str()),
    };
    !words.is_empty() && words.iter().all(has)
}

fn is_night(folder: &Path) -> bool {
    folder.join("plan.json").is_file()
}

/// Returns the name of a folder.
/// Returns the folders of all nights below a folder of results, ordered by name.
fn nights(out: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(out).into_iter().flatten().flatten();
    let mut nights: Vec<PathBuf> = entries
        .filter(|entry| entry.file_name() != LATEST)
        .map(|entry| entry.path())
        .filter(|folder| is_night(folder))
        .collect();
    nights.sort();
    nights
}

/// Returns the latest night of a folder of results, or its only one if none is marked as latest, as
/// in a copy.
fn newest(out: &Path) -> Option<PathBuf> {
    latest_experiment(out).or_else(|| match nights(out).as_slice() {
        [only] => Some(only.clone()),
        _ => None,
    })
}

/// Removes the runs of other nights if some are of the latest one, which the flags tell.
fn prefer_latest<A, B>(matching: &mut Vec<(A, B, bool)>) {
    if matching.iter().any(|(.., is_latest)| *is_latest) {
        matching.retain(|(.., is_latest)| *is_latest);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Creates folders with an empty plan below a folder.
    fn results(names: &[&str]) -> tempfile::TempDir {
        let out = tempfile::tempdir().unwrap();
        for name in names {
            std::fs::create_dir(out.path().join(name)).unwrap();
            std::fs::write(out.path().join(name).join("plan.json"), "{}").unwrap();
        }
        out
    }

    #[test]
    fn nights_are_selected_by_folder_word_and_latest() {
        let out = results(&["box-3f9a", "lamps-77aa"]);
        let selected = |what: &str| {
            let night = night(Some(Path::new(what)), out.path());
            night.map(|folder| name(&folder)).map_err(|e| e.message)
        };
        assert_eq!(selected("lamps"), Ok("lamps-77aa".to_owned()));
        assert_eq!(selected("3F9A box"), Ok("box-3f9a".to_owned()));
        let folder = out.path().join("box-3f9a");
        assert_eq!(
            selected(folder.to_str().unwrap()),
            Ok("box-3f9a".to_owned())
        );
        let several = selected("a").unwrap_err();
        assert!(
            several.contains("2 nights") && several.contains("lamps-77aa"),
            "{several}"
        );
        assert!(selected("glass").unwrap_err().contains("no night `glass`"));
        assert!(
            selected("latest")
                .unwrap_err()
                .contains("there is no night")
        );
        std::fs::write(out.path().join("latest"), "box-3f9a").unwrap();
        assert_eq!(selected("latest"), Ok("box-3f9a".to_owned()));
        let default = night(None, out.path()).map(|folder| name(&folder));
        assert_eq!(default.map_err(|e| e.message), Ok("box-3f9a".to_owned()));
    }

    #[test]
    fn runs_of_the_latest_night_are_preferred() {
        let preferred = |latest: &[bool]| {
            let all = latest.iter().enumerate();
            let mut matching = all.map(|(i, latest)| (i, "run", *latest)).collect();
            prefer_latest(&mut matching);
            matching.into_iter().map(|run| run.0).collect::<Vec<_>>()
        };
        assert_eq!(preferred(&[false, true, false]), [1]);
        assert_eq!(preferred(&[true, true]), [0, 1]);
        assert_eq!(preferred(&[false, false]), [0, 1]);
        assert!(preferred(&[]).is_empty());
    }

    #[test]
    fn assignments_are_compared_as_a_whole() {
        let path = "night-3f9a stage=box/depth=10/rep=0 77aa";
        let has = |text: &str| has_all(&words(text), path);
        assert!(has("depth=10 BOX") && has("stage=box rep=0") && has("77a"));
        assert!(!has("depth=1") && !has("depth=10 rep=1") && !has(""));
    }
}
