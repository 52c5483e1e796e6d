//! What a night of many short cells leaves behind and takes while it goes on.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use serde_json::{Value as Json, json};

use super::night::BALL;
use crate::experiment::memory;

/// Cells of the night.
const CELLS: usize = 400;

/// Bytes of memory after a quarter of the cells and after nearly all of them, where the system tells, and files.
pub struct Long {
    early: Option<u64>,
    late: Option<u64>,
    /// The most files of one run, snapshots and films aside.
    files: usize,
}

impl Long {
    /// Renders it on the mock backend, by this program in a process of its own.
    ///
    /// # Errors
    /// When it cannot be rendered, with a message for people.
    pub fn measure() -> Result<Long, String> {
        let program = std::env::current_exe().map_err(|e| e.to_string())?;
        let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
        let (scene, script, out) =
            (folder.path().join("ball.scn"), folder.path().join("long.lua"), folder.path().join("out"));
        let text = format!(
            "local x = experiment('long', {{ seed = 1 }})\n\
             x:axis('ior', linspace(1.1, 2.0, 20))\n\
             x:axis('depth', range(1, {}))\n\
             x:render(function(p) return {{ scene = {:?}, integrator = 'bpt', max_depth = p.depth, backend = 'mock',\n\
               set = {{ ['materials.ball.ior'] = p.ior }} }} end)\n\
             x:stop(stop.samples(4))\n\
             return x\n",
            CELLS / 20,
            scene.display().to_string()
        );
        fs::write(&scene, BALL).and_then(|()| fs::write(&script, text)).map_err(|e| e.to_string())?;
        let mut night = Command::new(program)
            .args(["run", "--no-tui", "-q", "--out"])
            .args([&out, &script])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|e| e.to_string())?;
        let (mut early, mut late) = (None, None);
        let ended = loop {
            if let Some(status) = night.try_wait().map_err(|e| e.to_string())? {
                break status;
            }
            let (done, memory) = (finished(&out), memory::of_process(&night.id().to_string(), "VmRSS:"));
            match done {
                done if done < CELLS / 4 => {}
                done if done < CELLS => {
                    early = early.or(memory);
                    late = memory.or(late);
                }
                _ => {}
            }
            sleep(Duration::from_millis(50));
        };
        match (ended.success(), finished(&out)) {
            (true, CELLS) => Ok(Long { early, late, files: most_files(&out) }),
            (_, done) => Err(format!("the night of short cells ended with {ended} after {done} of {CELLS}")),
        }
    }

    /// The lines of the table for people.
    pub fn table(&self) -> String {
        let memory =
            |bytes: Option<u64>| bytes.map_or_else(|| "        -".to_owned(), |b| format!("{:>9.1}", b as f64 / 1e6));
        format!(
            "memory of a night, after {:<4} cells   {} MB\n\
             memory of a night, after {:<4} cells   {} MB\n\
             files of a run                       {:>9}\n",
            CELLS / 4,
            memory(self.early),
            CELLS,
            memory(self.late),
            self.files
        )
    }

    /// The same figures as JSON.
    pub fn to_json(&self) -> Json {
        json!({ "cells": CELLS, "memory_early_bytes": self.early, "memory_late_bytes": self.late, "files_per_run": self.files })
    }
}

/// Cells that are done, as the journal says.
fn finished(out: &Path) -> usize {
    let journal = fs::read_to_string(out.join("latest").join("journal.jsonl")).unwrap_or_default();
    journal.lines().filter(|line| line.contains("cell_finished")).count()
}

/// The most files that stand in the folder of one run.
fn most_files(folder: &Path) -> usize {
    let entries: Vec<_> = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()).collect();
    let own = entries.iter().filter(|path| path.is_file() && !name_of(path).starts_with("snap-"));
    let own = if folder.join("done.json").is_file() { own.count() } else { 0 };
    let folders = entries.iter().filter(|path| path.is_dir() && !path.is_symlink());
    folders.map(|path| most_files(path)).max().unwrap_or(0).max(own)
}

fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}
