//! Cluster jobs of a night: their scripts, and the record of submitted jobs in the night's folder.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use crate::cli::args::JobArgs;
pub use lumbre_night::store::schema::plan::SchedulerKind;
use lumbre_night::store::schema::plan::{JobFile, SubmittedJob};
use lumbre_night::store::{StoreError, StoredFile, utc};
use lumbre_render::plugin;

/// Folder of job scripts, logs and the record below the night's folder.
const FOLDER: &str = "job";
/// Time before its time limit at which a worker is asked to stop, in seconds. Agrees with the
/// option `--signal=B:USR1@120` of Slurm jobs.
const NOTICE_S: u64 = 120;

/// Reads the jobs that were submitted for a night; empty if there are none.
pub fn submitted_jobs(home: &Path) -> Vec<SubmittedJob> {
    JobFile::read(&home.join(FOLDER)).unwrap_or_default().jobs
}

/// Adds a job to the record in a night's folder.
///
/// # Errors
/// Returns an error if the record cannot be written.
pub fn record_job(
    home: &Path,
    kind: SchedulerKind,
    id: &str,
    workers: u32,
) -> Result<(), StoreError> {
    let mut jobs = submitted_jobs(home);
    jobs.push(SubmittedJob {
        kind,
        id: id.to_owned(),
        workers,
        date: utc(std::time::SystemTime::now()),
    });
    let file = JobFile {
        jobs,
        ..JobFile::default()
    };
    file.write(&home.join(FOLDER))
}

/// Returns the path of the job script for a scheduler.
pub fn script_file(home: &Path, kind: SchedulerKind) -> PathBuf {
    home.join(FOLDER).join(format!("{}.sh", kind.name()))
}

/// Returns the path of the log of a worker that was not started by a scheduler.
pub fn log_file(home: &Path, name: &str) -> PathBuf {
    home.join(FOLDER).join(format!("{name}.log"))
}

/// Parameters of a job script.
pub struct JobScript<'a> {
    /// Name of the experiment.
    pub name: &'a str,
    /// Absolute path of the night's folder.
    pub home: &'a Path,
    /// Path of this program.
    pub program: &'a Path,
    /// Number of graphics devices of each job.
    pub gpus: u32,
    /// Whether its workers may run commands of the script.
    pub allow_commands: bool,
    /// Absolute paths of the libraries with techniques of one's own.
    pub libraries: &'a [PathBuf],
    /// Options of `lumbre submit`.
    pub args: &'a JobArgs,
}

