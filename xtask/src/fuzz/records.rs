//! What the repository records of the runs of targets: their tallies and small corpora, so that a run
//! on another machine continues them.

use std::fs;
use std::path::{Path, PathBuf};

use super::{Tally, Target, files, if_present, make_folder};

/// Bytes of inputs of each target that the repository records.
const RECORDED: u64 = 48 << 10;
/// Maximum number of inputs of each target that the repository records.
const MAX_INPUTS: usize = 128;

impl Target<'_> {
    /// Takes over what the repository records of the target; the tally only if no run was
    /// interrupted here.
    pub(super) fn recall(&self) -> Result<(), String> {
        let recorded = self.records.join(self.name);
        if let Ok(inputs) = files(&recorded) {
            copy(&inputs, &self.corpus())?;
        }
        if !self.tally().exists() {
            if_present(fs::copy(recorded.with_extension("json"), self.tally()))?;
        }
        Ok(())
    }

    /// Records the tally and some of the smallest inputs of the corpus in the repository, without findings,
    /// which are files of this machine.
    pub(super) fn record(&self, tally: &Tally) -> Result<(), String> {
        let recorded = self.records.join(self.name);
        if_present(fs::remove_dir_all(&recorded))?;
        let mut inputs = files(&self.corpus())?;
        let size = |file: &PathBuf| fs::metadata(file).map_or(0, |m| m.len());
        inputs.sort_by_key(size);
        let mut room = RECORDED;
        inputs.retain(|file| {
            room = room.saturating_sub(size(file));
            room > 0
        });
        let step = inputs.len().div_ceil(MAX_INPUTS).max(1);
        let inputs: Vec<PathBuf> = inputs.into_iter().step_by(step).collect();
        copy(&inputs, &recorded)?;
        let tally = Tally {
            findings: Vec::new(),
            ..tally.clone()
        };
        let text = serde_json::to_string_pretty(&tally).map_err(|e| e.to_string())?;
        fs::write(recorded.with_extension("json"), text + "\n").map_err(|e| e.to_string())
    }
}

/// Copies files into a folder.
fn copy(files: &[PathBuf], folder: &Path) -> Result<(), String> {
    make_folder(folder)?;
    for file in files {
        let to = folder.join(file.file_name().unwrap_or_default());
        fs::copy(file, &to).map_err(|e| format!("{}: {e}", to.display()))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;

    #[test]
    fn what_is_recorded_is_continued_in_another_folder() {
        let places = [(); 3].map(|()| tempfile::tempdir().unwrap());
        let [first, second, records] = [0, 1, 2].map(|i: usize| places[i].path());
        let target = |out| Target {
            name: "obj",
            reader: &[],
            program: PathBuf::new(),
            out,
            records,
        };
        let corpus = target(first).corpus();
        make_folder(&corpus).unwrap();
        fs::write(corpus.join("small"), "v 1 2 3").unwrap();
        fs::write(corpus.join("large"), vec![0; RECORDED as usize]).unwrap();
        let tally = Tally {
            inputs: 7,
            ..Tally::default()
        };
        target(first).record(&tally).unwrap();
        target(second).recall().unwrap();
        assert_eq!(target(second).interrupted().unwrap().inputs, 7);
        let inputs = files(&target(second).corpus()).unwrap();
        assert_eq!(inputs, [target(second).corpus().join("small")]);
        for i in 0..2 * MAX_INPUTS {
            fs::write(corpus.join(i.to_string()), "v 1 2 3").unwrap();
        }
        target(first).record(&tally).unwrap();
        let count = files(&records.join("obj")).unwrap().len();
        assert!((MAX_INPUTS / 2..=MAX_INPUTS).contains(&count), "{count}");
    }
}
