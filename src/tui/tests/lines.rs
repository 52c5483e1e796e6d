//! The line sink.

use insta::assert_snapshot;
use std::io::{self, Write};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use super::night::{self, Teller, in_the_middle};
use crate::experiment::event::Level;
use crate::experiment::{CellRef, Event, Outcome, Sink};
use crate::tui::line::{LineOptions, LineSink};

/// A writer whose text can be read back, and which may break like a pipe after some writes.
#[derive(Clone, Default)]
struct Page {
    text: Arc<Mutex<Vec<u8>>>,
    writes_left: Option<Arc<Mutex<usize>>>,
}

impl Write for Page {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if let Some(left) = &self.writes_left {
            let mut left = left.lock().unwrap();
            *left = left.checked_sub(1).ok_or(io::ErrorKind::BrokenPipe)?;
        }
        self.text.lock().unwrap().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn told(night: &Teller, options: LineOptions) -> String {
    let page = Page::default();
    // In milliseconds: the clock of the night that is told.
    let now = Arc::new(AtomicU64::new(0));
    let clock = Arc::clone(&now);
    let clock = Box::new(move || clock.load(Ordering::Relaxed) as f64 / 1e3);
    let mut sink = LineSink::with_clock(Box::new(page.clone()), options, clock);
    for (event, at_s) in &night.events {
        now.store((at_s * 1e3) as u64, Ordering::Relaxed);
        sink.hear(event).unwrap();
    }
    String::from_utf8(page.text.lock().unwrap().clone()).unwrap()
}

fn whole_night() -> Teller {
    let mut night = in_the_middle();
    night
        .finish(CellRef::Cell(2), Some(7), Outcome::Failed("backend `cpu` failed:\nno memory\u{1b}[2J".to_owned()))
        .say(Level::Error, Some(CellRef::Cell(2)), "no memory")
        .render(CellRef::Cell(3), 8)
        .finish(CellRef::Cell(3), Some(8), Outcome::Interrupted)
        .end();
    night
}

#[test]
fn a_night_in_lines() {
    assert_snapshot!("lines", told(&whole_night(), LineOptions::default()));
}

#[test]
fn a_quiet_night_says_only_what_is_wrong_and_how_it_ended() {
    assert_snapshot!("lines-quiet", told(&whole_night(), LineOptions { quiet: true, color: false }));
}

#[test]
fn colours_are_reset_on_every_line_and_nothing_else_steers_the_terminal() {
    let text = told(&whole_night(), LineOptions { quiet: false, color: true });
    for line in text.lines() {
        assert!(!line.contains('\u{1b}') || line.ends_with("\u{1b}[0m"), "{line:?}");
        assert!(line.matches('\u{1b}').count() <= 2, "{line:?}");
    }
    assert!(text.contains("\u{1b}[1;31m"));
}

#[test]
fn a_running_cell_is_neither_silent_nor_talkative() {
    let mut sink_night = Teller::new(night::plan());
    sink_night.render(CellRef::Cell(0), 0);
    let cell = CellRef::Cell(0);
    for i in 1..=1000u32 {
        let mut row = night::row(3);
        (row.samples, row.wall_s) = (u64::from(i), f64::from(i) * 0.1);
        let wave = Event::Wave { cell, row, measure_s: 0.0, image: night::picture(1), pow2: i.is_power_of_two() };
        sink_night.events.push((wave, 0.0));
    }
    let text = told(&sink_night, LineOptions::default());
    let seen: Vec<&str> = text.lines().skip(2).filter_map(|l| l.split("spp ").nth(1)?.split("  ").next()).collect();
    // Powers of two once two seconds have passed, else every ten seconds of the hundred.
    assert_eq!(seen, ["32", "64", "128", "228", "256", "356", "456", "512", "612", "712", "812", "912"]);
}

#[test]
fn a_reader_that_leaves_costs_nothing() {
    let page = Page { writes_left: Some(Arc::new(Mutex::new(5))), ..Page::default() };
    let mut sink = LineSink::new(Box::new(page.clone()), LineOptions::default());
    for (event, _) in &whole_night().events {
        sink.hear(event).unwrap();
    }
    assert!(!page.text.lock().unwrap().is_empty());
}

#[test]
fn the_night_is_summed_up_once_a_minute() {
    let mut night = Teller::new(Arc::new(night::plan_over(&(1..=9).collect::<Vec<_>>(), &[0.5])));
    for i in 0..9 {
        // 16.9 seconds each.
        night.render(CellRef::Cell(i), 8).finish(CellRef::Cell(i), Some(8), Outcome::Done("256 spp".to_owned()));
    }
    let text = told(night.end(), LineOptions::default());
    let sums: Vec<&str> = text.lines().filter(|line| line.contains("elapsed")).collect();
    assert_eq!(sums.len(), 2, "{text}");
    let first = "night first_light-3f9a: 3 of 9 cells, 0 of 1 reference, 1m08s elapsed, ";
    assert!(sums[0].starts_with(first), "{}", sums[0]);
    assert!(sums[0].ends_with("left, now depth=4 aa=0.5"), "{}", sums[0]);
}
