//! Lumbre: a terminal-driven, Lua-scripted experiment runner for light transport.
//!
//! This crate is the command line ([`cli`]), which connects the others. Data flows one way through
//! them, and a crate depends only on those above it:
//!
//! | crate | what it contains |
//! |---|---|
//! | `lumbre-light` | scenes, materials, lights, samplers, integrators |
//! | `lumbre-scene-io` | readers and writers of scene files |
//! | `lumbre-metrics` | errors between images |
//! | `lumbre-render` | jobs and renderers: the CPU backend, worker processes, other programs |
//! | `lumbre-vulkan` | the Vulkan backends |
//! | `lumbre-night` | sweeps, plans, stop rules, nights, and their files |
//! | `lumbre-lua` | scripts of experiments and scenes |
//! | `lumbre-report` | pictures, figures, tables and pages, as bytes |
//! | `lumbre-tui` | the dashboard and the interactive program |
//!
//! A program of one's own with further techniques is [`main_with`] and an [`OwnTechnique`] for each.

pub mod cli;

pub use cli::main_with;
pub use lumbre_render::own_technique::OwnTechnique;
pub use lumbre_render::trial::Trial;
