//! `x:axis` and the constructors of value lists: `range`, `linspace`, `logspace` and `zip`.

use mlua::Value as LuaValue;

use super::{ApiFn, Args, functions};
use crate::error::ScriptError;
use lumbre_light::value::Value;
use lumbre_light::value::suggest;
use lumbre_night::experiment::spec::Axis;

/// Largest number of values of one axis.
const MAX_VALUES: usize = 100_000;

/// Largest number of axes of one experiment.
const MAX_AXES: usize = 32;

/// Greatest number of values of all axes together.
const MAX_VALUES_OF_ALL: usize = 300_000;

/// Longest string that may be the value of an axis, in bytes. It becomes part of a folder name.
const MAX_TEXT: usize = 120;

functions! {
    /// Constructors of value lists.
    pub const GLOBALS;
    "range" -> "number[]" = range,
        "Returns the values from first to last in exact decimal steps: range(0.1, 0.5, 0.1) is { \
         0.1, 0.2, 0.3, 0.4, 0.5 }." {
        "first": "number", "First value.";
        "last": "number", "Last value; it is included if the steps reach it exactly.";
        "step?": "number",
            "Step between values, default 1; a negative step counts down. Zero is an error.";
    }
    "linspace" -> "number[]" = linspace, "Returns evenly spaced values from first to last." {
        "first": "number", "First value.";
        "last": "number", "Last value, always included.";
        "count": "integer", "Number of values, from 2 to 100000.";
    }
    "logspace" -> "number[]" = logspace,
        "Returns geometrically spaced values from first to last. Values in between are rounded to \
         12 digits." {
        "first": "number", "First value, above 0.";
        "last": "number", "Last value, above 0, always included.";
        "count": "integer", "Number of values, from 2 to 100000.";
    }
    "zip" -> "any[][]" = zip,
        "Combines several lists to one list of tuples: zip({3, 5}, {0.5, 1}) is {{3, 0.5}, {5, \
         1}}." {
        "...": "any[]", "At least two lists of equal length.";
    }
}

functions! {
    /// Method that declares an axis.
    pub const METHODS;
    "x:axis" = axis,
        "Declares an axis of the sweep. The first axis varies slowest. Parameters that vary \
         together are declared as x:axis({\"depth\", \"radius\"}, zip({3, 5}, {0.5, 1}))." {
        "name": "string|string[]",
            "Name of the axis: functions read its value as `p.NAME`. A list of names declares \
             parameters that vary together.";
        "values": "any[]",
            "List of at most 100000 numbers, strings, booleans or lists; for several names, a list \
             of tuples as returned by zip.";
    }
}

/// Returns a Lua list of numbers; whole numbers become integers.
fn numbers(args: &Args, values: &[f64]) -> Result<LuaValue, ScriptError> {
    let number = |x: &f64| match Value::number(*x) {
        Value::Int(i) => LuaValue::Integer(i),
        _ => LuaValue::Number(*x),
    };
    let table = args
        .lua
        .create_sequence_from(values.iter().map(number))
        .map_err(|e| args.shared.convert(&e))?;
    Ok(LuaValue::Table(table))
}

fn range(args: &Args) -> Result<LuaValue, ScriptError> {
    let (first, last) = (args.number(0, "first")?, args.number(1, "last")?);
    let step = if args.len() > 2 {
        args.number(2, "step")?
    } else {
        1.0
    };
    match exact_range(first, last, step) {
        Ok(values) => numbers(args, &values),
        Err(problem) => Err(args.error(problem, None)),
    }
}

/// Returns mantissa and scale of `mantissa * 10^-scale`, the shortest decimal form of a number;
/// `None` if it has more than 24 digits.
fn decimal(x: f64) -> Option<(i128, u32)> {
    let text = format!("{x}");
    let (whole, fraction) = text.split_once('.').unwrap_or((&text, ""));
    if whole.len() + fraction.len() > 24 {
        return None;
    }
    Some((
        format!("{whole}{fraction}").parse().ok()?,
        fraction.len() as u32,
    ))
}

