//! States of a night's cluster jobs, as reported by Slurm.

use std::collections::BTreeMap;
use std::process::{Command, Stdio};

use super::job::SchedulerKind;
use lumbre_night::store::schema::plan::SubmittedJob;

/// One task of a job array, which runs one worker.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Task {
    /// Job and task number, such as `1207_3`.
    pub id: String,
    /// Slurm's name of the state, such as `RUNNING`, `PENDING` or `CANCELLED`.
    pub state: String,
    /// Node on which it runs or ran; empty before it starts.
    pub node: String,
    /// Reason why it does not run; empty if it runs.
    pub reason: String,
    /// Exit code and signal such as `75:0`; empty until it has ended.
    pub exit: String,
}

/// Returns the tasks of all jobs of a night that Slurm still lists, in their order, and notes about
/// jobs whose state is not available.
pub fn tasks(jobs: &[SubmittedJob]) -> (Vec<Task>, Vec<String>) {
    let mut found = Vec::new();
    let mut notes = Vec::new();
    for job in jobs {
        match job.kind {
            SchedulerKind::Hq => notes.push(format!(
                "job {}: run `hq job info {}` for its state",
                job.id, job.id
            )),
            SchedulerKind::Slurm => found.extend(slurm_tasks(job, &mut notes)),
        }
    }
    (found, notes)
}

/// Returns the tasks of one Slurm job from `sacct` and `squeue`. Problems are added to `notes`.
fn slurm_tasks(job: &SubmittedJob, notes: &mut Vec<String>) -> Vec<Task> {
    let mut tasks = BTreeMap::new();
    let fields = "JobID,State,NodeList,Reason,ExitCode";
    // Many clusters have no accounting, so errors of sacct are ignored.
    let accounts = [
        "--noheader",
        "--parsable2",
        "--allocations",
        "--format",
        fields,
        "--jobs",
        &job.id,
    ];
    for line in command_output("sacct", &accounts)
        .unwrap_or_default()
        .lines()
    {
        insert_task(&mut tasks, line);
    }
    let fields = "JobArrayID:|,State:|,NodeList:|,Reason:|,exit_code:|";
    let queue = [
        "--noheader",
        "--array",
        "--states=all",
        "--Format",
        fields,
        "--jobs",
        &job.id,
    ];
    match command_output("squeue", &queue) {
        Ok(text) => text.lines().for_each(|line| insert_task(&mut tasks, line)),
        // The queue forgets jobs that ended long ago.
        Err(_) if !tasks.is_empty() => {}
        Err(problem) => notes.push(format!("job {}: {problem}", job.id)),
    }
    in_order(tasks)
}

/// Sorts the tasks of a job by their numbers.
fn in_order(tasks: BTreeMap<String, Task>) -> Vec<Task> {
    let mut tasks: Vec<Task> = tasks.into_values().collect();
    let number = |task: &Task| {
        task.id
            .rsplit('_')
            .next()
            .and_then(|n| n.parse::<u64>().ok())
    };
    tasks.sort_by_key(|task| (number(task), task.id.clone()));
    tasks
}

/// Parses a line of fields separated by `|` and inserts its task. A later line (from the queue)
/// replaces an earlier one (from accounting). Malformed lines are ignored.
fn insert_task(tasks: &mut BTreeMap<String, Task>, line: &str) {
    let fields: Vec<&str> = line.split('|').map(str::trim).collect();
    let [id, state, node, reason, exit, ..] = fields[..] else {
        return;
    };
    let known = |text: &str| {
        if ["None", "N/A", "(null)", "None assigned"].contains(&text) {
            ""
        } else {
            text
        }
        .to_owned()
    };
    let ended = ![
        "PENDING",
        "RUNNING",
        "COMPLETING",
        "SUSPENDED",
        "CONFIGURING",
    ]
    .contains(&state);
    let exit = if ended {
        exit_code(exit)
    } else {
        String::new()
    };
    let task = Task {
        id: id.to_owned(),
        state: state.to_owned(),
        node: known(node),
        reason: known(reason),
        exit,
    };
    tasks.insert(task.id.clone(), task);
}

/// Formats an exit code as accounting does, such as `75:0`. The queue prints the wait status
/// instead: the exit code in bits 8 and above, the signal in the lower seven bits.
fn exit_code(text: &str) -> String {
    match text.parse::<u32>() {
        Ok(status) => format!("{}:{}", status >> 8, status & 127),
        Err(_) => text.to_owned(),
    }
}

/// Runs a program and returns its stdout.
///
/// # Errors
/// Returns a message if the program is not installed, cannot be started or fails.
pub fn command_output(program: &str, args: &[&str]) -> Result<String, String> {
    let output = Command::new(program)
        .args(args)
        .stdin(Stdio::null())
        .output()
        .map_err(|e| match e.kind() {
            std::io::ErrorKind::NotFound => format!("`{program}` is not installed on this machine"),
            _ => format!("cannot start `{program}`: {e}"),
        })?;
    if output.status.success() {
        return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
    }
    let message = String::from_utf8_lossy(&output.stderr)
        .trim()
        .replace('\n', "; ");
    Err(format!(
        "`{program}` failed: {}",
        if message.is_empty() {
            output.status.to_string()
        } else {
            message
        }
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_the_queue_replace_those_of_accounting() {
        let mut tasks = BTreeMap::new();
        insert_task(&mut tasks, "12_0|COMPLETED|n1|None|0:0");
        insert_task(&mut tasks, "12_1|CANCELLED by 0|n1|None|0:15");
        insert_task(&mut tasks, "12_1|PENDING| |BeginTime|0|");
        insert_task(&mut tasks, "12_3|FAILED|n1|NonZeroExitCode|35072|");
        insert_task(&mut tasks, "12_2|RUNNING|n2|None|0:0|");
        insert_task(&mut tasks, "12_10|CANCELLED|n2|None|15|");
        insert_task(
            &mut tasks,
            "slurm_load_jobs error: Invalid job id specified",
        );
        let line = |id: &str| {
            let t: &Task = &tasks[id];
            [
                t.state.clone(),
                t.node.clone(),
                t.reason.clone(),
                t.exit.clone(),
            ]
        };
        assert_eq!(tasks.len(), 5);
        assert_eq!(line("12_3"), ["FAILED", "n1", "NonZeroExitCode", "137:0"]);
        assert_eq!(line("12_0"), ["COMPLETED", "n1", "", "0:0"]);
        assert_eq!(line("12_1"), ["PENDING", "", "BeginTime", ""]);
        assert_eq!(line("12_2"), ["RUNNING", "n2", "", ""]);
        assert_eq!(line("12_10"), ["CANCELLED", "n2", "", "0:15"]);
        let ids: Vec<String> = in_order(tasks).into_iter().map(|task| task.id).collect();
        assert_eq!(ids, ["12_0", "12_1", "12_2", "12_3", "12_10"]);
    }

    #[test]
    fn a_missing_program_is_reported() {
        assert!(
            command_output("no-such-program-of-lumbre", &[])
                .unwrap_err()
                .contains("is not installed on this machine")
        );
    }
}
