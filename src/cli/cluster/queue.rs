//! What Slurm says of a night's jobs.

use std::collections::BTreeMap;
use std::process::{Command, Stdio};

use super::job::{Job, Jobs, Kind};

/// One worker's job as Slurm sees it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Task {
    /// `1207_3`.
    pub id: String,
    /// `RUNNING`, `PENDING`, `CANCELLED`: Slurm's word.
    pub state: String,
    /// Where it runs or ran; empty before.
    pub node: String,
    /// Why it does not run; empty where it does.
    pub reason: String,
    /// Exit code and signal, `75:0`, once it has ended.
    pub exit: String,
}

/// The tasks of all jobs of a night that Slurm still knows, in their order, and what could not be asked, for people.
pub fn tasks(jobs: &Jobs) -> (Vec<Task>, Vec<String>) {
    let mut found = Vec::new();
    let mut notes = Vec::new();
    for job in &jobs.0 {
        match job.kind {
            Kind::Hq => notes.push(format!("job {}: `hq job info {}` says how it is", job.id, job.id)),
            Kind::Slurm => found.extend(slurm(job, &mut notes)),
        }
    }
    (found, notes)
}

fn slurm(job: &Job, notes: &mut Vec<String>) -> Vec<Task> {
    let mut tasks = BTreeMap::new();
    let fields = "JobID,State,NodeList,Reason,ExitCode";
    // Many clusters keep no accounts; then the queue alone is asked.
    let accounts = ["--noheader", "--parsable2", "--allocations", "--format", fields, "--jobs", &job.id];
    for line in ask("sacct", &accounts).unwrap_or_default().lines() {
        keep(&mut tasks, line);
    }
    let fields = "JobArrayID:|,State:|,NodeList:|,Reason:|,exit_code:|";
    let queue = ["--noheader", "--array", "--states=all", "--Format", fields, "--jobs", &job.id];
    match ask("squeue", &queue) {
        Ok(text) => text.lines().for_each(|line| keep(&mut tasks, line)),
        // What ended long ago the queue no longer knows.
        Err(_) if !tasks.is_empty() => {}
        Err(problem) => notes.push(format!("job {}: {problem}", job.id)),
    }
    let mut tasks: Vec<Task> = tasks.into_values().collect();
    let number = |task: &Task| task.id.rsplit('_').next().and_then(|n| n.parse::<u64>().ok());
    tasks.sort_by_key(|task| (number(task), task.id.clone()));
    tasks
}

/// Takes a line of fields in; what the queue says of a task replaces what the accounts say.
fn keep(tasks: &mut BTreeMap<String, Task>, line: &str) {
    let fields: Vec<&str> = line.split('|').map(str::trim).collect();
    let [id, state, node, reason, exit, ..] = fields[..] else { return };
    let known =
        |text: &str| if ["None", "N/A", "(null)", "None assigned"].contains(&text) { "" } else { text }.to_owned();
    let ended = !["PENDING", "RUNNING", "COMPLETING", "SUSPENDED", "CONFIGURING"].contains(&state);
    let exit = if ended { exit_code(exit) } else { String::new() };
    let task = Task { id: id.to_owned(), state: state.to_owned(), node: known(node), reason: known(reason), exit };
    tasks.insert(task.id.clone(), task);
}

/// An exit code as accounts write it, `75:0`. The queue tells what a parent process is told: the code in the upper eight
/// bits, the signal in the lower seven.
fn exit_code(text: &str) -> String {
    match text.parse::<u32>() {
        Ok(status) => format!("{}:{}", status >> 8, status & 127),
        Err(_) => text.to_owned(),
    }
}

/// What a program prints.
///
/// # Errors
/// Why it does not, in words.
pub fn ask(program: &str, args: &[&str]) -> Result<String, String> {
    let output = Command::new(program).args(args).stdin(Stdio::null()).output().map_err(|e| match e.kind() {
        std::io::ErrorKind::NotFound => format!("`{program}` is not on this machine"),
        _ => format!("`{program}` cannot be started: {e}"),
    })?;
    if output.status.success() {
        return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
    }
    let said = String::from_utf8_lossy(&output.stderr).trim().replace('\n', "; ");
    Err(format!("`{program}` refused: {}", if said.is_empty() { output.status.to_string() } else { said }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_the_queue_replace_those_of_the_accounts() {
        let mut tasks = BTreeMap::new();
        keep(&mut tasks, "12_0|COMPLETED|n1|None|0:0");
        keep(&mut tasks, "12_1|CANCELLED by 0|n1|None|0:15");
        keep(&mut tasks, "12_1|PENDING| |BeginTime|0|");
        keep(&mut tasks, "12_3|FAILED|n1|NonZeroExitCode|35072|");
        keep(&mut tasks, "12_2|RUNNING|n2|None|0:0|");
        keep(&mut tasks, "slurm says something else");
        let line = |id: &str| {
            let t: &Task = &tasks[id];
            [t.state.clone(), t.node.clone(), t.reason.clone(), t.exit.clone()]
        };
        assert_eq!(tasks.len(), 4);
        assert_eq!(line("12_3"), ["FAILED", "n1", "NonZeroExitCode", "137:0"]);
        assert_eq!(line("12_0"), ["COMPLETED", "n1", "", "0:0"]);
        assert_eq!(line("12_1"), ["PENDING", "", "BeginTime", ""]);
        assert_eq!(line("12_2"), ["RUNNING", "n2", "", ""]);
    }

    #[test]
    fn a_program_that_is_not_there_is_named() {
        assert!(ask("no-such-program-of-lumbre", &[]).unwrap_err().contains("is not on this machine"));
    }
}
