//! A run on a device.

use std::io::{self, Write};
use std::sync::Arc;
use std::time::Instant;

use super::delays::is_composed;
use super::device::Device;
use super::error::VulkanError;
use super::films::{Films, RestoreError, SplatMode};
use super::layout::{PathStep, Wave};
use super::pace::{AHEAD, Cut, Pace, Part, TARGET_S, TOGETHER};
use super::pipeline::Bindings;
use super::program::{Kind, Program, Traversal};
use super::session;
use super::spirv::Sources;
use super::submission::{Span, Submission};
use super::upload::{self, JobBuffers, SceneBuffers};
use crate::film::Film;
use crate::film::layer::{LayerFilm, Layout};
use crate::film::state::{Saved, write_words};
use crate::film::time::{self, TimeCube};
use crate::render::paths::{MOST_STEPS, SampleAt, Step};
use crate::render::{Job, OpenStats, RenderError, Renderer, WaveStats};
use crate::scene::CompiledScene;
use crate::scene::compile::{MOST_UNFOLDED, NONE};
use crate::transport::contribution::Contribution;
use crate::transport::ray::{Hit, Ray};

/// A run on a device. Its fields go in the order in which they are written: what uses others first.
pub struct VulkanRenderer {
    /// What the device has begun of the next wave.
    ahead: Option<Ahead>,
    kind: Kind,
    program: Program,
    bindings: Bindings,
    films: Films,
    _traversal: Traversal,
    _job_buffers: JobBuffers,
    _scene: Arc<SceneBuffers>,
    device: Arc<Device>,
    pace: Pace,
    /// The place of the counters of the last submission.
    place: usize,
    /// When the device worked on the last submission.
    last: Option<Span>,
    /// When the last wave was handed out, and seconds from there to asking for the next one.
    away: (Option<Instant>, [f64; 2]),
    film: Film,
    /// Index of the first sample of the film.
    first_sample: u64,
    open_stats: OpenStats,
    /// Whether some sample was refused so far.
    refused: bool,
}

/// The beginning of a wave that nobody has asked for yet: it runs while the host looks at the wave before.
struct Ahead {
    submission: Submission,
    parts: Vec<Part>,
    place: usize,
    /// The wave, after these parts.
    cut: Cut,
}

impl VulkanRenderer {
    /// Opens a run on the device of this process.
    ///
    /// # Errors
    /// When there is no device, it lacks something, or the scene does not fit.
    pub fn open(kind: Kind, scene: &CompiledScene, job: &Job) -> Result<VulkanRenderer, RenderError> {
        let device = session::device().map_err(|e| into_render_error(kind, e))?;
        VulkanRenderer::new(&device, kind, &Sources::chosen(), scene, job).map_err(|e| {
            session::forget(&device);
            into_render_error(kind, e)
        })
    }

    /// Opens a run on a device.
    ///
    /// # Errors
    /// When the device lacks something, a shader does not compile, or the scene does not fit.
    pub fn new(
        device: &Arc<Device>,
        kind: Kind,
        sources: &Sources,
        scene: &CompiledScene,
        job: &Job,
    ) -> Result<VulkanRenderer, VulkanError> {
        VulkanRenderer::make(device, kind, sources, scene, job, false)
    }

    /// Opens a run that can say what its samples do, step by step.
    ///
    /// # Errors
    /// As [`VulkanRenderer::new`].
    pub fn stepwise(
        device: &Arc<Device>,
        kind: Kind,
        sources: &Sources,
        scene: &CompiledScene,
        job: &Job,
    ) -> Result<VulkanRenderer, VulkanError> {
        VulkanRenderer::make(device, kind, sources, scene, &Job { layers: Vec::new(), ..job.clone() }, true)
    }

