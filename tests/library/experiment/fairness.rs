//! Orders of cells, warm-up, and the A/A check: whether techniques are compared fairly.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex};

use lumbre_light::transport::camera::FilterKind;
use lumbre_night::experiment::aa_check::{Finding, check};
use lumbre_night::experiment::outcome::Level;
use lumbre_night::experiment::plan::identity::{cell_seed, warmup_seed};
use lumbre_night::experiment::run::{Open, Options, Seams, run_with};
use lumbre_night::experiment::spec::{Order, Warmup};
use lumbre_night::experiment::{
    CellRef, Event, NightControls, NightSummary, Outcome, Plan, Sink, SinkError, StopRule,
};
use lumbre_render::Settings;
use lumbre_render::mock::MockRenderer;
use lumbre_render::{Advance, Job, RenderError, Renderer, WaveStats};

use crate::experiment::fixtures::{
    Lab, Memory, Night, Recorder, Wrapped, all_done, at, config, ints, outcomes, whole_at,
};

/// Returns three techniques at two depths.
fn lab(order: Order) -> Lab {
    let mut lab = Lab::new()
        .axis("depth", ints([2, 5]))
        .axis("technique", ["bpt", "nee", "bdpt"]);
    lab.spec.night.order = order;
    lab.spec.measure.every_s = 0.4;
    lab.configure(|p, config| {
        config.integrator = at(p, "technique").as_str().unwrap_or_default().to_owned();
        config.max_depth = Some(whole_at(p, "depth"));
    });
    lab.stop = Box::new(|_| Ok(StopRule::Samples(400)));
    lab
}

/// A machine that becomes slower with the time it has worked.
#[derive(Default)]
struct Machine {
    worked_s: Mutex<f64>,
    /// Relative slowdown per second of work.
    drift: f64,
    /// Every call of a renderer: its seed and its samples.
    calls: Mutex<Vec<(u64, u64)>>,
    /// After every call: samples of that run so far, and the number announced to follow.
    ahead: Mutex<Vec<(u64, u64)>>,
}

impl Machine {
    /// Renders with a job of this seed; `sample_s` is the time in seconds of a sample on a machine
    /// that has not worked yet.
    fn render(
        &self,
        (seed, sample_s): (u64, f64),
        mock: &mut MockRenderer,
        request: &Advance<'_>,
    ) -> Result<WaveStats, RenderError> {
        let samples = request.samples;
        let stats = mock.render(request)?;
        self.calls.lock().unwrap().push((seed, samples));
        let ahead = (mock.film().samples, request.more);
        self.ahead.lock().unwrap().push(ahead);
        let mut worked_s = self.worked_s.lock().unwrap();
        let before_s = *worked_s;
        for _ in 0..samples {
            *worked_s += sample_s * (1.0 + self.drift * *worked_s);
        }
        Ok(WaveStats {
            render_s: *worked_s - before_s,
            ..stats
        })
    }
}

/// Renders a night on a machine that slows down; a sample of `bdpt` takes three times as long as
/// one of the others.
fn night(lab: &Lab, drift: f64) -> (NightSummary, Recorder, Arc<Plan>, Arc<Machine>) {
    let machine = Arc::new(Machine {
        drift,
        ..Machine::default()
    });
    let open = |_: &str, scene, job: Job| -> Result<Box<dyn Renderer>, RenderError> {
        let sample_s = if job.integrator.name == "bdpt" {
            0.03
        } else {
            0.01
        };
        if job.integrator.name == "nee" && job.settings.rr_start == Some(7) {
            let inner = MockRenderer::new(scene, job).failing_after(10);
            return Ok(Box::new(inner));
        }
        let (machine, work) = (Arc::clone(&machine), (job.seed, sample_s));
        let mock = MockRenderer::new(scene, job);
        Ok(Box::new(Wrapped::new(mock, move |mock, request| {
            machine.render(work, mock, request)
        })))
    };
    let plan = Arc::new(lab.plan());
    let mut recorder = Recorder::default();
    let night = Night {
        open: &open,
        ..Night::default()
    };
    let summary = night.render(lab, &plan, &mut [&mut recorder]).unwrap();
    (summary, recorder, plan, machine)
}

