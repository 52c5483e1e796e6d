//! Run ids in result files, read according to the format of the file.

use std::path::Path;

use lumbre_night::paths::extension;
use lumbre_night::store::schema::run::ConfigFile;
use lumbre_night::store::{StoredFile, regular_file};
use lumbre_report::provenance::Provenance;
use lumbre_report::{exr, png};

/// Runs that a file names.
pub struct RunIds {
    /// Ids of the runs.
    pub runs: Vec<String>,
    /// Number of samples per pixel, if the file is a picture of one run.
    pub samples: Option<u64>,
}

/// Endings of the files that a figure or a table is written to beside its numbers, which name the
/// runs where the numbers do not.
const DRAWN: [&str; 2] = ["svg", "md"];

/// Reads the run ids in a file: metadata of EXR and PNG, comments of text formats, columns of CSV,
/// or the document information of PDF. Numbers without ids have those of the drawing beside them.
/// For the folder of a run, returns that run.
///
/// # Errors
/// Returns a message if the file cannot be read or names no run.
pub fn read(file: &Path) -> Result<RunIds, String> {
    if file.join(ConfigFile::NAME).is_file() {
        let folder = std::fs::canonicalize(file).unwrap_or_else(|_| file.to_owned());
        let name = folder.file_name().unwrap_or_default();
        return Ok(RunIds {
            runs: vec![name.to_string_lossy().into_owned()],
            samples: None,
        });
    }
    let bytes =
        regular_file::read(file).map_err(|e| format!("cannot read {}: {e}", file.display()))?;
    let ids = match extension(file).as_str() {
        "exr" => exr::decode(&bytes)
            .map(|(_, meta)| from_metadata(&meta))
            .map_err(|e| e.to_string()),
        "png" => png::texts(&bytes)
            .map(|meta| from_metadata(&meta))
            .map_err(|e| e.to_string()),
        "csv" => Ok(RunIds {
            runs: from_csv(&String::from_utf8_lossy(&bytes)),
            samples: None,
        }),
        _ => Ok(RunIds {
            runs: Provenance::parse(&String::from_utf8_lossy(&bytes)),
            samples: None,
        }),
    };
    let ids = ids.map_err(|e| format!("{}: {e}", file.display()))?;
    if ids.runs.is_empty() {
        let mut beside = DRAWN.iter().map(|ending| file.with_extension(ending));
        let drawn = beside.find(|drawn| extension(file) == "csv" && drawn.is_file());
        if let Some(drawn) = drawn {
            return read(&drawn);
        }
        return Err(format!(
            "{} names no run; give a picture, figure, table or data file written by lumbre, or \
             the folder of a run",
            file.display()
        ));
    }
    Ok(ids)
}

/// Reads run ids from the metadata of a picture: the key `run`, or a description of a figure.
fn from_metadata(meta: &[(String, String)]) -> RunIds {
    let get = |name: &str| {
        meta.iter()
            .find(|(key, _)| key == name)
            .map(|(_, value)| value.clone())
    };
    match get("run") {
        Some(run) => RunIds {
            runs: vec![run],
            samples: get("samples").and_then(|n| n.parse().ok()),
        },
        None => RunIds {
            runs: get("Description")
                .map(|d| Provenance::parse(&d))
                .unwrap_or_default(),
            samples: None,
        },
    }
}

/// Returns the ids in the columns `run` and `run_ids` of a CSV file. Ids contain no commas. All
/// fields that may contain commas come after `run` and before `run_ids`, so the columns are found
/// by counting commas from the start for `run` and from the end for `run_ids`.
fn from_csv(text: &str) -> Vec<String> {
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let from_start = header.iter().position(|name| *name == "run");
    let from_end = header
        .iter()
        .rposition(|name| *name == "run_ids")
        .map(|at| header.len() - 1 - at);
    let is_id = |text: &&str| text.len() == 32 && text.bytes().all(|b| b.is_ascii_hexdigit());
    let mut runs: Vec<String> = Vec::new();
    for line in lines {
        let first = from_start.and_then(|at| line.split(',').nth(at));
        let last = from_end.and_then(|at| line.rsplit(',').nth(at));
        for id in first
            .into_iter()
            .chain(last)
            .flat_map(|field| field.split(' '))
            .filter(is_id)
        {
            if !runs.iter().any(|run| run == id) {
                runs.push(id.to_owned());
            }
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn id_columns_of_data_and_tables_are_found_beside_quoted_commas() {
        let (a, b) = ("a".repeat(32), "b".repeat(32));
        let data = format!("program,night,plan,run,axis.x\nlumbre 0.1.0,n,{b},{a},\"1,2\"\n");
        assert_eq!(
            from_csv(&data),
            [a.as_str()],
            "the plan's hash is not a run id"
        );
        let table = format!("x,value,run_ids\n\"1,2\",0.5,{a} {b}\n3,0.5,{a}\n");
        assert_eq!(from_csv(&table), [a, b]);
        assert!(from_csv("x,y\n1,2\n").is_empty());
    }
}
