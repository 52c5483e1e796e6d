//! Options of the verbs for nights on many machines: `work`, `submit` and `cancel`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::script::ScriptArgs;
use super::typed::axis_values;
use lumbre_light::value::Value;
use lumbre_night::experiment::comparison_groups::Affinity;
use lumbre_night::experiment::spec::Deadline;

/// Options of `lumbre work`.
#[derive(Args, Debug)]
pub struct WorkArgs {
    /// Night: its folder, `latest`, or words of its name.
    pub folder: PathBuf,
    /// Render on this device.
    ///
    /// Give its index or a part of its name, as listed by `lumbre doctor`.
    #[arg(long, value_name = "DEVICE")]
    pub device: Option<String>,
    /// Render only cells with this value of an axis (repeatable).
    #[arg(long, value_name = "AXIS=VALUE", value_parser = axis_values)]
    pub only: Vec<(String, Vec<Value>)>,
    /// Stop at a time of day or after a duration: 08:00, 90min, 7.5h.
    ///
    /// Unfinished runs are saved as checkpoints.
    #[arg(long, value_name = "TIME", value_parser = crate::cli::night::deadline::parse)]
    pub until: Option<Deadline>,
    /// Stop after this many failed runs.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub max_fails: Option<u32>,
    /// Set what all techniques of one scene and depth must share: `device`, `model` or `none`.
    ///
    /// `device` renders them on the same device, `model` on devices of the same model, and `none`
    /// on any device.
    #[arg(long, value_name = "WHAT", default_value = "device", value_parser = affinity)]
    pub affinity: Affinity,
    /// Stop with a checkpoint when stdin closes, which happens if the parent process ends.
    #[arg(long, hide = true)]
    pub while_stdin: bool,
}

/// Options of `lumbre submit`.
#[derive(Args, Debug)]
pub struct SubmitArgs {
    /// Scheduler that runs the jobs.
    #[command(subcommand)]
    pub scheduler: Scheduler,
}

/// Job schedulers to which a night can be submitted.
#[derive(Debug, Subcommand)]
pub enum Scheduler {
    /// Submit to Slurm as a job array.
    ///
    /// Each job of the array is a worker. It saves a checkpoint before its time limit, and its job
    /// is queued again until the night is done.
    Slurm(JobArgs),
    /// Submit to HyperQueue as a task array.
    Hq(JobArgs),
}

impl Scheduler {
    /// Returns the options of the job, which are the same for all schedulers.
    pub fn job(&self) -> &JobArgs {
        let (Scheduler::Slurm(job) | Scheduler::Hq(job)) = self;
        job
    }
}

/// Options of a job array of workers.
#[derive(Args, Debug)]
pub struct JobArgs {
    /// Script of the experiment.
    #[command(flatten)]
    pub script: ScriptArgs,
    /// Number of workers, each of which is one job of the array.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 8,
        value_parser = clap::value_parser!(u32).range(1..=10_000)
    )]
    pub workers: u32,
    /// Number of graphics devices per job, with one process each.
    ///
    /// Default: 1 if the plan uses a graphics backend, otherwise 0.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=64))]
    pub gpus: Option<u32>,
    /// Time limit of each job.
    ///
    /// Two minutes before the limit a worker saves a checkpoint and exits; its job is queued again.
    #[arg(long, value_name = "HH:MM:SS", default_value = "08:00:00", value_parser = time)]
    pub time: String,
    /// Partition or queue of the jobs.
    #[arg(long, value_name = "NAME")]
    pub partition: Option<String>,
    /// Set what all techniques of one scene and depth must share: `device`, `model` or `none`.
    ///
    /// `device` renders them on the same device, `model` on devices of the same model, and `none`
    /// on any device.
    #[arg(long, value_name = "WHAT", default_value = "device", value_parser = affinity)]
    pub affinity: Affinity,
    /// Start lumbre on the nodes with this command [default: the path of this program].
    ///
    /// The command is parsed by the shell: "apptainer exec --nv /apps/lumbre.sif lumbre"
    #[arg(long, value_name = "COMMAND")]
    pub program: Option<String>,
    /// Print the job script and exit. Nothing is written or submitted.
    #[arg(long)]
    pub dry_run: bool,
    /// Pass these options on to the submit command of the scheduler.
    #[arg(last = true, value_name = "OPTION")]
    pub extra: Vec<String>,
}

/// Options of `lumbre cancel`.
#[derive(Args, Debug)]
pub struct CancelArgs {
    /// Night: its folder, `latest`, or words of its name [default: the latest one].
    pub folder: Option<PathBuf>,
}

/// Parses the value of `--affinity`.
pub(super) fn affinity(text: &str) -> Result<Affinity, String> {
    Affinity::from_name(text)
        .ok_or_else(|| format!("expected device, model or none, found `{text}`"))
}

/// Checks a Slurm time limit: minutes, MM:SS, HH:MM:SS, D-HH, D-HH:MM or D-HH:MM:SS.
fn time(text: &str) -> Result<String, String> {
    let (days, rest) = text
        .split_once('-')
        .map_or((None, text), |(days, rest)| (Some(days), rest));
    let parts: Vec<&str> = rest.split(':').collect();
    let numbers = days.into_iter().chain(parts.iter().copied());
    let all_digits = numbers
        .into_iter()
        .all(|part| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit()));
    if all_digits && parts.len() <= 3 {
        Ok(text.to_owned())
    } else {
        Err(format!(
            "expected a time such as 08:00:00 or 2-12:00:00, found `{text}`"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_written_as_slurm_reads_them() {
        for good in ["30", "08:00:00", "2-12", "1-00:30:00", "10:00"] {
            assert_eq!(time(good).as_deref(), Ok(good));
        }
        for bad in ["", "8h", "08:00:00:00", "1-", "-5", "08:xx"] {
            assert!(time(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn affinities_have_names() {
        assert_eq!(affinity("model"), Ok(Affinity::Model));
        assert!(
            affinity("machine")
                .unwrap_err()
                .contains("device, model or none")
        );
    }
}
