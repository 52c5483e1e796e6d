//! What can be typed of nights on many machines.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::{ScriptArgs, axis_values};
use crate::experiment::groups::Affinity;
use crate::experiment::spec::Deadline;
use crate::value::Value;

/// `lumbre work`.
#[derive(Args, Debug)]
pub struct WorkArgs {
    /// The folder of the night
    pub folder: PathBuf,
    /// Render on this device: its index or a part of its name, as `lumbre doctor` lists them
    #[arg(long, value_name = "DEVICE")]
    pub device: Option<String>,
    /// Take only cells with this value of an axis; give it again for further values or axes
    #[arg(long, value_name = "AXIS=VALUE", value_parser = axis_values)]
    pub only: Vec<(String, Vec<Value>)>,
    /// Leave at this time of day, or after this long: 08:00, 90min, 7.5h. What is unfinished then has its checkpoint
    #[arg(long, value_name = "TIME", value_parser = super::super::until::parse)]
    pub until: Option<Deadline>,
    /// Leave once so many runs have failed
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub max_fails: Option<u32>,
    /// What all techniques of a scene and depth share: one `device`, one `model` of device, or `none` of it
    #[arg(long, value_name = "WHAT", default_value = "device", value_parser = affinity)]
    pub affinity: Affinity,
    /// Leave with a checkpoint when standard input ends: with the process that started this one
    #[arg(long, hide = true)]
    pub while_stdin: bool,
}

/// `lumbre submit`.
#[derive(Args, Debug)]
pub struct SubmitArgs {
    /// To what.
    #[command(subcommand)]
    pub to: To,
}

/// What hands out jobs.
#[derive(Debug, Subcommand)]
pub enum To {
    /// Slurm: an array of workers, each of which goes on after its time limit
    Slurm(SlurmArgs),
    /// HyperQueue: the same array
    Hq(SlurmArgs),
}

impl To {
    /// The job, whatever it goes to.
    pub fn job(&self) -> &SlurmArgs {
        let (To::Slurm(job) | To::Hq(job)) = self;
        job
    }
}

/// A job of many workers.
#[derive(Args, Debug)]
pub struct SlurmArgs {
    /// Which experiment.
    #[command(flatten)]
    pub script: ScriptArgs,
    /// Workers, each a job of its own
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub workers: u32,
    /// Graphics devices of each job, and processes on them [default: 1 if the plan renders on them, else 0]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=64))]
    pub gpus: Option<u32>,
    /// Time limit of each job; a worker leaves two minutes earlier with a checkpoint, and is queued again
    #[arg(long, value_name = "HH:MM:SS", default_value = "08:00:00", value_parser = time)]
    pub time: String,
    /// The partition, or queue
    #[arg(long, value_name = "NAME")]
    pub partition: Option<String>,
    /// What all techniques of a scene and depth share: one `device`, one `model` of device, or `none` of it
    #[arg(long, value_name = "WHAT", default_value = "device", value_parser = affinity)]
    pub affinity: Affinity,
    /// What starts this program on the nodes, as a shell's words: "apptainer exec --nv /apps/lumbre.sif lumbre" [default: the
    /// path of the program that submits]
    #[arg(long, value_name = "COMMAND")]
    pub program: Option<String>,
    /// Print the job's script; write and submit nothing
    #[arg(long)]
    pub dry_run: bool,
    /// Further options for the program that submits, behind `--`
    #[arg(last = true, value_name = "OPTION")]
    pub extra: Vec<String>,
}

/// `lumbre cancel`.
#[derive(Args, Debug)]
pub struct CancelArgs {
    /// The folder of the night, or a folder of results, whose latest it is [default: --out]
    pub folder: Option<PathBuf>,
}

/// What of a comparison stays together, as it is typed.
pub(super) fn affinity(text: &str) -> Result<Affinity, String> {
    let known = Affinity::ALL.into_iter().find(|affinity| affinity.word() == text);
    known.ok_or_else(|| format!("expected device, model or none, found `{text}`"))
}

/// A time as Slurm writes it: minutes, MM:SS, HH:MM:SS, D-HH, D-HH:MM or D-HH:MM:SS.
fn time(text: &str) -> Result<String, String> {
    let (days, rest) = text.split_once('-').map_or((None, text), |(days, rest)| (Some(days), rest));
    let parts: Vec<&str> = rest.split(':').collect();
    let numbers = days.into_iter().chain(parts.iter().copied());
    let whole = numbers.into_iter().all(|part| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit()));
    if whole && parts.len() <= 3 {
        Ok(text.to_owned())
    } else {
        Err(format!("expected a time such as 08:00:00 or 2-12:00:00, found `{text}`"))
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
        assert!(affinity("nobody").unwrap_err().contains("device, model or none"));
    }
}
