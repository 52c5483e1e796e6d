//! Texture slots: the parameters of a material that a texture can modulate.

crate::named! {
    /// A parameter of a material that a texture can modulate. Its name is that in scripts:
    /// `set = { ["materials.NAME.<name>"] = FILE }`.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
    pub enum TextureSlot {
        /// Multiplies the base colour; sRGB.
        BaseColor = "base_color_texture",
        /// Multiplies the emission; sRGB.
        Emission = "emission_texture",
        /// Discards hits where its red channel is below the mask threshold; linear.
        Mask = "mask_texture",
        /// Replaces the roughness by its red channel; linear.
        Roughness = "roughness_texture",
        /// Replaces the metallic parameter by its red channel; linear.
        Metallic = "metallic_texture",
        /// Replaces the opacity by its red channel; linear.
        Opacity = "opacity_texture",
        /// Direction of anisotropy along u and v: red and green, mapped from 0..=1 to -1..=1;
        /// linear.
        AnisotropicDirection = "anisotropic_direction_texture",
        /// Normal in the MikkTSpace tangent frame, each channel mapped from 0..=1 to -1..=1, green
        /// up; linear.
        Normal = "normal_texture",
        /// Multiplies the delay of a constant profile by its red channel; linear.
        DelayConstant = "delay_constant_texture",
        /// Multiplies the rate of an exponential profile by its red channel; linear.
        DelayRate = "delay_rate_texture",
        /// Multiplies the mean of an Epanechnikov profile by its red channel; linear.
        DelayMean = "delay_mean_texture",
        /// Multiplies the width of an Epanechnikov profile by its red channel; linear.
        DelayWidth = "delay_width_texture",
        /// Height of the surface along its normal: the red channel times the bump height; linear.
        Bump = "bump_texture",
        /// Weight of the second of two parts: the red channel replaces the weights; linear.
        Weights = "weights_texture",
        /// Multiplies the transmittance; sRGB.
        Transmittance = "transmittance_texture",
    }
}

impl TextureSlot {
    /// Returns whether 8-bit texels of this slot are decoded from sRGB; data textures never are.
    pub fn is_srgb(self) -> bool {
        matches!(
            self,
            TextureSlot::BaseColor | TextureSlot::Emission | TextureSlot::Transmittance
        )
    }
}
