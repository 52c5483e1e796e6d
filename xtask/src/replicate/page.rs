//! The page `docs/replication.md`.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::Path;

use lumbre::cli::format::duration;
use lumbre_night::experiment::night::Night;

use super::Judged;
use super::claims::{FOLDER, Test, Uncovered, single_items, uncovered};
use super::significance::{Judgement, LEVEL, Verdict};
use crate::command;
use crate::root;

/// The page, from the root of the repository.
pub const PAGE: &str = "docs/replication.md";

/// Time and disk of the full form: sums of the times in the scripts' headers, and of the sizes of
/// quick nights in proportion to pixels and bins.
const FULL_FORM: &str = "about 8 hours on two cores, and 17 GB";

/// Documents with their authors.
const DOCUMENTS: [(&str, &str); 3] = [
    ("S0", "Bartaburu Chaine and Ubal Santana"),
    ("S1", "de la Calle Montilla"),
    ("S2", "Jiménez Omeñaca"),
];

/// Writes the page.
///
/// # Errors
/// Returns a message if a file cannot be read or written.
pub fn write(judged: &[Judged], nights: &[Night], out: &Path, quick: bool) -> Result<(), String> {
    let uncovered = uncovered()?;
    let mut page = head(nights, out, quick);
    page += &counts(judged, &uncovered);
    for (document, authors) in DOCUMENTS {
        let _ = write!(page, "\n## {document} ({authors})\n");
        let mut sections: BTreeMap<Vec<u32>, Vec<&Judged>> = BTreeMap::new();
        for judged in judged
            .iter()
            .filter(|judged| judged.claim.document == document)
        {
            sections
                .entry(numbers(&judged.claim.section))
                .or_default()
                .push(judged);
        }
        sections
            .values()
            .for_each(|claims| page += &section(claims));
        page += "\n### Without a claim\n\n| item | shows | why |\n|---|---|---|\n";
        for item in uncovered.iter().filter(|item| item.document == document) {
            let _ = writeln!(
                page,
                "| {} | {} | {} |",
                statement(&item.item),
                item.shows,
                item.why
            );
        }
    }
    command::write(&root().join(PAGE), page.as_bytes())
}

/// Returns the numbers of a section, for its order.
fn numbers(section: &str) -> Vec<u32> {
    section
        .split('.')
        .map(|number| number.parse().unwrap_or(u32::MAX))
        .collect()
}

/// Returns the name of an item without the word that marks statements.
fn statement(item: &str) -> &str {
    item.strip_prefix("claim: ").unwrap_or(item)
}

/// Returns the beginning of the page: how it was made.
fn head(nights: &[Night], out: &Path, quick: bool) -> String {
    let machines: BTreeSet<String> = nights
        .iter()
        .filter_map(|night| night.machine.as_ref())
        .map(|m| format!("{}, {} cores, {}; {}", m.cpu, m.cores, m.os, m.program))
        .collect();
    let runs = nights.iter().flat_map(|night| &night.runs);
    let rows = runs.filter_map(|run| run.rows.last());
    let seconds: f64 = rows.map(|row| row.render_s).sum();
    let folders = nights.iter().map(|night| night.folder.as_path());
    let folders = folders.filter(|folder| !folder.as_os_str().is_empty());
    let size: u64 = folders.chain([out.join("refs").as_path()]).map(bytes).sum();
    let unfinished = nights.iter().filter_map(|night| {
        let (ended, all) = (night.ended(), night.all().count());
        (ended < all).then(|| format!("{} ({ended} of {all} runs)", night.plan.name))
    });
    let unfinished: Vec<String> = unfinished.collect();
    let unfinished = match &unfinished[..] {
        [] => "none".to_owned(),
        some => some.join(", "),
    };
    let (form, option) = match quick {
        true => (
            "quick (small pictures and short times, to be read as a trend)",
            " --quick",
        ),
        false => ("full", ""),
    };
    let machines = machines.into_iter().collect::<Vec<_>>().join("; ");
    let dates = nights.iter().filter_map(|night| night.machine.as_ref());
    let date = dates
        .filter_map(|m| m.date.get(..10))
        .max()
        .unwrap_or("none");
    format!(
        "# Replication of the theses\n\n\
         `cargo xtask replicate` runs a script for each table and figure of the\n\
         [three theses](bibliography.md), tests their claims, and writes this page.\n\
         [{FOLDER}](../{FOLDER}/README.md) has the scripts, the claims, and the\n\
         definitions of values and tests.\n\n\
         - Form: {form}.\n\
         - Command: `cargo xtask replicate{option}`.\n\
         - Machine: {machines}.\n\
         - Nights that are not finished: {unfinished}.\n\
         - Newest run: {date}. Render time of the runs: {}, without references. Disk: {:.1} GB.\n\
         - The full form, `cargo xtask replicate`, takes {FULL_FORM}.\n",
        duration(seconds),
        size as f64 / 1e9,
    )
}

