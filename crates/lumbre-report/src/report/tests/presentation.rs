//! Names, colours and the tone map that a script sets, and names of nights.

use super::*;
use lumbre_metrics::tonemap::Tonemap;
use lumbre_night::experiment::spec::{
    FigureKind, FigureSpec, FigureX, Presentation, TableSpec, TableValue,
};

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
        notes: vec!["#final for <figure 3>".to_owned()],
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
    assert!(page.contains("#final for &lt;figure 3&gt;"));
    let series = &page_data(&page)["series"];
    assert!(series.to_string().contains("#123456"), "{series}");
    // Without it, each figure states its own exposure.
    let plain = item(&one(), "figures/crops-equal-time-box").svg.clone();
    assert!(plain.unwrap().contains(">srgb (exposure"));
}

#[test]
fn what_the_script_requests_comes_first() {
    let mut own = night("Sample GPU", 1.0);
    let plan = Arc::make_mut(&mut own.plan);
    plan.figures = vec![FigureSpec {
        name: "mine".to_owned(),
        kind: FigureKind::Convergence {
            x: FigureX::Samples,
            y: vec!["rmse".to_owned()],
        },
        by: Some("technique".to_owned()),
        facet: Vec::new(),
        only: Vec::new(),
    }];
    plan.tables = vec![TableSpec {
        name: "ours".to_owned(),
        value: TableValue::Metric("rmse".to_owned()),
        rows: vec!["scene".to_owned()],
        cols: vec!["technique".to_owned()],
        formats: Vec::new(),
    }];
    let made = report(std::slice::from_ref(&own), &ReportOptions::default());
    let stems: Vec<&str> = made.items.iter().map(|item| item.stem.as_str()).collect();
    assert!(stems[0].starts_with("requested/mine"), "{stems:?}");
    assert!(stems.contains(&"requested/ours"), "{stems:?}");
    assert!(text(&made, "requested/ours", "tex").contains("nee"));
    let page = text(&made, "index", "html");
    let at = |text: &str| page.find(text).unwrap_or_else(|| panic!("{text}"));
    assert!(at("id=\"requested/mine") < at("id=\"viewer\""));
    assert_eq!(page.matches("id=\"requested/ours\"").count(), 1);
    // A comparison of nights shows what suits all of them.
    let mut other = own.clone();
    other.folder = "elsewhere".into();
    let both = report(&[own, other], &ReportOptions::default());
    let is_requested = |item: &&ReportItem| item.stem.starts_with("requested/");
    assert!(!both.items.iter().any(|item| is_requested(&item)));
}

#[test]
fn answers_know_the_noise_of_references() {
    let own = night("Sample GPU", 1.0);
    let floors = |night: &Night| night.runs.iter().filter(|r| !r.floors.is_empty()).count();
    assert!(floors(&own) > 0);
    let device = |_, _: &Outcome| None;
    assert_eq!(floors(&requested::night(&own, device)), floors(&own));
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
