//! The script of an experiment, as verbs that plan, render or submit it take it.

use std::path::PathBuf;

use clap::Args;

use super::typed::axis_values;
use lumbre_light::value::Value;

/// Script of an experiment, with changes of its axes.
#[derive(Args, Clone, Debug, Default)]
pub struct ScriptArgs {
    /// Script of the experiment (.lua).
    pub script: PathBuf,
    /// Replace the values of an axis, as in `depth=5,9`.
    #[arg(value_name = "AXIS=V,V", value_parser = axis_values)]
    pub axes: Vec<(String, Vec<Value>)>,
    /// Run only cells with this value of an axis (repeatable).
    #[arg(long, value_name = "AXIS=VALUE", value_parser = axis_values)]
    pub only: Vec<(String, Vec<Value>)>,
}