/// Returns the bytes of all files below a folder.
fn bytes(folder: &Path) -> u64 {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let size = |entry: std::fs::DirEntry| match entry.file_type() {
        Ok(kind) if kind.is_dir() => bytes(&entry.path()),
        Ok(kind) if kind.is_file() => entry.metadata().map_or(0, |file| file.len()),
        _ => 0,
    };
    entries.map(size).sum()
}

/// Coverage of an item.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Coverage {
    None,
    Claimed,
    Judged,
}

/// Returns the counts of items and verdicts.
fn counts(judged: &[Judged], uncovered: &[Uncovered]) -> String {
    let mut items: BTreeMap<(&str, String), Coverage> = BTreeMap::new();
    for item in uncovered {
        items.insert((&item.document, item.item.clone()), Coverage::None);
    }
    for judged in judged {
        let coverage = match (judged.claim.test, judged.judgement.verdict) {
            (Test::None, _) => Coverage::None,
            (_, Verdict::Unjudged) => Coverage::Claimed,
            _ => Coverage::Judged,
        };
        for item in single_items(&judged.claim.item) {
            let known = items
                .entry((&judged.claim.document, item))
                .or_insert(coverage);
            *known = coverage.max(*known);
        }
    }
    let mut text =
        "\n| items | in the theses | with a claim | judged here |\n|---|--:|--:|--:|\n".to_owned();
    let kind = |item: &str| match item {
        _ if item.starts_with("table") => "tables",
        _ if item.starts_with("claim: ") => "statements",
        _ => "figures",
    };
    for name in ["tables", "figures", "statements", "all"] {
        let of_kind = items
            .iter()
            .filter(|((_, item), _)| name == "all" || kind(item) == name);
        let coverages: Vec<Coverage> = of_kind.map(|(_, coverage)| *coverage).collect();
        let count = |least| {
            coverages
                .iter()
                .filter(|coverage| **coverage >= least)
                .count()
        };
        let [all, claimed, done] = [Coverage::None, Coverage::Claimed, Coverage::Judged].map(count);
        let _ = writeln!(text, "| {name} | {all} | {claimed} | {done} |");
    }
    text += "\n| verdict | claims | meaning |\n|---|--:|---|\n";
    let (drawn, tested): (Vec<&Judged>, Vec<&Judged>) =
        judged.iter().partition(|judged| judged.is_drawn());
    let mut add = |name: &str, meaning: &str, is_counted: &dyn Fn(&Judged) -> bool| {
        let count = tested.iter().filter(|judged| is_counted(judged)).count();
        let _ = writeln!(text, "| {name} | {count} | {meaning} |");
    };
    for (verdict, meaning) in [
        (Verdict::Holds, "significant"),
        (Verdict::Weaker, "significant, but by less than stated"),
        (Verdict::TurnsAround, "the opposite is significant"),
    ] {
        add(verdict.name(), meaning, &|j| j.judgement.verdict == verdict);
    }
    let is_open = |j: &Judged| j.judgement.verdict == Verdict::Unjudged;
    let name = Verdict::Unjudged.name();
    let is_tested = |j: &Judged| j.judgement.p.is_some();
    let is_measured = |j: &Judged| j.claim.test != Test::None;
    add(name, "not significant", &|j| is_open(j) && is_tested(j));
    add(name, "too few runs, or only bounds", &|j| {
        is_open(j) && is_measured(j) && !is_tested(j)
    });
    add(name, "nothing is measured", &|j| !is_measured(j));
    let all = judged
        .iter()
        .flat_map(|j| [Some(&j.judgement), j.reason.as_ref()]);
    let tests = all
        .flatten()
        .filter(|judgement| judgement.p.is_some())
        .count();
    let _ = write!(
        text,
        "\nIn addition, {} pictures were drawn. A claim about several scenes counts once for each.\n\
         {tests} tests were made at level {LEVEL}: about {:.1} false answers are expected by chance.\n",
        drawn.len(),
        tests as f64 * LEVEL
    );
    text
}

