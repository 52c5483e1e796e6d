//! Which runs a file names, in the way of its format.

use std::path::Path;

use crate::output::report::Provenance;
use crate::output::{exr, png};

/// What a file says about itself.
pub struct Named {
    /// The runs that it shows.
    pub runs: Vec<String>,
    /// Samples per pixel of the one picture that it is, if it is one.
    pub samples: Option<u64>,
}

/// Reads which runs a file shows: metadata of EXR and PNG, comments of text formats, columns of CSV, the document
/// information of PDF. A run's folder shows the run.
///
/// # Errors
/// When the file cannot be read or names no run, in words for people.
pub fn read(file: &Path) -> Result<Named, String> {
    let file = if file.is_dir() { file.join("final.exr") } else { file.to_owned() };
    let bytes = std::fs::read(&file).map_err(|e| format!("cannot read {}: {e}", file.display()))?;
    let extension = file.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let named = match extension.as_str() {
        "exr" => exr::decode(&bytes).map(|(_, meta)| of_metadata(&meta)).map_err(|e| e.to_string()),
        "png" => png::texts(&bytes).map(|meta| of_metadata(&meta)).map_err(|e| e.to_string()),
        "csv" => Ok(Named { runs: of_csv(&String::from_utf8_lossy(&bytes)), samples: None }),
        _ => Ok(Named { runs: Provenance::parse(&String::from_utf8_lossy(&bytes)), samples: None }),
    };
    let named = named.map_err(|e| format!("{}: {e}", file.display()))?;
    if named.runs.is_empty() {
        return Err(format!(
            "{} names no run; expected a picture, figure, table or data file that lumbre wrote, or a run's folder",
            file.display()
        ));
    }
    Ok(named)
}

fn of_metadata(meta: &[(String, String)]) -> Named {
    let get = |name: &str| meta.iter().find(|(key, _)| key == name).map(|(_, value)| value.clone());
    match get("run") {
        Some(run) => Named { runs: vec![run], samples: get("samples").and_then(|n| n.parse().ok()) },
        None => Named { runs: get("Description").map(|d| Provenance::parse(&d)).unwrap_or_default(), samples: None },
    }
}

/// The ids in the columns `run` and `run_ids`. They hold no comma and come before or after all fields that may, so that
/// counting from the nearer end finds them.
fn of_csv(text: &str) -> Vec<String> {
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let from_start = header.iter().position(|name| *name == "run");
    let from_end = header.iter().rposition(|name| *name == "run_ids").map(|at| header.len() - 1 - at);
    let is_id = |word: &&str| word.len() == 32 && word.bytes().all(|b| b.is_ascii_hexdigit());
    let mut runs: Vec<String> = Vec::new();
    for line in lines {
        let first = from_start.and_then(|at| line.split(',').nth(at));
        let last = from_end.and_then(|at| line.rsplit(',').nth(at));
        for id in first.into_iter().chain(last).flat_map(|field| field.split(' ')).filter(is_id) {
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
    fn columns_of_data_and_tables_are_found_beside_quoted_commas() {
        let (a, b) = ("a".repeat(32), "b".repeat(32));
        let data = format!("program,night,plan,run,axis.x\nlumbre 0.1.0,n,{b},{a},\"1,2\"\n");
        assert_eq!(of_csv(&data), [a.as_str()], "the plan's hash is no run");
        let table = format!("x,value,run_ids\n\"1,2\",0.5,{a} {b}\n3,0.5,{a}\n");
        assert_eq!(of_csv(&table), [a, b]);
        assert!(of_csv("x,y\n1,2\n").is_empty());
    }
}
