//! Markdown for the generated reference pages: types, ranges, defaults and tables of schemas.

use super::schema::{AUTO, Field, Table, Ty};

/// Returns a text as a sentence: with a capital letter and a full stop. The first word keeps its
/// case if it is a name, such as a value before a colon.
pub fn sentence(text: &str) -> String {
    let first = text.split_whitespace().next().unwrap_or_default();
    let is_word = first.bytes().all(|b| b.is_ascii_lowercase() || b == b'-');
    let mut out = String::with_capacity(text.len() + 1);
    let mut chars = text.chars();
    match chars.next() {
        Some(c) if is_word => out.push(c.to_ascii_uppercase()),
        Some(c) => out.push(c),
        None => return out,
    }
    out.push_str(chars.as_str());
    if !out.ends_with(['.', '?', ':', '!']) {
        out.push('.');
    }
    out
}

/// Returns a text for a table cell: vertical bars are escaped and line breaks become spaces.
pub fn cell(text: &str) -> String {
    text.replace('|', "\\|").replace('\n', " ")
}

/// Returns one row of a table.
pub fn row<const N: usize>(cells: [&str; N]) -> String {
    format!("| {} |\n", cells.map(cell).join(" | "))
}

/// Returns the heading of a table: titles and the line below them.
pub fn table_head<const N: usize>(titles: [&str; N]) -> String {
    format!("{}|{}\n", row(titles), "---|".repeat(N))
}

/// Returns the table of a schema's fields: key, type with range, default, meaning.
pub fn fields_table(table: &Table) -> String {
    let mut out = table_head(["key", "type", "default", "meaning"]);
    for field in table.fields {
        out += &row([
            &format!("`{}`", field.key),
            &type_text(&field.ty),
            &default_text(field),
            &sentence(field.doc),
        ]);
    }
    out
}

/// Returns the default of a field; values are set as code, descriptions as text.
fn default_text(field: &Field) -> String {
    let text = field.default;
    let is_value = match field.ty {
        Ty::Word(words) => words.contains(&text),
        Ty::OneOrMany(Ty::Word(words)) => words.contains(&text),
        Ty::Bool => matches!(text, "true" | "false"),
        _ => {
            text.starts_with(['{', '"', '-']) || text.ends_with(')') || text.parse::<f64>().is_ok()
        }
    };
    match text {
        _ if field.required => "required".to_owned(),
        "" => "–".to_owned(),
        text if is_value => format!("`{text}`"),
        text => text.to_owned(),
    }
}

/// Returns a type with its range, as Markdown. Nested tables are links to their headings.
pub fn type_text(ty: &Ty) -> String {
    match ty {
        Ty::Bool => "boolean".to_owned(),
        Ty::Int { min, max } => format!("integer{}", integer_range(*min, *max)),
        Ty::Num { min, max } => format!("number{}", range(*min, *max)),
        Ty::Str => "string".to_owned(),
        Ty::Word(words) | Ty::WordOrDeclared(words) => {
            let words: Vec<String> = words.iter().map(|word| format!("`{word}`")).collect();
            words.join(", ")
        }
        Ty::Duration => "duration".to_owned(),
        Ty::Nums { len, min, max } => format!("{len} numbers{}", range(*min, *max)),
        Ty::List(item) => list_text(item),
        Ty::OneOrMany(item) => format!("{}, or {}", type_text(item), list_text(item)),
        Ty::OrAuto(item) => format!("`{AUTO}`, or {}", type_text(item)),
        Ty::Table(table) => link(table),
        Ty::Object(name) | Ty::Any(name) => format!("`{name}`"),
    }
}

/// Returns a link to the heading of a table on the same page.
pub fn link(table: &Table) -> String {
    format!("[`{0}`](#{1})", table.name, table.name.to_lowercase())
}

/// Returns the type of a list of items.
fn list_text(item: &Ty) -> String {
    match item {
        Ty::Int { min, max } => format!("list of integers{}", integer_range(*min, *max)),
        Ty::Num { min, max } => format!("list of numbers{}", range(*min, *max)),
        Ty::Nums { len, min, max } => {
            format!("list of lists of {len} numbers{}", range(*min, *max))
        }
        Ty::Str => "list of strings".to_owned(),
        Ty::Word(_) => "list of these".to_owned(),
        item => format!("list of items: {}", type_text(item)),
    }
}

/// Returns the range of an integer; empty if it has no limits.
fn integer_range(min: i64, max: i64) -> String {
    match (min == i64::MIN, max == i64::MAX) {
        (true, true) => String::new(),
        (false, true) => format!(" ≥ {}", integer_text(min)),
        (true, false) => format!(" ≤ {}", integer_text(max)),
        (false, false) => format!(", {} to {}", integer_text(min), integer_text(max)),
    }
}

/// Returns an integer; large powers of two are written as such.
fn integer_text(n: i64) -> String {
    let power = n
        .unsigned_abs()
        .is_power_of_two()
        .then(|| n.trailing_zeros());
    match power {
        Some(exponent) if n >= 1 << 16 => format!("2^{exponent}"),
        _ if n == i64::from(u32::MAX) => "2^32 - 1".to_owned(),
        _ => n.to_string(),
    }
}

/// Returns the range of a number; empty if it has no limits.
fn range(min: f64, max: f64) -> String {
    match (min <= f64::MIN, max >= f64::MAX) {
        (true, true) => String::new(),
        (false, true) => format!(" ≥ {}", number_text(min)),
        (true, false) => format!(" ≤ {}", number_text(max)),
        (false, false) => format!(", {} to {}", number_text(min), number_text(max)),
    }
}

/// Returns a number; very large and very small ones have an exponent.
fn number_text(x: f64) -> String {
    let size = x.abs();
    if size >= 1e5 || (size > 0.0 && size < 1e-3) {
        format!("{x:e}")
    } else {
        x.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sentences_begin_with_a_capital_letter_unless_with_a_name() {
        assert_eq!(sentence("half width in pixels"), "Half width in pixels.");
        assert_eq!(sentence("`true`: linear"), "`true`: linear.");
        assert_eq!(sentence("sah: number of bins"), "sah: number of bins.");
        assert_eq!(sentence(""), "");
    }

    #[test]
    fn ranges_are_short() {
        let int = |min, max| type_text(&Ty::Int { min, max });
        assert_eq!(int(1, 9), "integer, 1 to 9");
        assert_eq!(int(1, 1 << 53), "integer, 1 to 2^53");
        assert_eq!(int(0, i64::MAX), "integer ≥ 0");
        let num = |min, max| type_text(&Ty::Num { min, max });
        assert_eq!(num(1e-9, 1e9), "number, 1e-9 to 1e9");
        assert_eq!(num(f64::MIN, f64::MAX), "number");
        assert_eq!(
            type_text(&Ty::OneOrMany(&Ty::Str)),
            "string, or list of strings"
        );
    }

    #[test]
    fn rows_escape_vertical_bars() {
        assert_eq!(row(["a|b", "c"]), "| a\\|b | c |\n");
        assert_eq!(table_head(["a", "b"]), "| a | b |\n|---|---|\n");
    }
}
