//! The dashboard without a terminal: it draws when and what it would, and what it would write is counted and thrown away.

use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

use ratatui::backend::CrosstermBackend;
use ratatui::layout::Rect;
use ratatui::{Terminal, TerminalOptions, Viewport};

use super::dashboard::{FRAME, GLANCE};
use super::look::{Colors, Look};
use super::model::Model;
use super::panes;
use super::view::View;

/// What was drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Drawn {
    /// Frames.
    pub frames: u64,
    /// Bytes that the terminal would have got.
    pub bytes: u64,
}

/// Counts what is written.
struct Counted(Arc<AtomicU64>);

impl Write for Counted {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Draws for some time on a screen of so many columns and rows, at the pace of the dashboard. `news` tells the model what
/// has happened at each glance, with the seconds since the beginning, which are the listener's clock.
///
/// # Errors
/// None but the drawing library's own.
pub fn draw_for(
    time: Duration,
    size: (u16, u16),
    model: &mut Model,
    news: &mut dyn FnMut(&mut Model, f64),
) -> io::Result<Drawn> {
    let bytes = Arc::new(AtomicU64::new(0));
    let area = Rect::new(0, 0, size.0, size.1);
    // Of a fixed size, so that no terminal is asked for its own.
    let options = TerminalOptions { viewport: Viewport::Fixed(area) };
    let mut terminal = Terminal::with_options(CrosstermBackend::new(Counted(Arc::clone(&bytes))), options)?;
    let mut view = View::new(Look { colors: Colors::True, ascii: false });
    let (start, mut frames) = (Instant::now(), 0);
    let mut shown: Option<((u64, u64), Instant)> = None;
    while start.elapsed() < time {
        sleep(GLANCE);
        view.now_s = start.elapsed().as_secs_f64();
        news(model, view.now_s);
        let facts = (model.revision, view.tick(model, view.now_s));
        if shown.is_some_and(|(last, at)| last == facts || at.elapsed() < FRAME) {
            continue;
        }
        let copy = model.clone();
        let device = copy.current.as_ref().map_or("", |current| current.open.device.as_str());
        view.gauges.borrow_mut().refresh(device);
        terminal.draw(|frame| panes::draw(frame, &copy, &view))?;
        frames += 1;
        shown = Some((facts, Instant::now()));
    }
    Ok(Drawn { frames, bytes: bytes.load(Ordering::Relaxed) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tui::tests::night::in_the_middle;

    #[test]
    fn only_news_and_seconds_are_drawn() {
        let (mut model, _) = in_the_middle().model();
        let mut told = 0;
        let mut news = |model: &mut Model, now_s: f64| {
            if now_s > 0.3 && told == 0 {
                told = 1;
                model.say(crate::experiment::event::Level::Info, None, "news", now_s);
            }
        };
        let drawn = draw_for(Duration::from_millis(700), (80, 24), &mut model, &mut news).unwrap();
        // The first, the news, and at most one second that begins.
        assert!((2..=3).contains(&drawn.frames), "{drawn:?}");
        assert!(drawn.bytes > 2000, "{drawn:?}");
    }
}
