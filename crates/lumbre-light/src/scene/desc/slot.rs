//! Texture slots: the parameters of a material that a texture can modulate.

/// A parameter of a material that a texture can modulate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum TextureSlot {
    /// Multiplies the base colour; sRGB.
    BaseColor,
    /// Multiplies the emission; sRGB.
    Emission,
    /// Discards hits where its red channel is below the mask threshold; linear.
    Mask,
    /// Replaces the roughness by its red channel; linear.
    Roughness,
    /// Replaces the metallic parameter by its red channel; linear.
    Metallic,
    /// Replaces the opacity by its red channel; linear.
    Opacity,
    /// Direction of anisotropy along u and v: red and green, mapped from 0..=1 to -1..=1; linear.
    AnisotropicDirection,
    /// Normal in the MikkTSpace tangent frame, each channel mapped from 0..=1 to -1..=1, green up;
    /// linear.
    Normal,
    /// Multiplies the delay of a constant profile by its red channel; linear.
    DelayConstant,
    /// Multiplies the rate of an exponential profile by its red channel; linear.
    DelayRate,
    /// Multiplies the mean of an Epanechnikov profile by its red channel; linear.
    DelayMean,
    /// Multiplies the width of an Epanechnikov profile by its red channel; linear.
    DelayWidth,
    /// Height of the surface along its normal: the red channel times the bump height; linear.
    Bump,
    /// Weight of the second of two parts: the red channel replaces the weights; linear.
    Weights,
    /// Multiplies the transmittance; sRGB.
    Transmittance,
}

impl TextureSlot {
    /// Every slot, in declaration order.
    pub const ALL: [TextureSlot; 15] = [
        TextureSlot::BaseColor,
        TextureSlot::Emission,
        TextureSlot::Mask,
        TextureSlot::Roughness,
        TextureSlot::Metallic,
        TextureSlot::Opacity,
        TextureSlot::AnisotropicDirection,
        TextureSlot::Normal,
        TextureSlot::DelayConstant,
        TextureSlot::DelayRate,
        TextureSlot::DelayMean,
        TextureSlot::DelayWidth,
        TextureSlot::Bump,
        TextureSlot::Weights,
        TextureSlot::Transmittance,
    ];

    /// Returns the slot's name in scripts: `set = { ["materials.NAME.<name>"] = FILE }`.
    pub fn name(self) -> &'static str {
        match self {
            TextureSlot::BaseColor => "base_color_texture",
            TextureSlot::Emission => "emission_texture",
            TextureSlot::Mask => "mask_texture",
            TextureSlot::Roughness => "roughness_texture",
            TextureSlot::Metallic => "metallic_texture",
            TextureSlot::Opacity => "opacity_texture",
            TextureSlot::AnisotropicDirection => "anisotropic_direction_texture",
            TextureSlot::Normal => "normal_texture",
            TextureSlot::DelayConstant => "delay_constant_texture",
            TextureSlot::DelayRate => "delay_rate_texture",
            TextureSlot::DelayMean => "delay_mean_texture",
            TextureSlot::DelayWidth => "delay_width_texture",
            TextureSlot::Bump => "bump_texture",
            TextureSlot::Weights => "weights_texture",
            TextureSlot::Transmittance => "transmittance_texture",
        }
    }

    /// Returns the slot with this name in scripts.
    pub fn from_name(name: &str) -> Option<TextureSlot> {
        TextureSlot::ALL
            .into_iter()
            .find(|slot| slot.name() == name)
    }

    /// Returns whether 8-bit texels of this slot are decoded from sRGB; data textures never are.
    pub fn is_srgb(self) -> bool {
        matches!(
            self,
            TextureSlot::BaseColor | TextureSlot::Emission | TextureSlot::Transmittance
        )
    }
}
