//! Names, colours and the tone map that a script sets, and names of nights.

use super::*;
use lumbre_metrics::tonemap::Tonemap;
use lumbre_night::experiment::spec::Presentation;

#[test]
fn the_script_names_and_colours_series_and_sets_the_tone_map() {
    let mut own = night("Sample GPU", 1.0);
    let map = |value: &str| [("nee".to_owned(), value.to_owned())].into();
    Arc::make_mut(&mut own.plan).report = Presentation {
        display: Some(Tonemap::Gamma {
            gamma: 2.2,
            exposure: 1.5,
        }),
        names: map("two ends"),
        colours: map("#123456"),
    };
    let made = report(&[own], &ReportOptions::default());
    let svg = text(&made, "figures/error-time-rmse", "svg");
    assert!(svg.contains(">two ends</text>") && svg.contains("#123456"));
    assert!(!svg.contains(">nee</text>"));
    let tex = text(&made, "figures/error-time-rmse", "tex");
    assert!(tex.contains("{HTML}{123456}") && tex.contains("{two ends}"));
    assert!(text(&made, "tables/equal-time-rmse", "md").contains("two ends"));
    let crops = item(&made, "figures/crops-equal-time-box");
    assert!(crops.svg.as_ref().unwrap().contains(">gamma ("));
    let methods = text(&made, "methods", "md");
    assert!(methods.contains("shown by the tone map gamma"), "{methods}");
    assert!(methods.contains("Paths have at most 5 edges."), "{methods}");
    let page = text(&made, "index", "html");
    let series = &page_data(&page)["series"];
    assert!(series.to_string().contains("#123456"), "{series}");
    // Without it, each figure states its own exposure.
    let plain = item(&one(), "figures/crops-equal-time-box").svg.clone();
    assert!(plain.unwrap().contains(">srgb (exposure"));
}

#[test]
fn names_of_nights_that_contain_a_device_do_not_state_it() {
    let nights = [night("RTX 4070", 1.0), night("RX 7600", 0.44)];
    let options = ReportOptions {
        names: ["new RTX 4070", "old"].map(str::to_owned).into(),
        ..ReportOptions::default()
    };
    let made = report(&nights, &options);
    let caption = &item(&made, "figures/error-time-rmse").caption;
    let devices = "Times are from 2 devices: new RTX 4070: RTX 4070; old: RX 7600.";
    assert!(caption.contains(devices), "{caption}");
}
