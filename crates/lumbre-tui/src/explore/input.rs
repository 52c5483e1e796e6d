//! Keys and the mouse: changes of the state, and commands for the session.

use crossterm::event::{
    Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers, MouseButton, MouseEvent, MouseEventKind,
};
use ratatui::layout::Rect;

use super::camera::{self, Motion};
use super::parameters::{EXPOSURE, INTEGRATOR, Step};
use super::picker::Picker;
use super::state::{Overlay, State};
use crate::tui::modes::ChartX;

/// Rotation of the camera by one key press, in radians.
const TURN: f32 = 0.1;
/// Rotation of the camera by one column or row of a drag, in radians.
const DRAG_TURN: f32 = 0.03;
/// Translation of the camera by one key press, in units of its distance to the target.
const SHIFT: f32 = 0.05;
/// Factor of the distance to the target for one key press or one step of the wheel.
const NEARER: f32 = 0.9;

/// An action that follows from an event.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Command {
    /// Render the edited picture anew with its current settings.
    Restart,
    /// Render both pictures anew.
    RestartAll,
    /// End the comparison.
    EndComparison,
    /// Measure with the selected metric.
    Metric,
    /// Make the picture the reference.
    Freeze,
    /// Remove the reference.
    Unfreeze,
    /// Apply the limits.
    Limits,
    /// Pause or resume.
    Pause,
    /// Load the scene of the state, and render it.
    Open,
    /// Write the picture to files.
    Save,
    /// Write the settings as an experiment.
    WriteScript,
    /// Focus on what the pixel shows.
    Focus([u32; 2]),
    /// Leave the program.
    Quit,
}

/// Position of the picture on the screen, for the mouse.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PictureArea {
    /// Cells of the whole pane, without its border.
    pub pane: Rect,
    /// Cells of the visible pictures; the second one is empty if there is only one.
    pub tiles: [Rect; 2],
    /// Width and height of the pictures in pixels.
    pub resolution: [u32; 2],
}

impl PictureArea {
    /// Returns the pixel in the middle of a cell, if a picture covers it.
    pub fn pixel(&self, column: u16, row: u16) -> Option<[u32; 2]> {
        let covers = |cells: &&Rect| cells.contains((column, row).into());
        let cells = self.tiles.iter().find(covers)?;
        let scale = |offset: u16, cells: u16, pixels: u32| {
            (((f64::from(offset) + 0.5) / f64::from(cells) * f64::from(pixels)) as u32)
                .min(pixels.saturating_sub(1))
        };
        Some([
            scale(column - cells.x, cells.width, self.resolution[0]),
            scale(row - cells.y, cells.height, self.resolution[1]),
        ])
    }
}

/// A button that is held down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Drag {
    button: MouseButton,
    at: [u16; 2],
    moved: bool,
}

/// Input with the state of the mouse.
#[derive(Clone, Debug, Default)]
pub struct Input {
    drag: Option<Drag>,
}

impl Input {
    /// Applies an event to the state, and returns what else has to be done.
    pub fn event(
        &mut self,
        event: &Event,
        state: &mut State,
        picture: PictureArea,
    ) -> Option<Command> {
        match event {
            Event::Key(key) if key.kind != KeyEventKind::Release => {
                state.message = None;
                key_pressed(*key, state)
            }
            Event::Mouse(mouse) if state.overlay == Overlay::None => {
                self.mouse(*mouse, state, picture)
            }
            _ => None,
        }
    }

