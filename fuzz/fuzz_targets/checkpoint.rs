//! Fuzz target: the state of a renderer in a checkpoint.

#![no_main]

lumbre_fuzz::target!(|bytes| lumbre_fuzz::checkpoint(bytes));
