//! Fuzz target: a mesh of Mitsuba's compressed files, as its stream expands.

#![no_main]

lumbre_fuzz::target!(|bytes| lumbre_fuzz::serialized(bytes));
