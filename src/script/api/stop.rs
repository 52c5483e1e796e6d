//! Stop rules: `stop.time`, `stop.when` and the others, and how they become plain data.

use std::collections::BTreeMap;
use std::rc::Rc;

use mlua::{Function, Lua, UserData, Value as LuaValue};

use super::{ApiFn, Args, Param, kind};
use crate::experiment::StopRule;
use crate::experiment::stop::Comparison;
use crate::script::error::ScriptError;
use crate::script::source::Place;
use crate::script::state::Shared;
use crate::script::strict;
use crate::value::schema::{Field, Table, Ty, duration_s, unknown_name};
use crate::value::{Value, suggest};

/// Most rules inside one rule.
const MAX_PARTS: usize = 256;

/// Deepest nesting of rules.
const MAX_DEPTH: usize = 16;

/// Most different predicate functions of one plan.
const MAX_PREDICATES: usize = 100_000;

/// Largest count of samples, waves or invalid samples.
const MAX_COUNT: i64 = 1 << 53;

/// How comparisons are written.
const COMPARISONS: &[(&str, Comparison)] = &[
    ("<", Comparison::Less),
    ("<=", Comparison::LessEqual),
    (">", Comparison::Greater),
    (">=", Comparison::GreaterEqual),
];

/// The options of `stop.when`.
pub const WHEN: Table = Table {
    name: "WhenOptions",
    doc: "Options of stop.when.",
    fields: &[Field {
        key: "hold",
        ty: Ty::Int { min: 1, max: 1_000_000 },
        required: false,
        default: "1",
        doc: "how many measurements in a row must fulfil the comparison",
    }],
};

/// The options of `stop.plateau`.
pub const PLATEAU: Table = Table {
    name: "PlateauOptions",
    doc: "Options of stop.plateau.",
    fields: &[
        Field {
            key: "slope",
            ty: Ty::Num { min: -10.0, max: -1e-6 },
            required: false,
            default: "-0.1",
            doc: "the exponent of render time with which an error has to fall at least; without bias it falls with -0.5",
        },
        Field {
            key: "over",
            ty: Ty::Num { min: 1.5, max: 1e6 },
            required: false,
            default: "4",
            doc: "how far back it is looked, as a factor of render time: 4 is the last three quarters",
        },
        Field {
            key: "p",
            ty: Ty::Num { min: 1e-9, max: 0.5 },
            required: false,
            default: "0.01",
            doc: "the probability of a slope as flat as the one that is found, if the error fell as asked, below which it counts",
        },
    ],
};

/// The constructors of stop rules.
pub const RULES: &[ApiFn] = &[
    ApiFn {
        name: "stop.time",
        params: &[Param {
            name: "time",
            ty: "number|string",
            doc: "Render time: seconds, or text such as \"50s\", \"5min\".",
        }],
        returns: "StopRule",
        doc: "Stops when the renderer has worked for this long.",
        call: time,
    },
    ApiFn {
        name: "stop.samples",
        params: &[Param { name: "count", ty: "integer", doc: "Samples per pixel." }],
        returns: "StopRule",
        doc: "Stops when every pixel has exactly this many samples.",
        call: samples,
    },
    ApiFn {
        name: "stop.waves",
        params: &[Param { name: "count", ty: "integer", doc: "Waves." }],
        returns: "StopRule",
        doc: "Stops after this many waves.",
        call: waves,
    },
    ApiFn {
        name: "stop.when",
        params: &[
            Param { name: "column", ty: "string", doc: "A metric column of x:measure." },
            Param { name: "comparison", ty: "\"<\"|\"<=\"|\">\"|\">=\"", doc: "How it is compared." },
            Param { name: "value", ty: "number", doc: "The threshold." },
            Param { name: "options?", ty: "WhenOptions", doc: "How long it has to hold." },
        ],
        returns: "StopRule",
        doc: "Stops when a metric passes a threshold.",
        call: when,
    },
    ApiFn {
        name: "stop.plateau",
        params: &[
            Param { name: "column", ty: "string", doc: "A metric column of x:measure." },
            Param { name: "options?", ty: "PlateauOptions", doc: "What counts as falling no more." },
        ],
        returns: "StopRule",
        doc: "Stops when an error falls no more: when the slope of its logarithm over the logarithm of render time is \
              significantly flatter than asked. Then time buys nothing, because only bias, or the noise of the reference, \
              is left.",
        call: plateau,
    },
    ApiFn {
        name: "stop.nan",
        params: &[Param { name: "count", ty: "integer", doc: "Invalid samples." }],
        returns: "StopRule",
        doc: "Stops when at least this many samples were NaN or infinite.",
        call: nan,
    },
    ApiFn {
        name: "stop.predicate",
        params: &[Param {
            name: "f",
            ty: "fun(row: Row, history: Row[]): boolean?",
            doc: "Called after every measurement with the newest row and all rows, oldest first.",
        }],
        returns: "StopRule",
        doc: "Stops when the function returns true.",
        call: predicate,
    },
    ApiFn {
        name: "stop.any",
        params: &[Param { name: "...", ty: "StopRule|StopRule[]", doc: "Rules, one by one or in a list." }],
        returns: "StopRule",
        doc: "Stops when any of these rules does.",
        call: any,
    },
    ApiFn {
        name: "stop.all",
        params: &[Param { name: "...", ty: "StopRule|StopRule[]", doc: "Rules, one by one or in a list." }],
        returns: "StopRule",
        doc: "Stops when all of these rules do at once.",
        call: all,
    },
    ApiFn {
        name: "stop.not_",
        params: &[Param { name: "rule", ty: "StopRule", doc: "A rule." }],
        returns: "StopRule",
        doc: "Stops when the rule does not.",
        call: not,
    },
];

