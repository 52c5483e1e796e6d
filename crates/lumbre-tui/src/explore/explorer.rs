//! The program without its terminal: applies events to the state, sends requests to the session,
//! and draws frames.

use std::cell::RefCell;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use crossterm::event::Event;
use ratatui::Frame;
use ratatui::layout::Rect;

use super::camera;
use super::comparison::{Arrangement, FLICKER_S};
use super::input::{Command, Input};
use super::inspect::{Inspection, Query, Target, inspect};
use super::latest::Latest;
use super::measure::Meter;
use super::picker::SceneList;
use super::reference::Reference;
use super::script::{experiment_name, script_text};
use super::session::{Frame as Picture, Published, Request, SLOTS, Session, SessionOptions, Slot};
use super::settings::{SceneFile, Settings};
use super::state::State;
use super::view::picture_cache::PictureCache;
use super::view::{self, Screen};
use crate::tui::terminal::terminal_caps::{Graphics, TerminalCaps};
use lumbre_light::value::Value;
use lumbre_metrics::METRICS;
use lumbre_night::paths::folder_of;
use lumbre_night::store::write_atomically;
use lumbre_report::{exr, png};

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

/// Metric of comparisons and curves at the start.
const FIRST_METRIC: &str = "rmse";

/// Greatest number of files of one name in a folder.
const MOST_FILES: u32 = 10_000;

