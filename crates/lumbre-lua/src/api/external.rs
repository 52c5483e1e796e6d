//! `external`: another renderer as a technique.

use std::collections::BTreeMap;

use mlua::Value as LuaValue;

use super::render_schema::RENDER;
use super::{ApiFn, Args, functions};
use crate::error::ScriptError;
use crate::state::{Purpose, Shared};
use lumbre_light::transport::integrator::external::PREFIX;
use lumbre_light::value::Value;
use lumbre_light::value::schema::SchemaError;
use lumbre_render::external::Technique;
use lumbre_render::external::technique::{
    EXTERNAL, FOLDER, SCENE_FILE, VALUES, raw_scene, split_commands,
};
use lumbre_render::settings::find::find_file;

functions! {
    /// Constructor of techniques of other programs.
    pub const GLOBALS;
    "external" -> "string" = external,
        "Declares another renderer as a technique and returns its name, a value for `integrator`. \
         Runs nothing: commands run only with permission, when the night renders." {
        "options": "External",
            "Command of the program, and where its scene and its times come from.";
    }
}

fn external(args: &Args) -> Result<LuaValue, ScriptError> {
    if !args.shared.loading.get() || !matches!(args.shared.purpose, Purpose::Experiment) {
        let problem = "called outside the loading of an experiment";
        let help = "declare the technique at the top of the script, and use its name in functions";
        return Err(args.error(problem, Some(help.to_owned())));
    }
    let options = args.fields(0, "options", &EXTERNAL, "external")?.values;
    let (name, params) = parameters(options, &args.shared).map_err(|e| args.locate_error(e))?;
    Technique::declared(&name, &params).map_err(|problem| args.error(problem, None))?;
    let mut builder = args.shared.builder.borrow_mut();
    match builder.externals.get(&name) {
        Some(known) if *known != params => {
            let problem = format!("`{name}` is declared twice, with different options");
            let help = "give each its own name, or use `params` for what differs".to_owned();
            return Err(args.error(problem, Some(help)));
        }
        _ => builder.externals.insert(name.clone(), params),
    };
    let name = args
        .lua
        .create_string(&name)
        .map_err(|e| args.shared.convert(&e))?;
    Ok(LuaValue::String(name))
}

/// Returns the name of the integrator, and the parameters of its runs.
fn parameters(
    mut params: BTreeMap<String, Value>,
    shared: &Shared,
) -> Result<(String, BTreeMap<String, Value>), SchemaError> {
    let fail =
        |key: &str, problem: String| SchemaError::new(format!("external.{key}"), key, problem);
    let name = match params.remove("name") {
        Some(Value::Str(name)) => format!("{PREFIX}{name}"),
        _ => PREFIX.to_owned(),
    };
    split_commands(&mut params).map_err(|problem| fail("command", problem))?;
    if let Some(values) = params.remove("params") {
        let is_key = |name: &&String| RENDER.fields.iter().any(|field| field.key == **name);
        let keys = values.as_map().into_iter().flat_map(BTreeMap::keys);
        if let Some(name) = keys.into_iter().find(is_key) {
            let problem = format!("`{name}` is a key of the render table: choose another name");
            return Err(fail("params", problem));
        }
        let values = match values {
            Value::List(items) if items.is_empty() => Value::Map(BTreeMap::new()),
            values => values,
        };
        params.insert(VALUES.to_owned(), values);
    }
    if let Some(file) = params
        .get("scene")
        .and_then(Value::as_str)
        .and_then(raw_scene)
    {
        let found = find_file(file, &shared.folder, "external.scene", "scene")?;
        let found = std::path::absolute(found).map_err(|e| fail("scene", e.to_string()))?;
        params.insert(
            SCENE_FILE.to_owned(),
            found.to_string_lossy().as_ref().into(),
        );
    }
    let folder = std::path::absolute(&shared.folder).map_err(|e| fail("name", e.to_string()))?;
    params.insert(FOLDER.to_owned(), folder.to_string_lossy().as_ref().into());
    Ok((name, params))
}
