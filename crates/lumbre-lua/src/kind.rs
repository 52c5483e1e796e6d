//! Kinds of Lua values, for messages.

use mlua::Value as LuaValue;

/// Metafield with the kind of a Lua object, such as `a stop rule`.
pub const KIND: &str = "__kind";

/// Returns the kind of a Lua value: `nothing`, `a string`, or what the object states as [`KIND`].
pub fn kind(value: &LuaValue) -> String {
    let name = match value {
        LuaValue::Nil => "nothing",
        LuaValue::Boolean(_) => "a boolean",
        LuaValue::Integer(_) => "an integer",
        LuaValue::Number(_) => "a number",
        LuaValue::String(_) => "a string",
        LuaValue::Table(_) => "a table",
        LuaValue::Function(_) => "a function",
        LuaValue::UserData(object) => {
            let stated = object.metatable().and_then(|meta| meta.get(KIND));
            return stated.unwrap_or_else(|_| "a Lua object".to_owned());
        }
        _ => "a Lua object",
    };
    name.to_owned()
}