/// Returns `first`, `first + step` and so on, up to and including `last`. Each is the double
/// nearest to the exact decimal.
fn exact_range(first: f64, last: f64, step: f64) -> Result<Vec<f64>, String> {
    let call = format!("range({first}, {last}, {step})");
    if step == 0.0 {
        return Err(format!("{call}: the step is zero"));
    }
    if (last - first) * step < 0.0 {
        return Err(format!(
            "{call} is empty: the step leads away from the last value"
        ));
    }
    let parts = [first, last, step].map(decimal);
    let [Some(a), Some(b), Some(s)] = parts else {
        return Err(format!(
            "{call}: the numbers have too many digits for exact steps; use linspace"
        ));
    };
    let scale = a.1.max(b.1).max(s.1);
    let scaled =
        |(mantissa, own): (i128, u32)| mantissa.checked_mul(10i128.checked_pow(scale - own)?);
    let (Some(a), Some(b), Some(s)) = (scaled(a), scaled(b), scaled(s)) else {
        return Err(format!(
            "{call}: the numbers differ too much in size for exact steps; use linspace"
        ));
    };
    let steps = (b - a) / s;
    if steps >= MAX_VALUES as i128 {
        return Err(format!(
            "{call} has {} values; an axis has at most {MAX_VALUES}",
            steps + 1
        ));
    }
    let value = |k: i128| {
        format!("{}e-{scale}", a + k * s)
            .parse()
            .map_err(|_| format!("{call}: a value is not a finite number"))
    };
    (0..=steps).map(value).collect()
}

/// Returns the arguments first, last and count of `linspace` and `logspace`.
fn ends(args: &Args) -> Result<(f64, f64, i64), ScriptError> {
    let (first, last) = (args.number(0, "first")?, args.number(1, "last")?);
    Ok((first, last, args.integer(2, "count", 2, MAX_VALUES as i64)?))
}

fn linspace(args: &Args) -> Result<LuaValue, ScriptError> {
    let (first, last, count) = ends(args)?;
    let n = (count - 1) as f64;
    let values: Vec<f64> = (0..count)
        .map(|i| match i {
            0 => first,
            i if i == count - 1 => last,
            // One division at the end: linspace(0, 1, 11) then holds 0.3 and not
            // 0.30000000000000004.
            i => (first * (n - i as f64) + last * i as f64) / n,
        })
        .collect();
    numbers(args, &values)
}

fn logspace(args: &Args) -> Result<LuaValue, ScriptError> {
    let (first, last, count) = ends(args)?;
    if first <= 0.0 || last <= 0.0 {
        return Err(args.error(
            format!("logspace({first}, {last}): both ends must be above zero"),
            None,
        ));
    }
    let values: Vec<f64> = (0..count)
        .map(|i| match i {
            0 => first,
            i if i == count - 1 => last,
            i => rounded(first * (last / first).powf(i as f64 / (count - 1) as f64)),
        })
        .collect();
    numbers(args, &values)
}

/// Rounds to 12 significant digits, so that powers of ten are exact.
fn rounded(x: f64) -> f64 {
    format!("{x:.11e}").parse().unwrap_or(x)
}

fn zip(args: &Args) -> Result<LuaValue, ScriptError> {
    let lists = (0..args.len())
        .map(|i| args.table(i, "list"))
        .collect::<Result<Vec<_>, _>>()?;
    let lengths: Vec<usize> = lists.iter().map(mlua::Table::raw_len).collect();
    if lists.len() < 2 {
        let help = "x:axis({\"depth\", \"radius\"}, zip({3, 5}, {0.5, 1}))".to_owned();
        return Err(args.error("expected at least two lists", Some(help)));
    }
    if lengths.iter().any(|n| *n != lengths[0]) {
        return Err(args.error(format!("the lists differ in length: {lengths:?}"), None));
    }
    if lengths[0] > MAX_VALUES {
        return Err(args.error(
            format!("{} values; an axis has at most {MAX_VALUES}", lengths[0]),
            None,
        ));
    }
    let tuples = || -> mlua::Result<mlua::Table> {
        let out = args.lua.create_table_with_capacity(lengths[0], 0)?;
        for i in 1..=lengths[0] {
            let tuple = args.lua.create_table_with_capacity(lists.len(), 0)?;
            for (j, list) in lists.iter().enumerate() {
                tuple.raw_set(j + 1, list.raw_get::<LuaValue>(i)?)?;
            }
            out.raw_set(i, tuple)?;
        }
        Ok(out)
    };
    Ok(LuaValue::Table(
        tuples().map_err(|e| args.shared.convert(&e))?,
    ))
}

