//! References with known error: halves, shards, noise floors, and bias checks.

use lumbre_metrics::floor::Floor;
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use lumbre_light::film::Image;
use lumbre_light::scene::CompiledScene;
use lumbre_metrics::MetricSpec;
use lumbre_night::experiment::event::{FinishedRun, History, SaveState};
use lumbre_night::experiment::noise_floor::{HalfImages, floors};
use lumbre_night::experiment::outcome::Level;
use lumbre_night::experiment::plan::ReferenceSource;
use lumbre_night::experiment::run::{Options, Seams, run_with};
use lumbre_night::experiment::run_progress::{Checkpoint, RunProgress};
use lumbre_night::experiment::shards::Shard;
use lumbre_night::experiment::spec::{BiasCheckRequest, ReferenceRequest};
use lumbre_night::experiment::stop::Comparison;
use lumbre_night::experiment::{CellRef, Event, Outcome, Plan, Point, Sink, SinkError, StopRule};
use lumbre_render::Settings;
use lumbre_render::mock::{MockRenderer, RELATIVE_SIGMA};
use lumbre_render::{Job, RenderError, Renderer};

use crate::experiment::fixtures::{
    Lab, Night, Recorder, at, config, finished_in, ints, outcomes, whole_at,
};

const CELL: CellRef = CellRef::Cell(0);

/// Returns the settings of all pictures here: 64x48 pixels.
fn picture() -> Settings {
    Settings {
        resolution: Some([64, 48]),
        ..config()
    }
}

/// Returns an experiment of 64x48 pixels with a reference of this number of samples.
fn lab(reference: u64) -> Lab {
    lab_with(StopRule::Samples(reference), 1)
}

/// Returns the same with a reference that ends by a rule and is rendered in parts.
fn lab_with(stop: StopRule, shards: u32) -> Lab {
    let mut lab = Lab::new().measured();
    lab.render = Box::new(|_| Ok(picture()));
    lab.reference = Box::new(move |_| {
        Ok(Some(ReferenceRequest::Render {
            config: Box::new(picture()),
            stop: stop.clone(),
            bias_check: None,
            shards,
        }))
    });
    lab
}

fn reported_floors(recorder: &Recorder) -> Vec<Vec<Option<Floor>>> {
    let reported = |e: &Event| {
        if let Event::NoiseFloors { floors, .. } = e {
            Some(floors.to_vec())
        } else {
            None
        }
    };
    recorder.events.iter().filter_map(reported).collect()
}

#[test]
fn a_reference_consists_of_two_halves_and_its_noise_floor_is_its_error() {
    let (summary, recorder) = Night::default().record(&lab(400));
    let start = recorder
        .labels
        .iter()
        .position(|w| w == "start c0")
        .unwrap();
    assert_eq!(
        recorder.labels[start - 3..start],
        ["halves r0", "floors r0", "done r0"]
    );
    let halves = recorder.events.iter().find_map(|e| match e {
        Event::Halves { halves, .. } => Some(halves.clone()),
        _ => None,
    });
    let halves = halves.unwrap();
    assert_eq!(halves.each_ref().map(|h| h.samples), [200, 200]);
    assert_ne!(halves[0].mean(), halves[1].mean());
    let film = recorder.film(CellRef::Reference(0)).unwrap();
    assert_eq!(film.samples, 400);
    // The mock's noise is a known fraction of the truth, which the mean approximates well.
    let mean_square = film
        .mean()
        .data
        .iter()
        .flatten()
        .map(|x| f64::from(*x).powi(2))
        .sum::<f64>()
        / 9216.0;
    let expected = RELATIVE_SIGMA * (mean_square / 400.0).sqrt();
    let reported = reported_floors(&recorder);
    let [floor] = reported[0][..] else {
        panic!("{reported:?}")
    };
    // 9216 normal values: the square root of their mean square is within 3 % at four standard
    // errors.
    assert!(
        (floor.unwrap().value / expected - 1.0).abs() < 0.03,
        "{floor:?} {expected}"
    );
    assert_eq!(
        (reported.len(), summary.night.runs[0].floor("rmse")),
        (1, floor)
    );
    let of_reference = summary.night.references[0].floors.as_deref();
    assert_eq!(of_reference, Some(&reported[0]));
}

