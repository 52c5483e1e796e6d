//! A run on a device.

use std::io::{self, Write};
use std::sync::Arc;
use std::time::Instant;

use super::context::device::Device;
use super::context::session;
use super::error::VulkanError;
use super::films::device_film::{DeviceFilms, RestoreError, SplatMode};
use super::layout::{PathStep, WaveParams, add_counters};
use super::memory::light_paths::LightPathBuffers;
use super::memory::subpaths::{SubpathBuffers, SubpathRoom};
use super::memory::upload;
use super::memory::upload::{JobBuffers, SceneBuffers};
use super::pipelines::compute::Bindings;
use super::pipelines::program::{Program, TracingMode, Traversal};
use super::pipelines::sources::Sources;
use super::prepare::{check_films, specialization, supported_scene};
use super::schedule::dispatch_size::{
    DISPATCHES_PER_SUBMISSION, DispatchPacer, DispatchRange, MAX_SPECULATIVE_DISPATCHES, TARGET_S,
    WaveSplitter,
};
use super::schedule::pixel_samples::PixelSamples;
use super::schedule::submission::{Span, Submission};
use lumbre_light::film::Film;
use lumbre_light::film::layer::{LayerFilm, LayerSource};
use lumbre_light::film::state::{StateReader, write_u64s};
use lumbre_light::film::time::TimeCube;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::NONE;
use lumbre_light::transport::contribution::Contribution;
use lumbre_light::transport::ray::{Hit, Ray};
use lumbre_render::path_trace::{MAX_PATH_EVENTS, PathEvent, SampleAt};
use lumbre_render::{Advance, Job, OpenStats, RenderError, Renderer, WaveStats};

/// Run of a job on a device. Fields are dropped in the order of their declaration: users before
/// what they use.
pub struct VulkanRenderer {
    /// Speculative dispatches of the next wave.
    speculative: Option<SpeculativeWave>,
    kind: TracingMode,
    program: Program,
    bindings: Bindings,
    films: DeviceFilms,
    _light_paths: LightPathBuffers,
    _subpaths: SubpathBuffers,
    room: SubpathRoom,
    _traversal: Traversal,
    _job_buffers: JobBuffers,
    _scene: Arc<SceneBuffers>,
    device: Arc<Device>,
    pacer: DispatchPacer,
    /// Index of the last submission, which selects its counters.
    slot: usize,
    /// Interval in which the device worked on the last submission.
    last: Option<Span>,
    /// Time when the last wave was returned, and the host times in seconds between the last two
    /// waves.
    away: (Option<Instant>, [f64; 2]),
    film: Film,
    /// Index of the first sample of the film.
    first_sample: u64,
    open_stats: OpenStats,
    /// Whether any sample has been invalid so far.
    any_invalid: bool,
}

/// Beginning of a wave that has not been requested yet; it runs while the host reads the previous
/// wave.
struct SpeculativeWave {
    submission: Submission,
    dispatches: Vec<DispatchRange>,
    slot: usize,
    /// Rest of the wave after these dispatches.
    rest: WaveSplitter,
}

impl VulkanRenderer {
    /// Opens a run on the device of this process.
    ///
    /// # Errors
    /// Returns an error if there is no device, it lacks a feature, or the scene does not fit.
    pub fn open(
        kind: TracingMode,
        scene: &CompiledScene,
        job: &Job,
    ) -> Result<VulkanRenderer, RenderError> {
        let device = session::device().map_err(|e| into_render_error(kind, e))?;
        Sources::of(&job.settings.shaders)
            .map_err(VulkanError::from)
            .and_then(|sources| VulkanRenderer::new(&device, kind, &sources, scene, job))
            .map_err(|e| {
                session::forget(&device);
                into_render_error(kind, e)
            })
    }

    /// Opens a run on a device.
    ///
    /// # Errors
    /// Returns an error if the device lacks a feature, a shader does not compile, or the scene does
    /// not fit.
    pub fn new(
        device: &Arc<Device>,
        kind: TracingMode,
        sources: &Sources,
        scene: &CompiledScene,
        job: &Job,
    ) -> Result<VulkanRenderer, VulkanError> {
        let samples = PixelSamples::suitable(&device.info, job);
        VulkanRenderer::with_samples(device, kind, sources, scene, job, samples)
    }

    /// Opens a run that records the events of samples.
    ///
    /// # Errors
    /// Returns an error in the cases of [`VulkanRenderer::new`].
    pub fn recording(
        device: &Arc<Device>,
        kind: TracingMode,
        sources: &Sources,
        scene: &CompiledScene,
        job: &Job,
    ) -> Result<VulkanRenderer, VulkanError> {
        let job = &job.clone().with(|settings| settings.films.clear());
        VulkanRenderer::with_samples(device, kind, sources, scene, job, PixelSamples::Recorded)
    }

