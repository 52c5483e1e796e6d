//! `experiment(..)` and the methods that say what is rendered, against what, and until when.

use std::collections::BTreeMap;
use std::rc::Rc;

use mlua::{Lua, Value as LuaValue};

use super::builder::{Agree, Builder, Head, Reference, Stop};
use super::stop::{Allowed, rule_of};
use super::{ApiFn, Args, Param, axis, kind, measure, night, report};
use crate::experiment::StopRule;
use crate::experiment::spec::Order;
use crate::script::error::ScriptError;
use crate::script::source::Place;
use crate::script::state::{Purpose, Shared};
use crate::script::strict;
use crate::value::Value;
use crate::value::schema::{Field, Table, Ty, duration_s};

/// Most skip rules of one experiment.
const MAX_SKIPS: usize = 1000;

/// The options of `experiment`.
pub const EXPERIMENT: Table = Table {
    name: "ExperimentOptions",
    doc: "Options of experiment.",
    fields: &[
        Field {
            key: "seed",
            ty: Ty::Int { min: 0, max: i64::MAX },
            required: false,
            default: "0",
            doc: "the number from which every run's random numbers follow",
        },
        Field {
            key: "repeats",
            ty: Ty::Int { min: 1, max: 10_000 },
            required: false,
            default: "1",
            doc: "how often every cell is rendered, each time with other random numbers",
        },
        Field {
            key: "order",
            ty: Ty::Word(&Order::NAMES),
            required: false,
            default: "sequential",
            doc: "the order of cells: that of the axes; one that the seed decides; or, with interleave, that of the axes \
                  with the techniques of one picture taking turns of half a second, so that a machine that grows slower \
                  does so for all of them",
        },
        Field {
            key: "warmup",
            ty: Ty::Table(&night::WARMUP),
            required: false,
            default: "none",
            doc: "what every cell renders before its clock starts, with other random numbers, and throws away",
        },
    ],
};

/// The option `agree` of `x:reference`.
pub const AGREE: Table = Table {
    name: "Agree",
    doc: "A second technique that has to mean the same picture as the reference. Disagreement is an alarm with a map.",
    fields: &[
        Field {
            key: "with",
            ty: Ty::Str,
            required: true,
            default: "",
            doc: "its integrator; everything else is as in the reference, but for parameters of the integrator",
        },
        Field {
            key: "time",
            ty: Ty::Duration,
            required: false,
            default: "as the reference's stop says",
            doc: "its render time",
        },
        Field {
            key: "samples",
            ty: Ty::Int { min: 2, max: 1 << 53 },
            required: false,
            default: "as the reference's stop says",
            doc: "its samples per pixel",
        },
        Field {
            key: "rate",
            ty: Ty::Num { min: 1e-9, max: 0.5 },
            required: false,
            default: "0.01",
            doc: "of the blocks that are called different, the share that may be so by chance; where nothing differs, the probability of an alarm",
        },
    ],
};

/// The options of `x:reference`.
pub const REFERENCE: Table = Table {
    name: "Reference",
    doc: "What cells are measured against: a picture that is rendered first and kept, or an image file.",
    fields: &[
        Field {
            key: "from",
            ty: Ty::Object("fun(p: Point): RenderChanges"),
            required: false,
            default: "the cell's own render table",
            doc: "returns what differs from the cell's render table; `set`, `aa`, `camera` and `rr` are merged field by field",
        },
        Field {
            key: "stop",
            ty: Ty::Object("StopRule|fun(p: Point): StopRule"),
            required: false,
            default: "",
            doc: "when the reference is good enough, or a function that says so of each cell's; needed unless `image` is \
                  given",
        },
        Field {
            key: "agree",
            ty: Ty::Table(&AGREE),
            required: false,
            default: "no comparison",
            doc: "a second technique that the reference is compared with, block by block",
        },
        Field {
            key: "parts",
            ty: Ty::Int { min: 1, max: 4096 },
            required: false,
            default: "1",
            doc: "how many ranges of samples it is divided into, which workers render at the same time; for `stop.samples` alone",
        },
        Field {
            key: "image",
            ty: Ty::Object("string|fun(p: Point): string"),
            required: false,
            default: "",
            doc: "an EXR file instead, relative to the current folder or else to the script's; or a function that says which",
        },
        Field {
            key: "source",
            ty: Ty::Str,
            required: false,
            default: "",
            doc: "with `image`: who made it and how, in words that stand wherever the reference is named",
        },
    ],
};