/// The program without its terminal.
pub struct Explorer {
    /// State of the screen.
    pub state: State,
    session: Session,
    meter: Meter,
    inspections: Latest<Query, Inspection>,
    /// Latest query of the inspector.
    asked: Option<Target>,
    published: Published,
    input: Input,
    caps: TerminalCaps,
    /// Graphics protocol, and the size of a character cell in pixels if the protocol needs it.
    pub graphics: (Graphics, [u16; 2]),
    cache: RefCell<PictureCache>,
    folder: PathBuf,
    /// Size of the screen.
    area: Rect,
    /// Number of references so far.
    references: u64,
    start: Instant,
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
            metric: METRICS
                .iter()
                .position(|row| row.name == FIRST_METRIC)
                .unwrap_or(0),
            ..State::default()
        };
        if state.scene.is_none() {
            state.open_picker();
        }
        Ok(Explorer {
            state,
            session: Session::start(options.session)?,
            meter: Meter::start()?,
            inspections: Latest::start("inspect", |query| inspect(&query))?,
            asked: None,
            published: Published::default(),
            input: Input::default(),
            caps,
            graphics,
            cache: RefCell::default(),
            folder: options.folder,
            area: Rect::default(),
            references: 0,
            start: Instant::now(),
        })
    }

    /// Sets the size of the screen. The pictures are rendered anew if their pane changes, unless
    /// they are compared with a reference of another size.
    pub fn resize(&mut self, area: Rect) {
        self.area = area;
        self.fit_picture();
    }

    /// Renders the pictures in the resolution of their pane.
    fn fit_picture(&mut self) {
        let pane = view::picture_pane(self.area, self.state.panel_hidden);
        let resolution = view::resolution(pane, self.graphics);
        if resolution != self.state.resolution && self.state.reference.is_none() {
            self.state.resolution = resolution;
            self.state.cursor = None;
            self.restart_all();
        }
    }

    /// Handles an event. Returns whether the program should end.
    pub fn event(&mut self, event: &Event) -> bool {
        if let Event::Resize(width, height) = event {
            self.resize(Rect::new(0, 0, *width, *height));
            return false;
        }
        let picture = view::picture_area(self.area, &self.state, self.graphics);
        let command = self.input.event(event, &mut self.state, picture);
        self.fit_picture();
        match command {
            None => {}
            Some(Command::Quit) => return true,
            Some(Command::Restart) => self.restart(self.state.side),
            Some(Command::RestartAll | Command::Open) => self.restart_all(),
            Some(Command::Limits) => self
                .session
                .set_limits(self.state.side, self.state.settings.limits()),
            Some(Command::EndComparison) => {
                self.session.request(self.state.side.other(), None);
                self.state.difference = None;
            }
            Some(Command::Metric) => self.compare(),
            Some(Command::Freeze) => self.report(Explorer::freeze),
            Some(Command::Unfreeze) => {
                self.state.reference = None;
                self.meter.set_reference(None);
                self.fit_picture();
            }
            Some(Command::Pause) => self.session.set_paused(self.state.paused),
            Some(Command::Save) => self.report(Explorer::save),
            Some(Command::WriteScript) => self.report(Explorer::write_script),
            Some(Command::Focus(pixel)) => self.report(|explorer| explorer.focus(pixel)),
        }
        false
    }

    /// Takes what was published and measured. Returns whether anything changed.
    pub fn poll(&mut self) -> bool {
        let mut changed = self.take_measured();
        changed |= self.flicker();
        changed |= self.inspect();
        if self.session.revision() == self.published.revision {
            return changed;
        }
        let before = std::mem::replace(&mut self.published, self.session.published());
        self.measure(&before);
        if let Some(scene) = &self.published.slot(self.state.side).scene
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

    /// Shows the other picture of a comparison if it is time. Returns whether it did.
    fn flicker(&mut self) -> bool {
        let Some(comparison) = &mut self.state.comparison else {
            return false;
        };
        let turn = (self.start.elapsed().as_secs_f64() / FLICKER_S) as usize;
        let visible = Slot::ALL[turn % SLOTS];
        let changed = comparison.arrangement == Arrangement::Flicker;
        std::mem::replace(&mut comparison.visible, visible) != visible && changed
    }

    /// Asks about the pixel under the cursor if it is another one, and takes what was found out.
    /// Returns whether there was anything.
    fn inspect(&mut self) -> bool {
        if self.state.inspector.is_none() {
            self.asked = None;
        }
        let view = self.published.slot(self.state.side);
        let target = self
            .state
            .target()
            .filter(|target| view.request == target.request);
        if let (Some(target), Some(scene), Some(job)) = (target, &view.scene, &view.job)
            && self.asked != Some(target)
        {
            self.asked = Some(target);
            self.inspections.ask(Query {
                target,
                scene: Arc::clone(scene),
                job: Arc::clone(job),
            });
        }
        let found = self.inspections.take();
        let any = found.is_some();
        if let (Some(inspector), Some(found)) = (&mut self.state.inspector, found) {
            inspector.found = Some(Arc::new(found));
        }
        any
    }

    /// Takes what was measured. Returns whether there was anything.
    fn take_measured(&mut self) -> bool {
        let measured = self.meter.take();
        let reference = self.state.reference.as_ref();
        let number = reference.map(|reference| reference.number);
        let any =
            !measured.rows.is_empty() || measured.floors.is_some() || measured.difference.is_some();
        for (slot, request, row) in measured.rows {
            self.state.curves.push(slot, request, row);
        }
        if let Some((of, floors)) = measured.floors
            && Some(of) == number
        {
            self.state.floors = floors;
        }
        if measured.difference.is_some() && self.state.comparison.is_some() {
            self.state.difference = measured.difference;
        }
        any
    }

    /// Measures the pictures that are newer than those published before.
    fn measure(&mut self, before: &Published) {
        let mut any = false;
        for slot in Slot::ALL {
            let Some(frame) = self.current(slot) else {
                continue;
            };
            let known = before.slot(slot).frame.as_ref();
            if known.is_some_and(|known| Arc::ptr_eq(known, &frame)) {
                continue;
            }
            any = true;
            if self.state.curve(slot).is_some() {
                let request = self.state.requests[slot.index()];
                self.meter.measure(slot, request, frame);
            }
        }
        if any {
            self.compare();
        }
    }

    /// Measures the difference of the compared pictures.
    fn compare(&mut self) {
        let frames = Slot::ALL.map(|slot| self.current(slot));
        if let ([Some(a), Some(b)], Some(_)) = (frames, &self.state.comparison) {
            self.meter.compare(self.state.metric, [a, b]);
        }
    }

    /// Returns what the session published last.
    pub fn published(&self) -> &Published {
        &self.published
    }

    /// Returns the picture of a slot with the current settings in full resolution, if it has a
    /// sample.
    pub fn current(&self, slot: Slot) -> Option<Arc<Picture>> {
        let view = self.published.slot(slot);
        let frame = view.frame.as_ref().filter(|frame| frame.samples > 0);
        let newest = view.request == self.state.requests[slot.index()];
        frame.filter(|_| newest).cloned()
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

    /// Renders all pictures anew.
    fn restart_all(&mut self) {
        for slot in Slot::ALL {
            self.restart(slot);
        }
    }

    /// Renders the picture of a slot anew, if it has one.
    fn restart(&mut self, slot: Slot) {
        let (Some(scene), Some(settings)) = (&self.state.scene, self.state.settings_of(slot))
        else {
            return;
        };
        if self.state.resolution.contains(&0) {
            return;
        }
        self.session.set_limits(slot, settings.limits());
        let request = Request {
            scene: scene.clone(),
            table: settings.request_table(scene, self.state.resolution),
            seed: settings.random_seed(),
        };
        self.state.requests[slot.index()] = self.session.request(slot, Some(request));
        self.state.begin_curve(slot);
    }

    /// Makes the picture that the panel edits the reference of all following ones.
    fn freeze(&mut self) -> Result<String, String> {
        let (scene, frame) = self.shown()?;
        self.references += 1;
        let samples = frame.samples;
        let reference = Reference {
            number: self.references,
            frame,
            scene,
            settings: self.state.settings.clone(),
        };
        let restarted = self.state.freeze(reference);
        self.meter.set_reference(self.state.reference.clone());
        for slot in Slot::ALL {
            if restarted.contains(&slot) {
                self.restart(slot);
            } else {
                self.state.begin_curve(slot);
            }
        }
        Ok(format!(
            "the reference has {samples} samples; other pictures have other seeds"
        ))
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
        let scene = self.published.slot(self.state.side).scene.clone();
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
        self.restart(self.state.side);
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
            ("program", lumbre_night::text::program().to_owned()),
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
        let extras = exr::Extras {
            layers: &frame.layers,
            samples: Some(frame.samples),
            render_s: Some(frame.render_s),
        };
        let exr_bytes = exr::encode_with(&frame.image, &extras, &metadata);
        let exr_bytes = exr_bytes.map_err(|e| e.to_string())?;
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
        let frame = self.current(self.state.side);
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
    let folder = folder_of(scene);
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