#[test]
fn shuffled_cells_occur_once_each_in_an_order_that_the_seed_determines() {
    let lab = lab(Order::Shuffled);
    let order: Vec<usize> = lab.plan().interleave_groups(false).concat();
    assert_eq!(order.iter().collect::<BTreeSet<_>>().len(), 6);
    assert_ne!(order, (0..6).collect::<Vec<_>>());
    assert_eq!(
        order,
        lab.plan().interleave_groups(false).concat(),
        "the order must be the same in every process"
    );
    let mut other = self::lab(Order::Shuffled);
    other.spec.seed = 7;
    assert_ne!(order, other.plan().interleave_groups(false).concat());
    let coarse = Lab {
        spec: {
            let mut spec = lab.spec.clone();
            spec.repeats = 2;
            spec
        },
        ..lab
    };
    let plan = coarse.plan();
    let repeats: Vec<u32> = plan
        .interleave_groups(true)
        .concat()
        .into_iter()
        .map(|i| plan.cells[i].repeat)
        .collect();
    assert_eq!(
        repeats,
        [[0; 6], [1; 6]].concat(),
        "with a deadline, each repeat must be complete before the next begins"
    );
}

#[test]
fn techniques_of_one_picture_form_one_interleave_group() {
    let mut lab = lab(Order::Interleave);
    assert_eq!(lab.plan().interleave_groups(false), [[0, 1, 2], [3, 4, 5]]);
    assert_eq!(
        self::lab(Order::Sequential).plan().interleave_groups(false),
        [[0], [1], [2], [3], [4], [5]]
    );
    lab.spec.repeats = 2;
    assert_eq!(
        lab.plan().interleave_groups(false),
        [[0, 2, 4], [1, 3, 5], [6, 8, 10], [7, 9, 11]],
        "repeats must not be interleaved with each other"
    );
    lab.spec.repeats = 1;
    lab.render = Box::new(|_| Ok(config()));
    assert_eq!(lab.plan().interleave_groups(false).concat().len(), 6);
    assert_eq!(
        lab.plan().interleave_groups(false)[1..].concat(),
        [1, 2, 3, 4, 5],
        "six cells of one run must not be interleaved with each other"
    );
}

#[test]
fn only_techniques_differ_within_an_interleave_group() {
    type Change = fn(&mut Settings);
    let techniques: &[(&str, Change)] = &[
        ("integrator", |c| c.integrator = "nee".into()),
        ("roulette", |c| c.rr_start = Some(3)),
        ("sampler", |c| c.sampler = "sobol".into()),
    ];
    let pictures: &[(&str, Change)] = &[
        ("scene", |c| c.scene_file = "scenes/other_box.scn".into()),
        ("resolution", |c| c.resolution = Some([4, 8])),
        ("depth", |c| c.max_depth = Some(6)),
        ("filter", |c| c.filter.kind = FilterKind::Gauss),
        ("filter radius", |c| c.filter.radius = 0.75),
        ("backend", |c| c.backend = "cpu".into()),
    ];
    let groups = |change: Change| {
        let mut lab = Lab::new().axis("changed", ints([0, 1]));
        lab.spec.night.order = Order::Interleave;
        lab.configure(move |p, config| {
            if whole_at(p, "changed") == 1 {
                change(config);
            }
        });
        lab.plan().interleave_groups(false)
    };
    for (name, change) in techniques {
        assert_eq!(groups(*change), [vec![0, 1]], "{name}");
    }
    for (name, change) in pictures {
        assert_eq!(groups(*change), [[0], [1]], "{name}");
    }
}