    fn make(
        device: &Arc<Device>,
        kind: Kind,
        sources: &Sources,
        scene: &CompiledScene,
        job: &Job,
        steps: bool,
    ) -> Result<VulkanRenderer, VulkanError> {
        let unfolded;
        // Copies are placed in double precision, as on the CPU.
        let scene = if scene.instances.places.is_empty() || device.info.caps.doubles {
            scene
        } else {
            unfolded = scene.flattened(MOST_UNFOLDED).map_err(|found| VulkanError::Lacks {
                device: device.info.line(),
                needed: format!("numbers of double precision in shaders (shaderFloat64) for copies of meshes, which would be {found} triangles (at most {MOST_UNFOLDED} are unfolded)"),
            })?;
            &unfolded
        };
        let pixels = u64::from(job.resolution[0]) * u64::from(job.resolution[1]);
        let layout = Layout::new(&job.layers, job.max_depth, pixels)
            .map_err(|needed| VulkanError::Lacks { device: device.info.line(), needed })?;
        if let Some(timing) = &job.timing {
            time::bytes(&timing.axis, pixels, job.integrator.splats)
                .map_err(|needed| VulkanError::Lacks { device: device.info.line(), needed })?;
        }
        let mode = match (job.integrator.splats, device.info.caps.float_atomics) {
            (false, _) => SplatMode::None,
            (true, true) => SplatMode::Float,
            (true, false) => SplatMode::Fixed,
        };
        let start = Instant::now();
        let scene_buffers = session::scene(device, scene)?;
        let job_buffers = JobBuffers::new(device, scene, job, &layout)?;
        let upload_s = start.elapsed().as_secs_f64();
        let traversal = Traversal::new(device, kind, scene, &job.accel, &scene_buffers)?;
        let built = traversal.built();
        let mut defines = vec![
            ("SAMPLER_KIND", format!("{}u", u32::from(job.sampler.name == "sobol"))),
            ("MODELS", upload::models(scene).to_string()),
        ];
        if !job.layers.is_empty() {
            defines.push(("LAYERS", String::new()));
        }
        match mode {
            SplatMode::None => defines.push(("SPLAT_NONE", String::new())),
            SplatMode::Float => defines.push(("SPLAT_FLOAT", String::new())),
            SplatMode::Fixed => {}
        }
        if job.timing.is_some() {
            defines.push(("TIMES", String::new()));
        }
        if is_composed(scene) || (job.timing.is_some() && !scene.delays.is_empty()) {
            defines.push(("PARTS", String::new()));
        }
        if !scene.instances.places.is_empty() {
            defines.push(("COPIES", String::new()));
        }
        if !scene.second_uvs.is_empty() {
            defines.push(("SECOND_UVS", String::new()));
        }
        if let Some(shift) = scene_buffers.texel_shift() {
            defines.push(("TEXEL_SHIFT", format!("{shift}u")));
        }
        if steps {
            defines.push(("PATHS", String::new()));
        }
        let films = Films::new(device, job.resolution, layout, job.timing.as_ref().map(|t| t.axis), mode, steps)?;
        let mut bound = upload::bound(&scene_buffers, &job_buffers);
        bound.extend(films.bound());
        bound.extend(traversal.bound());
        let bindings = Bindings::new(device, Program::stages(kind), &bound)?;
        let start = Instant::now();
        let program = Program::new(device, kind, sources, job, &defines, &bindings)?;
        // Software drivers compile at the first dispatch; an empty one leaves that out of the first wave's time.
        let empty = Wave { first_sample: [0; 2], samples: 0, first_row: 0, rows: 0 };
        device.run("warm up", |commands| program.dispatch(commands, &bindings, 1, &empty))?;
        let pipeline_s = start.elapsed().as_secs_f64();
        Ok(VulkanRenderer {
            ahead: None,
            kind,
            program,
            bindings,
            films,
            _traversal: traversal,
            _job_buffers: job_buffers,
            _scene: scene_buffers,
            device: Arc::clone(device),
            pace: Pace::default(),
            place: 0,
            last: None,
            away: (None, [0.0; 2]),
            film: Film::new(job.resolution[0], job.resolution[1]),
            first_sample: job.first_sample,
            open_stats: OpenStats { upload_s, pipeline_s, device: device.info.line(), ..built },
            refused: false,
        })
    }

    /// Renders a wave, begins the next one where `more` samples are to follow, and brings the film here while that runs.
    fn wave(&mut self, samples: u64, more: u64) -> Result<WaveStats, VulkanError> {
        let mut stats = WaveStats { samples, paths: samples * self.film.sum.len() as u64, ..WaveStats::default() };
        self.away.1 = [self.away.0.take().map_or(0.0, |since| since.elapsed().as_secs_f64()), self.away.1[0]];
        let mut cut = self.take_ahead(samples, &mut stats)?;
        let mut waited = true;
        loop {
            let parts = cut.parts(&self.pace, TOGETHER);
            let ends = cut.is_done();
            // Where all of it was done ahead, its end is left.
            let submission = self.submit(&parts, self.film.samples, ends)?;
            let place = self.place;
            if ends {
                self.begin_ahead(samples, more)?;
            }
            self.book(&parts, submission.wait()?, place, waited, &mut stats);
            if ends {
                break;
            }
            waited = false;
        }
        self.away.0 = Some(Instant::now());
        self.film.samples += samples;
        self.films.end_wave();
        self.films.picture(&mut self.film)?;
        if stats.invalid > 0 && !self.refused {
            self.refused = true;
            stats.first_invalid = self.films.first_invalid().map(|[sample, y, x]| [x, y, sample]);
        }
        Ok(stats)
    }

