// The example of the page renders with `lumbre-render`, which runs it as a test: if this crate's
// tests needed that one, each change here would build it first.
#![cfg_attr(not(doctest), doc = include_str!("front_page.md"))]

pub mod film;
pub mod math;
pub mod prelude;
pub mod scene;
pub mod transport;
pub mod value;
