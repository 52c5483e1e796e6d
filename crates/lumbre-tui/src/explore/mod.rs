//! The interactive program of `lumbre explore`: a picture of a scene that renders in the terminal
//! while its settings change.
//!
//! Data flows one way. [`input`] turns keys and the mouse into changes of the [`state`] and into
//! commands. The state holds the [`settings`], which are a render table as scripts write it; the
//! rows of the panel are made from the schemas of that table ([`parameters`]), so a new parameter
//! of a technique appears here without further code. A thread ([`session`]) renders what the
//! settings request and publishes the mean of its film. [`view`] draws a frame from the state and
//! from what was published, and [`script`] writes the settings as an experiment. [`explorer`]
//! connects the parts, and [`terminal`] runs them on a terminal.
//!
//! Two settings can be rendered in turn ([`comparison`]), and a picture can be kept as [`mod@reference`]
//! of the following ones. Another thread ([`measure`]) computes the metrics of both. A pixel can be
//! inspected ([`inspect`]), with the [`Lobe`](lumbre_render::lobe::Lobe) of its material.

pub mod camera;
pub mod comparison;
pub mod explorer;
pub mod input;
pub mod inspect;
pub mod latest;
pub mod measure;
pub mod parameters;
pub mod picker;
pub mod reference;
pub mod script;
pub mod session;
pub mod settings;
pub mod state;
pub mod terminal;
pub mod view;

#[cfg(test)]
mod tests;
