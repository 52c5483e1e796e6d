//! Keys and the mouse as changes of the state.

use crossterm::event::{Event, KeyCode, KeyModifiers, MouseButton, MouseEvent, MouseEventKind};
use ratatui::layout::Rect;

use super::{character, facts, key, scene};
use crate::explore::input::{Command, Input, PictureArea};
use crate::explore::parameters::{Group, parameters};
use crate::explore::picker::SceneList;
use crate::explore::settings::Settings;
use crate::explore::state::{Overlay, State};
use lumbre_light::transport::integrator::{INTEGRATORS, integrator};
use lumbre_light::value::Value;

const AREA: PictureArea = PictureArea {
    pane: Rect::new(1, 2, 40, 20),
    tiles: [Rect::new(1, 2, 40, 20), Rect::ZERO],
    resolution: [40, 40],
};

/// A state with a loaded scene, and its input.
struct Fixture {
    state: State,
    input: Input,
}

impl Fixture {
    fn new() -> Fixture {
        Fixture {
            state: State {
                scene: Some(scene("cornell")),
                facts: Some(facts()),
                settings: Settings::new(&[]),
                resolution: AREA.resolution,
                ..State::default()
            },
            input: Input::default(),
        }
    }

    fn send(&mut self, event: &Event) -> Option<Command> {
        self.input.event(event, &mut self.state, AREA)
    }

    fn press(&mut self, c: char) -> Option<Command> {
        self.send(&character(c))
    }

    fn type_text(&mut self, text: &str) {
        for c in text.chars() {
            self.press(c);
        }
    }

    fn mouse(&mut self, kind: MouseEventKind, column: u16, row: u16) -> Option<Command> {
        self.send(&Event::Mouse(MouseEvent {
            kind,
            column,
            row,
            modifiers: KeyModifiers::NONE,
        }))
    }

    fn value(&self, path: &str) -> Option<String> {
        self.state.settings.get(path).map(Value::to_string)
    }
}

#[test]
fn every_parameter_of_every_technique_has_a_row() {
    for row in INTEGRATORS {
        let rows = parameters(row, &["side".to_owned()], "reinhard");
        for field in row.params.fields {
            let found = rows.iter().find(|known| known.path == field.key);
            assert_eq!(
                found.map(|row| row.group),
                Some(Group::Technique),
                "{}",
                field.key
            );
        }
        for path in [
            "integrator",
            "max_depth",
            "rr.start",
            "sampler",
            "aa.radius",
            "camera.aperture",
            "view",
            "films",
            "display.gamma",
            "limit.samples",
        ] {
            assert!(rows.iter().any(|row| row.path == path), "{path}");
        }
    }
    let nee = integrator("nee").unwrap();
    assert!(
        parameters(nee, &[], "srgb")
            .iter()
            .all(|row| row.path != "view")
    );
}

#[test]
fn a_step_changes_names_and_numbers_and_backspace_restores_the_default() {
    let mut fixture = Fixture::new();
    let nee = INTEGRATORS
        .iter()
        .position(|row| row.name == "nee")
        .unwrap();
    assert_eq!(fixture.press('t'), Some(Command::Restart));
    assert_eq!(
        fixture.value("integrator").as_deref(),
        Some(INTEGRATORS[nee + 1].name)
    );
    fixture.press('T');
    assert_eq!(fixture.value("integrator").as_deref(), Some("nee"));
    fixture.state.select("max_depth");
    assert_eq!(fixture.send(&key(KeyCode::Right)), Some(Command::Restart));
    assert_eq!(fixture.value("max_depth").as_deref(), Some("7"));
    fixture.state.select("mis");
    fixture.send(&key(KeyCode::Right));
    assert_eq!(fixture.value("mis").as_deref(), Some("balance"));
    assert_eq!(
        fixture.send(&key(KeyCode::Backspace)),
        Some(Command::Restart)
    );
    assert_eq!(fixture.value("mis"), None);
    fixture.state.select("rr.start");
    assert_eq!(fixture.send(&key(KeyCode::Left)), None);
    fixture.send(&key(KeyCode::Right));
    assert_eq!(fixture.value("rr.start").as_deref(), Some("1"));
    fixture.send(&key(KeyCode::Left));
    assert_eq!(
        fixture.value("rr.start"),
        None,
        "below the smallest value is the default"
    );
}

#[test]
fn strategies_are_chosen_in_order_of_path_length() {
    let mut fixture = Fixture::new();
    fixture
        .state
        .settings
        .put("integrator", Some("bdpt".into()));
    fixture.state.select("strategies");
    let mut seen = Vec::new();
    for _ in 0..6 {
        fixture.send(&key(KeyCode::Right));
        seen.push(fixture.value("strategies").unwrap());
    }
    assert_eq!(
        seen,
        ["[0, 2]", "[1, 1]", "[0, 3]", "[1, 2]", "[2, 1]", "[0, 4]"]
    );
    for _ in 0..6 {
        fixture.send(&key(KeyCode::Left));
    }
    assert_eq!(fixture.value("strategies"), None, "all strategies");
}

