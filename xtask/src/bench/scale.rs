//! Cost of listing and watching a night of ten thousand finished cells.

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::time::{Instant, SystemTime};

use lumbre::cli::inspect::follow::apply;
use lumbre::cli::night::load::decode_picture;
use lumbre_night::experiment::{Plan, memory};
use lumbre_night::store::schema::journal::{
    self, JournalEvent, JournalLine, NightStart, OutcomeKind, RunEnd, RunStart, WaveRecord,
};
use lumbre_night::store::schema::one_line;
use lumbre_night::store::schema::plan::{PlanFile, PlannedCell};
use lumbre_night::store::schema::run::{ConfigFile, DONE, DoneFile, RunResults};
use lumbre_night::store::schema::values::{Named, Real};
use lumbre_night::store::write::{manifest_checksum, metrics_csv};
use lumbre_night::store::{Follower, StoredFile, list_experiments, plan_file, utc};
use lumbre_render::Device;
use lumbre_tui::tui::model::night::NightModel;

/// Reason of the end of every run.
const REASON: &str = "1 sample per pixel";

/// Durations in seconds, and memory in bytes.
pub struct ListingCost {
    /// First `ls`, which builds the index from the folders.
    pub index_s: f64,
    /// `ls` with the index.
    pub ls_s: f64,
    /// `status`, and `watch` before its first frame: reads the plan, the journal and every cell.
    pub open_s: f64,
    /// One poll of a night without news.
    pub look_s: f64,
    /// Memory for watching, if the system reports it.
    pub memory: Option<u64>,
}

impl ListingCost {
    /// Creates a folder in which all cells of the plan are finished, and measures reading it.
    ///
    /// # Errors
    /// A message for the user if the folder cannot be written or read.
    pub fn measure(plan: &Plan) -> Result<ListingCost, String> {
        let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
        let out = folder.path();
        let experiment = out.join("bench-0000");
        write_night(plan, &experiment).map_err(|e| e.to_string())?;
        let timed = |action: &dyn Fn() -> usize| {
            let start = Instant::now();
            let result = action();
            (start.elapsed().as_secs_f64(), result)
        };
        let count_done = || {
            list_experiments(out)
                .nights
                .iter()
                .flat_map(|e| &e.runs)
                .filter(|run| run.state.name() == "done")
                .count()
        };
        let (index_s, first) = timed(&count_done);
        let (ls_s, second) = timed(&count_done);
        if [first, second] != [plan.cells.len(); 2] {
            return Err(format!(
                "listed {first} and {second} of {} runs",
                plan.cells.len()
            ));
        }
        let before = resident();
        let start = Instant::now();
        let mut follower =
            Follower::open(&experiment, decode_picture).map_err(|e| e.to_string())?;
        let mut model = NightModel::new(follower.night().clone());
        if let Some(changes) = follower.poll() {
            apply(&mut model, changes);
        }
        let open_s = start.elapsed().as_secs_f64();
        let memory = before
            .zip(resident())
            .map(|(before, after)| after.saturating_sub(before));
        let start = Instant::now();
        let later = follower.poll();
        let look_s = start.elapsed().as_secs_f64();
        let is_unread = |run: &Arc<lumbre_night::experiment::night::run::Run>| run.rows.is_empty();
        if model.night.runs.iter().any(is_unread) || later.is_some() {
            return Err("the simulated night was not read completely".to_owned());
        }
        Ok(ListingCost {
            index_s,
            ls_s,
            open_s,
            look_s,
            memory,
        })
    }

    /// Formats the figures as text.
    pub fn table(&self) -> String {
        let memory = self.memory.map_or_else(
            || "        -".to_owned(),
            |b| format!("{:>9.1}", b as f64 / 1e6),
        );
        format!(
            "\n10,000 finished runs\n\
             ls, building the index               {:>9.3} s\n\
             ls with the index                    {:>9.3} s\n\
             status, and watch until it opens     {:>9.3} s\n\
             poll of watch without news           {:>9.3} ms\n\
             memory of watch                      {memory} MB\n",
            self.index_s,
            self.ls_s,
            self.open_s,
            self.look_s * 1e3
        )
    }
}

/// Writes only the files that reading needs, without syncing.
fn write_night(plan: &Plan, folder: &Path) -> std::io::Result<()> {
    let plan = plan_file(plan);
    let date = utc(SystemTime::now());
    let line = |event| {
        one_line(&JournalLine {
            date: date.clone(),
            event,
        })
    };
    let mut journal = line(JournalEvent::NightStarted(NightStart::default()));
    for cell in &plan.cells {
        let folder_of_run = folder.join("runs").join(&cell.folder);
        fs::create_dir_all(&folder_of_run)?;
        let config = ConfigFile {
            run: cell.run.clone(),
            path: Some(cell.path.clone()),
            ..ConfigFile::default()
        };
        fs::write(folder_of_run.join(ConfigFile::NAME), config.text())?;
        fs::write(
            folder_of_run.join(metrics_csv::FILE),
            "wave,samples,render_s,wall_s,measure_s,paths,rays,invalid\n\
             1,1,0.25,0.3,0,4096,20480,0\n",
        )?;
        let done = DoneFile::Rendered(Box::new(results(cell, &date)));
        let done = manifest_checksum::add_checksums(&folder_of_run, &done)?;
        fs::write(folder_of_run.join(DONE), done.text())?;
        journal += &line(JournalEvent::CellStarted(RunStart {
            run: cell.run.clone(),
            path: cell.path.clone(),
            devices: vec![Device::processor(1)],
            ..RunStart::default()
        }));
        journal += &line(JournalEvent::CellFinished(end(cell)));
    }
    journal += &line(JournalEvent::NightFinished {});
    fs::write(folder.join(journal::FILE), journal)?;
    fs::write(folder.join(PlanFile::NAME), plan.text())
}

/// Results of a finished cell.
fn results(cell: &PlannedCell, date: &str) -> RunResults {
    RunResults {
        run: cell.run.clone(),
        reason: REASON.to_owned(),
        samples: 1,
        render_s: 0.25,
        wall_s: 0.3,
        waves: 1,
        paths: 4096,
        rays: 20480,
        metrics: Named(vec![("rmse".to_owned(), Real(0.125))]),
        finished: date.to_owned(),
        ..RunResults::default()
    }
}

/// Journal entry of the end of a cell.
fn end(cell: &PlannedCell) -> RunEnd {
    RunEnd {
        run: cell.run.clone(),
        path: cell.path.clone(),
        outcome: OutcomeKind::Done,
        reason: REASON.to_owned(),
        limit: true,
        last: Some(WaveRecord {
            wave: 1,
            samples: 1,
            render_s: 0.25,
            wall_s: 0.3,
            paths: 4096,
            rays: 20480,
            metrics: Named(vec![("rmse".to_owned(), Real(0.125))]),
            ..WaveRecord::default()
        }),
    }
}

/// Resident memory of this process in bytes, if the system reports it.
fn resident() -> Option<u64> {
    memory::process_bytes("self", "VmRSS:")
}

#[cfg(test)]
mod tests {
    use super::super::night::plan_10_000_cells;
    use super::*;

    #[test]
    fn a_night_of_many_cells_is_listed_and_followed_to_its_end() {
        let (mut plan, _) = plan_10_000_cells().unwrap();
        plan.cells.truncate(300);
        let scale = ListingCost::measure(&plan).unwrap();
        assert!(scale.table().contains("ls, building the index"));
    }
}