/// Returns a section of a document with its claims.
fn section(claims: &[&Judged]) -> String {
    let Some(first) = claims.first() else {
        return String::new();
    };
    let mut text = format!("\n### Section {}\n\n", first.claim.section);
    let names: BTreeSet<&str> = claims
        .iter()
        .map(|judged| judged.script.name.as_str())
        .collect();
    let links = names
        .iter()
        .map(|name| format!("[{name}](../{FOLDER}/{name}.lua)"));
    let _ = writeln!(text, "{}.", links.collect::<Vec<_>>().join(", "));
    let (drawn, tested): (Vec<&Judged>, Vec<&Judged>) =
        claims.iter().copied().partition(|judged| judged.is_drawn());
    if !drawn.is_empty() {
        text += "\n";
    }
    for judged in drawn {
        let Judged {
            claim, judgement, ..
        } = judged;
        let _ = writeln!(
            text,
            "- Picture of {}: {} {}",
            claim.item, claim.says, judgement.shown
        );
    }
    if !tested.is_empty() {
        text += "\n| item | claim | document | here | p | verdict |\n|---|---|---|---|---|---|\n";
    }
    for judged in &tested {
        let Judged {
            claim, judgement, ..
        } = judged;
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} |",
            statement(&claim.item),
            judged.sentence(),
            claim.figure,
            judgement.shown,
            judgement.p.map(p_value).unwrap_or_default(),
            judgement.verdict.name(),
        );
    }
    let reasons: Vec<String> = tested.iter().filter_map(|judged| reason(judged)).collect();
    if !reasons.is_empty() {
        text += "\n";
    }
    text + &reasons.concat()
}

/// Formats a p-value.
fn p_value(p: f64) -> String {
    match p {
        0.0..1e-4 => "< 0.0001".to_owned(),
        _ => format!("{p:.4}"),
    }
}

/// Returns why a claim does not hold, and whether its runs show the reason, as a line of a list.
fn reason(judged: &Judged) -> Option<String> {
    let Judged {
        claim, judgement, ..
    } = judged;
    let is_open = judgement.verdict == Verdict::Unjudged;
    // Without a test there is nothing to explain.
    let is_explained = claim.test == Test::None || judgement.p.is_some() || !is_open;
    let why = claim
        .why
        .as_ref()
        .filter(|_| is_explained && judgement.verdict != Verdict::Holds)?;
    let mut line = format!("- *{}* {why}", judged.sentence());
    if let (Some(Judgement { verdict, shown, p }), Some(arm)) = (&judged.reason, &claim.shown_by) {
        let arm = arm.iter().map(|(axis, value)| format!("{axis} = {value}"));
        let finding = match verdict {
            Verdict::Holds => "the claim holds, which supports the reason",
            Verdict::Weaker | Verdict::TurnsAround => "the claim does not hold either",
            Verdict::Unjudged => "not significant, so the reason stays open",
        };
        let p = p.map(|p| format!(", p {}", p_value(p))).unwrap_or_default();
        let arm = arm.collect::<Vec<_>>().join(", ");
        let _ = write!(line, " With `{arm}`: {shown}{p}; {finding}.");
    }
    Some(line + "\n")
}
