//! Methods paragraph for a paper: how the numbers were obtained.

use super::cite;
use super::item::ReportItem;
use super::study::{Member, Study};
use crate::provenance::Provenance;
use lumbre_light::transport::integrator::{IntegratorRow, integrators};
use lumbre_metrics::MetricSpec;
use lumbre_night::experiment::night::Night;
use lumbre_night::experiment::night::reference::ReferenceOrigin;
use lumbre_night::text::program;
use lumbre_render::denoise::BIAS;
use std::collections::BTreeSet;

/// Maximum number of different ends of runs that the paragraph lists.
const MOST_REASONS: usize = 4;

/// Builds `methods.tex` and `methods.md`: hardware, versions, seeds, references, and sources of the
/// techniques and metrics; and `references.bib`, the works that the paragraph cites.
pub fn items(study: &Study) -> [ReportItem; 2] {
    let provenance = Provenance::from_members(study.all());
    let sentences = sentences(study);
    let markdown = format!("{}\n\n{}", sentences.join(" "), provenance.markup_comment());
    let tex: String = sentences.iter().map(|s| cite::latex(s) + "\n").collect();
    // The text first: a night has hundreds of runs.
    let tex = format!("{tex}{}", provenance.comment("% "));
    let cited = cite::bibliography(sentences.iter().map(String::as_str));
    let texts = vec![("md", markdown.into_bytes()), ("tex", tex.into_bytes())];
    let works = vec![("bib", cited.into_bytes())];
    let about = "Works that the methods cite, as BibTeX.".to_owned();
    let methods = sentences.join(" ");
    [
        ReportItem::data("methods", "Methods", methods, texts, provenance.clone()),
        ReportItem::data("references", "References", about, works, provenance),
    ]
}

fn sentences(study: &Study) -> Vec<String> {
    let mut out = Vec::new();
    for (night, name) in study.nights.iter().zip(&study.names) {
        let name = (study.nights.len() > 1).then_some(name.as_str());
        out.push(experiment(night, name));
        out.push(format!(
            "All seeds derive from experiment seed {}: configurations of the same repeat share a \
             seed, and references use a separate seed.",
            night.plan.seed
        ));
    }
    out.extend(scenes_and_sizes(study));
    out.push(run_count(study));
    out.extend(techniques(study));
    out.extend(external_renderers(study));
    out.extend(denoisers(study));
    out.extend(references(study));
    out.extend(study.metrics.iter().map(definition));
    out.push(shown_by(study));
    out.push(
        "Render time is the time spent inside the renderer, without the time that other programs \
         took from its threads, where the system tells it."
            .to_owned(),
    );
    out.push("Measuring, encoding and writing between its waves are excluded.".to_owned());
    out.push("Curves are means over repeats with 95 % confidence intervals.".to_owned());
    out.push(
        "In tables, the best value of a row is bold only if it is significantly better than every \
         other value at 5 %: Student's t of the differences of repeats, or Welch's test [Welch 1947] \
         where repeats differ, corrected for the number of pairs [Dunn 1961]. The error of the \
         reference's noise is part of the test."
            .to_owned(),
    );
    out.push(format!("Figures and tables were made with {}.", program()));
    out
}

/// Returns sentences on the references that errors were measured against, and on their comparisons
/// with other techniques.
fn references(study: &Study) -> Vec<String> {
    let nights = study.nights.iter();
    let used: Vec<_> = nights
        .flat_map(Night::references_of_runs)
        .filter(|reference| reference.picture.is_some())
        .collect();
    let origins = merged_references(used.iter().map(|reference| &reference.origin));
    if origins.is_empty() {
        return Vec::new();
    }
    let mut out = vec![format!(
        "Errors were measured against references: {}.",
        origins.join("; ")
    )];
    let checks = used.iter().flat_map(|reference| &reference.checks);
    out.extend(checks.map(|check| {
        format!(
            "A reference was compared with `{}`: {}.",
            check.technique, check.finding
        )
    }));
    out
}

