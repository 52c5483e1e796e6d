//! Cost of a checkpoint.

use std::time::Instant;

use super::night::plan_script;
use lumbre_light::film::Image;
use lumbre_light::math::stats::median;
use lumbre_light::scene::compile;
use lumbre_night::backends::backend;
use lumbre_night::experiment::CellRef;
use lumbre_night::experiment::event::History;
use lumbre_night::experiment::run_progress::RunProgress;
use lumbre_night::store::Store;
use lumbre_render::Job;

/// Median seconds for writing a checkpoint of a 1280x720 cell of `bdpt` (which has a splat film),
/// synced to disk.
///
/// # Errors
/// A message for the user if the cell cannot be rendered or the checkpoint cannot be written.
pub fn checkpoint_s(
    scene: &std::path::Path,
    threads: usize,
    repeats: usize,
) -> Result<f64, String> {
    let scene = scene.canonicalize().map_err(|e| e.to_string())?;
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let text = format!(
        "local x = experiment('bench', {{ seed = 1 }})\n\
         x:render(function(p) return {{ scene = {:?}, integrator = 'bdpt', max_depth = 5,\n\
           resolution = {{ 1280, 720 }}, backend = 'cpu' }} end)\n\
         x:stop(stop.samples(1))\n\
         return x\n",
        scene.display().to_string()
    );
    let (_, plan, _) = plan_script(&text)?;
    let cell = &plan.cells[0];
    let (compiled, _) = compile(&cell.scene).map_err(|e| e.to_string())?;
    let job = Job {
        seed: cell.seed,
        ..cell
            .config
            .job(compiled.resolution, compiled.max_depth, threads)?
    };
    let row = backend("cpu").ok_or("no such backend")?;
    let mut renderer = (row.open)(compiled.into(), job).map_err(|e| e.to_string())?;
    renderer.advance(1).map_err(|e| e.to_string())?;
    let store =
        Store::open(&folder.path().join("out"), &plan, no_picture).map_err(|e| e.to_string())?;
    let mut seconds = Vec::new();
    for _ in 0..repeats.max(1) {
        let start = Instant::now();
        store
            .save_checkpoint(
                &plan,
                CellRef::Cell(0).into(),
                &RunProgress::default(),
                &|to| renderer.save(to),
            )
            .map_err(|e| e.to_string())?;
        seconds.push(start.elapsed().as_secs_f64());
    }
    Ok(median(seconds))
}

fn no_picture(_: &[u8]) -> Result<Image, String> {
    Err("the checkpoint benchmark does not read images".to_owned())
}
