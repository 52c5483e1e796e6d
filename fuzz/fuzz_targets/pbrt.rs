//! Fuzz target: a scene of pbrt.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lumbre_fuzz::scene("pbrt", "a.pbrt", bytes));
