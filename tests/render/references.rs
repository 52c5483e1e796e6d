//! Images by Mitsuba 3 of scenes that nobody here made, by the check of `lumbre verify`. Skipped where the shared folder
//! is absent.

use lumbre::cli::verify::references::{Entry, Reference, Surfaces, find};
use lumbre::cli::verify::technique;

use crate::common::shared;

/// The shared references that are bounded in depth, of these surfaces.
fn references(surfaces: Surfaces) -> Option<Vec<Reference>> {
    let root = shared()?;
    let entries = find(&root.join("references"), &root.join("scenes")).unwrap();
    let usable = entries.into_iter().filter_map(|entry| match entry {
        Entry::Usable(reference) => Some(*reference),
        Entry::LeftOut { .. } => None,
    });
    Some(usable.filter(|r| r.surfaces == surfaces && r.max_depth.is_some()).collect())
}

#[test]
fn diffuse_cornell_box_equals_mitsuba_at_every_depth() {
    let Some(references) = references(Surfaces::Diffuse) else {
        println!("SKIPPED: no shared references beside this checkout");
        return;
    };
    assert!(references.len() >= 4);
    let bpt = &technique::plain()[0];
    for reference in &references {
        let found = reference.compare(bpt, 48, 77, 0, references.len()).unwrap();
        let least = if reference.max_depth == Some(1) { 3 } else { 100 };
        assert!(found.opaque.found.comparisons > least, "{}: {}", reference.name, found.opaque.statement());
        assert!(found.agrees(), "{}: {}", reference.name, found.opaque.statement());
    }
}
