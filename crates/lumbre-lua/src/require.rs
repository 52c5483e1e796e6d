//! `require` for scripts: loads Lua modules from below the script's own folder only.

use std::path::PathBuf;

use mlua::chunk::ChunkMode;
use mlua::{Lua, Value as LuaValue};

use super::api::Args;
use super::error::ScriptError;
use super::source;

/// Key of the table of loaded modules in the Lua registry.
const LOADED: &str = "lumbre.modules";

/// Largest number of modules of one script.
const MAX_MODULES: usize = 256;

/// Loads a module once and returns its value, or `true` if the module returned nothing.
///
/// # Errors
/// Returns an error for an invalid name, a path outside the script's folder, a missing file, a
/// cycle, a call after loading, or an error in the module.
pub fn require(args: &Args) -> Result<LuaValue, ScriptError> {
    let name = args.text(0, "name")?;
    let steps: Vec<&str> = name.split(['.', '/']).collect();
    let legal = |step: &&str| {
        !step.is_empty()
            && step
                .chars()
                .all(|c| c.is_alphanumeric() || c == '_' || c == '-')
    };
    if !steps.iter().all(legal) {
        let help = "modules must be below the script's own folder: `lib.boxes` is \
             lib/boxes.lua"
            .to_owned();
        return Err(args.error(format!("`{name}` is not a valid module name"), Some(help)));
    }
    let key = steps.join("/");
    let loaded = loaded_table(&args.lua).map_err(|e| args.shared.convert(&e))?;
    let known: LuaValue = loaded
        .raw_get(key.as_str())
        .map_err(|e| args.shared.convert(&e))?;
    if !known.is_nil() {
        return Ok(known);
    }
    if !args.shared.loading.get() {
        let help = "call require at the top of the script".to_owned();
        return Err(args.error(
            format!("`{name}` cannot be loaded after the script has ended"),
            Some(help),
        ));
    }
    if args.shared.requiring.borrow().contains(&key) {
        let mut chain = args.shared.requiring.borrow().clone();
        chain.push(key);
        return Err(args.error(
            format!(
                "modules require each other in a circle: {}",
                chain.join(" -> ")
            ),
            None,
        ));
    }
    if args.shared.sources.borrow().count() > MAX_MODULES {
        return Err(args.error(
            format!("the script requires more than {MAX_MODULES} modules"),
            None,
        ));
    }
    let value = run_module(args, &key)?;
    loaded
        .raw_set(key, value.clone())
        .map_err(|e| args.shared.convert(&e))?;
    Ok(value)
}

/// Runs the module `key` and returns its value, or `true` if it returned nothing.
fn run_module(args: &Args, key: &str) -> Result<LuaValue, ScriptError> {
    let file = find(args, key)?;
    let text = source::read(&file)?;
    let index = args
        .shared
        .sources
        .borrow_mut()
        .add(&format!("{key}.lua"), &file, text.clone());
    let chunk = format!("@{}", args.shared.sources.borrow().get(index).chunk);
    args.shared.requiring.borrow_mut().push(key.to_owned());
    let result = args
        .lua
        .load(text)
        .set_name(chunk)
        .set_mode(ChunkMode::Text)
        .call::<LuaValue>(());
    args.shared.requiring.borrow_mut().pop();
    Ok(match result.map_err(|e| args.shared.convert(&e))? {
        LuaValue::Nil => LuaValue::Boolean(true),
        value => value,
    })
}

/// Returns the table of loaded modules, which is created on first use.
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

/// Returns the module's file. It must be below the script's folder even after symbolic links are
/// resolved.
fn find(args: &Args, key: &str) -> Result<PathBuf, ScriptError> {
    let file = args.shared.folder.join(format!("{key}.lua"));
    let real = |path: &PathBuf| path.canonicalize();
    match (real(&file), real(&args.shared.folder)) {
        (Ok(found), Ok(folder)) if found.starts_with(&folder) => Ok(file),
        (Ok(_), Ok(_)) => {
            let help = "modules must be below the script's own folder".to_owned();
            Err(args.error(
                format!("{} is outside the script's folder", file.display()),
                Some(help),
            ))
        }
        _ => Err(args.error(format!("there is no file {}", file.display()), None)),
    }
}
