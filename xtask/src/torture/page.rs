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
    let path = root().join(PAGE);
    let text = std::fs::read_to_string(&path).map_err(|e| format!("{PAGE}: {e}"))?;
    let [begin, end] = markers;
    let parts = text
        .split_once(begin)
        .and_then(|(head, rest)| Some((head, rest.split_once(end)?.1)));
    let (head, tail) = parts.ok_or_else(|| format!("{PAGE} has no `{begin}`"))?;
    let date = output("date", &["-u", "+%Y-%m-%d"]);
    let commit = output("git", &["rev-parse", "--short", "HEAD"]);
    let caption = format!("`cargo xtask {chore}`, {date}, commit {commit}:");
    let text = format!("{head}{begin}\n{caption}\n\n{table}{end}{tail}");
    std::fs::write(&path, text).map_err(|e| format!("{PAGE}: {e}"))
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