impl JobScript<'_> {
    /// Returns the commented bash script of a job.
    pub fn text(&self, kind: SchedulerKind) -> String {
        match kind {
            SchedulerKind::Slurm => self.slurm(),
            SchedulerKind::Hq => self.hq(),
        }
    }

    fn slurm(&self) -> String {
        let mut out = String::from("#!/bin/bash\n");
        let logs = self.home.join(FOLDER).join("%A_%a.log");
        let mut option = |text: String| {
            // Writing to a String cannot fail.
            let _ = writeln!(out, "#SBATCH {text}");
        };
        option(format!("--job-name=lumbre-{}", self.name));
        option(format!("--array=0-{}", self.args.workers - 1));
        option(format!("--time={}", self.args.time));
        if let Some(partition) = &self.args.partition {
            option(format!("--partition={partition}"));
        }
        if self.gpus > 0 {
            option(format!("--gres=gpu:{}", self.gpus));
        }
        option(format!("--output={}", logs.display()));
        option("--open-mode=append".to_owned());
        option("--requeue".to_owned());
        option("--signal=B:USR1@120".to_owned());
        out += &self.body(
            "# Two minutes before the time limit Slurm sends USR1 to this script. The worker then\n\
             # saves a checkpoint and exits with code 75. The job is queued again and resumes.\n",
            "",
            // SLURM_JOB_ID may be the number of the whole array, so the task is named explicitly.
            "if [ \"$requeue\" = 1 ] && [ \"$stopped\" = 0 ]; then\n  \
             exec scontrol requeue \"${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID\"\nfi\n",
        );
        out
    }

    fn hq(&self) -> String {
        let mut out = String::from("#!/bin/bash\n");
        // stdout and stderr need separate files: HyperQueue opens each one and truncates it.
        let logs = |end: &str| {
            self.home
                .join(FOLDER)
                .join(format!("%{{JOB_ID}}_%{{TASK_ID}}.{end}"))
        };
        let mut option = |text: String| {
            // Writing to a String cannot fail.
            let _ = writeln!(out, "#HQ {text}");
        };
        option(format!("--name=lumbre-{}", self.name));
        option(format!("--array=0-{}", self.args.workers - 1));
        let limit_s = seconds(&self.args.time);
        // HyperQueue reads times without a unit, and with days, differently; seconds are
        // unambiguous.
        option(format!("--time-limit={limit_s}s"));
        if self.gpus > 0 {
            option(format!("--resource gpus/nvidia={}", self.gpus));
        }
        option(format!("--stdout={}", logs("out").display()));
        option(format!("--stderr={}", logs("log").display()));
        let notice_s = limit_s.saturating_sub(NOTICE_S).max(limit_s / 2);
        out += &self.body(
            "# HyperQueue restarts lost tasks. It warns only one second before the time limit,\n\
             # too late for a large checkpoint, so this script sends USR1 two minutes before\n\
             # the limit. The worker then exits with code 75. Submit the night again to resume.\n",
            &format!(
                "(sleep {notice_s} & trap \"kill $!\" TERM; wait $! && kill -s USR1 $$) \
                 &\nnotice=$!\n"
            ),
            "kill \"$notice\" 2>/dev/null\n",
        );
        out
    }

    /// Returns the part that all schedulers share: workers, signals and the exit code. `first` is
    /// inserted before the workers start, `last` after all have ended.
    fn body(&self, about: &str, first: &str, last: &str) -> String {
        let device = if self.gpus > 1 {
            " --device \"$device\""
        } else {
            ""
        };
        let processes = self.gpus.max(1) - 1;
        let affinity = self.args.affinity.name();
        let commands = if self.allow_commands {
            " --allow-commands"
        } else {
            ""
        };
        // Queues may start jobs with another environment than that of `submit`.
        let libraries = if self.libraries.is_empty() {
            String::new()
        } else {
            let paths: Vec<String> = self.libraries.iter().map(|path| quoted(path)).collect();
            format!("export {}={}\n", plugin::VARIABLE, paths.join(":"))
        };
        format!(
            r#"#
# Runs one lumbre worker per device. Each worker renders cells that no other worker has claimed,
# until all are done. Jobs are independent: any number of them may start and stop at any time.
{about}set -u
{libraries}lumbre=({program})
night={night}

workers=() requeue=0 stopped=0 worst=0
trap 'kill -s USR1 "${{workers[@]}}" 2>/dev/null' USR1
# If the job is cancelled, its workers get the signal too. Wait for their checkpoints.
trap 'stopped=1' TERM
{first}for device in $(seq 0 {processes}); do
  "${{lumbre[@]}}" work "$night" --no-tui --affinity {affinity}{device}{commands} &
  workers+=($!)
done
for worker in "${{workers[@]}}"; do
  # A signal interrupts `wait`, so repeat it until the worker has ended.
  while wait "$worker"; kill -0 "$worker" 2>/dev/null; do :; done
  wait "$worker"
  code=$?
  if [ "$code" = 75 ]; then requeue=1; elif [ "$code" -gt "$worst" ]; then worst=$code; fi
done
{last}if [ "$requeue" = 1 ]; then worst=75; fi
exit "$worst"
"#,
            program = self
                .args
                .program
                .clone()
                .unwrap_or_else(|| quoted(self.program)),
            night = quoted(self.home),
        )
    }
}

/// Converts a Slurm time limit to seconds: minutes, MM:SS, HH:MM:SS, D-HH, D-HH:MM or D-HH:MM:SS.
fn seconds(time: &str) -> u64 {
    let (days, rest) = time
        .split_once('-')
        .map_or((None, time), |(days, rest)| (Some(days), rest));
    let number = |text: &str| text.parse::<u64>().unwrap_or(u64::MAX);
    let parts: Vec<u64> = rest.split(':').map(number).collect();
    let units: &[u64] = match (days, parts.len()) {
        (Some(_), _) | (None, 3) => &[3600, 60, 1],
        (None, _) => &[60, 1],
    };
    let rest = parts.iter().zip(units).fold(0u64, |sum, (n, unit)| {
        sum.saturating_add(n.saturating_mul(*unit))
    });
    rest.saturating_add(days.map_or(0, |days| number(days).saturating_mul(86_400)))
}

