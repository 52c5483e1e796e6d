//! Fuzz target: a scene of pbrt.

#![no_main]

lumbre_fuzz::target!(|bytes| lumbre_fuzz::scene("pbrt", "a.pbrt", bytes));
