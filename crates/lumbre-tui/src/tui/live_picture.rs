//! A picture that grows in the terminal below the prompt, with one line of progress: the display of
//! `lumbre render`. Without a capable terminal, only lines.

use std::io::{self, IsTerminal, Stderr, Write};
use std::time::{Duration, Instant};

use ratatui::backend::CrosstermBackend;
use ratatui::layout::Constraint;
use ratatui::{Terminal, TerminalOptions, Viewport};

use super::panes::{self, picture};
use super::terminal::terminal_caps::{OutputMode, TerminalCaps, output_mode};
use lumbre_light::film::Image;
use lumbre_metrics::tonemap::Tonemap;

/// Rows of the terminal that the picture takes at most.
const MAX_ROWS: u16 = 24;

/// Shortest time between two pictures, so that drawing takes little of the rendering time.
const PICTURE_PAUSE: Duration = Duration::from_millis(200);

/// Shortest time between two lines without a terminal.
const LINE_PAUSE: Duration = Duration::from_secs(10);

/// The display; it ends with the last picture on the screen.
pub struct LivePicture {
    screen: Screen,
    /// Tone map of the picture.
    display: Tonemap,
    shown: Option<Instant>,
}

/// Device on which the picture is shown.
enum Screen {
    /// Rows of a terminal, at the cursor.
    Rows {
        terminal: Terminal<CrosstermBackend<Stderr>>,
        caps: TerminalCaps,
    },
    /// Lines of text.
    Lines,
}

impl LivePicture {
    /// Opens the display on stderr. `lines_only` is set to show no picture.
    pub fn open(display: Tonemap, lines_only: bool) -> LivePicture {
        let env = |name: &str| std::env::var(name).ok();
        let is_terminal = io::stderr().is_terminal() && io::stdout().is_terminal();
        let capable = !lines_only && output_mode(is_terminal, &env) == OutputMode::Dashboard;
        let rows = capable.then(|| open_rows().ok()).flatten();
        LivePicture {
            screen: rows.map_or(Screen::Lines, |terminal| Screen::Rows {
                terminal,
                caps: TerminalCaps::from_env(&env),
            }),
            display,
            shown: None,
        }
    }

    /// Shows a picture and a line, unless the last ones were shown a moment ago. Errors of the
    /// terminal are ignored.
    pub fn show(&mut self, image: &Image, line: &str) {
        let pause = match self.screen {
            Screen::Rows { .. } => PICTURE_PAUSE,
            Screen::Lines => LINE_PAUSE,
        };
        let now = Instant::now();
        let first_line = self.shown.is_none() && matches!(self.screen, Screen::Lines);
        if first_line || self.shown.is_some_and(|shown| now - shown < pause) {
            // The first line would come before there is anything to say.
            self.shown.get_or_insert(now);
            return;
        }
        self.shown = Some(now);
        self.draw(image, line);
    }

    /// Shows a picture and a line at once.
    pub fn draw(&mut self, image: &Image, line: &str) {
        match &mut self.screen {
            Screen::Rows { terminal, caps } => {
                let (display, caps) = (self.display, *caps);
                let _ = terminal.draw(|frame| {
                    let parts = [Constraint::Fill(1), Constraint::Length(1)];
                    let [picture_at, line_at] = panes::rows(frame.area(), parts);
                    picture::draw_image(frame, picture_at, caps, image, 0.0, display);
                    frame.render_widget(line, line_at);
                });
            }
            Screen::Lines => {
                let _ = writeln!(io::stderr(), "{line}");
            }
        }
    }
}

impl Drop for LivePicture {
    fn drop(&mut self) {
        if let Screen::Rows { terminal, .. } = &mut self.screen {
            // The cursor goes below the picture, to the start of a row.
            let area = terminal.get_frame().area();
            let _ = terminal.set_cursor_position((0, area.bottom().saturating_sub(1)));
            let _ = terminal.show_cursor();
            let _ = writeln!(io::stderr());
        }
    }
}

/// Reserves rows of the terminal at the cursor.
fn open_rows() -> io::Result<Terminal<CrosstermBackend<Stderr>>> {
    let (_, rows) = crossterm::terminal::size()?;
    Terminal::with_options(
        CrosstermBackend::new(io::stderr()),
        TerminalOptions {
            viewport: Viewport::Inline(MAX_ROWS.min(rows.saturating_sub(2)).max(2)),
        },
    )
}
