//! Fuzz target: a texture in TGA, or in the format that its first bytes name.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lumbre_fuzz::texture(bytes));
