//! `lumbre trace`: the steps of one sample of one pixel, on any backend.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

use serde_json::{Value as Json, json};

use crate::cli::args::{Global, TraceArgs, integrator_row, unknown_name};
use crate::cli::bench::subject::Subject;
use crate::cli::exit::{Exit, Failure, print_result, print_status};
use crate::cli::json;
use crate::cli::reproduce::stored_run;
use crate::cli::selector;
use lumbre_light::scene::compile::MAX_FLATTENED_PRIMITIVES;
use lumbre_light::scene::desc::MAX_SIDE;
use lumbre_light::scene::{CompiledScene, compile};
use lumbre_light::transport::sampler::{SAMPLER_NAMES, sampler};
use lumbre_light::value::Value;
use lumbre_night::backends::backend;
use lumbre_render::Job;
use lumbre_render::path_trace::{MAX_PATH_EVENTS, PathEvent, SampleAt};
use lumbre_scene_io::load::{FORMATS, is_folder};

/// Returns whether an argument means a scene, which need not exist, and not a run.
fn is_scene(file: &Path) -> bool {
    let extension = file.extension().and_then(|extension| extension.to_str());
    let is_known = |extension: &str| {
        let mut formats = FORMATS.iter();
        extension == "lua" || formats.any(|format| format.extensions.contains(&extension))
    };
    file.is_file() || is_folder(file) || extension.is_some_and(is_known)
}

/// Runs `lumbre trace`: prints the steps of one sample.
pub fn main(args: &TraceArgs, global: &Global) -> Result<Exit, Failure> {
    let (scene, job, run_backend) = if is_scene(&args.file.file) {
        let (scene, job) = scene_job(args, global)?;
        (scene, job, None)
    } else if let Some((key, _)) = args.params.first() {
        return Err(Failure::usage(format!(
            "`{}` is a run, which has its own parameters, and `{key}=` is given: leave it out, or \
             quote all words that select a run",
            args.file.text
        )));
    } else {
        let run = selector::run(&args.file.text, &global.out)?;
        let (scene, job, backend) =
            stored_run::load_job(&run.folder, global).map_err(Failure::usage)?;
        (scene, job, Some(backend))
    };
    let scene = without_instances(scene)?;
    check_pixel(args.pixel, job.resolution)?;
    let [x, y] = args.pixel;
    let name = global
        .backend
        .clone()
        .or(run_backend)
        .unwrap_or_else(|| "auto".to_owned());
    let row =
        backend(&name).ok_or_else(|| Failure::usage(format!("there is no backend `{name}`")))?;
    let sample = SampleAt {
        pixel: args.pixel,
        sample: args.sample,
    };
    let mut steps = (row.paths)(&scene, &job, &[sample])
        .map_err(Failure::usage)?
        .pop()
        .unwrap_or_default();
    steps.iter_mut().for_each(|step| step.move_by(scene.origin));
    if args.json {
        let rows: Vec<Json> = steps.iter().map(|step| step_json(step, &scene)).collect();
        let json = json!({
            "backend": row.name, "integrator": job.integrator.name, "seed": job.seed,
            "pixel": args.pixel,
            "sample": args.sample, "steps": rows,
        });
        json::print(json)?;
    } else {
        print_result(&format!(
            "pixel {x},{y} sample {} of {} by {}, seed {}\n{}",
            args.sample,
            job.integrator.name,
            row.name,
            job.seed,
            page(&steps, &scene, args.pixel)
        ))?;
    }
    if steps.len() >= MAX_PATH_EVENTS && row.name != "cpu" {
        print_status(&format!(
            "note: a device records at most {MAX_PATH_EVENTS} steps; use --backend cpu for all \
             steps"
        ));
    }
    Ok(Exit::Done)
}

/// Flattens the instances of a scene, because backends number the triangles of instances
/// differently.
fn without_instances(scene: Arc<CompiledScene>) -> Result<Arc<CompiledScene>, Failure> {
    if scene.instances.placements.is_empty() {
        return Ok(scene);
    }
    let flattened = scene.flattened(MAX_FLATTENED_PRIMITIVES).map(Arc::new);
    flattened.map_err(|found| {
        Failure::usage(format!(
            "the scene has {found} triangles with all instances, but at most \
             {MAX_FLATTENED_PRIMITIVES} can be traced"
        ))
    })
}

