//! `lumbre reproduce`: what a file shows, rendered again.
//!
//! A file names runs ([`named`]), a run's folder says what was rendered ([`again`]), and the answer for each is one of
//! three: the same bits, a difference that noise explains, or a place where it does not.

pub(super) mod again;
mod named;

use std::path::{Path, PathBuf};

use serde_json::{Value as Json, json};

use super::args::{Global, ReproduceArgs};
use super::exit::{Exit, Failure, data, talk};
use super::load::shown;
use super::run::counted;
use super::verify::picture::{Picture, judge};
use crate::film::Image;
use crate::math::stats::normal_two_sided_p;
use crate::metrics::MetricSpec;
use crate::output::png;
use crate::store;
use again::Stored;

/// What became of one run.
enum Answer {
    /// Every bit is the same.
    Identical,
    /// They differ by what noise explains; with the statistic.
    Noise { p: f64, statement: String },
    /// They differ by more; with the first pixel of the worst block, and the map.
    Differs { statement: String, at: Option<[u32; 2]>, map: Option<PathBuf> },
    /// It cannot be rendered again, or not be judged.
    Impossible(String),
}

/// Renders again what a file shows.
pub fn main(args: &ReproduceArgs, global: &Global) -> Result<Exit, Failure> {
    let named = named::read(&args.file).map_err(Failure::usage)?;
    let stored: Vec<Result<Stored, String>> =
        named.runs.iter().map(|id| again::find(id, &args.file, &global.out, named.samples)).collect();
    if let [Err(reason)] = stored.as_slice() {
        return Err(Failure::usage(reason));
    }
    let tests = stored.len();
    let mut lines = Vec::new();
    let (mut differ, mut failed) = (0, 0);
    for (id, stored) in named.runs.iter().zip(stored) {
        let answer = match stored {
            Ok(stored) => {
                if !global.quiet {
                    talk(&format!("rendering {} again: {} samples per pixel", stored.name, stored.samples));
                }
                answer(&stored, args, global, tests)
            }
            Err(reason) => Answer::Impossible(reason),
        };
        differ += usize::from(matches!(answer, Answer::Differs { .. }));
        failed += usize::from(matches!(answer, Answer::Impossible(_)));
        let line = if args.json { answer.json(id) } else { json!(answer.words(id)) };
        if !args.json {
            data(&format!("{}\n", answer.words(id)))?;
        }
        lines.push(line);
    }
    if args.json {
        let whole = json!({ "file": shown(&args.file), "runs": lines });
        data(&format!("{whole:#}\n"))?;
    } else if tests > 1 && !global.quiet {
        talk(&format!("{}: {differ} differ, {failed} have no answer", counted(tests, "run")));
    }
    Ok(match (differ, failed) {
        (0, 0) => Exit::Done,
        (0, _) => Exit::CellsFailed,
        _ => Exit::NotVerified,
    })
}

fn answer(stored: &Stored, args: &ReproduceArgs, global: &Global, tests: usize) -> Answer {
    let film = match again::render(stored, global) {
        Ok(film) => film,
        Err(reason) => return Answer::Impossible(reason),
    };
    let now = film.mean();
    let bits = |image: &Image| image.data.iter().flatten().map(|x| x.to_bits()).collect::<Vec<u32>>();
    if [now.width, now.height] != [stored.image.width, stored.image.height] {
        return Answer::Impossible(format!("it has become {}x{} pixels", now.width, now.height));
    }
    if bits(&now) == bits(&stored.image) {
        return Answer::Identical;
    }
    // The stored picture has as many samples of the same kind, so its noise is that of the new one.
    let new = Picture::of(&film);
    let old = Picture { mean: stored.image.clone(), ..new.clone() };
    let side = now.width.min(now.height).div_ceil(16).max(1);
    let judged = judge(&new, &old, side, tests);
    let statement = judged.statement();
    if judged.too_dark() || film.samples < 2 {
        return Answer::Impossible("it differs, and too little light was found to tell noise from a change".to_owned());
    }
    if judged.agrees {
        // Of many p-values the least counts, as often as it was tried: once for each block, and for three channels.
        let least = judged.found.worst_p.min(normal_two_sided_p(judged.found.z));
        let p = (least * (judged.found.comparisons + 3) as f64).min(1.0);
        return Answer::Noise { p, statement };
    }
    let maps = args.maps.clone().unwrap_or_else(|| PathBuf::from("."));
    Answer::Differs { statement, at: judged.found.worst_at, map: map(&now, &stored.image, &stored.run, &maps) }
}

/// Writes where two pictures differ, if that can be drawn and written.
fn map(now: &Image, before: &Image, run: &str, folder: &Path) -> Option<PathBuf> {
    let metric = MetricSpec::new("relmse", "relmse", Default::default()).ok()?;
    let map = metric.error_map(now, before).ok()?;
    let meta = [("run".to_owned(), run.to_owned()), ("metric".to_owned(), "relmse".to_owned())];
    let bytes = png::encode_map(&map, map.scale(None), &meta).ok()?;
    let path = folder.join(format!("differs-{}.png", run.get(..8).unwrap_or(run)));
    std::fs::create_dir_all(folder).ok()?;
    store::atomic(&path, &bytes).map_err(|e| talk(&format!("warning: {e}"))).ok()?;
    Some(path)
}

impl Answer {
    fn words(&self, id: &str) -> String {
        let id = id.get(..8).unwrap_or(id);
        match self {
            Answer::Identical => format!("{id}  identical"),
            Answer::Noise { p, statement } => format!("{id}  equal within noise, p = {p:.2} ({statement})"),
            Answer::Differs { statement, at, map } => {
                let place = at.map(|[x, y]| format!(" at {x},{y}")).unwrap_or_default();
                let map = map.as_ref().map(|m| format!(", map: {}", shown(m))).unwrap_or_default();
                format!("{id}  differs here{place}{map} ({statement})")
            }
            Answer::Impossible(reason) => format!("{id}  no answer: {reason}"),
        }
    }

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
            Answer::Impossible(reason) => json!({ "run": id, "answer": "impossible", "reason": reason }),
        }
    }
}
