//! Constructors of stop rules: `stop.time`, `stop.when` and the others.

use mlua::Value as LuaValue;

use super::rule::{Rule, RuleObject};
use super::stop_rule::rule_from_value;
use super::{ApiFn, Args, functions};
use crate::error::ScriptError;
use crate::kind::kind;
use crate::strict;
use lumbre_light::value::schema::{Ty, duration_s};
use lumbre_light::value::suggest;
use lumbre_night::experiment::StopRule;
use lumbre_night::experiment::stop::Comparison;

/// Largest number of rules inside one rule.
const MAX_RULES: usize = 256;

/// Deepest nesting of rules.
const MAX_DEPTH: usize = 16;

/// Largest count of samples, waves or invalid samples.
const MAX_COUNT: i64 = 1 << 53;

/// Comparison operators with their spelling in scripts.
const COMPARISONS: &[(&str, Comparison)] = &[
    ("<", Comparison::Less),
    ("<=", Comparison::LessEqual),
    (">", Comparison::Greater),
    (">=", Comparison::GreaterEqual),
];

lumbre_light::table! {
    /// Options of `stop.when`.
    pub const WHEN = "WhenOptions", "Options of `stop.when`.";
    hold = "1": Ty::int(1, 1_000_000),
        "number of consecutive measurements that must fulfil the comparison";
}

lumbre_light::table! {
    /// Options of `stop.plateau`.
    pub const PLATEAU = "PlateauOptions", "Options of `stop.plateau`.";
    slope = "-0.1": Ty::num(-10.0, -1e-6),
        "slope of log(error) over log(render time) above which the error counts as constant; an \
         unbiased technique has -0.5";
    over = "4": Ty::num(1.5, 1e6),
        "length of the fitted interval as a ratio of render times: 4 uses the last three quarters \
         of the time";
    p = "0.01": Ty::num(1e-9, 0.5),
        "significance level: the rule stops if a slope as flat as the measured one had a smaller \
         probability under the requested slope";
}

functions! {
    /// Constructors of stop rules.
    pub const RULES;
    "stop.time" -> "StopRule" = time,
        "Stops when the render time, which excludes measuring and saving, reaches a limit." {
        "time": "number|string",
            "Render time above 0: seconds, or text such as \"50s\" or \"5min\".";
    }
    "stop.samples" -> "StopRule" = |args| counted(args, StopRule::Samples),
        "Stops when every pixel has exactly this many samples." {
        "count": "integer", "Samples per pixel, at least 1.";
    }
    "stop.waves" -> "StopRule" = |args| counted(args, StopRule::Waves),
        "Stops after this many waves." {
        "count": "integer", "Number of waves, at least 1.";
    }
    "stop.when" -> "StopRule" = when, "Stops when a metric passes a threshold." {
        "column": "string", "Name of a metric column of x:measure.";
        "comparison": "\"<\"|\"<=\"|\">\"|\">=\"", "Comparison of the column with the threshold.";
        "value": "number", "Threshold in the unit of the metric.";
        "options?": "WhenOptions", "Number of measurements for which the comparison must hold.";
    }
    "stop.plateau" -> "StopRule" = plateau,
        "Stops when an error no longer falls: when the slope of its logarithm over the logarithm \
         of render time is significantly flatter than requested. More time is then useless, since \
         only bias or the noise of the reference is left." {
        "column": "string", "Name of a metric column of x:measure.";
        "options?": "PlateauOptions", "Slope, interval and significance.";
    }
    "stop.nan" -> "StopRule" = |args| counted(args, StopRule::Nan),
        "Stops when at least this many samples were NaN or infinite." {
        "count": "integer", "Number of invalid samples, at least 1.";
    }
    "stop.predicate" -> "StopRule" = predicate, "Stops when the function returns true." {
        "f": "fun(row: Row, history: Row[]): boolean?",
            "Function that is called after every measurement with the newest row and all rows, \
             oldest first.";
    }
    "stop.any" -> "StopRule" = any, "Stops when at least one of the rules is fulfilled." {
        "...": "StopRule|StopRule[]", "Rules, as arguments or in one list.";
    }
    "stop.all" -> "StopRule" = all, "Stops when all rules are fulfilled at the same time." {
        "...": "StopRule|StopRule[]", "Rules, as arguments or in one list.";
    }
    "stop.not_" -> "StopRule" = not, "Stops when the rule is not fulfilled." {
        "rule": "StopRule", "Rule to negate.";
    }
}

/// Creates the Lua object of a rule.
fn rule_object(args: &Args, rule: Rule) -> Result<LuaValue, ScriptError> {
    let rule = RuleObject::new(rule);
    if rule.size() > MAX_RULES || rule.depth() > MAX_DEPTH {
        let problem = format!(
            "the rule contains more than {MAX_RULES} rules or is nested more than {MAX_DEPTH} deep"
        );
        return Err(args.error(problem, None));
    }
    args.object(rule)
}

