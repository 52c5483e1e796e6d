//! The jobs of a night: their scripts, and what is remembered of them in its folder.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde_json::{Value as Json, json};

use crate::cli::args::SlurmArgs;
use crate::store::{StoreError, atomic, utc};

/// The folder of scripts and logs inside a night's, and its record.
const FOLDER: &str = "job";
const RECORD: &str = "job.json";

/// How long before its time limit a worker is asked to leave, as `--signal=B:USR1@120` has it.
const NOTICE_S: u64 = 120;

/// What hands out jobs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Slurm.
    Slurm,
    /// HyperQueue.
    Hq,
}

impl Kind {
    /// The name on the command line.
    pub fn word(self) -> &'static str {
        match self {
            Kind::Slurm => "slurm",
            Kind::Hq => "hq",
        }
    }

    /// The program that takes jobs, and the one that takes them back.
    pub fn programs(self) -> [&'static str; 2] {
        match self {
            Kind::Slurm => ["sbatch", "scancel"],
            Kind::Hq => ["hq", "hq"],
        }
    }
}

/// A job that was submitted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Job {
    /// To what.
    pub kind: Kind,
    /// Its number there.
    pub id: String,
    /// Its workers.
    pub workers: u32,
    /// When, as [`utc`] writes it.
    pub date: String,
}

/// The jobs of a night, oldest first.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Jobs(pub Vec<Job>);

impl Jobs {
    /// What is remembered in a night's folder; nothing where no job was submitted.
    pub fn read(home: &Path) -> Jobs {
        let text = std::fs::read_to_string(home.join(FOLDER).join(RECORD)).unwrap_or_default();
        let json: Json = serde_json::from_str(&text).unwrap_or_default();
        let job = |json: &Json| {
            Some(Job {
                kind: [Kind::Slurm, Kind::Hq].into_iter().find(|kind| json["kind"] == kind.word())?,
                id: json["id"].as_str()?.to_owned(),
                workers: u32::try_from(json["workers"].as_u64()?).ok()?,
                date: json["date"].as_str().unwrap_or_default().to_owned(),
            })
        };
        Jobs(json["jobs"].as_array().into_iter().flatten().filter_map(job).collect())
    }

    /// Remembers one more.
    ///
    /// # Errors
    /// When that cannot be written.
    pub fn add(home: &Path, kind: Kind, id: &str, workers: u32) -> Result<(), StoreError> {
        let Jobs(mut jobs) = Jobs::read(home);
        jobs.push(Job { kind, id: id.to_owned(), workers, date: utc(std::time::SystemTime::now()) });
        let lines = jobs
            .iter()
            .map(|job| json!({ "kind": job.kind.word(), "id": job.id, "workers": job.workers, "date": job.date }));
        let json = json!({ "jobs": lines.collect::<Vec<_>>() });
        atomic(&home.join(FOLDER).join(RECORD), format!("{json:#}\n").as_bytes())
    }
}

/// Where the script of a job lies.
pub fn script_file(home: &Path, kind: Kind) -> PathBuf {
    home.join(FOLDER).join(format!("{}.sh", kind.word()))
}

/// Where a worker that no queue started leaves what it says.
pub fn log_file(home: &Path, name: &str) -> PathBuf {
    home.join(FOLDER).join(format!("{name}.log"))
}

/// What a job's script is made of.
pub struct Sheet<'a> {
    /// The experiment's name.
    pub name: &'a str,
    /// The night's folder, from the root.
    pub home: &'a Path,
    /// This program.
    pub program: &'a Path,
    /// Graphics devices of each job.
    pub gpus: u32,
    /// What was asked for.
    pub args: &'a SlurmArgs,
}

