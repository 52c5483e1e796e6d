//! The whole terminal as a screen: entering and leaving it, a buffered terminal to draw on, and its
//! input.

use std::cell::Cell;
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

/// Opens standard output for drawing on the [`area`].
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
    /// Terminal whose keyboard is read.
    keyboard: Keyboard,
    /// Columns and rows of the terminal at the last call.
    size: Cell<(u16, u16)>,
}

/// Terminal whose keyboard is read. crossterm 0.29 loops for ever when it reads from one that has
/// hung up, so it is called only when there is input, and does not wait itself.
enum Keyboard {
    /// Standard input of the process.
    Stdin,
    /// The controlling terminal.
    #[cfg_attr(
        windows,
        expect(dead_code, reason = "crossterm waits for keys on Windows")
    )]
    Controlling(File),
    /// There is none.
    None,
}

impl InputEvents {
    /// Creates the source for the terminal of this process.
    pub fn new() -> InputEvents {
        let keyboard = if io::stdin().is_terminal() {
            Keyboard::Stdin
        } else {
            File::open("/dev/tty").map_or(Keyboard::None, Keyboard::Controlling)
        };
        let size = Cell::new(terminal::size().unwrap_or_default());
        InputEvents { keyboard, size }
    }

    /// Returns the events since the last call. Waits for the first one at most as long as `wait`.
    ///
    /// # Errors
    /// If the terminal is gone.
    pub fn pending(&self, wait: Duration) -> io::Result<Vec<Event>> {
        let mut events = Vec::new();
        let waited = self.keyboard.wait(wait)?;
        let size = terminal::size()?;
        // crossterm would lose a key that comes before it has noticed a change of the size.
        let mut left = match waited {
            None => Some(wait),
            Some(false) if self.size.get() == size => None,
            Some(_) => Some(Duration::ZERO),
        };
        while let Some(wait) = left
            && event::poll(wait)?
        {
            events.push(event::read()?);
            // It may have hung up since.
            self.keyboard.wait(Duration::ZERO)?;
            left = Some(Duration::ZERO);
        }
        // A change from before its first call is unknown to crossterm.
        if self.size.replace(size) != size {
            events.push(Event::Resize(size.0, size.1));
        }
        Ok(events)
    }
}

impl Keyboard {
    /// Waits for a key, at most as long as `wait`. Returns whether there is one, or `None` if the
    /// system cannot wait here; crossterm can.
    ///
    /// # Errors
    /// If the terminal has hung up.
    #[cfg(unix)]
    fn wait(&self, wait: Duration) -> io::Result<Option<bool>> {
        use rustix::event::{PollFd, PollFlags, Timespec, poll};
        use std::os::fd::AsFd;

        let hung_up = || io::Error::new(io::ErrorKind::BrokenPipe, "the terminal has hung up");
        let stdin = io::stdin();
        let keyboard = match self {
            Keyboard::Stdin => stdin.as_fd(),
            Keyboard::Controlling(terminal) => terminal.as_fd(),
            Keyboard::None => return Err(hung_up()),
        };
        let timeout = Timespec::try_from(wait).map_err(io::Error::other)?;
        let mut polled = [PollFd::new(&keyboard, PollFlags::IN)];
        match poll(&mut polled, Some(&timeout)) {
            Ok(_) | Err(rustix::io::Errno::INTR) => {}
            Err(e) => return Err(e.into()),
        }
        let state = polled[0].revents();
        if state.intersects(PollFlags::HUP | PollFlags::ERR) {
            return Err(hung_up());
        }
        Ok(match state {
            // macOS cannot poll terminals.
            _ if state.contains(PollFlags::NVAL) => None,
            _ => Some(state.contains(PollFlags::IN)),
        })
    }

    /// Does not wait, since crossterm waits for keys on Windows.
    #[cfg(windows)]
    fn wait(&self, _wait: Duration) -> io::Result<Option<bool>> {
        Ok(None)
    }
}

impl Default for InputEvents {
    fn default() -> InputEvents {
        InputEvents::new()
    }
}
