//! Fuzz target: an OBJ mesh.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lumbre_fuzz::scene("obj", "a.obj", bytes));
