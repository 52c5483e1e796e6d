//! `lumbre export NIGHT`: pictures and numbers of a night for viewers and scripts of others: the JERI
//! viewer, figuregen, and tables.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value as Json, json};

use crate::cli::args::{ExportArgs, Global};
use crate::cli::exit::{Exit, Failure, print_result, print_status};
use crate::cli::format::{counted, display_path};
use lumbre_night::store::read::night::read_night;
use lumbre_night::store::{self, Evidence};
use lumbre_report::report::{self, Member, ReportOptions, Study};

/// Script that draws the exported pictures with figuregen.
const FIGURE: &str = include_str!("figuregen.py");

/// Exports the night that `args` names.
pub fn main(args: &ExportArgs, global: &Global) -> Result<Exit, Failure> {
    let evidence = Evidence::default();
    let nights = [read_night(&args.file, &evidence).map_err(Failure::usage)?];
    let study = Study::new(&nights, &ReportOptions::default()).map_err(Failure::usage)?;
    let kind = match (args.jeri, args.figuregen) {
        (true, _) => "jeri",
        (_, true) => "figuregen",
        _ => "csv",
    };
    let folder = args.folder.clone();
    let folder = folder.unwrap_or_else(|| PathBuf::from(format!("{}-{kind}", nights[0].plan.name)));
    let mut export = Export {
        folder: &folder,
        evidence: &evidence,
        written: 0,
    };
    let shown = match kind {
        "jeri" => {
            let tree = json!({ "title": study.nights[0].plan.name, "children": jeri(&mut export, &study)? });
            export.write("data.js", format!("const data = {tree:#};\n").as_bytes())?
        }
        "figuregen" => {
            let rows = figuregen(&mut export, &study)?;
            export.write(
                "figure.json",
                format!("{:#}\n", json!({ "rows": rows })).as_bytes(),
            )?;
            export.write("figure.py", FIGURE.as_bytes())?
        }
        _ => {
            for item in report::data(&study) {
                for (name, bytes) in item.files().map_err(Failure::internal)? {
                    export.write(name.trim_start_matches("data/"), &bytes)?;
                }
            }
            folder.join("runs.csv")
        }
    };
    let written = export.written;
    let problems = evidence.problems();
    for problem in &problems {
        print_status(&format!("left out: {problem}"));
    }
    if !global.quiet {
        print_status(&format!(
            "wrote {} to {}",
            counted(written, "file"),
            display_path(&folder)
        ));
    }
    print_result(&format!("{}\n", display_path(&shown)))?;
    Ok(Exit::unless_problems(!problems.is_empty()))
}

/// Export in progress.
struct Export<'a> {
    folder: &'a Path,
    evidence: &'a Evidence,
    /// Number of files written so far.
    written: usize,
}

impl Export<'_> {
    /// Writes a file of the export and returns its path.
    fn write(&mut self, name: &str, bytes: &[u8]) -> Result<PathBuf, Failure> {
        let path = self.folder.join(name);
        let made = path.parent().map_or(Ok(()), fs::create_dir_all);
        made.map_err(|e| Failure::usage(format!("{}: {e}", display_path(self.folder))))?;
        store::write_atomically(&path, bytes).map_err(Failure::usage)?;
        self.written += 1;
        Ok(path)
    }

    /// Copies a picture of the night. Returns its path in the export, or `None` if it is left out
    /// because it does not match its checksum.
    fn copy(&mut self, from: &Path, name: &str) -> Result<Option<String>, Failure> {
        let Ok(bytes) = self.evidence.read(from) else {
            return Ok(None);
        };
        let name = format!("pictures/{name}.exr");
        self.write(&name, &bytes)?;
        Ok(Some(name))
    }

    /// Copies the reference and the final picture of the first finished repeat of each series of a
    /// facet, with the run of each picture. The reference is that of the first series.
    fn facet<'a>(&mut self, study: &'a Study, facet: usize) -> Result<FacetPictures<'a>, Failure> {
        let mut pictures = FacetPictures::default();
        for series in 0..study.series.len() {
            let Some(member) = study.finished(facet, series).into_iter().next() else {
                continue;
            };
            let reference = member
                .run
                .reference
                .and_then(|i| member.night.references.get(i));
            let picture = reference.and_then(|reference| reference.picture.as_deref());
            if let (None, Some(picture)) = (&pictures.reference, picture)
                && picture
                    .extension()
                    .is_some_and(|extension| extension == "exr")
            {
                pictures.reference = self.copy(picture, &format!("{facet}-reference"))?;
            }
            if let Some((_, picture)) = member.run.pictures.last()
                && let Some(file) = self.copy(picture, &format!("{facet}-{series}"))?
            {
                pictures.series.push((series, file, member));
            }
        }
        Ok(pictures)
    }
}

/// Files of the pictures of one facet.
#[derive(Default)]
struct FacetPictures<'a> {
    reference: Option<String>,
    /// Index of the series, file, and run.
    series: Vec<(usize, String, Member<'a>)>,
}

/// Title of a facet; the name of the night if there is only one.
fn title(study: &Study, facet: usize) -> String {
    match study.facet_label(facet).as_str() {
        "" => study.nights[0].plan.name.clone(),
        label => label.to_owned(),
    }
}

/// Returns the tree of pictures that the component `ImageViewer` of JERI takes: a tab for each
/// facet, with its reference and series.
fn jeri(export: &mut Export, study: &Study) -> Result<Vec<Json>, Failure> {
    let mut tabs = Vec::new();
    for facet in 0..study.facets.len() {
        let pictures = export.facet(study, facet)?;
        let reference = pictures.reference;
        let mut children: Vec<Json> = reference
            .iter()
            .map(|file| json!({ "title": "Reference", "image": file }))
            .collect();
        for (series, file, _) in &pictures.series {
            let title = study.series[*series].full_label();
            children.push(match &reference {
                Some(reference) => json!({
                    "title": title, "image": file, "compareTo": { "reference": reference },
                }),
                None => json!({ "title": title, "image": file }),
            });
        }
        if !children.is_empty() {
            tabs.push(json!({ "title": title(study, facet), "children": children }));
        }
    }
    Ok(tabs)
}

/// Returns the rows of a figure: for each facet its reference and series with their errors.
fn figuregen(export: &mut Export, study: &Study) -> Result<Vec<Json>, Failure> {
    let mut rows = Vec::new();
    for facet in 0..study.facets.len() {
        let pictures = export.facet(study, facet)?;
        let series = pictures.series.iter().map(|(series, file, member)| {
            let last = member.run.rows.last();
            let errors = study.metrics.iter().enumerate().filter_map(|(i, metric)| {
                let value = member.value(last?, i).filter(|value| value.is_finite())?;
                Some((metric.column.clone(), Json::from(value)))
            });
            json!({
                "title": study.series[*series].full_label(),
                "image": file,
                "run": member.run.id,
                "samples": last.map(|row| row.samples),
                "render_s": last.map(|row| row.render_s),
                "errors": errors.collect::<serde_json::Map<_, _>>(),
            })
        });
        let series: Vec<Json> = series.collect();
        if !series.is_empty() {
            rows.push(json!({
                "title": title(study, facet), "reference": pictures.reference, "series": series,
            }));
        }
    }
    Ok(rows)
}
