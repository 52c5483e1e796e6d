//! Tone maps: from linear radiance to display values in 0..=1.

/// A named tone map with its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tonemap {
    /// `clamp(2^exposure * x)` with the sRGB transfer curve.
    Srgb {
        /// Stops.
        exposure: f32,
    },
    /// `y = 2^exposure * x; (y / (1 + y))^(1/gamma)` per channel [Reinhard 2002].
    Reinhard {
        /// Stops.
        exposure: f32,
        /// Display gamma.
        gamma: f32,
    },
}