/// Loads a scene file and creates a job with the options of the command line.
fn scene_job(args: &TraceArgs, global: &Global) -> Result<(Arc<CompiledScene>, Job), Failure> {
    let subject = Subject::from_arg(&args.file, global.missing()).map_err(Failure::usage)?;
    let desc = subject.load().map_err(Failure::usage)?;
    let (scene, _) = compile(&desc).map_err(Failure::usage)?;
    let technique = integrator_row(&args.integrator).map_err(Failure::usage)?;
    let params: BTreeMap<String, Value> = args.params.iter().cloned().collect();
    let checked = technique.params.check(technique.name, &params);
    checked.map_err(Failure::usage)?;
    let resolution = args.size.unwrap_or(scene.resolution);
    let job = Job {
        sampler: sampler(&args.sampler).ok_or_else(|| {
            Failure::usage(unknown_name("sampler", &args.sampler, &SAMPLER_NAMES))
        })?,
        threads: global.threads,
        ..Job::plain(
            technique,
            resolution,
            args.depth.unwrap_or(scene.max_depth),
            args.seed,
        )
    }
    .with(|settings| settings.params = params);
    Ok((Arc::new(scene), job))
}

/// Returns a step as JSON.
fn step_json(step: &PathEvent, scene: &CompiledScene) -> Json {
    match step {
        PathEvent::Closest { ray, t_max, hit } => json!({
            "step": "ray", "from": ray.origin.to_array(), "direction": ray.dir.to_array(),
            "within": t_max.is_finite().then_some(t_max),
            "hit": hit.map(|hit| json!({
                "t": hit.t, "primitive": hit.primitive, "uv": hit.uv,
                "what": scene.primitive_name(hit.primitive, hit.instance),
                "vertex": (ray.origin + ray.dir * hit.t).to_array(),
            })),
        }),
        PathEvent::Shadow {
            ray,
            t_max,
            blocked,
        } => json!({
            "step": "shadow", "from": ray.origin.to_array(), "direction": ray.dir.to_array(),
            "within": t_max.is_finite().then_some(t_max), "blocked": blocked,
        }),
        PathEvent::Light(c) => json!({
            "step": "light", "pixel": c.pixel, "value": c.value.to_array(),
            "unweighted": c.unweighted.to_array(),
            "s": c.s, "t": c.t,
        }),
    }
}

/// Formats the steps as text, one per line.
fn page(steps: &[PathEvent], scene: &CompiledScene, pixel: [u32; 2]) -> String {
    let mut text = String::new();
    for (i, step) in steps.iter().enumerate() {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{i:>3} {}", step.line(scene, pixel));
    }
    if steps.is_empty() {
        "nothing\n".to_owned()
    } else {
        text
    }
}

/// Checks that a pixel is inside of a picture of this width and height.
pub fn check_pixel([x, y]: [u32; 2], [width, height]: [u32; 2]) -> Result<(), Failure> {
    if x < width && y < height {
        return Ok(());
    }
    Err(Failure::usage(format!(
        "pixel {x},{y} is outside the picture, which has {width} x {height} pixels"
    )))
}

/// Parses a pixel `x,y`.
pub fn pixel(text: &str) -> Result<[u32; 2], String> {
    let pair = text
        .split_once(',')
        .and_then(|(x, y)| Some([x.trim().parse().ok()?, y.trim().parse().ok()?]));
    pair.ok_or_else(|| format!("expected column and row such as 12,7, found `{text}`"))
}

/// Parses a size `WxH` in pixels, each side between 1 and [`MAX_SIDE`].
pub fn size(text: &str) -> Result<[u32; 2], String> {
    let pair = text
        .split_once('x')
        .and_then(|(w, h)| Some([w.trim().parse().ok()?, h.trim().parse().ok()?]));
    pair.filter(|size: &[u32; 2]| size.iter().all(|n| (1..=MAX_SIDE).contains(n)))
        .ok_or_else(|| {
            format!(
                "expected width and height such as 640x360, each at most {MAX_SIDE}, found `{text}`"
            )
        })
}

#[cfg(test)]
mod tests {
    use crate::cli::scene::trace::*;

    #[test]
    fn pixels_and_sizes_are_parsed_or_rejected() {
        assert_eq!(pixel("3, 14"), Ok([3, 14]));
        assert_eq!(size("640x360"), Ok([640, 360]));
        for wrong in ["", "3", "3,", "3,-1", "a,b"] {
            assert!(pixel(wrong).is_err(), "{wrong}");
        }
        for wrong in ["0x4", "4", "4x", "99999x1"] {
            assert!(size(wrong).is_err(), "{wrong}");
        }
    }
}
