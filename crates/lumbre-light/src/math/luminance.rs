//! Relative luminance of linear sRGB, and luma of its display values [IEC 61966-2-1].

use glam::Vec3;

/// Weights of red, green and blue.
pub const WEIGHTS: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// [`WEIGHTS`] in single precision.
pub const WEIGHTS_F32: [f32; 3] = [WEIGHTS[0] as f32, WEIGHTS[1] as f32, WEIGHTS[2] as f32];

/// Returns the luminance of a colour.
pub fn luminance([r, g, b]: [f64; 3]) -> f64 {
    WEIGHTS[0] * r + WEIGHTS[1] * g + WEIGHTS[2] * b
}

/// Returns the luminance of a vector of red, green and blue.
pub fn luminance_of(color: Vec3) -> f64 {
    luminance(color.as_dvec3().to_array())
}

/// Returns the luminance of a colour in single precision.
pub fn luminance_f32([r, g, b]: [f32; 3]) -> f32 {
    WEIGHTS_F32[0] * r + WEIGHTS_F32[1] * g + WEIGHTS_F32[2] * b
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_has_a_luminance_of_one_in_both_precisions() {
        assert!((luminance([1.0; 3]) - 1.0).abs() < 1e-15);
        assert!((luminance_f32([1.0; 3]) - 1.0).abs() < 1e-7);
        // The literals in single precision, as shaders write them.
        assert_eq!(WEIGHTS_F32, [0.2126_f32, 0.7152, 0.0722]);
    }
}
