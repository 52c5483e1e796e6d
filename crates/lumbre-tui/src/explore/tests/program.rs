//! The program driven by events, on a screen in memory.

use crossterm::event::{Event, KeyCode};
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::layout::Rect;

use super::{character, key, scene, session_options, wait_until};
use crate::explore::explorer::{ExploreOptions, Explorer};
use crate::explore::picker::SceneList;
use crate::explore::session::Slot;
use crate::tui::terminal::terminal_caps::{Colors, Graphics, TerminalCaps};
use lumbre_light::transport::integrator::INTEGRATORS;
use lumbre_report::picture;

const CAPS: TerminalCaps = TerminalCaps {
    colors: Colors::True,
    ascii: false,
};

pub(super) fn explorer(folder: &std::path::Path) -> Explorer {
    let mut scenes: Vec<_> = ["edges", "cornell_spheres"].map(scene).into();
    scenes[1].built_in = true;
    let options = ExploreOptions {
        scene: None,
        scenes: SceneList::new(scenes, folder.to_owned()),
        settings: vec![("integrator".to_owned(), INTEGRATORS[0].name.into())],
        session: session_options(),
        folder: folder.to_owned(),
    };
    let mut explorer = Explorer::new(options, CAPS, (Graphics::Blocks, [0, 0])).unwrap();
    explorer.resize(Rect::new(0, 0, 80, 24));
    explorer
}

pub(super) fn send(explorer: &mut Explorer, text: &str) {
    for c in text.chars() {
        assert!(!explorer.event(&character(c)));
    }
}

pub(super) fn wait_for_samples(explorer: &mut Explorer, samples: u64) {
    wait_until("samples", || {
        explorer.poll();
        let frame = explorer.current(explorer.state.side);
        frame.is_some_and(|frame| frame.samples >= samples)
    });
}

pub(super) fn screen(explorer: &Explorer) -> String {
    let mut terminal = Terminal::new(TestBackend::new(80, 24)).unwrap();
    terminal.draw(|frame| explorer.draw(frame)).unwrap();
    terminal.backend().to_string()
}

#[test]
fn a_session_from_the_list_of_scenes_to_a_script() {
    let folder = tempfile::tempdir().unwrap();
    let mut explorer = explorer(folder.path());
    assert!(screen(&explorer).contains("edges"));
    send(&mut explorer, "spheres");
    assert!(!explorer.event(&key(KeyCode::Enter)));
    wait_for_samples(&mut explorer, 2);
    assert!(screen(&explorer).contains("cornell_spheres"));
    assert!(explorer.state.facts.is_some());
    // Another technique, from another side, in focus on the middle, and brighter.
    send(&mut explorer, "tdWE");
    explorer.state.cursor = Some([20, 20]);
    send(&mut explorer, "g");
    let message = explorer.state.message.clone().unwrap();
    assert!(
        !message.failed && message.text.starts_with("focus at"),
        "{message:?}"
    );
    wait_for_samples(&mut explorer, 2);
    send(&mut explorer, " px");
    let message = explorer.state.message.clone().unwrap();
    assert!(!message.failed, "{message:?}");
    let file = |name: &str| folder.path().join(name);
    let bytes = std::fs::read(file("cornell_spheres-1.exr")).unwrap();
    let decoded = picture::decode(&bytes).unwrap();
    let resolution = explorer.state.resolution;
    assert_eq!([decoded.image.width, decoded.image.height], resolution);
    assert!(file("cornell_spheres-1.png").is_file());
    let text = std::fs::read_to_string(file("cornell_spheres-1.lua")).unwrap();
    let technique = format!("integrator = \"{}\"", INTEGRATORS[1].name);
    assert!(
        text.contains(&technique) && text.contains("focus_distance"),
        "{text}"
    );
    lumbre_lua::load(&file("cornell_spheres-1.lua")).unwrap();
    // The files of a built-in scene are beside the script.
    assert!(
        file("cornell_spheres/cornell_spheres.scn").is_file(),
        "{text}"
    );
    send(&mut explorer, "x");
    assert!(file("cornell_spheres-2.lua").is_file());
    assert!(explorer.event(&character('q')));
}

#[test]
fn the_picture_follows_the_size_of_its_pane() {
    let folder = tempfile::tempdir().unwrap();
    let mut explorer = explorer(folder.path());
    explorer.event(&key(KeyCode::Enter));
    wait_for_samples(&mut explorer, 1);
    let small = explorer.state.resolution;
    explorer.event(&key(KeyCode::Tab));
    let large = explorer.state.resolution;
    assert!(
        large[0] > small[0] && large[1] == small[1],
        "{small:?} {large:?}"
    );
    explorer.event(&Event::Resize(120, 40));
    assert_eq!(explorer.state.resolution, [118, 72]);
    wait_until("the new resolution", || {
        explorer.poll();
        let live = explorer.published().slot(Slot::A);
        live.frame
            .as_ref()
            .is_some_and(|frame| frame.image.width == 118)
    });
}
