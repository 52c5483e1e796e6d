//! Fuzz target: a binary glTF.

#![no_main]

lumbre_fuzz::target!(|bytes| lumbre_fuzz::scene("glb", "a.glb", bytes));
