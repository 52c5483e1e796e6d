//! The paragraph of a paper that says how the numbers came about.

use super::item::{Item, Kind, PROGRAM, Provenance};
use super::latex;
use super::study::Study;

/// `methods.tex` and `methods.md`: hardware, versions, seeds, references and definitions of the metrics.
pub fn item(study: &Study) -> Item {
    let provenance = Provenance::of(study.all());
    let sentences = sentences(study);
    let markdown = format!("{}\n\n<!--\n{}\n-->\n", sentences.join(" "), provenance.text().replace("--", "- -"));
    let tex: String = sentences.iter().map(|s| latex::escape(s) + "\n").collect();
    let tex = format!("{}{tex}", provenance.comment("% "));
    Item {
        kind: Kind::Data,
        stem: "methods".to_owned(),
        title: "Methods".to_owned(),
        caption: sentences.join(" "),
        svg: None,
        grid: None,
        extra: vec![("md", markdown.into_bytes()), ("tex", tex.into_bytes())],
        provenance,
    }
}

fn sentences(study: &Study) -> Vec<String> {
    let mut out = Vec::new();
    for (night, name) in study.nights.iter().zip(&study.names) {
        let devices = night.devices();
        let on = if devices.is_empty() { String::new() } else { format!(" on {}", devices.join(" and ")) };
        let of = if study.nights.len() > 1 { format!(" ({name})") } else { String::new() };
        let (machine, program) = match &night.machine {
            Some(m) => (format!(", {} with {} cores", m.os, m.cores), m.program.clone()),
            None => (String::new(), "an unknown version of lumbre".to_owned()),
        };
        out.push(format!(
            "Experiment {}{of}, plan {}, was rendered with {program}{on}{machine}.",
            night.name,
            short(&night.plan)
        ));
        out.push(format!(
            "Seed {} of the experiment determines the seed of every run; the runs of one repeat share theirs, and \
             references have one that no run has.",
            night.seed
        ));
    }
    let finished = study.all().filter(|m| m.run.done()).count();
    let repeats = study.all().map(|m| m.run.repeat + 1).max().unwrap_or(1);
    let runs = if repeats > 1 {
        format!("{finished} runs finished, {repeats} repeats of each configuration with different seeds.")
    } else {
        format!("{finished} runs finished, one of each configuration.")
    };
    out.push(runs);
    let mut truths: Vec<String> = Vec::new();
    for truth in study.nights.iter().flat_map(|n| &n.references).filter(|t| t.picture.is_some()) {
        if !truths.contains(&truth.words) {
            truths.push(truth.words.clone());
        }
    }
    if !truths.is_empty() {
        out.push(format!("Errors were measured against references made beforehand: {}.", truths.join("; ")));
    }
    for metric in &study.metrics {
        let options = metric.describe_options();
        let options = if options.is_empty() { String::new() } else { format!(" ({options})") };
        let unit = metric.unit();
        let unit = if unit.is_empty() { String::new() } else { format!(", in {unit}") };
        let doc = metric.row.doc.trim_end_matches('.');
        out.push(format!("{}{options}{unit}: {doc}.", metric.row.label));
    }
    out.push(
        "Time is that spent inside the renderer; measuring, encoding and writing happen between its waves and are not \
         counted."
            .to_owned(),
    );
    out.push(format!(
        "Curves are means over repeats with 95 % confidence intervals; in tables the best value of a row is bold only \
         if Welch's test against every other is significant at 5 % after Holm's correction. Figures and tables were \
         made by {PROGRAM}."
    ));
    out
}

fn short(hash: &str) -> &str {
    hash.get(..8).unwrap_or(hash)
}
