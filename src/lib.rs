//! Lumbre: a terminal-driven, Lua-scripted experiment runner for light transport.
//!
//! Data flows one way through the modules below. A script becomes an [`experiment::ExperimentSpec`]
//! and the spec becomes an [`experiment::Plan`] of cells. Each cell becomes a compiled scene, a
//! renderer, a film, metric rows, and finally result files on disk. A module imports only modules
//! of a lower level; `tests/laws/imports.rs` checks the code against this table.
//!
//! | level | modules | what they contain |
//! |---|---|---|
//! | 0 | [`value`], [`math`], [`film`] | values, schemas; mathematics, statistics; pixel sums |
//! | 1 | [`scene`], [`metrics`] | scene descriptions, compiled scenes; image errors |
//! | 2 | [`transport`] | light transport: camera, BSDF, lights, samplers, integrators |
//! | 3 | [`render`] | backends that run integrators over waves of samples |
//! | 4 | [`experiment`] | sweeps, plans, stop rules, the state machine of a night |
//! | 5 | [`script`], [`store`], [`output`], [`tui`] | Lua; result folders; files; screens |
//! | 6 | [`cli`] | the command line, which connects the modules of level 5 |
//!
//! A *night* is a scheduled run of an experiment, usually unattended. The modules of level 5 never
//! import one another.

pub mod cli;
pub mod experiment;
pub mod film;
pub mod math;
pub mod metrics;
pub mod output;
pub mod render;
pub mod scene;
pub mod script;
pub mod store;
pub mod transport;
pub mod tui;
pub mod value;
