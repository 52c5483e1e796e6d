//! Roughness of interfaces.

use std::sync::Arc;

use super::MaterialReader;
use crate::load::composed::TextureValue;
use crate::load::pbrt::version::Version;
use lumbre_light::scene::SceneError;
use lumbre_light::scene::desc::{RoughnessTexels, Texels, TextureDesc, TextureSlot};

/// Alpha below which pbrt's interfaces are perfectly smooth.
const SMOOTH_ALPHA: f32 = 1e-3;

/// Greatest ratio of the two alphas here.
const MAX_ASPECT: f32 = 10.0;

/// Returns alpha for a roughness: the square root in version 4; in version 3 a polynomial of the
/// logarithm, `TrowbridgeReitzDistribution::RoughnessToAlpha`.
pub(super) fn remapped(roughness: f32, version: Version) -> f32 {
    match version {
        Version::V4 => roughness.max(0.0).sqrt(),
        Version::V3 => {
            let x = roughness.max(1e-3).ln();
            let terms = [0.000_640_711, 0.017_120_1, 0.173_4, 0.819_955, 1.621_42];
            terms.into_iter().fold(0.0, |sum, term| sum * x + term)
        }
    }
}

impl MaterialReader<'_> {
    /// Reads `roughness`, or `uroughness` and `vroughness`, after a prefix.
    pub(super) fn rough(&mut self, prefix: &str, default: f32) -> Result<(), SceneError> {
        let version = self.source.spectra.version;
        let remap = self.params().flag("remaproughness", true)?;
        let both = format!("{prefix}roughness");
        let mut values = Vec::new();
        for axis in ["u", "v"] {
            let own = format!("{prefix}{axis}roughness");
            let has_own = self.params().get(&own).is_some();
            values.push(self.value(if has_own { &own } else { &both }, false, default)?);
        }
        self.params().get(&both);
        // Glass of version 3 is smooth at zero, its other interfaces are not.
        let smooth = version == Version::V3 && self.source.class == "glass";
        let to_alpha = move |x: f32| {
            let kept = !remap || (smooth && x == 0.0);
            let alpha = if kept { x } else { remapped(x, version) };
            alpha.clamp(0.0, 1.0)
        };
        if let Some(i) = values
            .iter()
            .position(|v| matches!(v, TextureValue::Image(_)))
        {
            if self.params().get(&format!("{prefix}uroughness")).is_some() {
                self.note("a texture of roughness is used for both axes");
            }
            let TextureValue::Image(image) = values.swap_remove(i) else {
                return Ok(());
            };
            let how = format!("roughness {remap} {version:?}");
            let image = self.mapped(image, &how, to_alpha)?;
            self.m.roughness_texels = RoughnessTexels::Alpha;
            image.apply_to(&mut self.m, TextureSlot::Roughness);
            return Ok(());
        }
        let alpha = values.iter().map(|v| match v {
            TextureValue::Constant(c) => to_alpha(c.x),
            TextureValue::Image(_) => 0.0,
        });
        let alpha: Vec<f32> = alpha.collect();
        self.set_alpha([alpha[0], alpha[1]]);
        Ok(())
    }

    /// Sets roughness and anisotropy from alpha along u and v.
    fn set_alpha(&mut self, [u, v]: [f32; 2]) {
        if u.max(v) < SMOOTH_ALPHA {
            self.m.roughness = 0.0;
            return;
        }
        let (most, least) = (u.max(v), u.min(v).max(1e-4));
        let kept = least.max(most / MAX_ASPECT);
        if kept > least {
            self.note(format!(
                "the roughness of the two axes has a ratio of more than {MAX_ASPECT} as alpha; it \
                 is clamped"
            ));
        }
        self.m.roughness = (most * kept).sqrt().sqrt().min(1.0);
        self.m.anisotropic = ((1.0 - kept / most) / 0.9).clamp(0.0, 1.0);
        if v > u && self.m.anisotropic > 0.0 {
            // Stretches highlights along v.
            let along_v = Texels::RgbaF32(vec![[0.5, 1.0, 0.5, 1.0]]);
            let texture = Arc::new(TextureDesc::new("", 1, 1, along_v));
            self.m
                .set_texture(TextureSlot::AnisotropicDirection, Some(texture));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roughness_is_remapped_by_version() {
        assert_eq!(remapped(0.25, Version::V4), 0.5);
        // The polynomial at 1 is its constant, at 0.1 by hand.
        assert!((remapped(1.0, Version::V3) - 1.62142).abs() < 1e-5);
        let x = 0.1f32.ln();
        let by_hand = 1.62142
            + 0.819955 * x
            + 0.1734 * x * x
            + 0.0171201 * x * x * x
            + 0.000640711 * x * x * x * x;
        assert!((remapped(0.1, Version::V3) - by_hand).abs() < 1e-5);
        assert!((by_hand - 0.4618).abs() < 1e-3, "{by_hand}");
    }
}
