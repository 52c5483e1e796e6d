//! `lumbre check`: validates scripts and scene files without rendering or writing anything.

use std::collections::BTreeMap;

use glam::Vec3;
use serde_json::{Value as Json, json};

use crate::cli::args::{CheckArgs, Global, SceneArg, ScriptArgs};
use crate::cli::exit::{Exit, Failure, print_result, print_status};
use crate::cli::format::{counted, rounded};
use crate::cli::json;
use crate::cli::night::load;
use lumbre_light::scene::desc::{CameraDesc, CameraKind};
use lumbre_light::scene::{self, CompiledScene, SceneDesc, SceneError};
use lumbre_lua::scene::LoadedScene;
use lumbre_night::text::visible;

/// Maximum number of names that are listed.
const MOST_NAMES: usize = 40;

/// Runs `lumbre check`: checks all files, also after an error in one of them.
pub fn main(args: &CheckArgs, global: &Global) -> Result<Exit, Failure> {
    let mut exit = Exit::Done;
    let mut checks = Vec::new();
    for given in &args.files {
        let checked = if lumbre_lua::scene::is_lua(&given.file) {
            check_lua(given, global)
        } else {
            check_scene(given, global)
        };
        let file = &given.text;
        if args.json {
            checks.push(match &checked {
                Ok(Checked { text, kind, data }) => {
                    json!({ "file": file, "ok": true, "text": text, *kind: data })
                }
                Err(failure) => json!({ "file": file, "ok": false, "text": failure.message }),
            });
        }
        match checked {
            Ok(_) if global.quiet || args.json => {}
            Ok(Checked { text, .. }) => {
                print_result(&format!("ok  {file}: {text}\n"))?;
            }
            Err(failure) => {
                failure.print();
                exit = Exit::Usage;
            }
        }
    }
    if args.json {
        json::print(json!({ "files": checks }))?;
    }
    Ok(exit)
}

/// Summary of a valid file.
struct Checked {
    /// Summary as text.
    text: String,
    /// Kind of the file: `scene` or `experiment`.
    kind: &'static str,
    /// The summary as JSON.
    data: Json,
}

/// Checks a Lua file, which may be an experiment or a scene.
fn check_lua(given: &SceneArg, global: &Global) -> Result<Checked, Failure> {
    let file = &given.file;
    load::expect_script(file)?;
    let script = match lumbre_lua::load(file) {
        Err(error) if lumbre_lua::scene::is_scene(&error) => return check_scene(given, global),
        loaded => loaded.map_err(Failure::script)?,
    };
    if let Some((name, _)) = given.settings.first() {
        return Err(Failure::usage(format!(
            "{}: `{name}` after the question mark is an option of a scene, and this is an \
             experiment: `lumbre plan {} {name}=VALUE` plans it with other settings",
            given.text,
            file.display()
        )));
    }
    let args = ScriptArgs {
        script: file.to_owned(),
        ..ScriptArgs::default()
    };
    let plan = load::expand_plan(&script, &args, global, false, global.allow_commands)?;
    load::print_notes_and_warnings(&plan, global.quiet);
    let [cells, references, skipped] =
        [plan.cells.len(), plan.references.len(), plan.skipped.len()];
    Ok(Checked {
        text: format!(
            "experiment `{}`, {}, {}, {} skipped",
            plan.name,
            counted(cells, "cell"),
            counted(references, "reference"),
            counted(skipped, "point")
        ),
        kind: "experiment",
        data: json!({
            "name": plan.name, "cells": cells, "references": references, "skipped": skipped,
        }),
    })
}

/// Checks a scene file of any format.
fn check_scene(given: &SceneArg, global: &Global) -> Result<Checked, Failure> {
    let file = &given.file;
    if file.is_dir() && !lumbre_scene_io::load::is_folder(file) {
        return Err(Failure::usage(format!(
            "{} is a folder; give the files in it",
            file.display()
        )));
    }
    let LoadedScene {
        scene: desc,
        mut notes,
        options,
    } = read_scene(given, global)?;
    // Errors of compilation do not name a file.
    let (compiled, more) =
        scene::compile(&desc).map_err(|e| Failure::usage(format!("{}: {e}", file.display())))?;
    notes.extend(more);
    for note in &notes {
        // Notes of compilation are about the whole scene and do not name a file.
        let has_no_file = note.file.as_os_str().is_empty();
        print_status(&if has_no_file {
            format!("note: {}: {note}", file.display())
        } else {
            format!("note: {note}")
        });
    }
    let [width, height] = compiled.resolution;
    let counts = format!(
        "scene, {}, {}, {}, {}, {width}x{height} pixels, depth {}",
        counted(compiled.triangles.len(), "triangle"),
        counted(compiled.spheres.len(), "sphere"),
        counted(compiled.materials.len(), "material"),
        counted(compiled.emitters.len(), "emitter"),
        compiled.max_depth
    );
    Ok(Checked {
        text: counts + &contents(&desc, &compiled, &options),
        kind: "scene",
        data: contents_json(&desc, &compiled, &options),
    })
}