    fn mouse(
        &mut self,
        mouse: MouseEvent,
        state: &mut State,
        picture: PictureArea,
    ) -> Option<Command> {
        let at = [mouse.column, mouse.row];
        let pixel = picture.pixel(mouse.column, mouse.row);
        match mouse.kind {
            MouseEventKind::ScrollUp => pixel.and_then(|_| moved(state, Motion::Dolly(NEARER))),
            MouseEventKind::ScrollDown => {
                pixel.and_then(|_| moved(state, Motion::Dolly(1.0 / NEARER)))
            }
            MouseEventKind::Down(button) => {
                self.drag = pixel.map(|_| Drag {
                    button,
                    at,
                    moved: false,
                });
                None
            }
            MouseEventKind::Drag(_) => {
                let drag = self.drag.as_mut()?;
                let by = [0, 1].map(|i| f32::from(at[i]) - f32::from(drag.at[i]));
                (drag.at, drag.moved) = (at, true);
                // A row of characters is as high as two columns are wide.
                let [x, y] = [by[0], 2.0 * by[1]];
                let pans = drag.button == MouseButton::Right
                    || mouse.modifiers.contains(KeyModifiers::SHIFT);
                moved(
                    state,
                    if pans {
                        let width = f32::from(picture.tiles[0].width.max(1));
                        Motion::Pan([-x / width, y / width])
                    } else {
                        Motion::Orbit([-DRAG_TURN * x, DRAG_TURN * y])
                    },
                )
            }
            MouseEventKind::Up(button) => {
                let drag = self.drag.take()?;
                if drag.moved {
                    return None;
                }
                state.cursor = pixel;
                (button == MouseButton::Right).then(|| pixel.map(Command::Focus))?
            }
            _ => None,
        }
    }
}

/// Gives both sides of a comparison the same view. Returns what has to be rendered after a change
/// of the edited side.
fn changed(state: &mut State) -> Option<Command> {
    let both = match &mut state.comparison {
        Some(comparison) => comparison.share_view(&state.settings),
        None => false,
    };
    Some(if both {
        Command::RestartAll
    } else {
        Command::Restart
    })
}

/// Moves the camera.
fn moved(state: &mut State, motion: Motion) -> Option<Command> {
    let facts = state.facts.as_ref()?;
    let now = state.settings.camera(facts).ok()?;
    let next = camera::moved(&now, motion);
    state.settings.set_camera(facts, &next).ok()?;
    changed(state)
}

fn key_pressed(key: KeyEvent, state: &mut State) -> Option<Command> {
    if key.modifiers.contains(KeyModifiers::CONTROL) && key.code == KeyCode::Char('c') {
        return Some(Command::Quit);
    }
    match std::mem::take(&mut state.overlay) {
        Overlay::None if inspector_key(key, state) => None,
        Overlay::None => panel_key(key, state),
        Overlay::Help(first) => {
            // Other keys close the list.
            state.overlay = match key.code {
                KeyCode::Down => Overlay::Help(first + 1),
                KeyCode::Up => Overlay::Help(first.saturating_sub(1)),
                _ => Overlay::None,
            };
            None
        }
        Overlay::Picker(picker) => picker_key(key, state, picker),
        Overlay::Edit(text) => edit_key(key, state, text),
    }
}

/// Handles the keys of the inspector while it is open. Returns whether the key is one of them.
fn inspector_key(key: KeyEvent, state: &mut State) -> bool {
    let Some(inspector) = &mut state.inspector else {
        return false;
    };
    let far = if key.modifiers.contains(KeyModifiers::SHIFT) {
        10
    } else {
        1
    };
    match key.code {
        KeyCode::Enter => inspector.window = !inspector.window,
        KeyCode::Esc if inspector.window => inspector.window = false,
        KeyCode::Esc => state.toggle_inspector(),
        KeyCode::Up if inspector.window => inspector.scroll = inspector.scroll.saturating_sub(1),
        KeyCode::Down if inspector.window => inspector.scroll += 1,
        KeyCode::Char('n') => (inspector.sample, inspector.scroll) = (inspector.sample + 1, 0),
        KeyCode::Char('N') => {
            inspector.sample = inspector.sample.saturating_sub(1);
            inspector.scroll = 0;
        }
        KeyCode::Up => state.move_cursor([0, -far]),
        KeyCode::Down => state.move_cursor([0, far]),
        KeyCode::Left => state.move_cursor([-far, 0]),
        KeyCode::Right => state.move_cursor([far, 0]),
        _ => return false,
    }
    true
}

