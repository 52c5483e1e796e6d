//! Lumbre: a terminal-driven, Lua-scripted experiment runner for light transport.
//!
//! Data flows one way through the rooms below: a script becomes a [`experiment::Spec`], the spec a
//! [`experiment::Plan`] of cells, each cell a compiled scene, a renderer, a film, metric rows, and at last
//! evidence on disk. A room imports only rooms of a lower level; a law test holds this table against the code.
//!
//! | level | rooms | what they own |
//! |---|---|---|
//! | 0 | [`value`], [`math`], [`film`] | plain data and schemas; frames, warps, random numbers, statistics; pixel sums |
//! | 1 | [`scene`], [`metrics`] | what a scene says and its compiled form; errors between two images |
//! | 2 | [`transport`] | how light moves: camera, BSDF, lights, samplers, integrators |
//! | 3 | [`render`] | backends that run integrators over waves of samples |
//! | 4 | [`experiment`] | sweeps, plans, stop rules, the state machine of a night |
//! | 5 | [`script`], [`store`], [`output`], [`tui`] | Lua in; folders, files and screens out; they never import one another |
//! | 6 | [`cli`] | the command line, which joins the rooms of level 5 |

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