#[test]
fn a_reference_of_one_sample_has_no_halves_and_no_noise_floor() {
    let (summary, recorder) = Night::default().record(&lab(1));
    assert!(reported_floors(&recorder).is_empty() && summary.night.runs[0].floors.is_empty());
    assert!(!recorder.labels.contains(&"halves r0".to_owned()));
}

#[test]
fn a_sharded_reference_has_all_samples_and_is_joined_once() {
    let (_, whole) = Night::default().record(&lab(400));
    let lab = lab_with(StopRule::Samples(400), 3);
    assert_ne!(
        lab.plan().references[0].id.0,
        self::lab(400).plan().references[0].id.0,
        "the ids must differ, since the last bits may differ"
    );
    // No process stores the shards, so the night keeps them in memory.
    let (summary, recorder) = Night::default().record(&lab);
    let labels: Vec<&str> = recorder
        .labels
        .iter()
        .map(String::as_str)
        .filter(|w| !w.starts_with("wave"))
        .collect();
    let start = labels.iter().position(|w| *w == "start r0 1").unwrap();
    let wanted = [
        "start r0 1",
        "done r0 1",
        "start r0 2",
        "done r0 2",
        "start r0 3",
        "done r0 3",
    ];
    assert_eq!(labels[start..start + 6], wanted);
    assert_eq!(
        labels[start + 6..start + 11],
        [
            "start r0",
            "message r0",
            "halves r0",
            "floors r0",
            "done r0"
        ]
    );
    let [joined, one] =
        [&recorder, &whole].map(|recorder| recorder.film(CellRef::Reference(0)).unwrap());
    assert_eq!((joined.samples, one.samples), (400, 400));
    for (a, b) in joined.sum.iter().flatten().zip(one.sum.iter().flatten()) {
        assert!((a / b - 1.0).abs() < 1e-12, "{a} {b}");
    }
    for (a, b) in joined
        .variance_of_mean()
        .data
        .iter()
        .flatten()
        .zip(one.variance_of_mean().data.iter().flatten())
    {
        assert!((a / b - 1.0).abs() < 0.02, "{a} {b}");
    }
    let rows = summary.night.references[0]
        .rows
        .iter()
        .map(|row| (row.wave, row.samples))
        .collect::<Vec<_>>();
    assert_eq!(rows, [(1, 134), (2, 268), (3, 400)]);
    let paths = summary.night.references[0].rows.last().unwrap().paths;
    assert_eq!(
        paths,
        400 * 64 * 48,
        "the paths of both halves must be counted once each"
    );
}

/// A history that lists all shards as stored, and returns this checkpoint when it joins them.
struct UnreadableStore(Option<Checkpoint>);

impl History for UnreadableStore {
    fn finished_run(&self, _: &Plan, _: CellRef) -> Option<FinishedRun> {
        None
    }

    fn image(&self, _: &Plan, _: usize) -> Result<Option<Image>, SinkError> {
        Ok(None)
    }

    fn available_shards(&self, _: &Plan, parts: &[Shard]) -> BTreeSet<usize> {
        parts.iter().map(|part| part.number).collect()
    }

    fn joined_shards(&self, _: &Plan, _: &[Shard]) -> Option<Checkpoint> {
        self.0.clone()
    }
}