fn picker_key(key: KeyEvent, state: &mut State, mut picker: Picker) -> Option<Command> {
    match key.code {
        KeyCode::Esc if state.scene.is_none() => return Some(Command::Quit),
        KeyCode::Esc => return None,
        KeyCode::Enter => {
            if let Some(scene) = picker.chosen().cloned() {
                open(state, scene);
                return Some(Command::Open);
            }
        }
        KeyCode::Up => picker.select(-1),
        KeyCode::Down => picker.select(1),
        KeyCode::PageUp => picker.select(-10),
        KeyCode::PageDown => picker.select(10),
        KeyCode::Backspace => {
            let mut filter = picker.filter.clone();
            filter.pop();
            picker.set_filter(filter);
        }
        KeyCode::Char(c) => picker.set_filter(format!("{}{c}", picker.filter)),
        _ => {}
    }
    state.overlay = Overlay::Picker(picker);
    None
}

/// Opens a scene. Settings stay, but for the camera and other changes of the scene.
pub fn open(state: &mut State, scene: super::settings::SceneFile) {
    if state.scene.as_ref() != Some(&scene) && state.scene.is_some() {
        let other = state.comparison.as_mut();
        let other = other.map(|comparison| &mut comparison.other);
        for settings in [Some(&mut state.settings), other].into_iter().flatten() {
            settings.put("view", None);
            settings.set.clear();
        }
    }
    state.scene = Some(scene);
    state.facts = None;
    state.cursor = None;
}

fn edit_key(key: KeyEvent, state: &mut State, mut text: String) -> Option<Command> {
    match key.code {
        KeyCode::Esc => return None,
        KeyCode::Enter => {
            let parameter = state.selected()?;
            if text.trim().is_empty() {
                return put(state, &parameter.path, None);
            }
            match parameter.parse(&text) {
                Ok(value) => return put(state, &parameter.path, Some(value)),
                Err(reason) => state.fail(reason),
            }
        }
        KeyCode::Backspace => {
            text.pop();
        }
        KeyCode::Char(c) => text.push(c),
        _ => {}
    }
    state.overlay = Overlay::Edit(text);
    None
}

/// Sets a value. Returns what follows from it.
fn put(
    state: &mut State,
    path: &str,
    value: Option<lumbre_light::value::Value>,
) -> Option<Command> {
    state.settings.put(path, value);
    // Other techniques have other rows: the selected one stays selected.
    state.select(path);
    match path.split('.').next() {
        Some("display") => None,
        Some("limit") => Some(Command::Limits),
        _ => changed(state),
    }
}

fn panel_key(key: KeyEvent, state: &mut State) -> Option<Command> {
    let far = key.modifiers.contains(KeyModifiers::SHIFT);
    match key.code {
        KeyCode::Up => state.row = state.row.saturating_sub(1),
        KeyCode::Down => {
            let last = state.parameters().len().saturating_sub(1);
            state.row = (state.row + 1).min(last);
        }
        KeyCode::PageUp | KeyCode::PageDown => next_group(state, key.code == KeyCode::PageDown),
        KeyCode::Left => return step(state, if far { Step::FarDown } else { Step::Down }),
        KeyCode::Right => return step(state, if far { Step::FarUp } else { Step::Up }),
        KeyCode::Enter => {
            let parameter = state.selected()?;
            if !parameter.is_typed() {
                return step(state, Step::Up);
            }
            let value = state.settings.get(&parameter.path).cloned();
            let shown = value.or_else(|| state.default_of(&parameter));
            state.overlay = Overlay::Edit(shown.as_ref().map_or_else(String::new, plain_text));
        }
        KeyCode::Backspace | KeyCode::Delete => {
            let parameter = state.selected()?;
            if parameter.path == INTEGRATOR {
                return None;
            }
            return put(state, &parameter.path, None);
        }
        KeyCode::Tab => state.panel_hidden = !state.panel_hidden,
        // It closes overlays, so that one key too many must not cost a frozen reference.
        KeyCode::Esc => state.fail("q quits"),
        KeyCode::Char(c) => return character(c, state),
        _ => {}
    }
    None
}

/// Returns a value as it is typed.
fn plain_text(value: &lumbre_light::value::Value) -> String {
    match value.as_list() {
        Some(items) => {
            let items: Vec<String> = items.iter().map(ToString::to_string).collect();
            items.join(" ")
        }
        None => value.to_string(),
    }
}

