//! The loop of the render thread, and one picture in progress.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

use super::scenes::{Opened, Scenes};
use super::shared::{Frame, Request, SLOTS, SessionOptions, Shared, Status, Wanted, lock};
use crate::explore::settings::Limits;
use lumbre_light::film::{SharedImage, visible_noise};
use lumbre_render::{Advance, Job, RenderError, Renderer, Until, WaveStats};

/// Time that a wave should take, in seconds. A change of the settings abandons a wave anyway on the
/// CPU; on other backends this is how long it waits.
const WAVE_S: f64 = 0.03;

/// Shortest time between two pictures in seconds, so that averaging films takes little time.
const PUBLISH_S: f64 = 0.1;

/// Time that the picture in reduced resolution should take, in seconds.
const COARSE_S: f64 = 0.03;

/// Number of camera paths per second that is assumed before the first wave.
const FIRST_RATE: f64 = 1e6;

/// Greatest part of the rendering time that the estimate of the noise takes.
const NOISE_SHARE: f64 = 0.05;

/// A picture in progress.
struct PictureRun {
    /// Number of the request.
    number: u64,
    asked: Instant,
    request: Arc<Request>,
    state: PictureState,
}

enum PictureState {
    /// Nothing is allocated yet, or a wave was abandoned.
    Requested,
    Open(Box<OpenRun>),
    Failed,
}

struct OpenRun {
    opened: Opened,
    done: WaveStats,
    published: Option<Instant>,
    parts: Parts,
    noise: Option<f64>,
    variance: Option<(SharedImage, u64)>,
    /// Time that the last estimate of the noise took, and when it was made.
    noise_cost_s: f64,
    noise_at: Option<Instant>,
}

/// State of the render thread.
pub(super) struct Worker {
    scenes: Scenes,
    shared: Arc<Shared>,
    runs: [Option<PictureRun>; SLOTS],
    /// Number of camera paths per second of the last waves.
    rate: f64,
}

impl Worker {
    pub fn new(options: SessionOptions, shared: Arc<Shared>) -> Worker {
        Worker {
            scenes: Scenes::new(options),
            shared,
            runs: Default::default(),
            rate: FIRST_RATE,
        }
    }

    /// Renders until the session is closed.
    pub fn run(&mut self) {
        while let Some((slot, limits)) = self.wait_for_work() {
            self.work(slot, limits);
        }
    }

    /// Waits until a picture needs work, and returns the one with the least render time. Returns
    /// `None` if the session is closed.
    fn wait_for_work(&mut self) -> Option<(usize, Limits)> {
        let shared = Arc::clone(&self.shared);
        let mut wanted = shared.wanted();
        loop {
            if wanted.closed {
                return None;
            }
            self.update(&wanted);
            let next = (0..SLOTS)
                .filter(|slot| self.needs_work(*slot, &wanted))
                .min_by(|a, b| self.render_s(*a).total_cmp(&self.render_s(*b)));
            if let Some(slot) = next {
                return Some((slot, wanted.limits[slot]));
            }
            wanted = shared
                .changed
                .wait(wanted)
                .unwrap_or_else(std::sync::PoisonError::into_inner);
        }
    }

    /// Replaces runs whose request is no longer wanted, and publishes what becomes of the others.
    fn update(&mut self, wanted: &Wanted) {
        for (slot, request) in wanted.requests.iter().enumerate() {
            let current = self.runs[slot].as_ref().map(|run| run.number);
            if current == request.as_ref().map(|(number, ..)| *number) {
                let status = self.runs[slot]
                    .as_ref()
                    .and_then(|run| run.idle_status(wanted, slot));
                if let Some(status) = status {
                    self.shared.publish_status(slot, status);
                }
                continue;
            }
            self.runs[slot] = request.as_ref().map(|(number, asked, request)| PictureRun {
                number: *number,
                asked: *asked,
                request: Arc::clone(request),
                state: PictureState::Requested,
            });
            let status = match &self.runs[slot] {
                None => Status::Idle,
                Some(run) if self.scenes.knows(&run.request) => Status::Rendering,
                Some(_) => Status::Loading,
            };
            self.shared.publish(slot, |view| {
                if status == Status::Idle {
                    *view = Default::default();
                }
                view.status = status;
                view.first_picture_s = None;
            });
        }
    }

    fn needs_work(&self, slot: usize, wanted: &Wanted) -> bool {
        match self.runs[slot].as_ref() {
            None => false,
            // Even a paused picture shows its first sample.
            Some(run) if matches!(run.state, PictureState::Requested) => true,
            Some(run) => run.is_open() && run.idle_status(wanted, slot).is_none(),
        }
    }

    fn render_s(&self, slot: usize) -> f64 {
        match self.runs[slot].as_ref().map(|run| &run.state) {
            Some(PictureState::Open(open)) => open.done.render_s,
            _ => 0.0,
        }
    }

