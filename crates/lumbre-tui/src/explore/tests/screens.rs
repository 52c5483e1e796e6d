//! Snapshots of whole screens.

use std::cell::RefCell;
use std::sync::Arc;

use insta::assert_snapshot;
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::layout::Rect;

use super::{facts, scene};
use crate::explore::comparison::Arrangement;
use crate::explore::inspect::{Inspection, SurfaceFacts, Target};
use crate::explore::measure::Difference;
use crate::explore::picker::Picker;
use crate::explore::reference::Reference;
use crate::explore::session::{Frame, Published, Slot, Status};
use crate::explore::settings::Settings;
use crate::explore::state::{Overlay, State};
use crate::explore::view::{self, Screen};
use crate::tui::terminal::terminal_caps::{Colors, Graphics, TerminalCaps};
use lumbre_light::film::Image;
use lumbre_light::value::Value;
use lumbre_night::experiment::WaveRow;
use lumbre_render::lobe::{BINS, Lobe, STEPS, angle_of};

const SIZES: [(u16, u16); 3] = [(80, 24), (120, 40), (200, 60)];

const RICH: TerminalCaps = TerminalCaps {
    colors: Colors::True,
    ascii: false,
};

/// Without colours, pictures are characters, which snapshots show.
const PLAIN: TerminalCaps = TerminalCaps {
    colors: Colors::None,
    ascii: true,
};

fn screen(size: (u16, u16), state: &State, published: &Published, caps: TerminalCaps) -> String {
    let area = Rect::new(0, 0, size.0, size.1);
    let graphics = (Graphics::Blocks, [0, 0]);
    let mut state = state.clone();
    let pane = view::picture_pane(area, state.panel_hidden);
    if state.reference.is_none() {
        state.resolution = view::resolution(pane, graphics);
    }
    let mut terminal = Terminal::new(TestBackend::new(size.0, size.1)).unwrap();
    let screen = Screen {
        state: &state,
        published,
        caps,
        graphics,
        cache: &RefCell::default(),
    };
    terminal.draw(|frame| view::draw(frame, &screen)).unwrap();
    terminal.backend().to_string()
}

/// A picture whose brightness rises to the right.
fn published() -> Published {
    let mut published = Published::default();
    let live = &mut published.slots[0];
    live.status = Status::Rendering;
    live.first_picture_s = Some(0.021);
    live.device = "cpu, 2 threads, eight-wide BVH, avx2".to_owned();
    live.frame = Some(Arc::new(Frame {
        image: Arc::new(Image::from_fn(80, 60, |x, y| {
            let shade = x as f32 / 80.0;
            if y < 8 { [0.0; 3] } else { [shade * shade; 3] }
        })),
        samples: 96,
        render_s: 1.5,
        paths: 460_800,
        rays: 4_000_000,
        invalid: 0,
        noise: Some(0.0312),
        variance: None,
        part: None,
        layers: Vec::new(),
    }));
    published
}

fn state() -> State {
    State {
        scene: Some(scene("cornell_spheres")),
        facts: Some(facts()),
        settings: Settings::new(&[("max_depth".to_owned(), Value::Int(5))]),
        ..State::default()
    }
}

#[test]
fn a_picture_with_its_settings() {
    let mut state = state();
    state.select("max_depth");
    for size in SIZES {
        assert_snapshot!(
            format!("picture-{}", size.0),
            screen(size, &state, &published(), PLAIN)
        );
    }
    state.settings.put("integrator", Some("bdpt".into()));
    state.select("camera.aperture");
    assert_snapshot!("colours-80", screen((80, 24), &state, &published(), RICH));
}

#[test]
fn the_list_of_scenes_and_the_list_of_keys() {
    let mut state = state();
    let names = ["cornell", "edges", "lamp_row", "veach_lamps"];
    let mut picker = Picker {
        scenes: names.map(scene).into(),
        ..Picker::default()
    };
    picker.scenes[0].built_in = true;
    picker.set_filter("e".to_owned());
    picker.select(1);
    state.overlay = Overlay::Picker(picker);
    assert_snapshot!(
        "picker-80",
        screen((80, 24), &state, &Published::default(), PLAIN)
    );
    state.overlay = Overlay::Help(0);
    assert_snapshot!("help-80", screen((80, 24), &state, &published(), PLAIN));
}

#[test]
fn an_error_and_a_value_that_is_typed() {
    let mut state = state();
    let mut failed = Published::default();
    failed.slots[0].status = Status::Failed("camera.fov: 200 is out of range".to_owned());
    state.select("camera.fov");
    state.overlay = Overlay::Edit("200".to_owned());
    state.fail("200 is out of range");
    let text = screen((80, 24), &state, &failed, PLAIN);
    assert_snapshot!("error-80", text);
}

