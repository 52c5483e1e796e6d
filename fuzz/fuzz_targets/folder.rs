//! Fuzz target: the JSON of a scene folder.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lumbre_fuzz::scene("folder", "scene.json", bytes));
