//! The program without its terminal: applies events to the state, sends requests to the session,
//! and draws frames.

use std::cell::RefCell;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crossterm::event::Event;
use ratatui::Frame;
use ratatui::layout::Rect;

use super::camera;
use super::input::{Command, Input};
use super::picker::SceneList;
use super::script::{experiment_name, script_text};
use super::session::{Frame as Picture, Published, Request, Session, SessionOptions, Slot};
use super::settings::{SceneFile, Settings};
use super::state::State;
use super::view::picture::PictureCache;
use super::view::{self, Screen};
use crate::output::{exr, png};
use crate::store::write_atomically;
use crate::tui::terminal::terminal_caps::{Graphics, TerminalCaps};
use lumbre_light::value::Value;

/// Scenes, settings and folder with which the program starts.
#[derive(Clone, Debug)]
pub struct ExploreOptions {
    /// Scene that is shown first; the list of scenes if there is none.
    pub scene: Option<SceneFile>,
    /// Scenes of the list.
    pub scenes: SceneList,
    /// Keys of the render table, and paths of values in the scene.
    pub settings: Vec<(String, Value)>,
    /// Backend and threads that render.
    pub session: SessionOptions,
    /// Folder in which pictures and scripts are written.
    pub folder: PathBuf,
}

/// Greatest number of files of one name in a folder.
const MOST_FILES: u32 = 10_000;

/// The program without its terminal.
pub struct Explorer {
    /// State of the screen.
    pub state: State,
    session: Session,
    published: Published,
    input: Input,
    caps: TerminalCaps,
    /// Graphics protocol, and the size of a character cell in pixels if the protocol needs it.
    pub graphics: (Graphics, [u16; 2]),
    cache: RefCell<PictureCache>,
    folder: PathBuf,
    /// Size of the screen.
    area: Rect,
    /// Number of the newest request.
    requested: u64,
}

impl Explorer {
    /// Starts the session.
    ///
    /// # Errors
    /// If its thread cannot be started.
    pub fn new(
        options: ExploreOptions,
        caps: TerminalCaps,
        graphics: (Graphics, [u16; 2]),
    ) -> io::Result<Explorer> {
        let mut state = State {
            settings: Settings::new(&options.settings),
            scene: options.scene,
            scenes: options.scenes,
            ..State::default()
        };
        if state.scene.is_none() {
            state.open_picker();
        }
        Ok(Explorer {
            state,
            session: Session::start(options.session)?,
            published: Published::default(),
            input: Input::default(),
            caps,
            graphics,
            cache: RefCell::default(),
            folder: options.folder,
            area: Rect::default(),
            requested: 0,
        })
    }

    /// Sets the size of the screen. The picture is rendered anew if its pane changes.
    pub fn resize(&mut self, area: Rect) {
        self.area = area;
        self.fit_picture();
    }

    /// Renders the picture in the resolution of its pane.
    fn fit_picture(&mut self) {
        let picture = view::picture_area(self.area, self.state.panel_hidden, self.graphics);
        if picture.resolution != self.state.resolution {
            self.state.resolution = picture.resolution;
            self.state.cursor = None;
            self.restart();
        }
    }

    /// Handles an event. Returns whether the program should end.
    pub fn event(&mut self, event: &Event) -> bool {
        if let Event::Resize(width, height) = event {
            self.resize(Rect::new(0, 0, *width, *height));
            return false;
        }
        let picture = view::picture_area(self.area, self.state.panel_hidden, self.graphics);
        let command = self.input.event(event, &mut self.state, picture);
        self.fit_picture();
        match command {
            None => {}
            Some(Command::Quit) => return true,
            Some(Command::Restart | Command::Open) => self.restart(),
            Some(Command::Limits) => self
                .session
                .set_limits(Slot::Live, self.state.settings.limits()),
            Some(Command::Pause) => self.session.set_paused(self.state.paused),
            Some(Command::Save) => self.report(Explorer::save),
            Some(Command::WriteScript) => self.report(Explorer::write_script),
            Some(Command::Focus(pixel)) => self.report(|explorer| explorer.focus(pixel)),
        }
        false
    }

    /// Takes what the session published. Returns whether anything changed.
    pub fn poll(&mut self) -> bool {
        if self.session.revision() == self.published.revision {
            return false;
        }
        self.published = self.session.published();
        if let Some(scene) = &self.published.slot(Slot::Live).scene
            && Some(&scene.file) == self.state.scene.as_ref()
            && self.state.facts.as_ref() != Some(&scene.facts)
        {
            self.state.facts = Some(scene.facts.clone());
            if let Some(note) = scene.notes.first() {
                let more = match scene.notes.len() - 1 {
                    0 => String::new(),
                    more => format!(" (and {more} more; `lumbre check` lists them)"),
                };
                self.state.say(format!("note: {note}{more}"));
            }
        }
        true
    }

    /// Returns what the session published last.
    pub fn published(&self) -> &Published {
        &self.published
    }

    /// Returns the picture with the current settings in full resolution, if it has a sample.
    pub fn current(&self) -> Option<Arc<Picture>> {
        let live = self.published.slot(Slot::Live);
        let frame = live.frame.as_ref().filter(|frame| frame.samples > 0);
        frame.filter(|_| live.request == self.requested).cloned()
    }

    /// Draws a frame.
    pub fn draw(&self, frame: &mut Frame) {
        let screen = Screen {
            state: &self.state,
            published: &self.published,
            caps: self.caps,
            graphics: self.graphics,
            cache: &self.cache,
        };
        view::draw(frame, &screen);
    }