/// The constructor of experiments.
pub const GLOBALS: &[ApiFn] = &[ApiFn {
    name: "experiment",
    params: &[
        Param { name: "name", ty: "string", doc: "Its name: letters, digits, `_` and `-`." },
        Param { name: "options?", ty: "ExperimentOptions", doc: "Seed and repeats." },
    ],
    returns: "Experiment",
    doc: "Begins the description of an experiment. A script makes one and ends with returning it.",
    call: experiment,
}];

/// Every method of the experiment, in the order of the annotations.
pub const METHODS: &[&[ApiFn]] = &[axis::METHODS, OWN_METHODS, night::METHODS, measure::METHODS, report::METHODS];

const OWN_METHODS: &[ApiFn] = &[
    ApiFn {
        name: "x:skip",
        params: &[
            Param { name: "reason", ty: "string", doc: "Why, in words: the plan shows it." },
            Param { name: "rule", ty: "fun(p: Point): boolean?", doc: "Returns true for points to leave out." },
        ],
        returns: "",
        doc: "Leaves points of the sweep out.",
        call: skip,
    },
    ApiFn {
        name: "x:render",
        params: &[Param { name: "f", ty: "fun(p: Point): Render", doc: "Returns the table that says what to render." }],
        returns: "",
        doc: "Says what is rendered at each point of the sweep.",
        call: render,
    },
    ApiFn {
        name: "x:reference",
        params: &[Param { name: "options", ty: "Reference", doc: "Where the truth comes from." }],
        returns: "",
        doc: "Says what cells are measured against.",
        call: reference,
    },
    ApiFn {
        name: "x:stop",
        params: &[Param {
            name: "rule",
            ty: "StopRule|fun(p: Point): StopRule",
            doc: "One rule for all cells, or a function that returns the rule of each.",
        }],
        returns: "",
        doc: "Says when a cell is finished.",
        call: stop,
    },
];

fn experiment(shared: &Rc<Shared>, lua: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    args.at_most(shared, 2)?;
    let name = args.text(shared, 0, "name")?;
    let legal = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-');
    if name.is_empty() || name.len() > 64 || !name.chars().all(legal) {
        let help = "letters, digits, `_` and `-`, at most 64: it names a folder".to_owned();
        return Err(args.error(shared, format!("`{name}` cannot name an experiment"), Some(help)));
    }
    if let Some(Head { place: Place { line, .. }, .. }) = &shared.builder.borrow().head {
        return Err(args.error(
            shared,
            format!("a script describes one experiment; the first is in line {line}"),
            None,
        ));
    }
    if let Purpose::Scene { .. } = shared.purpose {
        let help = Some("experiments name it by its file".to_owned());
        return Err(args.error(shared, "a scene's file describes no experiment", help));
    }
    if !shared.loading.get() {
        return Err(args.error(shared, "experiments are described while the script is read", None));
    }
    let fields = match args.get(1) {
        LuaValue::Nil => strict::Fields::default(),
        LuaValue::Table(t) => {
            strict::fields(&t, &EXPERIMENT, "experiment", false).map_err(|e| args.blame(shared, e))?
        }
        _ => return Err(args.wrong(shared, 1, "options", "a table such as { seed = 1 }")),
    };
    let integer = |key: &str| fields.values.get(key).and_then(Value::as_i64);
    let object =
        super::method_object(lua, shared, METHODS.iter().copied().flatten(), "x").map_err(|e| shared.convert(&e))?;
    // A table without fields is a list to whoever reads it.
    let none = BTreeMap::new();
    let warmup = fields.values.get("warmup").map(|value| night::warmup(value.as_map().unwrap_or(&none)));
    let warmup = warmup.transpose().map_err(|e| args.blame(shared, e))?;
    let order = fields.values.get("order").and_then(Value::as_str).and_then(Order::from_name);
    let mut builder = shared.builder.borrow_mut();
    (builder.night.order, builder.night.warmup) = (order.unwrap_or_default(), warmup);
    builder.head = Some(Head {
        name,
        seed: integer("seed").map_or(0, i64::unsigned_abs),
        repeats: integer("repeats").and_then(|n| u32::try_from(n).ok()).unwrap_or(1),
        object: object.clone(),
        place: args.place.clone(),
    });
    Ok(LuaValue::Table(object))
}

