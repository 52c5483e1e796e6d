//! `lumbre render`: one picture of one scene, without a script.

use std::sync::Arc;
use std::time::{Duration, Instant};

use serde_json::{Value as Json, json};

use super::{files, settings};
use crate::cli::args::{Global, RenderArgs};
use crate::cli::exit::{Exit, Failure, print_result, print_status};
use crate::cli::format::{counted, display_path, duration, rounded};
use crate::cli::json;
use crate::cli::night::load::print_notes_and_warnings;
use crate::cli::night::signals;
use crate::cli::tev::Tev;
use lumbre_light::film::{Film, Image};
use lumbre_light::scene::compile::compile_sharing;
use lumbre_light::transport::integrator::external::is_external;
use lumbre_metrics::tonemap::Tonemap;
use lumbre_night::backends;
use lumbre_night::experiment::{Cell, NightControls, memory};
use lumbre_render::denoise::{self, Denoise};
use lumbre_render::external::{self, Access};
use lumbre_render::{Job, Picture, RenderError, Renderer, WaveStats};
use lumbre_report::exr;
use lumbre_tui::tui::live_picture::LivePicture;

/// Samples per pixel if neither `--spp` nor `--time` is given.
const DEFAULT_SAMPLES: u64 = 64;

/// Seconds of rendering between two updates of the preview, about.
const SLICE_S: f64 = 0.25;

/// Shortest time between two pictures in another program's viewer.
const VIEWER_PAUSE: Duration = Duration::from_secs(1);

/// Runs `lumbre render`: renders a picture, shows its progress, and writes it to files.
pub fn main(args: &RenderArgs, global: &Global) -> Result<Exit, Failure> {
    let outputs = files::outputs(&args.output, &args.picture.scene.file).map_err(Failure::usage)?;
    let plan = settings::plan(args, global)?;
    for output in &outputs {
        // Found before rendering, which may take hours.
        lumbre_night::store::probe(output.folder()).map_err(Failure::usage)?;
    }
    print_notes_and_warnings(&plan, global.quiet);
    if let Some(skipped) = plan.skipped.first() {
        return Err(Failure::usage(&skipped.reason));
    }
    let [cell] = &plan.cells[..] else {
        return Err(Failure::internal("the plan has more than one cell"));
    };
    let mut films = cell.config.films.iter();
    if let Some(layer) = films.find(|layer| layer.row().exr.is_empty()) {
        return Err(Failure::usage(format!(
            "the layer `{}` has several pictures, for which `lumbre render` writes no files: leave \
             it out of `films`, or render by a script",
            layer.row().name
        )));
    }
    let controls = Arc::new(NightControls::default());
    let stop_signal = signals::install(Arc::clone(&controls))?;
    let display = Tonemap::Srgb {
        exposure: args.exposure,
    };
    let mut session = Session {
        renderer: open(cell, args.seed, global)?,
        limits: Limits::new(args),
        done: WaveStats::default(),
        preview: (!global.quiet).then(|| LivePicture::open(display, global.no_tui)),
        viewer: args.tev.as_deref().map(Viewer::connect).transpose()?,
        started: Instant::now(),
    };
    let picture = session.render(&controls)?;
    let Session {
        renderer,
        done,
        preview,
        ..
    } = session;
    drop(preview);
    let film = renderer.film();
    let metadata = metadata(args, cell, film);
    let layers = renderer.layer_images().map_err(Failure::internal)?;
    let extras = exr::Extras {
        layers: &layers,
        samples: Some(film.samples),
        render_s: Some(done.render_s),
    };
    for output in &outputs {
        let bytes = output
            .encode(&picture.image, &extras, display, &metadata)
            .map_err(Failure::internal)?;
        lumbre_night::store::write_atomically(&output.path, &bytes).map_err(Failure::internal)?;
    }
    let paths: Vec<String> = outputs.iter().map(|o| display_path(&o.path)).collect();
    if !global.quiet {
        print_status(&summary(cell, film, &done));
    }
    if args.json {
        json::print(summary_json(cell, film, &done, &paths))?;
    } else {
        print_result(&format!("{}\n", paths.join("\n")))?;
    }
    Ok(if controls.stop_requested() {
        stop_signal.exit()
    } else {
        Exit::Done
    })
}

