//! Figures and tables of hand-made nights.

mod figures;
mod tables;
