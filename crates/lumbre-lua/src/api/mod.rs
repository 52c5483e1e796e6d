//! Functions that scripts call. Each is one [`ApiFn`], a table row with name, parameters,
//! documentation and the Rust function that implements it. The editor annotations and the reference
//! page are generated from the same rows.

pub mod axis;
pub mod builder;
mod call;
pub mod experiment;
pub mod external;
pub mod measure;
pub mod night;
pub mod notify;
pub mod presentation;
pub mod reference;
pub mod render;
pub mod render_schema;
pub mod report;
mod report_checks;
pub mod rule;
pub mod stop;
pub mod stop_rule;

use std::rc::Rc;

use mlua::{Lua, Value as LuaValue};

pub(crate) use call::functions;
pub use call::{ApiFn, Args, Param, method_object};

use super::state::{Shared, make_strict};
use super::{require, scene};
use call::bind;

/// Tables of functions, in the order of the annotations.
pub const FUNCTIONS: &[&[ApiFn]] = &[
    experiment::GLOBALS,
    axis::GLOBALS,
    external::GLOBALS,
    report::GLOBALS,
    stop::RULES,
    GLOBALS,
];

functions! {
    /// Functions that belong to no other file.
    const GLOBALS;
    "require" -> "any" = require::require,
        "Loads a module from below the script's own folder and returns its value. A module runs \
         only once." {
        "name": "string",
            "Name of the module: `lib.boxes` or `lib/boxes` is the file `lib/boxes.lua` beside the \
             script.";
    }
}

/// Globals of standard Lua that do not exist in scripts, with the reason.
const REMOVED_GLOBALS: &[(&str, &str)] = &[
    (
        "os",
        "scripts run in a sandbox without `os`: a plan must not depend on the clock or the machine",
    ),
    (
        "io",
        "scripts run in a sandbox without files: declare outputs with `x:measure`, `x:figure` and \
         `x:table`",
    ),
    ("debug", "scripts run in a sandbox without `debug`"),
    (
        "package",
        "scripts run in a sandbox: `require` loads modules from below the script's own folder",
    ),
    (
        "load",
        "scripts run in a sandbox: `require` is the only way to load code",
    ),
    (
        "loadfile",
        "scripts run in a sandbox: `require` is the only way to load code",
    ),
    (
        "dofile",
        "scripts run in a sandbox: `require` is the only way to load code",
    ),
    ("coroutine", "scripts run in a sandbox without coroutines"),
    (
        "collectgarbage",
        "scripts run in a sandbox without `collectgarbage`",
    ),
];

/// Functions of `math` that do not exist in scripts, with the reason.
const REMOVED_MATH_FUNCTIONS: &[(&str, &str)] = &[
    (
        "random",
        "a plan must be the same every time: use the experiment's seed and `repeats`",
    ),
    (
        "randomseed",
        "a plan must be the same every time: use the experiment's seed and `repeats`",
    ),
];

/// Adds all functions to the globals of a state, and makes reading an undefined name an error.
///
/// # Errors
/// Returns an error if the memory limit is exceeded.
pub fn register(lua: &Lua, shared: &Rc<Shared>) -> mlua::Result<()> {
    let globals = lua.globals();
    for row in FUNCTIONS.iter().chain(scene::FUNCTIONS).copied().flatten() {
        let function = bind(lua, shared, row)?;
        match row.name.split_once('.') {
            None => globals.raw_set(row.name, function)?,
            Some((space, name)) => {
                let table = match globals.raw_get::<LuaValue>(space)? {
                    LuaValue::Table(t) => t,
                    _ => lua.create_table()?,
                };
                table.raw_set(name, function)?;
                globals.raw_set(space, table)?;
            }
        }
    }
    measure::register(lua, shared)?;
    for (space, removed) in [
        ("stop", &[] as &[_]),
        ("metric", &[]),
        ("tonemap", &[]),
        ("shape", &[]),
        ("texture", &[]),
        ("math", REMOVED_MATH_FUNCTIONS),
        ("string", &[]),
        ("table", &[]),
        ("utf8", &[]),
    ] {
        make_strict(lua, shared, &globals.raw_get(space)?, space, removed)?;
    }
    make_strict(lua, shared, &globals, "", REMOVED_GLOBALS)
}
