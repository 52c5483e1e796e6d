//! Fuzz target: a `.scn` scene.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lumbre_fuzz::scene("scn", "a.scn", bytes));
