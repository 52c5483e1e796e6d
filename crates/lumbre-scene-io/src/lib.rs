//! Scene files: loaders ([`load`]), export for other renderers ([`export`]), edits of single
//! values of a scene ([`edit`]), and percent-encoding in addresses ([`uri`]).
//!
//! Paths inside a scene file are relative to the file that contains them. A part of a file that a
//! loader cannot represent becomes a [`Note`](lumbre_light::scene::Note); a file that it cannot
//! parse is a [`SceneError`](lumbre_light::scene::SceneError).

pub mod edit;
pub mod export;
pub mod load;
mod model_differences;
pub mod names;
pub mod stage;
pub mod uri;
