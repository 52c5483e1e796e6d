//! Notes about models that differ from those of Mitsuba and pbrt, with the size of the difference,
//! for scenes that are loaded or exported. The sizes for Mitsuba were measured with version 3.9.1,
//! and `lumbre verify --mitsuba` compares pictures with them. Those for pbrt are integrals of the
//! models, as docs/reference/formats.md describes.

use lumbre_light::scene::desc::{Distribution, Formulas, MaterialDesc};

/// Blends of two surfaces of which one has a perfectly smooth lobe.
pub(crate) const SMOOTH_BLEND: &str = "Mitsuba loses light where it blends a perfectly smooth lobe \
                                       with another surface, by up to 25 %";

/// Phong's model, by lobes about the reflected direction.
pub(crate) const PHONG: &str = "lobes of the `phong` model are about the reflected direction; a \
                                Beckmann lobe of the same width near the mirror direction is used, \
                                which is narrower at grazing angles";

/// Ward's model of highlights.
pub(crate) const WARD: &str = "lobes of the `ward` model have no shadowing; a Beckmann lobe of the \
                               same width is used, which is darker at grazing angles";

/// Coatings, as plastics.
pub(crate) const COATING: &str = "light that a coating reflects back inside is lost in Mitsuba; here \
                                  it reaches the surface again, as below a plastic with `nonlinear`";

/// Slopes of bump maps.
pub(crate) const BUMPS: &str = "slopes of height maps are differences over one texel here and \
                                derivatives in Mitsuba: steep maps of few texels differ by up to \
                                7 %";

/// Normals of bump maps that face away from the viewer.
pub(crate) const STEEP_BUMPS: &str = "bent normals that face away are turned in Mitsuba and tilted \
                                      to the front here: steep bump maps differ by up to 1 %";

/// Bump maps whose texels are not interpolated, such as checkerboards.
pub(crate) const STEPPED_BUMPS: &str = "a bump map that is not interpolated has no slopes but at \
                                        the edges of its texels; ignored";

/// Roughness textures whose texels are not alpha.
pub(crate) const ROUGHNESS_TEXELS: &str = "roughness is interpolated between texels here, and its square \
                                           alpha there: textures of few texels differ by up to 3 %";

/// Normals of normal maps that face away from the viewer or the light.
pub(crate) const NORMALS: &str = "bent normals that face away are turned and shadowed in Mitsuba \
                                  (`flip_invalid_normals`, `use_shadowing_function`), but not here: \
                                  steep maps differ by up to 3 %";

/// Returns the note about a rough plastic. The bounds are the greatest losses of a white body with
/// `nonlinear`, at alpha of 0.1, 0.3 and 0.6.
pub(crate) fn rough_plastic(distribution: Distribution, alpha: f32) -> String {
    let lost = match distribution {
        Distribution::Ggx => (1.2 * alpha).min(0.9),
        Distribution::Beckmann => 0.56 * alpha,
    };
    format!(
        "Mitsuba's rough plastic loses light in its body, by up to {:.0} % at this roughness; here \
         it loses none",
        (100.0 * lost).ceil()
    )
}

/// Returns the notes about the lobes of a `principled` surface. The bounds are those of the mean
/// over a sphere under an environment and an area light.
pub(crate) fn principled(m: &MaterialDesc) -> Vec<String> {
    let rows = [
        (m.clearcoat, 9.0, "a clear coat darkens the lobes below it"),
        (
            m.specular_tint,
            3.0,
            "the tint of the specular lobe fades with the exact reflectance",
        ),
    ];
    rows.into_iter()
        .filter(|(amount, ..)| *amount > 0.0 && m.formulas == Formulas::Lumbre)
        .map(|(amount, most, difference)| {
            let size = (most * amount).ceil();
            format!("{difference}, but not in Mitsuba: a difference of up to {size:.0} %")
        })
        .collect()
}

/// Slopes of pbrt's displacement textures.
pub(crate) const PBRT_BUMPS: &str = "slopes of height maps are differences over one texel here and \
                                     over half a pixel in pbrt: steep maps of few texels differ";

