//! `lumbre report`: figures, tables, data files and a page for nights, from their folders.

use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};

use serde_json::{Value as Json, json};

use crate::cli::args::{Global, ReportArgs};
use crate::cli::exit::{Exit, Failure, print_result, print_status};
use crate::cli::format::{counted, display_path};
use crate::cli::night::load::decode_picture;
use crate::cli::{json, selector};
use lumbre_light::film::Image;
use lumbre_night::experiment::night::Night;
use lumbre_night::store::read::night::read_night;
use lumbre_night::store::{self, Evidence};
use lumbre_report::report::{
    self, ItemKind, Report, ReportContext, ReportError, ReportItem, ReportOptions, Study,
};
use lumbre_report::{exr, picture};
use lumbre_scene_io::uri;

/// Runs `lumbre report`: builds a report and writes its files.
pub fn main(args: &ReportArgs, global: &Global) -> Result<Exit, Failure> {
    let evidence = Evidence::default();
    let read = |night: Option<&Path>| {
        let folder = selector::night(night, &global.out)?;
        read_night(&folder, &evidence).map_err(Failure::usage)
    };
    let nights: Vec<Night> = if args.nights.is_empty() {
        vec![read(None)?]
    } else {
        let nights = args.nights.iter().map(|night| read(Some(night)));
        nights.collect::<Result<_, _>>()?
    };
    let to = match (&args.to, nights.as_slice()) {
        (Some(to), _) => to.clone(),
        (None, [first, ..]) => first.folder.join("report"),
        (None, []) => return Err(Failure::usage("no night was given")),
    };
    let options = report_options(args);
    check_measured(&nights, &evidence)?;
    store::probe(&to).map_err(Failure::usage)?;
    let to = std::fs::canonicalize(&to).unwrap_or(to);
    let report = build(&nights, &options, &evidence, &to, None)?;
    write_files(&report, &to)?;
    let problems = evidence.problems();
    print_problems(&problems);
    if !global.quiet {
        print_summary(&report, &nights);
    }
    if args.json {
        json::print(report_json(&report, &to))?;
    } else {
        print_result(&format!("{}\n", display_path(&to.join("index.html"))))?;
    }
    Ok(Exit::unless_problems(!problems.is_empty()))
}

/// Builds the report of nights for a folder `to`. `live` is the number of this state of a night
/// whose page is served.
pub(in crate::cli) fn build(
    nights: &[Night],
    options: &ReportOptions,
    evidence: &Evidence,
    to: &Path,
    live: Option<u64>,
) -> Result<Report, Failure> {
    let study = Study::new(nights, options).map_err(report_failure)?;
    let link = |path: &Path| relative_url(to, path);
    let command = |run: &Path| {
        format!(
            "lumbre reproduce {}",
            quoted(&display_path(&run.join("final.exr")))
        )
    };
    let folders = nights
        .iter()
        .map(|night| quoted(&display_path(&night.folder)));
    let mut again = format!("lumbre report {}", folders.collect::<Vec<_>>().join(" "));
    if nights.iter().all(|night| night.folder.join("report") != to) {
        again += &format!(" --to {}", quoted(&display_path(to)));
    }
    let context = ReportContext {
        pictures: &|path, group| match group {
            None => read_picture(path, evidence),
            Some(group) => exr::decode_group(&evidence.read(path)?, group)
                .map_err(|e| format!("{}: {e}", path.display())),
        },
        bytes: &|path| evidence.read(path),
        problems: &|| evidence.problems(),
        link: &link,
        command: &command,
        again: &again,
        live,
    };
    report::build(&study, options, &context).map_err(report_failure)
}

/// Returns the items of a report with their files, and its notes, as JSON.
fn report_json(report: &Report, to: &Path) -> Json {
    let item = |item: &ReportItem| {
        let extensions = item.extensions();
        let file = |extension: &&str| display_path(&to.join(format!("{}.{extension}", item.stem)));
        json!({
            "title": item.title, "section": item.section, "caption": item.caption,
            "files": extensions.iter().map(file).collect::<Vec<_>>(),
        })
    };
    json!({
        "folder": display_path(to),
        "items": report.items.iter().map(item).collect::<Vec<_>>(),
        "notes": report.notes,
    })
}

/// Prints what is left out of a report because it does not match its checksum, even with `--quiet`.
fn print_problems(problems: &[String]) {
    for problem in problems {
        print_status(&format!("left out: {problem}"));
    }
}

/// Refuses nights of which no run can be reported, and prints why.
pub(in crate::cli) fn check_measured(nights: &[Night], evidence: &Evidence) -> Result<(), Failure> {
    let mut runs = nights.iter().flat_map(|night| &night.runs);
    let Some(first) = nights
        .first()
        .filter(|_| runs.all(|run| run.rows.is_empty()))
    else {
        return Ok(());
    };
    let problems = evidence.problems();
    print_problems(&problems);
    let folder = display_path(&first.folder);
    Err(if problems.is_empty() {
        Failure::usage(format!(
            "{folder}: no run has been measured yet; render the experiment first"
        ))
    } else {
        Failure::damaged(format!(
            "{folder}: no run is left to report; run the experiment again to repair it"
        ))
    })
}

