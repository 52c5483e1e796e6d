//! Sample output of the README: what its first command prints.

use super::workplace::Workplace;

/// Line of the README before the block that is compared.
const MARKER: &str = "tests/program/cli/readme.rs -->\n```\n";

#[test]
fn the_table_in_the_readme_is_what_its_command_prints() {
    let root = env!("CARGO_MANIFEST_DIR");
    let readme = std::fs::read_to_string(format!("{root}/README.md")).unwrap();
    let (_, rest) = readme.split_once(MARKER).expect("the README has the block");
    let (table, _) = rest.split_once("```\n").unwrap();
    assert!(table.lines().count() >= 4, "{table}");

    let place = Workplace::new();
    let output = place
        .command(&["run", "scripts/first_light.lua", "--backend", "cpu"])
        .current_dir(root)
        .arg("--out")
        .arg(place.path("out"))
        .output()
        .unwrap();
    let printed = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{printed}");
    assert!(
        printed.contains(table),
        "README.md shows\n{table}\nbut the command prints\n{printed}"
    );
}
