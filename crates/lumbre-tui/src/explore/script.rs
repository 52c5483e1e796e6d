//! The settings of a picture as an experiment in Lua.

use super::settings::{SceneFile, Settings};
use lumbre_light::value::Value;
use lumbre_lua::literal;

/// Returns a script with one run: the picture with these settings, of this resolution and number of
/// samples per pixel. Its bits are those of the session's picture. `file` is the name under which
/// the script is saved, for the comment at its top.
pub fn script_text(
    settings: &Settings,
    scene: &SceneFile,
    resolution: [u32; 2],
    samples: u64,
    file: &str,
) -> String {
    let mut table = settings.request_table(scene, resolution);
    let mut lines = String::new();
    for first in ["scene", "scene_options", "integrator"] {
        if let Some(value) = table.remove(first) {
            lines += &line(first, &value);
        }
    }
    for (key, value) in &table {
        lines += &line(key, value);
    }
    format!(
        "-- {file}: written by `lumbre explore`.
--
--     lumbre plan {file}         list what it renders
--     lumbre run {file}          render it: the same bits as on the screen
--     lumbre report out/latest   figures, tables and a page
--
-- Turn values into axes to compare them: x:axis(\"technique\", {{ \"nee\", \"bdpt\" }}) and
-- `integrator = p.technique`. docs/reference/script.md lists what a script can say.

local x = experiment({name}, {{ seed = {seed} }})

x:render(function(p)
  return {{
{lines}  }}
end)

x:measure {{ display = {display} }}

x:stop(stop.samples({samples}))

return x
",
        name = literal(&Value::Str(experiment_name(&scene.name))),
        seed = settings.seed(),
        display = tonemap(settings),
    )
}

fn line(key: &str, value: &Value) -> String {
    format!("    {key} = {},\n", literal(value))
}

/// Returns the tone map as a call.
fn tonemap(settings: &Settings) -> String {
    let value = settings.tonemap().to_value();
    let mut fields = value.as_map().cloned().unwrap_or_default();
    fields.remove("kind");
    let name = settings.tonemap().name();
    format!("tonemap.{name} {}", literal(&Value::Map(fields)))
}

/// Returns the name of the experiment of a scene: the file name without extension, of letters,
/// digits, `_` and `-`.
pub fn experiment_name(scene: &str) -> String {
    let file = scene.rsplit(['/', '\\']).next().unwrap_or(scene);
    let stem = file.split('.').next().unwrap_or(file);
    let allowed = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    let name: String = stem
        .chars()
        .map(|c| if allowed(c) { c } else { '_' })
        .collect();
    if name.is_empty() {
        "scene".to_owned()
    } else {
        name
    }
}