    /// Opens a picture, or adds a wave to it.
    fn work(&mut self, slot: usize, limits: Limits) {
        let Some(run) = self.runs[slot].as_mut() else {
            return;
        };
        let result = match &mut run.state {
            PictureState::Requested => {
                let opened = self.scenes.open(&run.request);
                opened.map(|opened| {
                    self.shared.publish(slot, |view| {
                        view.scene = Some(Arc::clone(&opened.scene));
                        view.job = Some(Arc::new(opened.job.clone()));
                        view.device = opened.renderer.open_stats().device_line();
                        view.status = Status::Rendering;
                    });
                    self.show_coarse(slot, &opened);
                    let run = self.runs[slot].as_mut();
                    if let Some(run) = run {
                        run.state = PictureState::Open(Box::new(OpenRun::new(opened)));
                    }
                })
            }
            PictureState::Open(_) => self.wave(slot, limits),
            PictureState::Failed => Ok(()),
        };
        if let Err(reason) = result {
            let number = self.runs[slot].as_mut().map_or(0, |run| {
                run.state = PictureState::Failed;
                run.number
            });
            self.shared.publish(slot, |view| {
                view.status = Status::Failed(reason);
                (view.frame, view.request) = (None, number);
            });
        }
    }

    /// Adds a wave to a picture and publishes it from time to time. A wave for settings that are no
    /// longer wanted is abandoned.
    fn wave(&mut self, slot: usize, limits: Limits) -> Result<(), String> {
        let Some(run) = self.runs[slot].as_mut() else {
            return Ok(());
        };
        let PictureState::Open(open) = &mut run.state else {
            return Ok(());
        };
        let (shared, number) = (&self.shared, run.number);
        let newest = &shared.newest[slot];
        let abandoned = || newest.load(Ordering::SeqCst) != number;
        let samples = open.next_wave(limits);
        let request = Advance {
            until: Until::Abandoned(&abandoned),
            ..Advance::by(samples)
        };
        match open.opened.renderer.render(&request) {
            Ok(stats) => open.done.add(&stats),
            Err(RenderError::Cancelled { .. }) => {
                run.state = PictureState::Requested;
                return Ok(());
            }
            Err(e) => return Err(e.to_string()),
        }
        let rate = open.done.paths as f64 / open.done.render_s;
        if rate.is_finite() && rate > 0.0 {
            self.rate = rate;
        }
        let ends = reaches(&open.done, limits);
        if !ends
            && open
                .published
                .is_some_and(|at| at.elapsed().as_secs_f64() < PUBLISH_S)
        {
            return Ok(());
        }
        let frame = Arc::new(open.frame(ends)?);
        open.published = Some(Instant::now());
        let waited = run.asked.elapsed().as_secs_f64();
        shared.publish(slot, |view| {
            view.frame = Some(frame);
            view.request = number;
            view.first_picture_s.get_or_insert(waited);
            view.status = if ends {
                Status::Finished
            } else {
                Status::Rendering
            };
        });
        Ok(())
    }

    /// Publishes a picture in reduced resolution if the first sample of every pixel would take
    /// long.
    fn show_coarse(&self, slot: usize, opened: &Opened) {
        let Some(run) = self.runs[slot].as_ref() else {
            return;
        };
        let Some(prepared) = opened.scene.prepared.as_ref() else {
            return;
        };
        let [width, height] = opened.job.resolution;
        let pixels = f64::from(width) * f64::from(height);
        let divisor = (pixels / (self.rate * COARSE_S)).sqrt().ceil() as u32;
        // Photons are traced before the first pixel, however few pixels there are.
        if divisor < 2 || opened.job.integrator.sharing.is_some() {
            return;
        }
        let job = Job {
            resolution: [width, height].map(|side| side.div_ceil(divisor)),
            ..opened.job.clone()
        }
        .with(|settings| settings.films = Vec::new());
        let (newest, number) = (&self.shared.newest[slot], run.number);
        let abandoned = || newest.load(Ordering::SeqCst) != number;
        let Ok(mut coarse) = prepared.open(job) else {
            return;
        };
        let request = Advance {
            until: Until::Abandoned(&abandoned),
            ..Advance::by(1)
        };
        if coarse.render(&request).is_err() {
            return;
        }
        let frame = Arc::new(Frame {
            image: Arc::new(coarse.film().mean()),
            samples: 0,
            render_s: 0.0,
            paths: 0,
            rays: 0,
            invalid: 0,
            noise: None,
            variance: None,
            part: None,
            layers: Vec::new(),
        });
        let waited = run.asked.elapsed().as_secs_f64();
        self.shared.publish(slot, |view| {
            view.frame = Some(frame);
            view.request = run.number;
            view.first_picture_s = Some(waited);
        });
    }
}

