//! Options of the verbs that plan and render nights: `run` and `plan`.

use std::path::PathBuf;

use clap::Args;

use super::cluster;
use super::script::{PlanChanges, ScriptArgs};
use lumbre_night::experiment::comparison_groups::Affinity;
use lumbre_night::experiment::spec::Deadline;

/// Options of `lumbre run`.
#[derive(Args, Debug, Default)]
pub struct RunArgs {
    /// Script of the experiment (.lua).
    ///
    /// With `--retry` or `--failed` also a night: its folder, `latest`, or words of its name
    /// [default: the latest night]. Its last command is repeated.
    #[arg(required_unless_present_any = ["retry", "failed"])]
    pub script: Option<PathBuf>,
    /// Changes of the plan.
    #[command(flatten)]
    pub changes: PlanChanges,
    /// Limits and devices of the night.
    #[command(flatten)]
    pub night: NightArgs,
    /// Run failed and unfinished cells of a night again.
    ///
    /// Says first what is run and what is kept.
    #[arg(long)]
    pub retry: bool,
    /// Run only cells whose last attempt failed.
    #[arg(long)]
    pub failed: bool,
    /// Print the plan, or what `--retry` or `--failed` would run, and exit.
    #[arg(long)]
    pub dry_run: bool,
    /// Whether the tables at the end are left out, for verbs that print results of their own.
    #[arg(skip)]
    pub without_tables: bool,
}

impl RunArgs {
    /// Returns whether a night is run again.
    pub fn is_again(&self) -> bool {
        self.retry || self.failed
    }

    /// Returns the script and its changes, or `None` if a night is meant or nothing is given.
    pub fn script(&self) -> Option<ScriptArgs> {
        let is_script = |given: &PathBuf| {
            !self.is_again() || given.is_file() || given.extension().is_some_and(|e| e == "lua")
        };
        Some(ScriptArgs {
            script: self.script.clone().filter(is_script)?,
            changes: self.changes.clone(),
        })
    }
}

/// Limits and devices of a night.
#[derive(Args, Clone, Debug, Default)]
pub struct NightArgs {
    /// Stop at a time of day or after a duration: 08:00, 90min, 7.5h.
    ///
    /// Cells are then ordered from coarse to fine, so that the finished ones form a complete
    /// smaller grid. Run the same command to resume.
    #[arg(long, value_name = "TIME", value_parser = crate::cli::night::deadline::parse)]
    pub until: Option<Deadline>,
    /// Stop after this many failed runs.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub max_fails: Option<u32>,
    /// Skip the smoke pass, which renders one small sample of every cell first.
    #[arg(long)]
    pub no_smoke: bool,
    /// Render on these graphics devices, with one worker process each.
    ///
    /// Devices are given by index or by a part of their name, as listed by `lumbre doctor`.
    /// Default: all devices of the same model as the first one, or the device named by
    /// LUMBRE_DEVICE.
    #[arg(long, value_name = "DEVICE,DEVICE", value_delimiter = ',')]
    pub devices: Vec<String>,
    /// Set what all techniques of one scene and depth must share: `device`, `model` or `none`.
    ///
    /// `device` renders them on the same device, `model` on devices of the same model, and `none`
    /// on any device.
    #[arg(long, value_name = "WHAT", default_value = "device", value_parser = cluster::affinity)]
    pub affinity: Affinity,
    /// Send pictures to the image viewer tev, which listens at 127.0.0.1:14158 by default.
    #[arg(long, value_name = "HOST:PORT")]
    pub tev: Option<String>,
}

/// Options of `lumbre plan`.
#[derive(Args, Debug)]
pub struct PlanArgs {
    /// Script of the experiment.
    #[command(flatten)]
    pub script: ScriptArgs,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}