#[test]
fn typed_values_are_checked_against_the_schema() {
    let mut fixture = Fixture::new();
    fixture.state.select("camera.fov");
    fixture.send(&key(KeyCode::Enter));
    assert_eq!(fixture.state.overlay, Overlay::Edit("45".to_owned()));
    fixture.type_text("000");
    assert_eq!(fixture.send(&key(KeyCode::Enter)), None);
    let message = fixture.state.message.clone().unwrap();
    assert!(
        message.failed && message.text.contains("179"),
        "{message:?}"
    );
    for _ in 0..3 {
        fixture.send(&key(KeyCode::Backspace));
    }
    assert_eq!(fixture.send(&key(KeyCode::Enter)), Some(Command::Restart));
    assert_eq!(fixture.value("camera.fov").as_deref(), Some("45"));
    fixture.state.select("camera.position");
    fixture.send(&key(KeyCode::Enter));
    for _ in 0..20 {
        fixture.send(&key(KeyCode::Backspace));
    }
    fixture.type_text("1 2 3.5");
    assert_eq!(fixture.send(&key(KeyCode::Enter)), Some(Command::Restart));
    assert_eq!(
        fixture.value("camera.position").as_deref(),
        Some("[1, 2, 3.5]")
    );
}

#[test]
fn exposure_and_limits_do_not_restart_the_picture() {
    let mut fixture = Fixture::new();
    assert_eq!(fixture.press('E'), None);
    assert_eq!(fixture.value("display.exposure").as_deref(), Some("0.25"));
    assert_eq!(fixture.press('e'), None);
    fixture.state.select("limit.samples");
    assert_eq!(fixture.send(&key(KeyCode::Right)), Some(Command::Limits));
    assert_eq!(fixture.state.settings.limits().samples, Some(1));
    assert_eq!(fixture.press(' '), Some(Command::Pause));
    assert!(fixture.state.paused);
}

#[test]
fn the_mouse_moves_the_camera() {
    let left = MouseButton::Left;
    let mut fixture = Fixture::new();
    assert_eq!(
        fixture.mouse(MouseEventKind::ScrollUp, 10, 10),
        Some(Command::Restart)
    );
    assert_eq!(
        fixture.value("camera.position").as_deref(),
        Some("[0, 0, 3.6]")
    );
    assert_eq!(
        fixture.mouse(MouseEventKind::ScrollUp, 60, 10),
        None,
        "outside the picture"
    );
    fixture.mouse(MouseEventKind::Down(left), 10, 10);
    assert_eq!(
        fixture.mouse(MouseEventKind::Drag(left), 14, 10),
        Some(Command::Restart)
    );
    assert_eq!(fixture.mouse(MouseEventKind::Up(left), 14, 10), None);
    assert_eq!(fixture.state.cursor, None, "a drag is no click");
    assert_ne!(
        fixture.value("camera.position").as_deref(),
        Some("[0, 0, 3.6]")
    );
    assert_eq!(fixture.press('0'), Some(Command::Restart));
    assert_eq!(fixture.value("camera.position"), None);
}

#[test]
fn a_click_selects_a_pixel_and_the_right_button_focuses_on_it() {
    let mut fixture = Fixture::new();
    assert_eq!(fixture.press('g'), None);
    for (button, command) in [
        (MouseButton::Left, None),
        (MouseButton::Right, Some(Command::Focus([9, 17]))),
    ] {
        fixture.mouse(MouseEventKind::Down(button), 10, 10);
        assert_eq!(fixture.mouse(MouseEventKind::Up(button), 10, 10), command);
        assert_eq!(fixture.state.cursor, Some([9, 17]));
    }
    assert_eq!(fixture.press('g'), Some(Command::Focus([9, 17])));
}

#[test]
fn a_scene_is_picked_by_typing() {
    let mut fixture = Fixture::new();
    fixture.state.scenes = SceneList::new(
        ["cornell", "edges", "veach_lamps"].map(scene).into(),
        std::path::PathBuf::from("no such folder"),
    );
    fixture.press('o');
    fixture.type_text("veach");
    assert_eq!(fixture.send(&key(KeyCode::Enter)), Some(Command::Open));
    assert_eq!(fixture.state.scene, Some(scene("veach_lamps")));
    assert_eq!(fixture.state.facts, None);
    assert_eq!(fixture.state.overlay, Overlay::None);
    fixture.press('o');
    assert_eq!(fixture.send(&key(KeyCode::Esc)), None);
    fixture.press('?');
    assert_eq!(fixture.state.overlay, Overlay::Help(0));
    fixture.press('?');
    // A key too many must not end it.
    assert_eq!(fixture.send(&key(KeyCode::Esc)), None);
    assert_eq!(fixture.press('q'), Some(Command::Quit));
}
