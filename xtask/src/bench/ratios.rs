//! Cost ratios of masks, instances and many lights, and the gain of a second thread. Each variant
//! is interleaved with its baseline.

use std::path::Path;
use std::sync::Arc;

use glam::Vec3;
use lumbre::cli::bench::interleave::interleaved;
use lumbre::cli::bench::subject::Subject;
use lumbre::cli::format::aligned;
use lumbre_light::math::stats::median;
use lumbre_light::scene::compile::{Sharing, compile_sharing};
use lumbre_light::scene::desc::{MaterialDesc, SceneDesc, TextureSlot};
use lumbre_light::scene::{CompiledScene, compile};
use lumbre_light::transport::integrator::{INTEGRATORS, IntegratorRow};
use lumbre_light::value::Value;
use lumbre_lua::scene;
use lumbre_night::backends::backend;
use lumbre_render::cpu::renderer::CpuRenderer;
use lumbre_render::{Job, Renderer, WaveStats};
use lumbre_scene_io::load::MissingTextures;

/// Samples per pixel of one round.
const SAMPLES: u64 = 2;
/// Number of instances, and of lights.
const MANY: i64 = 10_000;
/// Largest acceptable cost ratio of masks, instances and lights.
const MAX_RATIO: f64 = 1.5;
/// Number of threads for which shared writes are counted.
const THREADS: usize = 64;
/// Samples of the wave in which shared writes are counted.
const WAVE: u64 = 16;
/// Smallest acceptable gain of a second thread.
const MIN_GAIN: f64 = 1.9;

/// The scene with many lights, one of the built-in scenes.
const MANY_LIGHTS: &str = include_str!("../../../scenes/many_lights.lua");

/// A tray of instances, small enough that separate triangles fit into memory as well.
const INSTANCES: &str = r#"
local s = scene { resolution = { 480, 270 }, max_depth = 5 }
local count = s:option("count", 100)
s:camera { position = { 0, 9, 15 }, target = { 0, -0.4, 0.4 }, fov = 42 }
s:material("tray", { base_color = { 0.35, 0.33, 0.3 } })
s:material("glaze", { base_color = { 0.55, 0.2, 0.12 }, roughness = 0.35 })
s:environment { color = { 0.8, 0.84, 0.9 } }
s:add { name = "tray", shape = shape.grid { size = { 17, 17 } }, material = "tray" }
local vase = shape.lathe { segments = 16, profile = {
  { 0, 0 }, { 0.22, 0.03 }, { 0.34, 0.42 }, { 0.18, 0.76 }, { 0.2, 0.97 },
  { 0.11, 0.86 }, { 0, 0.08 } } }
