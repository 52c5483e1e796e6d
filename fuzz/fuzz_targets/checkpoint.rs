//! The state of a renderer, as checkpoints hold it.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lumbre_fuzz::checkpoint(bytes));