    /// Opens a run that renders the samples of a pixel in a given way.
    ///
    /// # Errors
    /// Returns an error in the cases of [`VulkanRenderer::new`].
    pub fn with_samples(
        device: &Arc<Device>,
        kind: TracingMode,
        sources: &Sources,
        scene: &CompiledScene,
        job: &Job,
        samples: PixelSamples,
    ) -> Result<VulkanRenderer, VulkanError> {
        let scene = &*supported_scene(device, scene, job)?;
        let layout = check_films(job)?;
        let splat_mode = SplatMode::select(job.integrator.splats, device.info.caps.float_atomics);
        let start = Instant::now();
        let scene_buffers = session::scene(device, scene)?;
        let room = SubpathRoom::new(job, samples.at_once(), device.info.limits.storage_range);
        let job_buffers = JobBuffers::new(device, scene, job, &layout, &room)?;
        let upload_s = start.elapsed().as_secs_f64();
        let traversal = Traversal::new(device, kind, scene, &job.settings.accel, &scene_buffers)?;
        let built = traversal.built();
        let shift = scene_buffers.texel_shift();
        let constants = specialization(scene, job, shift, samples);
        let films = DeviceFilms::new(
            device,
            job.resolution,
            layout,
            job.settings.timing.as_ref().map(|t| t.axis),
            splat_mode,
            samples,
        )?;
        let subpaths = SubpathBuffers::new(device, &room, job.settings.timing.is_some())?;
        let light_paths = LightPathBuffers::new(device, &room)?;
        let mut resources = upload::bindings(&scene_buffers, &job_buffers);
        resources.extend(films.bindings());
        resources.extend(subpaths.bindings());
        resources.extend(light_paths.bindings());
        resources.extend(traversal.bindings());
        let bindings = Bindings::new(device, Program::stages(kind), &resources)?;
        let start = Instant::now();
        let modes = (splat_mode, samples);
        let program = Program::new(kind, sources, job, modes, &constants, &bindings)?;
        program.warm_up(device, &bindings)?;
        if let Some(light) = program.light() {
            light.prepare(&bindings, &light_paths, job)?;
        }
        let pipeline_s = start.elapsed().as_secs_f64();
        Ok(VulkanRenderer {
            speculative: None,
            kind,
            program,
            bindings,
            films,
            _light_paths: light_paths,
            _subpaths: subpaths,
            room,
            _traversal: traversal,
            _job_buffers: job_buffers,
            _scene: scene_buffers,
            device: Arc::clone(device),
            pacer: DispatchPacer::default(),
            slot: 0,
            last: None,
            away: (None, [0.0; 2]),
            film: Film::new(job.resolution[0], job.resolution[1]),
            first_sample: job.first_sample,
            open_stats: OpenStats {
                upload_s,
                pipeline_s,
                devices: vec![lumbre_render::Device {
                    features: kind.features(&device.info, &job.settings.accel),
                    ..device.info.recorded()
                }],
                scene: scene.memory(),
                ..built
            },
            any_invalid: false,
        })
    }

    /// Renders a wave, starts the next one speculatively if `more` samples are expected, and copies
    /// the film to the host while that runs.
    fn wave(&mut self, samples: u64, more: u64) -> Result<WaveStats, VulkanError> {
        let mut stats = WaveStats {
            samples,
            paths: samples * self.film.sum.len() as u64,
            ..WaveStats::default()
        };
        self.away.1 = [
            self.away
                .0
                .take()
                .map_or(0.0, |since| since.elapsed().as_secs_f64()),
            self.away.1[0],
        ];
        let mut rest = self.take_speculative(samples, &mut stats)?;
        let mut device_was_idle = true;
        loop {
            let dispatches = rest.next_dispatches(&self.pacer, DISPATCHES_PER_SUBMISSION);
            let ends = rest.is_done();
            // If the whole wave was speculative, only its end is left.
            let submission = self.submit(&dispatches, self.film.samples, ends)?;
            let slot = self.slot;
            if ends {
                self.start_speculative(samples, more)?;
            }
            self.record(
                &dispatches,
                submission.wait()?,
                slot,
                device_was_idle,
                &mut stats,
            );
            if ends {
                break;
            }
            device_was_idle = false;
        }
        self.away.0 = Some(Instant::now());
        self.film.samples += samples;
        self.films.end_wave();
        self.films.picture(&mut self.film)?;
        if stats.invalid > 0 && !self.any_invalid {
            self.any_invalid = true;
            stats.first_invalid = self
                .films
                .first_invalid()
                .map(|[sample, y, x]| [x, y, sample]);
        }
        Ok(stats)
    }