fn axis(args: &Args) -> Result<LuaValue, ScriptError> {
    let names = axis_names(args)?;
    let path = format!("axis.{}", names.join("+"));
    let steps = axis_steps(args, &names, &path)?;
    let mut builder = args.shared.builder.borrow_mut();
    if let Some(name) = names
        .iter()
        .find(|n| builder.axis_names().contains(&n.as_str()))
    {
        return Err(args.error(format!("there is already an axis `{name}`"), None));
    }
    if builder.axes.len() >= MAX_AXES {
        return Err(args.error(format!("more than {MAX_AXES} axes"), None));
    }
    let others: usize = builder.axes.iter().map(|axis| axis.steps.len()).sum();
    if others + steps.len() > MAX_VALUES_OF_ALL {
        let problem = format!(
            "the axes have {} values together; at most {MAX_VALUES_OF_ALL}",
            others + steps.len()
        );
        return Err(args.error(problem, None));
    }
    builder.axes.push(Axis { names, steps });
    Ok(LuaValue::Nil)
}

/// Returns the names in the first argument of `x:axis`.
fn axis_names(args: &Args) -> Result<Vec<String>, ScriptError> {
    let names = match args.get(0) {
        LuaValue::String(_) => vec![args.text(0, "name")?],
        LuaValue::Table(_) => {
            let not_names = || {
                let help = "x:axis({\"depth\", \"radius\"}, zip({3, 5}, {0.5, 1}))".to_owned();
                args.error(
                    "argument 1 (name): expected a name or a list of names",
                    Some(help),
                )
            };
            let items = args.list(0, "name", "axis").map_err(|_| not_names())?;
            let names = items
                .iter()
                .map(|v| v.as_str().map(str::to_owned))
                .collect::<Option<Vec<_>>>();
            names.filter(|n| !n.is_empty()).ok_or_else(not_names)?
        }
        _ => return Err(args.wrong(0, "name", "a name or a list of names")),
    };
    for (i, name) in names.iter().enumerate() {
        if !is_name(name) || name == "rep" {
            let help = "use at most 40 letters, digits and `_`, not starting with a digit; `rep` \
                        is reserved for repeats"
                .to_owned();
            return Err(args.error(format!("`{name}` cannot name an axis"), Some(help)));
        }
        if names[..i].contains(name) {
            return Err(args.error(format!("the name `{name}` is given twice"), None));
        }
    }
    Ok(names)
}