/// Rejects saying something a second time.
fn only_once(shared: &Shared, args: &Args, before: Option<&Place>) -> Result<(), ScriptError> {
    match before {
        Some(place) => Err(args.error(shared, format!("said twice: the first is in line {}", place.line), None)),
        None => Ok(()),
    }
}

fn skip(shared: &Rc<Shared>, _: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    args.at_most(shared, 2)?;
    let reason = args.text(shared, 0, "reason")?;
    let rule = args.function(shared, 1, "rule")?;
    if reason.trim().is_empty() || reason.len() > 300 {
        return Err(args.error(shared, "the reason is one sentence: the plan shows it", None));
    }
    let mut builder = shared.builder.borrow_mut();
    if builder.skips.len() >= MAX_SKIPS {
        return Err(args.error(shared, format!("more than {MAX_SKIPS} skip rules"), None));
    }
    builder.skips.push((reason, rule));
    Ok(LuaValue::Nil)
}

fn render(shared: &Rc<Shared>, _: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    args.at_most(shared, 1)?;
    let function = args.function(shared, 0, "f")?;
    let mut builder = shared.builder.borrow_mut();
    only_once(shared, args, builder.render.as_ref().map(|(_, place)| place))?;
    builder.render = Some((function, args.place.clone()));
    Ok(LuaValue::Nil)
}

fn stop(shared: &Rc<Shared>, _: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    args.at_most(shared, 1)?;
    let stop = match (args.get(0), rule_of(&args.get(0))) {
        (_, Some(rule)) => Stop::Rule(rule),
        (LuaValue::Function(f), None) => Stop::Function(f),
        _ => return Err(args.wrong(shared, 0, "rule", "a stop rule such as stop.samples(256), or a function")),
    };
    let mut builder = shared.builder.borrow_mut();
    only_once(shared, args, builder.stop.as_ref().map(|(_, place)| place))?;
    builder.stop = Some((stop, args.place.clone()));
    Ok(LuaValue::Nil)
}

fn agree_of(map: &BTreeMap<String, Value>) -> Agree {
    let mut stops = Vec::new();
    stops.extend(map.get("time").and_then(duration_s).map(StopRule::Time));
    stops.extend(map.get("samples").and_then(Value::as_i64).map(|n| StopRule::Samples(n.unsigned_abs())));
    let stop = if stops.len() > 1 { Some(StopRule::Any(stops)) } else { stops.pop() };
    Agree {
        with: map.get("with").and_then(Value::as_str).unwrap_or_default().to_owned(),
        stop,
        rate: map.get("rate").and_then(Value::as_f64).unwrap_or(0.01),
    }
}