#[test]
fn stored_shards_that_cannot_be_read_fail_their_reference() {
    let lab = lab_with(StopRule::Samples(400), 4);
    let plan = Arc::new(lab.plan());
    let Night {
        open,
        wait,
        control,
        ..
    } = Night::default();
    let foreign = Checkpoint {
        progress: RunProgress::default(),
        state: vec![1; 64],
    };
    for stored in [None, Some(foreign)] {
        let mut recorder = Recorder::default();
        let seams = Seams { open, wait };
        let summary = run_with(
            &seams,
            &plan,
            &lab,
            &UnreadableStore(stored),
            &mut [&mut recorder],
            &control,
            1,
        )
        .unwrap();
        let [Outcome::Failed(why), Outcome::Failed(_)] = outcomes(&summary)[..] else {
            panic!("{summary:?}")
        };
        assert!(
            why.contains("shard 1 of 4 is stored but cannot be read")
                && why.contains("`refs/sums`"),
            "{why}"
        );
        assert!(
            !recorder.labels.iter().any(|word| word.starts_with("start")),
            "{:?}",
            recorder.labels
        );
    }
}

#[test]
fn a_sharded_reference_needs_a_number_of_samples() {
    let lab = lab_with(StopRule::Time(1.0), 4);
    let error = lab.try_plan().unwrap_err().to_string();
    assert!(
        error.contains("a reference in parts needs a number of samples"),
        "{error}"
    );
}

#[test]
fn stored_halves_give_the_noise_floors_once_and_broken_halves_give_a_warning() {
    let lab = lab(64).axis("idle", ints([1, 2]));
    let plan = lab.plan();
    let id = plan.references[0].id.clone();
    let flat = |x: f32| Image::from_fn(64, 48, |_, _| [x; 3]);
    let mut night = Night::default();
    let run = finished_in("refs");
    night.history.done.borrow_mut().insert(id.clone(), run);
    night.history.images.insert(id.clone(), Ok(flat(0.5)));
    let halves = HalfImages {
        means: [flat(0.4), flat(0.6)],
        samples: [32, 32],
    };
    night.history.halves.insert(id.clone(), Ok(halves));
    let (_, recorder) = night.record(&lab);
    let reported = reported_floors(&recorder);
    assert_eq!(reported.len(), 1, "both cells share the noise floor");
    assert!((reported[0][0].unwrap().value - 0.1).abs() < 1e-6);
    night
        .history
        .halves
        .insert(id, Err("half-a.exr is cut off".into()));
    let (summary, recorder) = night.record(&lab);
    assert!(reported_floors(&recorder).is_empty() && summary.night.runs[0].floors.is_empty());
    let warnings = recorder.messages(Level::Warn);
    assert!(
        warnings.iter().any(|w| w.contains("half-a.exr is cut off")),
        "{warnings:?}"
    );
}

#[test]
fn thresholds_below_the_noise_floor_cause_a_warning() {
    let warnings = |op: Comparison, value: f64| {
        let mut lab = lab(100).axis("idle", ints([1, 2]));
        lab.stop = Box::new(move |_| {
            let when = StopRule::When {
                column: "rmse".into(),
                op,
                value,
                hold: 1,
            };
            let inner = StopRule::All(vec![when, StopRule::Waves(1)]);
            Ok(StopRule::Any(vec![StopRule::Samples(4), inner]))
        });
        Night::default().record(&lab).1.messages(Level::Warn)
    };
    // The noise floor is near 0.1 * 0.5 / 10.
    let found = warnings(Comparison::Less, 0.001);
    assert_eq!(
        found.len(),
        2,
        "the scene's note and the warning: {found:?}"
    );
    let warning = found.iter().find(|w| w.contains("rmse")).unwrap();
    assert!(
        warning.starts_with(
            "2 cells stop at `rmse < 0.001`, but even the true picture would measure 0.00"
        ),
        "{warning}"
    );
    assert!(
        warnings(Comparison::Less, 0.01)
            .iter()
            .all(|w| !w.contains("rmse"))
    );
    // Both cells pass it at once, which is reported for the first of them.
    let passed = warnings(Comparison::Greater, 0.001);
    let of_rmse: Vec<&String> = passed.iter().filter(|w| w.contains("rmse")).collect();
    assert!(
        matches!(of_rmse[..], [one] if one.starts_with("`rmse > 0.001` held at the first")),
        "{passed:?}"
    );
}