/// Returns the motion of the camera that a key stands for.
fn motion(c: char) -> Option<Motion> {
    Some(match c {
        'w' => Motion::Orbit([0.0, TURN]),
        's' => Motion::Orbit([0.0, -TURN]),
        'a' => Motion::Orbit([-TURN, 0.0]),
        'd' => Motion::Orbit([TURN, 0.0]),
        'W' => Motion::Pan([0.0, SHIFT]),
        'S' => Motion::Pan([0.0, -SHIFT]),
        'A' => Motion::Pan([-SHIFT, 0.0]),
        'D' => Motion::Pan([SHIFT, 0.0]),
        '+' | '=' => Motion::Dolly(NEARER),
        '-' => Motion::Dolly(1.0 / NEARER),
        _ => return None,
    })
}

fn character(c: char, state: &mut State) -> Option<Command> {
    if let Some(motion) = motion(c) {
        return moved(state, motion);
    }
    match c {
        '0' => {
            state.settings.reset_camera();
            changed(state)
        }
        'g' => match state.cursor {
            Some(pixel) => Some(Command::Focus(pixel)),
            None => {
                state.fail("click a point of the picture first");
                None
            }
        },
        't' | 'T' => {
            state.select(INTEGRATOR);
            step(state, if c == 't' { Step::Up } else { Step::Down })
        }
        'e' | 'E' => {
            let row = state.row;
            state.select(EXPOSURE);
            let command = step(state, if c == 'E' { Step::Up } else { Step::Down });
            state.row = row;
            command
        }
        ' ' => {
            state.paused = !state.paused;
            Some(Command::Pause)
        }
        'r' => Some(Command::Restart),
        'c' => {
            // The other side of a comparison in progress has its picture already.
            state.compare().then_some(Command::Restart)
        }
        'C' => state.comparison.take().map(|_| Command::EndComparison),
        'v' => {
            match &mut state.comparison {
                Some(comparison) => comparison.arrangement = comparison.arrangement.next(),
                None => state.fail("press c to compare two settings first"),
            }
            None
        }
        'm' | 'M' => {
            state.select_metric(if c == 'm' { 1 } else { -1 });
            Some(Command::Metric)
        }
        'h' => {
            state.chart_x = match state.chart_x {
                ChartX::RenderS => ChartX::Samples,
                ChartX::Samples => ChartX::RenderS,
            };
            None
        }
        'i' => {
            state.toggle_inspector();
            None
        }
        'f' => Some(Command::Freeze),
        'F' => state.reference.is_some().then_some(Command::Unfreeze),
        'l' => {
            state.layer += 1;
            None
        }
        'p' => Some(Command::Save),
        'x' => Some(Command::WriteScript),
        'o' => {
            state.open_picker();
            None
        }
        '?' => {
            state.overlay = Overlay::Help(0);
            None
        }
        'q' => Some(Command::Quit),
        _ => None,
    }
}

/// Changes the value of the selected parameter.
fn step(state: &mut State, step: Step) -> Option<Command> {
    let parameter = state.selected()?;
    let current = state.settings.get(&parameter.path).cloned();
    let default = state.default_of(&parameter);
    let depth = state.settings.max_depth(state.facts.as_ref());
    match parameter.step(step, current.as_ref(), default.as_ref(), depth) {
        Some(value) => put(state, &parameter.path, value),
        None => {
            state.say(format!("{}: press Enter to type a value", parameter.name()));
            None
        }
    }
}

/// Selects the first row of the next or previous group.
fn next_group(state: &mut State, forward: bool) {
    let parameters = state.parameters();
    let group = |row: usize| parameters.get(row).map(|parameter| parameter.group);
    let now = group(state.row);
    let starts = (0..parameters.len()).filter(|row| *row == 0 || group(*row) != group(row - 1));
    let starts: Vec<usize> = starts.collect();
    let index = starts
        .iter()
        .rposition(|start| *start <= state.row)
        .unwrap_or(0);
    let next = match (forward, starts.get(index)) {
        (true, _) => starts.get(index + 1),
        (false, Some(start)) if *start < state.row && group(*start) == now => Some(start),
        (false, _) => index.checked_sub(1).and_then(|index| starts.get(index)),
    };
    state.row = next.copied().unwrap_or(state.row);
}
