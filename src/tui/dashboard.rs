//! The dashboard: a sink that keeps the newest state, and a thread of its own that owns the terminal and draws it.
//!
//! The same dashboard shows a night that another process renders: then somebody tells the model what the files say, and
//! no key reaches that night.
//!
//! Rendering never waits for the terminal. [`Dashboard::hear`](crate::experiment::Sink::hear) folds an event into the
//! shared model and returns; the thread copies out what changed at most ten times a second. A slow terminal loses
//! frames, a terminal that has gone away ends the thread, and neither is an error of the night.

use std::fs::File;
use std::io::{self, BufWriter, IsTerminal, Stdout, Write};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

use crossterm::event::{self, KeyEvent};
use crossterm::{cursor, execute, queue, terminal};
use ratatui::Terminal;
use ratatui::backend::CrosstermBackend;
use ratatui::layout::Rect;

use super::guard::Guard;
use super::look::{Graphics, Look};
use super::model::Model;
use super::panes;
use super::reel::Reel;
use super::view::{Command, View, Wishes};
use crate::experiment::event::Level;
use crate::experiment::{Control, Event, Sink, SinkError};

/// Shortest time between two frames.
pub(super) const FRAME: Duration = Duration::from_millis(100);
/// Longest time until a key is seen.
pub(super) const GLANCE: Duration = Duration::from_millis(40);

/// What to do when the user wants to leave at once; the terminal has been given back before it is called.
pub type LeaveNow = Box<dyn FnOnce() + Send>;

/// What the listener and the drawing thread share.
#[derive(Debug, Default)]
struct Shared {
    model: Mutex<Model>,
    over: Mutex<bool>,
    wake: Condvar,
}

impl Shared {
    fn model(&self) -> MutexGuard<'_, Model> {
        self.model.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits a glance long, or until the dashboard is over; says which.
    fn wait(&self) -> bool {
        let over = self.over.lock().unwrap_or_else(PoisonError::into_inner);
        let waited = self.wake.wait_timeout_while(over, GLANCE, |over| !*over);
        *waited.unwrap_or_else(PoisonError::into_inner).0
    }
}

/// Whose night it is.
#[derive(Clone, Debug)]
pub enum Role {
    /// This process's; keys act through the control.
    Run(Arc<Control>),
    /// Another's; keys act on the screen alone. Times are seconds since 1970.
    Watch,
}

/// Seconds on the listener's clock.
#[derive(Clone, Copy, Debug)]
enum Clock {
    Since(Instant),
    Unix,
}

impl Clock {
    fn now_s(self) -> f64 {
        match self {
            Clock::Since(start) => start.elapsed().as_secs_f64(),
            Clock::Unix => SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0.0, |d| d.as_secs_f64()),
        }
    }
}

/// The dashboard on the terminal that standard output is.
#[derive(Debug)]
pub struct Dashboard {
    shared: Arc<Shared>,
    clock: Clock,
    thread: Option<JoinHandle<()>>,
}

impl Dashboard {
    /// Takes the terminal (raw mode, alternate screen) and starts the thread `dashboard` that draws on it.
    ///
    /// The second wish to stop a night of this process (the first to leave another's) gives the terminal back and calls
    /// `leave_now` on that thread; if it returns, the night goes on without a dashboard.
    ///
    /// # Errors
    /// When there is no terminal that can be taken, or no thread can be started; the terminal is then as before.
    pub fn start(role: Role, leave_now: LeaveNow) -> io::Result<Dashboard> {
        let shared = Arc::new(Shared::default());
        let clock = match role {
            Role::Run(_) => Clock::Since(Instant::now()),
            Role::Watch => Clock::Unix,
        };
        let guard = Guard::take(enter, restore)?;
        let look = Look::from_env(&|name| std::env::var(name).ok());
        let terminal = open_terminal()?;
        let view = View { watching: matches!(role, Role::Watch), ..View::new(look) };
        let graphics = Graphics::from_env(&|name| std::env::var(name).ok());
        let screen = Screen { terminal, guard, keys: Keys::new(), view, graphics, role, shared: shared.clone(), clock };
        let thread = std::thread::Builder::new().name("dashboard".to_owned()).spawn(move || {
            // Tone mapping uses rayon. With this thread as a pool of its own it stays here, instead of queueing behind
            // the tiles of a wave, where keys would wait with it. Without such a pool it is slower, not wrong.
            let _pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
            // A terminal that can no longer be written to is gone: nothing is lost by not drawing.
            if let Ok(Exit::Leave) = screen.run() {
                leave_now();
            }
        })?;
        Ok(Dashboard { shared, clock, thread: Some(thread) })
    }

