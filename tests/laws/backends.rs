//! The table of docs/reference/backends.md agrees with the code.

use lumbre::film::layer::LAYERS;
use lumbre::render::BACKENDS;
use lumbre::transport::integrator::INTEGRATORS;
use lumbre::transport::sampler::SAMPLERS;

use super::source::{root, text};

const BEGIN: &str = "<!-- written by the test `the_table_of_backends_is_what_the_code_says` -->\n";
const END: &str = "<!-- end -->";

fn table() -> String {
    let mut lines =
        vec!["| backend | integrators | samplers | materials | layers | time axis | `accel` | what it is |".to_owned()];
    lines.push("|---|---|---|---|---|---|---|---|".to_owned());
    for row in BACKENDS {
        let able = INTEGRATORS
            .iter()
            .filter(|i| (row.refuses)(i, 1).is_none())
            .map(|i| i.name);
        let samplers = SAMPLERS.iter().map(|s| s.name);
        let layers = if row.layers {
            format!("all {}", LAYERS.len())
        } else {
            "none".to_owned()
        };
        let times = if row.times { "yes" } else { "no" };
        let accel = if row.accel { "as asked" } else { "its own" };
        let list = |names: Vec<&str>| names.join(", ");
        lines.push(format!(
            "| `{}` | {} | {} | {} | {layers} | {times} | {accel} | {} |",
            row.name,
            list(able.collect()),
            list(samplers.collect()),
            list(row.models.iter().map(|m| m.name()).collect()),
            row.doc
        ));
    }
    lines.join("\n") + "\n"
}

#[test]
fn the_table_of_backends_is_what_the_code_says() {
    let page = text("docs/reference/backends.md");
    let (before, rest) = page.split_once(BEGIN).expect("the page has a table");
    let (committed, after) = rest.split_once(END).expect("the table ends");
    if committed != table() {
        std::fs::write(
            root().join("docs/reference/backends.md"),
            format!("{before}{BEGIN}{}{END}{after}", table()),
        )
        .unwrap();
        panic!(
            "docs/reference/backends.md was not up to date: it has been written again, commit it"
        );
    }
}
