//! Figures as SVG. A [`figure::Figure`] holds the data, the module `draw` draws it, and `raster`
//! converts drawings to PNG.

pub(super) mod axis;
pub(super) mod draw;
pub(super) mod figure;
pub(super) mod grid;
pub(super) mod raster;
pub(super) mod sheet;
pub(super) mod sizes;
pub(super) mod style;
pub(super) mod svg;
mod text_outlines;

pub use raster::rasterize;
pub use sheet::files as sheets;
pub use svg::escape;
