//! A made-up night on the real terminal, to look at:
//! `cargo test --lib tui::tests::demo -- --ignored --nocapture`.

use std::io::IsTerminal;
use std::sync::Arc;
use std::time::Duration;

use super::night::{self, Teller};
use crate::experiment::event::Level;
use crate::experiment::{CellRef, Control, Outcome, Sink};
use crate::tui::Dashboard;

#[test]
#[ignore = "draws on the terminal; run it by hand"]
fn a_night_on_the_terminal() {
    if !std::io::stdout().is_terminal() {
        println!("SKIPPED: standard output is not a terminal");
        return;
    }
    let mut night = Teller::new(night::plan());
    let reason = || Outcome::Done("1024 spp".to_owned());
    night.render(CellRef::Reference(0), 8).finish(CellRef::Reference(0), Some(8), reason());
    night.say(Level::Info, None, "the reference is kept");
    for i in 0..4 {
        night.render(CellRef::Cell(i), 10).finish(CellRef::Cell(i), Some(10), reason());
    }
    let control = Arc::new(Control::default());
    let leave = Box::new(|| std::process::exit(130));
    let mut dashboard = Dashboard::start(control.clone(), leave).expect("a terminal");
    let panics_at = night.events.len() / 2;
    for (i, (event, _)) in night.events.iter().enumerate() {
        if i == panics_at {
            // The terminal is given back, the message appears, and with the next event the dashboard is there again.
            let caught = std::panic::catch_unwind(|| panic!("on purpose: a cell panics and the night goes on"));
            assert!(caught.is_err());
            std::thread::sleep(Duration::from_secs(1));
        }
        dashboard.hear(event).expect("the dashboard never fails");
        while control.paused() && !control.stop_requested() {
            std::thread::sleep(Duration::from_millis(50));
        }
        std::thread::sleep(Duration::from_millis(300));
        if control.stop_requested() {
            std::thread::sleep(Duration::from_secs(2));
            break;
        }
    }
    dashboard.finish();
    println!("the terminal is as it was");
}
