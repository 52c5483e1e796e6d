//! The dashboard without a terminal: draws at the same pace, counts the output and discards it.

use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

use ratatui::backend::CrosstermBackend;
use ratatui::layout::Rect;
use ratatui::{Terminal, TerminalOptions, Viewport};

use super::terminal_caps::{Colors, TerminalCaps};
use crate::tui::dashboard::{FRAME_INTERVAL, POLL_INTERVAL};
use crate::tui::model::night::NightModel;
use crate::tui::panes;
use crate::tui::view::View;

/// Amount of output drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DrawStats {
    /// Number of frames.
    pub frames: u64,
    /// Number of bytes that a terminal would have received.
    pub bytes: u64,
}

/// A writer that counts bytes and discards them.
struct CountingWriter(Arc<AtomicU64>);

impl Write for CountingWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Draws for `time` on a screen of `size` columns and rows, at the pace of the dashboard.
/// `update` updates the model before each poll; its second argument is the time in seconds since
/// the start.
///
/// # Errors
/// Errors of the drawing library.
pub fn draw_for(
    time: Duration,
    size: (u16, u16),
    model: &mut NightModel,
    update: &mut dyn FnMut(&mut NightModel, f64),
) -> io::Result<DrawStats> {
    let bytes = Arc::new(AtomicU64::new(0));
    let area = Rect::new(0, 0, size.0, size.1);
    // A fixed size avoids a query of the terminal's size.
    let options = TerminalOptions {
        viewport: Viewport::Fixed(area),
    };
    let mut terminal = Terminal::with_options(
        CrosstermBackend::new(CountingWriter(Arc::clone(&bytes))),
        options,
    )?;
    let mut view = View::new(TerminalCaps {
        colors: Colors::True,
        ascii: false,
    });
    let (start, mut frames) = (Instant::now(), 0);
    let mut shown: Option<((u64, u64), Instant)> = None;
    while start.elapsed() < time {
        sleep(POLL_INTERVAL);
        view.now_s = start.elapsed().as_secs_f64();
        update(model, view.now_s);
        let facts = (model.revision, view.tick(model, view.now_s));
        if shown.is_some_and(|(last, at)| last == facts || at.elapsed() < FRAME_INTERVAL) {
            continue;
        }
        let copy = model.clone();
        view.gauges.borrow_mut().refresh(copy.devices());
        terminal.draw(|frame| panes::draw(frame, &copy, &view))?;
        frames += 1;
        shown = Some((facts, Instant::now()));
    }
    Ok(DrawStats {
        frames,
        bytes: bytes.load(Ordering::Relaxed),
    })
}

#[cfg(test)]
mod tests {
    use crate::tui::terminal::offscreen::*;
    use crate::tui::tests::night::in_the_middle;

    #[test]
    fn frames_are_drawn_for_updates_and_new_seconds() {
        let (mut model, _) = in_the_middle().model();
        let mut updates = 0;
        let mut update = |model: &mut NightModel, now_s: f64| {
            if now_s > 0.3 && updates == 0 {
                updates = 1;
                model.log(
                    lumbre_night::experiment::outcome::Level::Info,
                    "news",
                    now_s,
                );
            }
        };
        let drawn = draw_for(
            Duration::from_millis(700),
            (80, 24),
            &mut model,
            &mut update,
        )
        .unwrap();
        // The first frame, the message, and at most one frame for a new second.
        assert!((2..=3).contains(&drawn.frames), "{drawn:?}");
        assert!(drawn.bytes > 2000, "{drawn:?}");
    }
}
