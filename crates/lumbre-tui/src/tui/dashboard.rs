//! The dashboard: a sink that stores the newest state, and a thread that owns the terminal and
//! draws this state.
//!
//! It also shows a night that another process renders. A reader then updates the model from
//! files, and keys cannot control the night.
//!
//! Rendering never waits for the terminal. [`Dashboard::receive`](lumbre_night::experiment::Sink::receive)
//! folds an event into the shared model and returns; the thread copies the model at most ten
//! times per second. A slow terminal loses frames, and a terminal that is gone ends the thread;
//! neither affects the night.

use std::io::{self, Write};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

use crossterm::event::{self, KeyEvent};
use crossterm::{execute, queue, terminal};
use ratatui::layout::Rect;

use super::model::night::NightModel;
use super::model::time_preview::TimePreview;
use super::modes::NightRequest;
use super::panes;
use super::terminal::full_screen::{self, BufferedTerminal, InputEvents};
use super::terminal::terminal_caps::{Graphics, TerminalCaps};
use super::terminal::terminal_guard::TerminalGuard;
use super::view::{PendingRequests, View};
use lumbre_night::experiment::outcome::Level;
use lumbre_night::experiment::{Event, NightControls, Sink, SinkError};

/// Shortest time between two frames.
pub(super) const FRAME_INTERVAL: Duration = Duration::from_millis(100);
/// Interval at which keys are polled.
pub(super) const POLL_INTERVAL: Duration = Duration::from_millis(40);

/// Called when the user quits at once, after the terminal has been restored.
pub type LeaveNow = Box<dyn FnOnce() + Send>;

/// State shared by the event sink and the drawing thread.
#[derive(Debug, Default)]
struct SharedState {
    model: Mutex<NightModel>,
    closed: Mutex<bool>,
    wake: Condvar,
}

impl SharedState {
    fn model(&self) -> MutexGuard<'_, NightModel> {
        self.model.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits one poll interval or until the dashboard ends; returns whether it has ended.
    fn wait(&self) -> bool {
        let closed = self.closed.lock().unwrap_or_else(PoisonError::into_inner);
        let waited = self
            .wake
            .wait_timeout_while(closed, POLL_INTERVAL, |closed| !*closed);
        *waited.unwrap_or_else(PoisonError::into_inner).0
    }
}

/// Origin of the night that is last.
#[derive(Clone, Debug)]
pub enum Role {
    /// The night of this process; keys act through the control.
    Run(Arc<NightControls>),
    /// The night of another process; keys act on the screen only. Times are Unix times in seconds.
    Watch,
}

/// Clock of the received events, in seconds.
#[derive(Clone, Copy, Debug)]
enum Clock {
    Since(Instant),
    Unix,
}

impl Clock {
    fn now_s(self) -> f64 {
        match self {
            Clock::Since(start) => start.elapsed().as_secs_f64(),
            Clock::Unix => SystemTime::now()
                .duration_since(SystemTime::UNIX_EPOCH)
                .map_or(0.0, |d| d.as_secs_f64()),
        }
    }
}

/// The dashboard on the terminal of standard output.
#[derive(Debug)]
pub struct Dashboard {
    shared: Arc<SharedState>,
    clock: Clock,
    thread: Option<JoinHandle<()>>,
}

