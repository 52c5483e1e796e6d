//! Cost of transferring an image from a worker process after every wave.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use lumbre::cli::bench::subject::Subject;
use lumbre_light::math::stats::median;
use lumbre_light::scene::compile;
use lumbre_light::transport::integrator::INTEGRATORS;
use lumbre_night::backends::backend;
use lumbre_night::experiment::processor_time;
use lumbre_render::worker::{Launcher, WorkerPool};
use lumbre_render::{Job, Renderer};

/// Resolution of the images.
const RESOLUTION: [u32; 2] = [1280, 720];

/// Milliseconds per image beyond rendering it: wall time, and CPU time of both processes.
pub struct ImageTransfer {
    /// Transfer through shared memory.
    memory: [f64; 2],
    /// Transfer through the pipe.
    pipe: [f64; 2],
}

impl ImageTransfer {
    /// Measures images of 1280x720, rendered by the mock backend in this process and in a worker.
    ///
    /// # Errors
    /// A message for the user if the scene cannot be loaded or the worker cannot be started.
    pub fn measure(
        program: &Path,
        subject: &Subject,
        repeats: usize,
    ) -> Result<ImageTransfer, String> {
        let desc = subject.load()?;
        let scene = Arc::new(compile(&desc).map_err(|e| e.to_string())?.0);
        let launcher = Launcher::new(program.to_owned(), ["worker"]);
        let job = || Job::plain(&INTEGRATORS[0], RESOLUTION, 1, 1);
        let mock = backend("mock").ok_or("no such backend")?;
        let mut local = (mock.open)(Arc::clone(&scene), job()).map_err(|e| e.to_string())?;
        let rendering = wave_ms(local.as_mut(), None, repeats)?;
        let transfer = |launcher: Launcher| {
            let pool = WorkerPool::new(launcher);
            let mut run = pool
                .open(mock.name, &scene, job())
                .map_err(|e| e.to_string())?;
            let total = wave_ms(&mut run, pool.worker_id(), repeats)?;
            Ok::<_, String>([0, 1].map(|i| total[i] - rendering[i]))
        };
        let memory = transfer(launcher.clone())?;
        Ok(ImageTransfer {
            memory,
            pipe: transfer(Launcher {
                films: None,
                ..launcher
            })?,
        })
    }

    /// Formats the figures as text.
    pub fn table(&self) -> String {
        let [width, height] = RESOLUTION;
        let line = |way: &str, [clock, processor]: [f64; 2]| {
            format!("  {way:<13} {clock:>7.1} ms wall time, {processor:>7.1} ms CPU time\n")
        };
        let head = format!("transfer of an image of {width}x{height} from a worker after a wave\n");
        head + &line("shared memory", self.memory) + &line("pipe", self.pipe)
    }
}

/// Median wall time and mean CPU time, in this process and a worker, of a wave in milliseconds.
fn wave_ms(
    renderer: &mut dyn Renderer,
    worker: Option<u32>,
    repeats: usize,
) -> Result<[f64; 2], String> {
    let mut advance = || renderer.advance(1).map(|_| ()).map_err(|e| e.to_string());
    // The first wave allocates memory.
    advance()?;
    let pids = [Some(std::process::id()), worker];
    let spent = || {
        pids.into_iter()
            .flatten()
            .map(|pid| {
                processor_time::process_time(pid).map_or(f64::NAN, |spent| spent.as_secs_f64())
            })
            .sum::<f64>()
    };
    let before = spent();
    let mut waves = Vec::new();
    for _ in 0..repeats.max(1) {
        let start = Instant::now();
        advance()?;
        waves.push(start.elapsed().as_secs_f64() * 1e3);
    }
    let processor = (spent() - before) / waves.len() as f64 * 1e3;
    Ok([median(waves), processor])
}