    /// Changes the model of a night that is told by somebody else than its events.
    pub fn tell(&self, change: impl FnOnce(&mut Model)) {
        change(&mut self.shared.model());
    }

    /// Whether the drawing thread has ended: the user left, or the terminal is gone.
    pub fn is_over(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// What can put lines into the log pane, from any thread.
    pub fn voice(&self) -> Voice {
        Voice { shared: Arc::clone(&self.shared), clock: self.clock }
    }

    /// Ends the thread and gives the terminal back.
    pub fn finish(mut self) {
        self.close();
    }

    fn close(&mut self) {
        *self.shared.over.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.shared.wake.notify_all();
        if let Some(thread) = self.thread.take() {
            // A panic of the drawing thread has been reported by the panic hook; the night is not concerned.
            let _ = thread.join();
        }
    }
}

/// Puts lines into the log pane.
#[derive(Clone, Debug)]
pub struct Voice {
    shared: Arc<Shared>,
    clock: Clock,
}

impl Voice {
    /// Says something that is not about a cell.
    pub fn say(&self, level: Level, text: &str) {
        let at_s = self.clock.now_s();
        self.shared.model().say(level, None, text, at_s);
    }
}

impl Drop for Dashboard {
    fn drop(&mut self) {
        self.close();
    }
}

impl Sink for Dashboard {
    fn hear(&mut self, event: &Event) -> Result<(), SinkError> {
        let at_s = self.clock.now_s();
        // Before the model is locked: keys must not wait for it.
        let reel = Reel::heard(event);
        let mut model = self.shared.model();
        model.hear(event, at_s);
        if let Some(reel) = reel {
            model.wound(reel);
        }
        Ok(())
    }

    fn shows_times(&self) -> bool {
        true
    }
}

/// A whole frame is gathered before it is written.
type Output = Terminal<CrosstermBackend<BufWriter<Stdout>>>;

fn open_terminal() -> io::Result<Output> {
    Terminal::new(CrosstermBackend::new(BufWriter::with_capacity(1 << 16, io::stdout())))
}

fn enter() -> io::Result<()> {
    terminal::enable_raw_mode()?;
    execute!(io::stdout(), terminal::EnterAlternateScreen, cursor::Hide)
}

/// Errors are of no use here: there is nobody left to tell.
fn restore() {
    let _ = execute!(io::stdout(), terminal::EndSynchronizedUpdate, terminal::LeaveAlternateScreen, cursor::Show);
    let _ = terminal::disable_raw_mode();
}

/// Why the thread ended.
enum Exit {
    /// The night is over.
    Over,
    /// The user wants to leave at once.
    Leave,
}

/// The drawing thread's own.
struct Screen {
    terminal: Output,
    guard: Guard,
    keys: Keys,
    view: View,
    graphics: Graphics,
    role: Role,
    shared: Arc<Shared>,
    clock: Clock,
}

/// What a frame shows that can change without an event; a frame with the same facts needs no drawing.
#[derive(Clone, Copy, PartialEq)]
struct Shown {
    revision: u64,
    tick: u64,
    size: (u16, u16),
    wishes: Wishes,
}

impl Screen {
    /// Draws and reads keys until the night is over.
    ///
    /// # Errors
    /// When the terminal can no longer be written to.
    fn run(mut self) -> io::Result<Exit> {
        let mut shown = None;
        let mut drawn: Option<Instant> = None;
        let mut lost_at: Option<u64> = None;
        loop {
            if self.shared.wait() {
                return Ok(Exit::Over);
            }
            if !self.guard.holds() {
                // A panic gave the terminal back. If events go on, it cost a cell and not the night.
                let revision = self.shared.model().revision;
                if *lost_at.get_or_insert(revision) == revision {
                    continue;
                }
                self.guard.take_again(enter)?;
                // Not cleared: that would ask the terminal for its cursor and wait for the answer.
                self.terminal = open_terminal()?;
                (shown, lost_at) = (None, None);
            }
            let mut touched = false;
            for key in self.keys.pressed()? {
                touched = true;
                if self.press(key)? {
                    return Ok(Exit::Leave);
                }
            }
            if touched {
                shown = None;
            }
            if drawn.is_some_and(|at| at.elapsed() < FRAME) {
                continue;
            }
            let now = self.facts()?;
            if shown != Some(now) {
                self.draw()?;
                shown = Some(now);
                drawn = Some(Instant::now());
            }
        }
    }

