//! The text of a script that compares techniques on one scene.

use std::collections::BTreeMap;

use super::settings::{checked_settings, picture_table};
use crate::cli::args::ComparisonArgs;
use crate::cli::exit::Failure;
use crate::cli::format::rounded;
use crate::cli::scene::builtin::scene_name;
use lumbre_light::transport::integrator::{UNBIASED_REFERENCE, bias_of, integrator};
use lumbre_light::value::Value;
use lumbre_lua::literal;

/// Render time of the reference over that of one run.
const REFERENCE_FACTOR: f64 = 8.0;

/// Number of measurements of a run, about.
const MEASUREMENTS: f64 = 20.0;

/// Least time between two measurements that scripts accept, in seconds.
const MIN_EVERY_S: f64 = 0.01;

/// Beginning of the names of other programs.
const EXTERNAL: &str = "external:";

/// A part of a render table.
type Settings = BTreeMap<String, Value>;

/// Returns the name of the experiment that compares techniques on a scene: letters, digits, `_` and
/// `-`.
pub fn experiment_name(comparison: &ComparisonArgs) -> String {
    let is_allowed = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    scene_name(&comparison.picture.scene.file)
        .chars()
        .map(|c| if is_allowed(c) { c } else { '_' })
        .collect()
}

/// Returns the technique of the reference: the one that is named for it, otherwise the last
/// unbiased one of those that are compared, or else an unbiased one beside them. The bias of other
/// programs is not known.
pub fn reference_technique(comparison: &ComparisonArgs) -> &str {
    let names = || comparison.techniques.iter().map(String::as_str);
    let is_unbiased = |name: &&str| bias_of(name).is_none() && !name.starts_with(EXTERNAL);
    let unbiased = names().rfind(is_unbiased);
    let named = comparison.reference.as_deref();
    named.or(unbiased).unwrap_or(UNBIASED_REFERENCE)
}

/// Returns the script. `file` is the name under which it is saved, for the comment at its top.
///
/// # Errors
/// Returns an error if fewer than two techniques, one twice, or a setting twice is given, or a setting
/// is invalid.
pub fn script_text(comparison: &ComparisonArgs, file: &str) -> Result<String, Failure> {
    let mut table = picture_table(&comparison.picture)?;
    check_techniques(&comparison.techniques, &table)?;
    let own = own_settings(&mut table, comparison);
    let of = |technique: &str| own.get(technique).cloned().unwrap_or_default();
    for technique in &comparison.techniques {
        let table = table.clone().into_iter().chain(of(technique));
        checked_settings(table.collect(), technique)?;
    }
    let reference = reference_technique(comparison);
    let mut of_reference = of(reference);
    of_reference.insert("integrator".to_owned(), reference.into());
    let names: Vec<Value> = comparison
        .techniques
        .iter()
        .map(|name| name.as_str().into())
        .collect();
    Ok(format!(
        "-- {file}: which technique has less error at equal render time?
--
--     lumbre run {file}          render, measure, print the table
--     lumbre report out/latest   figures, tables with significance, and a page

-- Techniques take turns, so that a machine that slows down slows all of them.
local x = experiment({name}, {{ seed = 1, repeats = {repeats} }})

x:axis(\"technique\", {techniques})

x:render(function(p)
{render}end)

-- One reference for all techniques, {factor} times as long as a run. Its own noise is measured, and
-- subtracted in the columns *_net.
x:reference {{
  from = function() return {reference} end,
  stop = stop.time({reference_time}),
}}

-- relmse is the squared error over the squared brightness of the pixel; flip is the difference that
-- an eye sees between the pictures through the tone map.
local display = tonemap.srgb {{ exposure = 0 }}
x:measure {{
  every = {every},
  relmse = metric.relmse(),
  flip = metric.flip {{ on = display }},
  display = display,
  keep = {{ exr = \"pow2\" }},
}}

x:stop(stop.time({time}))

x:figure(\"convergence\", {{ x = \"render_s\", y = {{ \"relmse\", \"flip\" }}, by = \"technique\" }})
x:table(\"relmse\", {{ value = \"relmse\", rows = \"technique\" }})
x:table(\"samples\", {{ value = \"samples\", rows = \"technique\" }})

return x
",
        name = literal(&Value::Str(experiment_name(comparison))),
        repeats = comparison.repeats,
        techniques = literal(&Value::List(names)),
        render = render_lines(table, &own),
        factor = rounded(REFERENCE_FACTOR),
        reference = literal(&Value::Map(of_reference)),
        reference_time = literal(&duration_text(REFERENCE_FACTOR * comparison.time)),
        every = literal(&duration_text((comparison.time / MEASUREMENTS).max(MIN_EVERY_S))),
        time = literal(&duration_text(comparison.time)),
    ))
}

/// Checks the techniques of a comparison; `table` are the other settings.
fn check_techniques(techniques: &[String], table: &Settings) -> Result<(), Failure> {
    if techniques.len() < 2 {
        return Err(Failure::usage(
            "two techniques or more are compared, as in --technique nee,bdpt",
        ));
    }
    if table.contains_key("integrator") {
        return Err(Failure::usage(
            "`integrator` is what is compared: give techniques by --technique, as in --technique \
             nee,bdpt",
        ));
    }
    let twice = (1..techniques.len()).find(|i| techniques[..*i].contains(&techniques[*i]));
    match twice {
        Some(i) => Err(Failure::usage(format!(
            "--technique names `{}` twice: give each technique once; --repeats repeats all of them",
            techniques[i]
        ))),
        None => Ok(()),
    }
}

/// Returns a duration in seconds as scripts write it.
fn duration_text(seconds: f64) -> Value {
    Value::Str(format!("{seconds}s"))
}

/// Takes the settings out of a table that are parameters of some of the techniques and not of all, and
/// returns them by technique.
fn own_settings(table: &mut Settings, comparison: &ComparisonArgs) -> BTreeMap<String, Settings> {
    let techniques = || comparison.techniques.iter().chain(&comparison.reference);
    let has = |technique: &str, key: &str| {
        let fields = integrator(technique).map_or(&[][..], |row| row.params.fields);
        fields.iter().any(|field| field.key == key)
    };
    let mut own: BTreeMap<String, Settings> = BTreeMap::new();
    table.retain(|key, value| {
        let (owners, others): (Vec<_>, Vec<_>) = techniques().partition(|name| has(name, key));
        let is_shared = owners.is_empty() || others.is_empty();
        for technique in owners.into_iter().filter(|_| !is_shared) {
            let settings = own.entry(technique.clone()).or_default();
            settings.insert(key.clone(), value.clone());
        }
        is_shared
    });
    own
}

/// Returns the lines of the function that renders: a table with the technique after the scene, and
/// what only some techniques have.
fn render_lines(mut table: Settings, own: &BTreeMap<String, Settings>) -> String {
    let scene = table.remove("scene").unwrap_or(Value::Nil);
    let mut fields = format!("    scene = {},\n", literal(&scene));
    fields += "    integrator = p.technique,\n";
    for (key, value) in table {
        fields += &format!("    {key} = {},\n", literal(&value));
    }
    if own.is_empty() {
        return format!("  return {{\n{fields}  }}\n");
    }
    let mut lines = format!("  local settings = {{\n{fields}  }}\n");
    for (technique, settings) in own {
        let technique = literal(&technique.as_str().into());
        lines += &format!("  if p.technique == {technique} then\n");
        for (key, value) in settings {
            lines += &format!("    settings.{key} = {}\n", literal(value));
        }
        lines += "  end\n";
    }
    lines + "  return settings\n"
}
