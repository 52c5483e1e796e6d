//! Animations: the properties of nodes at one time, which replace those of the document before its
//! scene is loaded.

use serde_json::Value as Json;

use super::document::Document;
use super::{list, shown, unit_quaternion};
use crate::load::Variables;
use lumbre_light::scene::{Note, SceneError};
use lumbre_light::value::schema::unknown_name;

/// Scene option: the time in seconds.
const TIME: &str = "time";
/// Scene option: the name or the index of an animation.
const ANIMATION: &str = "animation";
/// Scene options of glTF files; `stage` is read by the caller.
const OPTIONS: [&str; 3] = [TIME, ANIMATION, "stage"];

/// Sets the nodes of a document to their pose at the time of the scene options. Without that option
/// they keep the pose of the file.
///
/// # Errors
/// Fails for unknown options and values, and for invalid animations.
pub(super) fn apply(
    document: &mut Document,
    options: &Variables,
    notes: &mut Vec<Note>,
) -> Result<(), SceneError> {
    let path = document.path.clone();
    let invalid = |name: &str, problem: String| {
        SceneError::malformed(&path, format!("scene_options.{name}"), problem)
    };
    if let Some(name) = options
        .keys()
        .find(|name| !OPTIONS.contains(&name.as_str()))
    {
        let error = unknown_name("scene_options", &shown(name), "option", OPTIONS);
        let problem = format!("{}: {}", error.problem, error.help.unwrap_or_default());
        return Err(SceneError::malformed(&path, error.path, problem));
    }
    let Some(time) = options.get(TIME) else {
        if options.contains_key(ANIMATION) {
            let problem = "an animation needs a `time`: give this option, too";
            return Err(invalid(ANIMATION, problem.to_owned()));
        }
        if document.count("animations") > 0 {
            let pose = "every node has its static transform; the scene option `time` selects a \
                        time in seconds, and `animation` an animation by name or index";
            notes.push(Note::new(path, "animations", pose));
        }
        return Ok(());
    };
    let seconds = time.parse().ok().filter(|t: &f64| t.is_finite());
    let Some(seconds) = seconds else {
        let problem = format!("expected a time in seconds, found `{}`", shown(time));
        return Err(invalid(TIME, problem));
    };
    let i =
        select(document, options.get(ANIMATION)).map_err(|problem| invalid(ANIMATION, problem))?;
    let animation = document.at("animations", i).clone();
    for (k, channel) in list(&animation["channels"]).iter().enumerate() {
        let place = format!("animations[{i}].channels[{k}]");
        match change(document, &place, &animation, channel, seconds)? {
            Ok((node, property, value)) => {
                if let Some(node) = document.json["nodes"][node].as_object_mut() {
                    node.insert(property, value.into());
                }
            }
            Err(reason) => {
                let problem = format!("{reason}; the channel is ignored");
                notes.push(Note::new(&path, place, problem));
            }
        }
    }
    Ok(())
}

/// Returns the index of the animation with a name or an index, or of the first one.
fn select(document: &Document, wanted: Option<&String>) -> Result<usize, String> {
    let count = document.count("animations");
    let name = |i: usize| document.at("animations", i)["name"].as_str();
    // Numbers of a script may be floats.
    let index = |text: &str| {
        let x = text
            .parse()
            .ok()
            .filter(|x: &f64| *x >= 0.0 && x.fract() == 0.0);
        x.map(|x| x as usize)
    };
    let found = match wanted {
        None => Some(0),
        Some(wanted) => (0..count)
            .find(|i| name(*i) == Some(wanted))
            .or_else(|| index(wanted)),
    };
    found.filter(|i| *i < count).ok_or_else(|| {
        let names: Vec<String> = (0..count.min(8)).filter_map(name).map(shown).collect();
        let wanted = wanted.map_or_else(String::new, |wanted| format!(" `{}`", shown(wanted)));
        format!(
            "there is no animation{wanted}; the file has {count}: {}",
            names.join(", ")
        )
    })
}

/// The index of a node, the name of a property of it, and its value.
type Change = (usize, String, Vec<f64>);

