//! The whole terminal as a screen: entering and leaving it, a buffered terminal to draw on, and its
//! input.

use std::fs::File;
use std::io::{self, BufWriter, IsTerminal, Stdout};
use std::time::Duration;

use crossterm::event::{self, DisableMouseCapture, EnableMouseCapture, Event};
use crossterm::{cursor, execute, terminal};
use ratatui::Terminal;
use ratatui::backend::CrosstermBackend;

use super::terminal_caps::Graphics;

/// The terminal; a frame is buffered as a whole before it is written.
pub type BufferedTerminal = Terminal<CrosstermBackend<BufWriter<Stdout>>>;

/// Opens standard output for drawing.
///
/// # Errors
/// If the size of the terminal cannot be determined.
pub fn open() -> io::Result<BufferedTerminal> {
    Terminal::new(CrosstermBackend::new(BufWriter::with_capacity(
        1 << 16,
        io::stdout(),
    )))
}

/// Switches to raw mode and to the alternate screen, and hides the cursor.
///
/// # Errors
/// If the terminal cannot be written to.
pub fn enter() -> io::Result<()> {
    terminal::enable_raw_mode()?;
    execute!(io::stdout(), terminal::EnterAlternateScreen, cursor::Hide)
}

/// Does the same as [`enter`], and asks the terminal to report the mouse.
///
/// # Errors
/// If the terminal cannot be written to.
pub fn enter_with_mouse() -> io::Result<()> {
    enter()?;
    execute!(io::stdout(), EnableMouseCapture)
}

/// Restores the terminal after [`enter`]. Errors are ignored, since they cannot be displayed.
pub fn restore() {
    let _ = execute!(
        io::stdout(),
        terminal::EndSynchronizedUpdate,
        terminal::LeaveAlternateScreen,
        cursor::Show
    );
    let _ = terminal::disable_raw_mode();
}

/// Restores the terminal after [`enter_with_mouse`]. Errors are ignored, since they cannot be
/// displayed.
pub fn restore_with_mouse() {
    let _ = execute!(io::stdout(), DisableMouseCapture);
    restore();
}

/// Returns the width and height of a character cell in pixels; zeros if pictures are blocks or the
/// size is unknown. Queries the operating system, not the terminal.
pub fn cell_size(graphics: Graphics) -> [u16; 2] {
    if graphics == Graphics::Blocks {
        return [0, 0];
    }
    let size = terminal::window_size()
        .ok()
        .filter(|s| s.columns > 0 && s.rows > 0);
    size.map_or([0, 0], |s| [s.width / s.columns, s.height / s.rows])
}

/// Source of input events.
pub struct InputEvents {
    /// Whether standard input is the keyboard; otherwise it is the controlling terminal.
    on_stdin: bool,
}

impl InputEvents {
    /// Creates the source for the terminal of this process.
    pub fn new() -> InputEvents {
        InputEvents {
            on_stdin: io::stdin().is_terminal(),
        }
    }

    /// Whether the terminal is still connected. crossterm 0.29 loops forever when it reads from a
    /// terminal that has hung up, so it must not be polled then.
    fn connected(&self) -> bool {
        if self.on_stdin {
            io::stdin().is_terminal()
        } else {
            cfg!(windows) || File::open("/dev/tty").is_ok()
        }
    }

    /// Returns the events since the last call. Waits for the first one at most as long as `wait`.
    ///
    /// # Errors
    /// If the terminal is gone.
    pub fn pending(&self, wait: Duration) -> io::Result<Vec<Event>> {
        let mut events = Vec::new();
        let mut wait = wait;
        loop {
            if !self.connected() {
                return Err(io::Error::new(
                    io::ErrorKind::BrokenPipe,
                    "the terminal has hung up",
                ));
            }
            if !event::poll(wait)? {
                return Ok(events);
            }
            events.push(event::read()?);
            wait = Duration::ZERO;
        }
    }
}

impl Default for InputEvents {
    fn default() -> InputEvents {
        InputEvents::new()
    }
}
