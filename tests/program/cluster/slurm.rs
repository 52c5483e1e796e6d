//! A real Slurm on this machine, started by slurm.sh. In a night of three workers, one is killed,
//! one is requeued, and one reaches its time limit, while the node is drained and resumed.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use super::night::{RUNS, differing, finished, finished_once, home, results, script};
use super::workplace::Workplace;

/// Longest wait for one condition.
const MAX_WAIT: Duration = Duration::from_secs(180);

/// A Slurm that is stopped with the test, even if the test fails.
struct Slurm {
    dir: tempfile::TempDir,
}

impl Slurm {
    fn script() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/program/cluster/slurm.sh")
    }

    /// Starts Slurm; the error states why it cannot be started.
    fn start() -> Result<Slurm, String> {
        let dir = tempfile::tempdir().map_err(|e| e.to_string())?;
        let port = 20_000 + std::process::id() % 20_000;
        let started = Command::new("bash")
            .arg(Slurm::script())
            .args([Path::new("start"), dir.path()])
            .env("SLURM_TEST_PORT", port.to_string())
            .output()
            .map_err(|e| e.to_string())?;
        if started.status.success() {
            return Ok(Slurm { dir });
        }
        Err(String::from_utf8_lossy(&started.stdout).trim().to_owned())
    }

    fn conf(&self) -> PathBuf {
        self.dir.path().join("slurm.conf")
    }

    /// Runs one of Slurm's programs.
    fn run_tool(&self, line: &str) -> String {
        let words: Vec<&str> = line.split(' ').collect();
        let output = Command::new(words[0])
            .args(&words[1..])
            .env("SLURM_CONF", self.conf())
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "{line}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    /// Returns the state of every task of a job: `RUNNING`, `PENDING`, `COMPLETED`.
    fn states(&self, id: &str) -> BTreeMap<String, String> {
        let text = self.run_tool(&format!(
            "squeue --noheader --array --states=all --format=%i|%T --jobs={id}"
        ));
        text.lines()
            .filter_map(|line| line.split_once('|'))
            .map(|(a, b)| (a.to_owned(), b.to_owned()))
            .collect()
    }
}

impl Drop for Slurm {
    fn drop(&mut self) {
        // The script ends all remaining processes.
        let _ = Command::new("bash")
            .arg(Slurm::script())
            .args([Path::new("stop"), self.dir.path()])
            .status();
    }
}

/// Waits until a condition holds; panics with the logs of the jobs after [`MAX_WAIT`].
fn wait_until(place: &Workplace, home: &str, what: &str, mut holds: impl FnMut() -> bool) {
    let start = Instant::now();
    while !holds() {
        if start.elapsed() > MAX_WAIT {
            let logs = place.ending(&format!("{home}/job"), ".log").into_iter();
            let logs: Vec<String> = logs
                .map(|log| format!("{log}:\n{}", place.read(&log)))
                .collect();
            panic!("waited too long for {what}\n{}", logs.join("\n"));
        }
        std::thread::sleep(Duration::from_millis(100));
    }
}