/// Describes the experiment of a night, its program and its devices. `name` is given if there are
/// several nights.
fn experiment(night: &Night, name: Option<&str>) -> String {
    let devices = night.devices();
    let on = if devices.is_empty() {
        String::new()
    } else {
        format!(" on {}", devices.join(" and "))
    };
    let name = name.map_or(String::new(), |name| format!("{name}, "));
    let given = match night.given_settings() {
        given if given.is_empty() => given,
        given => format!(" It was {given}."),
    };
    let (machine, program) = match &night.machine {
        Some(m) => (
            format!(", {} with {} cores", m.os, m.cores),
            m.program.clone(),
        ),
        None => (String::new(), "an unknown version of lumbre".to_owned()),
    };
    format!(
        "Experiment {} ({name}plan {}) was rendered with {program}{on}{machine}.{given}",
        night.plan.name,
        night.plan.hash.get(..8).unwrap_or(&night.plan.hash)
    )
}

/// Describes how pictures in figures are shown.
fn shown_by(study: &Study) -> String {
    match study.display() {
        Some(display) => format!("Pictures in figures are shown by the tone map {display}."),
        None => "Pictures in figures are shown in sRGB; the exposure of each figure, in whole \
                 stops, is chosen from its reference and stated in it."
            .to_owned(),
    }
}

/// Returns sentences on the scenes of all runs, the sizes of their pictures and the clauses that
/// ended them, where these are known.
fn scenes_and_sizes(study: &Study) -> Vec<String> {
    let distinct = |texts: Vec<String>| {
        let mut distinct: Vec<String> = Vec::new();
        for text in texts {
            if !text.is_empty() && !distinct.contains(&text) {
                distinct.push(text);
            }
        }
        distinct
    };
    let scenes = distinct(study.all().map(|m| m.run.scene.clone()).collect());
    let size = |[width, height]: [u32; 2]| format!("{width} × {height}");
    let sizes = study.all().filter_map(|m| m.run.resolution.map(size));
    let sizes = distinct(sizes.collect());
    let reason = |member: Member| member.run.end_clause().to_owned();
    let ends = distinct(study.all().map(reason).collect());
    let mut out = Vec::new();
    if !scenes.is_empty() {
        let noun = if scenes.len() == 1 { "scene" } else { "scenes" };
        let scenes: Vec<String> = scenes.iter().map(|s| changed(study, s)).collect();
        out.push(format!("It renders the {noun} {}.", scenes.join(", ")));
    }
    let depths = study.all().filter_map(|m| m.run.max_depth);
    let mut depths: Vec<u32> = depths.collect();
    depths.sort_unstable();
    depths.dedup();
    let depths: Vec<String> = depths.iter().map(u32::to_string).collect();
    if !depths.is_empty() {
        out.push(format!("Paths have at most {} edges.", depths.join(" or ")));
    }
    if !sizes.is_empty() {
        out.push(format!("Pictures have {} pixels.", sizes.join(" or ")));
    }
    if !ends.is_empty() && ends.len() <= MOST_REASONS {
        out.push(format!(
            "Each run ended by its stop rule: {}.",
            ends.join("; ")
        ));
    }
    out
}

/// Returns the name of a scene with its options and the changes to it: those that all of its runs
/// share with their values, others by name.
fn changed(study: &Study, scene: &str) -> String {
    let runs: Vec<Member> = study.all().filter(|m| m.run.scene == scene).collect();
    let names: BTreeSet<&String> = runs.iter().flat_map(|m| m.run.changes.keys()).collect();
    let describe = |name: &String| {
        let mut values = runs.iter().map(|m| m.run.changes.get(name));
        let first = values.next().flatten();
        match first {
            Some(value) if values.all(|other| other == first) => format!("{name} = {value}"),
            _ => format!("different {name}"),
        }
    };
    let changes: Vec<String> = names.into_iter().map(describe).collect();
    match changes.as_slice() {
        [] => scene.to_owned(),
        changes => format!("{scene} with {}", changes.join(", ")),
    }
}

fn run_count(study: &Study) -> String {
    let finished = study.all().filter(|m| m.run.is_done()).count();
    let repeats = study.all().map(|m| m.run.repeat + 1).max().unwrap_or(1);
    if repeats > 1 {
        format!(
            "{finished} runs finished, with {repeats} repeats of each configuration under \
             different seeds."
        )
    } else {
        format!("{finished} runs finished, one for each configuration.")
    }
}