impl Dashboard {
    /// Acquires the terminal (raw mode, alternate screen) and starts the drawing thread
    /// `dashboard`.
    ///
    /// The second request to stop a night of this process (the first when watching) restores the
    /// terminal and calls `leave_now` on that thread; if it returns, the night continues without a
    /// dashboard.
    ///
    /// # Errors If the terminal cannot be acquired or the thread cannot be started; the terminal is
    /// restored.
    pub fn start(role: Role, leave_now: LeaveNow) -> io::Result<Dashboard> {
        let shared = Arc::new(SharedState::default());
        let clock = match role {
            Role::Run(_) => Clock::Since(Instant::now()),
            Role::Watch => Clock::Unix,
        };
        let guard = TerminalGuard::acquire(full_screen::enter, full_screen::restore)?;
        let caps = TerminalCaps::from_env(&|name| std::env::var(name).ok());
        let terminal = full_screen::open()?;
        let view = View {
            watching: matches!(role, Role::Watch),
            ..View::new(caps)
        };
        let graphics = Graphics::from_env(&|name| std::env::var(name).ok());
        let screen = Screen {
            terminal,
            guard,
            input: InputEvents::new(),
            view,
            graphics,
            role,
            shared: shared.clone(),
            clock,
        };
        let thread = std::thread::Builder::new()
            .name("dashboard".to_owned())
            .spawn(move || {
                // Tone mapping uses rayon. A pool that consists of this thread keeps it from
                // queueing behind the tiles of a wave, which would delay keys. If the pool cannot
                // be built, drawing is slower but correct.
                let _pool = rayon::ThreadPoolBuilder::new()
                    .num_threads(1)
                    .use_current_thread()
                    .build();
                // An error means that the terminal is gone; the night does not depend on it.
                if let Ok(ExitReason::Quit) = screen.run() {
                    leave_now();
                }
            })?;
        Ok(Dashboard {
            shared,
            clock,
            thread: Some(thread),
        })
    }

    /// Changes the model directly, for a night that is read from files instead of events.
    pub fn update_model(&self, change: impl FnOnce(&mut NightModel)) {
        change(&mut self.shared.model());
    }

    /// Whether the drawing thread has ended: the user left, or the terminal is gone.
    pub fn is_over(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Returns a handle that appends messages to the log pane from any thread.
    pub fn log_handle(&self) -> LogHandle {
        LogHandle {
            shared: Arc::clone(&self.shared),
            clock: self.clock,
        }
    }

    /// Ends the thread and restores the terminal.
    pub fn finish(mut self) {
        self.close();
    }

    fn close(&mut self) {
        *self
            .shared
            .closed
            .lock()
            .unwrap_or_else(PoisonError::into_inner) = true;
        self.shared.wake.notify_all();
        if let Some(thread) = self.thread.take() {
            // The panic hook has reported a panic of the drawing thread; the night is unaffected.
            let _ = thread.join();
        }
    }
}

/// Handle that appends messages to the log pane.
#[derive(Clone, Debug)]
pub struct LogHandle {
    shared: Arc<SharedState>,
    clock: Clock,
}

impl LogHandle {
    /// Appends a message that does not concern a cell.
    pub fn append(&self, level: Level, text: &str) {
        let at_s = self.clock.now_s();
        self.shared.model().log(level, text, at_s);
    }
}

impl Drop for Dashboard {
    fn drop(&mut self) {
        self.close();
    }
}

impl Sink for Dashboard {
    fn receive(&mut self, event: &Event) -> Result<(), SinkError> {
        let at_s = self.clock.now_s();
        // Before locking the model, so that keys do not wait for it.
        let time_preview = TimePreview::from_event(event);
        let mut model = self.shared.model();
        model.receive(event, at_s);
        if let Some(time_preview) = time_preview {
            model.set_time_preview(time_preview);
        }
        Ok(())
    }

