//! `require`: Lua modules below the script's own folder, and nowhere else.

use std::path::PathBuf;
use std::rc::Rc;

use mlua::chunk::ChunkMode;
use mlua::{Lua, Value as LuaValue};

use super::api::{Args, Param};
use super::error::ScriptError;
use super::source;
use super::state::Shared;

/// The parameters of `require`, for the editor annotations.
pub const PARAMS: &[Param] = &[Param {
    name: "name",
    ty: "string",
    doc: "The module: `lib.boxes` or `lib/boxes` is the file `lib/boxes.lua` beside the script.",
}];

/// Key of the table of loaded modules in Lua's registry.
const LOADED: &str = "lumbre.modules";

/// Most modules of one script.
const MAX_MODULES: usize = 256;

/// Loads a module once and returns what it returned, or `true` if that was nothing.
///
/// # Errors
/// A name that leads out of the folder, a missing file, a cycle, or the module's own error.
pub fn require(shared: &Rc<Shared>, lua: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    args.at_most(shared, 1)?;
    let name = args.text(shared, 0, "name")?;
    let steps: Vec<&str> = name.split(['.', '/']).collect();
    let legal = |step: &&str| !step.is_empty() && step.chars().all(|c| c.is_alphanumeric() || c == '_' || c == '-');
    if !steps.iter().all(legal) {
        let help = "modules lie below the script's own folder: `lib.boxes` is lib/boxes.lua".to_owned();
        return Err(args.error(shared, format!("`{name}` is no name of a module"), Some(help)));
    }
    let key = steps.join("/");
    let loaded = loaded_table(lua).map_err(|e| shared.convert(&e))?;
    let known: LuaValue = loaded.raw_get(key.as_str()).map_err(|e| shared.convert(&e))?;
    if !known.is_nil() {
        return Ok(known);
    }
    if !shared.loading.get() {
        let help = "require it at the top of the script".to_owned();
        return Err(args.error(
            shared,
            format!("`{name}` can no longer be loaded: the plan is being made"),
            Some(help),
        ));
    }
    if shared.requiring.borrow().contains(&key) {
        let mut chain = shared.requiring.borrow().clone();
        chain.push(key);
        return Err(args.error(
            shared,
            format!("modules require each other in a circle: {}", chain.join(" -> ")),
            None,
        ));
    }
    if shared.sources.borrow().count() > MAX_MODULES {
        return Err(args.error(shared, format!("more than {MAX_MODULES} modules"), None));
    }
    let file = find(shared, args, &key)?;
    let text = source::read(&file)?;
    let index = shared.sources.borrow_mut().add(&format!("{key}.lua"), &file, text.clone());
    let chunk = format!("@{}", shared.sources.borrow().get(index).chunk);
    shared.requiring.borrow_mut().push(key.clone());
    let result = lua.load(text).set_name(chunk).set_mode(ChunkMode::Text).call::<LuaValue>(());
    shared.requiring.borrow_mut().pop();
    let value = match result.map_err(|e| shared.convert(&e))? {
        LuaValue::Nil => LuaValue::Boolean(true),
        value => value,
    };
    loaded.raw_set(key, value.clone()).map_err(|e| shared.convert(&e))?;
    Ok(value)
}

fn loaded_table(lua: &Lua) -> mlua::Result<mlua::Table> {
    match lua.named_registry_value::<LuaValue>(LOADED)? {
        LuaValue::Table(t) => Ok(t),
        _ => {
            let table = lua.create_table()?;
            lua.set_named_registry_value(LOADED, &table)?;
            Ok(table)
        }
    }
}

/// The module's file, which must lie below the folder even when links are followed.
fn find(shared: &Shared, args: &Args, key: &str) -> Result<PathBuf, ScriptError> {
    let file = shared.folder.join(format!("{key}.lua"));
    let real = |path: &PathBuf| path.canonicalize();
    match (real(&file), real(&shared.folder)) {
        (Ok(found), Ok(folder)) if found.starts_with(&folder) => Ok(file),
        (Ok(_), Ok(_)) => {
            let help = "modules lie below the script's own folder".to_owned();
            Err(args.error(shared, format!("{} leads out of the script's folder", file.display()), Some(help)))
        }
        _ => Err(args.error(shared, format!("there is no file {}", file.display()), None)),
    }
}
