//! Axes: lists of values, exact ranges, and axes that move together.

use std::rc::Rc;

use mlua::{Lua, Value as LuaValue};

use super::{ApiFn, Args, Param};
use crate::experiment::spec::Axis;
use crate::script::error::ScriptError;
use crate::script::state::Shared;
use crate::value::Value;
use crate::value::suggest;

/// Most values of one axis.
const MAX_VALUES: usize = 100_000;

/// Most axes of one experiment.
const MAX_AXES: usize = 32;

/// Longest text that may be the value of an axis, in bytes: it becomes part of a folder's name.
const MAX_TEXT: usize = 120;

const FROM: Param = Param { name: "first", ty: "number", doc: "The first value." };

/// The constructors of values.
pub const GLOBALS: &[ApiFn] = &[
    ApiFn {
        name: "range",
        params: &[
            FROM,
            Param { name: "last", ty: "number", doc: "The last value; it is in the list if the steps meet it." },
            Param { name: "step?", ty: "number", doc: "The step, 1 if it is left out; negative counts down." },
        ],
        returns: "number[]",
        doc: "Values from first to last in exact decimal steps: range(0.1, 0.5, 0.1) is 0.1, 0.2, 0.3, 0.4, 0.5.",
        call: range,
    },
    ApiFn {
        name: "linspace",
        params: &[
            FROM,
            Param { name: "last", ty: "number", doc: "The last value, always in the list." },
            Param { name: "count", ty: "integer", doc: "How many values, at least 2." },
        ],
        returns: "number[]",
        doc: "Evenly spaced values from first to last.",
        call: linspace,
    },
    ApiFn {
        name: "logspace",
        params: &[
            Param { name: "first", ty: "number", doc: "The first value, above zero." },
            Param { name: "last", ty: "number", doc: "The last value, above zero, always in the list." },
            Param { name: "count", ty: "integer", doc: "How many values, at least 2." },
        ],
        returns: "number[]",
        doc: "Values from first to last that grow by the same factor, those between rounded to 12 digits.",
        call: logspace,
    },
    ApiFn {
        name: "zip",
        params: &[Param { name: "...", ty: "any[]", doc: "Lists of equal length." }],
        returns: "any[][]",
        doc: "One list of tuples out of several lists: zip({3, 5}, {0.5, 1}) is {{3, 0.5}, {5, 1}}.",
        call: zip,
    },
];

/// The method that declares an axis.
pub const METHODS: &[ApiFn] = &[ApiFn {
    name: "x:axis",
    params: &[
        Param {
            name: "name",
            ty: "string|string[]",
            doc: "The name by which `p.NAME` gives the value; several names for axes that move together.",
        },
        Param {
            name: "values",
            ty: "any[]",
            doc: "A list of numbers, strings, booleans or lists; with several names, a list of tuples as zip makes it.",
        },
    ],
    returns: "",
    doc: "Declares an axis of the sweep. The first axis changes slowest. Axes that move together are declared as \
          x:axis({\"depth\", \"radius\"}, zip({3, 5}, {0.5, 1})).",
    call: axis,
}];

fn numbers(shared: &Shared, lua: &Lua, values: &[f64]) -> Result<LuaValue, ScriptError> {
    let number = |x: &f64| match Value::number(*x) {
        Value::Int(i) => LuaValue::Integer(i),
        _ => LuaValue::Number(*x),
    };
    let table = lua.create_sequence_from(values.iter().map(number)).map_err(|e| shared.convert(&e))?;
    Ok(LuaValue::Table(table))
}

fn range(shared: &Rc<Shared>, lua: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    args.at_most(shared, 3)?;
    let (first, last) = (args.number(shared, 0, "first")?, args.number(shared, 1, "last")?);
    let step = if args.len() > 2 { args.number(shared, 2, "step")? } else { 1.0 };
    match exact_range(first, last, step) {
        Ok(values) => numbers(shared, lua, &values),
        Err(problem) => Err(args.error(shared, problem, None)),
    }
}