#[test]
fn the_lookahead_covers_only_samples_that_are_requested_next() {
    let lookaheads = |order: Order| {
        let (.., machine) = night(&lab(order), 0.0);
        let ahead = machine.ahead.lock().unwrap();
        ahead.clone()
    };
    let sequential = lookaheads(Order::Sequential);
    let ends = sequential
        .iter()
        .filter(|(samples, _)| *samples == 400)
        .count();
    assert_eq!(ends, 6);
    for (samples, more) in &sequential {
        // The smoke pass renders one sample.
        assert!(
            *samples <= 1 || (*more > 0) == (*samples < 400),
            "{more} more after {samples}"
        );
        assert!(samples + more <= 400, "{more} more after {samples}");
    }
    let interleaved = lookaheads(Order::Interleave);
    assert!(
        interleaved.len() > 6 && interleaved.iter().all(|(_, more)| *more == 0),
        "no samples may be announced, since another run's turn follows: {interleaved:?}"
    );
}

#[test]
fn turns_go_to_the_run_with_the_least_render_time_and_change_no_picture() {
    let (summary, recorder, ..) = night(&lab(Order::Interleave), 0.0);
    assert!(all_done(&summary));
    // Until the first run is done, no clock of the first comparison group is more than a turn and a
    // wave ahead of another.
    let mut clocks = [0.0; 3];
    for event in &recorder.events {
        match event {
            Event::Wave {
                cell: CellRef::Cell(i),
                row,
                ..
            } if *i < 3 => clocks[*i] = row.render_s,
            Event::CellFinished { .. } => break,
            _ => {}
        }
        let (least, most) = clocks
            .iter()
            .fold((f64::MAX, 0.0f64), |(a, b), c| (a.min(*c), b.max(*c)));
        assert!(most - least <= 0.9 + 1e-9, "{clocks:?}");
    }
    assert!(clocks.iter().all(|clock| *clock > 3.0), "{clocks:?}");
    let message = &recorder.messages(Level::Info)[0];
    assert_eq!(message, "interleaving 3 techniques of one picture");
    let (_, sequential, ..) = night(&lab(Order::Sequential), 0.0);
    for i in (0..6).map(CellRef::Cell) {
        assert_eq!(recorder.film(i), sequential.film(i));
        assert_eq!(recorder.rows(i).last().unwrap().samples, 400);
        let (a, b) = (
            recorder.rows(i).last().unwrap().render_s,
            sequential.rows(i).last().unwrap().render_s,
        );
        assert!(
            (a - b).abs() < 1e-9,
            "render time must include only the turns of its run: {a} and {b}"
        );
    }
}

#[test]
fn a_machine_that_slows_down_slows_interleaved_techniques_alike() {
    let speed = |order| {
        let mut lab = lab(order);
        lab.spec.axes[1].steps.truncate(2);
        let (summary, ..) = night(&lab, 0.05);
        let rate = |i: usize| {
            let last = summary.night.runs[i].rows.last().unwrap();
            last.samples as f64 / last.render_s
        };
        rate(1) / rate(0)
    };
    assert!(
        speed(Order::Sequential) < 0.9,
        "without interleaving, the second of two equally fast techniques must measure slower"
    );
    assert!((speed(Order::Interleave) - 1.0).abs() < 0.01);
}

