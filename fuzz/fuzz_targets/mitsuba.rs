//! Fuzz target: a Mitsuba scene in XML.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lumbre_fuzz::scene("mitsuba, more", "a.xml", bytes));