#[derive(Debug)]
enum Rule {
    Leaf(StopRule),
    /// A rule about a column.
    When(StopRule, String, Place),
    Predicate(Function),
    Any(Vec<RuleObject>),
    All(Vec<RuleObject>),
    Not(RuleObject),
}

/// A stop rule as scripts hold it.
#[derive(Clone, Debug)]
pub struct RuleObject {
    rule: Rc<Rule>,
    parts: usize,
    depth: usize,
}

impl UserData for RuleObject {}

/// The predicates of a plan; a stop rule names each by its number.
#[derive(Debug, Default)]
pub struct Predicates {
    functions: Vec<Function>,
    numbers: BTreeMap<usize, usize>,
}

impl Predicates {
    /// The predicate with this number.
    pub fn get(&self, number: usize) -> Option<Function> {
        self.functions.get(number).cloned()
    }

    /// The number of a function, the same for the same function; `None` when there are too many.
    fn number(&mut self, function: &Function) -> Option<usize> {
        // The function is kept, so its address stays its own.
        let address = function.to_pointer() as usize;
        if let Some(number) = self.numbers.get(&address) {
            return Some(*number);
        }
        if self.functions.len() >= MAX_PREDICATES {
            return None;
        }
        let number = self.functions.len();
        self.functions.push(function.clone());
        self.numbers.insert(address, number);
        Some(number)
    }
}

/// What a rule may say where it stands.
pub struct Allowed<'a> {
    /// The metric columns.
    pub columns: &'a [&'a str],
    /// Why no column can be compared here, if so.
    pub unmeasured: Option<&'static str>,
}

impl RuleObject {
    fn new(rule: Rule) -> RuleObject {
        let (parts, depth) = match &rule {
            Rule::Any(rules) | Rule::All(rules) => (
                rules.iter().map(|r| r.parts).fold(1, usize::saturating_add),
                1 + rules.iter().map(|r| r.depth).max().unwrap_or(0),
            ),
            Rule::Not(inner) => (inner.parts.saturating_add(1), inner.depth + 1),
            _ => (1, 1),
        };
        RuleObject { rule: Rc::new(rule), parts, depth }
    }

