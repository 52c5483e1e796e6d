//! The workers of a night for people and programs: what each says of itself, with what the queue says of its job.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::{Value as Json, json};

use super::job::Jobs;
use super::queue::{Task, tasks};
use crate::cli::text;
use crate::cli::watch::doing;
use crate::store::{Doing, Worker, crew};

/// Most workers that are listed for people.
const MOST: usize = 40;

/// Workers, jobs, and what could not be asked.
pub struct Roll {
    workers: Vec<Worker>,
    tasks: Vec<Task>,
    notes: Vec<String>,
}

impl Roll {
    /// Calls the roll of a night's folder.
    pub fn call(home: &Path) -> Roll {
        let (tasks, notes) = tasks(&Jobs::read(home));
        Roll { workers: crew(home), tasks, notes }
    }

    /// Whether there is anything to say: a night that one process renders alone has no workers.
    pub fn is_empty(&self) -> bool {
        self.workers.iter().all(|worker| worker.planner) && self.tasks.is_empty() && self.notes.is_empty()
    }

    /// Every job with the worker that was heard of last in it, and every worker without a job; those that left by hand
    /// are passed over.
    fn pairs(&self) -> Vec<(Option<&Task>, Option<&Worker>)> {
        let mut newest: BTreeMap<&str, &Worker> = BTreeMap::new();
        for worker in self.workers.iter().filter(|worker| !worker.job.is_empty()) {
            let known = newest.entry(&worker.job).or_insert(worker);
            if worker.age_s < known.age_s {
                *known = worker;
            }
        }
        let mut pairs: Vec<(Option<&Task>, Option<&Worker>)> =
            self.tasks.iter().map(|task| (Some(task), newest.remove(task.id.as_str()))).collect();
        // Jobs that the queue does not know any more.
        pairs.extend(newest.into_values().map(|worker| (None, Some(worker))));
        let alone = self.workers.iter().filter(|w| w.job.is_empty() && !matches!(w.doing, Doing::Left(_)));
        pairs.extend(alone.map(|worker| (None, Some(worker))));
        pairs
    }

    /// For people.
    pub fn page(&self) -> String {
        let here = self.workers.iter().filter(|worker| worker.is_here()).count();
        let lost = self.workers.iter().filter(|worker| worker.is_lost()).count();
        let left = self.workers.len() - here - lost;
        let mut lines = vec![["job", "state", "node", "heard", "does", "device"].map(str::to_owned).to_vec()];
        let pairs = self.pairs();
        for (task, worker) in pairs.iter().take(MOST) {
            let mut state = task.map_or("", |task| task.state.as_str()).to_owned();
            for more in task.iter().flat_map(|task| [&task.reason, &task.exit]).filter(|more| !more.is_empty()) {
                state += &format!(" {more}");
            }
            if worker.is_some_and(Worker::is_lost) {
                state = format!("{state} lost").trim().to_owned();
            }
            let job = task.map(|task| &task.id).or(worker.map(|worker| &worker.job));
            let node = worker.map(|w| &w.host).or(task.map(|task| &task.node));
            lines.push(vec![
                job.cloned().unwrap_or_default(),
                state,
                node.cloned().unwrap_or_default(),
                worker.map(|worker| format!("{} ago", text::duration(worker.age_s))).unwrap_or_default(),
                worker.map(doing).unwrap_or_default(),
                worker.map(|worker| worker.device.model.clone()).unwrap_or_default(),
            ]);
        }
        let mut out = format!("\nworkers: {here} here, {lost} lost, {left} left\n");
        if lines.len() > 1 {
            out += &text::aligned(&lines);
        }
        if pairs.len() > MOST {
            out += &format!("and {} more (--json lists all)\n", pairs.len() - MOST);
        }
        self.notes.iter().for_each(|note| out += &format!("{note}\n"));
        out
    }

    /// For programs.
    pub fn json(&self) -> Json {
        let worker = |worker: &Worker| {
            json!({
                "name": worker.name, "node": worker.host, "process": worker.process, "device": worker.device.key,
                "model": worker.device.model, "job": worker.job, "lost": worker.is_lost(), "here": worker.is_here(),
                "does": doing(worker), "heard_s": worker.age_s,
            })
        };
        let task = |task: &Task| {
            json!({
                "job": task.id, "state": task.state, "node": task.node, "reason": task.reason, "exit": task.exit,
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
    use super::*;
    use crate::store::Device;

    fn worker(job: &str, age_s: f64, doing: Doing) -> Worker {
        let device = Device { key: "n1".to_owned(), model: "lens".to_owned() };
        let (name, host) = (format!("{job}{age_s}"), "n1".to_owned());
        Worker { name, planner: false, host, process: 7, device, job: job.to_owned(), doing, age_s }
    }

    #[test]
    fn workers_and_jobs_are_joined() {
        let rendering = || Doing::Rendering { run: "ab".to_owned(), path: "depth=5/rep=0".to_owned() };
        let task = |id: &str, state: &str, reason: &str| Task {
            id: id.to_owned(),
            state: state.to_owned(),
            reason: reason.to_owned(),
            ..Task::default()
        };
        let roll = Roll {
            workers: vec![
                worker("7_0", 3.0, rendering()),
                worker("7_0", 900.0, Doing::Left("it was asked to".to_owned())),
                worker("7_1", 500.0, rendering()),
                worker("", 5.0, Doing::Waiting),
            ],
            tasks: vec![task("7_0", "RUNNING", ""), task("7_1", "NODE_FAIL", ""), task("7_2", "PENDING", "Resources")],
            notes: vec!["sacct is not here".to_owned()],
        };
        let page = roll.page();
        let lines: Vec<&str> = page.lines().collect();
        assert_eq!(lines[1], "workers: 2 here, 1 lost, 1 left");
        let words = |i: usize| lines[i].split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(words(3), "7_0 RUNNING n1 3 s ago depth=5/rep=0 lens");
        assert_eq!(words(4), "7_1 NODE_FAIL lost n1 8 min 20 s ago depth=5/rep=0 lens");
        assert_eq!(words(5), "7_2 PENDING Resources");
        assert_eq!(words(6), "n1 5 s ago waits lens");
        assert_eq!(lines[7], "sacct is not here");
        assert_eq!(roll.json()["jobs"][2]["reason"], "Resources");
    }
}
