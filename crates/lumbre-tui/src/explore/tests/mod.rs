//! Tests of keys, of the session, of whole screens, and of the program driven by events.

mod comparing;
mod inspecting;
mod keys;
mod program;
mod screens;
mod sessions;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers};

use super::session::SessionOptions;
use super::settings::{SceneFacts, SceneFile};
use glam::Vec3;
use lumbre_light::scene::desc::CameraDesc;
use lumbre_scene_io::load::MissingTextures;

/// Longest wait for a picture; every expected wait is far shorter.
const MAX_WAIT: Duration = Duration::from_secs(120);

/// A scene of the repository.
fn scene(name: &str) -> SceneFile {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let path: PathBuf = root.join(name).join(format!("{name}.scn"));
    SceneFile {
        name: name.to_owned(),
        path,
        options: BTreeMap::new(),
        built_in: false,
    }
}

/// Facts of a scene whose camera looks at the origin from `z = 4`.
fn facts() -> SceneFacts {
    let camera = CameraDesc {
        position: Vec3::new(0.0, 0.0, 4.0),
        target: Vec3::ZERO,
        ..CameraDesc::default()
    };
    SceneFacts {
        views: vec![("above".to_owned(), camera.clone())],
        camera,
        max_depth: 6,
    }
}

/// A session on two threads of the CPU.
fn session_options() -> SessionOptions {
    SessionOptions {
        backend: "cpu".to_owned(),
        threads: 2,
        missing: MissingTextures::Fail,
    }
}

fn key(code: KeyCode) -> Event {
    Event::Key(KeyEvent::new(code, KeyModifiers::NONE))
}

fn character(c: char) -> Event {
    key(KeyCode::Char(c))
}

/// Waits until a condition holds.
fn wait_until(what: &str, mut holds: impl FnMut() -> bool) {
    let start = Instant::now();
    while !holds() {
        assert!(start.elapsed() < MAX_WAIT, "waited for {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}
