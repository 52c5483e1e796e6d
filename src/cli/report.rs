//! `lumbre report`: figures, tables, data and a page of whole nights, from their folders.

use std::path::{Path, PathBuf};

use super::args::{Global, ReportArgs};
use super::exit::{Exit, Failure, data, talk};
use super::load::{decode, shown};
use super::run::counted;
use crate::experiment::evidence::Night;
use crate::film::Image;
use crate::output::picture;
use crate::output::report::{self, Kind, Options, Report, ReportError, Study, Surroundings};
use crate::store;

/// Makes a report.
pub fn main(args: &ReportArgs, global: &Global) -> Result<Exit, Failure> {
    let nights: Vec<Night> =
        args.nights.iter().map(|dir| store::evidence::night(dir)).collect::<Result<_, _>>().map_err(Failure::usage)?;
    let to = match (&args.to, nights.as_slice()) {
        (Some(to), _) => to.clone(),
        (None, [first, ..]) => first.folder.join("report"),
        (None, []) => return Err(Failure::usage("no night was given")),
    };
    let options = Options {
        by: args.by.clone(),
        facet: args.facet.clone().map(|f| f.into_iter().filter(|axis| !axis.is_empty()).collect()),
        names: args.name.clone(),
        crops: args.crop.clone(),
        thresholds: args.threshold.clone(),
        at_time: args.at_time,
        heat: args.heat.clone(),
        sweep: args.sweep.clone(),
    };
    if nights.iter().all(|night| night.runs.iter().all(|run| run.rows.is_empty())) {
        return Err(Failure::usage(format!("{}: no run has been measured yet", shown(&nights[0].folder))));
    }
    let study = Study::new(&nights, &options).map_err(failure)?;
    store::probe(&to).map_err(Failure::usage)?;
    let to = std::fs::canonicalize(&to).unwrap_or(to);
    let link = |path: &Path| address(&to, path);
    let command = |run: &Path| format!("lumbre reproduce {}", quoted(&shown(&run.join("final.exr"))));
    let around = Surroundings { pictures: &picture, link: &link, command: &command };
    let made = report::build(&study, &options, &around).map_err(failure)?;
    write(&made, &to)?;
    if !global.quiet {
        for note in &made.notes {
            talk(&format!("note: {note}"));
        }
        let count = |kind: Kind| made.items.iter().filter(|item| item.kind == kind).count();
        talk(&format!(
            "{} and {} of {}",
            counted(count(Kind::Figure), "figure"),
            counted(count(Kind::Table), "table"),
            nights.iter().map(|n| shown(&n.folder)).collect::<Vec<_>>().join(", ")
        ));
    }
    data(&format!("{}\n", shown(&to.join("index.html"))))?;
    Ok(Exit::Done)
}

/// Writes every file of a report below `to`.
fn write(made: &Report, to: &Path) -> Result<(), Failure> {
    for item in &made.items {
        for (name, bytes) in item.files().map_err(Failure::internal)? {
            let path: PathBuf = to.join(name);
            if let Some(folder) = path.parent() {
                std::fs::create_dir_all(folder)
                    .map_err(|e| Failure::internal(format!("cannot create {}: {e}", folder.display())))?;
            }
            store::atomic(&path, &bytes).map_err(Failure::internal)?;
        }
    }
    Ok(())
}

/// The relative address of a path as seen from a folder, both absolute, with what an address cannot hold escaped.
fn address(from: &Path, to: &Path) -> String {
    let (a, b): (Vec<_>, Vec<_>) = (from.components().collect(), to.components().collect());
    let shared = a.iter().zip(&b).take_while(|(x, y)| x == y).count();
    let up = std::iter::repeat_n("..".to_owned(), a.len() - shared);
    let down = b[shared..].iter().map(|part| escaped(&part.as_os_str().to_string_lossy()));
    let parts: Vec<String> = up.chain(down).collect();
    if parts.is_empty() { ".".to_owned() } else { parts.join("/") }
}

fn escaped(part: &str) -> String {
    let keep = |b: u8| b.is_ascii_alphanumeric() || b"-_.=+,~".contains(&b);
    part.bytes().map(|b| if keep(b) { char::from(b).to_string() } else { format!("%{b:02X}") }).collect()
}

/// A path as a shell reads it.
fn quoted(path: &str) -> String {
    let plain = path.chars().all(|c| c.is_ascii_alphanumeric() || "/._-=+,".contains(c));
    if plain { path.to_owned() } else { format!("'{}'", path.replace('\'', "'\\''")) }
}

/// Reads a picture that a night kept, or one that a script named as its reference.
fn picture(path: &Path) -> Result<Image, String> {
    let bytes = std::fs::read(path).map_err(|e| format!("{}: {e}", path.display()))?;
    decode(&bytes)
        .or_else(|_| picture::decode(&bytes).map(|p| p.image).map_err(|e| e.to_string()))
        .map_err(|e| format!("{}: {e}", path.display()))
}

fn failure(error: ReportError) -> Failure {
    match error {
        ReportError::Output(e) => Failure::internal(e),
        other => Failure::usage(other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_relative_and_escaped() {
        let address = |from: &str, to: &str| address(Path::new(from), Path::new(to));
        assert_eq!(address("/out/night/report", "/out/night/runs/a=1/x"), "../runs/a=1/x");
        assert_eq!(address("/out/report", "/out/report"), ".");
        assert_eq!(address("/a", "/b c/d#e"), "../b%20c/d%23e");
        assert_eq!(quoted("out/it's here"), "'out/it'\\''s here'");
    }
}
