//! Fuzz target: a PLY mesh.

#![no_main]

lumbre_fuzz::target!(|bytes| lumbre_fuzz::scene("ply", "a.ply", bytes));