    /// Checks every comparison in the rule.
    ///
    /// # Errors
    /// An unknown column, or a comparison where nothing is measured, at the line of its `stop.when`.
    pub fn check(&self, shared: &Shared, allowed: &Allowed) -> Result<(), ScriptError> {
        match &*self.rule {
            Rule::Leaf(_) | Rule::Predicate(_) => Ok(()),
            Rule::Any(rules) | Rule::All(rules) => rules.iter().try_for_each(|r| r.check(shared, allowed)),
            Rule::Not(inner) => inner.check(shared, allowed),
            Rule::When(rule, column, place) => {
                let function = if let StopRule::Plateau { .. } = rule { "stop.plateau" } else { "stop.when" };
                let fail = |problem: String, help: Option<String>| {
                    Err(shared.sources.borrow().field(place, function, problem, help))
                };
                if let Some(reason) = allowed.unmeasured {
                    return fail(format!("`{column}` cannot be compared here: {reason}"), None);
                }
                if allowed.columns.contains(&column.as_str()) {
                    return Ok(());
                }
                let error = unknown_name("", column, "metric column", allowed.columns.iter().copied());
                fail(error.problem, error.help)
            }
        }
    }

    /// The rule as plain data. `place` is where it was handed over.
    ///
    /// # Errors
    /// When the plan has too many predicates.
    pub fn lower(&self, shared: &Shared, place: &Place) -> Result<StopRule, ScriptError> {
        let many = |rules: &[RuleObject]| rules.iter().map(|r| r.lower(shared, place)).collect::<Result<Vec<_>, _>>();
        Ok(match &*self.rule {
            Rule::Leaf(rule) | Rule::When(rule, ..) => rule.clone(),
            Rule::Any(rules) => StopRule::Any(many(rules)?),
            Rule::All(rules) => StopRule::All(many(rules)?),
            Rule::Not(inner) => StopRule::Not(Box::new(inner.lower(shared, place)?)),
            Rule::Predicate(function) => {
                let number = shared.predicates.borrow_mut().number(function);
                StopRule::Predicate(number.ok_or_else(|| {
                    let problem = format!("the plan has more than {MAX_PREDICATES} different predicates");
                    let help = "make the predicate once, outside the function".to_owned();
                    shared.sources.borrow().field(place, "stop.predicate", problem, Some(help))
                })?)
            }
        })
    }
}

/// The rule that a Lua value is.
pub fn rule_of(value: &LuaValue) -> Option<RuleObject> {
    match value {
        LuaValue::UserData(data) => data.borrow::<RuleObject>().ok().map(|r| r.clone()),
        _ => None,
    }
}

fn object(shared: &Shared, lua: &Lua, args: &Args, rule: Rule) -> Result<LuaValue, ScriptError> {
    let rule = RuleObject::new(rule);
    if rule.parts > MAX_PARTS || rule.depth > MAX_DEPTH {
        let problem = format!("the rule has more than {MAX_PARTS} parts or is nested more than {MAX_DEPTH} deep");
        return Err(args.error(shared, problem, None));
    }
    Ok(LuaValue::UserData(lua.create_userdata(rule).map_err(|e| shared.convert(&e))?))
}

fn time(shared: &Rc<Shared>, lua: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    args.at_most(shared, 1)?;
    let value = strict::read(&args.get(0), "stop.time", "").map_err(|e| args.blame(shared, e))?;
    match duration_s(&value) {
        Some(seconds) if seconds > 0.0 => object(shared, lua, args, Rule::Leaf(StopRule::Time(seconds))),
        _ => Err(args.error(
            shared,
            format!("`{value}` is no duration above zero: expected {}", Ty::Duration.describe()),
            None,
        )),
    }
}

fn count(shared: &Shared, args: &Args) -> Result<u64, ScriptError> {
    args.at_most(shared, 1)?;
    args.integer(shared, 0, "count", 1, MAX_COUNT).map(i64::unsigned_abs)
}

fn samples(shared: &Rc<Shared>, lua: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    object(shared, lua, args, Rule::Leaf(StopRule::Samples(count(shared, args)?)))
}

fn waves(shared: &Rc<Shared>, lua: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    object(shared, lua, args, Rule::Leaf(StopRule::Waves(count(shared, args)?)))
}

fn nan(shared: &Rc<Shared>, lua: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    object(shared, lua, args, Rule::Leaf(StopRule::Nan(count(shared, args)?)))
}