#[test]
fn a_night_on_slurm_survives_killed_requeued_and_expired_jobs() {
    let slurm = match Slurm::start() {
        Ok(slurm) => slurm,
        Err(reason) if std::env::var("REQUIRE_SLURM").is_ok_and(|v| v == "1") => {
            panic!("Slurm cannot be started: {reason}")
        }
        Err(reason) => {
            return crate::common::skipped(format_args!("Slurm cannot be started: {reason}"));
        }
    };
    let place = Workplace::new();
    place.write("grid.lua", &script(4000));
    let run = |args: &[&str]| {
        let output = place
            .command(args)
            .env("SLURM_CONF", slurm.conf())
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "{args:?}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let submit = [
        "submit",
        "slurm",
        "grid.lua",
        "--workers",
        "3",
        "--time",
        "00:10:00",
        "--affinity",
        "none",
    ];
    let id = run(&[&submit[..], &["--partition", "short", "--", "--mem=0"]].concat())
        .trim()
        .to_owned();
    let home = home(&place, "out");
    let task = |n: u32| format!("{id}_{n}");
    // Returns the process of a task's worker while it renders.
    let rendering = |n: u32| -> Option<u64> {
        let files = place
            .ending(&format!("{home}/workers"), ".json")
            .into_iter();
        let mut workers =
            files.filter_map(|f| serde_json::from_str::<serde_json::Value>(&place.read(&f)).ok());
        workers.find(|w| w["job"] == task(n).as_str() && w["state"]["rendering"].is_object())?["owner"]
            ["process"]
            .as_u64()
    };
    wait_until(&place, &home, "three rendering workers", || {
        (0..3).all(|n| rendering(n).is_some())
    });
    let status = run(&["status", &home]);
    assert!(
        status.contains("3 active, 0 lost") && status.contains("RUNNING"),
        "{status}"
    );

    // One worker is killed, one is requeued by Slurm, one reaches its time limit; and the node is
    // drained. Between two cells a worker renders nothing.
    wait_until(&place, &home, "a rendering worker to kill", || {
        rendering(0).is_some_and(|pid| {
            crate::common::kill()
                .args(["-9", &pid.to_string()])
                .status()
                .unwrap()
                .success()
        })
    });
    slurm.run_tool(&format!("scontrol requeue {}", task(1)));
    let host = slurm
        .run_tool("sinfo --noheader --format=%n")
        .trim()
        .to_owned();
    slurm.run_tool(&format!(
        "scontrol update nodename={host} state=drain reason=test"
    ));
    slurm.run_tool(&format!("scancel --batch --signal=USR1 {}", task(2)));
    wait_until(&place, &home, "two tasks in the queue again", || {
        let states = slurm.states(&id);
        [1, 2].iter().all(|n| {
            states
                .get(&task(*n))
                .is_some_and(|state| state == "PENDING")
        })
    });
    let status = run(&["status", &home]);
    assert!(
        status.contains("FAILED") && status.contains("137:0") && status.contains("PENDING"),
        "{status}"
    );
    let before = finished(&place, &home).len();
    assert!(
        before < RUNS,
        "the night must not finish before the jobs are disturbed"
    );
    slurm.run_tool(&format!("scontrol update nodename={host} state=resume"));
    wait_until(&place, &home, "the end of the night", || {
        slurm
            .states(&id)
            .values()
            .all(|state| !["PENDING", "RUNNING", "COMPLETING"].contains(&state.as_str()))
    });

    // One worker was killed, and Slurm may kill the requeued one.
    finished_once(&place, &home, 2);
    let states = slurm.states(&id);
    assert_eq!(
        (states[&task(1)].as_str(), states[&task(2)].as_str()),
        ("COMPLETED", "COMPLETED")
    );
    place.succeed(&["run", "grid.lua", "--out", "alone", "-q"]);
    assert_eq!(
        differing(&results(&place, "out"), &results(&place, "alone")),
        Vec::<String>::new()
    );
    let json: serde_json::Value = serde_json::from_str(&run(&["status", &home, "--json"])).unwrap();
    assert_eq!(
        (&json["state"], &json["cells"]["done"]),
        (&"finished".into(), &12.into()),
        "{json:#}"
    );

    // Cancel another job.
    place.write("slow.lua", &script(400_000));
    let id = run(&[
        "submit",
        "slurm",
        "slow.lua",
        "--workers",
        "2",
        "--time",
        "00:10:00",
    ])
    .trim()
    .to_owned();
    let home = super::night::home(&place, "out");
    wait_until(&place, &home, "workers of the second job", || {
        slurm.states(&id).values().any(|state| state == "RUNNING")
    });
    run(&["cancel", &home]);
    wait_until(&place, &home, "the end of the cancelled job", || {
        slurm.states(&id).values().all(|state| state == "CANCELLED")
    });
}
