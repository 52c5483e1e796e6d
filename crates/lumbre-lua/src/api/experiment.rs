//! `experiment(..)`, and the methods `x:skip`, `x:render` and `x:stop`.

use std::collections::BTreeMap;

use mlua::Value as LuaValue;

use super::builder::{Builder, Head, Reference, Stop};
use super::stop_rule::{cell_rules, reference_rules, rule_from_value};
use super::{
    ApiFn, Args, axis, functions, measure, night, notify, presentation, reference, report,
    report_checks,
};
use crate::error::ScriptError;
use crate::source::SourcePlace;
use crate::state::{Purpose, Shared};
use crate::strict;
use lumbre_light::value::schema::Ty;
use lumbre_night::experiment::spec::Order;

/// Largest number of skip rules of one experiment.
const MAX_SKIPS: usize = 1000;

lumbre_light::table! {
    /// Options of `experiment`.
    pub const EXPERIMENT = "ExperimentOptions", "Options of `experiment`.";
    seed = "0": Ty::int(0, i64::MAX), "seed from which the random numbers of every run are derived";
    repeats = "1": Ty::int(1, 10_000),
        "number of runs of every cell, each with other random numbers";
    order = "interleave": Ty::Word(Order::NAMES),
        "order of cells: `interleave` is that of the axes with the techniques of one picture \
         alternating every half second, so that a slowdown of the machine affects all of them; \
         `sequential` is that of the axes, `shuffled` random by the seed";
    warmup = "none": Ty::Table(&night::WARMUP),
        "rendering before the clock of a cell starts, with other random numbers; its result is \
         discarded";
}

functions! {
    /// Constructor of experiments.
    pub const GLOBALS;
    "experiment" -> "Experiment" = experiment,
        "Creates an experiment. A script creates exactly one, calls its methods, and returns it." {
        "name": "string",
            "Name of the experiment and of its results folder: at most 64 letters, digits, `_` and \
             `-`.";
        "options?": "ExperimentOptions", "Seed, repeats, order and warm-up.";
    }
}

/// Methods of an experiment, in the order of the annotations.
pub const METHODS: &[&[ApiFn]] = &[
    axis::METHODS,
    OWN_METHODS,
    reference::METHODS,
    RULE_METHODS,
    night::METHODS,
    notify::METHODS,
    measure::METHODS,
    report::METHODS,
    presentation::METHODS,
];

functions! {
    /// Methods that declare what to render.
    const OWN_METHODS;
    "x:skip" = skip, "Skips points of the sweep." {
        "reason": "string", "Reason, which the plan prints: 1 to 300 characters.";
        "rule": "fun(p: Point): boolean?", "Function that returns true for points to skip.";
    }
    "x:render" = render, "Sets what is rendered at each point of the sweep." {
        "f": "fun(p: Point): Render", "Function that returns the render table of a point.";
    }
}

functions! {
    /// Method that declares the stop rule of cells.
    const RULE_METHODS;
    "x:stop" = stop, "Sets when a cell is finished." {
        "rule": "StopRule|fun(p: Point): StopRule",
            "One rule for all cells, or a function that returns the rule of each cell.";
    }
}

fn experiment(args: &Args) -> Result<LuaValue, ScriptError> {
    let name = args.text(0, "name")?;
    let legal = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-');
    if name.is_empty() || name.len() > 64 || !name.chars().all(legal) {
        let help = "use at most 64 letters, digits, `_` and `-`: it becomes the name of a \
                    folder"
            .to_owned();
        return Err(args.error(format!("`{name}` cannot name an experiment"), Some(help)));
    }
    if let Some(Head {
        place: SourcePlace { line, .. },
        ..
    }) = &args.shared.builder.borrow().head
    {
        return Err(args.error(
            format!("a script describes one experiment; the first is in line {line}"),
            None,
        ));
    }
    if let Purpose::Scene { .. } = args.shared.purpose {
        let help =
            Some("`lumbre run` runs an experiment; its scenes are files of their own".to_owned());
        return Err(args.error("a scene file cannot create an experiment", help));
    }
    if !args.shared.loading.get() {
        return Err(args.error("call experiment(..) only while the script is loaded", None));
    }
    let fields = args.options(1, &EXPERIMENT, "experiment", "{ seed = 1 }")?;
    declare(args, name, &fields)
}

