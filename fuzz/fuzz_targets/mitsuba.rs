//! Fuzz target: a Mitsuba scene in XML.

#![no_main]

lumbre_fuzz::target!(|bytes| lumbre_fuzz::scene("mitsuba, more", "a.xml", bytes));
