//! Fuzz target: a scene in Lua.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lumbre_fuzz::scene("lua", "a.lua", bytes));
