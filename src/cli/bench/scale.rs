//! What it costs to look at a night of ten thousand cells.

use std::fs;
use std::path::Path;
use std::time::{Instant, SystemTime};

use serde_json::{Value as Json, json};

use crate::cli::load::decode;
use crate::cli::watch::{open, tell};
use crate::experiment::{Plan, memory};
use crate::store::{Follower, list, plan_json, utc};
use crate::tui::model::Model;

/// Seconds, and bytes of memory.
pub struct Scale {
    /// The index is made from the folders.
    pub index_s: f64,
    /// `ls`, with the index.
    pub ls_s: f64,
    /// `status`, and `watch` before its first frame: the plan, the journal, the state of every cell.
    pub open_s: f64,
    /// A further look at a night in which nothing happened.
    pub look_s: f64,
    /// Memory that following takes, where the system tells.
    pub memory: Option<u64>,
}

impl Scale {
    /// Makes a folder in which all cells of the plan are done, and looks at it.
    ///
    /// # Errors
    /// When it cannot be written or read, with a message for people.
    pub fn measure(plan: &Plan) -> Result<Scale, String> {
        let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
        let out = folder.path();
        let experiment = out.join("bench-0000");
        write_night(plan, &experiment).map_err(|e| e.to_string())?;
        let timed = |what: &dyn Fn() -> usize| {
            let start = Instant::now();
            let found = what();
            (start.elapsed().as_secs_f64(), found)
        };
        let done = || list(out).iter().flat_map(|e| &e.runs).filter(|run| run.state.word() == "done").count();
        let (index_s, first) = timed(&done);
        let (ls_s, second) = timed(&done);
        if [first, second] != [plan.cells.len(); 2] {
            return Err(format!("listed {first} and {second} of {} runs", plan.cells.len()));
        }
        let before = resident();
        let start = Instant::now();
        let mut follower = Follower::open(&experiment, decode).map_err(|e| e.to_string())?;
        let mut model = Model::default();
        open(&mut model, &follower);
        follower.look().into_iter().for_each(|sight| tell(&mut model, sight));
        let open_s = start.elapsed().as_secs_f64();
        let memory = before.zip(resident()).map(|(before, after)| after.saturating_sub(before));
        let start = Instant::now();
        let nothing = follower.look().len();
        let look_s = start.elapsed().as_secs_f64();
        if model.cells.iter().any(|cell| cell.last.is_none()) || nothing > 0 {
            return Err("the night was not followed to its end".to_owned());
        }
        Ok(Scale { index_s, ls_s, open_s, look_s, memory })
    }

    /// The rows for people.
    pub fn table(&self) -> String {
        let memory = self.memory.map_or_else(|| "        -".to_owned(), |b| format!("{:>9.1}", b as f64 / 1e6));
        format!(
            "\n10,000 finished runs\n\
             index made from the folders          {:>9.3} s\n\
             ls with the index                    {:>9.3} s\n\
             status, and watch until it opens     {:>9.3} s\n\
             a look without news                  {:>9.3} ms\n\
             memory of watching                   {memory} MB\n",
            self.index_s,
            self.ls_s,
            self.open_s,
            self.look_s * 1e3
        )
    }

    /// The same figures as JSON.
    pub fn to_json(&self) -> Json {
        json!({
            "index_s": self.index_s, "ls_s": self.ls_s, "open_s": self.open_s, "look_s": self.look_s,
            "memory_bytes": self.memory,
        })
    }
}

/// The files that reading needs, written without the care that results get.
fn write_night(plan: &Plan, folder: &Path) -> std::io::Result<()> {
    let described = plan_json(plan);
    let date = utc(SystemTime::now());
    let mut journal = format!("{}\n", json!({ "date": date, "event": "night_started" }));
    for cell in described["cells"].as_array().into_iter().flatten() {
        let (run, place) = (&cell["run"], cell["folder"].as_str().unwrap_or_default());
        let place = folder.join("runs").join(place);
        fs::create_dir_all(&place)?;
        let facts = json!({
            "run": run, "reason": "1 sample per pixel", "samples": 1, "render_s": 0.25, "wall_s": 0.3, "waves": 1,
            "paths": 4096, "rays": 20480, "invalid": 0, "metrics": { "rmse": 0.125 }, "finished": date,
        });
        fs::write(place.join("config.json"), json!({ "run": run, "path": cell["path"] }).to_string())?;
        fs::write(
            place.join("metrics.csv"),
            "wave,samples,render_s,wall_s,paths,rays,invalid\n1,1,0.25,0.3,4096,20480,0\n",
        )?;
        fs::write(place.join("done.json"), facts.to_string())?;
        let started = json!({ "date": date, "event": "cell_started", "run": run, "device": "cpu" });
        let mut ended = json!({ "date": date, "event": "cell_finished", "outcome": "done" });
        if let (Some(ended), Some(facts)) = (ended.as_object_mut(), facts.as_object()) {
            ended.extend(facts.clone());
        }
        journal += &format!("{started}\n{ended}\n");
    }
    journal += &format!("{}\n", json!({ "date": date, "event": "night_finished" }));
    fs::write(folder.join("journal.jsonl"), journal)?;
    fs::write(folder.join("plan.json"), described.to_string())
}

/// Bytes of this process in memory, where the system tells.
fn resident() -> Option<u64> {
    memory::of_process("self", "VmRSS:")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::bench::night::plan_10_000_cells;

    #[test]
    fn a_night_of_many_cells_is_listed_and_followed_to_its_end() {
        let (mut plan, _) = plan_10_000_cells().unwrap();
        plan.cells.truncate(300);
        let scale = Scale::measure(&plan).unwrap();
        assert!(scale.table().contains("index made from the folders"));
        assert!(scale.to_json()["open_s"].as_f64().unwrap() > 0.0);
    }
}