/// Quotes a path for the shell.
fn quoted(path: &Path) -> String {
    format!("'{}'", path.display().to_string().replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::cli::args::{Cli, Verb};

    fn job_script(line: &str, kind: SchedulerKind, gpus: u32) -> String {
        let cli = Cli::try_parse_from(line.split(' ')).unwrap();
        let Verb::Submit(submit) = cli.verb else {
            panic!("{line}")
        };
        let (home, program) = (
            Path::new("/nights/it's/night-3f9a"),
            Path::new("/opt/lumbre"),
        );
        JobScript {
            name: "night",
            home,
            program,
            gpus,
            allow_commands: false,
            libraries: &[],
            args: submit.scheduler.job(),
        }
        .text(kind)
    }

    #[test]
    fn the_script_contains_all_options() {
        let line =
            "lumbre submit slurm a.lua depth=5 --workers 4 --time 01:30:00 --partition short";
        let text = job_script(line, SchedulerKind::Slurm, 2);
        for part in [
            "--array=0-3\n",
            "--time=01:30:00\n",
            "--partition=short\n",
            "--gres=gpu:2\n",
            "--requeue\n",
            "--signal=B:USR1@120\n",
            "seq 0 1",
            "--device \"$device\"",
            "--affinity device",
            "scontrol requeue",
            r"night='/nights/it'\''s/night-3f9a'",
        ] {
            assert!(text.contains(part), "{part} in\n{text}");
        }
        let text = job_script(
            "lumbre submit slurm a.lua --affinity none",
            SchedulerKind::Slurm,
            0,
        );
        assert!(
            !text.contains("gres")
                && !text.contains("--device")
                && text.contains("--affinity none"),
            "{text}"
        );
        let text = job_script("lumbre submit hq a.lua --workers 3", SchedulerKind::Hq, 1);
        assert!(text.contains("\nlumbre=('/opt/lumbre')\n"), "{text}");
        let cli = [
            "lumbre",
            "submit",
            "hq",
            "a.lua",
            "--program",
            "apptainer exec /apps/lumbre.sif lumbre",
        ];
        let Verb::Submit(submit) = Cli::try_parse_from(cli).unwrap().verb else {
            panic!("{cli:?}")
        };
        let (home, program) = (Path::new("/night"), Path::new("/opt/lumbre"));
        let contained = JobScript {
            name: "night",
            home,
            program,
            gpus: 0,
            allow_commands: true,
            libraries: &["/lib/it's.so".into(), "/lib/b.so".into()],
            args: submit.scheduler.job(),
        }
        .text(SchedulerKind::Hq);
        assert!(
            contained.contains("\nlumbre=(apptainer exec /apps/lumbre.sif lumbre)\n"),
            "{contained}"
        );
        assert!(
            contained.contains("\nexport LUMBRE_PLUGINS='/lib/it'\\''s.so':'/lib/b.so'\n"),
            "{contained}"
        );
        let text = job_script("lumbre submit hq a.lua --workers 3", SchedulerKind::Hq, 1);
        assert!(
            text.contains("#HQ --array=0-2\n")
                && !text.contains("SBATCH")
                && !text.contains("scontrol"),
            "{text}"
        );
    }

    #[test]
    fn hyperqueue_gets_seconds_and_the_script_sends_the_notice() {
        let text = job_script(
            "lumbre submit hq a.lua --workers 3 --time 2-12",
            SchedulerKind::Hq,
            1,
        );
        assert!(
            text.contains("#HQ --time-limit=216000s\n") && text.contains("(sleep 215880 &"),
            "{text}"
        );
        let text = job_script("lumbre submit hq a.lua --time 3:00", SchedulerKind::Hq, 0);
        assert!(
            text.contains("#HQ --time-limit=180s\n") && text.contains("(sleep 90 &"),
            "{text}"
        );
        assert!(
            !job_script("lumbre submit slurm a.lua", SchedulerKind::Slurm, 0).contains("sleep")
        );
        let times = [
            ("30", 1800),
            ("10:30", 630),
            ("08:00:01", 28_801),
            ("2-12", 216_000),
            ("1-00:30", 88_200),
        ];
        for (text, expected) in times {
            assert_eq!(seconds(text), expected, "{text}");
        }
        assert_eq!(seconds("1-00:30:05"), 88_205);
    }

    #[test]
    fn jobs_are_recorded_in_their_order() {
        let dir = tempfile::tempdir().unwrap();
        assert!(submitted_jobs(dir.path()).is_empty());
        record_job(dir.path(), SchedulerKind::Slurm, "1207", 8).unwrap();
        record_job(dir.path(), SchedulerKind::Hq, "3", 2).unwrap();
        let found: Vec<(SchedulerKind, String, u32)> = submitted_jobs(dir.path())
            .into_iter()
            .map(|job| (job.kind, job.id, job.workers))
            .collect();
        assert_eq!(
            found,
            [
                (SchedulerKind::Slurm, "1207".to_owned(), 8),
                (SchedulerKind::Hq, "3".to_owned(), 2)
            ]
        );
    }
}
