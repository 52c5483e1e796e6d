//! Fuzz target: the JSON of a glTF.

#![no_main]

lumbre_fuzz::target!(|bytes| lumbre_fuzz::scene("gltf", "a.gltf", bytes));
