//! Fuzz target: the JSON of a scene folder.

#![no_main]

lumbre_fuzz::target!(|bytes| lumbre_fuzz::scene("folder", "scene.json", bytes));