/// Returns a sentence for each technique of this program, with its sources.
fn techniques(study: &Study) -> Vec<String> {
    let is_used = |row: &&IntegratorRow| study.all().any(|m| m.run.integrator == row.name);
    let sentence = |row: &IntegratorRow| {
        let sources = cite::in_brackets(row.doc);
        let space = if sources.is_empty() { "" } else { " " };
        format!("`{}` is {}{space}{sources}.", row.name, row.long_name)
    };
    integrators().filter(is_used).map(sentence).collect()
}

/// Returns a sentence for each technique that was rendered by an external program.
fn external_renderers(study: &Study) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    for (run, peer) in study
        .all()
        .filter_map(|m| Some((m.run, m.run.peer.as_ref()?)))
    {
        let clock = if peer.wall_clock {
            "; its render time is the wall-clock time of its processes, which includes starting \
             them and loading the scene"
        } else {
            ", which measures its render time itself"
        };
        let sentence = format!(
            "{} was rendered by {}{clock}.",
            run.integrator, peer.program
        );
        if !out.contains(&sentence) {
            out.push(sentence);
        }
    }
    out
}

/// Returns sentences on the denoisers of pictures.
fn denoisers(study: &Study) -> Vec<String> {
    let is_used = |name: &str| {
        let mut runs = study.all();
        runs.any(|m| m.run.denoise.as_deref() == Some(name))
    };
    let mut out = Vec::new();
    if is_used("atrous") {
        out.push(
            "Pictures of `denoise = atrous` were filtered by an edge-avoiding à-trous wavelet \
             filter with variance guidance [Dammertz et al. 2010; Schied et al. 2017]."
                .to_owned(),
        );
    }
    if is_used("oidn") {
        out.push(
            "Pictures of `denoise = oidn` were filtered by Open Image Denoise [Áfra 2019]."
                .to_owned(),
        );
    }
    if !out.is_empty() {
        out.push(format!(
            "Denoisers were guided by albedo and normals, and one denoising is part of each render \
             time. {BIAS}"
        ));
    }
    out
}

fn definition(metric: &MetricSpec) -> String {
    let options = metric.describe_options();
    let options = if options.is_empty() {
        String::new()
    } else {
        format!(" ({options})")
    };
    let unit = metric.unit();
    let unit = if unit.is_empty() {
        String::new()
    } else {
        format!(", in {unit}")
    };
    let doc = metric.row.doc.trim_end_matches('.');
    format!("{}{options}{unit}: {doc}.", metric.row.label)
}

/// Merges the descriptions of references that were rendered by the same technique, such as
/// `bpt, 16 to 1024 samples per pixel (12 pictures)`. Other descriptions are listed once each.
fn merged_references<'a>(origins: impl Iterator<Item = &'a ReferenceOrigin>) -> Vec<String> {
    let mut others: Vec<String> = Vec::new();
    // Technique, fewest and most samples, number of pictures.
    let mut rendered: Vec<(&str, u64, u64, usize)> = Vec::new();
    for origin in origins {
        match origin {
            ReferenceOrigin::Rendered {
                integrator,
                samples: n,
            } => match rendered.iter_mut().find(|r| r.0 == integrator) {
                Some((_, least, most, count)) => {
                    (*least, *most, *count) = ((*least).min(*n), (*most).max(*n), *count + 1);
                }
                None => rendered.push((integrator, *n, *n, 1)),
            },
            ReferenceOrigin::Other(text) if !others.contains(text) => others.push(text.clone()),
            ReferenceOrigin::Other(_) => {}
        }
    }
    let merged = rendered.into_iter().map(|(technique, least, most, count)| {
        let samples = if least == most {
            least.to_string()
        } else {
            format!("{least} to {most}")
        };
        let pictures = if count > 1 {
            format!(" ({count} pictures)")
        } else {
            String::new()
        };
        format!("{technique}, {samples} samples per pixel{pictures}")
    });
    merged.chain(others).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn references_of_one_technique_are_merged() {
        let rendered = |integrator: &str, samples| ReferenceOrigin::Rendered {
            integrator: integrator.to_owned(),
            samples,
        };
        let file = || ReferenceOrigin::Other("sky.exr".to_owned());
        let origins = [
            rendered("bpt", 16),
            rendered("nee", 8),
            file(),
            rendered("bpt", 64),
            file(),
        ];
        assert_eq!(
            merged_references(origins.iter()),
            [
                "bpt, 16 to 64 samples per pixel (2 pictures)",
                "nee, 8 samples per pixel",
                "sky.exr"
            ]
        );
    }
}