/// A comparison of the picture with one of `bdpt`, and a reference with curves of both.
fn compared() -> (State, Published) {
    let (mut state, mut published) = (state(), published());
    let mut second = published.slots[0].clone();
    let frame = second.frame.take().unwrap();
    second.frame = Some(Arc::new(Frame {
        samples: 40,
        noise: Some(0.021),
        ..(*frame).clone()
    }));
    published.slots[1] = second;
    let reference = Reference {
        number: 1,
        frame: Arc::clone(published.slots[0].frame.as_ref().unwrap()),
        scene: scene("cornell_spheres"),
        settings: state.settings.clone(),
    };
    state.metric = 1;
    assert!(state.compare());
    state.settings.put("integrator", Some("bdpt".into()));
    state.resolution = [80, 60];
    state.freeze(reference);
    state.floors = vec![Some(0.0001), Some(0.01)];
    for (slot, factor) in [(Slot::A, 0.2), (Slot::B, 0.09)] {
        state.begin_curve(slot);
        for step in 0..8u32 {
            let samples = 1u64 << step;
            let error = factor / (samples as f64).sqrt();
            let row = WaveRow {
                samples,
                render_s: samples as f64 * 0.015,
                metrics: vec![error * error, error],
                ..WaveRow::default()
            };
            state.curves.push(slot, 0, row);
        }
    }
    state.difference = Some(Difference {
        metric: 1,
        value: Ok(0.0345),
        noise: Some(0.0338),
        samples: [96, 40],
    });
    (state, published)
}

#[test]
fn two_settings_with_their_difference_and_their_errors() {
    let (mut state, published) = compared();
    for size in SIZES {
        assert_snapshot!(
            format!("compared-{}", size.0),
            screen(size, &state, &published, PLAIN)
        );
    }
    assert_snapshot!(
        "compared-colours-120",
        screen((120, 40), &state, &published, RICH)
    );
    state.reference = None;
    state.comparison.as_mut().unwrap().arrangement = Arrangement::Flicker;
    assert_snapshot!("flicker-80", screen((80, 24), &state, &published, PLAIN));
}

/// A pixel of a glossy surface with the steps of a sample.
fn inspected() -> (State, Published) {
    let (mut state, mut published) = (state(), published());
    state.cursor = Some([20, 14]);
    let frame = published.slots[0].frame.take().unwrap();
    published.slots[0].frame = Some(Arc::new(Frame {
        variance: Some((Arc::new(Image::from_fn(80, 60, |_, _| [1e-4; 3])), 96)),
        ..(*frame).clone()
    }));
    let values: Vec<f64> = (0..=STEPS)
        .map(|step| {
            let angle = f64::from(angle_of(step));
            let bump = (-((angle - 0.6) / 0.3).powi(2)).exp();
            angle.cos().max(0.0) * (0.2 + bump)
        })
        .collect();
    let histogram: Vec<f64> = (0..BINS)
        .map(|bin| values[(bin * STEPS + STEPS / 2) / BINS])
        .collect();
    let lobe = Lobe {
        angle: 0.6,
        densities: histogram.iter().map(|x| 1.1 * x).collect(),
        histogram,
        values,
        delta: 0.0,
        lost: 0.05,
        albedo: 0.62,
    };
    let target = state_target(&mut state);
    let steps = [
        "ray    (0, 0, 4) -> vertex (0.25, -0.5, 0): triangle 12 (disney), t 4.03",
        "shadow (0.25, -0.5, 0) -> (0, 1, 0.5): free",
        "light  s 1 t 2: (0.75, 0.5, 0.25) of (0.75, 0.5, 0.25)",
    ];
    state.inspector.as_mut().unwrap().found = Some(Arc::new(Inspection {
        target,
        surface: Some(SurfaceFacts {
            material: "floor".to_owned(),
            model: "disney",
            primitive: "triangle 12 (disney)".to_owned(),
            position: [0.25, -0.5, 0.0],
            distance: 4.03,
            light: None,
            lobe: Some(lobe),
        }),
        steps: steps.map(str::to_owned).into(),
        depths: vec![(2, [0.75, 0.5, 0.25])],
        rays: 2,
    }));
    (state, published)
}

/// Opens the inspector and returns its target.
fn state_target(state: &mut State) -> Target {
    state.toggle_inspector();
    state.target().unwrap()
}

#[test]
fn a_pixel_with_its_surface_and_the_window_with_its_lobe() {
    let (mut state, published) = inspected();
    for size in SIZES {
        assert_snapshot!(
            format!("pixel-{}", size.0),
            screen(size, &state, &published, PLAIN)
        );
    }
    state.inspector.as_mut().unwrap().window = true;
    for size in SIZES {
        assert_snapshot!(
            format!("lobe-{}", size.0),
            screen(size, &state, &published, PLAIN)
        );
    }
}

#[test]
fn small_screens_show_what_fits() {
    let mut state = state();
    state.panel_hidden = true;
    assert_snapshot!("hidden-60", screen((60, 15), &state, &published(), PLAIN));
    let tiny = screen((20, 6), &state, &published(), PLAIN);
    assert!(tiny.contains("too small"), "{tiny}");
    for width in 24..90 {
        for height in [8, 13, 21] {
            screen((width, height), &state, &published(), RICH);
            let (mut inspected, picture) = inspected();
            screen((width, height), &inspected, &picture, RICH);
            inspected.inspector.as_mut().unwrap().window = true;
            screen((width, height), &inspected, &picture, RICH);
            let (compared, pictures) = compared();
            screen((width, height), &compared, &pictures, RICH);
        }
    }
}