/// Opens the renderer of a cell.
fn open(cell: &Cell, seed: u64, global: &Global) -> Result<Box<dyn Renderer>, Failure> {
    let config = &cell.config;
    let limit = memory::free(global.memory, 0);
    let shortage = limit.and_then(|limit| memory::shortage(1, memory::run_bytes(config), &limit));
    if let Some(shortage) = shortage {
        return Err(Failure::usage(shortage));
    }
    let (scene, notes) =
        compile_sharing(&cell.scene, config.accel.instances).map_err(Failure::usage)?;
    if !global.quiet {
        notes
            .iter()
            .for_each(|note| print_status(&format!("note: {note}")));
    }
    let job = config
        .job(scene.resolution, scene.max_depth, global.threads)
        .map_err(Failure::usage)?;
    let job = Job { seed, ..job };
    let start = |job: Job| {
        if is_external(job.integrator) {
            let access = Access {
                commands: false,
                cancelled: &|| false,
            };
            external::open(&cell.scene, &config.integrator, &job, &access)
        } else {
            backends::open(&config.backend, Arc::new(scene), job)
        }
    };
    denoise::open::<RenderError>(job, start).map_err(Failure::usage)
}

/// When rendering stops.
#[derive(Clone, Copy, Debug)]
struct Limits {
    /// Samples per pixel.
    samples: Option<u64>,
    /// Seconds inside the renderer.
    seconds: Option<f64>,
}

impl Limits {
    fn new(args: &RenderArgs) -> Limits {
        let samples = match (args.spp, args.time) {
            (None, None) => Some(DEFAULT_SAMPLES),
            (samples, _) => samples,
        };
        Limits {
            samples,
            seconds: args.time,
        }
    }

    /// Returns the number of samples of the next wave: what is likely to take [`SLICE_S`], and no
    /// more than is left. 0 if a limit is reached.
    fn next_wave(self, done: &WaveStats) -> u64 {
        let by_samples = self
            .samples
            .map_or(u64::MAX, |most| most.saturating_sub(done.samples));
        let by_time = match self.seconds {
            Some(most) if done.render_s >= most => 0,
            Some(most) => done.samples_in(most - done.render_s),
            None => u64::MAX,
        };
        done.samples_in(SLICE_S).min(by_samples).min(by_time)
    }

    /// Returns the estimated seconds of rendering that are left.
    fn seconds_left(self, done: &WaveStats) -> f64 {
        let by_samples = self.samples.map_or(f64::INFINITY, |most| {
            most.saturating_sub(done.samples) as f64 * done.render_s / done.samples as f64
        });
        let by_time = self
            .seconds
            .map_or(f64::INFINITY, |most| most - done.render_s);
        by_samples.min(by_time).max(0.0)
    }
}

/// A renderer in progress.
struct Session {
    renderer: Box<dyn Renderer>,
    limits: Limits,
    done: WaveStats,
    /// Preview and line of progress; `None` with `--quiet`.
    preview: Option<LivePicture>,
    viewer: Option<Viewer>,
    started: Instant,
}

/// Image viewer that shows the picture in progress.
struct Viewer {
    tev: Tev,
    shown: Option<Instant>,
}

impl Viewer {
    fn connect(address: &str) -> Result<Viewer, Failure> {
        let tev = Tev::connect(address)?;
        Ok(Viewer { tev, shown: None })
    }

    /// Shows the picture, unless it was shown a moment ago and is not the last one.
    fn show(&mut self, image: &Image, is_last: bool) {
        let recent = |shown: Instant| shown.elapsed() < VIEWER_PAUSE;
        if is_last || !self.shown.is_some_and(recent) {
            self.tev.show("lumbre render", image);
            self.shown = Some(Instant::now());
        }
    }
}

impl Session {
    /// Renders until a limit is reached or a stop is requested. Returns the last picture.
    fn render(&mut self, controls: &NightControls) -> Result<Picture, Failure> {
        loop {
            let wave = self.limits.next_wave(&self.done);
            if wave == 0 || (controls.stop_requested() && self.done.samples > 0) {
                let picture = self.renderer.picture().map_err(Failure::internal)?;
                self.done.render_s += picture.extra_s;
                let line = self.progress_line();
                if let Some(preview) = &mut self.preview {
                    preview.draw(&picture.image, &line);
                }
                if let Some(viewer) = &mut self.viewer {
                    viewer.show(&picture.image, true);
                }
                return Ok(picture);
            }
            let stats = self.renderer.advance(wave).map_err(Failure::internal)?;
            if stats.samples == 0 {
                return Err(Failure::internal("the renderer returned no samples"));
            }
            self.done.add(&stats);
            let line = self.progress_line();
            if let Some(preview) = &mut self.preview {
                preview.show(&self.renderer.film().mean(), &line);
            }
            if let Some(viewer) = &mut self.viewer {
                viewer.show(&self.renderer.film().mean(), false);
            }
        }
    }