#[test]
fn a_metric_that_cannot_be_computed_has_no_floor() {
    let metrics = ["rmse", "ssim"].map(|m| MetricSpec::new(m, m, BTreeMap::new()).unwrap());
    let image = Image::from_fn(4, 4, |_, _| [0.5; 3]);
    let halves = HalfImages {
        means: [image.clone(), image.clone()],
        samples: [1, 1],
    };
    assert_eq!(
        floors(&metrics, &image, &halves),
        [Some(Floor::exact(0.0)), None]
    );
}

/// Returns an experiment whose reference has a bias check by `nee`.
fn compared() -> Lab {
    compared_by("bpt", Some("nee"))
}

/// Returns an experiment whose reference is by one technique, with a bias check by another.
fn compared_by(first: &'static str, second: Option<&'static str>) -> Lab {
    let mut lab = lab(256);
    lab.reference = Box::new(move |_| {
        let mut config = config();
        config.resolution = Some([64, 48]);
        config.integrator = first.into();
        let bias_check = second.map(|second| {
            Box::new(BiasCheckRequest {
                config: Settings {
                    integrator: second.into(),
                    ..config.clone()
                },
                stop: StopRule::Samples(64),
                rate: 0.01,
            })
        });
        let stop = StopRule::Samples(256);
        Ok(Some(ReferenceRequest::Render {
            config: Box::new(config),
            stop,
            bias_check,
            shards: 1,
        }))
    });
    lab
}

#[test]
fn a_bias_check_refuses_a_technique_that_is_not_unbiased_and_a_reference_by_it_is_noted() {
    for pair in [("bpt", "sppm"), ("sppm", "bpt")] {
        let refusal = compared_by(pair.0, Some(pair.1)).try_plan().unwrap_err();
        let refusal = refusal.to_string();
        assert!(
            refusal.contains("`sppm` is biased") && refusal.contains("unbiased"),
            "{refusal}"
        );
    }
    let noted = |technique| compared_by(technique, None).plan().warnings;
    let warnings = noted("sppm");
    assert!(
        warnings
            .iter()
            .any(|w| w.starts_with("the reference is rendered by `sppm`, which is biased")),
        "{warnings:?}"
    );
    assert!(noted("bpt").is_empty(), "{:?}", noted("bpt"));
}

#[test]
fn a_bias_check_of_a_technique_whose_pixels_share_noise_is_noted() {
    for pair in [("bpt", "lvc"), ("lvc", "bpt")] {
        let warnings = compared_by(pair.0, Some(pair.1)).plan().warnings;
        assert!(
            warnings
                .iter()
                .any(|w| w.contains("those of `lvc` share light subpaths")),
            "{warnings:?}"
        );
    }
    let warnings = compared_by("bpt", Some("nee")).plan().warnings;
    assert!(warnings.is_empty(), "{warnings:?}");
    let warnings = compared_by("lvc", None).plan().warnings;
    assert!(warnings.is_empty(), "{warnings:?}");
}

/// Opens a renderer that is biased for `nee`: its paths may have one more edge, which adds light.
fn biased(_: &str, scene: Arc<CompiledScene>, job: Job) -> Result<Box<dyn Renderer>, RenderError> {
    let max_depth = if job.integrator.name == "nee" {
        job.max_depth + 1
    } else {
        job.max_depth
    };
    Ok(Box::new(MockRenderer::new(scene, Job { max_depth, ..job })))
}

#[test]
fn a_bias_check_passes_within_noise_and_its_picture_is_no_reference_of_a_cell() {
    let lab = compared();
    let plan = lab.plan();
    assert_eq!(plan.references.len(), 2);
    assert_eq!(
        (
            plan.references[0].bias_check.unwrap().with,
            plan.references[1].bias_check
        ),
        (1, None)
    );
    assert_eq!(plan.cells[0].reference, Some(0));
    let seeds = |index: usize| match &plan.references[index].source {
        ReferenceSource::Render { seeds, .. } => *seeds,
        ReferenceSource::File { .. } => panic!("reference {index} is a file"),
    };
    assert!(
        seeds(0).iter().all(|seed| !seeds(1).contains(seed)),
        "pictures to compare must be independent"
    );
    let (summary, recorder) = Night::default().record(&lab);
    assert!(summary.disagreements.is_empty());
    let at = |word: &str| {
        recorder
            .labels
            .iter()
            .position(|w| w == word)
            .unwrap_or_else(|| panic!("{word}"))
    };
    assert!(at("done r1") < at("compared r0 r1") && at("compared r0 r1") < at("start c0"));
    let messages = recorder.messages(Level::Info);
    assert!(
        messages
            .iter()
            .any(|w| w.starts_with("agrees with `nee`: none of ")),
        "{messages:?}"
    );
}

