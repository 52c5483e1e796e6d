//! The whole terminal as a screen: entering and leaving it, a buffered terminal to draw on, and its
//! input.

use std::fs::File;
use std::io::{self, BufWriter, IsTerminal, Stdout};
use std::time::Duration;

use crossterm::event::{self, DisableMouseCapture, EnableMouseCapture, Event};
use crossterm::{cursor, execute, terminal};
use ratatui::backend::CrosstermBackend;
use ratatui::layout::Rect;
use ratatui::{Terminal, TerminalOptions, Viewport};

use super::terminal_caps::Graphics;

/// The terminal; a frame is buffered as a whole before it is written.
pub type BufferedTerminal = Terminal<CrosstermBackend<BufWriter<Stdout>>>;

/// Greatest numbers of columns and rows that are drawn on. A terminal may claim to have 65,535 of
/// both, and a frame takes about 80 bytes for each character.
const MAX_SIZE: [u16; 2] = [1000, 500];

/// Returns the part of the terminal that is drawn on: all of it, up to [`MAX_SIZE`].
///
/// # Errors
/// If the size of the terminal cannot be determined.
pub fn area() -> io::Result<Rect> {
    let (columns, rows) = terminal::size()?;
    let [max_columns, max_rows] = MAX_SIZE;
    Ok(Rect::new(
        0,
        0,
        columns.min(max_columns),
        rows.min(max_rows),
    ))
}

/// Opens standard output for drawing on the [area](area).
///
/// # Errors
/// If the size of the terminal cannot be determined.
pub fn open() -> io::Result<BufferedTerminal> {
    let stdout = BufWriter::with_capacity(1 << 16, io::stdout());
    let viewport = Viewport::Fixed(area()?);
    Terminal::with_options(CrosstermBackend::new(stdout), TerminalOptions { viewport })
}

/// Follows a change of the terminal's size.
///
/// # Errors
/// If the size of the terminal cannot be determined, or the terminal cannot be written to.
pub fn fit(screen: &mut BufferedTerminal) -> io::Result<()> {
    let area = area()?;
    if screen.get_frame().area() != area {
        screen.resize(area)?;
    }
    Ok(())
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
