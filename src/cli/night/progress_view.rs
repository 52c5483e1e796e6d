//! Choice between the dashboard and progress lines for a running night.

use std::io::IsTerminal;
use std::sync::Arc;

use super::log::Log;
use crate::cli::args::Global;
use crate::cli::exit::Exit;
use lumbre_night::experiment::outcome::Level;
use lumbre_night::experiment::{NightControls, Sink};
use lumbre_tui::tui;

/// Display of a running night: the dashboard, or lines on stderr.
pub(in crate::cli) enum ProgressView {
    /// Dashboard over the full screen.
    Dashboard(tui::Dashboard),
    /// Plain lines on stderr.
    Lines(Box<tui::ProgressLines>),
}

impl ProgressView {
    /// Starts the dashboard if stdout is a terminal that supports it and neither `--no-tui` nor
    /// `--quiet` was given. Otherwise, or if the dashboard fails to start, uses progress lines.
    pub(in crate::cli) fn new(
        control: &Arc<NightControls>,
        global: &Global,
        log: &Log,
    ) -> ProgressView {
        let env = |name: &str| std::env::var(name).ok();
        let full_screen =
            tui::output_mode(std::io::stdout().is_terminal(), &env) == tui::OutputMode::Dashboard;
        if full_screen && !global.no_tui && !global.quiet {
            log.defer_stderr();
            let exit_now = Box::new(|| std::process::exit(i32::from(Exit::Interrupted.code())));
            match tui::Dashboard::start(tui::Role::Run(Arc::clone(control)), exit_now) {
                Ok(dashboard) => {
                    let log_handle = dashboard.log_handle();
                    log.set_listener(Box::new(move |level, text| {
                        log_handle.append(dashboard_level(level), text)
                    }));
                    return ProgressView::Dashboard(dashboard);
                }
                Err(e) => {
                    log.resume_stderr();
                    tracing::warn!("cannot start the dashboard: {e}");
                }
            }
        }
        let color = tui::use_colors(std::io::stderr().is_terminal(), &env);
        let options = tui::ProgressLineOptions {
            quiet: global.quiet,
            color,
        };
        ProgressView::Lines(Box::new(tui::ProgressLines::new(
            Box::new(std::io::stderr()),
            options,
        )))
    }

    /// Returns the sink that receives the events of the night.
    pub(in crate::cli) fn sink(&mut self) -> &mut dyn Sink {
        match self {
            ProgressView::Dashboard(dashboard) => dashboard,
            ProgressView::Lines(lines) => lines.as_mut(),
        }
    }
}

/// Converts a `tracing` level to the level of a dashboard message.
fn dashboard_level(level: tracing::Level) -> Level {
    match level {
        tracing::Level::ERROR => Level::Error,
        tracing::Level::WARN => Level::Warn,
        _ => Level::Info,
    }
}
