//! Figures over an axis of the sweep.

use super::*;

/// Builds a night with a third axis, the number of bins, which takes the place of the repeats.
/// Every
/// run has two repeats; the second builds its acceleration structure 10 % more slowly.
fn swept() -> Night {
    let mut night = night("Sample GPU", 1.0);
    Arc::make_mut(&mut night.plan).axes.push("bins".to_owned());
    let mut runs = Vec::new();
    for run in &night.runs {
        for repeat in 0..2 {
            let bins = [2i64, 8, 32][run.repeat as usize];
            let mut one = Arc::clone(run);
            let plan = planned(&mut one);
            plan.point.push(("bins".to_owned(), Value::Int(bins)));
            plan.id = format!("{:032x}", 0xabc000 + runs.len());
            plan.repeat = repeat;
            if let Some(open) = &mut Arc::make_mut(&mut one).open {
                open.accel_build_s = 0.001 * bins as f64 * (1.0 + 0.1 * f64::from(repeat));
                open.accel_nodes = 70 + bins as u64;
            }
            runs.push(one);
        }
    }
    night.runs = runs;
    night
}

#[test]
fn final_values_are_drawn_over_axes_of_numbers() {
    let made = report(&[swept()], &ReportOptions::default());
    let stems: Vec<&str> = made
        .items
        .iter()
        .map(|i| i.stem.as_str())
        .filter(|s| s.contains("/sweep-"))
        .collect();
    let columns = [
        "rmse",
        "ssim",
        "mpaths_s",
        "accel_build_s",
        "accel_nodes",
        "accel_mib",
        "accel_cost",
    ];
    assert_eq!(
        stems,
        columns.map(|column| format!("figures/sweep-bins-{column}"))
    );
    let build = item(&made, "figures/sweep-bins-accel_build_s");
    let svg = build.svg.as_deref().unwrap();
    assert!(
        svg.contains(">build (s)</text>")
            && svg.contains(">bins</text>")
            && svg.contains(">lamps</text>"),
        "{svg}"
    );
    // Two panels with two series each have a line, a band and three markers per series.
    assert_eq!(svg.matches("fill-opacity=\"0.16\"").count(), 4);
    assert_eq!(
        svg.matches("<circle").count(),
        2 * 3,
        "markers of the first series"
    );
    assert_eq!(
        build.caption,
        "Build time of the acceleration structure in seconds, over bins. Geometric mean of \
         repeats. Band: range of the two repeats. Measured on Sample GPU."
    );
    assert_eq!(build.provenance.runs.len(), 24);
    assert!(
        build
            .files()
            .unwrap()
            .iter()
            .any(|(name, bytes)| name.ends_with("pdf") && bytes.len() > 1000)
    );
}

#[test]
fn sweeps_are_exported_to_latex_with_scales_and_bands() {
    let made = report(&[swept()], &ReportOptions::default());
    let dat = text(&made, "figures/sweep-bins-accel_build_s", "dat");
    let first = dat.lines().filter(|l| !l.starts_with('#')).nth(1).unwrap();
    let numbers: Vec<f64> = first
        .split(' ')
        .take(4)
        .map(|n| n.parse().unwrap())
        .collect();
    let expected = [2.0, 0.002 * 1.1f64.sqrt(), 0.002, 0.0022];
    assert!(
        numbers
            .iter()
            .zip(expected)
            .all(|(a, b)| (a / b - 1.0).abs() < 1e-9),
        "{numbers:?}"
    );
    let tex = text(&made, "figures/sweep-bins-accel_build_s", "tex");
    assert!(
        tex.contains("xmode=log, ymode=log, ylabel={build (s)}")
            && tex.contains(", xlabel={bins}, xmin="),
        "{tex}"
    );
    // The vertical axis is linear, since the numbers of nodes span less than a factor of ten.
    let tex = text(&made, "figures/sweep-bins-accel_nodes", "tex");
    assert!(tex.contains("xmode=log, ylabel={nodes}"), "{tex}");
}

#[test]
fn requested_axes_of_names_are_drawn_and_long_names_are_rotated() {
    let options = ReportOptions {
        sweep: vec!["scene".to_owned()],
        ..ReportOptions::default()
    };
    let mut long = night("Sample GPU", 1.0);
    for run in long.runs.iter_mut().filter(|run| run.scene == "lamps.scn") {
        planned(run).point[0].1 = Value::from(
            "a scene with a name that is too long to fit beside the label of another scene",
        );
    }
    let made = report(&[long], &options);
    let figure = item(&made, "figures/sweep-scene-rmse");
    let svg = figure.svg.as_deref().unwrap();
    assert!(
        svg.contains("rotate(-90") && svg.contains(">a scene with a name"),
        "{svg}"
    );
    assert!(text(&made, "figures/sweep-scene-rmse", "tex").contains("rotate=90, anchor=east"));
    assert!(
        figure.files().is_ok(),
        "rotated text can be exported to PDF"
    );
    let stems: Vec<&str> = made.items.iter().map(|i| i.stem.as_str()).collect();
    assert!(
        !stems.contains(&"figures/sweep-scene-accel_nodes"),
        "all scenes have the same acceleration structure"
    );
    let unknown = ReportOptions {
        sweep: vec!["scenes".to_owned()],
        ..ReportOptions::default()
    };
    let nights = [night("Sample GPU", 1.0)];
    let study = Study::new(&nights, &unknown).unwrap();
    assert!(
        crate::report::sweep::all(&study, &unknown, &mut Vec::new())
            .unwrap_err()
            .to_string()
            .contains("the axes are: scene, technique")
    );
}

