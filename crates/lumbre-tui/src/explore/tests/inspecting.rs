//! The pixel inspector: keys, and what it finds while a picture renders.

use super::program::{explorer, screen, send, wait_for_samples};
use super::{character, facts, key, scene, wait_until};
use crate::explore::explorer::Explorer;
use crate::explore::input::{Command, Input, PictureArea};
use crate::explore::inspect::Inspection;
use crate::explore::settings::Settings;
use crate::explore::state::State;
use crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers};
use std::sync::Arc;

fn state() -> State {
    State {
        scene: Some(scene("cornell")),
        facts: Some(facts()),
        settings: Settings::new(&[]),
        resolution: [30, 20],
        ..State::default()
    }
}

fn send_key(state: &mut State, event: &Event) -> Option<Command> {
    Input::default().event(event, state, PictureArea::default())
}

#[test]
fn the_arrows_move_the_inspected_pixel_and_change_no_setting() {
    let mut state = state();
    let settings = state.settings.clone();
    assert_eq!(state.target(), None);
    send_key(&mut state, &character('i'));
    assert_eq!(state.target().unwrap().pixel, [15, 10]);
    for code in [KeyCode::Left, KeyCode::Up, KeyCode::Up] {
        assert_eq!(send_key(&mut state, &key(code)), None);
    }
    assert_eq!(state.cursor, Some([14, 8]));
    let far = Event::Key(KeyEvent::new(KeyCode::Right, KeyModifiers::SHIFT));
    for _ in 0..3 {
        send_key(&mut state, &far);
    }
    assert_eq!(state.cursor, Some([29, 8]), "the border stops it");
    for c in "nnN".chars() {
        send_key(&mut state, &character(c));
    }
    assert_eq!(state.target().unwrap().sample, 1);
    assert_eq!(state.settings, settings);
    // In the window the arrows scroll.
    send_key(&mut state, &key(KeyCode::Enter));
    send_key(&mut state, &key(KeyCode::Down));
    let inspector = state.inspector.clone().unwrap();
    assert_eq!((inspector.window, inspector.scroll), (true, 1));
    send_key(&mut state, &key(KeyCode::Esc));
    assert!(state.inspector.as_ref().is_some_and(|known| !known.window));
    assert_eq!(send_key(&mut state, &key(KeyCode::Esc)), None);
    assert!(state.inspector.is_none());
    assert_eq!(
        send_key(&mut state, &character('t')),
        Some(Command::Restart)
    );
}

/// Waits until the present target was inspected.
fn inspected(explorer: &mut Explorer) -> Arc<Inspection> {
    let mut found = None;
    wait_until("the inspection", || {
        explorer.poll();
        let state = &explorer.state;
        let target = state.target();
        found = state
            .inspector
            .as_ref()
            .and_then(|known| known.found.clone())
            .filter(|found| Some(found.target) == target);
        found.is_some()
    });
    found.unwrap()
}

#[test]
fn a_pixel_shows_its_surface_its_lobe_and_the_steps_of_a_sample() {
    let folder = tempfile::tempdir().unwrap();
    let mut explorer = explorer(folder.path());
    send(&mut explorer, "spheres");
    explorer.event(&key(KeyCode::Enter));
    wait_for_samples(&mut explorer, 4);
    send(&mut explorer, "i");
    let found = inspected(&mut explorer);
    let surface = found.surface.as_ref().expect("the middle shows the box");
    assert!(!surface.material.is_empty() && surface.distance > 0.0);
    assert!(surface.lobe.as_ref().is_some_and(|lobe| lobe.albedo > 0.0));
    assert!(!found.steps.is_empty() && found.rays > 0);
    assert!(found.steps[0].starts_with("ray "), "{:?}", found.steps);
    // The light of all samples of a pixel adds up to its value.
    let frame = explorer.current(explorer.state.side).unwrap();
    let pixel = found.target.pixel;
    let mut sum = 0.0;
    for sample in 0..frame.samples.min(64) {
        explorer.state.inspector.as_mut().unwrap().sample = sample;
        let found = inspected(&mut explorer);
        let light: f32 = found.depths.iter().map(|(_, rgb)| rgb[1]).sum();
        sum += f64::from(light);
    }
    if frame.samples <= 64 {
        let mean = f64::from(frame.image.at(pixel[0], pixel[1])[1]);
        let traced = sum / frame.samples as f64;
        assert!(
            (traced - mean).abs() <= 1e-4 * mean.abs(),
            "{traced} {mean}"
        );
    }
    let text = screen(&explorer);
    assert!(
        text.contains("std. error") && text.contains("variance of a sample"),
        "{text}"
    );
    explorer.event(&key(KeyCode::Enter));
    let text = screen(&explorer);
    assert!(
        text.contains("f cos") && text.contains("Sampled directions"),
        "{text}"
    );
    explorer.event(&key(KeyCode::Enter));
    send(&mut explorer, "i");
    assert!(!screen(&explorer).contains("std. error"));
}
