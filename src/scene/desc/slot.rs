//! The places where a material may have a texture.

/// The places where a material may have a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum TextureSlot {
    /// Multiplies the base colour; sRGB.
    BaseColor,
    /// Multiplies the emission; sRGB.
    Emission,
    /// Hits where its red channel is below the mask threshold are discarded; linear.
    Mask,
    /// Its red channel replaces the roughness; linear.
    Roughness,
    /// Its red channel replaces the metallic parameter; linear.
    Metallic,
    /// Its red channel replaces the opacity; linear.
    Opacity,
    /// Red and green, moved from 0..=1 to -1..=1, are the direction of anisotropy along u and v; linear.
    AnisotropicDirection,
    /// A normal in the tangent frame of MikkTSpace, each channel moved from 0..=1 to -1..=1, green up; linear.
    Normal,
    /// Its red channel multiplies the delay of a constant profile; linear.
    DelayConstant,
    /// Its red channel multiplies the rate of an exponential profile; linear.
    DelayRate,
    /// Its red channel multiplies the mean of an Epanechnikov profile; linear.
    DelayMean,
    /// Its red channel multiplies the width of an Epanechnikov profile; linear.
    DelayWidth,
    /// Its red channel, times the bump height, is how far the surface stands out along its normal; linear.
    Bump,
}

impl TextureSlot {
    /// Every slot, in order.
    pub const ALL: [TextureSlot; 13] = [
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
    ];

    /// Name in scripts: `set = { ["materials.NAME.<name>"] = FILE }`.
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
        }
    }

    /// The slot with this name in scripts.
    pub fn from_name(name: &str) -> Option<TextureSlot> {
        TextureSlot::ALL.into_iter().find(|slot| slot.name() == name)
    }

    /// Whether eight-bit texels of this role are decoded from sRGB; data textures never are.
    pub fn is_srgb(self) -> bool {
        matches!(self, TextureSlot::BaseColor | TextureSlot::Emission)
    }
}