/// A number as `mantissa * 10^-scale` from its shortest decimal form.
fn decimal(x: f64) -> Option<(i128, u32)> {
    let text = format!("{x}");
    let (whole, fraction) = text.split_once('.').unwrap_or((&text, ""));
    if whole.len() + fraction.len() > 24 {
        return None;
    }
    Some((format!("{whole}{fraction}").parse().ok()?, fraction.len() as u32))
}

/// `first`, `first + step`, .. up to and including `last`, each the double nearest to the exact decimal.
fn exact_range(first: f64, last: f64, step: f64) -> Result<Vec<f64>, String> {
    let words = format!("range({first}, {last}, {step})");
    if step == 0.0 {
        return Err(format!("{words}: the step is zero"));
    }
    if (last - first) * step < 0.0 {
        return Err(format!("{words} is empty: the step leads away from the last value"));
    }
    let parts = [first, last, step].map(decimal);
    let [Some(a), Some(b), Some(s)] = parts else {
        return Err(format!("{words}: the numbers have too many digits for exact steps; use linspace"));
    };
    let scale = a.1.max(b.1).max(s.1);
    let scaled = |(mantissa, own): (i128, u32)| mantissa.checked_mul(10i128.checked_pow(scale - own)?);
    let (Some(a), Some(b), Some(s)) = (scaled(a), scaled(b), scaled(s)) else {
        return Err(format!("{words}: the numbers differ too much in size for exact steps; use linspace"));
    };
    let steps = (b - a) / s;
    if steps >= MAX_VALUES as i128 {
        return Err(format!("{words} has {} values; an axis has at most {MAX_VALUES}", steps + 1));
    }
    let value = |k: i128| format!("{}e-{scale}", a + k * s).parse().map_err(|_| format!("{words} leaves the numbers"));
    (0..=steps).map(value).collect()
}

fn ends(shared: &Shared, args: &Args) -> Result<(f64, f64, i64), ScriptError> {
    args.at_most(shared, 3)?;
    let (first, last) = (args.number(shared, 0, "first")?, args.number(shared, 1, "last")?);
    Ok((first, last, args.integer(shared, 2, "count", 2, MAX_VALUES as i64)?))
}

fn linspace(shared: &Rc<Shared>, lua: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    let (first, last, count) = ends(shared, args)?;
    let n = (count - 1) as f64;
    let values: Vec<f64> = (0..count)
        .map(|i| match i {
            0 => first,
            i if i == count - 1 => last,
            // One division at the end: linspace(0, 1, 11) then holds 0.3 and not 0.30000000000000004.
            i => (first * (n - i as f64) + last * i as f64) / n,
        })
        .collect();
    numbers(shared, lua, &values)
}

fn logspace(shared: &Rc<Shared>, lua: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    let (first, last, count) = ends(shared, args)?;
    if first <= 0.0 || last <= 0.0 {
        return Err(args.error(shared, format!("logspace({first}, {last}): both ends must be above zero"), None));
    }
    let values: Vec<f64> = (0..count)
        .map(|i| match i {
            0 => first,
            i if i == count - 1 => last,
            i => rounded(first * (last / first).powf(i as f64 / (count - 1) as f64)),
        })
        .collect();
    numbers(shared, lua, &values)
}

/// `x` to 12 significant digits, so that powers of ten come out as such.
fn rounded(x: f64) -> f64 {
    format!("{x:.11e}").parse().unwrap_or(x)
}