/// Returns what a channel of an animation changes at a time, or the reason for ignoring it.
fn change(
    document: &Document,
    place: &str,
    animation: &Json,
    channel: &Json,
    time: f64,
) -> Result<Result<Change, String>, SceneError> {
    let target = &channel["target"];
    let path = target["path"].as_str().unwrap_or_default();
    if path == "pointer" {
        return Ok(Err("`KHR_animation_pointer` is not supported".to_owned()));
    }
    if target["node"].is_null() {
        return Ok(Err("its target is no node".to_owned()));
    }
    let (n, node) = document.resolve(place, "nodes", &target["node"])?;
    let width = match path {
        "translation" | "scale" => 3,
        "rotation" => 4,
        "weights" if node["mesh"].is_null() => return Ok(Err("its node has no mesh".to_owned())),
        "weights" => {
            let (_, mesh) = document.resolve(place, "meshes", &node["mesh"])?;
            list(&mesh["primitives"][0]["targets"]).len()
        }
        _ => return Ok(Err(format!("its path `{}` is unknown", shown(path)))),
    };
    let error = |problem: String| Err(document.error(place, problem));
    if path != "weights" && node["matrix"].is_array() {
        return error(format!(
            "nodes[{n}] has a `matrix`, which cannot be animated"
        ));
    }
    let index = channel["sampler"].as_u64().unwrap_or(u64::MAX);
    let Some(sampler) = animation["samplers"].get(index as usize) else {
        return error("there is no such sampler".to_owned());
    };
    let times = document.numbers(place, &sampler["input"], 1)?;
    document.charge(place, times.len() as u64)?;
    if times.is_empty() || times.windows(2).any(|pair| pair[0] >= pair[1]) {
        return error("times must increase, and there must be one".to_owned());
    }
    let interpolation = sampler["interpolation"].as_str().unwrap_or("LINEAR");
    if !["STEP", "LINEAR", "CUBICSPLINE"].contains(&interpolation) {
        return error(format!("unknown interpolation `{}`", shown(interpolation)));
    }
    let values = document.numbers(
        place,
        &sampler["output"],
        if path == "weights" { 1 } else { width },
    )?;
    // A spline has tangents before and after each value.
    let parts = if interpolation == "CUBICSPLINE" { 3 } else { 1 };
    if width.checked_mul(parts * times.len()) != Some(values.len()) || width == 0 {
        let (found, keys) = (values.len(), times.len());
        return error(format!(
            "{found} numbers are not {parts} x {width} for {keys} times"
        ));
    }
    let part = |k: usize, part: usize| &values[(k * parts + part) * width..][..width];
    let value = |k: usize| part(k, parts / 2);
    let next = times.partition_point(|t| *t <= time);
    let k = next.saturating_sub(1);
    // The values at the ends hold outside of the range of times.
    if next == 0 || next == times.len() || interpolation == "STEP" {
        return Ok(Ok((n, path.to_owned(), value(k).to_vec())));
    }
    let step = times[next] - times[k];
    let u = (time - times[k]) / step;
    let combined = |terms: &[(f64, &[f64])]| -> Vec<f64> {
        let sum = |c| terms.iter().map(|(factor, v)| factor * v[c]).sum();
        (0..width).map(sum).collect()
    };
    let value = match (interpolation, path) {
        // Hermite basis; tangents are per second.
        ("CUBICSPLINE", _) => combined(&[
            ((2.0 * u - 3.0) * u * u + 1.0, value(k)),
            (((u - 2.0) * u + 1.0) * u * step, part(k, 2)),
            ((3.0 - 2.0 * u) * u * u, value(next)),
            ((u - 1.0) * u * u * step, part(next, 0)),
        ]),
        (_, "rotation") => {
            let [from, to] = [k, next].map(|k| unit_quaternion(|c| value(k)[c]));
            from.slerp(to, u).to_array().to_vec()
        }
        _ => combined(&[(1.0 - u, value(k)), (u, value(next))]),
    };
    Ok(Ok((n, path.to_owned(), value)))
}
