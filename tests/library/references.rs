//! Third-party scenes compared with renders by Mitsuba 3, by the check of `lumbre verify`. Skipped
//! if the shared folder is absent.

use lumbre::cli::verify::references::{Reference, ReferenceFile, Surfaces, find};
use lumbre::cli::verify::technique::{self, Technique};
use lumbre_light::transport::integrator::integrator;

use crate::common::shared;

/// Returns the shared references of bounded depth with these surfaces.
fn references(surfaces: Surfaces) -> Option<Vec<Reference>> {
    let root = shared()?;
    let entries = find(&root.join("references"), &root.join("scenes")).unwrap();
    let usable = entries.into_iter().filter_map(|entry| match entry {
        ReferenceFile::Usable(reference) => Some(*reference),
        ReferenceFile::Excluded { .. } => None,
    });
    Some(
        usable
            .filter(|r| r.surfaces == surfaces && r.max_depth.is_some())
            .collect(),
    )
}

#[test]
fn diffuse_cornell_box_equals_mitsuba_at_every_depth() {
    let Some(references) = references(Surfaces::Diffuse) else {
        crate::common::skipped("no shared references beside this checkout");
        return;
    };
    assert!(references.len() >= 4);
    let bpt = &technique::plain()[0];
    for reference in &references {
        let found = reference
            .compare(bpt, reference.setting(48, 77, 0), references.len())
            .unwrap();
        let least = if reference.max_depth == Some(1) {
            3
        } else {
            100
        };
        assert!(
            found.opaque.result.comparisons > least,
            "{}: {}",
            reference.name,
            found.opaque.statement()
        );
        assert!(
            found.agrees(),
            "{}: {}",
            reference.name,
            found.opaque.statement()
        );
    }
}

/// Compares the scene's own materials with Mitsuba's `principled`: walls of roughness 1 and index
/// 1.5, a mirror-like metal, and a ball of glass of index 2.5.
///
/// The formulas of the opaque lobes are the same. The lobe of the metal, of the least alpha in
/// Mitsuba and a Dirac here, is narrower than a pixel. These parts pass a z-test, including the
/// caustics of the ball. The ball itself differs: in Mitsuba it is a rough interface of alpha
/// 0.001, evaluated in single precision, here a Dirac. Its mean may therefore differ by one per
/// cent, which is about the noise of these samples. With 480 samples it was 1.0015 +- 0.0031 of the
/// reference, and all the rest 1.0001 +- 0.0004. Paths find light through the ball by chance: with
/// a quarter of the samples, bright samples are too rare for sums to be normal.
#[test]
fn disney_cornell_box_with_spheres_equals_the_principled_bsdf_of_mitsuba() {
    let Some(references) = references(Surfaces::Principled) else {
        return;
    };
    assert!(!references.is_empty());
    let nee = Technique::plain(integrator("nee").unwrap());
    for reference in &references {
        let found = reference
            .compare(&nee, reference.setting(128, 78, 0), references.len())
            .unwrap();
        assert!(
            found.opaque.result.comparisons > 200,
            "{}: {}",
            reference.name,
            found.opaque.statement()
        );
        assert!(
            found
                .glass
                .as_ref()
                .is_some_and(|glass| glass.error < 0.015),
            "{}: too noisy for this test",
            reference.name
        );
        assert!(
            found.agrees(),
            "{}: {}",
            reference.name,
            found.outcome().statement
        );
    }
}