    fn facts(&self) -> io::Result<Shown> {
        let size = terminal::size()?;
        let now_s = self.clock.now_s();
        let model = self.shared.model();
        Ok(Shown { revision: model.revision, tick: self.view.tick(&model, now_s), size, wishes: self.wishes() })
    }

    fn wishes(&self) -> Wishes {
        match &self.role {
            Role::Run(control) => Wishes::of(control),
            Role::Watch => Wishes::default(),
        }
    }

    /// Acts on a key; whether to leave at once.
    fn press(&mut self, key: KeyEvent) -> io::Result<bool> {
        let (width, height) = terminal::size()?;
        let area = Rect::new(0, 0, width, height);
        self.view.now_s = self.clock.now_s();
        self.view.wishes = self.wishes();
        let Some(command) = self.view.key(key, &self.shared.model(), area) else { return Ok(false) };
        let control = match &self.role {
            Role::Run(control) => control,
            Role::Watch => return Ok(command == Command::Stop),
        };
        match command {
            Command::Stop => return Ok(control.request_stop() >= 2),
            Command::StopAfterCell => {
                control.toggle_stop_after_cell();
            }
            Command::Pause(Some(paused)) => control.set_paused(paused),
            Command::Pause(None) => {
                control.toggle_pause();
            }
            Command::PauseAt(limit) => control.set_pause_at(limit),
            Command::Skip => control.request_skip(),
            Command::Restart => control.request_restart(),
        }
        Ok(false)
    }

    fn draw(&mut self) -> io::Result<()> {
        self.view.now_s = self.clock.now_s();
        self.view.wishes = self.wishes();
        // Reducing the picture takes a while, writing may take for ever: neither happens under the lock.
        let model = self.shared.model().clone();
        if !self.view.watching {
            let device = model.current.as_ref().map_or("", |current| current.open.device.as_str());
            self.view.gauges.borrow_mut().refresh(device);
        }
        if self.graphics != Graphics::Blocks {
            // Asked of the system, not of the terminal; without an answer pictures are blocks.
            let cell = terminal::window_size().ok().filter(|s| s.columns > 0 && s.rows > 0);
            self.view.graphics = (self.graphics, cell.map_or([0, 0], |s| [s.width / s.columns, s.height / s.rows]));
        }
        let (terminal, view) = (&mut self.terminal, &self.view);
        let written = self.guard.write(|| {
            queue!(terminal.backend_mut(), terminal::BeginSynchronizedUpdate)?;
            terminal.draw(|frame| panes::draw(frame, &model, view))?;
            execute!(terminal.backend_mut(), terminal::EndSynchronizedUpdate)?;
            terminal.backend_mut().flush()
        });
        written.unwrap_or(Ok(()))
    }
}

/// The keyboard.
struct Keys {
    /// Whether standard input is the keyboard; otherwise it is the controlling terminal.
    on_stdin: bool,
}

impl Keys {
    fn new() -> Keys {
        Keys { on_stdin: io::stdin().is_terminal() }
    }

    /// Whether the terminal is still there. crossterm 0.29 reads in a loop without end from one that has hung up, so
    /// it must not be asked for keys then.
    fn connected(&self) -> bool {
        if self.on_stdin { io::stdin().is_terminal() } else { cfg!(windows) || File::open("/dev/tty").is_ok() }
    }

    /// The keys pressed since the last call, without waiting for one.
    ///
    /// # Errors
    /// When the terminal is gone.
    fn pressed(&self) -> io::Result<Vec<KeyEvent>> {
        let mut keys = Vec::new();
        loop {
            if !self.connected() {
                return Err(io::Error::new(io::ErrorKind::BrokenPipe, "the terminal has hung up"));
            }
            if !event::poll(Duration::ZERO)? {
                return Ok(keys);
            }
            if let event::Event::Key(key) = event::read()? {
                keys.push(key);
            }
        }
    }
}
