//! Tests of progress lines.

use insta::assert_snapshot;
use std::io::{self, Write};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use super::night::{self, NightBuilder, in_the_middle};
use crate::tui::progress_lines::{ProgressLineOptions, ProgressLines};
use lumbre_night::experiment::outcome::Level;
use lumbre_night::experiment::{CellRef, EndCause, Event, Outcome, Sink};

/// A writer that records its text and optionally fails like a broken pipe after some writes.
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

fn lines_of(night: &NightBuilder, options: ProgressLineOptions) -> String {
    let page = Page::default();
    // Clock of the night in milliseconds.
    let now = Arc::new(AtomicU64::new(0));
    let clock = Arc::clone(&now);
    let clock = Box::new(move || clock.load(Ordering::Relaxed) as f64 / 1e3);
    let mut sink = ProgressLines::with_clock(Box::new(page.clone()), options, clock);
    for (event, at_s) in &night.events {
        now.store((at_s * 1e3) as u64, Ordering::Relaxed);
        sink.receive(event).unwrap();
    }
    String::from_utf8(page.text.lock().unwrap().clone()).unwrap()
}

fn whole_night() -> NightBuilder {
    let mut night = in_the_middle();
    night
        .finish(
            CellRef::Cell(2),
            Some(7),
            Outcome::Failed("backend `cpu` failed:\nno memory\u{1b}[2J".to_owned()),
        )
        .message(Level::Error, Some(CellRef::Cell(2)), "no memory")
        .render(CellRef::Cell(3), 8)
        .finish(CellRef::Cell(3), Some(8), Outcome::Interrupted)
        .end();
    night
}

#[test]
fn a_night_in_lines() {
    assert_snapshot!(
        "lines",
        lines_of(&whole_night(), ProgressLineOptions::default())
    );
}

#[test]
fn quiet_lines_are_problems_and_the_summary() {
    assert_snapshot!(
        "lines-quiet",
        lines_of(
            &whole_night(),
            ProgressLineOptions {
                quiet: true,
                color: false
            }
        )
    );
}

#[test]
fn colours_are_reset_on_every_line_and_control_characters_removed() {
    let text = lines_of(
        &whole_night(),
        ProgressLineOptions {
            quiet: false,
            color: true,
        },
    );
    for line in text.lines() {
        assert!(
            !line.contains('\u{1b}') || line.ends_with("\u{1b}[0m"),
            "{line:?}"
        );
        assert!(line.matches('\u{1b}').count() <= 2, "{line:?}");
    }
    assert!(text.contains("\u{1b}[1;31m"));
}

#[test]
fn a_running_cell_prints_lines_at_limited_intervals() {
    let mut sink_night = NightBuilder::new(night::plan());
    sink_night.render(CellRef::Cell(0), 0);
    let cell = CellRef::Cell(0);
    for i in 1..=1000u32 {
        let mut row = night::row(3);
        (row.samples, row.wall_s) = (u64::from(i), f64::from(i) * 0.1);
        let wave = Event::Wave {
            cell,
            row,
            measure_s: 0.0,
            image: Some(night::picture(1)),
            noise: None,
            pow2: i.is_power_of_two(),
        };
        sink_night.events.push((wave, 0.0));
    }
    let text = lines_of(&sink_night, ProgressLineOptions::default());
    let seen: Vec<&str> = text
        .lines()
        .skip(2)
        .filter_map(|l| l.split("spp ").nth(1)?.split("  ").next())
        .collect();
    // Powers of two after at least two seconds, and at least one line every ten seconds.
    assert_eq!(
        seen,
        [
            "32", "64", "128", "228", "256", "356", "456", "512", "612", "712", "812", "912"
        ]
    );
}

#[test]
fn a_closed_pipe_is_not_an_error() {
    let page = Page {
        writes_left: Some(Arc::new(Mutex::new(5))),
        ..Page::default()
    };
    let mut sink = ProgressLines::new(Box::new(page.clone()), ProgressLineOptions::default());
    for (event, _) in &whole_night().events {
        sink.receive(event).unwrap();
    }
    assert!(!page.text.lock().unwrap().is_empty());
}

#[test]
fn the_remaining_time_is_printed_every_two_seconds_at_most() {
    let depths: Vec<_> = (1..=9).collect();
    let mut night = NightBuilder::new(Arc::new(night::plan_over(&depths, &[0.5])));
    for i in 0..9 {
        night.render(CellRef::Cell(i), 8).finish(
            CellRef::Cell(i),
            Some(8),
            Outcome::Done(EndCause::other("256 spp")),
        );
    }
    let count = |night: &NightBuilder| {
        let text = lines_of(night, ProgressLineOptions::default());
        text.lines().filter(|l| l.contains("left, about")).count()
    };
    assert_eq!(count(&night), 8);
    for (_, at_s) in &mut night.events {
        *at_s /= 100.0;
    }
    assert_eq!(count(&night), 1, "a cell takes 0.17 seconds");
}

#[test]
fn a_summary_is_printed_once_a_minute() {
    let mut night = NightBuilder::new(Arc::new(night::plan_over(
        &(1..=9).collect::<Vec<_>>(),
        &[0.5],
    )));
    for i in 0..9 {
        // Each cell takes 16.9 seconds.
        night.render(CellRef::Cell(i), 8).finish(
            CellRef::Cell(i),
            Some(8),
            Outcome::Done(EndCause::other("256 spp")),
        );
    }
    let text = lines_of(night.end(), ProgressLineOptions::default());
    let sums: Vec<&str> = text
        .lines()
        .filter(|line| line.contains("elapsed"))
        .collect();
    assert_eq!(sums.len(), 2, "{text}");
    let first = "night first_light-3f9a: 3 of 9 cells, 0 of 1 reference, 1m08s elapsed, ";
    assert!(sums[0].starts_with(first), "{}", sums[0]);
    assert!(sums[0].ends_with("left, now depth=4"), "{}", sums[0]);
}
