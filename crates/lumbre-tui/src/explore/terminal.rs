//! The program on the terminal of this process.

use std::io::{self, Write};
use std::time::{Duration, Instant};

use crossterm::{execute, queue, terminal};
use ratatui::layout::Rect;

use super::explorer::{ExploreOptions, Explorer};
use crate::tui::terminal::full_screen::{self, InputEvents};
use crate::tui::terminal::terminal_caps::{Graphics, TerminalCaps};
use crate::tui::terminal::terminal_guard::TerminalGuard;

/// Longest wait for a key before new pictures are looked for.
const POLL: Duration = Duration::from_millis(15);

/// Shortest time between two frames.
const FRAME: Duration = Duration::from_millis(33);

/// Runs the program until the user quits or `stop_requested` returns true.
///
/// # Errors
/// If the terminal cannot be used, or is gone.
pub fn run(options: ExploreOptions, stop_requested: &dyn Fn() -> bool) -> io::Result<()> {
    let env = |name: &str| std::env::var(name).ok();
    let protocol = Graphics::from_env(&env);
    let guard = TerminalGuard::acquire(
        full_screen::enter_with_mouse,
        full_screen::restore_with_mouse,
    )?;
    let mut screen = full_screen::open()?;
    let graphics = (protocol, full_screen::cell_size(protocol));
    let mut explorer = Explorer::new(options, TerminalCaps::from_env(&env), graphics)?;
    let input = InputEvents::new();
    let (mut area, mut drawn) = (Rect::ZERO, None::<Instant>);
    let mut dirty = true;
    loop {
        if stop_requested() {
            return Ok(());
        }
        let now = full_screen::area()?;
        if now != area {
            area = now;
            explorer.graphics.1 = full_screen::cell_size(protocol);
            explorer.resize(area);
            dirty = true;
        }
        for event in input.pending(POLL)? {
            dirty = true;
            if explorer.event(&event) {
                return Ok(());
            }
        }
        dirty |= explorer.poll();
        if !dirty || drawn.is_some_and(|at| at.elapsed() < FRAME) {
            continue;
        }
        let written = guard.write(|| {
            queue!(screen.backend_mut(), terminal::BeginSynchronizedUpdate)?;
            full_screen::fit(&mut screen)?;
            screen.draw(|frame| explorer.draw(frame))?;
            execute!(screen.backend_mut(), terminal::EndSynchronizedUpdate)?;
            screen.backend_mut().flush()
        });
        // Without a result a panic has restored the terminal.
        written
            .unwrap_or_else(|| Err(io::Error::other("the terminal was restored after a panic")))?;
        (drawn, dirty) = (Some(Instant::now()), false);
    }
}
