//! The answer at the top of the page, its caveats, and the reference that crops show.

use super::*;
use lumbre_metrics::floor::Floor;
use lumbre_render::Peer;

fn verdict(night: Night) -> String {
    let made = report(&[night], &ReportOptions::default());
    text(&made, "verdict", "md")
}

#[test]
fn the_page_begins_with_the_winners() {
    let made = one();
    let expected = "RMSE at equal time: nee is significantly best in 2 of 2 rows.";
    let markdown = text(&made, "verdict", "md");
    assert!(markdown.starts_with(expected), "{markdown}");
    assert!(markdown.contains("| box, after 1.28 s"), "{markdown}");
    assert!(markdown.contains("| **nee (1.4×)** |"), "{markdown}");
    let page = text(&made, "index", "html");
    let (answer, rest) = page.split_once("<nav>").unwrap();
    assert!(answer.contains(expected) && answer.contains("<b>nee (1.4×)</b>"));
    assert!(answer.contains("data:image/png;base64,"), "thumbnails");
    assert!(!answer.contains("Before you believe it"), "{answer}");
    assert!(answer.contains("/experiment.lua\">script</a>"), "{answer}");
    assert!(rest.contains("<summary>RMSE</summary>"));
}

#[test]
fn a_winner_whose_runs_have_an_error_in_common_has_a_caveat() {
    let caveats = |dark: &str| {
        let pictures = |path: &Path, group: Option<&str>| {
            let mut image = picture(path, group)?;
            if path.display().to_string().starts_with(dark) {
                image.data.iter_mut().for_each(|pixel| pixel[0] -= 0.1);
            }
            Ok(image)
        };
        let nights = [night("GPU", 1.0)];
        let made = report_with(&nights, &ReportOptions::default(), &pictures);
        text(&made, "verdict", "md")
    };
    assert!(!caveats("none").contains("in common"));
    assert!(caveats("nee").contains("The runs of nee have more error in common"));
    assert!(!caveats("bpt").contains("in common"), "bpt does not lead");
}

#[test]
fn bars_and_line_breaks_in_names_do_not_break_the_table_of_winners() {
    let named = |device: &str, speed: f64| {
        let mut named = night(device, speed);
        for run in named.runs.iter_mut().map(planned) {
            run.point[0].1 = Value::Str(format!("a|b\n{}", run.scene));
            run.point[1].1 = Value::Str(format!("{}|2", run.integrator));
        }
        named
    };
    let nights = [named("GPU|1", 1.0), named("Another GPU", 0.5)];
    let markdown = text(&report(&nights, &ReportOptions::default()), "verdict", "md");
    let lines: Vec<&str> = markdown.lines().filter(|l| l.starts_with('|')).collect();
    assert_eq!(lines.len(), 2 + 2, "a row for each scene: {markdown}");
    assert!(lines[0].contains("RMSE (GPU\\|1)"), "{markdown}");
    assert!(
        lines[2].starts_with("| a\\|b box.scn, after "),
        "{markdown}"
    );
    assert!(lines[2].contains("**technique = nee\\|2 ("), "{markdown}");
    let columns = |line: &&str| line.matches('|').count() - line.matches("\\|").count();
    let expected = columns(&lines[0]);
    assert!(lines.iter().all(|l| columns(l) == expected), "{markdown}");
}

#[test]
fn equal_techniques_have_no_winner() {
    let mut same = night("Sample GPU", 1.0);
    let (of_bpt, of_nee): (Vec<_>, Vec<_>) = same
        .runs
        .iter()
        .cloned()
        .partition(|run| run.integrator == "bpt");
    for run in same.runs.iter_mut().map(Arc::make_mut) {
        let all = if run.scene == "box.scn" {
            &of_bpt
        } else {
            &of_nee
        };
        let is_twin = |other: &&Arc<Run>| other.repeat == run.repeat && other.scene == run.scene;
        run.rows = all.iter().find(is_twin).unwrap().rows.clone();
    }
    let markdown = verdict(same);
    assert!(
        markdown.starts_with(
            "RMSE at equal time: no series is significantly better than every other in any row."
        ),
        "{markdown}"
    );
    assert!(markdown.contains("| no clear winner |"), "{markdown}");
}

#[test]
fn weak_evidence_is_named() {
    let mut single = night("Sample GPU", 1.0);
    single.runs.retain(|run| run.repeat == 0);
    let markdown = verdict(single);
    assert!(markdown.contains("from 1 finished repeat:"), "{markdown}");

    let mut noisy = night("Sample GPU", 1.0);
    for run in noisy.runs.iter_mut().map(Arc::make_mut) {
        run.floors = vec![("rmse".to_owned(), Floor::exact(0.012))];
    }
    let made = report(&[noisy], &ReportOptions::default());
    // The errors of the box are 0.018 with bpt and 0.009 with nee: below 0.012 times the root of 2
    // for the latter only.
    let table = text(&made, "tables/final-rmse", "md");
    let row = table
        .lines()
        .find(|line| line.starts_with("| box"))
        .unwrap();
    assert_eq!(row.matches('†').count(), 1, "{table}");
    assert!(table.contains("†: at least half"), "{table}");
    let markdown = text(&made, "verdict", "md");
    assert!(
        markdown.contains("Final RMSE: 1 of 4 numbers can be noise"),
        "{markdown}"
    );

    let mut easy = night("Sample GPU", 1.0);
    for row in easy
        .runs
        .iter_mut()
        .flat_map(|run| Arc::make_mut(&mut Arc::make_mut(run).rows))
    {
        row.metrics[1] = 0.99;
    }
    let markdown = verdict(easy);
    let passed = "Time to SSIM ≥ 0.95: 4 of 4 times are of the first measurement";
    assert!(markdown.contains(passed), "{markdown}");
}