/// Reads a scene with the given options, and those that it declares.
fn read_scene(given: &SceneArg, global: &Global) -> Result<LoadedScene, Failure> {
    let (file, missing) = (&given.file, global.missing());
    let options = given.settings.iter().cloned().collect();
    if lumbre_lua::scene::is_lua(file) {
        let loaded = lumbre_lua::scene::load(file, &options, missing);
        return loaded.map_err(|e| Failure::usage(SceneError::Script(e.to_string())));
    }
    let read = lumbre_lua::scene::read(file, &options, missing);
    let (scene, notes) = read.map_err(Failure::usage)?;
    Ok(LoadedScene {
        scene,
        notes,
        options: BTreeMap::new(),
    })
}

/// Formats what a scene contains, one line for each kind: the box around all objects, camera, views,
/// options, objects, materials and lights. Lines begin with a line break.
fn contents(
    desc: &SceneDesc,
    compiled: &CompiledScene,
    options: &BTreeMap<String, String>,
) -> String {
    let point = |p: Vec3| {
        let [x, y, z] = p.to_array().map(|x| rounded(f64::from(x)));
        format!("({x}, {y}, {z})")
    };
    let [low, high] = compiled.bounds.map(|corner| compiled.described(corner));
    let camera = &desc.camera;
    let environment = desc.environment.iter().map(|_| "environment".to_owned());
    let lights = desc.lights.iter().map(|light| light.name.clone());
    let emitters = compiled.emitters.len();
    let surfaces = (emitters > 0).then(|| counted(emitters, "emitting surface"));
    let lines = [
        ("box", format!("{} to {}", point(low), point(high))),
        (
            "camera",
            format!(
                "at {}, towards {}, {}",
                point(camera.position),
                point(camera.target),
                view(camera)
            ),
        ),
        (
            "views",
            listed(desc.views.iter().map(|(name, _)| name.clone())),
        ),
        (
            "options",
            listed(
                options
                    .iter()
                    .map(|(name, values)| format!("{name} = {values}")),
            ),
        ),
        (
            "objects",
            listed(desc.entities.iter().map(|e| e.name.clone())),
        ),
        (
            "materials",
            listed(desc.materials.iter().map(|m| m.name.clone())),
        ),
        ("lights", listed(lights.chain(environment).chain(surfaces))),
    ];
    let shown = lines.iter().filter(|(_, text)| !text.is_empty());
    shown
        .map(|(name, text)| format!("\n    {name:<10}{text}"))
        .collect()
}

/// Returns what a camera shows of the scene in front of it.
fn view(camera: &CameraDesc) -> String {
    match camera.kind {
        CameraKind::Perspective => {
            let lens = match camera.lens_diameter() {
                0.0 => "pinhole".to_owned(),
                diameter => format!("lens of diameter {}", rounded(f64::from(diameter))),
            };
            let degrees = rounded(f64::from(camera.view_deg()));
            format!("field of view {degrees} degrees, {lens}")
        }
        CameraKind::Orthographic => format!(
            "orthographic, {} units high",
            rounded(f64::from(camera.view_height))
        ),
        CameraKind::Spherical => "spherical".to_owned(),
    }
}

/// Returns what a scene contains as JSON.
fn contents_json(
    desc: &SceneDesc,
    compiled: &CompiledScene,
    options: &BTreeMap<String, String>,
) -> Json {
    let [low, high] = compiled.bounds.map(|corner| compiled.described(corner));
    let camera = &desc.camera;
    let views: Vec<&String> = desc.views.iter().map(|(name, _)| name).collect();
    let objects: Vec<&String> = desc.entities.iter().map(|e| &e.name).collect();
    let materials: Vec<&String> = desc.materials.iter().map(|m| &m.name).collect();
    let lights: Vec<&String> = desc.lights.iter().map(|light| &light.name).collect();
    json!({
        "triangles": compiled.triangles.len(), "spheres": compiled.spheres.len(),
        "resolution": compiled.resolution, "max_depth": compiled.max_depth,
        "box": [low.to_array(), high.to_array()],
        "camera": {
            "position": camera.position.to_array(), "target": camera.target.to_array(),
            "fov": camera.view_deg(), "aperture": camera.lens_diameter(), "kind": camera.kind.name(), "view_height": camera.view_height,
            "window": camera.window.to_array(),
        },
        "views": views, "options": options, "objects": objects, "materials": materials,
        "lights": lights, "emitters": compiled.emitters.len(),
        "environment": desc.environment.is_some(),
    })
}

/// Joins names with commas; of many, the first ones and the number of the others.
fn listed(names: impl Iterator<Item = String>) -> String {
    let names: Vec<String> = names.collect();
    let first = names.len().min(MOST_NAMES);
    let mut text = names[..first].join(", ");
    if names.len() > first {
        text += &format!(", and {} more", names.len() - first);
    }
    visible(&text).into_owned()
}