#[test]
fn a_failure_affects_one_run_of_a_group_and_a_skip_affects_its_first_run() {
    struct SkipDuringSecondRun<'a>(&'a NightControls, bool);
    impl Sink for SkipDuringSecondRun<'_> {
        fn receive(&mut self, event: &Event) -> Result<(), SinkError> {
            // Request a skip during the first turn of the second run.
            if matches!(
                event,
                Event::Wave {
                    cell: CellRef::Cell(1),
                    ..
                }
            ) && !std::mem::replace(&mut self.1, true)
            {
                self.0.skip.set(true);
            }
            Ok(())
        }
    }
    let mut lab = lab(Order::Interleave);
    let render = std::mem::replace(&mut lab.render, Box::new(|_| Ok(config())));
    lab.render = Box::new(move |p| {
        render(p).map(|c| Settings {
            rr_start: Some(7),
            ..c
        })
    });
    let (summary, ..) = night(&lab, 0.0);
    let outcomes: Vec<&str> = outcomes(&summary)
        .iter()
        .map(|outcome| match outcome {
            Outcome::Done(_) => "done",
            Outcome::Failed(_) => "failed",
            _ => "other",
        })
        .collect();
    assert_eq!(
        outcomes,
        ["done", "failed", "done", "done", "failed", "done"]
    );

    let lab = self::lab(Order::Interleave);
    let plan = Arc::new(lab.plan());
    let night = Night::default();
    let mut skip = SkipDuringSecondRun(&night.control, false);
    let summary = night.render(&lab, &plan, &mut [&mut skip]).unwrap();
    let night = summary.night;
    let skipped: Vec<CellRef> = night
        .all()
        .filter(|cell| night.outcome(*cell) == Some(&Outcome::Interrupted))
        .collect();
    assert_eq!(skipped, [CellRef::Cell(0)]);
}

#[test]
fn interleaved_techniques_that_exceed_the_memory_fail_with_the_reason() {
    let lab = lab(Order::Interleave);
    let plan = Arc::new(lab.plan());
    let estimate = plan.estimate(&|_| true);
    // Sums, splats of `bdpt`, and the evaluator's buffers, of 8x4 pixels.
    assert_eq!(
        (estimate.interleaved_runs, estimate.interleaved_bytes),
        (3, 32 * (3 * (48 + 80) + 96))
    );
    assert_eq!(
        self::lab(Order::Sequential)
            .plan()
            .estimate(&|_| true)
            .interleaved_bytes,
        0
    );
    let night = |memory: u64| {
        let open: Open<'_> = &|_, scene, job| Ok(Box::new(MockRenderer::new(scene, job)));
        let (seams, control) = (Seams { open, wait: &|| {} }, NightControls::default());
        let options = Options {
            memory: Some(memory),
            ..Options::from(1)
        };
        run_with(
            &seams,
            &plan,
            &lab,
            &Memory::default(),
            &mut [],
            &control,
            options,
        )
        .unwrap()
    };
    assert!(all_done(&night(estimate.interleaved_bytes)));
    for outcome in outcomes(&night(estimate.interleaved_bytes - 1)) {
        let Outcome::Failed(reason) = outcome else {
            panic!("{outcome:?}")
        };
        assert!(
            reason.contains("3 interleaved techniques") && reason.contains("interleave"),
            "{reason}"
        );
    }
}

#[test]
fn warm_up_samples_count_in_no_render_time_and_no_picture() {
    let (_, cold, _, machine) = night(&lab(Order::Sequential), 0.0);
    assert!(
        machine
            .calls
            .lock()
            .unwrap()
            .iter()
            .all(|(seed, _)| *seed == cell_seed(1, 0))
    );
    for warmup in [Warmup::Samples(37), Warmup::Time(1.0)] {
        let mut lab = lab(Order::Sequential);
        lab.spec.night.warmup = Some(warmup);
        let (_, warm, plan, machine) = night(&lab, 0.0);
        assert_eq!(
            plan.cells[0].id,
            self::lab(Order::Sequential).plan().cells[0].id,
            "warm-up must not change the run id"
        );
        for i in (0..6).map(CellRef::Cell) {
            assert_eq!(warm.film(i), cold.film(i));
            assert_eq!(warm.totals(i).last(), cold.totals(i).last());
            assert!(
                (warm.rows(i).last().unwrap().render_s - cold.rows(i).last().unwrap().render_s)
                    .abs()
                    < 1e-9
            );
        }
        let calls = machine.calls.lock().unwrap().clone();
        let discarded: u64 = calls
            .iter()
            .filter(|(seed, _)| *seed == warmup_seed())
            .map(|(_, n)| n)
            .sum();
        // A second is 100 samples of bpt and nee, 34 of bdpt.
        let expected = if warmup == Warmup::Samples(37) {
            6 * 37..=6 * 37
        } else {
            2 * 234..=2 * 240
        };
        assert!(expected.contains(&discarded), "{discarded}");
        assert_eq!(
            calls.iter().map(|(_, n)| n).sum::<u64>(),
            6 * 400 + discarded
        );
        assert_eq!(calls[0].0, warmup_seed(), "the warm-up must come first");
        assert!(
            warm.messages(Level::Info)[0].starts_with("warmed up for"),
            "{:?}",
            warm.messages(Level::Info)
        );
    }
}