#[test]
fn with_a_deadline_both_pictures_of_a_bias_check_come_before_their_cells() {
    let lab = compared();
    let plan = Arc::new(lab.plan());
    let Night {
        open,
        wait,
        control,
        history,
    } = Night::default();
    let options = Options {
        deadline: Some(SystemTime::now() + Duration::from_secs(9999)),
        ..Options::from(1)
    };
    let mut recorder = Recorder::default();
    let seams = Seams { open, wait };
    run_with(
        &seams,
        &plan,
        &lab,
        &history,
        &mut [&mut recorder],
        &control,
        options,
    )
    .unwrap();
    let starts: Vec<&String> = recorder
        .labels
        .iter()
        .filter(|label| label.starts_with("start ") || label.starts_with("compared "))
        .collect();
    assert_eq!(
        starts,
        ["start r0", "start r1", "compared r0 r1", "start c0"]
    );
}

#[test]
fn cells_are_measured_against_their_own_stored_references() {
    // The depth is the inner axis, so that each cell needs another reference than the last.
    let depth = |p: &Point, config: &mut Settings| config.max_depth = Some(whole_at(p, "depth"));
    let mut lab = Lab::new()
        .axis("technique", ["bpt", "nee"])
        .axis("depth", [1i64, 2, 3]);
    lab.configure(depth);
    let mut lab = lab.measured();
    lab.configure(move |p, config| {
        depth(p, config);
        config.integrator = at(p, "technique").as_str().unwrap_or_default().to_owned();
    });
    let plan = lab.plan();
    let mut night = Night::default();
    for (index, reference) in plan.references.iter().enumerate() {
        let run = finished_in("refs");
        let brightness = 10f32.powi(index as i32 + 1);
        let image = Image::from_fn(8, 4, |_, _| [brightness; 3]);
        night
            .history
            .done
            .borrow_mut()
            .insert(reference.id.clone(), run);
        night.history.images.insert(reference.id.clone(), Ok(image));
    }
    let (summary, _) = night.record(&lab);
    // The pictures themselves are darker than 1.
    assert_eq!(summary.night.runs.len(), 6);
    for run in &summary.night.runs {
        let brightness = [10.0, 100.0, 1000.0][run.reference.unwrap()];
        let rmse = run.rows.last().unwrap().metrics[0];
        assert!(
            (rmse - brightness).abs() < 1.0,
            "{rmse} instead of about {brightness}"
        );
    }
}

#[test]
fn a_bias_check_of_a_biased_technique_raises_an_alarm_with_a_map() {
    let (summary, recorder) = Night {
        open: &biased,
        ..Night::default()
    }
    .record(&compared());
    let [found] = summary.disagreements.as_slice() else {
        panic!("{:?}", summary.disagreements)
    };
    assert_eq!((found.reference, found.with), (0, 1));
    assert!(
        found.found.starts_with("DISAGREES with `nee`: "),
        "{}",
        found.found
    );
    assert!(recorder.messages(Level::Error).contains(&found.found));
    let agreement = recorder.events.iter().find_map(|e| match e {
        Event::BiasCheck { compared, .. } => compared.clone(),
        _ => None,
    });
    let (_, agreement) = agreement.unwrap();
    // 31/32 of the light compared with 63/64.
    assert!(
        (agreement.ratio / (62.0 / 63.0) - 1.0).abs() < 0.001,
        "{}",
        agreement.ratio
    );
    assert!(agreement.map.values.iter().filter(|z| **z < -2.0).count() > 64 * 48 / 2);
    // The night continues: its cells are rendered.
    assert!(recorder.labels.contains(&"done c0".to_owned()));
}

