//! What it costs to bring a picture from a worker process here, after every wave.

use std::sync::Arc;
use std::time::Instant;

use serde_json::{Value as Json, json};

use super::subject::Subject;
use crate::experiment::processor;
use crate::math::stats::median;
use crate::render::worker::{Launcher, Pool};
use crate::render::{Job, Renderer, backend};
use crate::scene::compile;
use crate::transport::integrator::INTEGRATORS;

/// The size of the pictures.
const RESOLUTION: [u32; 2] = [1280, 720];

/// Milliseconds of one picture, by the clock and of processor time of both processes, beyond making it.
pub struct HandOver {
    /// Through memory that both processes see.
    memory: [f64; 2],
    /// Through the pipe.
    pipe: [f64; 2],
}

impl HandOver {
    /// Measures pictures of 1280x720, made by the mock backend here and in a worker.
    ///
    /// # Errors
    /// When there is no such scene or no worker, with a message for people.
    pub fn measure(subject: &Subject, repeats: usize) -> Result<HandOver, String> {
        let desc = subject.load()?;
        let scene = Arc::new(compile(&desc).map_err(|e| e.to_string())?.0);
        let program = std::env::current_exe().map_err(|e| e.to_string())?;
        let launcher = Launcher::new(program, ["worker"]);
        let job = || Job::plain(&INTEGRATORS[0], RESOLUTION, 1, 1);
        let mock = backend("mock").ok_or("no such backend")?;
        let mut here = (mock.open)(Arc::clone(&scene), job()).map_err(|e| e.to_string())?;
        let making = wave_ms(here.as_mut(), None, repeats)?;
        let there = |launcher: Launcher| {
            let pool = Pool::new(launcher);
            let mut run = pool.open(mock.name, &scene, job()).map_err(|e| e.to_string())?;
            let whole = wave_ms(&mut run, pool.worker_id(), repeats)?;
            Ok::<_, String>([0, 1].map(|i| whole[i] - making[i]))
        };
        let memory = there(launcher.clone())?;
        Ok(HandOver { memory, pipe: there(Launcher { films: None, ..launcher })? })
    }

    /// The lines for people.
    pub fn lines(&self) -> String {
        let [width, height] = RESOLUTION;
        let line = |way: &str, [clock, processor]: [f64; 2]| {
            format!("  {way:<8} {clock:>7.1} ms by the clock, {processor:>7.1} ms of processor time\n")
        };
        let head = format!("bringing a picture of {width}x{height} from a worker after a wave\n");
        head + &line("memory", self.memory) + &line("pipe", self.pipe)
    }

    /// The figures by name.
    pub fn to_json(&self) -> Json {
        json!({ "resolution": RESOLUTION, "memory_ms": self.memory, "pipe_ms": self.pipe })
    }
}

/// Median milliseconds of a wave by the clock, and mean ones of processor time here and in a worker.
fn wave_ms(renderer: &mut dyn Renderer, worker: Option<u32>, repeats: usize) -> Result<[f64; 2], String> {
    let mut advance = || renderer.advance(1).map(|_| ()).map_err(|e| e.to_string());
    // The first one asks the system for memory.
    advance()?;
    let pids = [Some(std::process::id()), worker];
    let spent = || {
        pids.into_iter()
            .flatten()
            .map(|pid| processor::of_process(pid).map_or(f64::NAN, |spent| spent.as_secs_f64()))
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
