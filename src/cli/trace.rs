//! `lumbre trace`: what one sample of one pixel does, step by step, on any backend.

use std::fmt::Write as _;
use std::sync::Arc;

use serde_json::{Value as Json, json};

use super::args::{Global, TraceArgs};
use super::exit::{Exit, Failure, data, talk};
use super::load;
use super::reproduce::again;
use crate::render::paths::{MOST_STEPS, SampleAt, Step};
use crate::render::{Job, backend};
use crate::scene::compile::{MOST_UNFOLDED, NONE};
use crate::scene::{CompiledScene, compile};
use crate::transport::integrator::{INTEGRATORS, integrator};
use crate::transport::sampler::{SAMPLER_NAMES, sampler};
use crate::value::suggest;

/// Prints the steps.
pub fn main(args: &TraceArgs, global: &Global) -> Result<Exit, Failure> {
    let (scene, job, own) = if args.file.join("config.json").is_file() {
        let (scene, job, own) = again::job(&args.file, global).map_err(Failure::usage)?;
        (scene, job, Some(own))
    } else {
        let (scene, job) = of_scene(args, global)?;
        (scene, job, None)
    };
    // Backends number the triangles of copies alike only where each has its own.
    let scene = if scene.instances.places.is_empty() {
        scene
    } else {
        scene.flattened(MOST_UNFOLDED).map(Arc::new).map_err(|found| {
            Failure::usage(format!("its copies of meshes are {found} triangles; at most {MOST_UNFOLDED} can be traced"))
        })?
    };
    let [width, height] = job.resolution;
    let [x, y] = args.pixel;
    if x >= width || y >= height {
        return Err(Failure::usage(format!("there is no pixel {x},{y} in a picture of {width}x{height}")));
    }
    let name = global.backend.clone().or(own).unwrap_or_else(|| "auto".to_owned());
    let row = backend(&name).ok_or_else(|| Failure::usage(format!("there is no backend `{name}`")))?;
    let at = SampleAt { pixel: args.pixel, sample: args.sample };
    let steps = (row.paths)(&scene, &job, &[at]).map_err(Failure::usage)?.pop().unwrap_or_default();
    if args.json {
        let rows: Vec<Json> = steps.iter().map(|step| row_of(step, &scene)).collect();
        let what = json!({
            "backend": row.name, "integrator": job.integrator.name, "seed": job.seed, "pixel": args.pixel,
            "sample": args.sample, "steps": rows,
        });
        data(&format!("{what:#}\n"))?;
    } else {
        let of = format!("pixel {x},{y} sample {} of {} by {}", args.sample, job.integrator.name, row.name);
        data(&format!("{of}, seed {}\n{}", job.seed, page(&steps, &scene, args.pixel)))?;
    }
    if steps.len() >= MOST_STEPS && row.name != "cpu" {
        talk(&format!("note: no more than {MOST_STEPS} steps are recorded on a device"));
    }
    Ok(Exit::Done)
}

/// A job on a scene file, as the options say.
fn of_scene(args: &TraceArgs, global: &Global) -> Result<(Arc<CompiledScene>, Job), Failure> {
    let (desc, _) = load::scene(&args.file, global.missing()).map_err(Failure::usage)?;
    let (scene, _) = compile(&desc).map_err(Failure::usage)?;
    let unknown = |what: &str, name: &str, known: Vec<&'static str>| {
        let near = suggest::nearest(name, known.iter().copied());
        let help = near.map_or_else(|| format!("there are: {}", known.join(", ")), |n| format!("did you mean `{n}`?"));
        Failure::usage(format!("there is no {what} `{name}` ({help})"))
    };
    let names = || INTEGRATORS.iter().map(|row| row.name).collect();
    let technique = integrator(&args.integrator).ok_or_else(|| unknown("integrator", &args.integrator, names()))?;
    let resolution = args.size.unwrap_or(scene.resolution);
    let job = Job {
        sampler: sampler(&args.sampler).ok_or_else(|| unknown("sampler", &args.sampler, SAMPLER_NAMES.to_vec()))?,
        threads: global.threads,
        ..Job::plain(technique, resolution, args.depth.unwrap_or(scene.max_depth), args.seed)
    };
    Ok((Arc::new(scene), job))
}

