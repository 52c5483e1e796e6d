//! Tables of the rates of several machines: absolute, and relative to the first one, as tables 5.2
//! and 5.3 of thesis S0.

use std::collections::BTreeMap;

use super::provenance::Provenance;
use super::table::{Digits, Interval, Table, TableCell, TableKind};
use lumbre_light::math::t_test::mean_and_interval;

/// Rates of one backend of one machine.
#[derive(Clone, Debug, PartialEq)]
pub struct RateGroup {
    /// Heading of its columns.
    pub label: String,
    /// Samples of every pixel per second of each repeat, by scene and technique.
    pub rates: BTreeMap<(String, String), Vec<f64>>,
}

impl RateGroup {
    fn repeats(&self, scene: &str, technique: &str) -> &[f64] {
        let key = (scene.to_owned(), technique.to_owned());
        self.rates.get(&key).map_or(&[], Vec::as_slice)
    }

    /// Returns those of some techniques of which any scene has a rate.
    fn techniques<'a>(&self, all: &'a [String]) -> Vec<&'a String> {
        let has = |technique: &&String| self.rates.keys().any(|(_, own)| own == *technique);
        all.iter().filter(has).collect()
    }
}

/// A table in all formats.
#[derive(Clone, Debug, PartialEq)]
pub struct RateTable {
    /// Name of its files without extension.
    pub name: String,
    /// The table as Markdown with its caption.
    pub markdown: String,
    /// The table as CSV in full precision, a line for each cell.
    pub csv: String,
    /// The table as LaTeX with booktabs rules.
    pub latex: String,
}

/// Returns the table of rates and, for several groups, that of the rates relative to the first one,
/// with these scenes as rows and techniques as columns.
pub fn tables(groups: &[RateGroup], scenes: &[String], techniques: &[String]) -> Vec<RateTable> {
    let mut tables = vec![absolute(groups, scenes, techniques)];
    if let [base, others @ ..] = groups
        && !others.is_empty()
    {
        tables.push(relative(base, others, scenes, techniques));
    }
    let written = |table: Table| RateTable {
        markdown: table.to_markdown(),
        csv: table.to_long_csv(),
        latex: table.to_latex(),
        name: table.name,
    };
    tables.into_iter().map(written).collect()
}

fn absolute(groups: &[RateGroup], scenes: &[String], techniques: &[String]) -> Table {
    let shown: Vec<(&RateGroup, Vec<&String>)> = groups
        .iter()
        .map(|group| (group, group.techniques(techniques)))
        .collect();
    let cell = |scene: &String, group: &RateGroup, technique: &String| {
        let repeats = group.repeats(scene, technique);
        if repeats.is_empty() {
            return TableCell::default();
        }
        let (mean, half) = mean_and_interval(repeats);
        TableCell {
            value: Some(mean),
            interval: half.map(Interval::Half),
            runs: repeats.len(),
            ..TableCell::default()
        }
    };
    let caption = "Samples of every pixel per second (FPS). Mean of repeats with its 95 % \
                   confidence interval.";
    table(
        "benchmark-fps",
        ("Sampling rate", caption),
        ("1/s", Digits::Significant(4)),
        &shown,
        scenes,
        &cell,
    )
}

fn relative(
    base: &RateGroup,
    others: &[RateGroup],
    scenes: &[String],
    techniques: &[String],
) -> Table {
    let shared = |group: &RateGroup| {
        let own = base.techniques(techniques);
        let both = group.techniques(techniques).into_iter();
        both.filter(|technique| own.contains(technique)).collect()
    };
    let shown: Vec<(&RateGroup, Vec<&String>)> =
        others.iter().map(|group| (group, shared(group))).collect();
    let cell = |scene: &String, group: &RateGroup, technique: &String| {
        let [a, b] = [group, base].map(|group| group.repeats(scene, technique));
        if a.is_empty() || b.is_empty() {
            return TableCell::default();
        }
        TableCell {
            value: Some(mean_and_interval(a).0 / mean_and_interval(b).0),
            runs: a.len().min(b.len()),
            ..TableCell::default()
        }
    };
    let caption = format!(
        "Sampling rate relative to that of {} with the same technique.",
        base.label
    );
    table(
        "benchmark-relative",
        ("Relative sampling rate", &caption),
        ("1", Digits::Percent),
        &shown,
        scenes,
        &cell,
    )
}

/// Builds a table of groups with their techniques.
fn table(
    name: &str,
    (title, caption): (&str, &str),
    (unit, digits): (&str, Digits),
    shown: &[(&RateGroup, Vec<&String>)],
    scenes: &[String],
    cell: &dyn Fn(&String, &RateGroup, &String) -> TableCell,
) -> Table {
    let row = |scene: &String| {
        let cells = shown.iter().flat_map(|(group, techniques)| {
            techniques
                .iter()
                .map(|technique| cell(scene, group, technique))
        });
        (vec![scene.clone()], cells.collect())
    };
    let columns = shown.iter().flat_map(|(_, techniques)| techniques);
    Table {
        name: name.to_owned(),
        kind: TableKind::Other,
        section: String::new(),
        title: title.to_owned(),
        caption: caption.to_owned(),
        unit: unit.to_owned(),
        label_headers: vec!["scene".to_owned()],
        groups: shown
            .iter()
            .map(|(group, techniques)| (group.label.clone(), techniques.len()))
            .collect(),
        columns: columns.map(|technique| (*technique).clone()).collect(),
        rows: scenes.iter().map(row).collect(),
        digits,
        provenance: Provenance::default(),
    }
}
