//! Sheets of pictures and frames that a script requests.

use super::*;
use crate::report::requested::{RunFiles, sheets};
use crate::time::array;
use lumbre_light::film::time::TimeAxis;
use lumbre_light::transport::delay::Profile;
use lumbre_light::transport::time_settings::Timing;
use lumbre_night::experiment::spec::SheetSpec;

/// Returns a night with a sheet or frames of these options.
fn with_sheet(kind: &str, options: serde_json::Value) -> Night {
    let mut night = night("Sample GPU", 1.0);
    let mut options = Value::from_json(&options).as_map().unwrap().clone();
    options.extend([("kind", kind), ("name", "mine")].map(|(k, v)| (k.to_owned(), v.into())));
    let spec = SheetSpec::new(options).unwrap();
    let plan = Arc::make_mut(&mut night.plan);
    plan.sheets = vec![spec];
    plan.is_repeated = true;
    plan.varying = vec![true; 2];
    night
}

/// Draws the only sheet of a night with its caption below, and returns it with its notes.
fn drawn(night: &Night, pictures: &Pictures) -> (ReportItem, String, Vec<String>) {
    let mut notes = Vec::new();
    let cube: Vec<f32> = (0..4 * 3 * 5 * 3).map(|i| (i % 7) as f32).collect();
    let files = RunFiles {
        pictures,
        bytes: &|path| match path.ends_with("films/time-cube.npy") {
            true => Ok(array(&[3, 4, 5, 3], cube.iter().copied())),
            false => Err(format!("{} is missing", path.display())),
        },
    };
    let mut made = sheets(std::slice::from_ref(night), files, true, &mut notes).unwrap();
    let item = made.remove(0);
    assert!(made.is_empty());
    let svg = item.svg.clone().unwrap();
    (item, svg, notes)
}

#[test]
fn pictures_form_rows_and_columns_and_the_caption_states_the_rest() {
    let rows = serde_json::json!({ "rows": "scene", "cols": "technique", "at": 60 });
    let (item, svg, notes) = drawn(&with_sheet("sheet", rows), &picture);
    assert_eq!(
        (item.stem.as_str(), svg.matches("<image").count()),
        ("sheets/mine", 4)
    );
    for label in ["box", "lamps", "bpt", "nee"] {
        assert!(
            svg.contains(&format!(">{label}</text>")),
            "{label} is missing"
        );
    }
    assert_eq!(
        item.caption,
        "Stored pictures nearest to 60 samples per pixel. 64 samples per pixel. Tone map: srgb \
         (exposure 0). Rows: scene. Columns: technique. Of the repeats, the first."
    );
    assert!(
        svg.contains(">Stored pictures nearest to"),
        "the caption is drawn"
    );
    assert!(notes.is_empty() && item.provenance.runs.len() == 4);
    let wrapped = serde_json::json!({ "cols": "scene", "at": "90s" });
    let (item, svg, _) = drawn(&with_sheet("sheet", wrapped), &picture);
    assert_eq!(svg.matches("<image").count(), 2);
    let caption = &item.caption;
    assert!(
        caption.contains("technique = bpt, the first of 2 values."),
        "{caption}"
    );
    assert!(caption.contains("Runs that ended before, with their last picture: 2."));
}

#[test]
fn gaps_state_why_a_picture_is_missing() {
    let rows = serde_json::json!({ "rows": "scene", "cols": "technique" });
    let mut night = with_sheet("sheet", rows);
    for run in &mut night.runs[..3] {
        let run = Arc::make_mut(run);
        (run.state, run.pictures) = (UNFINISHED, Vec::new());
    }
    // The first repeat failed: the second is shown.
    Arc::make_mut(&mut night.runs[3]).state = UNFINISHED;
    Arc::make_mut(&mut night.runs[6]).pictures.truncate(0);
    let read = |path: &Path, group: Option<&str>| match path.to_str() {
        Some("nee-0-128.exr") => Err("nee-0-128.exr: it is damaged".to_owned()),
        _ => picture(path, group).map(|image| Image::from_fn(40, 20, |x, y| image.at(x, y))),
    };
    let (item, svg, notes) = drawn(&night, &read);
    assert_eq!(svg.matches("<image").count(), 1);
    assert!(svg.contains(">unfinished</text>"));
    assert_eq!(
        svg.matches(">no picture</text>").count(),
        2,
        "none, and a damaged one"
    );
    assert_eq!(
        notes,
        ["a picture is left out: nee-0-128.exr: it is damaged"]
    );
    assert_eq!(item.provenance.runs[0].0, night.runs[4].id);
}

#[test]
fn frames_follow_the_density_and_the_picture_without_time() {
    let options = serde_json::json!({
        "at": [4.5, 8], "rows": "technique", "density": "hare", "static": true,
    });
    let mut night = with_sheet("frames", options);
    for (i, run) in night.runs.iter_mut().enumerate() {
        let plan = planned(run);
        let (start, bin) = (4.0, 0.5 + 0.5 * (i / 3 % 2) as f64);
        let mut timing = Timing::plain(TimeAxis {
            start,
            bin,
            bins: 5,
        });
        timing.metres = 1.0;
        plan.timing = Some(timing);
        plan.delays = [("hare".to_owned(), vec![(1.0, Profile::Exponential(2.0))])].into();
    }
    let (item, svg, notes) = drawn(&night, &picture);
    assert!(notes.is_empty(), "{notes:?}");
    // The axis of `bpt` ends at 6.5, that of `nee` at 9.
    assert_eq!(svg.matches("<image").count(), 2 * 2 + 1);
    assert_eq!(svg.matches(">outside of the axis</text>").count(), 1);
    assert_eq!(svg.matches("<polyline").count(), 2, "a density in each row");
    for head in ["density", "without time", "t = 4.5", "t = 8"] {
        assert!(
            svg.contains(&format!(">{head}</text>")),
            "{head} is missing"
        );
    }
    let caption = &item.caption;
    assert!(caption.contains("1 scene unit is 3.336 ns."), "{caption}");
    assert!(caption.contains("up to 2.00 per scene unit"), "{caption}");
    assert!(
        caption.contains("scene = box, the first of 2 values."),
        "{caption}"
    );
    planned(&mut night.runs[0]).timing = None;
    let (_, svg, _) = drawn(&night, &picture);
    assert_eq!(svg.matches(">no time axis</text>").count(), 2);
}

#[test]
fn reports_list_sheets() {
    let night = with_sheet("sheet", serde_json::json!({ "cols": "technique" }));
    let made = report(&[night], &ReportOptions::default());
    let sheet = item(&made, "sheets/mine");
    assert_eq!(
        (sheet.section.as_str(), sheet.title.as_str()),
        ("Requested by the script", "mine")
    );
    let svg = sheet.svg.as_ref().unwrap();
    assert!(
        !svg.contains(">Final pictures"),
        "captions of reports are beside"
    );
}
