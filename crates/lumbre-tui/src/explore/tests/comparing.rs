//! Comparison of two settings and errors against a frozen picture: state and program.

use std::sync::Arc;

use super::program::{explorer, screen, send, wait_for_samples};
use super::{character, facts, key, scene, wait_until};
use crate::explore::explorer::Explorer;
use crate::explore::input::{Command, Input, PictureArea};
use crate::explore::reference::{
    Curves, FloorDistance, Mismatch, Reference, floor_distance, label, metrics,
};
use crate::explore::session::{Frame, Slot};
use crate::explore::settings::Settings;
use crate::explore::state::State;
use crossterm::event::KeyCode;
use lumbre_light::film::Image;
use lumbre_light::value::Value;
use lumbre_night::experiment::WaveRow;

/// Returns a frame whose first and second samples are the given values in every pixel.
fn frame(values: [f32; 2], samples: [u64; 2]) -> Frame {
    let flat = |x: f32| Arc::new(Image::from_fn(16, 12, |_, _| [x; 3]));
    let all = samples[0] + samples[1];
    let mean = (values[0] * samples[0] as f32 + values[1] * samples[1] as f32) / all as f32;
    Frame {
        image: flat(mean),
        samples: all,
        render_s: 1.0,
        paths: 1,
        rays: 1,
        invalid: 0,
        noise: None,
        variance: None,
        part: Some((flat(values[0]), samples[0])),
        layers: Vec::new(),
    }
}

fn state() -> State {
    State {
        scene: Some(scene("cornell")),
        facts: Some(facts()),
        settings: Settings::new(&[]),
        resolution: [16, 12],
        ..State::default()
    }
}

fn press(state: &mut State, keys: &str) -> Option<Command> {
    let mut input = Input::default();
    let mut last = None;
    for c in keys.chars() {
        last = input.event(&character(c), state, PictureArea::default());
    }
    last
}

fn reference(state: &State) -> Reference {
    Reference {
        number: 1,
        frame: Arc::new(frame([1.0, 2.0], [3, 5])),
        scene: state.scene.clone().unwrap(),
        settings: state.settings.clone(),
    }
}

#[test]
fn the_key_starts_a_comparison_and_then_switches_the_edited_side() {
    let mut state = state();
    assert_eq!(press(&mut state, "v"), None);
    assert!(state.message.as_ref().unwrap().failed);
    assert_eq!(press(&mut state, "c"), Some(Command::Restart));
    assert_eq!((state.side, state.visible().len()), (Slot::B, 2));
    assert_eq!(press(&mut state, "t"), Some(Command::Restart));
    let edited = state.settings.technique().name;
    assert_eq!(press(&mut state, "c"), None, "A has its picture already");
    assert_eq!(state.side, Slot::A);
    assert_ne!(state.settings.technique().name, edited);
    let other = state.settings_of(Slot::B).unwrap();
    assert_eq!((other.technique().name, other.seed()), (edited, 1));
    press(&mut state, "v");
    assert_eq!(state.visible().len(), 1);
    assert_eq!(press(&mut state, "C"), Some(Command::EndComparison));
    assert_eq!((state.side, state.visible().len()), (Slot::A, 1));
    assert_eq!(press(&mut state, "C"), None);
}

#[test]
fn both_sides_follow_the_camera_and_a_setting_changes_one() {
    let mut state = state();
    press(&mut state, "c");
    assert_eq!(press(&mut state, "d"), Some(Command::RestartAll));
    let [a, b] = Slot::ALL.map(|slot| state.settings_of(slot).unwrap().view());
    assert_eq!(a, b);
    assert!(!a.is_empty());
    state.select("max_depth");
    let right = key(KeyCode::Right);
    let command = Input::default().event(&right, &mut state, PictureArea::default());
    assert_eq!(command, Some(Command::Restart));
    assert_eq!(press(&mut state, "0"), Some(Command::RestartAll));
}

#[test]
fn the_metric_goes_round_the_table() {
    let mut state = state();
    assert_eq!(press(&mut state, "M"), Some(Command::Metric));
    assert_eq!(state.metric, metrics().len() - 1);
    press(&mut state, "mmm");
    assert_eq!(metrics()[state.metric].column, "mae");
}

#[test]
fn a_reference_never_shares_its_seed_or_another_view() {
    let mut state = state();
    press(&mut state, "c");
    let frozen = reference(&state);
    // B had the seed 1, A has 0.
    assert_eq!(state.freeze(frozen), [Slot::B]);
    let seeds = Slot::ALL.map(|slot| state.settings_of(slot).unwrap().seed());
    assert_eq!(seeds, [0, 2]);
    assert_eq!(Slot::ALL.map(|slot| state.mismatch(slot)), [None, None]);
    state.settings.put("seed", Some(Value::Int(1)));
    assert_eq!(state.mismatch(Slot::B), Some(Mismatch::Seed));
    press(&mut state, "w");
    assert_eq!(
        Slot::ALL.map(|slot| state.mismatch(slot)),
        [Some(Mismatch::View); 2]
    );
    press(&mut state, "0");
    let change = ("materials.white.roughness".to_owned(), Value::Num(0.5));
    state.settings.set.extend([change]);
    assert_eq!(
        state.mismatch(Slot::B),
        Some(Mismatch::View),
        "the scene has another material"
    );
    state.settings.set.clear();
    state.resolution = [17, 12];
    assert_eq!(state.mismatch(Slot::A), Some(Mismatch::View));
}