/// Stores name and checked options of the experiment and returns its Lua object.
fn declare(args: &Args, name: String, fields: &strict::Fields) -> Result<LuaValue, ScriptError> {
    let integer = |key: &str| fields.i64(key);
    let object = super::method_object(
        &args.lua,
        &args.shared,
        METHODS.iter().copied().flatten(),
        "x",
    )
    .map_err(|e| args.shared.convert(&e))?;
    // An empty table was converted to a list, which has no map.
    let none = BTreeMap::new();
    let warmup = fields
        .values
        .get("warmup")
        .map(|value| night::warmup(value.as_map().unwrap_or(&none)));
    let warmup = warmup.transpose().map_err(|e| args.locate_error(e))?;
    let order = fields.text("order").and_then(Order::from_name);
    let mut builder = args.shared.builder.borrow_mut();
    (builder.night.order, builder.night.warmup) = (order.unwrap_or(Order::Interleave), warmup);
    builder.head = Some(Head {
        name,
        seed: integer("seed").map_or(0, i64::unsigned_abs),
        repeats: integer("repeats")
            .and_then(|n| u32::try_from(n).ok())
            .unwrap_or(1),
        object: object.clone(),
        place: args.place.clone(),
    });
    Ok(LuaValue::Table(object))
}

fn skip(args: &Args) -> Result<LuaValue, ScriptError> {
    let reason = args.text(0, "reason")?;
    let rule = args.function(1, "rule")?;
    if reason.trim().is_empty() || reason.len() > 300 {
        return Err(args.error(
            "the reason must have 1 to 300 characters, since the plan prints it",
            None,
        ));
    }
    let mut builder = args.shared.builder.borrow_mut();
    if builder.skips.len() >= MAX_SKIPS {
        return Err(args.error(format!("more than {MAX_SKIPS} skip rules"), None));
    }
    builder.skips.push((reason, rule));
    Ok(LuaValue::Nil)
}

fn render(args: &Args) -> Result<LuaValue, ScriptError> {
    let function = args.function(0, "f")?;
    let mut builder = args.shared.builder.borrow_mut();
    args.only_once(builder.render.as_ref().map(|(_, place)| place))?;
    builder.render = Some((function, args.place.clone()));
    Ok(LuaValue::Nil)
}

fn stop(args: &Args) -> Result<LuaValue, ScriptError> {
    let stop = match (args.get(0), rule_from_value(&args.get(0))) {
        (_, Some(rule)) => Stop::Rule(rule),
        (LuaValue::Function(f), None) => Stop::Function(f),
        _ => {
            return Err(args.wrong(
                0,
                "rule",
                "a stop rule such as stop.samples(256), or a function",
            ));
        }
    };
    let mut builder = args.shared.builder.borrow_mut();
    args.only_once(builder.stop.as_ref().map(|(_, place)| place))?;
    builder.stop = Some((stop, args.place.clone()));
    Ok(LuaValue::Nil)
}

/// Checks the declarations after the script has ended.
///
/// # Errors
/// Returns an error for a missing declaration or an undeclared name.
pub fn check(builder: &Builder, head: &Head, shared: &Shared) -> Result<(), ScriptError> {
    let missing = |what: &str, help: &str| {
        Err(shared.sources.borrow().field(
            &head.place,
            "experiment",
            format!("`{}` does not define {what}", head.name),
            Some(help.to_owned()),
        ))
    };
    let Some(_) = &builder.render else {
        return missing(
            "what to render",
            "add x:render(function(p) return { scene = .., integrator = .. } end)",
        );
    };
    let Some((stop, _)) = &builder.stop else {
        return missing(
            "when a cell is finished",
            "add x:stop(stop.samples(256)) or another stop rule",
        );
    };
    let columns = builder.columns();
    if let Stop::Rule(rule) = stop {
        rule.check(shared, &cell_rules(builder, &columns))?;
    }
    if let Some(Reference::Render(reference)) = &builder.reference
        && let Stop::Rule(rule) = &reference.stop
    {
        rule.check(shared, &reference_rules(&columns))?;
    }
    report_checks::check(builder, shared)
}
