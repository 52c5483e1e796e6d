//! Fuzz target: the measurements of a run, `metrics.csv`.

#![no_main]

lumbre_fuzz::target!(|bytes| lumbre_fuzz::rows(bytes));
