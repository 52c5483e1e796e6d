//! Whether samples that are compared by time were traced one at a time or many in vectors.

use lumbre_night::experiment::night::run::Run;

/// Returns a sentence if some techniques traced one path at a time and others many. Each run has the
/// label of its technique; runs whose number of paths is unknown count for neither.
pub fn mixed_lanes<'a>(runs: impl Iterator<Item = (&'a str, &'a Run)>) -> Option<String> {
    let (mut single, mut vectors, mut is_external) = (Vec::new(), Vec::new(), false);
    for (label, run) in runs {
        let of = match run.lanes {
            Some(1) => {
                is_external |= run.peer.is_some();
                &mut single
            }
            Some(_) => &mut vectors,
            None => continue,
        };
        if !of.contains(&label) {
            of.push(label);
        }
    }
    let external = if is_external {
        " Mitsuba's `variant = \"llvm_ad_rgb\"` is vectorised as well."
    } else {
        ""
    };
    (!single.is_empty() && !vectors.is_empty()).then(|| {
        format!(
            "{} traced one path at a time, and {} many at a time in vectors, which alone makes \
             samples several times as fast. `accel = {{ lanes = \"never\" }}` in the render table \
             compares all of them one path at a time, with the same pictures.{external}",
            single.join(", "),
            vectors.join(", ")
        )
    })
}