    /// Hands parts of a wave to the device that follows so many samples, and its end where they are the last ones.
    fn submit(&mut self, parts: &[Part], before: u64, ends: bool) -> Result<Submission, VulkanError> {
        self.place += 1;
        let render = |commands| {
            self.films.start_counting(&self.device, commands);
            for (i, part) in parts.iter().enumerate() {
                if i > 0 {
                    // The same rows may come again.
                    self.device.barrier_to_shaders(commands);
                }
                let first = self.first_sample + before + part.done;
                let (first_sample, rows) = ([first as u32, (first >> 32) as u32], part.rows);
                let wave = Wave { first_sample, samples: part.samples, first_row: part.row, rows };
                self.program.dispatch(commands, &self.bindings, self.film.width, &wave);
            }
            self.films.stop_counting(&self.device, commands, self.place);
        };
        // On no clock, as the bins of a time axis are not that are fetched later: what splats need to be copied, other
        // techniques would not pay.
        let copy = |commands| {
            if ends {
                self.films.record_end(&self.device, commands);
            }
        };
        self.device.submit("render", render, copy)
    }

    /// Counts what a submission has done, and learns from it. All clocks are the device's: a wave takes from the beginning of its
    /// first submission to the end of its last, but for the time in which the device `waited` to be asked for more.
    fn book(&mut self, parts: &[Part], span: Span, place: usize, waited: bool, stats: &mut WaveStats) {
        let (seconds, width) = (span.seconds(), self.film.width);
        if !parts.is_empty() {
            let work = parts.iter().map(|part| part.work(width)).sum::<f64>();
            self.pace.record(work / parts.len() as f64, seconds / parts.len() as f64);
        }
        let counted = self.films.counted(place);
        stats.rays += u64::from(counted.rays[1]) << 32 | u64::from(counted.rays[0]);
        stats.invalid += u64::from(counted.invalid);
        let before = self.last.map_or(0.0, |last| span.since(&last));
        *if waited { &mut stats.idle_s } else { &mut stats.render_s } += before;
        stats.render_s += seconds;
        stats.device_s += seconds;
        self.last = Some(span);
    }

    /// Begins the wave after the one in progress, of `samples`, as far as the host was away the last times, if so many samples are
    /// to follow and the films let it.
    fn begin_ahead(&mut self, samples: u64, more: u64) -> Result<(), VulkanError> {
        // Without a clock of the device nobody could say how long it took.
        if more == 0 || !self.films.may_go_on() || self.device.info.limits.timestamp_ns == 0.0 {
            return Ok(());
        }
        let mut cut = Cut::new([self.film.width, self.film.height], more);
        let parts = cut.parts(&self.pace, ((self.away.1[0].max(self.away.1[1]) / TARGET_S) as usize + 1).min(AHEAD));
        let submission = self.submit(&parts, self.film.samples + samples, false)?;
        self.ahead = Some(Ahead { submission, parts, place: self.place, cut });
        Ok(())
    }

    /// What is left of a wave of so many samples after what was done ahead. What was done of another wave is put back.
    fn take_ahead(&mut self, samples: u64, stats: &mut WaveStats) -> Result<Cut, VulkanError> {
        let whole = Cut::new([self.film.width, self.film.height], samples);
        let Some(Ahead { submission, parts, place, cut }) = self.ahead.take() else { return Ok(whole) };
        let span = submission.wait()?;
        if let Some(rest) = cut.of(samples) {
            self.book(&parts, span, place, true, stats);
            return Ok(rest);
        }
        tracing::debug!("{:.3} s of the device were for a wave that nobody wants, and count for none", span.seconds());
        self.last = Some(span);
        self.films.take_back()?;
        Ok(whole)
    }

    /// What samples do, of a run that was opened [`VulkanRenderer::stepwise`]. Its film is worthless afterwards.
    ///
    /// # Errors
    /// When the device fails.
    pub fn paths(&mut self, samples: &[SampleAt]) -> Result<Vec<Vec<Step>>, VulkanError> {
        let mut found = Vec::with_capacity(samples.len());
        // A row at a time, as they come.
        for row in samples.chunk_by(|a, b| (a.pixel[1], a.sample) == (b.pixel[1], b.sample)) {
            let (y, sample) = (row[0].pixel[1], row[0].sample);
            let first_sample = [sample as u32, (sample >> 32) as u32];
            let wave = Wave { first_sample, samples: 1, first_row: y, rows: 1 };
            self.films.clear_steps()?;
            self.device.run("steps of samples", |commands| {
                self.device.barrier_to_shaders(commands);
                self.program.dispatch(commands, &self.bindings, self.film.width, &wave);
                self.device.barrier_to_copy(commands);
            })?;
            let steps = self.films.steps()?;
            found.extend(row.iter().map(|at| {
                let own = steps.chunks_exact(MOST_STEPS).nth(at.pixel[0] as usize).unwrap_or_default();
                own.iter().map_while(step).collect()
            }));
        }
        Ok(found)
    }

