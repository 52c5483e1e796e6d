//! Rules for the rows of all tables: names, docs, schemas and keys.

use std::collections::BTreeSet;

use lumbre_light::scene::desc::MATERIAL_PARAMS;
use lumbre_light::transport::integrator::INTEGRATORS;
use lumbre_light::transport::sampler::{SAMPLERS, sampler};
use lumbre_light::value::schema::{Field, Table, Ty};
use lumbre_metrics::METRICS;
use lumbre_metrics::tonemap::TONEMAPS;
use lumbre_night::backends::BACKENDS;
use lumbre_scene_io::load::FORMATS;

fn snake_case(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_lowercase())
        && name
            .chars()
            .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
}

fn check_rows<'a>(table: &str, rows: impl IntoIterator<Item = (&'a str, &'a str)>) {
    let mut seen = BTreeSet::new();
    for (name, doc) in rows {
        // The name of a backend starts with its family: `vulkan-query`.
        assert!(
            snake_case(&name.replacen('-', "_", 1)),
            "{table}: `{name}` is not snake_case"
        );
        assert!(
            seen.insert(name.to_owned()),
            "{table}: `{name}` is listed twice"
        );
        check_doc(&format!("{table}.{name}"), doc);
    }
    assert!(!seen.is_empty(), "{table} is empty");
}

fn check_doc(place: &str, doc: &str) {
    assert!(
        doc.split_whitespace().count() >= 2,
        "{place}: `{doc}` has fewer than two words"
    );
    assert!(
        doc.trim() == doc && doc.ends_with(['.', ')', ']']),
        "{place}: `{doc}` is not a sentence"
    );
}

fn check_schema(place: &str, table: &Table) {
    assert!(!table.name.is_empty(), "{place}: the schema has no name");
    check_doc(&format!("{place}: schema {}", table.name), table.doc);
    let mut seen = BTreeSet::new();
    for Field { key, ty, doc, .. } in table.fields {
        let place = format!("{place}.{key}");
        assert!(snake_case(key), "{place} is not snake_case");
        assert!(seen.insert(key), "{place} is listed twice");
        assert!(!doc.trim().is_empty(), "{place} has no doc");
        if let Ty::Table(inner) = ty {
            check_schema(&place, inner);
        }
    }
}

#[test]
fn integrators_have_names_long_names_and_docs() {
    check_rows("INTEGRATORS", INTEGRATORS.iter().map(|r| (r.name, r.doc)));
    for row in INTEGRATORS {
        assert!(
            row.long_name.contains(' '),
            "{}: the long name `{}` is a single word",
            row.name,
            row.long_name
        );
        assert!(row.revision >= 1);
        assert_eq!(
            row.bias.is_some(),
            row.long_name.ends_with("biased"),
            "{}: tables and plots must show whether it is biased: `{}`",
            row.name,
            row.long_name
        );
        check_schema(row.name, &row.params);
    }
}

#[test]
fn samplers_have_names_and_docs_and_return_numbers_below_one() {
    check_rows("SAMPLERS", SAMPLERS.iter().map(|r| (r.name, r.doc)));
    for row in SAMPLERS {
        assert!(row.revision >= 1);
        assert!(sampler(row.name).is_some_and(|found| found.name == row.name));
        assert!((0.0..1.0).contains(&row.start(1, [2, 3], 4).next_1d()));
    }
}

#[test]
fn backends_have_names_and_docs_and_their_probes_return_text() {
    check_rows("BACKENDS", BACKENDS.iter().map(|r| (r.name, r.doc)));
    for row in BACKENDS {
        let (Ok(answer) | Err(answer)) = (row.probe)();
        assert!(
            !answer.trim().is_empty(),
            "{}: the probe returned no text",
            row.name
        );
    }
    assert!(
        BACKENDS.iter().all(|r| r.name != "auto"),
        "`auto` selects a backend and must not be one"
    );
}

#[test]
fn metrics_have_names_long_names_and_docs() {
    check_rows("METRICS", METRICS.iter().map(|r| (r.name, r.doc)));
    for row in METRICS {
        assert!(!row.long_name.is_empty(), "{}", row.name);
        check_schema(row.name, &row.options);
    }
}

#[test]
fn material_parameters_have_docs_and_distinct_scn_keys() {
    check_rows(
        "MATERIAL_PARAMS",
        MATERIAL_PARAMS.iter().map(|r| (r.name, r.doc)),
    );
    let keys: BTreeSet<_> = MATERIAL_PARAMS
        .iter()
        .map(|r| r.scn_key.to_lowercase())
        .collect();
    assert_eq!(
        keys.len(),
        MATERIAL_PARAMS.len(),
        "two parameters share a .scn key"
    );
}

#[test]
fn no_two_scene_formats_share_an_extension() {
    check_rows("FORMATS", FORMATS.iter().map(|r| (r.name, r.doc)));
    let mut seen = BTreeSet::new();
    for extension in FORMATS.iter().flat_map(|r| r.extensions) {
        assert!(
            extension
                .chars()
                .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit()),
            "`{extension}`"
        );
        assert!(seen.insert(extension), "two formats claim `.{extension}`");
    }
}

#[test]
fn tone_maps_have_names_docs_and_valid_schemas() {
    check_rows(
        "TONEMAPS",
        TONEMAPS.iter().map(|(name, table)| (*name, table.doc)),
    );
    TONEMAPS
        .iter()
        .for_each(|(name, table)| check_schema(name, table));
}
