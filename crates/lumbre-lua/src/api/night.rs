//! Declarations about nights and fair comparisons: checkpoints, deadline, warm-up and the A/A
//! check.

use std::collections::BTreeMap;

use mlua::Value as LuaValue;

use super::{ApiFn, Args, functions};
use crate::error::ScriptError;
use crate::strict;
use lumbre_light::value::Value;
use lumbre_light::value::schema::{SchemaError, Ty, duration_s};
use lumbre_night::experiment::spec::{Deadline, Warmup};

lumbre_light::table! {
    /// Option `warmup` of `experiment`.
    pub const WARMUP = "Warmup",
        "Rendering before the clock of a cell starts; its result is discarded. Exactly one key is \
         given.";
    time = "": Ty::Duration, "render time before the clock starts, above 0";
    samples = "": Ty::int(1, 1 << 53), "samples per pixel before the clock starts";
}

functions! {
    /// Methods that set how nights run.
    pub const METHODS;
    "x:checkpoint" = checkpoint,
        "Sets how often an unfinished cell is saved, so that an interrupted night resumes from its \
         last checkpoint. Default: every 60 s of render time, and less often if saving would take \
         more than 1 % of it." {
        "every": "string|number",
            "Render time between two checkpoints, above 0: seconds, or text such as \"60s\".";
    }
    "x:deadline" = deadline,
        "Sets when a night ends, finished or not. Cells are then ordered from coarse to fine, so \
         that the finished ones form a complete smaller grid. The option `--until` of the command \
         line replaces it." {
        "at": "string", "Time of day such as \"08:00\", or duration such as \"7.5h\".";
    }
    "x:control" = control,
        "Adds an A/A check: renders the chosen points twice, with two seeds, as if they were two \
         techniques. Every difference between the two is a false discovery and is reported with \
         its confidence interval, which shows how large a difference has to be to matter. The \
         duplicates do not appear in tables or figures." {
        "which?": "fun(p: Point): boolean?",
            "Function that returns true for the points to check. Default: the first technique of \
             every picture.";
    }
}

/// Returns the only argument as plain data.
fn one_value(args: &Args) -> Result<Value, ScriptError> {
    let found = args.get(0);
    strict::read(&found, args.name, args.name).map_err(|e| args.locate_error(e))
}

fn checkpoint(args: &Args) -> Result<LuaValue, ScriptError> {
    let every = duration_s(&one_value(args)?).filter(|seconds| *seconds > 0.0);
    let Some(every) = every else {
        return Err(args.error("expected a duration above 0, such as \"60s\"", None));
    };
    args.shared.builder.borrow_mut().night.checkpoint_s = Some(every);
    Ok(LuaValue::Nil)
}

fn deadline(args: &Args) -> Result<LuaValue, ScriptError> {
    let Some(deadline) = Deadline::parse(&one_value(args)?) else {
        let problem = "expected a time of day such as \"08:00\" or a length such as \"7.5h\"";
        return Err(args.error(problem, None));
    };
    args.shared.builder.borrow_mut().night.deadline = Some(deadline);
    Ok(LuaValue::Nil)
}

fn control(args: &Args) -> Result<LuaValue, ScriptError> {
    let which = match args.get(0) {
        LuaValue::Nil => None,
        LuaValue::Function(f) => Some(f),
        _ => {
            return Err(args.wrong(
                0,
                "which",
                "a function that returns true for the points to check",
            ));
        }
    };
    let mut builder = args.shared.builder.borrow_mut();
    if builder.aa_check.is_some() {
        return Err(args.error("called twice; an experiment has one A/A check", None));
    }
    builder.aa_check = Some(which);
    Ok(LuaValue::Nil)
}

/// Converts a checked table to a warm-up.
///
/// # Errors
/// Returns an error if the table has both keys or none, or a time of 0.
pub fn warmup(map: &BTreeMap<String, Value>) -> Result<Warmup, SchemaError> {
    let fail = |problem: &str| {
        let help = Some("warmup = { time = \"2s\" } or { samples = 16 }".to_owned());
        Err(SchemaError {
            path: "experiment.warmup".to_owned(),
            problem: problem.to_owned(),
            help,
            key: "warmup".to_owned(),
        })
    };
    let samples = map
        .get("samples")
        .and_then(Value::as_i64)
        .map(|n| Warmup::Samples(n.unsigned_abs()));
    match (map.get("time").and_then(duration_s), samples) {
        (Some(seconds), None) if seconds > 0.0 => Ok(Warmup::Time(seconds)),
        (Some(_), None) => fail("expected a time above 0"),
        (None, Some(samples)) => Ok(samples),
        (Some(_), Some(_)) => fail("`time` and `samples` exclude each other"),
        (None, None) => fail("expected `time` or `samples`, found neither"),
    }
}