/// Returns whether `name` can be a field name in Lua and a part of a file name.
pub fn is_name(name: &str) -> bool {
    let starts_well = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
    starts_well && name.len() <= 40 && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// Returns the values in the second argument of `x:axis`: for each step, one value per name.
fn axis_steps(args: &Args, names: &[String], path: &str) -> Result<Vec<Vec<Value>>, ScriptError> {
    let items = args.list(1, "values", path)?;
    if items.is_empty() {
        return Err(args.error(format!("{path} has no values"), None));
    }
    if items.len() > MAX_VALUES {
        return Err(args.error(
            format!("{path} has {} values; at most {MAX_VALUES}", items.len()),
            None,
        ));
    }
    let mut steps: Vec<Vec<Value>> = Vec::with_capacity(items.len());
    for (i, item) in items.into_iter().enumerate() {
        let step = match item {
            item if names.len() == 1 => vec![item],
            Value::List(tuple) if tuple.len() == names.len() => tuple,
            other => {
                let problem = format!(
                    "{path}[{}] is `{other}`: expected {} values, one for each name",
                    i + 1,
                    names.len()
                );
                return Err(args.error(problem, None));
            }
        };
        if let Some(problem) = step.iter().find_map(bad_value) {
            return Err(args.error(format!("{path}[{}]: {problem}", i + 1), None));
        }
        steps.push(step);
    }
    // Two cells with the same values would be one run. The debug form of values is unique, so it
    // serves as the key.
    let mut seen = std::collections::BTreeMap::new();
    for (i, step) in steps.iter().enumerate() {
        if let Some(before) = seen.insert(format!("{step:?}"), i) {
            let shown = step
                .iter()
                .map(Value::to_string)
                .collect::<Vec<_>>()
                .join(", ");
            let problem = format!(
                "{path}[{}] repeats the value `{shown}` of [{}]",
                i + 1,
                before + 1
            );
            let help = "experiment(name, { repeats = N }) renders every cell N times".to_owned();
            return Err(args.error(problem, Some(help)));
        }
    }
    Ok(steps)
}

/// Returns why a value cannot be the value of an axis; `None` if it can.
fn bad_value(value: &Value) -> Option<String> {
    match value {
        Value::Bool(_) | Value::Int(_) => None,
        Value::Num(x) if x.is_finite() => None,
        Value::Num(x) => Some(format!("{x} is not finite")),
        Value::Str(s) if s.trim().is_empty() => Some("the text is empty".to_owned()),
        Value::Str(s) if s.len() > MAX_TEXT => {
            Some(format!("the text is longer than {MAX_TEXT} bytes"))
        }
        Value::Str(s) if s.chars().any(char::is_control) => {
            Some("the text has control characters".to_owned())
        }
        Value::Str(s) if has_address(s) => Some(
            "the text has an address in memory, which differs in every process, so the run would \
             never be found again"
                .to_owned(),
        ),
        Value::Str(_) => None,
        Value::List(items) if items.is_empty() => Some("the list is empty".to_owned()),
        Value::List(items) => items.iter().find_map(bad_value),
        Value::Nil | Value::Map(_) => Some(format!(
            "values are numbers, strings, booleans or lists of such, found {}",
            value.kind()
        )),
    }
}

/// Whether a text has an address as `tostring` writes it for functions and tables: `0x` and at least
/// eight hexadecimal digits.
fn has_address(text: &str) -> bool {
    let digits = |rest: &str| rest.bytes().take_while(u8::is_ascii_hexdigit).count();
    text.split("0x").skip(1).any(|rest| digits(rest) >= 8)
}

/// Checks that `name` is one of the axes.
///
/// # Errors
/// Returns message and help if it is not.
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
    fn addresses_of_tables_and_functions_are_no_values() {
        for text in ["table: 0x55d0c0ffee12", "function: builtin: 0x12345678"] {
            assert!(bad_value(&text.into()).is_some(), "{text}");
        }
        for text in ["0x1234567", "0x and more", "12345678"] {
            assert_eq!(bad_value(&text.into()), None, "{text}");
        }
    }

    #[test]
    fn ranges_are_exact_decimals() {
        assert_eq!(
            exact_range(0.1, 0.5, 0.1).unwrap(),
            [0.1, 0.2, 0.3, 0.4, 0.5]
        );
        assert_eq!(exact_range(1.0, 3.0, 1.0).unwrap(), [1.0, 2.0, 3.0]);
        assert_eq!(
            exact_range(1.0, 0.0, -0.25).unwrap(),
            [1.0, 0.75, 0.5, 0.25, 0.0]
        );
        assert_eq!(exact_range(0.0, 1.0, 0.3).unwrap(), [0.0, 0.3, 0.6, 0.9]);
        assert_eq!(exact_range(2.0, 2.0, 1.0).unwrap(), [2.0]);
        assert_eq!(exact_range(-0.5, -0.3, 0.1).unwrap(), [-0.5, -0.4, -0.3]);
        assert_eq!(exact_range(0.0, 99999.0, 1.0).unwrap().len(), 100_000);
    }

    #[test]
    fn invalid_ranges_are_errors() {
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