    fn restart(&mut self) {
        let Some(scene) = &self.state.scene else {
            return;
        };
        if self.state.resolution.contains(&0) {
            return;
        }
        self.session
            .set_limits(Slot::Live, self.state.settings.limits());
        let request = Request {
            scene: scene.clone(),
            table: self
                .state
                .settings
                .request_table(scene, self.state.resolution),
            seed: self.state.settings.random_seed(),
        };
        self.requested = self.session.request(Slot::Live, Some(request));
    }

    /// Runs an action and shows its message.
    fn report(&mut self, action: impl FnOnce(&mut Explorer) -> Result<String, String>) {
        match action(self) {
            Ok(text) => self.state.say(text),
            Err(text) => self.state.fail(text),
        }
    }

    /// Puts the plane in focus on what a pixel shows.
    fn focus(&mut self, pixel: [u32; 2]) -> Result<String, String> {
        let scene = self.published.slot(Slot::Live).scene.clone();
        let scene = scene.ok_or("the scene is not loaded yet")?;
        let prepared = scene
            .prepared
            .as_ref()
            .ok_or("focusing by a click needs the backend `cpu`")?;
        let mut camera = self.state.settings.camera(&scene.facts)?;
        let (ray, hit) = prepared.center_hit(&camera, self.state.resolution, pixel);
        let hit = hit.ok_or("there is nothing to focus on at this point")?;
        let point = ray.origin + ray.dir * hit.t;
        let distance = camera::depth(&camera, point).ok_or("the point is behind the camera")?;
        camera.focus_distance = Some(distance);
        self.state.settings.set_camera(&scene.facts, &camera)?;
        self.restart();
        let pinhole = if camera.lens_diameter() > 0.0 {
            ""
        } else {
            "; raise `aperture` to see it"
        };
        Ok(format!(
            "focus at {}{pinhole}",
            super::parameters::rounded(f64::from(distance))
        ))
    }

    /// Writes the picture as EXR and PNG files.
    fn save(&mut self) -> Result<String, String> {
        let (scene, frame) = self.shown()?;
        let metadata = [
            (
                "program",
                concat!("lumbre ", env!("CARGO_PKG_VERSION")).to_owned(),
            ),
            ("scene", scene.path.display().to_string()),
            (
                "settings",
                Value::Map(self.state.settings.render_table()).to_string(),
            ),
            ("samples", frame.samples.to_string()),
            ("seed", self.state.settings.random_seed().to_string()),
        ];
        let metadata: Vec<(String, String)> = metadata
            .into_iter()
            .map(|(key, value)| (key.to_owned(), value))
            .collect();
        let stem = self.free_name(&scene, &["exr", "png"])?;
        let tonemap = self.state.tonemap();
        let exr_bytes = exr::encode(&frame.image, &metadata).map_err(|e| e.to_string())?;
        let png_bytes = png::encode(&frame.image, tonemap, &metadata).map_err(|e| e.to_string())?;
        for (extension, bytes) in [("exr", exr_bytes), ("png", png_bytes)] {
            let path = self.folder.join(format!("{stem}.{extension}"));
            write_atomically(&path, &bytes).map_err(|e| e.to_string())?;
        }
        Ok(format!("wrote {stem}.exr and {stem}.png"))
    }

    /// Writes the settings as an experiment. Files of a built-in scene are written beside it, since
    /// those of the program exist only while it runs.
    fn write_script(&mut self) -> Result<String, String> {
        let (mut scene, frame) = self.shown()?;
        let stem = self.free_name(&scene, &["lua"])?;
        if scene.built_in {
            scene.path = copy_scene(&scene.path, &self.folder)?;
        }
        let file = format!("{stem}.lua");
        let text = script_text(
            &self.state.settings,
            &scene,
            self.state.resolution,
            self.state
                .settings
                .limits()
                .samples
                .unwrap_or(frame.samples),
            &file,
        );
        write_atomically(&self.folder.join(&file), text.as_bytes()).map_err(|e| e.to_string())?;
        Ok(format!("wrote {file}; lumbre run {file} renders it"))
    }

    /// Returns the scene and its picture with the current settings.
    fn shown(&self) -> Result<(SceneFile, Arc<Picture>), String> {
        let scene = self.state.scene.clone().ok_or("there is no scene yet")?;
        let frame = self.current();
        Ok((
            scene,
            frame.ok_or("there is no picture with these settings yet")?,
        ))
    }

    /// Returns a name without extension that no file in the folder has with any of the extensions.
    fn free_name(&self, scene: &SceneFile, extensions: &[&str]) -> Result<String, String> {
        let name = experiment_name(&scene.name);
        let is_free = |stem: &String| {
            extensions
                .iter()
                .all(|extension| !self.folder.join(format!("{stem}.{extension}")).exists())
        };
        (1..=MOST_FILES)
            .map(|number| format!("{name}-{number}"))
            .find(is_free)
            .ok_or_else(|| format!("{MOST_FILES} files are named {name} already"))
    }
}

/// Copies the folder of a built-in scene into another folder, unless it is there. Returns the path
/// of the scene file.
fn copy_scene(scene: &Path, into: &Path) -> Result<PathBuf, String> {
    let failed = |e: io::Error| format!("cannot write the files of the scene: {e}");
    let folder = scene.parent().unwrap_or(Path::new("."));
    let name = folder.file_name().unwrap_or_default();
    let target = into.join(name);
    fs::create_dir_all(&target).map_err(failed)?;
    for entry in fs::read_dir(folder).map_err(failed)?.flatten() {
        let copy = target.join(entry.file_name());
        if entry.path().is_file() && !copy.exists() {
            fs::copy(entry.path(), copy).map_err(failed)?;
        }
    }
    Ok(target.join(scene.file_name().unwrap_or_default()))
}