fn when(shared: &Rc<Shared>, lua: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    args.at_most(shared, 4)?;
    let column = args.text(shared, 0, "column")?;
    let sign = args.text(shared, 1, "comparison")?;
    let value = args.number(shared, 2, "value")?;
    let Some((_, op)) = COMPARISONS.iter().find(|(s, _)| *s == sign) else {
        let known = COMPARISONS.iter().map(|(s, _)| *s).collect::<Vec<_>>().join(", ");
        return Err(args.error(shared, format!("unknown comparison `{sign}`"), Some(format!("known: {known}"))));
    };
    let options = match args.get(3) {
        LuaValue::Nil => strict::Fields::default(),
        LuaValue::Table(t) => strict::fields(&t, &WHEN, "stop.when", false).map_err(|e| args.blame(shared, e))?,
        _ => return Err(args.wrong(shared, 3, "options", "a table such as { hold = 3 }")),
    };
    let hold = options.values.get("hold").and_then(Value::as_i64).and_then(|h| u32::try_from(h).ok()).unwrap_or(1);
    let rule = StopRule::When { column: column.clone(), op: *op, value, hold };
    object(shared, lua, args, Rule::When(rule, column, args.place.clone()))
}

fn plateau(shared: &Rc<Shared>, lua: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    args.at_most(shared, 2)?;
    let column = args.text(shared, 0, "column")?;
    let options = match args.get(1) {
        LuaValue::Nil => strict::Fields::default(),
        LuaValue::Table(t) => strict::fields(&t, &PLATEAU, "stop.plateau", false).map_err(|e| args.blame(shared, e))?,
        _ => return Err(args.wrong(shared, 1, "options", "a table such as { slope = -0.1 }")),
    };
    let number = |key: &str, default: f64| options.values.get(key).and_then(Value::as_f64).unwrap_or(default);
    let (exponent, over, p) = (number("slope", -0.1), number("over", 4.0), number("p", 0.01));
    let rule = StopRule::Plateau { column: column.clone(), exponent, over, p };
    object(shared, lua, args, Rule::When(rule, column, args.place.clone()))
}

fn predicate(shared: &Rc<Shared>, lua: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    args.at_most(shared, 1)?;
    let function = args.function(shared, 0, "f")?;
    object(shared, lua, args, Rule::Predicate(function))
}

/// The rules in the arguments: one by one, or in one list.
fn rules(shared: &Shared, args: &Args) -> Result<Vec<RuleObject>, ScriptError> {
    let values: Vec<LuaValue> = match args.get(0) {
        LuaValue::Table(list) if args.len() == 1 => {
            let n = list.raw_len();
            (1..=n.min(MAX_PARTS + 1))
                .map(|i| list.raw_get(i))
                .collect::<mlua::Result<_>>()
                .map_err(|e| shared.convert(&e))?
        }
        _ => (0..args.len()).map(|i| args.get(i)).collect(),
    };
    if values.is_empty() {
        let help = "write stop.any { stop.samples(256), stop.time(\"50s\") }".to_owned();
        return Err(args.error(shared, "expected at least one rule", Some(help)));
    }
    let rule = |(i, value): (usize, &LuaValue)| {
        rule_of(value).ok_or_else(|| {
            args.error(shared, format!("rule {}: expected a stop rule, found {}", i + 1, kind(value)), help_for(value))
        })
    };
    values.iter().enumerate().map(rule).collect()
}

/// What may have been meant by something that is no rule.
fn help_for(value: &LuaValue) -> Option<String> {
    let names = || RULES.iter().filter_map(|r| r.name.strip_prefix("stop."));
    match value {
        LuaValue::Function(_) => Some("a function becomes a rule by stop.predicate(f)".to_owned()),
        LuaValue::String(s) => suggest::nearest(&s.to_string_lossy(), names()).map(|n| format!("write stop.{n}(..)")),
        LuaValue::Integer(_) | LuaValue::Number(_) => Some("write stop.samples(n) or stop.time(seconds)".to_owned()),
        _ => None,
    }
}

fn any(shared: &Rc<Shared>, lua: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    object(shared, lua, args, Rule::Any(rules(shared, args)?))
}

fn all(shared: &Rc<Shared>, lua: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    object(shared, lua, args, Rule::All(rules(shared, args)?))
}

fn not(shared: &Rc<Shared>, lua: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    args.at_most(shared, 1)?;
    match rule_of(&args.get(0)) {
        Some(inner) => object(shared, lua, args, Rule::Not(inner)),
        None => Err(args.wrong(shared, 0, "rule", "a stop rule")),
    }
}