    /// Submits dispatches of a wave that begins after `before` samples, and the end of the wave if
    /// `ends`.
    fn submit(
        &mut self,
        dispatches: &[DispatchRange],
        before: u64,
        ends: bool,
    ) -> Result<Submission, VulkanError> {
        self.slot += 1;
        let shares_room = self.room.rows(self.film.width) < self.film.height;
        let render = |commands| {
            self.films.start_counting(&self.device, commands);
            for (i, part) in dispatches.iter().enumerate() {
                if i > 0 && (shares_room || part.overlaps(&dispatches[i - 1])) {
                    self.device.barrier_to_shaders(commands);
                }
                let first = self.first_sample + before + part.done;
                if part.row == 0 {
                    self.program.begin(commands, &self.bindings, first);
                }
                let wave = WaveParams::new(first, part.samples, part.row, part.rows);
                self.program
                    .dispatch(commands, &self.bindings, self.film.width, &wave);
            }
            self.films.stop_counting(&self.device, commands, self.slot);
        };
        // Not timed, as the later copies of time bins are not: other techniques would not pay for
        // the copies that splats need.
        let copy = |commands| {
            if ends {
                self.films.record_end(&self.device, commands);
            }
        };
        self.device.submit("render", render, copy)
    }

    /// Adds the statistics of a submission and updates the pacer. All times are the device's: a
    /// wave takes from the start of its first submission to the end of its last, except for the
    /// time in which the device was idle between them if `device_was_idle`.
    fn record(
        &mut self,
        dispatches: &[DispatchRange],
        span: Span,
        slot: usize,
        device_was_idle: bool,
        stats: &mut WaveStats,
    ) {
        let (seconds, width) = (span.seconds(), self.film.width);
        if !dispatches.is_empty() {
            let work = dispatches.iter().map(|part| part.work(width)).sum::<f64>();
            self.pacer.record(
                work / dispatches.len() as f64,
                seconds / dispatches.len() as f64,
            );
        }
        add_counters(&self.films.counted(slot), stats);
        let before = self.last.map_or(0.0, |last| span.since(&last));
        *if device_was_idle {
            &mut stats.idle_s
        } else {
            &mut stats.render_s
        } += before;
        stats.render_s += seconds;
        stats.device_s += seconds;
        self.last = Some(span);
    }

    /// Starts the wave after the current one, of `samples`, speculatively for as long as the host
    /// was away the last times, if `more` samples are expected and the films allow it.
    fn start_speculative(&mut self, samples: u64, more: u64) -> Result<(), VulkanError> {
        // Without a device clock its time could not be measured.
        if more == 0
            || !self.films.allows_speculation()
            || self.device.info.limits.timestamp_ns == 0.0
        {
            return Ok(());
        }
        let mut rest = self.splitter(more);
        let dispatches = rest.next_dispatches(
            &self.pacer,
            ((self.away.1[0].max(self.away.1[1]) / TARGET_S) as usize + 1)
                .min(MAX_SPECULATIVE_DISPATCHES),
        );
        let submission = self.submit(&dispatches, self.film.samples + samples, false)?;
        self.speculative = Some(SpeculativeWave {
            submission,
            dispatches,
            slot: self.slot,
            rest,
        });
        Ok(())
    }

    /// Returns the rest of a wave of `samples` samples after its speculative dispatches. Dispatches
    /// of another wave are rolled back.
    fn take_speculative(
        &mut self,
        samples: u64,
        stats: &mut WaveStats,
    ) -> Result<WaveSplitter, VulkanError> {
        let whole = self.splitter(samples);
        let Some(SpeculativeWave {
            submission,
            dispatches,
            slot,
            rest,
        }) = self.speculative.take()
        else {
            return Ok(whole);
        };
        let span = submission.wait()?;
        if let Some(rest) = rest.rest_of(samples) {
            self.record(&dispatches, span, slot, true, stats);
            return Ok(rest);
        }
        tracing::debug!(
            "discarded {:.3} s of speculative device work",
            span.seconds()
        );
        self.last = Some(span);
        self.films.roll_back()?;
        Ok(whole)
    }

    /// Starts to split a wave of `samples` samples into dispatches.
    fn splitter(&self, samples: u64) -> WaveSplitter {
        let size = [self.film.width, self.film.height];
        WaveSplitter::new(size, samples)
            .at_once(self.program.max_samples())
            .rows(self.room.rows(self.film.width))
    }