fn reference(shared: &Rc<Shared>, _: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    args.at_most(shared, 1)?;
    let table = args.table(shared, 0, "options")?;
    let fields = strict::fields(&table, &REFERENCE, "reference", false).map_err(|e| args.blame(shared, e))?;
    let fail = |key: &str, problem: String, help: Option<&str>| {
        let path = format!("reference.{key}");
        let error =
            crate::value::schema::SchemaError { path, problem, help: help.map(str::to_owned), key: key.to_owned() };
        Err(args.blame(shared, error))
    };
    let (from, rule, image) = (fields.objects.get("from"), fields.objects.get("stop"), fields.objects.get("image"));
    let source = || fields.values.get("source").and_then(Value::as_str).unwrap_or_default().to_owned();
    let said = match (image, rule) {
        (Some(_), Some(_)) => return fail("stop", "an image is finished; it has no `stop`".to_owned(), None),
        (Some(_), None) if fields.values.contains_key("agree") => {
            return fail("agree", "an image comes without its noise, so it cannot be compared".to_owned(), None);
        }
        (Some(_), None) if from.is_some() => {
            return fail("from", "an image is finished; it has no `from`".to_owned(), None);
        }
        (Some(_), None) if fields.values.contains_key("parts") => {
            return fail("parts", "an image is finished; it has no `parts`".to_owned(), None);
        }
        (None, _) if fields.values.contains_key("source") => {
            return fail("source", "it says who made an `image`, and there is none".to_owned(), None);
        }
        (Some(LuaValue::String(s)), None) => {
            Reference::Image { file: s.to_string_lossy(), source: source(), place: args.place.clone() }
        }
        (Some(LuaValue::Function(f)), None) => Reference::ImageOf { file: f.clone(), source: source() },
        (Some(other), None) => {
            return fail("image", format!("expected a file or a function, found {}", kind(other)), None);
        }
        (None, None) => {
            let help = "a reference has no natural end: stop = stop.samples(4096)".to_owned();
            return Err(shared.sources.borrow().field(&args.place, "reference", "`stop` is missing", Some(help)));
        }
        (None, Some(rule)) => {
            let stop = match (rule_of(rule), rule) {
                (Some(rule), _) => Stop::Rule(rule),
                (None, LuaValue::Function(f)) => Stop::Function(f.clone()),
                (None, _) => {
                    let help = "one of stop.samples(n), stop.time(t), .., or a function that returns one";
                    return fail("stop", format!("expected a stop rule, found {}", kind(rule)), Some(help));
                }
            };
            let from = match from {
                None => None,
                Some(LuaValue::Function(f)) => Some(f.clone()),
                Some(other) => {
                    let help = "from = function(p) return { max_depth = 64 } end";
                    return fail("from", format!("expected a function, found {}", kind(other)), Some(help));
                }
            };
            let agree = fields.values.get("agree").and_then(Value::as_map).map(agree_of);
            let parts = fields.values.get("parts").and_then(Value::as_i64).and_then(|n| u32::try_from(n).ok());
            Reference::Render { from, stop, agree, parts: parts.unwrap_or(1), place: args.place.clone() }
        }
    };
    let mut builder = shared.builder.borrow_mut();
    if builder.reference.is_some() {
        return Err(args.error(shared, "said twice", None));
    }
    builder.reference = Some(said);
    Ok(LuaValue::Nil)
}

/// What `stop.when` may compare in a cell's rule.
pub fn cell_rules<'a>(builder: &Builder, columns: &'a [&'a str]) -> Allowed<'a> {
    let unmeasured = match builder.reference {
        Some(_) => None,
        None => Some("metrics need a reference, and the script has no x:reference"),
    };
    Allowed { columns, unmeasured }
}

/// What `stop.when` may compare in a reference's rule: nothing.
pub fn reference_rules<'a>(columns: &'a [&'a str]) -> Allowed<'a> {
    Allowed { columns, unmeasured: Some("a reference is not measured against anything") }
}

/// Checks what can only be checked when the script has said everything.
///
/// # Errors
/// A missing part, or a name that nobody declared.
pub fn check(builder: &Builder, head: &Head, shared: &Shared) -> Result<(), ScriptError> {
    let missing = |what: &str, help: &str| {
        Err(shared.sources.borrow().field(
            &head.place,
            "experiment",
            format!("`{}` never says {what}", head.name),
            Some(help.to_owned()),
        ))
    };
    let Some(_) = &builder.render else {
        return missing("what to render", "add x:render(function(p) return { scene = .., integrator = .. } end)");
    };
    let Some((stop, _)) = &builder.stop else {
        return missing("when a cell is finished", "add x:stop(stop.samples(256)) or another stop rule");
    };
    let columns = builder.columns();
    if let Stop::Rule(rule) = stop {
        rule.check(shared, &cell_rules(builder, &columns))?;
    }
    if let Some(Reference::Render { stop: Stop::Rule(rule), .. }) = &builder.reference {
        rule.check(shared, &reference_rules(&columns))?;
    }
    report::check(builder, shared)
}