impl Sheet<'_> {
    /// The script of a job, for people too.
    pub fn text(&self, kind: Kind) -> String {
        match kind {
            Kind::Slurm => self.slurm(),
            Kind::Hq => self.hq(),
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
            "# Two minutes before the time limit Slurm sends USR1 to this script. The worker then leaves with a checkpoint\n\
             # and exit code 75, and the job is queued again, to go on from there.\n",
            "",
            // The job's own number may be that of the whole array.
            "if [ \"$again\" = 1 ] && [ \"$stopped\" = 0 ]; then\n  exec scontrol requeue \"${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID\"\nfi\n",
        );
        out
    }

    fn hq(&self) -> String {
        let mut out = String::from("#!/bin/bash\n");
        // Two files: HyperQueue opens each of them, and neither for appending.
        let logs = |end: &str| self.home.join(FOLDER).join(format!("%{{JOB_ID}}_%{{TASK_ID}}.{end}"));
        let mut option = |text: String| {
            // Writing to a String cannot fail.
            let _ = writeln!(out, "#HQ {text}");
        };
        option(format!("--name=lumbre-{}", self.name));
        option(format!("--array=0-{}", self.args.workers - 1));
        let limit_s = seconds(&self.args.time);
        // What has no unit, or days, means something else there.
        option(format!("--time-limit={limit_s}s"));
        if self.gpus > 0 {
            option(format!("--resource gpus/nvidia={}", self.gpus));
        }
        option(format!("--stdout={}", logs("out").display()));
        option(format!("--stderr={}", logs("log").display()));
        let notice_s = limit_s.saturating_sub(NOTICE_S).max(limit_s / 2);
        out += &self.body(
            "# HyperQueue starts what it lost again. It gives a second's notice of its time limit, too little for a large\n\
             # checkpoint; so this script gives notice itself, two minutes before. The worker then leaves with exit code 75,\n\
             # and the night goes on when it is submitted again.\n",
            &format!("(sleep {notice_s} & trap \"kill $!\" TERM; wait $! && kill -s USR1 $$) &\nnotice=$!\n"),
            "kill \"$notice\" 2>/dev/null\n",
        );
        out
    }

    /// What every job does: its workers, signals, and exit code. `first` comes before its workers, `last` when all have ended.
    fn body(&self, about: &str, first: &str, last: &str) -> String {
        let device = if self.gpus > 1 { " --device \"$device\"" } else { "" };
        let processes = self.gpus.max(1) - 1;
        let affinity = self.args.affinity.word();
        format!(
            r#"#
# One worker of a night of Lumbre, for each device. It takes cells that nobody works on until all are done. Any
# number of these may come and go; the folder knows what is finished, and no job is needed for another.
{about}set -u
lumbre=({program})
night={night}

workers=() again=0 stopped=0 worst=0
trap 'kill -s USR1 "${{workers[@]}}" 2>/dev/null' USR1
# Whoever takes the job back ends its workers too; this script only waits for their checkpoints.
trap 'stopped=1' TERM
{first}for device in $(seq 0 {processes}); do
  "${{lumbre[@]}}" work "$night" --no-tui --affinity {affinity}{device} &
  workers+=($!)
done
for worker in "${{workers[@]}}"; do
  # A signal ends `wait` before the worker has ended.
  while wait "$worker"; kill -0 "$worker" 2>/dev/null; do :; done
  wait "$worker"
  code=$?
  if [ "$code" = 75 ]; then again=1; elif [ "$code" -gt "$worst" ]; then worst=$code; fi
done
{last}if [ "$again" = 1 ]; then worst=75; fi
exit "$worst"
"#,
            program = self.args.program.clone().unwrap_or_else(|| quoted(self.program)),
            night = quoted(self.home),
        )
    }
}

/// Seconds of a time as Slurm writes it: minutes, MM:SS, HH:MM:SS, D-HH, D-HH:MM or D-HH:MM:SS.
fn seconds(time: &str) -> u64 {
    let (days, rest) = time.split_once('-').map_or((None, time), |(days, rest)| (Some(days), rest));
    let number = |text: &str| text.parse::<u64>().unwrap_or(u64::MAX);
    let parts: Vec<u64> = rest.split(':').map(number).collect();
    let units: &[u64] = match (days, parts.len()) {
        (Some(_), _) | (None, 3) => &[3600, 60, 1],
        (None, _) => &[60, 1],
    };
    let rest = parts.iter().zip(units).fold(0u64, |sum, (n, unit)| sum.saturating_add(n.saturating_mul(*unit)));
    rest.saturating_add(days.map_or(0, |days| number(days).saturating_mul(86_400)))
}