local side = math.ceil(math.sqrt(count))
local step = 16 / side
local r = random(21)
for i = 0, count - 1 do
  local x, z = (i % side + 0.5) * step - 8, (i // side + 0.5) * step - 8
  s:add { name = "vase_" .. i, shape = vase, material = "glaze", at = { x, 0, z },
    rotate = r:between(0, 360), scale = step }
end
return s
"#;

/// Comparison of a variant with its baseline.
pub struct Ratio {
    name: &'static str,
    baseline: &'static str,
    integrator: &'static str,
    /// Unit of work by which times are divided: "ray" or "path".
    unit: &'static str,
    /// Median nanoseconds per unit of work, summed over threads: variant and baseline.
    ns: [f64; 2],
    /// Median over the rounds of variant divided by baseline, and the target for it.
    ratio: f64,
    target: String,
}

/// Number of writes to memory that threads share.
pub struct SharedWrites {
    integrator: &'static str,
    /// Writes per thousand paths, with one thread and with [`THREADS`].
    writes: [f64; 2],
}

/// All comparisons of this module.
pub struct Ratios {
    rows: Vec<Ratio>,
    shared: Vec<SharedWrites>,
}

impl Ratios {
    /// Measures all comparisons in `rounds` rounds; `masked` is a scene with masks, `plain` is used
    /// for the thread comparison.
    ///
    /// # Errors
    /// A message for the user if a scene cannot be loaded or rendered.
    pub fn measure(
        masked: &Subject,
        plain: &Subject,
        rounds: usize,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Ratios, String> {
        let nee = INTEGRATORS
            .iter()
            .find(|row| row.name == "nee")
            .ok_or("no integrator `nee`")?;
        progress("measuring masks");
        let mut rows = vec![masks(masked, nee, rounds)?];
        let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
        progress("measuring 10,000 instances");
        rows.push(instances(folder.path(), nee, rounds)?);
        progress("measuring 10,000 lights");
        rows.extend(lights(folder.path(), nee, rounds)?);
        progress("measuring threads");
        let scene = compiled(&plain.load()?)?;
        for row in INTEGRATORS {
            rows.push(threads(&scene, row, rounds)?);
        }
        progress("counting writes to shared memory");
        let shared = INTEGRATORS
            .iter()
            .map(|row| SharedWrites::count(&scene, row))
            .collect::<Result<_, _>>()?;
        Ok(Ratios { rows, shared })
    }

    /// Formats the figures as text.
    pub fn table(&self) -> String {
        let head = [
            "",
            "baseline",
            "integrator",
            "per",
            "ns",
            "baseline ns",
            "ratio",
            "target",
        ];
        let mut lines = vec![head.map(str::to_owned).to_vec()];
        for row in &self.rows {
            lines.push(vec![
                row.name.to_owned(),
                row.baseline.to_owned(),
                row.integrator.to_owned(),
                row.unit.to_owned(),
                format!("{:.1}", row.ns[0]),
                format!("{:.1}", row.ns[1]),
                format!("{:.2}", row.ratio),
                row.target.clone(),
            ]);
        }
        let mut text = aligned(&lines);
        text += &format!(
            "\n\nwrites to memory shared by threads, per 1000 paths, with 1 and {THREADS} \
             threads:\n"
        );
        for shared in &self.shared {
            let [one, many] = shared.writes;
            text += &format!("{:<5} {one:>8.3} {many:>8.3}\n", shared.integrator);
        }
        text
    }
}

/// Compares masked leaves with the same leaves without masks.
fn masks(
    masked: &Subject,
    integrator: &'static IntegratorRow,
    rounds: usize,
) -> Result<Ratio, String> {
    let desc = masked.load()?;
    let mut opaque = desc.clone();
    opaque.materials.iter_mut().for_each(|material| {
        material
            .textures
            .retain(|(slot, _)| *slot != TextureSlot::Mask)
    });
    let pair = [compiled(&desc)?, compiled(&opaque)?];
    let names = ["masked leaves", "opaque leaves"];
    Ratio::measure(names, integrator, "ray", &pair, rounds)
}

/// Compares instances of a mesh with the same triangles without instancing.
fn instances(
    folder: &Path,
    integrator: &'static IntegratorRow,
    rounds: usize,
) -> Result<Ratio, String> {
    let desc = read_scene(
        folder,
        "copies.lua",
        INSTANCES,
        &[("count", Value::Int(MANY))],
    )?;
    let [instanced, flattened] = [Sharing::Always, Sharing::Never].map(|sharing| {
        compile_sharing(&desc, sharing)
            .map(|(scene, _)| Arc::new(scene))
            .map_err(|e| e.to_string())
    });
    let names = ["10,000 instances", "separate triangles"];
    Ratio::measure(names, integrator, "ray", &[instanced?, flattened?], rounds)
}

/// Compares many lights with one, and with as many spheres of which one emits light.
fn lights(
    folder: &Path,
    integrator: &'static IntegratorRow,
    rounds: usize,
) -> Result<Vec<Ratio>, String> {
    let mut rows = Vec::new();
    for (kind, name, baseline) in [
        ("spheres", "10,000 sphere lights", "1 sphere light"),
        ("points", "10,000 point lights", "1 point light"),
    ] {
        let with_lights = |count: i64| {
            let options = [("lights", Value::Int(count)), ("kind", kind.into())];
            read_scene(folder, "many_lights.lua", MANY_LIGHTS, &options)
        };
        let many = with_lights(MANY)?;
        let pair = [compiled(&many)?, compiled(&with_lights(1)?)?];
        rows.push(Ratio::measure(
            [name, baseline],
            integrator,
            "ray",
            &pair,
            rounds,
        )?);
        if kind == "spheres" {
            // The rays intersect the same spheres, so the ratio is the cost of light selection.
            let [all, _] = pair;
            let pair = [all, compiled(&one_lit(many))?];
            let names = [name, "1 lit of 10,000"];
            rows.push(Ratio::measure(names, integrator, "ray", &pair, rounds)?);
        }
    }
    Ok(rows)
}

/// Writes a Lua scene to a file and loads it with options, at 480x270.
fn read_scene(
    folder: &Path,
    name: &str,
    text: &str,
    options: &[(&str, Value)],
) -> Result<SceneDesc, String> {
    let file = folder.join(name);
    std::fs::write(&file, text).map_err(|e| e.to_string())?;
    let options = options
        .iter()
        .map(|(key, value)| ((*key).to_owned(), value.clone()))
        .collect();
    let (mut desc, _) =
        scene::read(&file, &options, MissingTextures::Fail).map_err(|e| e.to_string())?;
    desc.resolution = [480, 270];
    Ok(desc)
}

impl SharedWrites {
    /// Counts the writes in a wave as long as those of a night. Nothing is timed, so there may be
    /// more threads than cores.
    fn count(
        scene: &Arc<CompiledScene>,
        row: &'static IntegratorRow,
    ) -> Result<SharedWrites, String> {
        let writes = |threads: usize| {
            let job = Job::plain(row, scene.resolution, scene.max_depth, 1).on_threads(threads);
            let mut renderer =
                CpuRenderer::new(Arc::clone(scene), job).map_err(|e| e.to_string())?;
            let wave = renderer.advance(WAVE).map_err(|e| e.to_string())?;
            Ok::<_, String>(renderer.shared_writes() as f64 * 1e3 / wave.paths as f64)
        };
        Ok(SharedWrites {
            integrator: row.name,
            writes: [writes(1)?, writes(THREADS)?],
        })
    }
}

/// Returns the scene with only one emissive entity left.
fn one_lit(mut desc: SceneDesc) -> SceneDesc {
    let lit: Vec<String> = desc
        .materials
        .iter()
        .filter(|m| m.emission != Vec3::ZERO)
        .map(|m| m.name.clone())
        .collect();
    let emits =
        |material: &Option<String>| material.as_ref().is_some_and(|name| lit.contains(name));
    let dark = "dark".to_owned();
    for entity in desc
        .entities
        .iter_mut()
        .filter(|entity| emits(&entity.material))
        .skip(1)
    {
        entity.material = Some(dark.clone());
    }
    desc.materials.push(MaterialDesc {
        base_color: Vec3::ZERO,
        ..MaterialDesc::new(&dark)
    });
    desc
}

impl Ratio {
    /// Measures two scenes interleaved on one thread.
    fn measure(
        [name, baseline]: [&'static str; 2],
        row: &'static IntegratorRow,
        unit: &'static str,
        scenes: &[Arc<CompiledScene>; 2],
        rounds: usize,
    ) -> Result<Ratio, String> {
        let [variant, baseline_scene] = scenes;
        let mut runs = [open(variant, row, 1)?, open(baseline_scene, row, 1)?];
        let count = |wave: &WaveStats| if unit == "ray" { wave.rays } else { wave.paths };
        let rounds = interleaved(&mut runs, rounds, SAMPLES, |wave| {
            wave.render_s * 1e9 / count(wave).max(1) as f64
        })?;
        let ratio = median(rounds.iter().map(|round| round[0] / round[1]));
        let ns = [0, 1].map(|i| median(rounds.iter().map(|round| round[i])));
        Ok(Ratio {
            name,
            baseline,
            integrator: row.name,
            unit,
            ns,
            ratio,
            target: format!("<= {MAX_RATIO}"),
        })
    }
}

/// Measures the gain of two threads over one.
fn threads(
    scene: &Arc<CompiledScene>,
    row: &'static IntegratorRow,
    rounds: usize,
) -> Result<Ratio, String> {
    let mut runs = [open(scene, row, 1)?, open(scene, row, 2)?];
    let rounds = interleaved(&mut runs, rounds, SAMPLES, |wave| {
        wave.render_s * 1e9 / wave.paths.max(1) as f64
    })?;
    let ratio = median(rounds.iter().map(|round| round[0] / round[1]));
    let ns = [0, 1].map(|i| median(rounds.iter().map(|round| round[i])));
    let (name, baseline) = ("one thread", "two threads");
    Ok(Ratio {
        name,
        baseline,
        integrator: row.name,
        unit: "path",
        ns,
        ratio,
        target: format!(">= {MIN_GAIN}"),
    })
}

fn compiled(desc: &SceneDesc) -> Result<Arc<CompiledScene>, String> {
    compile(desc)
        .map(|(scene, _)| Arc::new(scene))
        .map_err(|e| e.to_string())
}

/// Opens a run and renders its first sample.
fn open(
    scene: &Arc<CompiledScene>,
    row: &'static IntegratorRow,
    threads: usize,
) -> Result<Box<dyn Renderer>, String> {
    let job = Job::plain(row, scene.resolution, scene.max_depth, 1).on_threads(threads);
    let cpu = backend("cpu").ok_or("no cpu backend")?;
    let mut renderer = (cpu.open)(Arc::clone(scene), job).map_err(|e| e.to_string())?;
    renderer.advance(1).map_err(|e| e.to_string())?;
    Ok(renderer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_light::scene::compile::NONE;
    use std::collections::BTreeMap;

    #[test]
    fn benchmark_scenes_have_the_stated_lights_and_instances() {
        let folder = tempfile::tempdir().unwrap();
        let read = |text: &str, key: &str, count: i64| {
            let file = folder.path().join("scene.lua");
            std::fs::write(&file, text).unwrap();
            let options = BTreeMap::from([(key.to_owned(), Value::Int(count))]);
            scene::read(&file, &options, MissingTextures::Fail)
                .unwrap()
                .0
        };
        let spheres_with = |count: i64| {
            compiled(&read(MANY_LIGHTS, "lights", count))
                .unwrap()
                .spheres
                .len()
        };
        assert_eq!(spheres_with(50) - spheres_with(1), 49);
        let spheres_and_emitters = |desc: &SceneDesc| {
            let scene = compiled(desc).unwrap();
            [
                scene.spheres.len(),
                scene.spheres.iter().filter(|s| s.emitter != NONE).count(),
            ]
        };
        let many = read(MANY_LIGHTS, "lights", 50);
        let [spheres, lit] = spheres_and_emitters(&many);
        assert_eq!(
            (lit, spheres_and_emitters(&one_lit(many))),
            (50, [spheres, 1])
        );
        let desc = read(INSTANCES, "count", 30);
        let compile_as = |sharing| compile_sharing(&desc, sharing).unwrap().0;
        let (instanced, flattened) = (compile_as(Sharing::Always), compile_as(Sharing::Never));
        assert_eq!(
            (
                instanced.instances.placements.len(),
                flattened.instances.placements.len()
            ),
            (30, 0)
        );
        assert!(flattened.triangles.len() > 20 * instanced.triangles.len());
    }

    #[test]
    fn interleaved_runs_are_compared_by_cost() {
        let file = crate::root().join("scenes/cornell_spheres/cornell_spheres.scn");
        let (mut desc, _) = scene::read(&file, &BTreeMap::new(), MissingTextures::Fail).unwrap();
        desc.resolution = [32, 24];
        let small = compiled(&desc).unwrap();
        let nee = INTEGRATORS.iter().find(|row| row.name == "nee").unwrap();
        let mut runs = [
            open(&small, nee, 1).unwrap(),
            open(&shallow(&small), nee, 1).unwrap(),
        ];
        // Rays per path replace the time, which varies.
        let rounds = interleaved(&mut runs, 3, SAMPLES, |wave| {
            wave.rays as f64 / wave.paths as f64
        })
        .unwrap();
        assert_eq!(rounds.len(), 3);
        assert!(
            rounds.iter().all(|round| round[1] == 1.0 && round[0] > 2.0),
            "{rounds:?}"
        );
        let ratio = Ratio::measure(
            ["twelve edges", "one"],
            nee,
            "path",
            &[Arc::clone(&small), shallow(&small)],
            3,
        )
        .unwrap();
        assert!(
            ratio.ns.iter().all(|ns| *ns > 0.0) && ratio.ratio > 0.0,
            "{:?}",
            ratio.ns
        );
        let shared = vec![SharedWrites::count(&small, nee).unwrap()];
        let table = Ratios {
            rows: vec![ratio, threads(&small, nee, 1).unwrap()],
            shared,
        };
        assert!(
            table.table().contains("<= 1.5") && table.table().contains(">= 1.9"),
            "{}",
            table.table()
        );
        // Only film rows are shared, for any number of threads.
        let paths = 32.0 * 24.0 * WAVE as f64;
        assert_eq!(table.shared[0].writes, [3.0 * 24.0 * 1e3 / paths; 2]);
    }

    fn shallow(scene: &CompiledScene) -> Arc<CompiledScene> {
        Arc::new(CompiledScene {
            max_depth: 1,
            ..scene.clone()
        })
    }
}
