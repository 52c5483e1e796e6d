//! Claims of the theses, from the files beside the scripts. Their fields are described in
//! `scripts/theses/README.md`.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use lumbre_light::value::Value;
use lumbre_night::experiment::spec::Point;
use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::values::Quantity;
use crate::root;

/// Folder of the scripts, from the root of the repository.
pub const FOLDER: &str = "scripts/theses";

/// Values of axes that select runs.
pub type Selection = BTreeMap<String, Value>;

/// Test of a claim, by its name in the files.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum Test {
    Less,
    Equal,
    Rises,
    Falls,
    Shift,
    Drawn,
    None,
}

/// Side of a comparison.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    A,
    #[default]
    B,
}

/// Runs or number with which the runs of `a` are compared.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
pub enum Operand {
    Number(f64),
    Runs(Selection),
}

/// Channel of a picture; the number is its index.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Channel {
    R,
    G,
    B,
}

/// Axis over which a value rises or falls, and its values in order.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Over {
    pub axis: String,
    pub values: Vec<Value>,
}

/// One claim of a thesis.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Claim {
    pub document: String,
    pub section: String,
    pub item: String,
    pub says: String,
    pub figure: String,
    pub test: Test,
    pub value: Option<Quantity>,
    pub value_b: Option<Quantity>,
    #[serde(default)]
    pub a: Selection,
    pub b: Option<Operand>,
    pub factor: Option<f64>,
    pub within: Option<f64>,
    pub each: Option<String>,
    pub over: Option<Over>,
    pub by: Option<f64>,
    pub region: Option<[f64; 4]>,
    pub channel: Option<Channel>,
    pub channel_b: Option<Channel>,
    pub file: Option<String>,
    pub why: Option<String>,
    pub shown_by: Option<Selection>,
    #[serde(default)]
    pub shown_in: Side,
}

impl Claim {
    /// Returns the quantity of a side.
    ///
    /// # Errors
    /// Returns a message if the claim has none.
    pub fn quantity(&self, side: Side) -> Result<&Quantity, &'static str> {
        let own = self.value_b.as_ref().filter(|_| side == Side::B);
        own.or(self.value.as_ref()).ok_or("no value is compared")
    }

    /// Returns the channel of a side.
    pub fn channel(&self, side: Side) -> Option<Channel> {
        self.channel_b.filter(|_| side == Side::B).or(self.channel)
    }

    /// Returns the claim about one value of the axis `each`.
    pub fn at(&self, axis: &str, value: &Value) -> Claim {
        let mut claim = self.clone();
        let runs = [Some(&mut claim.a), runs(&mut claim.b)];
        for selection in runs.into_iter().flatten() {
            selection.insert(axis.to_owned(), value.clone());
        }
        claim
    }

    /// Returns the claim with the values of `shown_by`, if it has them.
    pub fn with_reason(&self) -> Option<Claim> {
        let mut claim = self.clone();
        let selection = match self.shown_in {
            Side::A => &mut claim.a,
            Side::B => runs(&mut claim.b)?,
        };
        selection.extend(self.shown_by.clone()?);
        Some(claim)
    }

    /// Returns the name of a field that the test needs and the claim lacks.
    fn lacking(&self) -> Option<&'static str> {
        use Test::{Drawn, Equal, Falls, Less, None, Rises, Shift};
        let is = |tests: &[Test]| tests.contains(&self.test);
        let is_over_time = self.value.as_ref().is_some_and(Quantity::is_over_time);
        let rules = [
            ("value", !is(&[Drawn, None]), self.value.is_some()),
            ("b", is(&[Less, Equal, Shift]), self.b.is_some()),
            ("within", is(&[Equal, Shift]), self.within.is_some()),
            ("by", is(&[Shift]), self.by.is_some()),
            ("over", is(&[Rises, Falls]), self.over.is_some()),
            ("file", is(&[Drawn]), self.file.is_some()),
            ("why", is(&[None]), self.why.is_some()),
            ("region", is_over_time, self.region.is_some()),
            ("channel", is_over_time, self.channel.is_some()),
        ];
        let lacking = rules
            .into_iter()
            .find(|(_, needed, there)| *needed && !there);
        lacking.map(|(field, ..)| field)
    }
}

/// Returns the selection of an operand that has one.
fn runs(operand: &mut Option<Operand>) -> Option<&mut Selection> {
    match operand {
        Some(Operand::Runs(selection)) => Some(selection),
        Some(Operand::Number(_)) | None => None,
    }
}

/// Returns whether a point has all values of a selection.
pub fn matches(point: &Point, selection: &Selection) -> bool {
    selection
        .iter()
        .all(|(axis, value)| point.iter().any(|(name, own)| name == axis && own == value))
}

/// A script with its claims.
#[derive(Clone, Debug)]
pub struct ClaimedScript {
    /// Name of the experiment and of both files.
    pub name: String,
    pub claims: Vec<Claim>,
}

impl ClaimedScript {
    /// Returns the path of the script from the root of the repository.
    pub fn file(&self) -> String {
        format!("{FOLDER}/{}.lua", self.name)
    }
}

/// Content of a file of claims.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ClaimFile {
    claim: Vec<Claim>,
}

