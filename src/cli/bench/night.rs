//! What a night costs besides rendering.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use crate::experiment::event::FinishedRun;
use crate::experiment::plan::{Overrides, expand};
use crate::experiment::run::run;
use crate::experiment::{CellRef, Control, Event, History, Plan, Sink, SinkError};
use crate::film::Image;
use crate::scene::load;
use crate::script;

/// Remembers nothing.
struct Forgetful;

impl History for Forgetful {
    fn done(&self, _: &Plan, _: CellRef) -> Option<FinishedRun> {
        None
    }

    fn image(&self, _: &Plan, _: usize) -> Result<Option<Image>, SinkError> {
        Ok(None)
    }
}

/// Keeps the clocks of the last measurement of the cell.
#[derive(Default)]
struct Clocks {
    render_s: f64,
    wall_s: f64,
}

impl Sink for Clocks {
    fn hear(&mut self, event: &Event) -> Result<(), SinkError> {
        if let Event::Wave { cell: CellRef::Cell(_), row, .. } = event {
            self.render_s = row.render_s;
            self.wall_s = row.wall_s;
        }
        Ok(())
    }
}

/// A script in a folder of its own, loaded and expanded.
fn planned(text: &str) -> Result<(script::Script, Plan, f64), String> {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let file = folder.path().join("bench.lua");
    std::fs::write(&file, text).map_err(|e| e.to_string())?;
    let start = Instant::now();
    let script = script::load(&file).map_err(|e| e.to_string())?;
    let plan = expand(&script.spec, &script, &Overrides::default(), &mut |path, _| load::load(path))
        .map_err(|e| e.to_string())?;
    let seconds = start.elapsed().as_secs_f64();
    Ok((script, plan, seconds))
}

/// A plan of 10,000 cells, each with its own change to the scene, and the seconds from its script's file to it.
///
/// # Errors
/// When the plan cannot be made, with a message for people.
pub fn plan_10_000_cells() -> Result<(Plan, f64), String> {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let scene = folder.path().join("ball.scn");
    std::fs::write(&scene, BALL).map_err(|e| e.to_string())?;
    let text = format!(
        "local x = experiment('bench', {{ seed = 1 }})\n\
         x:axis('ior', linspace(1.1, 2.0, 100))\n\
         x:axis('depth', range(1, 100))\n\
         x:render(function(p) return {{ scene = {:?}, integrator = 'bpt', max_depth = p.depth,\n\
           set = {{ ['materials.ball.ior'] = p.ior }} }} end)\n\
         x:stop(stop.samples(1))\n\
         return x\n",
        scene.display().to_string()
    );
    let (_, plan, seconds) = planned(&text)?;
    if plan.cells.len() == 10_000 { Ok((plan, seconds)) } else { Err(format!("planned {} cells", plan.cells.len())) }
}

/// A plan of one cell of a size, which is measured by these metrics.
///
/// # Errors
/// When the plan cannot be made, with a message for people.
pub(super) fn plan_of_one_cell([width, height]: [u32; 2], metrics: &[&str]) -> Result<Plan, String> {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let scene = folder.path().join("ball.scn");
    std::fs::write(&scene, BALL).map_err(|e| e.to_string())?;
    let metrics: String = metrics.iter().map(|name| format!("{name} = metric.{name}(), ")).collect();
    let text = format!(
        "local x = experiment('bench', {{ seed = 1 }})\n\
         x:render(function(p) return {{ scene = {:?}, integrator = 'bpt', resolution = {{ {width}, {height} }},\n\
           backend = 'cpu' }} end)\n\
         x:reference {{ stop = stop.samples(4) }}\n\
         x:measure {{ every = '0.5s', {metrics} }}\n\
         x:stop(stop.time('1h'))\n\
         return x\n",
        scene.display().to_string()
    );
    Ok(planned(&text)?.1)
}

/// A sphere that shines on another.
pub(super) const BALL: &str = r#"{ "resolution": [64, 64], "maxdepth": 5,
  "camera": { "position": [0, 0, 5], "lookat": [0, 0, 0], "fov": 40 },
  "materials": [ { "name": "ball", "color": [0.8, 0.8, 0.8] }, { "name": "lamp", "emission": [5, 5, 5] } ],
  "entities": [ { "type": "sphere", "position": [0, 0, 0], "radius": 1, "material": "ball" },
                { "type": "sphere", "position": [2, 2, 1], "radius": 0.5, "material": "lamp" } ] }"#;

/// The part of a four-second cell's time that is not spent inside `advance`: measuring three metrics every half second
/// at 640x360, and telling listeners. The scene is compiled and its hierarchy built before the cell's clock starts.
///
/// # Errors
/// When the cell cannot be rendered, with a message for people.
pub fn share_outside_advance(scene: &Path, threads: usize) -> Result<f64, String> {
    let scene = scene.canonicalize().map_err(|e| e.to_string())?;
    let text = format!(
        "local x = experiment('bench', {{ seed = 1 }})\n\
         x:axis('depth', {{ 5 }})\n\
         x:render(function(p) return {{ scene = {:?}, integrator = 'bpt', max_depth = p.depth,\n\
           resolution = {{ 640, 360 }}, backend = 'cpu' }} end)\n\
         x:reference {{ stop = stop.samples(4) }}\n\
         x:measure {{ every = '0.5s', rmse = metric.rmse(), relmse = metric.relmse(),\n\
           ssim = metric.ssim {{ on = tonemap.srgb(), range = 1.0 }} }}\n\
         x:stop(stop.time('4s'))\n\
         return x\n",
        scene.display().to_string()
    );
    let (script, plan, _) = planned(&text)?;
    let mut clocks = Clocks::default();
    run(&Arc::new(plan), &script, &Forgetful, &mut [&mut clocks], &Control::default(), threads)
        .map_err(|e| e.to_string())?;
    if clocks.wall_s > 0.0 { Ok(1.0 - clocks.render_s / clocks.wall_s) } else { Err("nothing was rendered".to_owned()) }
}