    /// Records the events of samples, in a run opened by [`VulkanRenderer::recording`]. Its film
    /// must not be used afterwards.
    ///
    /// # Errors
    /// Returns an error if the device fails.
    pub fn paths(&mut self, samples: &[SampleAt]) -> Result<Vec<Vec<PathEvent>>, VulkanError> {
        let mut found = Vec::with_capacity(samples.len());
        // One row at a time, in the given order.
        for row in samples.chunk_by(|a, b| (a.pixel[1], a.sample) == (b.pixel[1], b.sample)) {
            let (y, sample) = (row[0].pixel[1], row[0].sample);
            let wave = WaveParams::new(sample, 1, y, 1);
            self.films.clear_events()?;
            self.device.run("path events", |commands| {
                self.device.barrier_to_shaders(commands);
                self.program.begin(commands, &self.bindings, sample);
                self.program
                    .dispatch(commands, &self.bindings, self.film.width, &wave);
                self.device.barrier_to_copy(commands);
            })?;
            let events = self.films.events()?;
            found.extend(row.iter().map(|at| {
                let own = events
                    .chunks_exact(MAX_PATH_EVENTS)
                    .nth(at.pixel[0] as usize)
                    .unwrap_or_default();
                own.iter().map_while(to_event).collect()
            }));
        }
        Ok(found)
    }

    fn restore_state(&mut self, state: &[u8]) -> Result<(), RestoreError> {
        if let Some(speculative) = self.speculative.take() {
            speculative.submission.wait()?;
        }
        let mut from = StateReader::new(state);
        let samples = from.read_u64()?;
        self.any_invalid = from.read_u64()? != 0;
        self.films.restore(&mut from)?;
        from.finish()?;
        self.film.samples = samples;
        Ok(self.films.picture(&mut self.film)?)
    }
}

impl Drop for VulkanRenderer {
    fn drop(&mut self) {
        let ended = self
            .speculative
            .take()
            .map(|speculative| speculative.submission.wait());
        if let Some(Err(error)) = ended {
            tracing::debug!("the device failed in discarded speculative work: {error}");
            session::forget(&self.device);
        }
    }
}

/// Converts an event written by a shader, or returns `None` for an empty one.
fn to_event(s: &PathStep) -> Option<PathEvent> {
    let ray = Ray {
        origin: s.origin.into(),
        dir: s.dir.into(),
    };
    match s.kind {
        1 => {
            let hit = (s.met != NONE).then_some(Hit {
                t: s.t,
                primitive: s.met,
                instance: NONE,
                uv: s.uv,
            });
            Some(PathEvent::Closest {
                ray,
                t_max: s.t_max,
                hit,
            })
        }
        2 => Some(PathEvent::Shadow {
            ray,
            t_max: s.t_max,
            blocked: s.met != 0,
        }),
        3 => Some(PathEvent::Light(Contribution {
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

/// Converts a device error to a backend error.
pub fn into_render_error(kind: TracingMode, error: VulkanError) -> RenderError {
    let (backend, reason) = (kind.backend(), error.to_string());
    match error {
        VulkanError::NoLoader(_)
        | VulkanError::NoDevice(_)
        | VulkanError::Lacks { .. }
        | VulkanError::OverLimit(_)
        | VulkanError::PipelineRefused { .. }
        | VulkanError::TooLarge { .. } => RenderError::Unsupported { backend, reason },
        VulkanError::Lost { .. } | VulkanError::Stuck { .. } => {
            RenderError::Lost { backend, reason }
        }
        _ => RenderError::Failed { backend, reason },
    }
}

impl Renderer for VulkanRenderer {
    fn render(&mut self, request: &Advance<'_>) -> Result<WaveStats, RenderError> {
        self.wave(request.samples, request.more).map_err(|e| {
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
        let film = self.films.layers().get(index);
        match film.map(|film| film.layer.row().source) {
            Some(LayerSource::Variance) => Ok(self.film.clone()),
            Some(_) => self
                .films
                .layer(index, self.film.samples)
                .map_err(|e| into_render_error(self.kind, e)),
            None => {
                let reason = format!("layer film {index} does not exist");
                Err(RenderError::failed(self.kind.backend(), reason))
            }
        }
    }

    fn times(&self) -> Option<TimeCube> {
        let found = self.films.times(self.film.samples);
        found.unwrap_or_else(|error| {
            tracing::warn!("the time-resolved film of this run is lost: {error}");
            session::forget(&self.device);
            None
        })
    }

    fn save(&self, to: &mut dyn Write) -> io::Result<bool> {
        write_u64s(to, [self.film.samples, self.any_invalid.into()])?;
        self.films.save(to)?;
        Ok(true)
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), RenderError> {
        self.restore_state(state).map_err(|error| match error {
            RestoreError::CheckpointMismatch(error) => {
                RenderError::failed(self.kind.backend(), error)
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