#[test]
fn stored_pictures_are_compared_and_missing_noise_is_reported() {
    let lab = compared();
    let plan = lab.plan();
    let mut night = Night::default();
    for (reference, light) in plan.references.iter().zip([0.5, 0.6]) {
        let run = finished_in("refs");
        night
            .history
            .done
            .borrow_mut()
            .insert(reference.id.clone(), run);
        let flat = |x: f32| Image::from_fn(64, 48, |_, _| [x; 3]);
        night
            .history
            .images
            .insert(reference.id.clone(), Ok(flat(light)));
        night.history.noise.insert(reference.id.clone(), flat(0.02));
    }
    let (summary, _) = night.record(&lab);
    assert_eq!(summary.disagreements.len(), 1);
    night.history.noise.clear();
    let (summary, recorder) = night.record(&lab);
    assert!(summary.disagreements.is_empty());
    let messages = recorder.messages(Level::Warn);
    assert!(
        messages
            .iter()
            .any(|w| w.contains("cannot be compared with `nee`: the noise of `bpt` is not known")),
        "{messages:?}"
    );
}

#[test]
fn measuring_time_is_recorded_and_accumulates() {
    let (_, recorder) = Night::default().record(&lab(16));
    let rows = recorder.rows(CELL);
    assert!(
        rows.iter()
            .all(|row| row.measure_s > 0.0 && row.measure_s <= row.wall_s)
    );
    assert!(
        rows.windows(2)
            .all(|pair| pair[1].measure_s > pair[0].measure_s)
    );
}

/// A history that stores the sums of one reference.
#[derive(Default)]
struct Sums(RefCell<Option<Checkpoint>>);

impl History for Sums {
    fn finished_run(&self, _: &Plan, _: CellRef) -> Option<FinishedRun> {
        None
    }

    fn image(&self, _: &Plan, _: usize) -> Result<Option<Image>, SinkError> {
        Ok(None)
    }

    fn shorter_reference(&self, _: &Plan, _: usize, most: u64) -> Option<Checkpoint> {
        let stored = self.0.borrow().clone();
        stored.filter(|stored| stored.progress.samples() <= most)
    }

    fn save_sums(
        &self,
        _: &Plan,
        _: usize,
        progress: &RunProgress,
        save: SaveState<'_>,
    ) -> Result<bool, SinkError> {
        let mut state = Vec::new();
        save(&mut state).map_err(|e| SinkError(e.to_string()))?;
        let progress = progress.clone();
        *self.0.borrow_mut() = Some(Checkpoint { progress, state });
        Ok(true)
    }
}

#[test]
fn a_reference_with_the_samples_of_a_stored_one_renders_nothing() {
    let stored = Sums::default();
    let starts = |stop: StopRule| {
        let lab = lab_with(stop, 1);
        let plan = Arc::new(lab.plan());
        let Night {
            open,
            wait,
            control,
            ..
        } = Night::default();
        let mut recorder = Recorder::default();
        let seams = Seams { open, wait };
        let sinks: &mut [&mut dyn Sink] = &mut [&mut recorder];
        run_with(&seams, &plan, &lab, &stored, sinks, &control, 1).unwrap();
        let waves = recorder.labels.iter().filter(|l| l.starts_with("wave r0"));
        (waves.count(), recorder.messages(Level::Info))
    };
    let (waves, _) = starts(StopRule::Samples(64));
    assert!(waves > 0);
    let limits = vec![StopRule::Samples(64), StopRule::Time(1e6)];
    let (waves, messages) = starts(StopRule::Any(limits));
    let continued = "continues a shorter reference after 64 samples per pixel";
    assert!(
        waves == 0 && messages.iter().any(|text| text.contains(continued)),
        "{waves} {messages:?}"
    );
}