    fn take(&mut self, state: &[u8]) -> Result<(), RestoreError> {
        if let Some(ahead) = self.ahead.take() {
            ahead.submission.wait()?;
        }
        let mut from = Saved::new(state);
        let samples = from.word()?;
        self.refused = from.word()? != 0;
        self.films.restore(&mut from)?;
        from.end()?;
        self.film.samples = samples;
        Ok(self.films.picture(&mut self.film)?)
    }
}

impl Drop for VulkanRenderer {
    fn drop(&mut self) {
        let ended = self.ahead.take().map(|ahead| ahead.submission.wait());
        if let Some(Err(error)) = ended {
            tracing::debug!("the device failed in a wave that nobody wanted any more: {error}");
            session::forget(&self.device);
        }
    }
}

/// A step as a shader has written it, if it has.
fn step(s: &PathStep) -> Option<Step> {
    let ray = Ray { origin: s.origin.into(), dir: s.dir.into() };
    match s.kind {
        1 => {
            let hit = (s.met != NONE).then_some(Hit { t: s.t, primitive: s.met, instance: NONE, uv: s.uv });
            Some(Step::Closest { ray, t_max: s.t_max, hit })
        }
        2 => Some(Step::Shadow { ray, t_max: s.t_max, blocked: s.met != 0 }),
        3 => Some(Step::Light(Contribution {
            pixel: s.pixel,
            value: s.value.into(),
            unweighted: s.unweighted.into(),
            s: s.light_vertices,
            t: s.camera_vertices,
            length: s.optical_length.into(),
        })),
        _ => None,
    }
}

/// What the layers above are told.
pub fn into_render_error(kind: Kind, error: VulkanError) -> RenderError {
    let (backend, reason) = (kind.backend(), error.to_string());
    match error {
        VulkanError::NoLoader(_)
        | VulkanError::NoDevice(_)
        | VulkanError::Lacks { .. }
        | VulkanError::TooLarge { .. } => RenderError::Unsupported { backend, reason },
        VulkanError::Lost { .. } | VulkanError::Stuck { .. } => RenderError::Lost { backend, reason },
        _ => RenderError::Failed { backend, reason },
    }
}

impl Renderer for VulkanRenderer {
    fn advance(&mut self, samples: u64) -> Result<WaveStats, RenderError> {
        self.advance_toward(samples, 0)
    }

    fn advance_toward(&mut self, samples: u64, more: u64) -> Result<WaveStats, RenderError> {
        self.wave(samples, more).map_err(|e| {
            session::forget(&self.device);
            into_render_error(self.kind, e)
        })
    }

    fn film(&self) -> &Film {
        &self.film
    }

    fn layers(&self) -> &[LayerFilm] {
        self.films.layers()
    }

    fn layer(&self, index: usize) -> Result<Film, RenderError> {
        if index >= self.films.layers().len() {
            let reason = format!("there is no film {index} of layers");
            return Err(RenderError::Failed { backend: self.kind.backend(), reason });
        }
        self.films.layer(index, self.film.samples).map_err(|e| into_render_error(self.kind, e))
    }

    fn times(&self) -> Option<TimeCube> {
        let found = self.films.times(self.film.samples);
        found.unwrap_or_else(|error| {
            tracing::warn!("the light of this run by its time is lost: {error}");
            session::forget(&self.device);
            None
        })
    }

    fn save(&self, to: &mut dyn Write) -> io::Result<bool> {
        write_words(to, [self.film.samples, self.refused.into()])?;
        self.films.save(to)?;
        Ok(true)
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), RenderError> {
        self.take(state).map_err(|error| match error {
            RestoreError::Misfit(misfit) => {
                RenderError::Failed { backend: self.kind.backend(), reason: misfit.to_string() }
            }
            RestoreError::Device(error) => {
                session::forget(&self.device);
                into_render_error(self.kind, error)
            }
        })
    }

    fn open_stats(&self) -> &OpenStats {
        &self.open_stats
    }
}
