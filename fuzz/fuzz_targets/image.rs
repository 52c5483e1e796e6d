//! A texture: TGA, or what its first bytes say.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lumbre_fuzz::texture(bytes));
