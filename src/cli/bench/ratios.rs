//! What masks, copies and many lights cost, and what a second thread brings: each beside the same without it, in turns.

use std::sync::Arc;

use serde_json::{Value as Json, json};

use super::subject::Subject;
use super::turns::in_turns;
use crate::cli::text::aligned;
use crate::math::stats::median;
use crate::render::{Job, Renderer, WaveStats, backend};
use crate::scene::compile::{Sharing, compile_sharing};
use crate::scene::desc::{SceneDesc, TextureSlot};
use crate::scene::load::Missing;
use crate::scene::{CompiledScene, compile};
use crate::script::scene;
use crate::transport::integrator::{INTEGRATORS, IntegratorRow};
use crate::value::Value;

/// Samples of one turn.
const SAMPLES: u64 = 2;
/// Copies, and lights.
const MANY: i64 = 10_000;
/// Most that masked geometry, copies and lights may cost in relation to the same without.
const MOST: f64 = 1.5;
/// Least gain of a second thread.
const GAIN: f64 = 1.9;

/// The scene of lamps, which lies with the others.
const LAMPS: &str = include_str!("../../../scenes/many_lights.lua");

/// A tray of copies, small enough that triangles of their own fit into memory as well.
const COPIES: &str = r#"
local s = scene { resolution = { 480, 270 }, max_depth = 5 }
local count = s:option("count", 100)
s:camera { position = { 0, 9, 15 }, target = { 0, -0.4, 0.4 }, fov = 42 }
s:material("tray", { base_color = { 0.35, 0.33, 0.3 } })
s:material("glaze", { base_color = { 0.55, 0.2, 0.12 }, roughness = 0.35 })
s:environment { color = { 0.8, 0.84, 0.9 } }
s:add { name = "tray", shape = shape.grid { size = { 17, 17 } }, material = "tray" }
local vase = shape.lathe { segments = 16, profile = {
  { 0, 0 }, { 0.22, 0.03 }, { 0.34, 0.42 }, { 0.18, 0.76 }, { 0.2, 0.97 }, { 0.11, 0.86 }, { 0, 0.08 } } }
