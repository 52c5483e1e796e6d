//! Fuzz target: a `.scn` scene.

#![no_main]

lumbre_fuzz::target!(|bytes| lumbre_fuzz::scene("scn", "a.scn", bytes));