fn time(args: &Args) -> Result<LuaValue, ScriptError> {
    let value = strict::read(&args.get(0), "stop.time", "").map_err(|e| args.locate_error(e))?;
    match duration_s(&value) {
        Some(seconds) if seconds > 0.0 => rule_object(args, Rule::Leaf(StopRule::Time(seconds))),
        _ => Err(args.error(
            format!(
                "`{value}` is not a duration above zero: expected {}",
                Ty::Duration.describe()
            ),
            None,
        )),
    }
}

/// Returns the rule of the only argument, a count.
fn counted(args: &Args, rule: fn(u64) -> StopRule) -> Result<LuaValue, ScriptError> {
    let count = args.integer(0, "count", 1, MAX_COUNT)?;
    rule_object(args, Rule::Leaf(rule(count.unsigned_abs())))
}

fn when(args: &Args) -> Result<LuaValue, ScriptError> {
    let column = args.text(0, "column")?;
    let sign = args.text(1, "comparison")?;
    let value = args.number(2, "value")?;
    let Some((_, op)) = COMPARISONS.iter().find(|(s, _)| *s == sign) else {
        let known = COMPARISONS
            .iter()
            .map(|(s, _)| *s)
            .collect::<Vec<_>>()
            .join(", ");
        return Err(args.error(
            format!("unknown comparison `{sign}`"),
            Some(format!("known: {known}")),
        ));
    };
    let options = args.options(3, &WHEN, "stop.when", "{ hold = 3 }")?;
    let hold = options
        .i64("hold")
        .and_then(|h| u32::try_from(h).ok())
        .unwrap_or(1);
    let rule = StopRule::When {
        column: column.clone(),
        op: *op,
        value,
        hold,
    };
    rule_object(args, Rule::Column(rule, column, args.place.clone()))
}

fn plateau(args: &Args) -> Result<LuaValue, ScriptError> {
    let column = args.text(0, "column")?;
    let options = args.options(1, &PLATEAU, "stop.plateau", "{ slope = -0.1 }")?;
    let number = |key: &str, default: f64| options.f64(key).unwrap_or(default);
    let (exponent, over, p) = (
        number("slope", -0.1),
        number("over", 4.0),
        number("p", 0.01),
    );
    let rule = StopRule::Plateau {
        column: column.clone(),
        exponent,
        over,
        p,
    };
    rule_object(args, Rule::Column(rule, column, args.place.clone()))
}

fn predicate(args: &Args) -> Result<LuaValue, ScriptError> {
    let function = args.function(0, "f")?;
    rule_object(args, Rule::Predicate(function))
}

/// Returns the rules in the arguments, given one by one or in one list.
fn rules(args: &Args) -> Result<Vec<RuleObject>, ScriptError> {
    let values: Vec<LuaValue> = match args.get(0) {
        LuaValue::Table(list) if args.len() == 1 => {
            let n = list.raw_len();
            (1..=n.min(MAX_RULES + 1))
                .map(|i| list.raw_get(i))
                .collect::<mlua::Result<_>>()
                .map_err(|e| args.shared.convert(&e))?
        }
        _ => (0..args.len()).map(|i| args.get(i)).collect(),
    };
    if values.is_empty() {
        let help = "write stop.any { stop.samples(256), stop.time(\"50s\") }".to_owned();
        return Err(args.error("expected at least one rule", Some(help)));
    }
    let rule = |(i, value): (usize, &LuaValue)| {
        rule_from_value(value).ok_or_else(|| {
            args.error(
                format!(
                    "rule {}: expected a stop rule, found {}",
                    i + 1,
                    kind(value)
                ),
                help_for(value),
            )
        })
    };
    values.iter().enumerate().map(rule).collect()
}

/// Returns a suggestion for a value that is not a rule.
fn help_for(value: &LuaValue) -> Option<String> {
    let names = || RULES.iter().filter_map(|r| r.name.strip_prefix("stop."));
    match value {
        LuaValue::Function(_) => {
            Some("use stop.predicate(f) to make a rule of a function".to_owned())
        }
        LuaValue::String(s) => {
            suggest::nearest(&s.to_string_lossy(), names()).map(|n| format!("write stop.{n}(..)"))
        }
        LuaValue::Integer(_) | LuaValue::Number(_) => {
            Some("write stop.samples(n) or stop.time(seconds)".to_owned())
        }
        _ => None,
    }
}

fn any(args: &Args) -> Result<LuaValue, ScriptError> {
    rule_object(args, Rule::Any(rules(args)?))
}

fn all(args: &Args) -> Result<LuaValue, ScriptError> {
    rule_object(args, Rule::All(rules(args)?))
}

fn not(args: &Args) -> Result<LuaValue, ScriptError> {
    match rule_from_value(&args.get(0)) {
        Some(inner) => rule_object(args, Rule::Not(inner)),
        None => Err(args.wrong(0, "rule", "a stop rule")),
    }
}
