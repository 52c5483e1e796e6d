//! Textures as the integrators read them.

/// A texture in linear colour.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Linear texels, `[y][x][rgb]`, origin top-left.
    pub texels: Vec<[f32; 3]>,
}