    fn wants_times(&self) -> bool {
        true
    }
}

/// Reason why the drawing thread ended.
enum ExitReason {
    /// The dashboard was closed.
    Closed,
    /// The user wants to quit at once.
    Quit,
}

/// State of the drawing thread.
struct Screen {
    terminal: BufferedTerminal,
    guard: TerminalGuard,
    input: InputEvents,
    view: View,
    graphics: Graphics,
    role: Role,
    shared: Arc<SharedState>,
    clock: Clock,
}

/// Everything that a frame depends on; a frame with an equal key is not drawn again.
#[derive(Clone, Copy, PartialEq)]
struct FrameKey {
    revision: u64,
    tick: u64,
    area: Rect,
    requests: PendingRequests,
}

impl Screen {
    /// Draws and handles keys until the dashboard is closed.
    ///
    /// # Errors
    /// If the terminal can no longer be written to.
    fn run(mut self) -> io::Result<ExitReason> {
        let mut last = None;
        let mut drawn: Option<Instant> = None;
        let mut lost_at: Option<u64> = None;
        loop {
            if self.shared.wait() {
                return Ok(ExitReason::Closed);
            }
            if !self.guard.is_acquired() {
                // A panic restored the terminal. If events continue, only a cell was affected.
                let revision = self.shared.model().revision;
                if *lost_at.get_or_insert(revision) == revision {
                    continue;
                }
                self.guard.reacquire(full_screen::enter)?;
                // Do not clear: that queries the terminal's cursor position and waits for a reply.
                self.terminal = full_screen::open()?;
                (last, lost_at) = (None, None);
            }
            let mut touched = false;
            for event in self.input.pending(Duration::ZERO)? {
                let event::Event::Key(key) = event else {
                    continue;
                };
                touched = true;
                if self.handle_key(key)? {
                    return Ok(ExitReason::Quit);
                }
            }
            if touched {
                last = None;
            }
            if drawn.is_some_and(|at| at.elapsed() < FRAME_INTERVAL) {
                continue;
            }
            let now = self.frame_key()?;
            if last != Some(now) {
                self.draw()?;
                last = Some(now);
                drawn = Some(Instant::now());
            }
        }
    }

    fn frame_key(&self) -> io::Result<FrameKey> {
        let area = full_screen::area()?;
        let now_s = self.clock.now_s();
        let model = self.shared.model();
        Ok(FrameKey {
            revision: model.revision,
            tick: self.view.tick(&model, now_s),
            area,
            requests: self.requests(),
        })
    }

    fn requests(&self) -> PendingRequests {
        match &self.role {
            Role::Run(control) => PendingRequests::from_controls(control),
            Role::Watch => PendingRequests::default(),
        }
    }

    /// Handles a key; returns whether to quit at once.
    fn handle_key(&mut self, key: KeyEvent) -> io::Result<bool> {
        let area = full_screen::area()?;
        self.view.now_s = self.clock.now_s();
        self.view.requests = self.requests();
        let Some(command) = self.view.key(key, &self.shared.model(), area) else {
            return Ok(false);
        };
        let control = match &self.role {
            Role::Run(control) => control,
            Role::Watch => return Ok(command == NightRequest::Stop),
        };
        match command {
            NightRequest::Stop => return Ok(control.request_stop() >= 2),
            NightRequest::StopAfterCell => {
                control.after_cell.toggle();
            }
            NightRequest::Pause(Some(paused)) => control.paused.set(paused),
            NightRequest::Pause(None) => {
                control.paused.toggle();
            }
            NightRequest::PauseAt(limit) => control.set_pause_at(limit),
            NightRequest::Skip => control.skip.set(true),
            NightRequest::Restart => control.restart.set(true),
        }
        Ok(false)
    }

    fn draw(&mut self) -> io::Result<()> {
        self.view.now_s = self.clock.now_s();
        self.view.requests = self.requests();
        // Reducing the picture is slow and writing may block: do neither while holding the lock.
        let model = self.shared.model().clone();
        if !self.view.watching {
            self.view.gauges.borrow_mut().refresh(model.devices());
        }
        // Without a size, pictures are blocks.
        self.view.graphics = (self.graphics, full_screen::cell_size(self.graphics));
        let (terminal, view) = (&mut self.terminal, &self.view);
        let written = self.guard.write(|| {
            queue!(terminal.backend_mut(), terminal::BeginSynchronizedUpdate)?;
            full_screen::fit(terminal)?;
            terminal.draw(|frame| panes::draw(frame, &model, view))?;
            execute!(terminal.backend_mut(), terminal::EndSynchronizedUpdate)?;
            terminal.backend_mut().flush()
        });
        written.unwrap_or(Ok(()))
    }
}
