//! Tallies of targets and archives of small corpora in the repository, so that a run on another
//! machine continues them.

use std::fs;
use std::path::PathBuf;

use std::process::Command;

use super::{Tally, Target, files, if_present, make_folder};
use crate::command::{execute, tar};

/// Bytes of inputs of each target that the repository records.
const RECORDED: u64 = 48 << 10;
/// Maximum number of inputs of each target that the repository records.
const MAX_INPUTS: usize = 128;

impl Target<'_> {
    /// Takes over what the repository records of the target; the tally only if no run was
    /// interrupted here.
    pub(super) fn recall(&self) -> Result<(), String> {
        let archive = self.archive();
        if archive.is_file() {
            make_folder(&self.corpus())?;
            let mut unpack = Command::new("tar");
            execute(unpack.arg("-C").arg(self.corpus()).arg("-xzf").arg(archive))?;
        }
        if !self.tally().exists() {
            let recorded = self.records.join(format!("{}.json", self.name));
            if_present(fs::copy(recorded, self.tally()))?;
        }
        Ok(())
    }

    /// Records the tally and some of the smallest inputs of the corpus in the repository, without findings,
    /// which are files of this machine.
    pub(super) fn record(&self, tally: &Tally) -> Result<(), String> {
        make_folder(self.records)?;
        let mut inputs = files(&self.corpus())?;
        let size = |file: &PathBuf| fs::metadata(file).map_or(0, |m| m.len());
        inputs.sort_by_key(size);
        let mut room = RECORDED;
        inputs.retain(|file| {
            room = room.saturating_sub(size(file));
            room > 0
        });
        let step = inputs.len().div_ceil(MAX_INPUTS).max(1);
        let names = inputs
            .iter()
            .step_by(step)
            .filter_map(|file| file.file_name());
        let mut pack = tar(&self.archive(), &self.corpus());
        execute(pack.args(names))?;
        let tally = Tally {
            findings: Vec::new(),
            ..tally.clone()
        };
        let text = serde_json::to_string_pretty(&tally).map_err(|e| e.to_string())?;
        let file = self.records.join(format!("{}.json", self.name));
        fs::write(file, text + "\n").map_err(|e| e.to_string())
    }

    /// Returns the archive of its small corpus.
    fn archive(&self) -> PathBuf {
        self.records.join(format!("{}.tar.gz", self.name))
    }
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
        let third = records.join("third");
        target(&third).recall().unwrap();
        let count = files(&target(&third).corpus()).unwrap().len();
        assert!((MAX_INPUTS / 2..=MAX_INPUTS).contains(&count), "{count}");
    }
}