/// Returns the findings of an A/A check of `bpt` with five repeats on a machine that slows down.
fn aa_checked(order: Order) -> (Vec<Finding>, Arc<Plan>) {
    let mut lab = lab(order).measured();
    lab.spec.aa_check = true;
    lab.spec.repeats = 5;
    let (summary, _, plan, _) = night(&lab, 0.002);
    (check(&plan, &summary.night), plan)
}

#[test]
fn the_aa_check_detects_a_machine_that_slows_down_unless_techniques_are_interleaved() {
    let (sequential, plan) = aa_checked(Order::Sequential);
    let doubles: Vec<_> = plan
        .cells
        .iter()
        .filter(|cell| cell.double_of.is_some())
        .collect();
    // The first technique of each of two depths, five repeats each.
    assert_eq!((plan.cells.len(), doubles.len()), (2 * 3 * 5 + 10, 10));
    assert!(
        doubles
            .iter()
            .all(|cell| cell.config.integrator == "bpt" && cell.repeat == 5 + cell.paired_repeat())
    );
    let seeds: BTreeSet<u64> = plan.cells.iter().map(|cell| cell.seed).collect();
    assert_eq!(seeds.len(), 10, "doubles must have other seeds");
    let [speed, rmse] = sequential.as_slice() else {
        panic!("{sequential:?}")
    };
    assert_eq!(
        (speed.measure.as_str(), rmse.measure.as_str(), speed.pairs),
        ("samples/s", "rmse", 10)
    );
    assert!(speed.alarm && speed.ratio < 0.99, "{speed:?}");
    assert!(
        speed.describe().contains("MORE THAN CHANCE ALLOWS"),
        "{}",
        speed.describe()
    );
    assert!(!rmse.alarm, "{rmse:?}");

    let (interleaved, plan) = aa_checked(Order::Interleave);
    assert!(
        plan.interleave_groups(false)
            .iter()
            .all(|group| group.len() == 4),
        "a double must be interleaved with its original"
    );
    assert!(
        interleaved.iter().all(|finding| !finding.alarm),
        "{interleaved:?}"
    );
    assert!((interleaved[0].ratio - 1.0).abs() < 1e-3, "{interleaved:?}");
}

#[test]
fn a_single_pair_gives_no_p_value_and_a_plan_without_a_check_no_findings() {
    let mut lab = lab(Order::Sequential);
    lab.spec.aa_check = true;
    let (mut summary, _, plan, _) = night(&lab, 0.0);
    assert!(check(&self::lab(Order::Sequential).plan(), &summary.night).is_empty());
    let findings = check(&plan, &summary.night);
    assert_eq!(
        (findings.len(), findings[0].pairs),
        (1, 2),
        "only speed is measured"
    );
    summary.night.runs.truncate(3);
    let findings = check(&plan, &summary.night);
    assert_eq!(findings.len(), 1);
    assert!(
        findings[0].p.is_none() && findings[0].describe().contains("too few to judge by"),
        "{findings:?}"
    );
}