/// Rough diffuse surfaces.
pub(crate) const ROUGH_DIFFUSE: &str = "light that goes from facet to facet of a rough diffuse surface is left out, as with \
     `useFastApprox`";

/// Diffuse surfaces with roughness, in formats without them.
pub(crate) const SMOOTH_DIFFUSE: &str = "a rough diffuse surface is not supported there; a smooth \
                                         one is written, which is brighter straight on";

/// A coat over a conductor.
pub(crate) const COATED_CONDUCTOR: &str = "a coated conductor is the conductor alone here, with \
     its index relative to the coat: by 1 to 4 % brighter if both are smooth, by up to 30 % if the \
     conductor has an alpha of 0.3, and by up to 65 % if both have, where pbrt loses light";

/// The plastic of version 3 of pbrt.
pub(crate) const PBRT_PLASTIC: &str = "the diffuse part is lit through the interface here and \
     added to its reflection in pbrt: by 4 % darker at normal incidence, by 9 % under even light";

/// The substrate of version 3 of pbrt.
pub(crate) const PBRT_SUBSTRATE: &str = "the diffuse part is lit through an interface here and by \
     the formula of Ashikhmin and Shirley in pbrt: for `Ks` of 0.04 by 3 % brighter at normal \
     incidence, by 15 % under even light";

/// Spot lights of version 4 of pbrt.
pub(crate) const PBRT_SPOT: &str = "the falloff of the cone is linear in the angle here and smooth \
                                    in the cosine in pbrt: a difference of up to 17 % of the \
                                    intensity at the edge, and up to 8 % less light if the edge \
                                    is wide";

/// Spot lights of version 3 of pbrt.
pub(crate) const PBRT3_SPOT: &str = "the falloff of the cone is a square here and a fourth power \
                                     in pbrt: the light is the same in all, but differs by up to \
                                     31 % of the intensity at the edge";

/// Spot lights whose falloff is a square, in version 4 of pbrt.
pub(crate) const PBRT_SMOOTH_SPOT: &str = "the falloff of the cone is a square here and smooth in \
                                           pbrt: a difference of up to 25 % of the intensity at \
                                           the edge";

/// Images of projection lights in pbrt.
pub(crate) const PBRT_PROJECTION: &str = "the image is interpolated between its pixels here, and not \
                                          in version 4 of pbrt";

/// Coloured maps of goniometric lights in version 4 of pbrt.
pub(crate) const PBRT_GONIOMETRIC_COLOR: &str = "pbrt replaces the colours of the map of a \
                                                 goniometric light by the mean of red, green and \
                                                 blue";

/// Environment maps of version 4 of pbrt.
pub(crate) const EQUAL_AREA: &str = "the map of equal areas is resampled to longitude and \
                                     latitude: edges of texels are blurred";

/// Alpha of a coat over a diffuse surface of reflectance 0.5 or 1, and by how many percent it
/// reflects more here than in pbrt.
const COATED_DIFFUSE: [[f32; 3]; 5] = [
    [0.0, 0.1, 7.4],
    [0.1, 1.7, 13.0],
    [0.3, 10.5, 41.6],
    [0.6, 32.7, 98.2],
    [1.0, 71.7, 181.7],
];

/// Returns the note about a diffuse surface under a coat of index 1.5.
pub(crate) fn coated_diffuse(alpha: f32) -> String {
    let after = COATED_DIFFUSE.iter().position(|row| row[0] >= alpha);
    let after = after.unwrap_or(COATED_DIFFUSE.len() - 1).max(1);
    let (a, b) = (COATED_DIFFUSE[after - 1], COATED_DIFFUSE[after]);
    let t = ((alpha - a[0]) / (b[0] - a[0])).clamp(0.0, 1.0);
    let [half, white] = [1, 2].map(|i| (a[i] + (b[i] - a[i]) * t).ceil());
    format!(
        "pbrt loses light between the layers of a coated surface, here none is lost: under even \
         light by {half} % brighter at this roughness for a reflectance of 0.5, by {white} % for 1"
    )
}
