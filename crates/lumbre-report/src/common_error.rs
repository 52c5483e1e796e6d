//! Caveat on techniques whose runs have most of their error in common.

use std::collections::BTreeMap;
use std::path::Path;

use lumbre_light::film::Image;
use lumbre_light::transport::integrator::bias_of;
use lumbre_metrics::common_error::CommonError;
use lumbre_night::experiment::night::Night;
use lumbre_night::experiment::night::run::Run;

/// Whether the last pictures of some runs of one technique have more error in common than the noise
/// by which they differ. Runs without a picture or a reference, and those of known bias, are left
/// out. `read` returns a picture.
pub fn exceeds_noise<'a>(
    night: &Night,
    runs: impl Iterator<Item = &'a Run>,
    read: impl Fn(&Path) -> Option<Image>,
) -> bool {
    let mut by_reference: BTreeMap<&Path, Vec<&Path>> = BTreeMap::new();
    for run in runs.filter(|run| bias_of(&run.integrator).is_none() && run.denoise.is_none()) {
        let reference = run.reference.and_then(|r| night.references.get(r));
        let reference = reference.and_then(|reference| reference.picture.as_deref());
        if let Some((reference, (_, last))) = reference.zip(run.pictures.last()) {
            by_reference.entry(reference).or_default().push(last);
        }
    }
    by_reference.into_iter().any(|(reference, pictures)| {
        let Some(reference) = read(reference).filter(|_| pictures.len() > 1) else {
            return false;
        };
        let mut common = CommonError::new(&reference);
        for picture in pictures {
            read(picture).iter().for_each(|picture| common.add(picture));
        }
        common.exceeds_noise()
    })
}

/// Returns the caveat for techniques that lead, by their labels.
pub fn caveat(labels: &[String]) -> Option<String> {
    (!labels.is_empty()).then(|| {
        format!(
            "The runs of {} have more error in common than the noise by which they differ: the \
             technique is biased, or none of its runs has found some of the light, and a run that \
             does can have a much larger error.",
            labels.join(", ")
        )
    })
}