#[test]
fn the_page_does_not_repeat_rmse_as_mse() {
    let mut squared = night("Sample GPU", 1.0);
    Arc::make_mut(&mut squared.plan).metrics[1] =
        MetricSpec::new("mse", "mse", BTreeMap::new()).unwrap();
    for run in squared.runs.iter_mut().map(Arc::make_mut) {
        run.floors = vec![
            ("rmse".to_owned(), Floor::exact(0.012)),
            ("mse".to_owned(), Floor::exact(0.000_144)),
        ];
        for row in Arc::make_mut(&mut run.rows) {
            row.metrics[1] = row.metrics[0] * row.metrics[0];
        }
    }
    let made = report(&[squared], &ReportOptions::default());
    let caveats = text(&made, "verdict", "md");
    assert_eq!(caveats.matches("can be noise").count(), 1, "{caveats}");
    assert!(!text(&made, "figures/error-time-mse", "svg").is_empty());
    let page = text(&made, "index", "html");
    assert!(page.contains("id=\"figures/error-time-rmse\""));
    assert!(!page.contains("id=\"figures/error-time-mse\""));
}

#[test]
fn techniques_with_and_without_vectors_are_told_apart() {
    let mut mixed = night("Sample GPU", 1.0);
    for run in mixed.runs.iter_mut().filter(|run| run.integrator == "bpt") {
        Arc::make_mut(run).lanes = Some(1);
    }
    let markdown = verdict(mixed.clone());
    let expected = "bpt traced one path at a time, and nee many at a time in vectors";
    assert!(markdown.contains(expected), "{markdown}");
    assert!(!markdown.contains("llvm_ad_rgb"), "{markdown}");
    for run in mixed.runs.iter_mut().filter(|run| run.lanes == Some(1)) {
        Arc::make_mut(run).peer = Some(Peer::default());
    }
    let markdown = verdict(mixed);
    assert!(markdown.contains(expected), "{markdown}");
    assert!(markdown.contains("llvm_ad_rgb"), "{markdown}");
    assert!(!verdict(night("Sample GPU", 1.0)).contains("in vectors"));
}

#[test]
fn references_that_runs_use_are_named_with_their_checks() {
    let mut own = night("Sample GPU", 1.0);
    own.references.push(Arc::new(Reference {
        origin: ReferenceOrigin::Rendered {
            integrator: "lvc".to_owned(),
            samples: 99,
        },
        ..Reference::clone(&own.references[0])
    }));
    let checked = |agrees| {
        let mut own = own.clone();
        Arc::make_mut(&mut own.references[0]).checks = vec![BiasCheckSummary {
            technique: "lvc".to_owned(),
            agrees,
            finding: "3 of 20 comparisons differ".to_owned(),
        }];
        report(&[own], &ReportOptions::default())
    };
    let text_of = |agrees, stem| text(&checked(agrees), stem, "md");
    let methods = text_of(false, "methods");
    assert!(
        methods.contains("references: bdpt, 4096 samples per pixel."),
        "{methods}"
    );
    let sentence = "A reference was compared with `lvc`: 3 of 20 comparisons differ.";
    assert!(methods.contains(sentence), "{methods}");
    assert!(text_of(false, "verdict").contains("DISAGREES with `lvc`"));
    assert!(!text_of(true, "verdict").contains("DISAGREES"));
}

#[test]
fn crops_show_the_least_noisy_reference_and_warn_if_references_differ() {
    let mut own = night("Sample GPU", 1.0);
    own.references.push(Arc::new(Reference {
        picture: Some(PathBuf::from("second.exr")),
        ..Reference::clone(&own.references[0])
    }));
    for run in &mut own.runs {
        let is_bpt = run.integrator == "bpt";
        planned(run).reference = Some(usize::from(!is_bpt));
        Arc::make_mut(run).floors = vec![(
            "rmse".to_owned(),
            Floor::exact(if is_bpt { 0.02 } else { 0.001 }),
        )];
    }
    let caption_with = |factor: f32| {
        let pictures = |path: &Path, group: Option<&str>| {
            let image = picture(path, group)?;
            let is_second = path.ends_with("second.exr");
            let factor = if is_second { factor } else { 1.0 };
            Ok(Image {
                data: image.data.iter().map(|p| p.map(|x| x * factor)).collect(),
                ..image
            })
        };
        let made = report_with(&[own.clone()], &ReportOptions::default(), &pictures);
        let svg = text(&made, "figures/crops-equal-time-box", "svg");
        assert!(svg.contains(">reference of nee</text>"));
        let caption = item(&made, "figures/crops-equal-time-box").caption.clone();
        (caption, svg)
    };
    let (caption, _) = caption_with(1.0);
    assert!(
        caption.contains("the one shown is that of nee"),
        "{caption}"
    );
    assert!(!caption.contains("differ by more"), "{caption}");
    let (caption, svg) = caption_with(1.5);
    let warning = "The references of bpt and nee differ by more than their noise: RMSE 0.";
    assert!(caption.contains(warning), "{caption}");
    assert!(svg.contains("#b3261e"), "the figure warns too");
}
