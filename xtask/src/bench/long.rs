//! Memory and number of files of a night of many short cells.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use super::night::BALL;
use lumbre_night::experiment::memory;
use lumbre_night::paths::name;

/// Number of cells of the night.
const CELLS: usize = 400;

/// Resident memory in bytes after a quarter of the cells and after nearly all of them, if the
/// system reports it, and the number of files.
pub struct ShortCellCost {
    early: Option<u64>,
    late: Option<u64>,
    /// Largest number of files of one run, without snapshots and films.
    files: usize,
}

impl ShortCellCost {
    /// Renders the night on the mock backend in a separate process of this program.
    ///
    /// # Errors
    /// A message for the user if the night cannot be rendered.
    pub fn measure(program: &Path) -> Result<ShortCellCost, String> {
        let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
        let (scene, script, out) = (
            folder.path().join("ball.scn"),
            folder.path().join("long.lua"),
            folder.path().join("out"),
        );
        let text = format!(
            "local x = experiment('long', {{ seed = 1 }})\n\
             x:axis('ior', linspace(1.1, 2.0, 20))\n\
             x:axis('depth', range(1, {}))\n\
             x:render(function(p) return {{ scene = {:?}, integrator = 'bpt', max_depth = p.depth,\n\
               backend = 'mock',\n\
               set = {{ ['materials.ball.ior'] = p.ior }} }} end)\n\
             x:stop(stop.samples(4))\n\
             return x\n",
            CELLS / 20,
            scene.display().to_string()
        );
        fs::write(&scene, BALL)
            .and_then(|()| fs::write(&script, text))
            .map_err(|e| e.to_string())?;
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
            let (done, memory) = (
                finished(&out),
                memory::process_bytes(&night.id().to_string(), "VmRSS:"),
            );
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
            (true, CELLS) => Ok(ShortCellCost {
                early,
                late,
                files: most_files(&out),
            }),
            (_, done) => Err(format!(
                "the benchmark night ended with {ended} after {done} of {CELLS} cells"
            )),
        }
    }

    /// Formats the figures as text.
    pub fn table(&self) -> String {
        let memory = |bytes: Option<u64>| {
            bytes.map_or_else(
                || "        -".to_owned(),
                |b| format!("{:>9.1}", b as f64 / 1e6),
            )
        };
        format!(
            "memory of a night, after {:<4} cells   {} MB\n\
             memory of a night, after {:<4} cells   {} MB\n\
             files per run                        {:>9}\n",
            CELLS / 4,
            memory(self.early),
            CELLS,
            memory(self.late),
            self.files
        )
    }
}

/// Number of finished cells in the journal.
fn finished(out: &Path) -> usize {
    let journal = fs::read_to_string(out.join("latest").join("journal.jsonl")).unwrap_or_default();
    journal
        .lines()
        .filter(|line| line.contains("cell_finished"))
        .count()
}

/// Largest number of files in the folder of one run.
fn most_files(folder: &Path) -> usize {
    let entries: Vec<_> = fs::read_dir(folder)
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path())
        .collect();
    let own = entries
        .iter()
        .filter(|path| path.is_file() && !name(path).starts_with("snap-"));
    let own = if folder.join("done.json").is_file() {
        own.count()
    } else {
        0
    };
    let folders = entries
        .iter()
        .filter(|path| path.is_dir() && !path.is_symlink());
    folders
        .map(|path| most_files(path))
        .max()
        .unwrap_or(0)
        .max(own)
}
