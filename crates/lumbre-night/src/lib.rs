//! Experiments and nights: what a script asks for, how it is carried out, and its files.
//!
//! An [`ExperimentSpec`](experiment::ExperimentSpec) is expanded to a [`Plan`](experiment::Plan) of
//! cells, a night renders the plan ([`experiment::run`]), and [`store`] writes and reads what it
//! leaves. A [`Night`](experiment::Night) is the state of all runs, folded from events or read from
//! files. A *night* is a scheduled run of an experiment, usually unattended.
//!
//! [`backends`] is the table of backends of this program; [`columns`] are those of CSV files, and
//! [`paths`] and [`text`] are shared by files and messages.

pub mod backends;
pub mod columns;
pub mod experiment;
pub mod paths;
pub mod store;
pub mod text;