/// What a primitive is called: its kind, number and the model of its material.
fn primitive(scene: &CompiledScene, id: u32) -> String {
    let material = &scene.materials[scene.material_of(id, NONE) as usize];
    let i = id as usize;
    let (kind, i) = if i < scene.triangles.len() { ("triangle", i) } else { ("sphere", i - scene.triangles.len()) };
    format!("{kind} {i} ({})", material.model.word())
}

fn row_of(step: &Step, scene: &CompiledScene) -> Json {
    match step {
        Step::Closest { ray, t_max, hit } => json!({
            "step": "ray", "from": ray.origin.to_array(), "direction": ray.dir.to_array(),
            "within": t_max.is_finite().then_some(t_max),
            "hit": hit.map(|hit| json!({
                "t": hit.t, "primitive": hit.primitive, "uv": hit.uv, "what": primitive(scene, hit.primitive),
                "vertex": (ray.origin + ray.dir * hit.t).to_array(),
            })),
        }),
        Step::Shadow { ray, t_max, blocked } => json!({
            "step": "shadow", "from": ray.origin.to_array(), "direction": ray.dir.to_array(),
            "within": t_max.is_finite().then_some(t_max), "blocked": blocked,
        }),
        Step::Light(c) => json!({
            "step": "light", "pixel": c.pixel, "value": c.value.to_array(), "unweighted": c.unweighted.to_array(),
            "s": c.s, "t": c.t,
        }),
    }
}

/// The steps for people.
fn page(steps: &[Step], scene: &CompiledScene, pixel: [u32; 2]) -> String {
    let point = |v: glam::Vec3| format!("({}, {}, {})", v.x, v.y, v.z);
    let mut text = String::new();
    for (i, step) in steps.iter().enumerate() {
        let line = match step {
            Step::Closest { ray, hit: None, .. } => {
                format!("ray    {} -> {}: nothing", point(ray.origin), point(ray.dir))
            }
            Step::Closest { ray, hit: Some(hit), .. } => {
                let vertex = point(ray.origin + ray.dir * hit.t);
                format!(
                    "ray    {} -> vertex {vertex}: {}, t {}",
                    point(ray.origin),
                    primitive(scene, hit.primitive),
                    hit.t
                )
            }
            Step::Shadow { ray, t_max, blocked } => {
                let end = if t_max.is_finite() { point(ray.origin + ray.dir * *t_max) } else { "outside".to_owned() };
                format!("shadow {} -> {end}: {}", point(ray.origin), if *blocked { "blocked" } else { "free" })
            }
            Step::Light(c) => {
                let place =
                    if c.pixel == pixel { String::new() } else { format!(" for pixel {},{}", c.pixel[0], c.pixel[1]) };
                format!("light  s {} t {}: {} of {}{place}", c.s, c.t, point(c.value), point(c.unweighted))
            }
        };
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{i:>3} {line}");
    }
    if steps.is_empty() { "nothing\n".to_owned() } else { text }
}

/// Reads `x,y`.
pub fn pixel(text: &str) -> Result<[u32; 2], String> {
    let pair = text.split_once(',').and_then(|(x, y)| Some([x.trim().parse().ok()?, y.trim().parse().ok()?]));
    pair.ok_or_else(|| format!("expected column and row such as 12,7, found `{text}`"))
}

/// Reads `WxH`.
pub fn size(text: &str) -> Result<[u32; 2], String> {
    let pair = text.split_once('x').and_then(|(w, h)| Some([w.trim().parse().ok()?, h.trim().parse().ok()?]));
    pair.filter(|size: &[u32; 2]| size.iter().all(|n| (1..=1 << 14).contains(n)))
        .ok_or_else(|| format!("expected width and height such as 640x360, found `{text}`"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_and_sizes_are_read_or_refused() {
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
