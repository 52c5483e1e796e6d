//! Fuzz target: a PLY mesh.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lumbre_fuzz::scene("ply", "a.ply", bytes));
