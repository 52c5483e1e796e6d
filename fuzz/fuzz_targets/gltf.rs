//! Fuzz target: the JSON of a glTF.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lumbre_fuzz::scene("gltf", "a.gltf", bytes));
