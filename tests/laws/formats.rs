//! The tables of docs/reference/formats.md agree with the loaders, and name nothing that no loader
//! supports.

use lumbre::scene::desc::MATERIAL_PARAMS;
use lumbre::scene::load::{FORMATS, FormatRow};

use super::source::{root, rust_files, text};

fn begin(format: &str) -> String {
    format!(
        "<!-- the parts of {format}, written by the test `the_tables_of_formats_are_what_the_loaders_say` -->\n"
    )
}

const END: &str = "<!-- end -->";

fn table(row: &FormatRow) -> String {
    let mut lines = vec![
        "| element | support | limits |".to_owned(),
        "|---|---|---|".to_owned(),
    ];
    lines.extend(
        row.supported
            .iter()
            .map(|part| format!("| {} | {} | {} |", part.name, part.support, part.limits)),
    );
    // A `.scn` has the parameters of materials by the keys of their own table.
    for param in MATERIAL_PARAMS.iter().filter(|_| row.name == "scn") {
        let keys = [param.scn_key, param.scn_texture_key];
        let keys: Vec<String> = keys
            .iter()
            .filter(|k| !k.is_empty())
            .map(|k| format!("`{k}`"))
            .collect();
        lines.push(format!(
            "| {} | `{}` of the material, and its texture | values out of range |",
            keys.join(", "),
            param.name
        ));
        if param.scn_texture_key.is_empty() {
            let last = lines.len() - 1;
            lines[last] = lines[last].replace(", and its texture", "");
        }
    }
    lines.join("\n").replace("|  |", "| |") + "\n"
}

#[test]
fn the_tables_of_formats_are_what_the_loaders_say() {
    let page = text("docs/reference/formats.md");
    let mut wanted = page.clone();
    for row in FORMATS {
        let begin = begin(row.name);
        let (before, rest) = wanted
            .split_once(&begin)
            .unwrap_or_else(|| panic!("{} has no table", row.name));
        let (_, after) = rest.split_once(END).expect("the table ends");
        wanted = format!("{before}{begin}{}{END}{after}", table(row));
    }
    if wanted != page {
        std::fs::write(root().join("docs/reference/formats.md"), wanted).unwrap();
        panic!(
            "docs/reference/formats.md was not up to date: it has been written again, commit it"
        );
    }
}

#[test]
fn no_table_of_a_format_names_what_its_loader_does_not_know() {
    for row in FORMATS {
        let folder = format!("src/scene/load/{}", row.name);
        let alone = format!("{folder}.rs");
        let files = rust_files(&folder)
            .into_iter()
            .filter(|f| !f.ends_with("/supported.rs") && !f.ends_with("/tests.rs"));
        let alone = root().join(&alone).is_file().then_some(alone);
        let source: String = files
            .chain(alone)
            .map(|file| text(&file).to_lowercase())
            .collect();
        assert!(row.supported.len() >= 5, "{}", row.name);
        let mut seen = 0;
        for part in row.supported {
            assert!(
                !part.support.is_empty() || !part.limits.is_empty(),
                "{}: {} has neither support nor limits",
                row.name,
                part.name
            );
            for word in part.name.split('`').skip(1).step_by(2) {
                let literal = format!("\"{}\"", word.to_lowercase());
                assert!(
                    source.contains(&literal),
                    "{}: `{word}` stands in its table and not in its loader",
                    row.name
                );
                seen += 1;
            }
        }
        assert!(seen >= 10, "{}: {seen}", row.name);
    }
}
