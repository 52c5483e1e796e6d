//! What a script says about how nights go, and how fair they are: checkpoints, deadline, warm-up, the A/A check.

use std::collections::BTreeMap;
use std::rc::Rc;

use mlua::{Lua, Value as LuaValue};

use super::{ApiFn, Args, Param};
use crate::experiment::spec::{Deadline, Warmup};
use crate::script::error::ScriptError;
use crate::script::state::Shared;
use crate::script::strict;
use crate::value::Value;
use crate::value::schema::{Field, SchemaError, Table, Ty, duration_s};

/// The option `warmup` of `experiment`.
pub const WARMUP: Table = Table {
    name: "Warmup",
    doc: "What every cell renders before its clock starts, and throws away: one of these.",
    fields: &[
        Field { key: "time", ty: Ty::Duration, required: false, default: "", doc: "render time" },
        Field {
            key: "samples",
            ty: Ty::Int { min: 1, max: 1 << 53 },
            required: false,
            default: "",
            doc: "samples per pixel",
        },
    ],
};

/// The methods that say how nights go.
pub const METHODS: &[ApiFn] = &[
    ApiFn {
        name: "x:checkpoint",
        params: &[Param {
            name: "every",
            ty: "string|number",
            doc: "Render time between two checkpoints: \"60s\", or seconds.",
        }],
        returns: "",
        doc: "Says how often an unfinished cell is saved, so that a night that was cut off goes on in its middle. Without \
              it, every 60 s of render time, and more rarely where saving would cost over 1 % of it.",
        call: checkpoint,
    },
    ApiFn {
        name: "x:deadline",
        params: &[Param {
            name: "at",
            ty: "string",
            doc: "A time of day such as \"08:00\", or a length such as \"7.5h\".",
        }],
        returns: "",
        doc: "Says when a night ends, finished or not. Cells then come from coarse to fine, so that what is finished is a \
              complete smaller grid. `--until` of the command line replaces it.",
        call: deadline,
    },
    ApiFn {
        name: "x:control",
        params: &[Param {
            name: "which?",
            ty: "fun(p: Point): boolean?",
            doc: "Returns true for the points to check; without it, the first technique of every picture.",
        }],
        returns: "",
        doc: "Asks for an A/A check: some cells are rendered twice, with two seeds, as if they were two techniques. Whatever \
              differs between the two is false, and is reported with its confidence, so that one sees how large a difference \
              has to be to mean something. The doubles stand in no table and no figure.",
        call: control,
    },
];

fn one_value(args: &Args, shared: &Rc<Shared>) -> Result<Value, ScriptError> {
    args.at_most(shared, 1)?;
    let found = args.values.first().cloned().unwrap_or(LuaValue::Nil);
    strict::read(&found, args.name, args.name).map_err(|e| args.blame(shared, e))
}

fn checkpoint(shared: &Rc<Shared>, _: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    let every = duration_s(&one_value(args, shared)?).filter(|seconds| *seconds > 0.0);
    let Some(every) = every else {
        return Err(args.error(shared, "expected a duration above 0, such as \"60s\"", None));
    };
    shared.builder.borrow_mut().night.checkpoint_s = Some(every);
    Ok(LuaValue::Nil)
}

fn deadline(shared: &Rc<Shared>, _: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    let Some(deadline) = Deadline::parse(&one_value(args, shared)?) else {
        let problem = "expected a time of day such as \"08:00\" or a length such as \"7.5h\"";
        return Err(args.error(shared, problem, None));
    };
    shared.builder.borrow_mut().night.deadline = Some(deadline);
    Ok(LuaValue::Nil)
}

fn control(shared: &Rc<Shared>, _: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    args.at_most(shared, 1)?;
    let which = match args.get(0) {
        LuaValue::Nil => None,
        LuaValue::Function(f) => Some(f),
        _ => return Err(args.wrong(shared, 0, "which", "a function that returns true for the points to check")),
    };
    let mut builder = shared.builder.borrow_mut();
    if builder.control.is_some() {
        return Err(args.error(shared, "said twice", None));
    }
    builder.control = Some(which);
    Ok(LuaValue::Nil)
}

/// The warm-up that a checked table means.
///
/// # Errors
/// When it says both or neither, or a time of nothing.
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
    let samples = map.get("samples").and_then(Value::as_i64).map(|n| Warmup::Samples(n.unsigned_abs()));
    match (map.get("time").and_then(duration_s), samples) {
        (Some(seconds), None) if seconds > 0.0 => Ok(Warmup::Time(seconds)),
        (Some(_), None) => fail("a time above 0 is needed"),
        (None, Some(samples)) => Ok(samples),
        (Some(_), Some(_)) => fail("`time` and `samples` exclude each other"),
        (None, None) => fail("it says neither `time` nor `samples`"),
    }
}