local side = math.ceil(math.sqrt(count))
local step = 16 / side
local r = random(21)
for i = 0, count - 1 do
  local x, z = (i % side + 0.5) * step - 8, (i // side + 0.5) * step - 8
  s:add { name = "vase_" .. i, shape = vase, material = "glaze", at = { x, 0, z }, rotate = r:between(0, 360), scale = step }
end
return s
"#;

/// One comparison.
pub struct Ratio {
    what: &'static str,
    beside: &'static str,
    integrator: &'static str,
    /// What is compared: nanoseconds of all threads' clock.
    each: &'static str,
    /// Medians over the turns, of the thing and of what it stands beside.
    ns: [f64; 2],
    /// The median of the ratios of the turns, and what is asked of it.
    ratio: f64,
    aim: String,
}

/// Everything that is measured here.
pub struct Ratios {
    rows: Vec<Ratio>,
}

impl Ratios {
    /// Measures all of it in `turns` turns; `masked` is a scene with masks, `plain` one for threads.
    ///
    /// # Errors
    /// When a scene cannot be loaded or rendered, with a message for people.
    pub fn measure(
        masked: &Subject,
        plain: &Subject,
        turns: usize,
        say: &mut dyn FnMut(&str),
    ) -> Result<Ratios, String> {
        let nee = INTEGRATORS.iter().find(|row| row.name == "nee").ok_or("no integrator `nee`")?;
        let mut rows = Vec::new();
        say("measuring masks");
        let desc = masked.load()?;
        let mut opaque = desc.clone();
        opaque
            .materials
            .iter_mut()
            .for_each(|material| material.textures.retain(|(slot, _)| *slot != TextureSlot::Mask));
        let pair = [compiled(&desc)?, compiled(&opaque)?];
        rows.push(Ratio::of(["masked leaves", "opaque ones"], nee, "ray", &pair, turns)?);

        say("measuring ten thousand copies");
        let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
        let read = |name: &str, text: &str, options: &[(&str, Value)]| -> Result<SceneDesc, String> {
            let file = folder.path().join(name);
            std::fs::write(&file, text).map_err(|e| e.to_string())?;
            let options = options.iter().map(|(key, value)| ((*key).to_owned(), value.clone())).collect();
            let (mut desc, _) = scene::read(&file, &options, Missing::Refused).map_err(|e| e.to_string())?;
            desc.resolution = [480, 270];
            Ok(desc)
        };
        let copies = read("copies.lua", COPIES, &[("count", Value::Int(MANY))])?;
        let shared = |sharing| compile_sharing(&copies, sharing).map(|(scene, _)| Arc::new(scene));
        let pair = [Sharing::Always, Sharing::Never].map(|sharing| shared(sharing).map_err(|e| e.to_string()));
        let [own, flat] = pair;
        rows.push(Ratio::of(["10,000 copies", "triangles of their own"], nee, "ray", &[own?, flat?], turns)?);

        say("measuring ten thousand lights");
        for (kind, what, beside) in [("spheres", "10,000 lamps", "one lamp"), ("points", "10,000 points", "one point")]
        {
            let lights = |count: i64| {
                let options = [("lights", Value::Int(count)), ("kind", kind.into())];
                compiled(&read("many_lights.lua", LAMPS, &options)?)
            };
            rows.push(Ratio::of([what, beside], nee, "path", &[lights(MANY)?, lights(1)?], turns)?);
        }

        say("measuring threads");
        let desc = plain.load()?;
        let scene = compiled(&desc)?;
        for row in INTEGRATORS {
            rows.push(threads(&scene, row, turns)?);
        }
        Ok(Ratios { rows })
    }

    /// The table for people.
    pub fn table(&self) -> String {
        let head = ["", "beside", "integrator", "of each", "ns", "ns beside", "ratio", "aim"];
        let mut lines = vec![head.map(str::to_owned).to_vec()];
        for row in &self.rows {
            lines.push(vec![
                row.what.to_owned(),
                row.beside.to_owned(),
                row.integrator.to_owned(),
                row.each.to_owned(),
                format!("{:.1}", row.ns[0]),
                format!("{:.1}", row.ns[1]),
                format!("{:.2}", row.ratio),
                row.aim.clone(),
            ]);
        }
        aligned(&lines)
    }

    /// The same figures as JSON.
    pub fn to_json(&self) -> Json {
        let rows = self.rows.iter().map(|row| {
            json!({
                "what": row.what, "beside": row.beside, "integrator": row.integrator, "of_each": row.each, "ns": row.ns,
                "ratio": row.ratio, "aim": row.aim,
            })
        });
        Json::Array(rows.collect())
    }
}

impl Ratio {
    /// What one of two scenes costs in relation to the other, which take turns on one thread.
    fn of(
        [what, beside]: [&'static str; 2],
        row: &'static IntegratorRow,
        each: &'static str,
        scenes: &[Arc<CompiledScene>; 2],
        turns: usize,
    ) -> Result<Ratio, String> {
        let [thing, other] = scenes;
        let mut both = [open(thing, row, 1)?, open(other, row, 1)?];
        let count = |wave: &WaveStats| if each == "ray" { wave.rays } else { wave.paths };
        let turns = in_turns(&mut both, turns, SAMPLES, |wave| wave.render_s * 1e9 / count(wave).max(1) as f64)?;
        let ratio = median(turns.iter().map(|turn| turn[0] / turn[1]));
        let ns = [0, 1].map(|i| median(turns.iter().map(|turn| turn[i])));
        Ok(Ratio { what, beside, integrator: row.name, each, ns, ratio, aim: format!("<= {MOST}") })
    }
}

/// How much faster two threads are than one.
fn threads(scene: &Arc<CompiledScene>, row: &'static IntegratorRow, turns: usize) -> Result<Ratio, String> {
    let mut both = [open(scene, row, 1)?, open(scene, row, 2)?];
    let turns = in_turns(&mut both, turns, SAMPLES, |wave| wave.render_s * 1e9 / wave.paths.max(1) as f64)?;
    let ratio = median(turns.iter().map(|turn| turn[0] / turn[1]));
    let ns = [0, 1].map(|i| median(turns.iter().map(|turn| turn[i])));
    let (what, beside) = ("one thread", "two threads");
    Ok(Ratio { what, beside, integrator: row.name, each: "path", ns, ratio, aim: format!(">= {GAIN}") })
}

fn compiled(desc: &SceneDesc) -> Result<Arc<CompiledScene>, String> {
    compile(desc).map(|(scene, _)| Arc::new(scene)).map_err(|e| e.to_string())
}

/// A run that has had its first sample.
fn open(scene: &Arc<CompiledScene>, row: &'static IntegratorRow, threads: usize) -> Result<Box<dyn Renderer>, String> {
    let job = Job { threads, ..Job::plain(row, scene.resolution, scene.max_depth, 1) };
    let cpu = backend("cpu").ok_or("no cpu backend")?;
    let mut renderer = (cpu.open)(Arc::clone(scene), job).map_err(|e| e.to_string())?;
    renderer.advance(1).map_err(|e| e.to_string())?;
    Ok(renderer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::builtin::BuiltIn;
    use std::collections::BTreeMap;

    #[test]
    fn scenes_of_lamps_and_copies_are_what_they_say() {
        let folder = tempfile::tempdir().unwrap();
        let read = |text: &str, key: &str, count: i64| {
            let file = folder.path().join("scene.lua");
            std::fs::write(&file, text).unwrap();
            let options = BTreeMap::from([(key.to_owned(), Value::Int(count))]);
            scene::read(&file, &options, Missing::Refused).unwrap().0
        };
        let lamps = |count: i64| compiled(&read(LAMPS, "lights", count)).unwrap().spheres.len();
        assert_eq!(lamps(50) - lamps(1), 49);
        let copies = read(COPIES, "count", 30);
        let of = |sharing| compile_sharing(&copies, sharing).unwrap().0;
        let (own, flat) = (of(Sharing::Always), of(Sharing::Never));
        assert_eq!((own.instances.places.len(), flat.instances.places.len()), (30, 0));
        assert!(flat.triangles.len() > 20 * own.triangles.len());
    }

    #[test]
    fn two_runs_take_turns_and_their_costs_are_compared() {
        let built_in = BuiltIn::unpack().unwrap();
        let file = built_in.scenes().into_iter().find(|f| f.ends_with("cornell_spheres.scn")).unwrap();
        let (mut desc, _) = scene::read(&file, &BTreeMap::new(), Missing::Refused).unwrap();
        desc.resolution = [32, 24];
        let small = compiled(&desc).unwrap();
        let nee = INTEGRATORS.iter().find(|row| row.name == "nee").unwrap();
        let mut both = [open(&small, nee, 1).unwrap(), open(&shallow(&small), nee, 1).unwrap()];
        // What they trace stands in for what they take, which nobody can promise.
        let turns = in_turns(&mut both, 3, SAMPLES, |wave| wave.rays as f64 / wave.paths as f64).unwrap();
        assert_eq!(turns.len(), 3);
        assert!(turns.iter().all(|turn| turn[1] == 1.0 && turn[0] > 2.0), "{turns:?}");
        let ratio = Ratio::of(["twelve edges", "one"], nee, "path", &[Arc::clone(&small), shallow(&small)], 3).unwrap();
        assert!(ratio.ns.iter().all(|ns| *ns > 0.0) && ratio.ratio > 0.0, "{:?}", ratio.ns);
        let table = Ratios { rows: vec![ratio, threads(&small, nee, 1).unwrap()] };
        assert!(table.table().contains("<= 1.5") && table.table().contains(">= 1.9"), "{}", table.table());
        assert_eq!(table.to_json()[0]["of_each"], "path");
    }

    fn shallow(scene: &CompiledScene) -> Arc<CompiledScene> {
        Arc::new(CompiledScene { max_depth: 1, ..scene.clone() })
    }
}
