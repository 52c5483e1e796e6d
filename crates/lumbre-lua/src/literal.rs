//! Values as Lua source text.

use std::fmt::Write;

use lumbre_light::value::Value;

/// Returns Lua source text that evaluates to a value. Keys of tables that are names are written
/// without quotes; infinities and NaN are divisions.
pub fn literal(value: &Value) -> String {
    match value {
        Value::Nil => "nil".to_owned(),
        Value::Bool(b) => b.to_string(),
        Value::Int(i) => i.to_string(),
        Value::Num(x) if x.is_nan() => "0 / 0".to_owned(),
        Value::Num(x) if x.is_infinite() => if *x > 0.0 { "1 / 0" } else { "-1 / 0" }.to_owned(),
        Value::Num(x) => x.to_string(),
        Value::Str(text) => quoted(text),
        Value::List(items) if items.is_empty() => "{}".to_owned(),
        Value::List(items) => {
            let items: Vec<String> = items.iter().map(literal).collect();
            format!("{{ {} }}", items.join(", "))
        }
        Value::Map(map) if map.is_empty() => "{}".to_owned(),
        Value::Map(map) => {
            let entries: Vec<String> = map
                .iter()
                .map(|(key, value)| format!("{} = {}", table_key(key), literal(value)))
                .collect();
            format!("{{ {} }}", entries.join(", "))
        }
    }
}

/// Words that Lua reserves, which are no names.
const RESERVED: [&str; 22] = [
    "and", "break", "do", "else", "elseif", "end", "false", "for", "function", "goto", "if", "in",
    "local", "nil", "not", "or", "repeat", "return", "then", "true", "until", "while",
];

/// Returns the key of a table entry: a name, or a quoted string in brackets.
fn table_key(key: &str) -> String {
    let mut characters = key.chars();
    let starts = characters
        .next()
        .is_some_and(|c| c.is_ascii_alphabetic() || c == '_');
    let is_name = starts && characters.all(|c| c.is_ascii_alphanumeric() || c == '_');
    if is_name && !RESERVED.contains(&key) {
        key.to_owned()
    } else {
        format!("[{}]", quoted(key))
    }
}

/// Returns a string in quotes, with escapes for quotes, backslashes and control characters.
fn quoted(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => {
                out.push('\\');
                out.push(c);
            }
            '\n' => out.push_str("\\n"),
            c if c.is_control() => {
                // Writing to a String cannot fail.
                let _ = write!(out, "\\u{{{:x}}}", c as u32);
            }
            c => out.push(c),
        }
    }
    out.push('"');
    out
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use mlua::Lua;

    use super::*;

    #[test]
    fn lua_reads_every_literal_as_its_value() {
        let lua = Lua::new();
        let text = "a \"b\" \\ \n \t \u{1} é";
        for (value, test) in [
            (Value::from(text), "v == s"),
            (Value::Num(0.1), "v == 0.1"),
            (Value::Num(1e300), "v == 1e300"),
            (Value::Num(f64::NEG_INFINITY), "v == -math.huge"),
            (Value::Num(f64::NAN), "v ~= v"),
            (Value::Int(-7), "v == -7"),
            (Value::Bool(true), "v == true"),
            (
                Value::List(vec![Value::Int(1), Value::from("x")]),
                "#v == 2 and v[2] == 'x'",
            ),
            (
                Value::Map(BTreeMap::from([
                    ("end".to_owned(), Value::Int(1)),
                    ("a.b".to_owned(), Value::Int(2)),
                    ("name".to_owned(), Value::List(vec![])),
                ])),
                "v['end'] == 1 and v['a.b'] == 2 and #v.name == 0",
            ),
        ] {
            lua.globals().set("s", text).unwrap();
            let program = format!("local v = {}\nreturn {test}", literal(&value));
            assert!(lua.load(&program).eval::<bool>().unwrap(), "{program}");
        }
    }
}
