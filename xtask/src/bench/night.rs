//! Cost of a night besides rendering.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use lumbre_light::film::Image;
use lumbre_night::experiment::event::FinishedRun;
use lumbre_night::experiment::plan::{Overrides, expand};
use lumbre_night::experiment::run::run;
use lumbre_night::experiment::{CellRef, Event, History, NightControls, Plan, Sink, SinkError};
use lumbre_scene_io::load;

/// A history without finished runs.
struct EmptyHistory;

impl History for EmptyHistory {
    fn finished_run(&self, _: &Plan, _: CellRef) -> Option<FinishedRun> {
        None
    }

    fn image(&self, _: &Plan, _: usize) -> Result<Option<Image>, SinkError> {
        Ok(None)
    }
}

/// Clocks of the latest measurement of the cell.
#[derive(Default)]
struct Clocks {
    render_s: f64,
    wall_s: f64,
}

impl Sink for Clocks {
    fn receive(&mut self, event: &Event) -> Result<(), SinkError> {
        if let Event::Wave {
            cell: CellRef::Cell(_),
            row,
            ..
        } = event
        {
            self.render_s = row.render_s;
            self.wall_s = row.wall_s;
        }
        Ok(())
    }
}

/// Loads and plans a script from a temporary folder; returns the seconds this took.
pub(super) fn plan_script(text: &str) -> Result<(lumbre_lua::Script, Plan, f64), String> {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let file = folder.path().join("bench.lua");
    std::fs::write(&file, text).map_err(|e| e.to_string())?;
    let start = Instant::now();
    let script = lumbre_lua::load(&file).map_err(|e| e.to_string())?;
    let plan = expand(
        &script.spec,
        &script,
        &Overrides::default(),
        &mut |path, _| load::load(path),
    )
    .map_err(|e| e.to_string())?;
    let seconds = start.elapsed().as_secs_f64();
    Ok((script, plan, seconds))
}

/// Plans 10,000 cells, each with its own scene edit, and measures the seconds from the script file
/// to the plan.
///
/// # Errors
/// A message for the user if the script cannot be planned.
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
    let (_, plan, seconds) = plan_script(&text)?;
    if plan.cells.len() == 10_000 {
        Ok((plan, seconds))
    } else {
        Err(format!("planned {} cells", plan.cells.len()))
    }
}

/// Plans one cell of the given size, measured by the given metrics.
///
/// # Errors
/// A message for the user if the script cannot be planned.
pub(super) fn plan_of_one_cell(
    [width, height]: [u32; 2],
    metrics: &[&str],
) -> Result<Plan, String> {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let scene = folder.path().join("ball.scn");
    std::fs::write(&scene, BALL).map_err(|e| e.to_string())?;
    let metrics: String = metrics
        .iter()
        .map(|name| format!("{name} = metric.{name}(), "))
        .collect();
    let text = format!(
        "local x = experiment('bench', {{ seed = 1 }})\n\
         x:render(function(p) return {{ scene = {:?}, integrator = 'bpt',\n\
           resolution = {{ {width}, {height} }},\n\
           backend = 'cpu' }} end)\n\
         x:reference {{ stop = stop.samples(4) }}\n\
         x:measure {{ every = '0.5s', {metrics} }}\n\
         x:stop(stop.time('1h'))\n\
         return x\n",
        scene.display().to_string()
    );
    Ok(plan_script(&text)?.1)
}

/// A scene with a sphere lit by another.
pub(super) const BALL: &str = r#"{ "resolution": [64, 64], "maxdepth": 5,
  "camera": { "position": [0, 0, 5], "lookat": [0, 0, 0], "fov": 40 },
  "materials": [ { "name": "ball", "color": [0.8, 0.8, 0.8] },
                 { "name": "lamp", "emission": [5, 5, 5] } ],
  "entities": [ { "type": "sphere", "position": [0, 0, 0], "radius": 1, "material": "ball" },
                { "type": "sphere", "position": [2, 2, 1], "radius": 0.5,
                  "material": "lamp" } ] }"#;

/// Fraction of a four-second cell that is not spent inside `advance`: evaluating three metrics
/// every half second at 640x360, and sending events. Compiling the scene and building its
/// acceleration structure happen before the clock of the cell starts.
///
/// # Errors
/// A message for the user if the cell cannot be rendered.
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
    let (script, plan, _) = plan_script(&text)?;
    let mut clocks = Clocks::default();
    run(
        &Arc::new(plan),
        &script,
        &EmptyHistory,
        &mut [&mut clocks],
        &NightControls::default(),
        threads,
    )
    .map_err(|e| e.to_string())?;
    if clocks.wall_s > 0.0 {
        Ok(1.0 - clocks.render_s / clocks.wall_s)
    } else {
        Err("the benchmark cell was not rendered".to_owned())
    }
}