/// A path as a word of a shell's command.
fn quoted(path: &Path) -> String {
    format!("'{}'", path.display().to_string().replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::cli::args::{Cli, Verb};

    fn sheet(line: &str, kind: Kind, gpus: u32) -> String {
        let cli = Cli::try_parse_from(line.split(' ')).unwrap();
        let Verb::Submit(submit) = cli.verb else { panic!("{line}") };
        let (home, program) = (Path::new("/nights/it's/night-3f9a"), Path::new("/opt/lumbre"));
        Sheet { name: "night", home, program, gpus, args: submit.to.job() }.text(kind)
    }

    #[test]
    fn the_script_says_all_that_was_asked() {
        let line = "lumbre submit slurm a.lua depth=5 --workers 4 --time 01:30:00 --partition short";
        let text = sheet(line, Kind::Slurm, 2);
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
        let text = sheet("lumbre submit slurm a.lua --affinity none", Kind::Slurm, 0);
        assert!(!text.contains("gres") && !text.contains("--device") && text.contains("--affinity none"), "{text}");
        let text = sheet("lumbre submit hq a.lua --workers 3", Kind::Hq, 1);
        assert!(text.contains("\nlumbre=('/opt/lumbre')\n"), "{text}");
        let cli = ["lumbre", "submit", "hq", "a.lua", "--program", "apptainer exec /apps/lumbre.sif lumbre"];
        let Verb::Submit(submit) = Cli::try_parse_from(cli).unwrap().verb else { panic!("{cli:?}") };
        let (home, program) = (Path::new("/night"), Path::new("/opt/lumbre"));
        let contained = Sheet { name: "night", home, program, gpus: 0, args: submit.to.job() }.text(Kind::Hq);
        assert!(contained.contains("\nlumbre=(apptainer exec /apps/lumbre.sif lumbre)\n"), "{contained}");
        let text = sheet("lumbre submit hq a.lua --workers 3", Kind::Hq, 1);
        assert!(text.contains("#HQ --array=0-2\n") && !text.contains("SBATCH") && !text.contains("scontrol"), "{text}");
    }

    #[test]
    fn the_other_queue_is_told_seconds_and_given_notice_by_the_script() {
        let text = sheet("lumbre submit hq a.lua --workers 3 --time 2-12", Kind::Hq, 1);
        assert!(text.contains("#HQ --time-limit=216000s\n") && text.contains("(sleep 215880 &"), "{text}");
        let text = sheet("lumbre submit hq a.lua --time 3:00", Kind::Hq, 0);
        assert!(text.contains("#HQ --time-limit=180s\n") && text.contains("(sleep 90 &"), "{text}");
        assert!(!sheet("lumbre submit slurm a.lua", Kind::Slurm, 0).contains("sleep"));
        let times = [("30", 1800), ("10:30", 630), ("08:00:01", 28_801), ("2-12", 216_000), ("1-00:30", 88_200)];
        for (text, expected) in times {
            assert_eq!(seconds(text), expected, "{text}");
        }
        assert_eq!(seconds("1-00:30:05"), 88_205);
    }

    #[test]
    fn jobs_are_remembered_in_their_order() {
        let dir = tempfile::tempdir().unwrap();
        assert_eq!(Jobs::read(dir.path()), Jobs::default());
        Jobs::add(dir.path(), Kind::Slurm, "1207", 8).unwrap();
        Jobs::add(dir.path(), Kind::Hq, "3", 2).unwrap();
        let found: Vec<(Kind, String, u32)> =
            Jobs::read(dir.path()).0.into_iter().map(|job| (job.kind, job.id, job.workers)).collect();
        assert_eq!(found, [(Kind::Slurm, "1207".to_owned(), 8), (Kind::Hq, "3".to_owned(), 2)]);
    }
}