/// Reads all scripts with their claims, ordered by name.
///
/// # Errors
/// Returns a message if a script has no claims, or a file of claims is invalid.
pub fn scripts() -> Result<Vec<ClaimedScript>, String> {
    let folder = root().join(FOLDER);
    let entries = fs::read_dir(&folder).map_err(|e| format!("{FOLDER}: {e}"))?;
    let files = entries.flatten().map(|entry| entry.path());
    let mut files: Vec<PathBuf> = files
        .filter(|path| path.extension().is_some_and(|e| e == "lua"))
        .collect();
    files.sort();
    let script = |path: PathBuf| {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        Ok(ClaimedScript {
            claims: read_claims(&path.with_extension("toml"))?,
            name: name.into_owned(),
        })
    };
    files.into_iter().map(script).collect()
}

/// Reads a file of claims.
///
/// # Errors
/// Returns a message with the file, and the number of the claim or the line.
fn read_claims(file: &Path) -> Result<Vec<Claim>, String> {
    let claims = read_toml::<ClaimFile>(file)?.claim;
    let fault = claims
        .iter()
        .enumerate()
        .find_map(|(i, claim)| Some((i + 1, claim.lacking()?)));
    match fault {
        Some((number, field)) => Err(format!(
            "{}: claim {number} has no `{field}`, which its test needs",
            file.display()
        )),
        None => Ok(claims),
    }
}

fn read_toml<T: DeserializeOwned>(file: &Path) -> Result<T, String> {
    let text = fs::read_to_string(file).map_err(|e| format!("{}: {e}", file.display()))?;
    toml::from_str(&text).map_err(|e| format!("{}: {e}", file.display()))
}

/// Table, figure or statement that no claim covers.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Uncovered {
    pub document: String,
    pub item: String,
    pub shows: String,
    pub why: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct UncoveredFile {
    uncovered: Vec<Uncovered>,
}

/// Reads the list of items that no claim covers.
///
/// # Errors
/// Returns a message if the list cannot be read.
pub fn uncovered() -> Result<Vec<Uncovered>, String> {
    let file = root().join(FOLDER).join("uncovered.toml");
    Ok(read_toml::<UncoveredFile>(&file)?.uncovered)
}

/// Returns the single items of a list: `figures 3.2 to 3.4` is `figure 3.2`, `figure 3.3` and
/// `figure 3.4`.
pub fn single_items(list: &str) -> Vec<String> {
    let several = || {
        let numbers = list.strip_prefix("figures ")?;
        if let Some((first, last)) = numbers.split_once(" and ") {
            return Some(vec![format!("figure {first}"), format!("figure {last}")]);
        }
        let (first, last) = numbers.split_once(" to ")?;
        let [(chapter, first), (_, last)] = [first.rsplit_once('.')?, last.rsplit_once('.')?];
        let numbers = first.parse::<u32>().ok()?..=last.parse().ok()?;
        Some(numbers.map(|n| format!("figure {chapter}.{n}")).collect())
    };
    several().unwrap_or_else(|| vec![list.to_owned()])
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;

    const CLAIM: &str = "[[claim]]\ndocument = \"S0\"\nsection = \"1\"\nitem = \"table 1\"\n\
                         says = \"It is fast.\"\nfigure = \"\"\ntest = \"less\"\n\
                         value = \"at(rmse, 1)\"\na = { depth = 5 }\n";

    /// Reads a file with the claim above and some more lines.
    fn read(more: &str) -> Result<Vec<Claim>, String> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("fast.toml");
        fs::write(&file, format!("{CLAIM}{more}")).unwrap();
        read_claims(&file)
    }

    #[test]
    fn unknown_and_missing_fields_are_refused_with_the_file_and_their_name() {
        let is_refused = |more: &str, name: &str| {
            let problem = read(more).unwrap_err();
            assert!(
                problem.contains("fast.toml") && problem.contains(name),
                "{problem}"
            );
        };
        is_refused("b = 1.0\nfactr = 2.0\n", "factr");
        is_refused("b = 1.0\nvalue_b = \"at(rmse)\"\n", "at(rmse)");
        is_refused("", "`b`");
        assert_eq!(read("b = 1\n").unwrap().len(), 1);
    }

    #[test]
    fn places_and_reasons_replace_values_of_axes() {
        let claim = read("b = { depth = 6 }\nshown_by = { depth = 7 }\nshown_in = \"a\"\n");
        let claim = claim.unwrap().remove(0).at("stage", &"box".into());
        let selection = |depth: i64| {
            let values = [("depth", Value::Int(depth)), ("stage", "box".into())];
            Selection::from(values.map(|(axis, value)| (axis.to_owned(), value)))
        };
        let of = |claim: &Claim| match &claim.b {
            Some(Operand::Runs(b)) => [claim.a.clone(), b.clone()],
            _ => panic!("{:?}", claim.b),
        };
        assert_eq!(of(&claim), [5, 6].map(selection));
        assert_eq!(of(&claim.with_reason().unwrap()), [7, 6].map(selection));
    }

    #[test]
    fn lists_of_items_are_counted_one_by_one() {
        assert_eq!(
            single_items("figures 3.2 to 3.4"),
            ["figure 3.2", "figure 3.3", "figure 3.4"]
        );
        assert_eq!(
            single_items("figures 3.9 and 3.10"),
            ["figure 3.9", "figure 3.10"]
        );
        assert_eq!(single_items("claim: a and b"), ["claim: a and b"]);
    }
}
