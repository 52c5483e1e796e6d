//! Tables of chores on the page about hostile files.

use std::process::Command;

use crate::root;

/// The page.
const PAGE: &str = "docs/inside/hostile-files.md";

/// Writes a table between two lines of the page, with the chore's command line, date and commit.
///
/// # Errors
/// Returns a message if the page lacks the lines, or cannot be written.
pub fn write(markers: [&str; 2], chore: &str, table: &str) -> Result<(), String> {
    let [date, commit] = state();
    let caption = format!("`cargo xtask {chore}`, {date}, commit {commit}:");
    replace(markers, &format!("{caption}\n\n{table}"))
}

/// Puts rows into the table between two lines of the page: each replaces the row with the same first
/// cell, others stay. Date and commit become the last cell.
///
/// # Errors
/// Returns a message if the page lacks the lines, or cannot be written.
pub fn put_rows(markers: [&str; 2], head: &str, rows: &[String]) -> Result<(), String> {
    let [_, before, _] = parts(markers)?;
    // The line of the first marker and the head are not rows.
    let before = before.lines().skip(3).map(str::to_owned).collect();
    let [date, commit] = state();
    let rows = rows.iter().map(|row| format!("{row} {date}, {commit} |"));
    let all = merged(before, rows);
    replace(markers, &format!("{head}{}\n", all.join("\n")))
}

/// Puts each row in place of the one with the same first cell, or at the end.
fn merged(mut all: Vec<String>, rows: impl Iterator<Item = String>) -> Vec<String> {
    for row in rows {
        let old = all
            .iter_mut()
            .find(|old| first_cell(old) == first_cell(&row));
        match old {
            Some(old) => *old = row,
            None => all.push(row),
        }
    }
    all
}

/// Returns the first cell of a row.
fn first_cell(row: &str) -> Option<&str> {
    row.split('|').nth(1)
}

/// Replaces the text between two lines of the page.
fn replace(markers: [&str; 2], text: &str) -> Result<(), String> {
    let [head, _, tail] = parts(markers)?;
    let [begin, end] = markers;
    let page = format!("{head}{begin}\n{text}{end}{tail}");
    std::fs::write(root().join(PAGE), page).map_err(|e| format!("{PAGE}: {e}"))
}

/// Returns today's date and the commit that is checked out.
fn state() -> [String; 2] {
    [
        output("date", &["-u", "+%Y-%m-%d"]),
        output("git", &["rev-parse", "--short", "HEAD"]),
    ]
}

/// Returns the page before, between and after two lines.
fn parts([begin, end]: [&str; 2]) -> Result<[String; 3], String> {
    let text = std::fs::read_to_string(root().join(PAGE)).map_err(|e| format!("{PAGE}: {e}"))?;
    let parts = text.split_once(begin).and_then(|(head, rest)| {
        let (text, tail) = rest.split_once(end)?;
        Some([head, text, tail].map(str::to_owned))
    });
    parts.ok_or_else(|| format!("{PAGE} has no `{begin}`"))
}

/// Returns the output of a command; empty if it cannot be started.
fn output(command: &str, arguments: &[&str]) -> String {
    let output = Command::new(command)
        .args(arguments)
        .current_dir(root())
        .output();
    let bytes = output.map(|o| o.stdout).unwrap_or_default();
    String::from_utf8_lossy(&bytes).trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_replaces_the_one_of_the_same_name() {
        let old = ["| a | 1 |", "| b | 2 |"].map(str::to_owned).to_vec();
        let new = ["| b | 3 |", "| c | 4 |"].map(str::to_owned);
        let expected = ["| a | 1 |", "| b | 3 |", "| c | 4 |"];
        assert_eq!(merged(old, new.into_iter()), expected);
    }
}
