//! Lumbre: a terminal-driven, Lua-scripted experiment runner for light transport.
//!
//! Data flows one way through the modules below. A script becomes an [`experiment::ExperimentSpec`]
//! and the spec becomes an [`experiment::Plan`] of cells. Each cell becomes a compiled scene, a
//! renderer, a film, metric rows, and finally result files on disk. A module imports only modules
//! of a lower level; `tests/library/laws/imports.rs` checks the code against this table.
//!
//! | level | modules | what they contain |
//! |---|---|---|
//! | 0 | [`backends`], [`columns`], [`paths`], [`text`] | the table of backends of this program; columns of CSV files; folders of files; counts, lines, CSV |
//! | 1 | [`experiment`] | sweeps, plans, stop rules, the state machine of a night |
//! | 2 | [`script`], [`store`], [`output`], [`tui`] | Lua; result folders; files; screens |
//! | 3 | [`explore`] | the interactive program: a picture that renders while its settings change |
//! | 4 | [`cli`] | the command line, which connects the other modules |
//!
//! Light transport itself is in the crates `lumbre-light` (scenes, materials, lights, samplers,
//! integrators), `lumbre-render` (the CPU backend, worker processes) and `lumbre-vulkan`, and the
//! errors between images in `lumbre-metrics`.
//!
//! A program of one's own with further techniques is [`main_with`] and an [`OwnTechnique`] for each.
//!
//! A *night* is a scheduled run of an experiment, usually unattended. The modules of level 2 never
//! import one another.

pub mod backends;
pub mod cli;
pub mod columns;
pub mod experiment;
pub mod explore;
pub mod output;
pub mod paths;
pub mod script;
pub mod store;
pub mod text;
pub mod tui;

pub use cli::main_with;
pub use lumbre_render::own_technique::OwnTechnique;
pub use lumbre_render::trial::Trial;