impl Shared {
    /// Publishes the state of a picture, if it changed.
    fn publish_status(&self, slot: usize, status: Status) {
        if lock(&self.published).slots[slot].status != status {
            self.publish(slot, |view| view.status = status);
        }
    }
}

impl PictureRun {
    fn is_open(&self) -> bool {
        matches!(self.state, PictureState::Open(_))
    }

    /// Returns why no samples are added; `None` if some should be.
    fn idle_status(&self, wanted: &Wanted, slot: usize) -> Option<Status> {
        let PictureState::Open(open) = &self.state else {
            return None;
        };
        if reaches(&open.done, wanted.limits[slot]) {
            return Some(Status::Finished);
        }
        (wanted.paused && open.done.samples > 0).then_some(Status::Paused)
    }
}

/// Whether a picture that has done this much has reached a limit.
fn reaches(done: &WaveStats, limits: Limits) -> bool {
    limits.samples.is_some_and(|most| done.samples >= most)
        || limits.seconds.is_some_and(|most| done.render_s >= most)
}

impl OpenRun {
    fn new(opened: Opened) -> OpenRun {
        OpenRun {
            opened,
            done: WaveStats::default(),
            published: None,
            parts: Parts::default(),
            noise: None,
            variance: None,
            noise_cost_s: 0.0,
            noise_at: None,
        }
    }

    /// Returns the number of samples of the next wave.
    fn next_wave(&self, limits: Limits) -> u64 {
        let left = limits
            .samples
            .map_or(u64::MAX, |most| most.saturating_sub(self.done.samples));
        self.done.samples_in(WAVE_S).min(left).max(1)
    }

    /// Returns the picture with all samples so far. `last` is whether no more follow for now, so
    /// that its noise is estimated whatever that costs.
    fn frame(&mut self, last: bool) -> Result<Frame, String> {
        let film = self.opened.renderer.film();
        let (image, samples) = (Arc::new(film.mean()), self.done.samples);
        let due = self
            .noise_at
            .is_none_or(|at| at.elapsed().as_secs_f64() * NOISE_SHARE > self.noise_cost_s);
        if due || last {
            let start = Instant::now();
            let variance = film.variance_of_mean();
            self.noise = visible_noise(&image, &variance).filter(|_| samples > 1);
            self.variance = (samples > 1).then(|| (Arc::new(variance), samples));
            self.noise_cost_s = start.elapsed().as_secs_f64();
            self.noise_at = Some(Instant::now());
        }
        let part = self.parts.part_of(&image, samples);
        let layers = self.opened.renderer.layer_images();
        let layers = layers.map_err(|e| e.to_string())?;
        Ok(Frame {
            image,
            samples,
            render_s: self.done.render_s,
            paths: self.done.paths,
            rays: self.done.rays,
            invalid: self.done.invalid,
            noise: self.noise,
            variance: self.variance.clone(),
            part,
            layers,
        })
    }
}

/// Pictures that were published at about half and a quarter of the samples, oldest first.
#[derive(Default)]
struct Parts(Vec<(SharedImage, u64)>);

impl Parts {
    /// Remembers a picture if it has twice the samples of the one before. Returns the one with the
    /// most samples up to a half of all.
    fn part_of(&mut self, image: &SharedImage, samples: u64) -> Option<(SharedImage, u64)> {
        let half = self.0.iter().rev().find(|(_, n)| 2 * n <= samples);
        let part = half.or(self.0.first()).cloned();
        if self.0.last().is_none_or(|(_, n)| samples >= 2 * n) {
            if self.0.len() > 1 {
                self.0.remove(0);
            }
            self.0.push((Arc::clone(image), samples));
        }
        part.filter(|(_, n)| *n < samples)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_light::film::Image;

    #[test]
    fn a_part_of_a_picture_has_at_most_half_of_its_samples() {
        let mut parts = Parts::default();
        let image = Arc::new(Image::new(1, 1));
        let found = [1, 2, 3, 4, 6, 7, 8, 12, 15, 16].map(|samples| {
            let part = parts.part_of(&image, samples);
            part.map(|(_, samples)| samples)
        });
        let expected = [0, 1, 1, 2, 2, 2, 4, 4, 4, 8].map(|n| (n > 0).then_some(n));
        assert_eq!(found, expected);
    }

    #[test]
    fn a_picture_is_finished_at_the_first_of_its_limits() {
        let done = |samples, render_s| WaveStats {
            samples,
            render_s,
            ..WaveStats::default()
        };
        let limits = Limits {
            samples: Some(16),
            seconds: Some(2.0),
        };
        for (samples, render_s, expected) in [
            (15, 1.9, false),
            (16, 1.9, true),
            (15, 2.0, true),
            (1000, 1000.0, true),
        ] {
            assert_eq!(reaches(&done(samples, render_s), limits), expected);
        }
        assert!(!reaches(&done(1000, 1000.0), Limits::default()));
    }
}