fn zip(shared: &Rc<Shared>, lua: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    let lists = (0..args.len()).map(|i| args.table(shared, i, "list")).collect::<Result<Vec<_>, _>>()?;
    let lengths: Vec<usize> = lists.iter().map(mlua::Table::raw_len).collect();
    if lists.len() < 2 {
        let help = "x:axis({\"depth\", \"radius\"}, zip({3, 5}, {0.5, 1}))".to_owned();
        return Err(args.error(shared, "expected at least two lists", Some(help)));
    }
    if lengths.iter().any(|n| *n != lengths[0]) {
        return Err(args.error(shared, format!("the lists differ in length: {lengths:?}"), None));
    }
    if lengths[0] > MAX_VALUES {
        return Err(args.error(shared, format!("{} values; an axis has at most {MAX_VALUES}", lengths[0]), None));
    }
    let tuples = || -> mlua::Result<mlua::Table> {
        let out = lua.create_table_with_capacity(lengths[0], 0)?;
        for i in 1..=lengths[0] {
            let tuple = lua.create_table_with_capacity(lists.len(), 0)?;
            for (j, list) in lists.iter().enumerate() {
                tuple.raw_set(j + 1, list.raw_get::<LuaValue>(i)?)?;
            }
            out.raw_set(i, tuple)?;
        }
        Ok(out)
    };
    Ok(LuaValue::Table(tuples().map_err(|e| shared.convert(&e))?))
}

fn axis(shared: &Rc<Shared>, _: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    args.at_most(shared, 2)?;
    let names = axis_names(shared, args)?;
    let path = format!("axis.{}", names.join("+"));
    let steps = axis_steps(shared, args, &names, &path)?;
    let mut builder = shared.builder.borrow_mut();
    if let Some(name) = names.iter().find(|n| builder.axis_names().contains(&n.as_str())) {
        return Err(args.error(shared, format!("there is already an axis `{name}`"), None));
    }
    if builder.axes.len() >= MAX_AXES {
        return Err(args.error(shared, format!("more than {MAX_AXES} axes"), None));
    }
    builder.axes.push(Axis { names, steps });
    Ok(LuaValue::Nil)
}

fn axis_names(shared: &Shared, args: &Args) -> Result<Vec<String>, ScriptError> {
    let names = match args.get(0) {
        LuaValue::String(_) => vec![args.text(shared, 0, "name")?],
        LuaValue::Table(_) => {
            let not_names = || {
                let help = "x:axis({\"depth\", \"radius\"}, zip({3, 5}, {0.5, 1}))".to_owned();
                args.error(shared, "argument 1 (name): expected a name or a list of names", Some(help))
            };
            let items = args.list(shared, 0, "name", "axis").map_err(|_| not_names())?;
            let names = items.iter().map(|v| v.as_str().map(str::to_owned)).collect::<Option<Vec<_>>>();
            names.filter(|n| !n.is_empty()).ok_or_else(not_names)?
        }
        _ => return Err(args.wrong(shared, 0, "name", "a name or a list of names")),
    };
    for (i, name) in names.iter().enumerate() {
        if !is_name(name) || name == "rep" {
            let help = "letters, digits and `_`, not starting with a digit, at most 40; `rep` is the repeat".to_owned();
            return Err(args.error(shared, format!("`{name}` cannot name an axis"), Some(help)));
        }
        if names[..i].contains(name) {
            return Err(args.error(shared, format!("the name `{name}` stands there twice"), None));
        }
    }
    Ok(names)
}