/// Builds the night of [`swept`] with two more axes: the number of leaves, which is different for
/// each number of bins, and a kind that two numbers of bins share.
fn zipped() -> Night {
    let mut night = swept();
    Arc::make_mut(&mut night.plan)
        .axes
        .extend(["leaves", "kind"].map(str::to_owned));
    for run in &mut night.runs {
        let bins = run.axis_value("bins").unwrap();
        let run = planned(run);
        run.point.push((
            "leaves".to_owned(),
            Value::from(format!("{bins} leaves").as_str()),
        ));
        run.point.push((
            "kind".to_owned(),
            Value::from(if bins == "2" { "few" } else { "many" }),
        ));
    }
    night
}

#[test]
fn axes_determined_by_the_swept_one_distinguish_no_lines() {
    let stem = "figures/sweep-bins-accel_build_s";
    let lines = |report: &Report| {
        item(report, stem)
            .svg
            .as_deref()
            .unwrap()
            .matches("fill-opacity=\"0.16\"")
            .count()
    };
    let made = report(&[zipped()], &ReportOptions::default());
    assert_eq!(lines(&made), 4, "as without them");
    let caption = &item(&made, stem).caption;
    assert!(
        caption.contains(", over bins. With it, leaves and kind change. "),
        "{caption}"
    );
    assert!(
        !made.notes.iter().any(|note| note.contains("over `")),
        "{:?}",
        made.notes
    );
    let by = |axis: &str| ReportOptions {
        by: vec![axis.to_owned()],
        ..ReportOptions::default()
    };
    // A line needs two points, which only one of the kinds has.
    let made = report(&[zipped()], &by("kind"));
    assert_eq!(lines(&made), 4 + 4);
    assert_eq!(made.notes, Vec::<String>::new());
    let made = report(&[zipped()], &by("leaves"));
    assert_eq!(lines(&made), 4);
    assert!(made.notes.contains(
        &"over `bins`, lines are not distinguished by `leaves`, which changes with it".to_owned()
    ));
    let sweep = |axis: &str| ReportOptions {
        sweep: vec![axis.to_owned()],
        ..ReportOptions::default()
    };
    let made = report(&[zipped()], &sweep("leaves"));
    assert!(
        item(&made, "figures/sweep-leaves-rmse")
            .caption
            .contains(". With it, bins and kind change.")
    );
}

#[test]
fn a_requested_axis_without_figures_is_a_note() {
    let options = ReportOptions {
        by: vec!["scene".to_owned()],
        sweep: vec!["scene".to_owned()],
        ..ReportOptions::default()
    };
    let mut one = night("Sample GPU", 1.0);
    one.runs.retain(|run| run.scene == "box.scn");
    let made = report(&[one], &options);
    for note in [
        "nothing is compared by `scene`: it has a single value",
        "nothing is drawn over `scene`: it has a single value",
    ] {
        assert!(
            made.notes.iter().any(|n| n == note),
            "{note}: {:?}",
            made.notes
        );
    }
    let mut unfinished = night("Sample GPU", 1.0);
    unfinished
        .runs
        .iter_mut()
        .filter(|run| run.scene == "box.scn")
        .for_each(|run| Arc::make_mut(run).state = UNFINISHED);
    let made = report(
        &[unfinished],
        &ReportOptions {
            sweep: vec!["scene".to_owned()],
            ..ReportOptions::default()
        },
    );
    assert!(
        made.notes
            .iter()
            .any(|n| n.starts_with("nothing is drawn over `scene`: no line")),
        "{:?}",
        made.notes
    );
}

#[test]
fn a_sweep_over_techniques_is_one_line() {
    let mut one = night("Sample GPU", 1.0);
    one.runs.retain(|run| run.scene == "box.scn");
    one.runs
        .iter_mut()
        .for_each(|run| drop(planned(run).point.remove(0)));
    Arc::make_mut(&mut one.plan).axes.remove(0);
    let made = report(
        &[one],
        &ReportOptions {
            sweep: vec!["technique".to_owned()],
            ..ReportOptions::default()
        },
    );
    let svg = item(&made, "figures/sweep-technique-rmse")
        .svg
        .as_deref()
        .unwrap();
    assert_eq!(svg.matches("fill-opacity=\"0.16\"").count(), 1, "{svg}");
    assert!(!svg.contains(">bpt ("), "{svg}");
}
