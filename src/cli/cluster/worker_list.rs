//! List of a night's workers: their own states, joined with the states of their cluster jobs.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::{Value as Json, json};

use super::job::submitted_jobs;
use super::queue::{Task, tasks};
use crate::cli::format;
use crate::cli::inspect::follow::describe_state;
use lumbre_night::store::list_workers;
use lumbre_night::store::{WorkerState, WorkerStatus};

/// Maximum number of workers in the text table.
const MAX_LISTED: usize = 40;

/// Workers and cluster jobs of a night.
pub struct WorkerList {
    workers: Vec<WorkerStatus>,
    tasks: Vec<Task>,
    /// Jobs whose state is not available, and why.
    notes: Vec<String>,
}

impl WorkerList {
    /// Reads the workers of a night's folder and asks the schedulers for the states of its jobs.
    pub fn read(home: &Path) -> WorkerList {
        let (tasks, notes) = tasks(&submitted_jobs(home));
        WorkerList {
            workers: list_workers(home),
            tasks,
            notes,
        }
    }

    /// Returns whether the list is empty, as for a night rendered by a single process.
    pub fn is_empty(&self) -> bool {
        self.workers.iter().all(|worker| worker.planner)
            && self.tasks.is_empty()
            && self.notes.is_empty()
    }

    /// Pairs every job with the worker in it that sent the last heartbeat. Workers without a job
    /// are listed alone, unless they have exited.
    fn pairs(&self) -> Vec<(Option<&Task>, Option<&WorkerStatus>)> {
        let mut newest: BTreeMap<&str, &WorkerStatus> = BTreeMap::new();
        for worker in self.workers.iter().filter(|worker| !worker.job.is_empty()) {
            let known = newest.entry(&worker.job).or_insert(worker);
            if worker.age_s < known.age_s {
                *known = worker;
            }
        }
        let mut pairs: Vec<(Option<&Task>, Option<&WorkerStatus>)> = self
            .tasks
            .iter()
            .map(|task| (Some(task), newest.remove(task.id.as_str())))
            .collect();
        // Add workers whose jobs the scheduler no longer lists.
        pairs.extend(newest.into_values().map(|worker| (None, Some(worker))));
        let without_job = self
            .workers
            .iter()
            .filter(|w| w.job.is_empty() && !matches!(w.state, WorkerState::Left(_)));
        pairs.extend(without_job.map(|worker| (None, Some(worker))));
        pairs
    }

    /// Formats the list as a text table.
    pub fn page(&self) -> String {
        let active = self
            .workers
            .iter()
            .filter(|worker| worker.is_active())
            .count();
        let lost = self
            .workers
            .iter()
            .filter(|worker| worker.is_lost())
            .count();
        let exited = self.workers.len() - active - lost;
        let mut lines = vec![
            ["job", "state", "node", "heartbeat", "activity", "device"]
                .map(str::to_owned)
                .to_vec(),
        ];
        let pairs = self.pairs();
        for (task, worker) in pairs.iter().take(MAX_LISTED) {
            let mut state = task.map_or("", |task| task.state.as_str()).to_owned();
            for detail in task
                .iter()
                .flat_map(|task| [&task.reason, &task.exit])
                .filter(|detail| !detail.is_empty())
            {
                state += &format!(" {detail}");
            }
            if worker.is_some_and(WorkerStatus::is_lost) {
                state = format!("{state} lost").trim().to_owned();
            }
            let job = task
                .map(|task| &task.id)
                .or(worker.map(|worker| &worker.job));
            let node = worker.map(|w| &w.host).or(task.map(|task| &task.node));
            lines.push(vec![
                job.cloned().unwrap_or_default(),
                state,
                node.cloned().unwrap_or_default(),
                worker
                    .map(|worker| format!("{} ago", format::duration(worker.age_s)))
                    .unwrap_or_default(),
                worker.map(describe_state).unwrap_or_default(),
                worker
                    .map(|worker| worker.device.model.clone())
                    .unwrap_or_default(),
            ]);
        }
        let mut out = format!("\nworkers: {active} active, {lost} lost, {exited} exited\n");
        if lines.len() > 1 {
            out += &format::aligned(&lines);
        }
        if pairs.len() > MAX_LISTED {
            out += &format!("and {} more (--json lists all)\n", pairs.len() - MAX_LISTED);
        }
        self.notes
            .iter()
            .for_each(|note| out += &format!("{note}\n"));
        out
    }

    /// Returns the list as JSON.
    pub fn json(&self) -> Json {
        let worker = |worker: &WorkerStatus| {
            json!({
                "name": worker.name, "node": worker.host, "process": worker.process,
                "device": worker.device.key,
                "model": worker.device.model, "job": worker.job, "lost": worker.is_lost(),
                "here": worker.is_active(),
                "does": describe_state(worker), "heard_s": worker.age_s,
            })
        };
        let task = |task: &Task| {
            json!({
                "job": task.id, "state": task.state, "node": task.node, "reason": task.reason,
                "exit": task.exit,
            })
        };
        json!({
            "workers": self.workers.iter().map(worker).collect::<Vec<_>>(),
            "jobs": self.tasks.iter().map(task).collect::<Vec<_>>(),
            "notes": self.notes,
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::cli::cluster::worker_list::*;
    use lumbre_night::store::RenderDevice;

    fn worker(job: &str, age_s: f64, state: WorkerState) -> WorkerStatus {
        let device = RenderDevice {
            key: "n1".to_owned(),
            model: "lens".to_owned(),
        };
        let (name, host) = (format!("{job}{age_s}"), "n1".to_owned());
        WorkerStatus {
            name,
            planner: false,
            host,
            process: 7,
            device,
            job: job.to_owned(),
            state,
            age_s,
        }
    }

    #[test]
    fn workers_and_jobs_are_joined() {
        let rendering = || WorkerState::Rendering {
            run: "ab".to_owned(),
            path: "depth=5/rep=0".to_owned(),
        };
        let task = |id: &str, state: &str, reason: &str| Task {
            id: id.to_owned(),
            state: state.to_owned(),
            reason: reason.to_owned(),
            ..Task::default()
        };
        let list = WorkerList {
            workers: vec![
                worker("7_0", 3.0, rendering()),
                worker(
                    "7_0",
                    900.0,
                    WorkerState::Left("stopped on request".to_owned()),
                ),
                worker("7_1", 500.0, rendering()),
                worker("", 5.0, WorkerState::Waiting),
            ],
            tasks: vec![
                task("7_0", "RUNNING", ""),
                task("7_1", "NODE_FAIL", ""),
                task("7_2", "PENDING", "Resources"),
            ],
            notes: vec!["sacct is not installed".to_owned()],
        };
        let page = list.page();
        let lines: Vec<&str> = page.lines().collect();
        assert_eq!(lines[1], "workers: 2 active, 1 lost, 1 exited");
        let words = |i: usize| lines[i].split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(words(3), "7_0 RUNNING n1 3 s ago depth=5/rep=0 lens");
        assert_eq!(
            words(4),
            "7_1 NODE_FAIL lost n1 8 min 20 s ago depth=5/rep=0 lens"
        );
        assert_eq!(words(5), "7_2 PENDING Resources");
        assert_eq!(words(6), "n1 5 s ago waiting lens");
        assert_eq!(lines[7], "sacct is not installed");
        assert_eq!(list.json()["jobs"][2]["reason"], "Resources");
    }
}
