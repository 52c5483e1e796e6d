//! `lumbre watch`: the dashboard for a night that another process renders or has rendered.

use std::fs::File;
use std::io::{BufReader, IsTerminal};
use std::sync::Arc;
use std::time::Duration;

use super::follow::{apply, open_follower};
use super::{page_server, status};
use crate::cli::args::{Global, StatusArgs, WatchArgs};
use crate::cli::exit::{Exit, Failure};
use crate::cli::night::log::Log;
use crate::cli::night::signals;
use lumbre_light::scene::desc::MAX_SIDE;
use lumbre_night::experiment::NightControls;
use lumbre_night::store::TimesFile;
use lumbre_report::time;
use lumbre_tui::tui::model::night::NightModel;
use lumbre_tui::tui::model::time_preview::{TimePreview, TimePreviewBuilder};
use lumbre_tui::tui::{self, Dashboard, Role};

/// Time between two reads of the files.
const FILE_POLL_INTERVAL: Duration = Duration::from_millis(500);
/// Time between two checks whether the dashboard was closed.
const EXIT_POLL_INTERVAL: Duration = Duration::from_millis(50);

/// Runs `lumbre watch`: shows a night in the dashboard, or prints its status without a terminal.
pub fn main(args: &WatchArgs, global: &Global, log: &Log) -> Result<Exit, Failure> {
    if let Some(port) = args.page {
        return page_server::main(args.folder.as_deref(), port, global);
    }
    let env = |name: &str| std::env::var(name).ok();
    let whole_screen =
        tui::output_mode(std::io::stdout().is_terminal(), &env) == tui::OutputMode::Dashboard;
    if !whole_screen || global.no_tui {
        return status::main(
            &StatusArgs {
                folder: args.folder.clone(),
                json: false,
            },
            global,
        );
    }
    let mut follower = open_follower(args.folder.as_deref(), global)?;
    // Signals end only this dashboard; the process that renders the night handles its own.
    let control = Arc::new(NightControls::default());
    signals::install(Arc::clone(&control))?;
    log.defer_stderr();
    let dashboard = Dashboard::start(Role::Watch, Box::new(|| {})).map_err(Failure::internal)?;
    dashboard.update_model(|model| *model = NightModel::new(follower.night().clone()));
    let mut waited = FILE_POLL_INTERVAL;
    while !dashboard.is_over() && !control.stop_requested() {
        if waited >= FILE_POLL_INTERVAL {
            // Read files before the model is locked, so that a slow disk does not block keys.
            if let Some(changes) = follower.poll() {
                let preview = changes.times.iter().rev().find_map(load_time_preview);
                dashboard.update_model(|model| {
                    apply(model, changes);
                    if let Some(preview) = preview {
                        model.set_time_preview(preview);
                    }
                });
            }
            waited = Duration::ZERO;
        }
        std::thread::sleep(EXIT_POLL_INTERVAL);
        waited += EXIT_POLL_INTERVAL;
    }
    drop(dashboard);
    log.resume_stderr();
    Ok(Exit::Done)
}

/// Loads the preview of a run's time axis row by row. Returns `None` if the file cannot be read or
/// does not match the axis.
fn load_time_preview(TimesFile { cell, file, axis }: &TimesFile) -> Option<TimePreview> {
    let mut reader = BufReader::new(File::open(file).ok()?);
    let [height, width, bins, 3] = time::read_shape(&mut reader).ok()?[..] else {
        return None;
    };
    let size = [u32::try_from(width).ok()?, u32::try_from(height).ok()?];
    if bins != axis.bins as usize || size[0].max(size[1]) > MAX_SIDE {
        return None;
    }
    let mut preview = TimePreviewBuilder::new(*cell, *axis, size);
    for _ in 0..height {
        let row = time::read_numbers(&mut reader, width * bins * 3).ok()?;
        preview.add_row(row.as_chunks::<3>().0.iter().copied());
    }
    preview.finish()
}

#[cfg(test)]
mod tests {
    use crate::cli::inspect::watch::*;
    use lumbre_light::film::time::{TimeAxis, TimeCube};
    use lumbre_night::experiment::CellRef;

    #[test]
    fn a_time_preview_from_a_file_equals_the_rendered_one() {
        let axis = TimeAxis {
            start: 1.0,
            bin: 0.5,
            bins: 5,
        };
        let (width, height) = (7, 3);
        let slots = width * height * axis.slots();
        let sum: Vec<[f64; 3]> = (0..slots)
            .map(|i| [i as f64 % 5.0, 0.25 * i as f64, 1.0])
            .collect();
        let cube = TimeCube {
            axis,
            width: 7,
            height: 3,
            samples: 4,
            square: vec![[0.0; 3]; slots],
            sum,
        };
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("time-cube.npy");
        let files = time::files(&cube, None, &[]).unwrap();
        let bytes = files
            .iter()
            .find(|f| f.name == "time-cube.npy")
            .map(|f| f.bytes.clone())
            .unwrap();
        std::fs::write(&file, &bytes).unwrap();
        let cell = CellRef::Cell(3);
        let timed = |axis| TimesFile {
            cell,
            file: file.clone(),
            axis,
        };
        assert_eq!(
            load_time_preview(&timed(axis)),
            TimePreview::from_cube(cell, &cube)
        );
        assert!(load_time_preview(&timed(axis)).is_some());
        assert_eq!(
            load_time_preview(&timed(TimeAxis { bins: 6, ..axis })),
            None,
            "the file of another run"
        );
        std::fs::write(&file, &bytes[..bytes.len() - 1]).unwrap();
        assert_eq!(load_time_preview(&timed(axis)), None, "a truncated file");
    }
}
