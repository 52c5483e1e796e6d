//! Fuzz target: a binary glTF.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lumbre_fuzz::scene("glb", "a.glb", bytes));
