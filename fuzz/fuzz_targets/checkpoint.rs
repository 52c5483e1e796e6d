//! Fuzz target: the state of a renderer in a checkpoint.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lumbre_fuzz::checkpoint(bytes));
