//! Fuzz target: an OBJ mesh.

#![no_main]

lumbre_fuzz::target!(|bytes| lumbre_fuzz::scene("obj", "a.obj", bytes));
