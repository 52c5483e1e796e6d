//! Fuzz target: a scene in Lua.

#![no_main]

lumbre_fuzz::target!(|bytes| lumbre_fuzz::scene("lua", "a.lua", bytes));
