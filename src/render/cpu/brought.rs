//! What paths that go together hand over.

/// What light is that a sample has brought. All that is for other pixels comes first; then, sample by sample, the parts of
/// what is for its own pixel in the order of its path, and the whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Brought {
    /// All that one path brings to another pixel, whose column and row these are, and the path's optical length.
    Elsewhere([u32; 2], f64),
    /// What one path brings to the sample's own pixel, and its optical length: told only where a film has a time axis.
    Part(f64),
    /// The sum of what all paths bring to the sample's own pixel.
    Whole,
}