    /// Describes the progress in one line.
    fn progress_line(&self) -> String {
        let samples = match self.limits.samples {
            Some(most) => format!("{} of {most}", self.done.samples),
            None => self.done.samples.to_string(),
        };
        format!(
            "{samples} samples per pixel, {} elapsed, about {} left",
            duration(self.started.elapsed().as_secs_f64()),
            duration(self.limits.seconds_left(&self.done))
        )
    }
}

/// Describes a finished picture: its size, technique, samples, time, rate and noise.
fn summary(cell: &Cell, film: &Film, done: &WaveStats) -> String {
    let mut text = format!(
        "{}x{} by {}: {} per pixel in {} s, {} million paths per second",
        film.width,
        film.height,
        cell.config.integrator,
        counted(film.samples as usize, "sample"),
        rounded(done.render_s),
        rounded(done.paths as f64 / done.render_s / 1e6)
    );
    match (denoised_by(cell), film.visible_noise()) {
        (Some(denoiser), _) => {
            text += &format!(", denoised by {denoiser}, which makes it biased");
        }
        (None, Some(noise)) => {
            let percent = |noise: f64| rounded(100.0 * noise);
            text += &format!(", noise {} % of the mean", percent(noise));
            let all = film.relative_noise().filter(|all| *all > 1.5 * noise);
            if let Some(all) = all {
                text += &format!(" ({} % with the brightest fireflies)", percent(all));
            }
        }
        (None, None) => {}
    }
    if done.invalid > 0 {
        text += &format!(
            "\nwarning: {} were NaN or infinite and count as black",
            counted(done.invalid as usize, "sample")
        );
    }
    text
}

/// Returns the same as [`summary`] as JSON, with the files of the picture.
fn summary_json(cell: &Cell, film: &Film, done: &WaveStats, files: &[String]) -> Json {
    json!({
        "width": film.width, "height": film.height, "integrator": cell.config.integrator,
        "backend": cell.config.backend, "samples": film.samples, "render_s": done.render_s,
        "paths": done.paths, "relative_noise": film.relative_noise(),
        "visible_noise": film.visible_noise(), "invalid": done.invalid,
        "denoised_by": denoised_by(cell), "files": files,
    })
}

/// Returns the metadata of a picture.
fn metadata(args: &RenderArgs, cell: &Cell, film: &Film) -> Vec<(String, String)> {
    let settings: Vec<String> = args
        .picture
        .settings
        .iter()
        .map(|(key, value)| format!("{key}={value}"))
        .collect();
    [
        ("program", lumbre_night::text::program().to_owned()),
        ("scene", args.picture.scene.text.clone()),
        ("settings", settings.join(" ")),
        ("integrator", cell.config.integrator.clone()),
        ("backend", cell.config.backend.clone()),
        ("samples", film.samples.to_string()),
        ("seed", args.seed.to_string()),
    ]
    .into_iter()
    .chain(denoised_by(cell).map(|denoiser| ("denoised by", denoiser)))
    .map(|(key, value)| (key.to_owned(), value))
    .collect()
}

/// Describes the denoiser of a picture, if it has one.
fn denoised_by(cell: &Cell) -> Option<String> {
    cell.config.denoise.as_ref().map(Denoise::describe)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn done(samples: u64, render_s: f64) -> WaveStats {
        WaveStats {
            samples,
            render_s,
            ..WaveStats::default()
        }
    }

    #[test]
    fn waves_end_exactly_at_a_number_of_samples() {
        let limits = Limits {
            samples: Some(20),
            seconds: None,
        };
        assert_eq!(limits.next_wave(&WaveStats::default()), 1);
        assert_eq!(limits.next_wave(&done(1, 0.05)), 5);
        assert_eq!(limits.next_wave(&done(18, 0.9)), 2);
        assert_eq!(limits.next_wave(&done(20, 1.0)), 0);
    }

    #[test]
    fn the_first_limit_that_is_reached_ends_rendering() {
        let limits = Limits {
            samples: Some(1000),
            seconds: Some(1.0),
        };
        // 128 samples per second; these times have no rounding.
        assert_eq!(limits.next_wave(&done(64, 0.5)), 32);
        assert_eq!(limits.next_wave(&done(112, 0.875)), 16);
        assert_eq!(limits.next_wave(&done(127, 0.9921875)), 1);
        assert_eq!(limits.next_wave(&done(128, 1.0)), 0);
        assert!((limits.seconds_left(&done(50, 0.5)) - 0.5).abs() < 1e-12);
    }
}
