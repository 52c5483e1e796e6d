//! The script of an experiment, as verbs that plan, render or submit it take it.

use std::path::PathBuf;

use clap::Args;

use super::typed::axis_values;
use lumbre_light::value::Value;

/// Script of an experiment, with changes of its plan.
#[derive(Args, Clone, Debug, Default)]
pub struct ScriptArgs {
    /// Script of the experiment (.lua).
    pub script: PathBuf,
    /// Changes of its plan.
    #[command(flatten)]
    pub changes: PlanChanges,
}

/// Changes of the plan that a script makes.
#[derive(Args, Clone, Debug, Default)]
pub struct PlanChanges {
    /// Replace the values of an axis, or set any setting of the render table, as in `depth=5,9` or
    /// `technique=nee resolution=64x48`.
    ///
    /// A setting may be a path, such as `aa.filter=gaussian` or `materials.floor.roughness=0.2`. It
    /// holds for the reference too, but for the technique and its parameters. Several values are
    /// an axis of their own.
    #[arg(value_name = "NAME=V,V", value_parser = axis_values)]
    pub axes: Vec<(String, Vec<Value>)>,
    /// Run only cells with this value of an axis (repeatable).
    #[arg(long, value_name = "AXIS=VALUE", value_parser = axis_values)]
    pub only: Vec<(String, Vec<Value>)>,
    /// Render pictures with an eighth of the pixels, for a sixteenth of the time and samples.
    ///
    /// The same plan, to see whether it works. Results have other ids.
    #[arg(long)]
    pub quick: bool,
}