/// Whether `name` can be written as a field in Lua and as part of a file's name.
pub fn is_name(name: &str) -> bool {
    let starts_well = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
    starts_well && name.len() <= 40 && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

fn axis_steps(shared: &Shared, args: &Args, names: &[String], path: &str) -> Result<Vec<Vec<Value>>, ScriptError> {
    let items = args.list(shared, 1, "values", path)?;
    if items.is_empty() {
        return Err(args.error(shared, format!("{path} has no values"), None));
    }
    if items.len() > MAX_VALUES {
        return Err(args.error(shared, format!("{path} has {} values; at most {MAX_VALUES}", items.len()), None));
    }
    let mut steps: Vec<Vec<Value>> = Vec::with_capacity(items.len());
    for (i, item) in items.into_iter().enumerate() {
        let step = match item {
            item if names.len() == 1 => vec![item],
            Value::List(tuple) if tuple.len() == names.len() => tuple,
            other => {
                let problem =
                    format!("{path}[{}] is `{other}`: expected {} values, one for each name", i + 1, names.len());
                return Err(args.error(shared, problem, None));
            }
        };
        if let Some(problem) = step.iter().find_map(bad_value) {
            return Err(args.error(shared, format!("{path}[{}]: {problem}", i + 1), None));
        }
        steps.push(step);
    }
    // Two cells with the same values would be one run; duplicates are found by their printed form, which is unique.
    let mut seen = std::collections::BTreeMap::new();
    for (i, step) in steps.iter().enumerate() {
        if let Some(before) = seen.insert(format!("{step:?}"), i) {
            let shown = step.iter().map(Value::to_string).collect::<Vec<_>>().join(", ");
            let problem = format!("{path}[{}] repeats the value `{shown}` of [{}]", i + 1, before + 1);
            let help = "experiment(name, { repeats = N }) renders every cell N times".to_owned();
            return Err(args.error(shared, problem, Some(help)));
        }
    }
    Ok(steps)
}

/// What is wrong with a value of an axis, if anything.
fn bad_value(value: &Value) -> Option<String> {
    match value {
        Value::Bool(_) | Value::Int(_) => None,
        Value::Num(x) if x.is_finite() => None,
        Value::Num(x) => Some(format!("{x} is not finite")),
        Value::Str(s) if s.trim().is_empty() => Some("the text is empty".to_owned()),
        Value::Str(s) if s.len() > MAX_TEXT => Some(format!("the text is longer than {MAX_TEXT} bytes")),
        Value::Str(s) if s.chars().any(char::is_control) => Some("the text has control characters".to_owned()),
        Value::Str(_) => None,
        Value::List(items) if items.is_empty() => Some("the list is empty".to_owned()),
        Value::List(items) => items.iter().find_map(bad_value),
        Value::Nil | Value::Map(_) => {
            Some(format!("values are numbers, strings, booleans or lists of such, found {}", value.kind()))
        }
    }
}

/// Checks that `name` is one of the axes.
///
/// # Errors
/// The message and help for a name that is not.
pub fn known_axis(name: &str, axes: &[&str]) -> Result<(), (String, String)> {
    if axes.contains(&name) {
        return Ok(());
    }
    let help = match suggest::nearest(name, axes.iter().copied()) {
        Some(near) => format!("did you mean `{near}`?"),
        None if axes.is_empty() => "the experiment has no axes".to_owned(),
        None => format!("axes: {}", axes.join(", ")),
    };
    Err((format!("there is no axis `{name}`"), help))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_exact_decimals() {
        assert_eq!(exact_range(0.1, 0.5, 0.1).unwrap(), [0.1, 0.2, 0.3, 0.4, 0.5]);
        assert_eq!(exact_range(1.0, 3.0, 1.0).unwrap(), [1.0, 2.0, 3.0]);
        assert_eq!(exact_range(1.0, 0.0, -0.25).unwrap(), [1.0, 0.75, 0.5, 0.25, 0.0]);
        assert_eq!(exact_range(0.0, 1.0, 0.3).unwrap(), [0.0, 0.3, 0.6, 0.9]);
        assert_eq!(exact_range(2.0, 2.0, 1.0).unwrap(), [2.0]);
        assert_eq!(exact_range(-0.5, -0.3, 0.1).unwrap(), [-0.5, -0.4, -0.3]);
        assert_eq!(exact_range(0.0, 99999.0, 1.0).unwrap().len(), 100_000);
    }

    #[test]
    fn ranges_that_make_no_sense_say_why() {
        for (a, b, s, words) in [
            (0.0, 1.0, 0.0, "step is zero"),
            (1.0, 0.0, 0.1, "empty"),
            (0.0, 1e6, 1.0, "at most 100000"),
            (0.0, 1e300, 1.0, "too many digits"),
            (0.0, 1.0, 1e-300, "too many digits"),
        ] {
            let e = exact_range(a, b, s).unwrap_err();
            assert!(e.contains(words), "{e}");
        }
    }

    #[test]
    fn rounding_keeps_powers_of_ten() {
        assert_eq!(rounded(1000f64.powf(1.0 / 3.0)), 10.0);
        assert_eq!(rounded(0.1 + 0.2), 0.3);
    }
}
