//! Fuzz target: a texture, as TGA or in the format of its first bytes.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lumbre_fuzz::texture(bytes));