/// Converts the options of the command line.
fn report_options(args: &ReportArgs) -> ReportOptions {
    ReportOptions {
        by: args.by.clone(),
        facet: args
            .facet
            .clone()
            .map(|f| f.into_iter().filter(|axis| !axis.is_empty()).collect()),
        names: args.name.clone(),
        crops: args.crop.clone(),
        thresholds: args.threshold.clone(),
        at_time: args.at_time,
        heat: args.heat.clone(),
        sweep: args.sweep.clone(),
    }
}

/// Prints the notes of a report, and how many figures and tables it has.
fn print_summary(report: &Report, nights: &[Night]) {
    for note in &report.notes {
        print_status(&format!("note: {note}"));
    }
    let count = |kind: ItemKind| report.items.iter().filter(|item| item.kind == kind).count();
    print_status(&format!(
        "wrote {} and {} of {}",
        counted(count(ItemKind::Figure), "figure"),
        counted(count(ItemKind::Table), "table"),
        nights
            .iter()
            .map(|n| display_path(&n.folder))
            .collect::<Vec<_>>()
            .join(", ")
    ));
}

/// Name of the file with the names of all files of a report, one per line.
const FILE_LIST: &str = "files.txt";

/// Writes all files of a report below the folder `to`, and removes what a killed report left there,
/// and files of the last report that this one does not have.
fn write_files(report: &Report, to: &Path) -> Result<(), Failure> {
    let mut cleaned = BTreeSet::new();
    let mut written = BTreeSet::new();
    for item in &report.items {
        for (name, bytes) in item.files().map_err(Failure::internal)? {
            let path: PathBuf = to.join(&name);
            written.insert(name);
            let folder = path.parent().unwrap_or(to);
            if cleaned.insert(folder.to_owned()) {
                store::remove_temporaries(folder);
            }
            store::write_atomically(&path, &bytes).map_err(Failure::internal)?;
        }
    }
    let list = to.join(FILE_LIST);
    let last = std::fs::read_to_string(&list).unwrap_or_default();
    let is_below = |name: &str| {
        let mut parts = Path::new(name).components();
        parts.all(|part| matches!(part, Component::Normal(_)))
    };
    for name in last.lines().filter(|name| !written.contains(*name)) {
        if is_below(name) {
            // A file that cannot be removed is left: the page does not show it.
            let _ = std::fs::remove_file(to.join(name));
        }
    }
    let names: String = written.iter().map(|name| format!("{name}\n")).collect();
    store::write_atomically(&list, names.as_bytes()).map_err(Failure::internal)
}

/// Returns the relative URL of a path from a folder, with percent-encoding. Both paths are
/// absolute.
fn relative_url(from: &Path, to: &Path) -> String {
    let (a, b): (Vec<_>, Vec<_>) = (from.components().collect(), to.components().collect());
    let shared = a.iter().zip(&b).take_while(|(x, y)| x == y).count();
    let up = std::iter::repeat_n("..".to_owned(), a.len() - shared);
    let down = b[shared..]
        .iter()
        .map(|part| uri::encoded(&part.as_os_str().to_string_lossy()));
    let parts: Vec<String> = up.chain(down).collect();
    if parts.is_empty() {
        ".".to_owned()
    } else {
        parts.join("/")
    }
}

/// Quotes a path for the shell if necessary.
fn quoted(path: &str) -> String {
    let plain = path
        .chars()
        .all(|c| c.is_ascii_alphanumeric() || "/._-=+,".contains(c));
    if plain {
        path.to_owned()
    } else {
        format!("'{}'", path.replace('\'', "'\\''"))
    }
}

/// Reads a picture of a night, or a picture of any known format that a script uses as a reference.
pub(in crate::cli) fn read_picture(path: &Path, evidence: &Evidence) -> Result<Image, String> {
    let bytes = evidence.read(path)?;
    decode_picture(&bytes)
        .or_else(|_| {
            picture::decode(&bytes)
                .map(|p| p.image)
                .map_err(|e| e.to_string())
        })
        .map_err(|e| format!("{}: {e}", path.display()))
}

/// Converts an error of a report: failed output is internal, all else is a usage error.
fn report_failure(error: ReportError) -> Failure {
    match error {
        ReportError::Output(e) => Failure::internal(e),
        other => Failure::usage(other),
    }
}

#[cfg(test)]
mod tests {
    use crate::cli::inspect::report::*;

    #[test]
    fn addresses_are_relative_and_escaped() {
        let url = |from: &str, to: &str| relative_url(Path::new(from), Path::new(to));
        assert_eq!(
            url("/out/night/report", "/out/night/runs/a=1/x"),
            "../runs/a=1/x"
        );
        assert_eq!(url("/out/report", "/out/report"), ".");
        assert_eq!(url("/a", "/b c/d#e"), "../b%20c/d%23e");
        assert_eq!(quoted("out/it's here"), "'out/it'\\''s here'");
    }
}
