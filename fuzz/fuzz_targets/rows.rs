//! Fuzz target: the measurements of a run, `metrics.csv`.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lumbre_fuzz::rows(bytes));
