//! Notes about models that differ from those of Mitsuba, with the size of the difference, for scenes
//! that are loaded or exported. The sizes were measured with Mitsuba 3.9.1, and `lumbre verify
//! --mitsuba` compares pictures with them.

use super::desc::{Distribution, MaterialDesc};

/// Blends of two surfaces of which one has a perfectly smooth lobe.
pub(super) const SMOOTH_BLEND: &str = "Mitsuba loses light where it blends a perfectly smooth lobe \
                                       with another surface, by up to 25 %";

/// Slopes of bump maps.
pub(super) const BUMPS: &str = "slopes of height maps are differences over one texel here and \
                                derivatives in Mitsuba: steep maps of few texels differ by up to 7 %";

/// Normals of normal maps that face away from the viewer or the light.
pub(super) const NORMALS: &str = "bent normals that face away are turned and shadowed in Mitsuba \
                                  (`flip_invalid_normals`, `use_shadowing_function`), but not here: \
                                  steep maps differ by up to 3 %";

/// Returns the note about a rough plastic. The bounds are the greatest losses of a white body with
/// `nonlinear`, at alpha of 0.1, 0.3 and 0.6.
pub(super) fn rough_plastic(distribution: Distribution, alpha: f32) -> String {
    let lost = match distribution {
        Distribution::Ggx => (1.2 * alpha).min(0.9),
        Distribution::Beckmann => 0.56 * alpha,
    };
    format!(
        "Mitsuba's rough plastic loses light in its body, by up to {:.0} % at this roughness; here it \
         loses none",
        (100.0 * lost).ceil()
    )
}

/// Returns the notes about the lobes of a `principled` surface. The bounds are those of the mean over
/// a sphere under an environment and an area light.
pub(super) fn principled(m: &MaterialDesc) -> Vec<String> {
    let rows = [
        (m.clearcoat, 9.0, "a clear coat darkens the lobes below it"),
        (
            m.specular_tint,
            3.0,
            "the tint of the specular lobe fades with the exact reflectance",
        ),
    ];
    rows.into_iter()
        .filter(|(amount, ..)| *amount > 0.0)
        .map(|(amount, most, difference)| {
            let size = (most * amount).ceil();
            format!("{difference}, but not in Mitsuba: a difference of up to {size:.0} %")
        })
        .collect()
}
