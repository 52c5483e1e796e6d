//! Readable relative paths of cells, valid on every file system.

use std::collections::BTreeSet;

use crate::experiment::spec::Point;
use lumbre_light::value::Value;

/// Greatest length of an axis name or a value in a path, in characters.
const LONGEST: usize = 40;

/// Assigns unique paths to points.
#[derive(Debug, Default)]
pub(super) struct Paths {
    taken: BTreeSet<String>,
}

impl Paths {
    /// Returns the path of a point without its repeat: `scene=cornell/depth=5`, empty for a sweep
    /// without axes.
    ///
    /// Letters, digits and `. _ + -` are kept, other characters become `_`, and long texts are cut.
    /// A value that was changed in this way gets a few digits of its hash appended. If the path is
    /// still equal to an earlier one, ignoring case (`5` and `"5"`, `a` and `A`), all of its values
    /// get their hash.
    pub(super) fn unique_path(&mut self, point: &Point) -> String {
        let path = join(point, false);
        if self.taken.insert(path.to_lowercase()) {
            return path;
        }
        let path = join(point, true);
        self.taken.insert(path.to_lowercase());
        path
    }
}

/// Joins the names and values of a point; `hashed` appends the hash to every value.
fn join(point: &Point, hashed: bool) -> String {
    let component = |(name, value): &(String, Value)| {
        format!(
            "{}={}",
            clean(&Value::from(name.as_str()), false),
            clean(value, hashed)
        )
    };
    point.iter().map(component).collect::<Vec<_>>().join("/")
}

/// Makes a value safe for file names; `hashed` appends its hash even if nothing was changed.
fn clean(value: &Value, hashed: bool) -> String {
    let text = value.to_string();
    let safe = |c: char| {
        if c.is_ascii_alphanumeric() || "._+-".contains(c) {
            c
        } else {
            '_'
        }
    };
    let mut cleaned: String = text.chars().map(safe).take(LONGEST).collect();
    // Windows removes a dot at the end of a name.
    if hashed || cleaned != text || cleaned.ends_with('.') || cleaned.is_empty() {
        let mut hasher = blake3::Hasher::new();
        value.hash_into(&mut hasher);
        cleaned = format!("{cleaned}~{}", &hasher.finalize().to_hex()[..8]);
    }
    cleaned
}

#[cfg(test)]
mod tests {
    use super::*;

    fn paths(values: &[Value]) -> Vec<String> {
        let mut paths = Paths::default();
        values
            .iter()
            .map(|v| paths.unique_path(&vec![("scene".to_owned(), v.clone())]))
            .collect()
    }

    #[test]
    fn plain_values_read_as_written() {
        let values = [
            "cornell_box".into(),
            Value::Int(5),
            Value::Num(0.25),
            Value::Bool(true),
            Value::Int(-3),
        ];
        assert_eq!(
            paths(&values),
            [
                "scene=cornell_box",
                "scene=5",
                "scene=0.25",
                "scene=true",
                "scene=-3"
            ]
            .map(str::to_owned)
        );
        let two: Point = vec![
            ("scene".into(), "a".into()),
            ("depth".into(), Value::Int(2)),
        ];
        assert_eq!(Paths::default().unique_path(&two), "scene=a/depth=2");
        assert_eq!(Paths::default().unique_path(&Vec::new()), "");
    }

    #[test]
    fn hostile_values_stay_inside_one_short_folder_and_apart() {
        let long = "x".repeat(500);
        let longer = "x".repeat(501);
        let hostile: Vec<Value> = [
            "a/b",
            "a\\b",
            "a b",
            "a_b",
            "..",
            "../../etc",
            "a:b",
            "",
            "a.",
            &long,
            &longer,
            "é",
        ]
        .map(Value::from)
        .into_iter()
        .chain([
            Value::List(vec![Value::Int(1), Value::Int(2)]),
            Value::Int(5),
            "5".into(),
            "A".into(),
            "a".into(),
        ])
        .collect();
        let paths = paths(&hostile);
        for path in &paths {
            let value = path.strip_prefix("scene=").unwrap();
            assert!(value.len() <= LONGEST + 9 && !value.is_empty(), "{path}");
            assert!(
                value
                    .chars()
                    .all(|c| c.is_ascii_alphanumeric() || "._+-~".contains(c)),
                "{path}"
            );
            assert!(!value.ends_with('.'), "{path}");
        }
        let distinct: BTreeSet<String> = paths.iter().map(|p| p.to_lowercase()).collect();
        assert_eq!(distinct.len(), hostile.len(), "{paths:?}");
    }

    #[test]
    fn an_axis_name_is_cleaned_too() {
        let point: Point = vec![("a/b".into(), Value::Int(1))];
        let path = Paths::default().unique_path(&point);
        assert!(path.starts_with("a_b~") && path.ends_with("=1"), "{path}");
    }
}
