//! Sample output of the README: the table that its first command prints.

use super::workplace::Workplace;

/// Line of the README before the block that is compared.
const MARKER: &str = "tests/program/cli/readme.rs -->\n```\n";

/// Returns the first column of a Markdown table, and whether each other cell is a number with an
/// interval.
fn rows(table: &str) -> Vec<(String, bool)> {
    let row = |line: &str| {
        let mut cells = line.trim_matches('|').split('|').map(str::trim);
        let name = cells.next().unwrap().to_owned();
        let is_number = |text: &str| text.parse::<f64>().is_ok();
        let measured = cells.all(|cell| cell.split(" ± ").all(is_number));
        (name, measured)
    };
    let lines = table.lines().skip_while(|line| !line.starts_with('|'));
    lines
        .take_while(|line| line.starts_with('|'))
        .filter(|line| !line.starts_with("|-"))
        .map(row)
        .collect()
}

#[test]
fn the_first_command_prints_a_table_like_that_of_the_readme() {
    let root = env!("CARGO_MANIFEST_DIR");
    let readme = std::fs::read_to_string(format!("{root}/README.md")).unwrap();
    let (_, rest) = readme.split_once(MARKER).expect("the README has the block");
    let (table, _) = rest.split_once("```\n").unwrap();
    let shown = rows(table);
    assert_eq!(shown.len(), 4, "{table}");
    assert!(shown[1..].iter().all(|(_, measured)| *measured), "{table}");

    let place = Workplace::new();
    let output = place
        .command(&["run", "scripts/first_light.lua", "seconds=0.1"])
        .args(["--backend", "cpu"])
        .current_dir(root)
        .arg("--out")
        .arg(place.path("out"))
        .output()
        .unwrap();
    let printed = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{printed}");
    assert_eq!(rows(&printed), shown, "{printed}");
    let figure = place.path("out/latest/figures/convergence.svg");
    assert!(figure.is_file(), "{printed}");
}