#[test]
fn the_floor_is_that_of_the_two_parts_of_the_samples() {
    let state = state();
    let reference = reference(&state);
    let (means, samples) = reference.frame.halves().unwrap();
    assert_eq!(samples, [3, 5]);
    assert_eq!(means.map(|image| image.at(0, 0)[0]), [1.0, 2.0]);
    // D = (A - B) sqrt(15) / 8 in every pixel.
    let floor = reference.floors(&metrics())[1].unwrap();
    assert!((floor - 15f64.sqrt() / 8.0).abs() < 1e-6, "{floor}");
    let rmse = &metrics()[1];
    for (value, expected) in [
        (2.1, FloorDistance::Far),
        (1.9, FloorDistance::Near),
        (1.4, FloorDistance::AtFloor),
    ] {
        assert_eq!(floor_distance(rmse, value, Some(1.0)), expected, "{value}");
    }
    assert_eq!(floor_distance(rmse, 0.1, None), FloorDistance::Far);
}

#[test]
fn curves_are_named_by_what_differs_and_keep_their_colours() {
    let mut settings = Settings::new(&[]);
    let base = settings.clone();
    assert_eq!(label(&settings, &base), "nee");
    settings.put("max_depth", Some(Value::Int(3)));
    settings.put("seed", Some(Value::Int(9)));
    settings.put("display.exposure", Some(Value::Int(1)));
    assert_eq!(label(&settings, &base), "nee max_depth=3");
    assert_eq!(label(&base, &settings), "nee max_depth=default");
    let mut curves = Curves::default();
    let row = |samples| WaveRow {
        samples,
        ..WaveRow::default()
    };
    for request in 1..=8 {
        curves.begin(Slot::A, request, format!("setting {request}"));
        curves.push(Slot::A, request, row(4));
        // Neither an older picture nor a dropped request adds a point.
        curves.push(Slot::A, request, row(3));
        curves.push(Slot::B, request, row(5));
    }
    assert_eq!(curves.list().len(), 6);
    let mut colours: Vec<usize> = curves.list().iter().map(|known| known.colour).collect();
    colours.sort_unstable();
    assert_eq!(colours, [0, 1, 2, 3, 4, 5]);
    curves.begin(Slot::A, 9, "setting 8".to_owned());
    assert_eq!(
        (curves.list().len(), curves.of(Slot::A, 8).is_none()),
        (6, true)
    );
    curves.begin(Slot::A, 10, "setting 10".to_owned());
    assert!(curves.of(Slot::A, 9).is_none(), "it had no measurement");
    assert_eq!(curves.of(Slot::A, 10).unwrap().curve.rows().len(), 0);
}

fn until(explorer: &mut Explorer, what: &str, holds: impl Fn(&Explorer) -> bool) {
    wait_until(what, || {
        explorer.poll();
        holds(explorer)
    });
}

#[test]
fn a_comparison_and_a_reference_are_measured_while_they_render() {
    let folder = tempfile::tempdir().unwrap();
    let mut explorer = explorer(folder.path());
    explorer.event(&key(KeyCode::Enter));
    wait_for_samples(&mut explorer, 2);
    send(&mut explorer, "ct");
    until(&mut explorer, "the difference", |explorer| {
        let known = explorer.state.difference.as_ref();
        known.is_some_and(|known| known.noise.is_some_and(|noise| noise > 0.0))
    });
    let text = screen(&explorer);
    assert!(
        text.contains("rmse A to B: ") && text.contains("rmse of noise alone"),
        "{text}"
    );
    // Both have about the same time: a wave takes some hundredths of a second.
    let times = Slot::ALL.map(|slot| explorer.current(slot).map(|frame| frame.render_s));
    if let [Some(a), Some(b)] = times {
        assert!((a - b).abs() < 1.0, "{a} {b}");
    }
    send(&mut explorer, "f");
    assert!(!explorer.state.message.as_ref().unwrap().failed);
    let resolution = explorer.state.resolution;
    until(&mut explorer, "the curves", |explorer| {
        let measured = |slot| {
            let known = explorer.state.curve(slot);
            known.is_some_and(|known| known.curve.rows().len() > 1)
        };
        Slot::ALL.into_iter().all(measured) && !explorer.state.floors.is_empty()
    });
    assert!(explorer.state.floors[1].is_some_and(|floor| floor > 0.0));
    assert!(screen(&explorer).contains("╭ rmse"));
    // The size of the picture stays, so that it can still be measured.
    explorer.event(&key(KeyCode::Tab));
    assert_eq!(explorer.state.resolution, resolution);
    send(&mut explorer, "F");
    assert!(explorer.state.reference.is_none() && explorer.state.resolution != resolution);
    send(&mut explorer, "C");
    assert_eq!(explorer.state.visible().len(), 1);
}
