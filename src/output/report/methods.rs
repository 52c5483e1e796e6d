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
    let mut peers: Vec<String> = Vec::new();
    for (run, program) in study.all().filter_map(|m| Some((m.run, m.run.peer.as_ref()?))) {
        let peer = format!("{} was rendered by {program}, whose clock is its own", run.integrator);
        if !peers.contains(&peer) {
            peers.push(peer);
        }
    }
    out.extend(peers.into_iter().map(|peer| peer + "."));
    let truths = study.nights.iter().flat_map(|n| &n.references).filter(|t| t.picture.is_some());
    let truths = references(truths.map(|t| t.words.as_str()));
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

/// References in words, those of one technique together: `bpt, 16 to 1024 samples per pixel (12 pictures)`.
fn references<'a>(words: impl Iterator<Item = &'a str>) -> Vec<String> {
    let mut others: Vec<String> = Vec::new();
    let mut rendered: Vec<(&str, u64, u64, usize)> = Vec::new();
    for words in words {
        let samples = words.strip_suffix(" samples per pixel").and_then(|rest| rest.rsplit_once(", "));
        match samples.and_then(|(technique, n)| Some((technique, n.parse::<u64>().ok()?))) {
            Some((technique, n)) => match rendered.iter_mut().find(|r| r.0 == technique) {
                Some(known) => *known = (technique, known.1.min(n), known.2.max(n), known.3 + 1),
                None => rendered.push((technique, n, n, 1)),
            },
            None if !others.iter().any(|o| o == words) => others.push(words.to_owned()),
            None => {}
        }
    }
    let together = rendered.into_iter().map(|(technique, least, most, count)| {
        let samples = if least == most { least.to_string() } else { format!("{least} to {most}") };
        let pictures = if count > 1 { format!(" ({count} pictures)") } else { String::new() };
        format!("{technique}, {samples} samples per pixel{pictures}")
    });
    together.chain(others).collect()
}

fn short(hash: &str) -> &str {
    hash.get(..8).unwrap_or(hash)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn references_of_one_technique_are_said_together() {
        let words = [
            "bpt, 16 samples per pixel",
            "nee, 8 samples per pixel",
            "sky.exr",
            "bpt, 64 samples per pixel",
            "sky.exr",
        ];
        let said = references(words.into_iter());
        assert_eq!(said, ["bpt, 16 to 64 samples per pixel (2 pictures)", "nee, 8 samples per pixel", "sky.exr"]);
    }
}
