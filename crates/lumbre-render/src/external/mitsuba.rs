//! The bridge to Mitsuba 3: a server in Python that this program carries.

use std::collections::BTreeMap;
use std::time::Duration;

use super::clock::Clock;
use super::picture::PictureFormat;
use super::technique::{DEFAULT_TIMEOUT_S, SceneSource, Technique};
use lumbre_light::transport::integrator::external::{METHOD, PYTHON, VARIANT};
use lumbre_light::value::Value;
use lumbre_light::value::schema::Field;

/// Script that serves the requests, and its file name.
const BRIDGE: (&str, &str) = ("lumbre_mitsuba.py", include_str!("lumbre_mitsuba.py"));

/// Script that prints the version of the package; the variant is its argument.
const VERSION: &str =
    "import sys, mitsuba\nmitsuba.set_variant(sys.argv[1])\nprint(mitsuba.__version__)";

/// Returns the technique `external:mitsuba` with these parameters.
pub(super) fn technique(params: &BTreeMap<String, Value>) -> Technique {
    let text = |field: Field| {
        let given = params.get(field.key).and_then(Value::as_str);
        given.unwrap_or(field.default).to_owned()
    };
    let words = |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect();
    let values = [PYTHON, VARIANT, METHOD].map(|field| (field.key.to_owned(), text(field)));
    let is_scalar = text(VARIANT).starts_with("scalar");
    Technique {
        name: "mitsuba".to_owned(),
        found_version: String::new(),
        command: words(&[
            "{python}",
            "{work}/lumbre_mitsuba.py",
            "{variant}",
            "{method}",
            "{scene}",
            "{width}",
            "{height}",
            "{depth}",
            "{threads}",
        ]),
        version: Some(words(&["{python}", "-c", VERSION, "{variant}"])),
        clock: Clock::Wall,
        scene: SceneSource::Mitsuba,
        serve: true,
        picture: PictureFormat::Exr,
        timeout: Duration::from_secs_f64(10.0 * DEFAULT_TIMEOUT_S),
        filters: BTreeMap::new(),
        layers: BTreeMap::new(),
        non_finite_is_black: true,
        // Compiled variants do not state the width of their vectors.
        lanes: is_scalar.then_some(1),
        bridge: Some(BRIDGE),
        values: BTreeMap::from(values),
    }
}
