//! A run on a device.

use std::sync::Arc;
use std::time::Instant;

use super::device::Device;
use super::error::VulkanError;
use super::films::{Films, SplatMode};
use super::layout::Wave;
use super::pace::Pace;
use super::pipeline::Bindings;
use super::program::{Kind, Program, Traversal};
use super::session;
use super::spirv::Sources;
use super::upload::{self, JobBuffers, SceneBuffers};
use crate::film::Film;
use crate::film::layer::{LayerFilm, Layout};
use crate::render::{Job, OpenStats, RenderError, Renderer, WaveStats};
use crate::scene::CompiledScene;

/// Triangles and spheres up to which scenes with copies of meshes are unfolded for a device: some four gigabytes.
const MOST_UNFOLDED: usize = 1 << 24;

/// A run on a device. Its fields go in the order in which they are written: what uses others first.
pub struct VulkanRenderer {
    kind: Kind,
    program: Program,
    bindings: Bindings,
    films: Films,
    _traversal: Traversal,
    _job_buffers: JobBuffers,
    _scene: Arc<SceneBuffers>,
    device: Arc<Device>,
    pace: Pace,
    film: Film,
    open_stats: OpenStats,
    /// Whether some sample was refused so far.
    refused: bool,
}

/// What opening a run took, in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OpenTimes {
    /// Copying the scene.
    pub upload_s: f64,
    /// Building what rays are traced through.
    pub build_s: f64,
    /// Compiling shaders and making the pipeline.
    pub pipeline_s: f64,
}

impl VulkanRenderer {
    /// Opens a run on the device of this process.
    ///
    /// # Errors
    /// When there is no device, it lacks something, or the scene does not fit.
    pub fn open(kind: Kind, scene: &CompiledScene, job: &Job) -> Result<VulkanRenderer, RenderError> {
        let device = session::device().map_err(|e| into_render_error(kind, e))?;
        VulkanRenderer::new(&device, kind, &Sources::Embedded, scene, job).map_err(|e| {
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
        let unfolded;
        let scene = if scene.instances.places.is_empty() {
            scene
        } else {
            unfolded = scene.flattened(MOST_UNFOLDED).map_err(|found| VulkanError::Lacks {
                device: device.info.line(),
                needed: format!("copies of meshes without triangles of their own, which would be {found} (at most {MOST_UNFOLDED} are unfolded)"),
            })?;
            &unfolded
        };
        let pixels = u64::from(job.resolution[0]) * u64::from(job.resolution[1]);
        let layout = Layout::new(&job.layers, job.max_depth, pixels)
            .map_err(|needed| VulkanError::Lacks { device: device.info.line(), needed })?;
        let mode = match (job.integrator.splats, device.info.caps.float_atomics) {
            (false, _) => SplatMode::None,
            (true, true) => SplatMode::Float,
            (true, false) => SplatMode::Fixed,
        };
        let start = Instant::now();
        let scene_buffers = session::scene(device, scene)?;
        let job_buffers = JobBuffers::new(device, scene, job, &layout)?;
        let upload_s = start.elapsed().as_secs_f64();
        let traversal = Traversal::new(device, kind, scene, &scene_buffers)?;
        let (build_s, nodes) = traversal.built();
        let mut defines = vec![("SAMPLER_KIND", format!("{}u", u32::from(job.sampler.name == "sobol")))];
        if !job.layers.is_empty() {
            defines.push(("LAYERS", String::new()));
        }
        match mode {
            SplatMode::None => defines.push(("SPLAT_NONE", String::new())),
            SplatMode::Float => defines.push(("SPLAT_FLOAT", String::new())),
            SplatMode::Fixed => {}
        }
        let films = Films::new(device, job.resolution, layout, mode)?;
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
        let times = OpenTimes { upload_s, build_s, pipeline_s };
        tracing::debug!("{} on {}: {times:?}", kind.backend(), device.info.line());
        Ok(VulkanRenderer {
            kind,
            program,
            bindings,
            films,
            _traversal: traversal,
            _job_buffers: job_buffers,
            _scene: scene_buffers,
            device: Arc::clone(device),
            pace: Pace::default(),
            film: Film::new(job.resolution[0], job.resolution[1]),
            open_stats: OpenStats {
                accel_build_s: build_s,
                accel_nodes: nodes,
                device: device.info.line(),
                ..OpenStats::default()
            },
            refused: false,
        })
    }

    fn wave(&mut self, samples: u64) -> Result<WaveStats, VulkanError> {
        let start = Instant::now();
        let size = [self.film.width, self.film.height];
        let mut stats = WaveStats { samples, paths: samples * self.film.sum.len() as u64, ..WaveStats::default() };
        let mut done = 0;
        while done < samples {
            let share = self.pace.samples(size, samples - done);
            let first = self.film.samples + done;
            let mut row = 0;
            while row < size[1] {
                let rows = self.pace.rows(size[0], share, size[1] - row);
                let wave =
                    Wave { first_sample: [first as u32, (first >> 32) as u32], samples: share, first_row: row, rows };
                let seconds = self.device.timed("render", |commands| {
                    self.films.start_counting(&self.device, commands);
                    self.program.dispatch(commands, &self.bindings, size[0], &wave);
                    self.films.stop_counting(&self.device, commands);
                })?;
                self.pace.record(f64::from(size[0]) * f64::from(rows) * f64::from(share), seconds);
                let counted = self.films.counted();
                stats.rays += u64::from(counted.rays);
                stats.invalid += u64::from(counted.invalid);
                stats.device_s += seconds;
                row += rows;
            }
            done += u64::from(share);
        }
        self.film.samples += samples;
        self.films.end_wave()?;
        self.films.picture(&mut self.film)?;
        if stats.invalid > 0 && !self.refused {
            self.refused = true;
            stats.first_invalid = self.films.first_invalid()?.map(|[sample, y, x]| [x, y, sample]);
        }
        stats.render_s = start.elapsed().as_secs_f64();
        Ok(stats)
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
        _ => RenderError::Failed { backend, reason },
    }
}

impl Renderer for VulkanRenderer {
    fn advance(&mut self, samples: u64) -> Result<WaveStats, RenderError> {
        self.wave(samples).map_err(|e| {
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

    fn layer(&self, index: usize) -> Option<Film> {
        (index < self.films.layers().len()).then(|| self.films.layer(index, self.film.samples).ok()).flatten()
    }

    fn open_stats(&self) -> &OpenStats {
        &self.open_stats
    }
}
