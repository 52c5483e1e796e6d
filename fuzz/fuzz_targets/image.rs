//! Fuzz target: a texture in TGA, or in the format that its first bytes name.

#![no_main]

lumbre_fuzz::target!(|bytes| lumbre_fuzz::texture(bytes));
